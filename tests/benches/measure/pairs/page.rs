//! A page of pairs, and a sheet of some of them.

use std::{collections::BTreeMap, fmt::Write as _, fs, io, path::Path};

use grasp_scene::{Image, contact_sheet, side_by_side};
use grasp_tests::pairs::{pairing::Pair, reasons::Reason};
use rayon::prelude::*;

use crate::pairs::{
    picture::{GREEN, RED, framed, picture},
    table,
};

/// Pairs on the sheet, and in a row of it.
const ON_SHEET: usize = 24;
const COLUMNS: usize = 3;

/// Objects are shown in the order of their multiples of the first number, modulo the second, a prime.
const STRIDE: usize = 11;
const WHEEL: usize = 37;

/// What the page looks like.
const STYLE: &str = "body{font:15px/1.4 sans-serif;margin:24px;background:#fafafa;color:#222}\
main{display:flex;flex-wrap:wrap;gap:16px}\
figure{margin:0;padding:8px;background:#fff;border:1px solid #ddd}\
figure.wrong{background:#fff0d8;border-color:#c80}\
img{width:260px;vertical-align:top}\
.plausible{border:4px solid #2e8b46}.implausible{border:4px solid #c03028}\
td,th{padding:2px 12px;text-align:right}td:first-child,th:first-child{text-align:left}";

/// Up to `most` pairs: those ranked wrong, then others, one of each reason in turn. Some are ranked right.
pub(crate) fn chosen<'a>(pairs: &'a [Pair<'a>], most: usize) -> Vec<&'a Pair<'a>> {
    let mut wrong: Vec<&Pair<'_>> = pairs.iter().filter(|pair| !pair.is_right()).collect();
    wrong.sort_by(|a, b| a.margin().total_cmp(&b.margin()));
    wrong.truncate(most - (ON_SHEET / 2).min(most / 2));
    let right: Vec<&Pair<'_>> = pairs.iter().filter(|pair| pair.is_right()).collect();
    wrong.into_iter().chain(in_turn(&right)).take(most).collect()
}

/// The pairs of all reasons by turns, those of a reason from one object after the other.
fn in_turn<'a>(pairs: &[&'a Pair<'a>]) -> Vec<&'a Pair<'a>> {
    let mut used: BTreeMap<(Reason, usize), usize> = BTreeMap::new();
    let mut turns: Vec<_> = pairs
        .iter()
        .map(|&pair| {
            let Pair { reason, gathered, .. } = *pair;
            let round = used.entry((reason, gathered.object)).or_default();
            *round += 1;
            // Each reason begins with other objects.
            let place = (gathered.object * STRIDE + reason as usize * STRIDE * STRIDE) % WHEEL;
            (*round, place, reason, pair)
        })
        .collect();
    turns.sort_by_key(|&(round, place, reason, _)| (reason, round, place));
    let mut places: BTreeMap<Reason, usize> = BTreeMap::new();
    let mut in_turn: Vec<_> = turns
        .into_iter()
        .map(|(.., reason, pair)| {
            let place = places.entry(reason).or_default();
            *place += 1;
            (*place, reason, pair)
        })
        .collect();
    in_turn.sort_by_key(|&(place, reason, _)| (place, reason));
    in_turn.into_iter().map(|(.., pair)| pair).collect()
}

/// Writes `index.html`, the pictures of the chosen pairs and `pairs.png` into a folder. Calls `drawn` for each picture.
pub(crate) fn write(
    folder: &Path,
    all: &[Pair<'_>],
    chosen: &[&Pair<'_>],
    drawn: impl Fn() + Sync,
) -> io::Result<()> {
    if folder.exists() {
        fs::remove_dir_all(folder)?;
    }
    fs::create_dir_all(folder)?;
    let mut grasps: Vec<(String, &Pair<'_>, usize)> = chosen
        .iter()
        .flat_map(|pair| [pair.plausible, pair.implausible].map(|number| (file(pair, number), *pair, number)))
        .collect();
    grasps.sort_by(|(a, ..), (b, ..)| a.cmp(b));
    grasps.dedup_by(|(a, ..), (b, ..)| a == b);
    let pictures: BTreeMap<String, Image> = grasps
        .into_par_iter()
        .map(|(file, pair, number)| {
            let picture = picture(pair.gathered, number);
            drawn();
            (file, picture)
        })
        .collect();
    for (file, picture) in &pictures {
        fs::write(folder.join(file), picture.to_png())?;
    }
    let on_sheet: Vec<(Image, String)> = for_sheet(chosen)
        .into_iter()
        .map(|pair| {
            let [plausible, implausible] = [(pair.plausible, GREEN), (pair.implausible, RED)]
                .map(|(number, colour)| framed(&pictures[&file(pair, number)], colour));
            (side_by_side(&plausible, &implausible), caption(pair))
        })
        .collect();
    if let Some(sheet) = contact_sheet(&on_sheet, COLUMNS) {
        fs::write(folder.join("pairs.png"), sheet.to_png())?;
    }
    fs::write(folder.join("index.html"), html(all, chosen))
}

/// Pairs for the sheet, of all reasons and many objects.
fn for_sheet<'a>(chosen: &[&'a Pair<'a>]) -> Vec<&'a Pair<'a>> {
    let (wrong, right): (Vec<_>, Vec<_>) = chosen.iter().partition(|pair| !pair.is_right());
    let wrong = in_turn(&wrong).into_iter().take(ON_SHEET / 2);
    wrong.chain(in_turn(&right)).take(ON_SHEET).collect()
}

/// The name of a grasp's picture.
fn file(pair: &Pair<'_>, number: usize) -> String {
    let gathered = pair.gathered;
    format!("{}-{}-{number}.png", gathered.offer.object.name, gathered.number)
}

fn caption(pair: &Pair<'_>) -> String {
    let [plausible, implausible] = pair.totals();
    format!(
        "{}{}: {}  {plausible:.3} {} {implausible:.3}",
        if pair.is_right() { "" } else { "WRONG " },
        pair.gathered.offer.object.name,
        pair.reason.name(),
        if pair.is_right() { '>' } else { '<' },
    )
}

fn html(all: &[Pair<'_>], chosen: &[&Pair<'_>]) -> String {
    let mut text = format!(
        "<!doctype html>\n<html lang=\"en\"><meta charset=\"utf-8\"><title>Pairs of grasps</title><style>{STYLE}</style>\n\
        <h1>Pairs of grasps</h1>\n<p>On the left a grasp that a person would plausibly choose, on the right one that a person \
        would not, and why; beneath, the totals of their scores. Pairs that the score ranks wrong come first.</p>\n\
        <table>{}</table>\n<main>\n",
        table::html_rows(&table::lines(all)),
    );
    for pair in chosen {
        let [plausible, implausible] = pair.totals();
        let _ = writeln!(
            text,
            "<figure{}><img class=\"plausible\" src=\"{}\" alt=\"plausible\"> <img class=\"implausible\" src=\"{}\" \
            alt=\"implausible\"><figcaption>{}, {}, held by {}: {plausible:.3} and {implausible:.3}{}</figcaption></figure>",
            if pair.is_right() { "" } else { " class=\"wrong\"" },
            file(pair, pair.plausible),
            file(pair, pair.implausible),
            pair.gathered.offer.object.name,
            pair.reason.name(),
            pair.gathered.offer.giver,
            if pair.is_right() { "" } else { ", ranked wrong" },
        );
    }
    text.push_str("</main>\n</html>\n");
    text
}
