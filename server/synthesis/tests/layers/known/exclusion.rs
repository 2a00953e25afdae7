//! Grips that a giver excludes, against comparing hands one by one.

use crate::prelude::*;

/// A posed hand as a giver.
fn giver_of(rig: &Rig, pose: &HandPose) -> PreparedHand {
    PreparedHand::new(&TrackedSolids::of_joints(&HandJoints::of_pose(rig, pose)))
}

/// Compares some known grips as givers, in place and backed off, so that the object lies between two hands, with others; at least a
/// share of those that meet are excluded, since exclusion pays only if it settles many pairs.
fn assert_excludes_meeting_grips(name: &str, atlas: &Atlas, every: [usize; 2], share: f32) {
    let rig = right();
    let (mut meeting, mut excluded, mut free) = (0, 0, 0);
    for (turn, giver) in atlas.entries().iter().step_by(every[0]).enumerate() {
        let Pose {
            position,
            orientation,
        } = giver.grip.pose.frame_from_wrist;
        let off = orientation * Vec3::Z * 0.01 * (turn % 6) as f32;
        let turned = Quat::from_rotation_x(0.05 * turn as f32) * orientation;
        let pose = hand_pose(Pose::new(position - off, turned), giver.grip.pose.digits);
        let hand = giver_of(rig, &pose);
        let exclusion = atlas.excluded_by(&hand);
        for (index, entry) in atlas.entries().iter().enumerate().step_by(every[1]) {
            let meets = hand.comes_within(entry.solids(rig).iter(), GIVER_CLEARANCE);
            let is_excluded = exclusion.contains(index as u16);
            assert!(meets || !is_excluded, "{name}: {index} is clear of {turn}");
            meeting += u32::from(meets);
            excluded += u32::from(is_excluded);
            free += u32::from(!meets);
        }
    }
    assert!(free > 50, "{name}: only {free} pairs keep clear");
    assert!(
        excluded as f32 > share * meeting as f32,
        "{name}: {excluded} of {meeting}"
    );
}

#[test]
fn excluded_grips_meet_the_giver() {
    for name in OBJECT_NAMES.into_iter().take(cases(3) as usize) {
        // A thousand grips, as in an atlas that a server grows; it takes hundreds of givers to measure how many are excluded.
        assert_excludes_meeting_grips(name, &every(8, name), [4, 1], 0.4);
    }
}

#[test]
fn a_shipped_atlas_excludes_meeting_grips_and_lists_the_best_first() {
    for name in ["remote", "scissors"] {
        let atlas = complete_atlas(name);
        let entries = atlas.entries();
        // So many hands fill more cells than are kept; those that few hands fill are dropped, which excludes little less. Some of
        // every block that is compared together.
        assert_excludes_meeting_grips(name, &atlas, [entries.len() / 8, 61], 1.0 / 3.0);
        let sum = |entry: &Entry| entry.scores.iter().map(|&score| u32::from(score)).sum::<u32>();
        assert!(entries.is_sorted_by(|a, b| sum(a) >= sum(b)), "{name}");
        assert!(atlas.bytes() < 11_500_000, "{name}: {} bytes", atlas.bytes());
    }
}

#[test]
fn an_empty_atlas_excludes_nothing() {
    let rig = right();
    let known = grown(growth(object("remote"), rig), 2).atlas;
    let giver = giver_of(rig, &known.entries()[0].grip.pose);
    let empty = Atlas::new(object("remote"), rig, Grips::default(), false);
    for atlas in [empty, Atlas::default()] {
        assert!(!atlas.excluded_by(&giver).contains(0));
    }
}

#[test]
fn atlas_memory_does_not_grow_with_the_objects_size() {
    let small = object("remote");
    let known = grown(growth(small, right()), 20).atlas;
    let bytes_of = |object: &GraspObject| Atlas::new(object, right(), known.grips().clone(), false).bytes();
    let usual = bytes_of(small);
    let large = bytes_of(&resized(small, 40.0));
    assert!(large < 3 * usual, "{large} bytes instead of {usual}");
}
