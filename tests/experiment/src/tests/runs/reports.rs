//! Reports against the lists they are made from.

use std::{collections::BTreeMap, fs, path::Path};

use crate::{
    claims::Verdict,
    plan::{Set, Settings},
    report::{self, Report, command_line},
};
use grasp_synthesis::model::{grasp_type::GraspType, strategy::Strategy};

use super::beyond_ladder;
use crate::tests::fixtures::small_runs::{Scratch, complete, index_of, maker, small};

fn reported(settings: &Settings) -> (Scratch, Report) {
    let scratch = Scratch::new();
    let folder = complete(scratch.path(), settings);
    let maker = maker(settings, &folder);
    let report = report::write(settings, &folder, &maker, &scratch.path().join("report")).expect("a report");
    (scratch, report)
}

/// The rows of a CSV file by column names.
fn csv_rows(path: &Path) -> Vec<BTreeMap<String, String>> {
    let mut reader =
        csv::Reader::from_path(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    reader.deserialize().map(|row| row.expect("a row")).collect()
}

fn number(row: &BTreeMap<String, String>, column: &str) -> f64 {
    row[column]
        .parse()
        .unwrap_or_else(|_| panic!("{column} is {:?}", row[column]))
}

#[test]
fn the_ladder_shows_means_of_the_listed_grasps() {
    let (scratch, _) = reported(&small());
    let grasps = csv_rows(&scratch.path().join("grasps.csv"));
    for row in csv_rows(&scratch.path().join("report/csv/ladder.csv")) {
        let own: Vec<_> = grasps
            .iter()
            .filter(|grasp| {
                grasp["strategy"] == row["set"] && grasp["threads"] == "1" && grasp["bend_ratios"] == "all"
            })
            .collect();
        assert_eq!(own.len(), 6);
        for (column, listed) in [("attempts", "attempts"), ("ms", "milliseconds")] {
            // All holdouts have equally many grasps, so the mean of the means is the mean.
            let mean = own.iter().map(|grasp| number(grasp, listed)).sum::<f64>() / 6.0;
            let reported = number(&row, column);
            assert!(
                (reported / mean - 1.0).abs() < 1e-4,
                "{column}: {reported}, not {mean}"
            );
        }
    }
}

#[test]
fn output_types_count_the_listed_attempts() {
    let (scratch, _) = reported(&small());
    let attempts = csv_rows(&scratch.path().join("attempts.csv"));
    for row in csv_rows(&scratch.path().join("report/csv/output-types.csv")) {
        let own: Vec<_> = attempts
            .iter()
            .filter(|attempt| attempt["strategy"] == row["set"] && attempt["output_type"] != "Valid")
            .collect();
        assert_eq!(own.len(), 40);
        for kind in [
            "NoContacts",
            "NoThumb",
            "NoThumbEarlystop",
            "PalmCollision",
            "NotImmobilizing",
        ] {
            let count = own
                .iter()
                .filter(|attempt| attempt["output_type"] == kind)
                .count();
            assert_eq!(number(&row, kind), count as f64, "{kind} of {}", row["set"]);
        }
    }
}

#[test]
fn the_page_links_only_existing_files() {
    let (scratch, report) = reported(&small());
    let page = fs::read_to_string(&report.page).expect("the page");
    let mut linked = 0;
    for link in page.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
        let bytes = fs::read(scratch.path().join("report").join(link))
            .unwrap_or_else(|error| panic!("{link}: {error}"));
        assert!(!bytes.is_empty(), "{link} is empty");
        match link.rsplit('.').next() {
            Some("svg") => assert!(
                bytes.starts_with(b"<svg") || bytes.starts_with(b"<?xml"),
                "{link}"
            ),
            Some("png") => assert!(bytes.starts_with(b"\x89PNG"), "{link}"),
            Some("csv") => assert!(
                csv::Reader::from_reader(&bytes[..])
                    .records()
                    .all(|row| row.is_ok()),
                "{link}"
            ),
            _ => panic!("{link} is of no known kind"),
        }
        linked += 1;
    }
    assert!(linked > 15, "{linked} links");
    for figure in [
        "figure-5-15",
        "figure-5-17",
        "figure-5-18",
        "figure-5-19",
        "figure-5-20",
    ] {
        assert!(page.contains(figure), "no {figure}");
    }
    // Sets A, B and F are not part of the run.
    for figure in [
        "figure-5-06",
        "figure-5-09",
        "figure-5-10",
        "figure-5-11",
        "figure-5-13",
        "figure-5-22",
    ] {
        assert!(!page.contains(figure), "{figure}");
    }
}

#[test]
fn claims_that_hold_by_construction_agree() {
    let (_scratch, report) = reported(&small());
    let verdict = |part: &str| {
        let claim = report.claims.iter().find(|claim| claim.thesis.contains(part));
        claim.unwrap_or_else(|| panic!("no claim on {part}")).verdict
    };
    assert_eq!(verdict("become NoThumbEarlystop"), Verdict::Agrees);
    // With 0.7 tried first, it cannot be the least used ratio.
    assert_eq!(verdict("touch less often with ratio 0.7"), Verdict::Differs);
}

#[test]
fn claims_about_sets_outside_the_run_are_left_out() {
    let settings = Settings {
        sets: vec![Set::ladder(Strategy::F)],
        bend_ratio_columns: false,
        threads: vec![1],
        valid: 1,
        holdouts: vec![index_of("scissors-hold1")],
        ..small()
    };
    let (_scratch, report) = reported(&settings);
    assert!(!report.claims.is_empty());
    for claim in &report.claims {
        assert!(
            ["5.5", "5.6", "5.6, Figure 5.22", "6.1, open question"].contains(&claim.source),
            "{claim:?}"
        );
    }
}

