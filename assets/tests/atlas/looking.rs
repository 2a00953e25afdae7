//! Looks at known grips that are cut short, and go on.

use std::{
    sync::{
        Arc,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    time::Duration,
};

use grasp_synthesis::{
    base::clock::Clock,
    known::recent_grips::RecentGrips,
    model::{hand::Handedness, holdout::Holdout},
    search::{GraspSource, LookUp, find_grasp, find_known_grasp, settings::SearchSettings},
};

use crate::support::{NoClock, adult, few_of, held_out, known, reproducible};

/// A clock that goes on by a microsecond whenever it is looked at.
#[derive(Default)]
struct Looks(AtomicU64);

impl Clock for Looks {
    fn now(&self) -> Duration {
        Duration::from_micros(self.0.fetch_add(1, Ordering::Relaxed))
    }
}

fn look(holdout: &Holdout, settings: &SearchSettings, within: Duration) -> LookUp {
    find_known_grasp(
        holdout,
        adult(Handedness::Right),
        settings,
        &Looks::default(),
        within,
    )
}

#[test]
fn a_look_goes_on_where_it_ended_and_comes_to_the_same() {
    let known = known();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let pool = pool.expect("a thread");
    let few = few_of(&known);
    let (mut cut, mut subset_grasp, mut nothing) = (0, 0, 0);
    let of_all = (0..known.entries().len())
        .step_by(71)
        .map(|giver| (giver, &known));
    let of_few = (0..known.entries().len()).step_by(4).map(|giver| (giver, &few));
    for (giver, atlas) in of_all.chain(of_few) {
        let holdout = held_out(&known, giver);
        let mut settings = SearchSettings {
            atlas: Some(Arc::clone(atlas)),
            reproducible: false,
            ..reproducible(&holdout)
        };
        let whole = look(&holdout, &settings, Duration::from_secs(1));
        let mut last = None;
        let in_parts = loop {
            match look(&holdout, &settings, Duration::from_micros(3)) {
                LookUp::Found(outcome) => break Some(outcome),
                LookUp::NotFound { tried } => {
                    if last == Some(tried) {
                        break None;
                    }
                    assert!(tried > last.unwrap_or(0), "giver {giver}: {tried} after {last:?}");
                    // A search goes on there, too.
                    settings.known_tried = tried;
                    last = Some(tried);
                }
            }
        };
        let by_search = find_grasp(
            &pool,
            &holdout,
            adult(Handedness::Right),
            &settings,
            &NoClock,
            &AtomicBool::new(false),
        );
        match (whole.clone().found(), in_parts) {
            (Some(whole), Some(in_parts)) => {
                assert_eq!(
                    (whole.grasp.as_ref(), whole.report.source),
                    (in_parts.grasp.as_ref(), in_parts.report.source)
                );
                assert_eq!(
                    (by_search.grasp, by_search.report.source),
                    (whole.grasp, whole.report.source)
                );
                cut += usize::from(last.is_some());
                subset_grasp += usize::from(matches!(whole.report.source, Some(GraspSource::Spared(_))));
            }
            (None, None) => {
                assert_eq!(by_search.grasp, None);
                let LookUp::NotFound { tried } = whole else {
                    unreachable!("nothing was found")
                };
                assert_eq!(last, Some(tried));
                nothing += 1;
            }
            (whole, in_parts) => panic!("giver {giver}: {whole:?}, in parts {in_parts:?}"),
        }
    }
    assert!(
        cut >= 10 && subset_grasp >= 3 && nothing >= 3,
        "{cut} looks were cut short, {subset_grasp} ended with subset_grasp fingers, {nothing} with nothing"
    );
}

#[test]
fn what_is_not_looked_for_is_not_tried() {
    let known = known();
    let holdout = held_out(&known, 0);
    let without = SearchSettings {
        reproducible: false,
        ..reproducible(&holdout)
    };
    let reproducible = SearchSettings {
        atlas: Some(known),
        recent: RecentGrips::default(),
        ..reproducible(&holdout)
    };
    for settings in [without, reproducible] {
        let LookUp::NotFound { tried } = look(&holdout, &settings, Duration::from_secs(1)) else {
            panic!("it is no look for a known grip");
        };
        assert_eq!(tried, 0);
    }
}
