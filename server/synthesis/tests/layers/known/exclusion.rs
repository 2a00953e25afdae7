//! Grips that a giver excludes, against comparing hands one by one.

use glam::{Quat, Vec3};
use grasp_cases::cases;
use grasp_synthesis::{
    base::pose::Pose,
    geometry::mesh::TriangleMesh,
    known::{atlas::Atlas, grips::Grips},
    model::{
        hand::{HandPose, joints::HandJoints, rig::Rig},
        object::GraspObject,
    },
    physical::{
        grip::GIVER_CLEARANCE,
        solids::{HandSolids, PreparedHand, TrackedSolids},
    },
};

use crate::fixtures::{
    atlases::{complete_atlas, every, grown, growth},
    hands::right,
    objects::object,
};

/// The object, `scale` times as large.
fn scaled(object: &GraspObject, scale: f32) -> GraspObject {
    let mesh = object.surface.mesh();
    let positions = mesh.positions().iter().map(|place| *place * scale).collect();
    let mesh = TriangleMesh::new(positions, mesh.triangles().to_vec()).expect("it was sound before");
    GraspObject::new(mesh, object.mass, object.centre_of_mass * scale, None, &[])
        .expect("it was sound before")
}

/// A posed hand as a giver.
fn giver_of(rig: &Rig, pose: &HandPose) -> PreparedHand {
    PreparedHand::new(&TrackedSolids::of_joints(&HandJoints::of_pose(rig, pose)))
}

#[test]
fn excluded_grips_meet_the_giver() {
    let rig = right();
    for name in ["remote", "scissors", "scalpel"]
        .into_iter()
        .take(cases(3) as usize)
    {
        // A thousand grips, as in an atlas that a server grows.
        let atlas = every(8, name);
        let (mut meeting, mut excluded, mut free) = (0, 0, 0);
        // Known grips as givers, in place and backed off, so that the object lies between two hands. It takes hundreds
        // among a thousand grips to measure how many are excluded.
        for (turn, giver) in atlas.entries().iter().step_by(4).enumerate() {
            let mut pose = giver.grip.pose;
            let off = 0.01 * (turn % 6) as f32;
            pose.frame_from_wrist = Pose::new(
                pose.frame_from_wrist.position - off * pose.frame_from_wrist.transform_vector(Vec3::Z),
                Quat::from_rotation_x(0.05 * turn as f32) * pose.frame_from_wrist.orientation,
            );
            let hand = giver_of(rig, &pose);
            let exclusion = atlas.excluded_by(&hand);
            for (index, entry) in atlas.entries().iter().enumerate() {
                let solids = HandSolids::of_pose(rig, &entry.grip.pose);
                let meets = hand.comes_within(solids.iter(), GIVER_CLEARANCE);
                let is_excluded = exclusion.contains(index as u16);
                assert!(
                    meets || !is_excluded,
                    "{name}: {index} keeps clear of giver {turn}"
                );
                meeting += usize::from(meets);
                excluded += usize::from(is_excluded);
                free += usize::from(!meets);
            }
        }
        assert!(free > 50, "{name}: only {free} pairs keep clear");
        // Exclusion pays only if it settles many pairs.
        assert!(
            5 * excluded > 2 * meeting,
            "{name}: {excluded} of {meeting} are excluded"
        );
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
    let rig = right();
    let small = object("remote");
    let known = grown(growth(small, rig), 20).atlas;
    let bytes_of = |object: &GraspObject| Atlas::new(object, rig, known.grips().clone(), false).bytes();
    let usual = bytes_of(small);
    let large = bytes_of(&scaled(small, 40.0));
    assert!(large < 3 * usual, "{large} bytes instead of {usual}");
}

#[test]
fn a_shipped_atlas_excludes_only_meeting_grips_and_lists_the_best_first() {
    let rig = right();
    for name in ["remote", "scissors"] {
        let atlas = complete_atlas(name);
        let entries = atlas.entries();
        let (mut meeting, mut excluded) = (0, 0);
        for giver in entries.iter().step_by(entries.len() / 8) {
            let hand = giver_of(rig, &giver.grip.pose);
            let exclusion = atlas.excluded_by(&hand);
            // Some of every block that is compared together.
            for index in (0..entries.len()).step_by(61) {
                let solids = HandSolids::of_pose(rig, &entries[index].grip.pose);
                let meets = hand.comes_within(solids.iter(), GIVER_CLEARANCE);
                let is_excluded = exclusion.contains(index as u16);
                assert!(meets || !is_excluded, "{name}: {index} keeps clear");
                meeting += usize::from(meets);
                excluded += usize::from(is_excluded);
            }
        }
        // So many hands fill more cells than are kept; those that few hands fill are dropped, which excludes little
        // less.
        assert!(
            3 * excluded > meeting,
            "{name}: {excluded} of {meeting} are excluded"
        );
        let sums: Vec<u32> = entries
            .iter()
            .map(|entry| entry.scores.iter().map(|&score| u32::from(score)).sum())
            .collect();
        assert!(sums.is_sorted_by(|a, b| a >= b), "{name}");
        assert!(atlas.bytes() < 11_500_000, "{name}: {} bytes", atlas.bytes());
    }
}
