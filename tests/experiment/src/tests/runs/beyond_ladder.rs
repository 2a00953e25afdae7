//! The sets beyond A to F: their records, and the atlases that one of them answers from.

use std::{
    fs,
    path::PathBuf,
    sync::{
        Arc, LazyLock,
        atomic::{AtomicBool, Ordering},
    },
};

use crate::{
    atlases::{AtlasProgress, Atlases},
    folder::Folder,
    make::{MakeError, Maker},
    plan::{Set, Settings},
    record::{Record, SearchFigures, Source},
    report,
    run::{RunEnd, run},
    table::Value,
};
use grasp_assets::{hands::hand, objects::object};
use grasp_synthesis::{
    known::{
        atlas::Atlas,
        codec::{AtlasError, encode},
        growth::Growth,
        recheck::GripChecker,
    },
    model::{hand::Handedness, strategy::Validity},
    physical::{
        grip::Gripper,
        receiver::SUITABLE,
        scene::{ObjectScene, Presented},
    },
    propose::prepared::PreparedRig,
};

use crate::tests::fixtures::small_runs::{Scratch, atlas_folder, complete, index_of, maker, open, small};

/// Grips of the small atlas: enough that a giver leaves some.
const GRIPS: usize = 100;

fn adult() -> &'static PreparedRig {
    &hand("adult", Handedness::Right).expect("a built-in hand").rig
}

/// A small atlas of the scissors, marked as complete, and its bytes.
static SMALL_ATLAS: LazyLock<(Arc<Atlas>, Vec<u8>)> = LazyLock::new(|| {
    let object = &object("scissors").expect("a built-in object").prepared;
    let mut growth = Growth::new(object, adult());
    let mut gripper = Gripper::default();
    while growth.len() < GRIPS {
        growth.round(&mut gripper);
    }
    let mut grown = growth.grown();
    grown.atlas = Arc::new(Atlas::new(grown.atlas.grips().clone(), true));
    let bytes = encode(&grown, object, adult());
    (grown.atlas, bytes)
});

/// Every set beyond the thesis, and one of the thesis.
pub(crate) fn settings() -> Settings {
    Settings {
        sets: vec![Set::ALL[3], Set::GUIDED, Set::PHYSICAL, Set::ATLAS],
        holdouts: vec![index_of("scissors-hold1"), index_of("scissors-hold2")],
        bend_ratio_columns: false,
        ..small()
    }
}

/// The file of the scissors' atlas for a run.
fn file(scratch: &Scratch) -> PathBuf {
    let object = &object("scissors").expect("a built-in object").object;
    atlas_folder(scratch.path()).file(object, adult())
}

/// A folder with the small atlas in it.
pub(crate) fn with_atlas() -> Scratch {
    let scratch = Scratch::new();
    fs::create_dir_all(atlas_folder(scratch.path()).path()).expect("a folder");
    fs::write(file(&scratch), &SMALL_ATLAS.1).expect("an atlas");
    scratch
}

fn of(folder: &Folder, set: Set) -> Vec<Record> {
    let own = folder.records().iter().filter(|record| record.cell.set == set);
    own.cloned().collect()
}

