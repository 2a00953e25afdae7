use std::{collections::HashMap, sync::Arc};

use super::{
    catalogue::{labelled, labelled_objects},
    gathering::{Offer, gather},
    pairing::{Gathered, MAX_PER_REASON, pairs},
    reasons::Reason,
};

/// Grasps of each object.
const GRASPS: usize = 16;

/// Least share of the pairs that the weights have to rank right.
const MIN_SHARE_RIGHT: f32 = 0.75;

fn pool() -> rayon::ThreadPool {
    rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap()
}

#[test]
fn weights_rank_most_pairs_right() {
    use rayon::prelude::*;
    let pool = pool();
    let offers: Vec<(usize, usize, Offer)> = labelled_objects()
        .into_iter()
        .enumerate()
        .flat_map(|(number, object)| {
            let object = Arc::new(object);
            let held = Offer::built_in(&object).into_iter().take(2);
            let all: Vec<_> = [Offer::free(&object)].into_iter().chain(held).collect();
            let all = all.into_iter().enumerate();
            all.map(move |(offer_number, offer)| (number, offer_number, offer))
        })
        .collect();
    let all: Vec<Gathered> = pool.install(|| {
        let gathered = offers.into_par_iter().map(|(object, number, offer)| Gathered {
            object,
            number,
            candidates: gather(&offer, GRASPS, 1),
            offer,
        });
        gathered.collect()
    });

    let drawn = pairs(&all, 1);
    let mut counts: HashMap<(Reason, usize), usize> = HashMap::new();
    for pair in &drawn {
        let verdicts = |number: usize| pair.gathered.candidates[number].verdicts;
        assert!(verdicts(pair.plausible).are_plausible());
        assert_eq!(verdicts(pair.implausible).only_reason(), Some(pair.reason));
        let difference: f64 = pair.differences().iter().map(|difference| difference.abs()).sum();
        assert!(difference > 0.0, "a grasp is paired with itself");
        *counts.entry((pair.reason, pair.gathered.object)).or_default() += 1;
    }
    assert!(
        counts.values().all(|&count| count <= MAX_PER_REASON),
        "{counts:?}"
    );

    let wrong: Vec<String> = drawn
        .iter()
        .filter(|pair| !pair.is_right())
        .map(|pair| {
            let name = pair.gathered.offer.object.name;
            format!("{name}, {}: {:.3}", pair.reason.name(), pair.margin())
        })
        .collect();
    let right = 1.0 - wrong.len() as f32 / drawn.len() as f32;
    assert!(drawn.len() >= 40, "{} pairs", drawn.len());
    assert!(
        right >= MIN_SHARE_RIGHT,
        "{right} of {} pairs are right; wrong are:\n{}",
        drawn.len(),
        wrong.join("\n")
    );
}

#[test]
fn grasps_differ_and_are_the_same_in_a_second_run() {
    let remote = Arc::new(labelled("remote", &[], &[]));
    let offer = Offer::free(&remote);
    let [first, second] = [0, 1].map(|_| gather(&offer, 3, 7));
    assert_eq!(first.len(), 3);
    let wrists = |found: &[super::gathering::Candidate]| {
        let wrists = found
            .iter()
            .map(|candidate| candidate.grasp.pose.frame_from_wrist.position);
        wrists.collect::<Vec<_>>()
    };
    assert_eq!(wrists(&first), wrists(&second));
    let [a, b, c] = wrists(&first)[..] else {
        panic!("three grasps")
    };
    assert!(a != b && b != c && c != a);
}