#[test]
fn the_command_line_reproduces_the_settings() {
    assert_eq!(command_line(&Settings::default()), "grasp experiment");
    let settings = Settings {
        sets: vec![Set::ladder(Strategy::F)],
        threads: vec![1],
        bend_ratio_columns: false,
        ..small()
    };
    assert_eq!(
        command_line(&settings),
        "grasp experiment --set F --holdout scalpel-hold2 --holdout scissors-hold1 --valid 3 --invalid 20 --seed 7 \
         --threads 1 --no-bend-ratio-columns"
    );
}

#[test]
fn sets_beyond_the_ladder_are_reported_along_with_it() {
    let settings = beyond_ladder::settings();
    let scratch = beyond_ladder::with_atlas();
    let folder = complete(scratch.path(), &settings);
    let maker = maker(&settings, &folder);
    let target = scratch.path().join("report");
    let report = report::write(&settings, &folder, &maker, &target).expect("a report");
    let names = ["D", "Guided", "Physical", "Atlas"];
    let sets = |file: &str| -> Vec<String> {
        let rows = csv_rows(&target.join("csv").join(file));
        rows.into_iter()
            .map(|mut row| row.remove("set").expect("a set"))
            .collect()
    };
    assert_eq!(sets("ladder.csv"), names);
    assert_eq!(sets("unclassifiable.csv"), names);
    assert_eq!(sets("contacts.csv"), names);
    // Answers from an atlas have no failed attempts.
    assert_eq!(sets("output-types.csv"), names[..3]);
    assert_eq!(sets("step-totals.csv"), names[..3]);
    let ladder = csv_rows(&target.join("csv/ladder.csv"));
    assert_eq!(ladder[3]["attempts"], "0");
    assert_eq!(ladder[3]["µs per attempt"], "");
    for row in &ladder[1..] {
        assert_eq!(row["thesis: attempts"], "");
        assert!(number(row, "ms") > 0.0);
    }
    // Solved forces are not drawn.
    for row in &csv_rows(&target.join("csv/contacts.csv"))[2..] {
        assert_eq!(row["valid again with new draws, %"], "");
        assert!(number(row, "contacts: mean") >= 2.0);
    }
    // Claims are about the thesis' sets, here only D.
    for claim in &report.claims {
        assert!(
            !claim.run.contains("Guided") && !claim.run.contains("Atlas"),
            "{claim:?}"
        );
    }

    let grasps = csv_rows(&scratch.path().join("grasps.csv"));
    for row in csv_rows(&target.join("csv/atlas.csv")) {
        let own: Vec<_> = grasps
            .iter()
            .filter(|grasp| {
                grasp["atlas"] == "allowed" && grasp["threads"] == "1" && grasp["holdout"] == row["holdout"]
            })
            .collect();
        assert_eq!(own.len(), 3);
        assert!(
            own.iter()
                .all(|grasp| grasp["atlas_entry"] == own[0]["atlas_entry"])
        );
        assert_ne!(own[0]["atlas_entry"], "");
        assert_eq!(number(&row, "answers"), 3.0);
        assert_eq!(number(&row, "different grasps"), 1.0);
        assert_eq!(number(&row, "from the atlas, %"), 100.0);
        let mut times: Vec<_> = own
            .iter()
            .map(|grasp| 1e3 * number(grasp, "milliseconds"))
            .collect();
        times.sort_by(f64::total_cmp);
        assert!((number(&row, "median µs") / times[1] - 1.0).abs() < 1e-3);
    }

    let unclassifiable = csv_rows(&target.join("csv/unclassifiable.csv"));
    assert_eq!(number(&unclassifiable[3], "different ones"), 2.0);
    assert_eq!(unclassifiable[3]["±"], "");
    assert_eq!(number(&unclassifiable[2], "different ones"), 6.0);
    let page = fs::read_to_string(&report.page).expect("the page");
    let share = number(&unclassifiable[3], "unclassifiable, %");
    assert!(page.contains(&format!("{share:.1} % in Atlas.")), "{share}");
}

#[test]
fn types_match_the_reproduced_grasps() {
    let settings = small();
    let scratch = Scratch::new();
    let folder = complete(scratch.path(), &settings);
    let maker = maker(&settings, &folder);
    let report = scratch.path().join("report");
    report::write(&settings, &folder, &maker, &report).expect("a report");
    let shares = csv_rows(&report.join("csv/grasp-types.csv"));
    for set in settings.sets {
        let own: Vec<_> = folder
            .records()
            .iter()
            .filter(|record| {
                let cell = record.cell;
                record.rejection.is_none() && cell.threads == 1 && cell.set == set
            })
            .map(|record| maker.grasp_of(record).expect("the grasp can be reproduced"))
            .map(|grasp| {
                grasp
                    .classification
                    .grasp_type
                    .map_or("unclassifiable", GraspType::name)
            })
            .collect();
        assert_eq!(own.len(), 6);
        let column = format!("{}, %", set.name());
        let mut sum = 0.0;
        for row in &shares {
            // All holdouts have equally many grasps.
            let of_type = own.iter().filter(|name| **name == row["type"]).count();
            let share = number(row, &column);
            assert!((share - 100.0 * of_type as f64 / 6.0).abs() < 1e-3, "{row:?}");
            sum += share;
        }
        assert!((sum - 100.0).abs() < 1e-2, "{sum}");
        let rows = csv_rows(&report.join("csv/unclassifiable.csv"));
        let row = rows.iter().find(|row| row["set"] == set.name()).expect("the set");
        let none = own.iter().filter(|name| **name == "unclassifiable").count();
        assert!((number(row, "unclassifiable, %") - 100.0 * none as f64 / 6.0).abs() < 1e-3);
    }
}