#[test]
fn an_atlas_answers_with_a_holding_grip_from_where_the_receiver_stands() {
    let scratch = with_atlas();
    let folder = complete(scratch.path(), &settings());
    let records = of(&folder, Set::ATLAS);
    // Two holdouts on one and two threads; no failed attempts.
    assert_eq!(records.len(), 3 * 2 * 2);
    for record in records.iter().filter(|record| record.cell.threads == 1) {
        let holdout = record
            .cell
            .built_in()
            .to_holdout()
            .expect("a built-in holdout is sound");
        let object = ObjectScene::new(&holdout.object, holdout.object.friction_under(Validity::Physical));
        let presented = Presented::of(&holdout);
        let held = |entry: u16| {
            let entry = &SMALL_ATLAS.0.entries()[usize::from(entry)];
            let checker = GripChecker::new(&object, adult(), &presented);
            checker.check(entry, &entry.tracked_solids(adult()), &mut Gripper::default())
        };
        let suits = |entry: u16| {
            let wrist = SMALL_ATLAS.0.entries()[usize::from(entry)]
                .grip
                .pose
                .frame_from_wrist;
            presented.receiver.suits(adult(), wrist) >= SUITABLE
        };
        let Source::AtlasEntry(entry) = record.source else {
            panic!("{:?}", record.source);
        };
        let grasp = held(entry).expect("it holds");
        let entries = 0..SMALL_ATLAS.0.entries().len() as u16;
        assert!(
            suits(entry)
                || !entries
                    .into_iter()
                    .any(|other| suits(other) && held(other).is_some())
        );
        let search = record.search.expect("a search");
        assert_eq!(search.attempts, 0);
        assert_eq!(search.rejections, [0; 8]);
        let atlas = search.atlas.expect("a report on the atlas");
        assert_eq!(atlas.entries, SMALL_ATLAS.0.entries().len() as u64);
        assert_eq!(atlas.candidates, 1);
        let details = record.details.as_ref().expect("details");
        assert_eq!(details.step_nanoseconds, None);
        let figures = record.grasp().expect("figures of a grasp");
        assert_eq!(figures.comfort, grasp.comfort);
        let on_digits: u32 = details.digits.iter().map(|digit| digit.contacts).sum();
        assert_eq!((on_digits + figures.palm_contacts) as usize, grasp.contacts.len());
    }
}

#[test]
fn sets_without_an_atlas_are_valid_by_their_own_notion_and_hand() {
    let scratch = with_atlas();
    let settings = settings();
    let folder = complete(scratch.path(), &settings);
    let maker = maker(&settings, &folder);
    for (set, is_physical) in [(Set::GUIDED, false), (Set::PHYSICAL, true)] {
        let records = of(&folder, set);
        assert_eq!(records.len(), 2 * (3 * 2 + 20));
        for record in &records {
            let attempt = record.source.attempt().expect("an attempt");
            assert!(maker.is_reproducible(record), "{record:?}");
            if record.rejection.is_some() {
                continue;
            }
            let grasp = maker.grasp_of(record).expect("the grasp can be reproduced");
            // Only the physical checks have margins, and only they solve for the forces.
            assert_eq!(grasp.margins.is_some(), is_physical);
            if record.cell.threads > 1 {
                continue;
            }
            let search = record.search.expect("a search");
            // Attempts after it might have found a grasp that people would rather choose.
            assert!(search.attempts == attempt + 1 || (is_physical && search.attempts > attempt));
            assert_eq!(search.atlas, None);
            let figures = record.grasp().expect("figures of a grasp");
            assert_eq!(figures.sufficient_distributions.is_none(), is_physical);
            assert!(figures.comfort_again.is_empty() || !is_physical);
            assert_eq!(figures.comfort, grasp.comfort);
        }
    }
}

/// The record of a search of set Physical that gave up on the first holdout after so many valid grasps on one thread.
fn given_up(settings: &Settings, number: u64) -> Record {
    let cell = settings.cells()[0];
    assert_eq!((cell.set, cell.threads), (Set::PHYSICAL, 1));
    Record {
        cell,
        number,
        seed: settings.seed_of_valid(&cell, number),
        source: Source::Nowhere,
        rejection: None,
        search: Some(SearchFigures {
            attempts: Set::PHYSICAL.most_attempts(),
            pruned_placements: 0,
            rejections: [0; 8],
            nanoseconds: 1_000_000_000,
            atlas: None,
        }),
        details: None,
    }
}

