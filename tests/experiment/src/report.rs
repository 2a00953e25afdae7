//! The report of a run: a page, its pictures and all tables as CSV.

use std::{
    fmt::Write as _,
    fs, io,
    path::{Path, PathBuf},
};

use crate::{
    claims::{self, Claim, Verdict, claims},
    data::Data,
    figures::{Figure, figures},
    folder::Folder,
    make::Maker,
    plan::{Set, Settings},
    plot::figure,
    sheet::comfort_sheet,
    table::{Table, with_separators},
    tables,
    types::{SetTypes, set_types, unclassifiable_in_words},
};

const PAGE: &str = "README.md";
const SHEET: &str = "comfort.png";
const CSV_FOLDER: &str = "csv";

/// A written report.
#[derive(Clone, Debug)]
pub struct Report {
    /// The page.
    pub page: PathBuf,
    /// Attempts and time per valid grasp.
    pub ladder: Table,
    /// The claims of chapter 5 with the run's results.
    pub claims: Vec<Claim>,
}

/// A file of the report cannot be written.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {}", path.display())]
pub struct ReportError {
    /// The file.
    pub path: PathBuf,
    /// Why.
    pub source: io::Error,
}

/// Writes the report of a folder's records: the page with its pictures and tables to `target`, and the lists of all
/// grasps and attempts to the folder itself.
///
/// # Errors
/// A file cannot be written.
pub fn write(
    settings: &Settings,
    folder: &Folder,
    maker: &Maker,
    target: &Path,
) -> Result<Report, ReportError> {
    let data = Data::new(settings, folder.records());
    for list in [tables::grasp_list(&data), tables::attempt_list(&data)] {
        write_file(
            &folder.path().join(format!("{}.csv", list.file)),
            list.to_csv().as_bytes(),
        )?;
    }
    let types = set_types(&data, maker);
    let claims = claims(&data, &types);
    let ladder = tables::ladder(&data);
    let sections = sections(&data, &claims, &ladder, &types);
    for table in sections.iter().flat_map(|section| &section.tables) {
        let path = target.join(CSV_FOLDER).join(format!("{}.csv", table.file));
        write_file(&path, table.to_csv().as_bytes())?;
    }
    for drawn in sections.iter().flat_map(|section| &section.figures) {
        let svg = figure(drawn.title, &drawn.panels, drawn.columns);
        write_file(&target.join(format!("{}.svg", drawn.file)), svg.as_bytes())?;
    }
    // The thesis asks this (6.1).
    let sheet_set = data.ladder().last().map(Set::ladder).or(data.sets().last());
    let sheet = sheet_set.and_then(|set| Some((set, comfort_sheet(&data, maker, set)?)));
    if let Some((_, image)) = &sheet {
        write_file(&target.join(SHEET), &image.to_png())?;
    }
    let page = target.join(PAGE);
    let text = page_text(&data, folder, &sections, sheet.map(|(set, _)| set));
    write_file(&page, text.as_bytes())?;
    Ok(Report { page, ladder, claims })
}

fn write_file(path: &Path, bytes: &[u8]) -> Result<(), ReportError> {
    let parent = path.parent().unwrap_or(Path::new(""));
    fs::create_dir_all(parent)
        .and_then(|()| fs::write(path, bytes))
        .map_err(|source| ReportError {
            path: path.to_owned(),
            source,
        })
}

/// A section of the page.
struct Section {
    title: &'static str,
    text: String,
    figures: Vec<Figure>,
    tables: Vec<Table>,
}

impl Section {
    /// A section without figures.
    fn new(title: &'static str, text: impl Into<String>, tables: Vec<Table>) -> Self {
        Self {
            title,
            text: text.into(),
            figures: Vec::new(),
            tables,
        }
    }
}

