//! What a server keeps of a growth: few grips, tried one by one.

use grasp_synthesis::{
    known::{codec::encode, entry::SLIPS, gravity::DIRECTIONS, growth::CHOSEN},
    model::regions::suits_owner,
};

use crate::prelude::*;

/// All that grew on the scissors, and what is kept of it.
static SCISSORS: LazyLock<(Grown, Grown)> = LazyLock::new(|| {
    let growth = grown_enough(object("scissors"));
    (growth.grown(), growth.kept())
});

fn grown_enough(object: &Arc<GraspObject>) -> Growth<'static> {
    let mut growth = growth(object, right());
    let mut gripper = Gripper::default();
    while !growth.is_enough() {
        growth.round(&mut gripper);
    }
    growth
}

/// Of givers and directions of gravity, how many leave one of the grips free that holds.
fn served(givers: &Atlas, grips: &[Entry]) -> usize {
    let of_giver = |giver: usize| {
        let holdout = scissors_held_by(givers, giver);
        let giver = Presented::of(&holdout).giver.expect("there is a giver");
        let is_clear = |grip: &&Entry| {
            giver
                .clearance(&grip.tracked_solids(right()), GIVER_CLEARANCE)
                .is_some()
        };
        let clear: Vec<&Entry> = grips.iter().filter(is_clear).collect();
        let is_served = |up: &usize| clear.iter().any(|grip| grip.scores[*up] != SLIPS);
        (0..DIRECTIONS).step_by(3).filter(is_served).count()
    };
    (0..givers.entries().len()).step_by(11).map(of_giver).sum()
}

#[test]
fn few_grips_serve_nearly_all_givers_that_all_serve() {
    let (all, kept) = &*SCISSORS;
    let (few, many) = (kept.atlas.entries(), all.atlas.entries());
    assert!(kept.atlas.is_complete() && few.len() == CHOSEN && many.len() > 2 * CHOSEN);
    assert!(few.iter().all(|grip| many.contains(grip)));
    let sum = |grip: &Entry| grip.scores.iter().map(|&score| u32::from(score)).sum::<u32>();
    assert!(few.is_sorted_by(|a, b| sum(a) >= sum(b)));
    let of_all = served(&all.atlas, many);
    let of_kept = served(&all.atlas, few);
    assert!(100 * of_kept >= 95 * of_all, "{of_kept} of {of_all}");
    // As many that were found first serve fewer.
    let of_first = served(&all.atlas, &many[..CHOSEN]);
    assert!(
        of_all - of_kept < (of_all - of_first) / 2,
        "{of_kept} and {of_first} of {of_all}"
    );
}

#[test]
fn what_is_kept_takes_less_than_300_kilobytes_and_is_read_as_it_was() {
    let (_, kept) = &*SCISSORS;
    assert!(kept.bytes() < 300_000, "{}", kept.bytes());
    let (object, rig) = (object("scissors"), right());
    let bytes = encode(kept, object, rig);
    assert_eq!(decode(&bytes, object, rig).as_ref(), Ok(kept));
}

#[test]
fn a_growth_that_is_not_enough_keeps_all() {
    let growth = grown_to(object("remote"), right(), 20);
    let (grown, kept) = (growth.grown(), growth.kept());
    assert_eq!(kept.atlas.entries(), grown.atlas.entries());
    assert!(!kept.atlas.is_complete() && kept.proposed() == grown.proposed());
}

#[test]
fn half_of_what_is_kept_holds_where_the_owner_wants_hands() {
    let end = Region {
        wish: Wish::Prefer,
        weight: 1.0,
        triangles: Vec::new(),
        zones: vec![half_space(Vec3::Y * 0.05, Vec3::Y)],
    };
    let plain = Arc::new(bar());
    let triangles = plain.mesh.triangles().len();
    let with_end = Arc::new(bar().with_regions(Regions::new(&[end], triangles)));
    let at_end = |object| {
        let kept = grown_enough(object).kept();
        let suits = |grip: &&Entry| suits_owner(&with_end.regions().values(&grip.contacts));
        kept.atlas.entries().iter().filter(suits).count()
    };
    let [chance, wanted] = [&plain, &with_end].map(at_end);
    assert!(wanted >= CHOSEN / 2 && 2 * chance < wanted, "{chance} {wanted}");
}
