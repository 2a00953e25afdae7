//! Look-ups of known grips that are cut short and resumed.

use grasp_synthesis::search::LookUp;

use crate::prelude::*;

/// A look-up under a clock that advances by a microsecond per reading.
fn look_up(search: &Search<'_>, within: Duration) -> LookUp {
    search.look_up(&FakeClock::ticking(1_000), within)
}

#[test]
fn a_resumed_look_up_finds_the_same_as_an_uninterrupted_one() {
    let known = complete_atlas("scissors");
    let pool = pool(1);
    let few = every(90, "scissors");
    let (mut cut, mut nothing) = (0, 0);
    let of_all = (0..known.entries().len())
        .step_by(71)
        .map(|giver| (giver, &known));
    let of_few = (0..known.entries().len()).step_by(4).map(|giver| (giver, &few));
    for (giver, atlas) in of_all.chain(of_few) {
        let holdout = scissors_held_by(&known, giver);
        let mut search = guided(&holdout).atlas(atlas).reproducible(false);
        let whole = look_up(&search, Duration::from_secs(1));
        let mut last = None;
        let in_parts = loop {
            match look_up(&search, Duration::from_micros(3)) {
                LookUp::Found(outcome) => break Some(outcome),
                LookUp::NotFound { tried } => {
                    if last == Some(tried) {
                        break None;
                    }
                    assert!(tried > last.unwrap_or(0), "giver {giver}: {tried} after {last:?}");
                    // A search resumes there, too.
                    search.settings.known.tried = tried;
                    last = Some(tried);
                }
            }
        };
        let by_search = search.run_on(&pool);
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
    assert!(cut >= 10 && nothing >= 3, "{cut} {nothing}");
}

#[test]
fn reproducible_look_ups_and_those_without_an_atlas_try_nothing() {
    let known = complete_atlas("scissors");
    let holdout = scissors_held_by(&known, 0);
    let without = guided(&holdout).reproducible(false);
    let reproducible = guided(&holdout).atlas(&known);
    for search in [without, reproducible] {
        let LookUp::NotFound { tried } = look_up(&search, Duration::from_secs(1)) else {
            panic!("there is nothing to look up");
        };
        assert_eq!(tried, 0);
    }
}