/// The sections of the page. Figures go to the section with the table they are drawn from.
fn sections(data: &Data<'_>, claims: &[Claim], ladder: &Table, types: &[SetTypes]) -> Vec<Section> {
    let mut sections = vec![
        Section::new(
            "The ladder",
            "Means over the holdouts, of which each counts the same. An attempt is one accepted placement, as \
             the thesis counts; placements that the measures pruned before it stand beside it. Times are \
             wall-clock times of whole searches. ± is half of a 95 % interval."
                .to_owned()
                + &beyond_the_ladder(data),
            vec![ladder.clone(), tables::per_holdout(data)],
        ),
        Section::new(
            "The atlas",
            "Answers of set Atlas on one thread. No attempt is run where a grip of the atlas is valid; the first \
             that is ends the search, so that there is one candidate, and an answer from the atlas is the same grip \
             every time. The atlases were complete before the first search. Failed attempts are those of Physical.",
            vec![tables::atlas_answers(data)],
        ),
        Section::new(
            "What chapter 5 says",
            "\"In part\" means: in the same direction, but not of the same size.",
            vec![claims::table(claims)],
        ),
        Section::new(
            "How attempts end",
            "The negative sets are the first failed attempts of each holdout, as in the thesis. \"% of all\" is \
             the share in all failed attempts that the searches made.",
            vec![tables::output_types(data)],
        ),
        Section::new(
            "What the steps take",
            "Each attempt of the positive and negative sets was replayed alone; a step's time is the median of \
             the replays, with one reading of the clock in it and everything already in the processor's caches. \
             Wrist Placement includes the pruned placements.",
            vec![tables::step_times(data), tables::step_totals(data)],
        ),
        Section::new(
            "Wrist placement",
            "Of failed attempts the plots show at most as many as the thesis had; the CSV has all.",
            vec![tables::measure_ranges(data), tables::palm_angle_bins(data)],
        ),
        Section::new(
            "Finger posing",
            "Lost contacts: wrist and yaw of every valid grasp of set C are kept, and each touching digit \
             closes with another bend ratio alone.",
            vec![
                tables::yaw_spread(data),
                tables::bend_angles(data),
                tables::ratio_counts(data),
                tables::lost_contacts(data),
                tables::columns(data),
                tables::columns_per_holdout(data),
            ],
        ),
        Section::new(
            "Contacts, forces and comfort",
            "\"Valid again\" is how often Immobility Validation passes when it is repeated for the same contacts. \
             \"By the draw\" is the share of E's variance that stays when the grasp is kept and only the random \
             force distributions are drawn anew: E cannot tell grasps apart by that share.",
            vec![tables::contact_counts(data), tables::comfort_spread(data)],
        ),
        Section::new(
            "Grasp types",
            format!(
                "Each valid grasp on one thread is made again and classified by pose and contacts alone. A grasp that is \
                 like no type of the taxonomy counts as unnatural, as in the thesis. Means over the holdouts; ± is half of \
                 a 95 % interval. {}",
                unclassifiable_in_words(types)
            ),
            vec![tables::unclassifiable(types), tables::grasp_types(types)],
        ),
    ];
    for figure in figures(data) {
        let owner = match figure.data {
            "attempts" if figure.file.ends_with("15") => "yaw",
            "attempts" => "measures",
            table => table,
        };
        let section = sections
            .iter_mut()
            .find(|section| section.tables.iter().any(|table| table.file == owner));
        if let Some(section) = section {
            section.figures.push(figure);
        }
    }
    for section in &mut sections {
        section.tables.retain(|table| !table.rows.is_empty());
    }
    sections.retain(|section| !section.tables.is_empty());
    sections
}