#[test]
fn given_up_searches_are_neither_repeated_nor_averaged() {
    let settings = Settings {
        sets: vec![Set::PHYSICAL],
        ..settings()
    };
    let scratch = Scratch::new();
    let record = given_up(&settings, 0);
    open(scratch.path(), &settings)
        .add(vec![record.clone()])
        .expect("a folder that can be written");
    let mut folder = open(scratch.path(), &settings);
    assert_eq!(folder.records(), &[record], "it round-trips");
    let maker = maker(&settings, &folder);
    let mut last = None;
    let end = run(&settings, &maker, &mut folder, &AtomicBool::new(false), |now| {
        last = Some(now);
    });
    assert_eq!(end.expect("a run"), RunEnd::Complete);
    // All but the last grasp: given-up ones count as done.
    let last = last.expect("progress");
    assert_eq!((last.done, last.total), (3 * 4 - 1, 3 * 4));
    let valid = folder.records().iter().filter(|record| record.is_valid()).count();
    assert_eq!(valid, 3 * 3);

    let target = scratch.path().join("report");
    let report = report::write(&settings, &folder, &maker, &target).expect("a report");
    let own: Vec<f64> = folder
        .records()
        .iter()
        .filter(|record| record.is_valid() && record.cell.threads == 1)
        .map(|record| record.search.expect("a search").attempts as f64)
        .collect();
    assert_eq!(own.len(), 3);
    let Value::Number(mean, _) = report.ladder.rows[0][2] else {
        panic!("{:?}", report.ladder.rows[0]);
    };
    assert!((mean - own.iter().sum::<f64>() / 3.0).abs() < 1e-9);
    let page = fs::read_to_string(&report.page).expect("the page");
    let expected = "Physical found no grasp in 1,000,000 attempts for scissors-hold1: left out of its means.";
    assert!(page.contains(expected), "{page}");
    let list = fs::read_to_string(scratch.path().join("grasps.csv")).expect("the grasps");
    assert_eq!(list.lines().count(), 1 + 3 * 3);
}

#[test]
fn a_set_with_an_atlas_requires_one() {
    let settings = settings();
    let error = Maker::new(&settings, Atlases::default()).err();
    assert!(matches!(error, Some(MakeError::Atlas("scissors"))), "{error:?}");
    let without = Settings {
        sets: vec![Set::GUIDED, Set::PHYSICAL],
        ..settings
    };
    assert!(Maker::new(&without, Atlases::default()).is_ok());
}

/// Grows the atlases of a folder until one has so many grips; returns the first and the last progress.
fn grow(scratch: &Scratch, until: u64) -> [AtlasProgress; 2] {
    let settings = settings();
    let folder = open(scratch.path(), &settings);
    let stop = AtomicBool::new(false);
    let mut ends = None;
    let atlases = Atlases::complete(&settings, &folder, &atlas_folder(scratch.path()), &stop, |now| {
        ends.get_or_insert([now; 2])[1] = now;
        stop.store(now.entries >= until, Ordering::Relaxed);
    });
    assert!(atlases.expect("a folder that can be written").is_none());
    ends.expect("the atlas has to grow")
}

#[test]
fn a_stopped_atlas_resumes() {
    let scratch = Scratch::new();
    let [first, last] = grow(&scratch, 5);
    assert_eq!(
        (first.object, first.entries, first.rejected),
        ("scissors", 0, None)
    );
    let [again, _] = grow(&scratch, last.entries + 1);
    assert_eq!((again.entries, again.rejected), (last.entries, None));
}

#[test]
fn a_damaged_atlas_is_grown_again_with_the_reason() {
    let scratch = Scratch::new();
    grow(&scratch, 1);
    let path = file(&scratch);
    let mut bytes = fs::read(&path).expect("an atlas");
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(&path, bytes).expect("an atlas");
    let [first, _] = grow(&scratch, 1);
    assert_eq!((first.entries, first.rejected), (0, Some(AtlasError::Damaged)));
    let [next, _] = grow(&scratch, 1);
    assert_eq!(next.rejected, None);
}

#[test]
fn a_complete_atlas_in_the_folder_does_not_grow() {
    let scratch = with_atlas();
    let settings = settings();
    let folder = open(scratch.path(), &settings);
    let never = |now| panic!("it grows: {now:?}");
    let atlas_folder = atlas_folder(scratch.path());
    let atlases = Atlases::complete(&settings, &folder, &atlas_folder, &AtomicBool::new(true), never);
    let atlases = atlases.expect("a folder").expect("no atlas has to grow");
    assert!(Maker::new(&settings, atlases).is_ok());
    assert_eq!(fs::read(file(&scratch)).expect("an atlas"), SMALL_ATLAS.1);
}
