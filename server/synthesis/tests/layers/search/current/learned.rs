//! Current grasps and the grips that searches found.

use std::sync::Arc;

use grasp_synthesis::{
    known::{atlas::Atlas, entry::Entry},
    model::grasp::Grasp,
    search::{
        GraspSource,
        current::{CurrentGraspStatus, Settlement},
    },
};

use super::{after, current, settled, valid_grips, way};
use crate::fixtures::{
    atlases::{scissors_held_by, shipped_atlas},
    hands::right,
    holdouts::tracked_holdouts,
    searches::Search,
};

fn learned<'a>(grips: impl IntoIterator<Item = &'a Grasp>) -> Arc<Atlas> {
    let learn = |learned: Atlas, grasp: &Grasp| {
        learned.with(right(), Entry::of_grasp(grasp).expect("one hand holds it"), 64)
    };
    Arc::new(grips.into_iter().fold(Atlas::default(), learn))
}

#[test]
fn a_learned_hand_is_kept_or_falls_as_one_that_nobody_knows() {
    let (mut kept, mut failed) = (0, 0);
    for holdout in tracked_holdouts() {
        let search = Search {
            max_attempts: 2_000,
            ..Search::guided(&holdout, right())
        };
        let Some(grasp) = search.run().grasp.filter(|grasp| !grasp.hangs) else {
            continue;
        };
        for other in tracked_holdouts().filter(|other| Arc::ptr_eq(&other.object, &holdout.object)) {
            let unknown = Search {
                current: Some(current(grasp.pose)),
                reproducible: false,
                ..Search::guided(&other, right())
            };
            let known = Search {
                learned: Some(learned([&grasp])),
                ..unknown.clone()
            };
            match (unknown.settle(), known.settle()) {
                (Settlement::Settled(unknown), Settlement::Settled(known)) => {
                    kept += 1;
                    assert_eq!(known.1, unknown.1);
                    let [known, unknown] =
                        [known, unknown].map(|settled| settled.0.grasp.expect("it is kept"));
                    assert_eq!((known.pose, &known.contacts), (unknown.pose, &unknown.contacts));
                    let score = |grasp: &Grasp| grasp.score.expect("it is rated").total();
                    assert!((score(&known) - score(&unknown)).abs() < 0.01);
                }
                (Settlement::Failed(unknown), Settlement::Failed(known)) => {
                    failed += 1;
                    assert_eq!(known, unknown);
                }
                other => panic!("{other:?}"),
            }
        }
    }
    assert!(kept > 5 && failed > 0, "{kept} kept and {failed} failed");
}

#[test]
fn the_nearest_learned_grip_follows_where_the_atlas_has_none() {
    let known = shipped_atlas("scissors");
    let empty = Arc::new(Atlas::default());
    let mut followed = 0;
    for giver in (0..known.entries().len()).step_by(11) {
        let holdout = scissors_held_by(&known, giver);
        // The hand is where the giver's is.
        let failed = known.entries()[giver].grip.pose;
        let valid: Vec<Grasp> = valid_grips(&holdout, &known)
            .into_iter()
            .flatten()
            .take(40)
            .collect();
        if valid.len() < 2 {
            continue;
        }
        let search = Search {
            learned: Some(learned(&valid)),
            reproducible: false,
            ..after(&holdout, &empty, current(failed))
        };
        let (outcome, verdict) = settled(search.settle());
        assert_eq!(verdict.status, CurrentGraspStatus::Replanned);
        assert!(matches!(outcome.report.source, Some(GraspSource::Learned(_))));
        let of = |grasp: &Grasp| way(failed.frame_from_wrist, grasp.pose.frame_from_wrist);
        let nearest = valid.iter().map(of).fold(f32::INFINITY, f32::min);
        let answer = outcome.grasp.expect("there is one");
        assert!(of(&answer) <= 1.25 * nearest + 1e-5);
        followed += 1;
        // With an atlas that has a valid grip, that follows, however far it is.
        let with_atlas = Search {
            learned: Some(learned(&valid)),
            reproducible: false,
            ..after(&holdout, &known, current(failed))
        };
        let (outcome, _) = settled(with_atlas.settle());
        assert!(matches!(outcome.report.source, Some(GraspSource::Atlas(_))));
    }
    assert!(followed > 3, "{followed}");
}