/// Notes on the sets beyond A to F.
fn beyond_the_ladder(data: &Data<'_>) -> String {
    if data.sets().all(Set::is_ladder) {
        return String::new();
    }
    let mut text = " Guided looks for the same grasps as A to F, but places hands where opposed surfaces suggest it; an \
                    attempt that finds no room for a hand counts as NoContacts. \
                    Physical and Atlas are searches for the grasps that a server gives by default: another rig \
                    (`adult`), hands as solids, forces solved for. What is valid differs, so that they compare with each \
                    other and not with the others. Physical finds its grasps afresh; Atlas tries the grips of the \
                    object's complete atlas first."
        .to_owned();
    for set in data.sets() {
        let names = data.given_up(set);
        if !names.is_empty() {
            let _ = write!(
                text,
                " {} found no grasp in {} attempts for {}: left out of its means.",
                set.name(),
                with_separators(&set.most_attempts().to_string()),
                names.join(", ")
            );
        }
    }
    text
}

fn page_text(data: &Data<'_>, folder: &Folder, sections: &[Section], sheet: Option<Set>) -> String {
    let settings = data.settings;
    let mut text = String::from("# Chapter 5, made again\n\n");
    let sets: Vec<_> = data.sets().map(Set::name).collect();
    let _ = writeln!(
        text,
        "Made by `{}`: grasp sets {} over {} holdouts, {} valid grasps and {} invalid attempts each; seed {}. In sets A to \
         F and Guided, as valid counts what the thesis prints, for the rig `{}`. Measured on {}; reading the clock takes \
         {} ns. `grasps.csv` and `attempts.csv` in the run's folder list every grasp and attempt with its seed and index: \
         `grasp find --holdout H --validity V --strategy S --bend-ratios R --seed N --replay-attempt I --receiving-hand right` \
         makes it again.",
        command_line(settings),
        sets.join(", "),
        settings.holdouts.len(),
        settings.valid,
        settings.invalid,
        folder.manifest.seed,
        folder.manifest.rig,
        folder.manifest.machine,
        folder.manifest.machine.clock_nanoseconds,
    );
    for section in sections {
        let _ = write!(text, "\n## {}\n\n{}\n", section.title, section.text);
        for figure in &section.figures {
            let _ = write!(text, "\n![{}]({}.svg)\n", figure.title, figure.file);
        }
        for table in &section.tables {
            let _ = write!(
                text,
                "\n**{}** ([CSV]({CSV_FOLDER}/{}.csv))\n\n{}",
                table.title,
                table.file,
                table.to_markdown()
            );
        }
    }
    if let Some(set) = sheet {
        let _ = write!(
            text,
            "\n## Valid grasps in the order of comfort E\n\nGrasp set {}, object by object, row by row from the most \
             comfortable to the least, spread evenly over the ranks.\n\n![Valid grasps ordered by comfort]({SHEET})\n",
            set.name()
        );
    }
    text
}

/// The command line of a run, without default values.
pub fn command_line(settings: &Settings) -> String {
    let usual = Settings::default();
    let mut text = "grasp experiment".to_owned();
    if settings.sets != usual.sets {
        for set in &settings.sets {
            let _ = write!(text, " --set {}", set.name());
        }
    }
    if settings.holdouts != usual.holdouts {
        for &holdout in &settings.holdouts {
            let _ = write!(
                text,
                " --holdout {}",
                grasp_assets::holdouts::holdouts()[holdout].name
            );
        }
    }
    for (name, value, usual) in [
        ("valid", settings.valid, usual.valid),
        ("invalid", settings.invalid, usual.invalid),
        ("seed", settings.seed, usual.seed),
    ] {
        if value != usual {
            let _ = write!(text, " --{name} {value}");
        }
    }
    if settings.threads != usual.threads {
        let _ = write!(
            text,
            " --threads {}",
            settings.threads.last().copied().unwrap_or(1)
        );
    }
    if !settings.bend_ratio_columns {
        text.push_str(" --no-bend-ratio-columns");
    }
    text
}

/// "17 agree, 4 in part, 3 differ".
pub fn verdicts_at_a_glance(claims: &[Claim]) -> String {
    format!(
        "{} agree, {} in part, {} differ",
        claims::count(claims, Verdict::Agrees),
        claims::count(claims, Verdict::InPart),
        claims::count(claims, Verdict::Differs)
    )
}
