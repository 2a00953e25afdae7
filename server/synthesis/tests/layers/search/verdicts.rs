//! Verdicts about hands that somebody posed.

use grasp_synthesis::{model::grasp::Grasp, search::verdicts::Judgement};

use crate::fixtures::{
    atlases::complete_atlas,
    hands::{built_in_hand, right},
    holdouts::tracked_holdouts,
    objects::{OBJECT_NAMES, object},
    searches::{Search, pool},
};

#[test]
fn explore() {
    use grasp_assets::atlas_folder;
    use grasp_synthesis::model::hand::Handedness;
    use std::sync::Arc;
    let pool = pool(1);
    let (mut all, mut bad, mut differ) = (0, 0, 0);
    for (place, holdout) in tracked_holdouts().enumerate() {
        let name = OBJECT_NAMES
            .into_iter()
            .find(|name| Arc::ptr_eq(object(name), &holdout.object))
            .unwrap();
        for side in [Handedness::Left, Handedness::Right] {
            let rig = &built_in_hand("adult", side).rig;
            for seed in 0..12 {
                for with_atlas in [false, true] {
                    let search = Search {
                        seed,
                        atlas: with_atlas.then(|| atlas_folder::complete_atlas(name, rig)),
                        max_attempts: if with_atlas { 0 } else { 3000 },
                        ..Search::guided(&holdout, rig)
                    };
                    if with_atlas && seed > 0 {
                        continue;
                    }
                    let outcome = search.run_on(&pool);
                    let Some(grasp) = outcome.grasp else { continue };
                    all += 1;
                    let judged = search.judge(&grasp.pose);
                    let (a, b) = (grasp.margins.unwrap(), *judged.margins().unwrap());
                    if !judged.is_valid() {
                        bad += 1;
                        println!(
                            "BAD {place} {side:?} {seed} {with_atlas}: {:#?}",
                            judged.verdicts.iter().filter(|v| !v.passed).collect::<Vec<_>>()
                        );
                    }
                    let close = |x: f32, y: f32| (x - y).abs() < 1e-5;
                    let same = close(a.penetration, b.penetration)
                        && close(a.epsilon, b.epsilon)
                        && close(a.residual, b.residual)
                        && close(a.giver_clearance.unwrap(), b.giver_clearance.unwrap())
                        && grasp.contacts.len() == judged.grasp.contacts.len()
                        && close(
                            grasp.score.unwrap().total(),
                            judged.grasp.score.map_or(0.0, |s| s.total()),
                        );
                    if !same {
                        differ += 1;
                        println!(
                            "DIFF {place} {side:?} {seed} {with_atlas}: {a:?} {b:?} contacts {} {} score {:?} {:?}",
                            grasp.contacts.len(),
                            judged.grasp.contacts.len(),
                            grasp.score.map(|s| s.total()),
                            judged.grasp.score.map(|s| s.total())
                        );
                    }
                }
            }
        }
    }
    println!("{all} answers, {bad} invalid, {differ} differ");
}
