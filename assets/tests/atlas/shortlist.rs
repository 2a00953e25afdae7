//! The grips that are tried first, against comparing hands one by one.

use grasp_assets::atlases::atlas as built_in_atlas;
use grasp_synthesis::{
    atlas::{Atlas, Listed, codec::decode, gravity::direction, grips::Grips, growth::Growth},
    hand::{Handedness, joints::HandJoints},
    physical::{
        grip::GIVER_CLEARANCE,
        solids::{PreparedHand, ToldSolids},
    },
};

use crate::support::{adult, grown, object};

/// Givers of an object that are asked.
const GIVERS: usize = 40;

/// Of which direction gravity comes.
const DIRECTION: usize = 20;

#[test]
fn more_givers_leave_one_of_the_shortlist_than_of_as_many_that_score_most() {
    let rig = adult(Handedness::Right);
    for name in ["remote", "scalpel", "scissors"] {
        let object = object(name);
        let bytes = built_in_atlas(name, rig).expect("it comes with the server");
        let atlas = decode(bytes, object, rig).expect("it is of today").atlas;
        let entries = atlas.entries();
        let up = direction(DIRECTION);
        let score = |&entry: &u16| entries[usize::from(entry)].scores[DIRECTION];
        let listed = |listed: &Listed| listed.entry;
        let list: Vec<u16> = atlas.shortlist(up).iter().map(listed).collect();
        assert!(list.is_sorted_by(|a, b| score(a) >= score(b)), "{name}");
        let holding = atlas.holding_under(up);
        assert!(list.iter().all(|entry| holding.contains(entry)), "{name}");

        // Other grips than those that the list was made with, which are every sixteenth.
        let (mut by_list, mut by_score, mut by_any) = (0, 0, 0);
        let (mut listed_scores, mut best_scores) = (0, 0);
        for giver in entries.iter().skip(7).step_by(entries.len() / GIVERS) {
            let joints = HandJoints::of_pose(rig, &giver.grip.pose);
            let hand = PreparedHand::new(&ToldSolids::of_joints(&joints));
            let keeps_clear = |entry: &&u16| {
                let solids = entries[usize::from(**entry)].solids(rig);
                !hand.is_neared_by(solids.iter(), GIVER_CLEARANCE)
            };
            let listed = list.iter().find(keeps_clear);
            let best = holding.iter().find(keeps_clear);
            by_list += usize::from(listed.is_some());
            by_score += usize::from(holding[..list.len()].iter().any(|entry| keeps_clear(&entry)));
            by_any += usize::from(best.is_some());
            if let (Some(listed), Some(best)) = (listed, best) {
                listed_scores += u32::from(score(listed));
                best_scores += u32::from(score(best));
            }
        }
        assert!(
            2 * by_list > 3 * by_score,
            "{name}: {by_list} and {by_score} of {by_any}"
        );
        assert!(
            5 * by_list >= 4 * by_any,
            "{name}: {by_list} of {by_any} leave one of the list"
        );
        // What is found first must be nearly as good as what would be found in the end.
        assert!(
            listed_scores >= best_scores * 19 / 20,
            "{name}: {listed_scores} instead of {best_scores}"
        );
    }
}

#[test]
fn a_growing_atlas_has_a_shortlist_of_its_own() {
    let rig = adult(Handedness::Right);
    let object = object("remote");
    let atlas = grown(Growth::new(object, rig), 40).atlas;
    let up = direction(DIRECTION);
    let list = atlas.shortlist(up);
    assert!(!list.is_empty());
    let mut once: Vec<u16> = list.iter().map(|listed| listed.entry).collect();
    once.sort_unstable();
    once.dedup();
    assert_eq!(once.len(), list.len(), "a grip is listed once");
    let empty = Atlas::new(object, rig, Grips::default(), false);
    for atlas in [empty, Atlas::default()] {
        assert!(atlas.shortlist(up).is_empty());
    }
}
