//! What a giver excludes, against comparing hands one by one.

use glam::{Quat, Vec3};
use grasp_assets::{atlases::atlas as built_in_atlas, objects::object as built_in};
use grasp_synthesis::{
    base::pose::Pose,
    geometry::mesh::TriangleMesh,
    known::{atlas::Atlas, codec::decode, grips::Grips, growth::Growth},
    model::{
        hand::{HandPose, Handedness, joints::HandJoints, rig::Rig},
        object::GraspObject,
    },
    physical::{
        grip::GIVER_CLEARANCE,
        solids::{HandSolids, PreparedHand, TrackedSolids},
    },
};

use crate::support::{adult, grown, object};

/// A mesh `scale` times as large.
fn scaled(object: &GraspObject, scale: f32) -> GraspObject {
    let mesh = object.surface.mesh();
    let positions = mesh.positions().iter().map(|place| *place * scale).collect();
    let mesh = TriangleMesh::new(positions, mesh.triangles().to_vec()).expect("it was one before");
    GraspObject::new(mesh, object.mass, object.centre_of_mass * scale, None, &[]).expect("it was one before")
}

/// A posed hand as a giver's.
fn giver_of(rig: &Rig, pose: &HandPose) -> PreparedHand {
    PreparedHand::new(&TrackedSolids::of_joints(&HandJoints::of_pose(rig, pose)))
}

#[test]
fn what_is_excluded_meets_the_giver() {
    let rig = adult(Handedness::Right);
    for name in ["remote", "scissors", "scalpel"] {
        let object = object(name);
        let atlas = grown(Growth::new(object, rig), 120).atlas;
        let (mut meeting, mut excluded, mut free) = (0, 0, 0);
        // Known grips as givers, where they are and some way off; then the object lies between two hands. Hundreds of them
        // among a thousand grips, as fewer are no measure of how many hands are settled.
        for (turn, giver) in atlas.entries().iter().step_by(4).enumerate() {
            let mut pose = giver.grip.pose;
            let off = 0.01 * (turn % 6) as f32;
            pose.frame_from_wrist = Pose::new(
                pose.frame_from_wrist.position - off * pose.frame_from_wrist.transform_vector(Vec3::Z),
                Quat::from_rotation_x(0.05 * turn as f32) * pose.frame_from_wrist.orientation,
            );
            let hand = giver_of(rig, &pose);
            let out_of_question = atlas.excluded_by(&hand);
            for (index, entry) in atlas.entries().iter().enumerate() {
                let solids = HandSolids::of_pose(rig, &entry.grip.pose);
                let meets = hand.is_neared_by(solids.iter(), GIVER_CLEARANCE);
                let is_excluded = out_of_question.contains(index as u16);
                assert!(
                    meets || !is_excluded,
                    "{name}: {index} keeps clear of giver {turn}"
                );
                meeting += usize::from(meets);
                excluded += usize::from(is_excluded);
                free += usize::from(!meets);
            }
        }
        assert!(free > 50, "{name}: only {free} keep clear of anybody");
        // It is worth asking only if it settles many.
        assert!(
            5 * excluded > 2 * meeting,
            "{name}: {excluded} of {meeting} are excluded"
        );
    }
}

#[test]
fn without_grips_nothing_is_excluded() {
    let rig = adult(Handedness::Right);
    let known = grown(Growth::new(object("remote"), rig), 2).atlas;
    let giver = giver_of(rig, &known.entries()[0].grip.pose);
    let empty = Atlas::new(object("remote"), rig, Grips::default(), false);
    for atlas in [empty, Atlas::default()] {
        assert!(!atlas.excluded_by(&giver).contains(0));
    }
}

#[test]
fn a_large_object_takes_no_more_memory_than_a_small_one() {
    let rig = adult(Handedness::Right);
    let small = built_in("remote").expect("it is built in");
    let known = grown(Growth::new(&small.object, rig), 20).atlas;
    let bytes_of = |object: &GraspObject| Atlas::new(object, rig, known.grips().clone(), false).bytes();
    let usual = bytes_of(&small.object);
    let large = bytes_of(&scaled(&small.object, 40.0));
    assert!(large < 3 * usual, "{large} bytes instead of {usual}");
}

#[test]
fn a_complete_atlas_excludes_only_what_meets_and_begins_with_the_best() {
    let rig = adult(Handedness::Right);
    for name in ["remote", "scissors"] {
        let object = object(name);
        let bytes = built_in_atlas(name, rig).expect("it comes with the server");
        let atlas = decode(bytes, object, rig).expect("it is of today").atlas;
        let entries = atlas.entries();
        let (mut meeting, mut excluded) = (0, 0);
        for giver in entries.iter().step_by(entries.len() / 8) {
            let hand = giver_of(rig, &giver.grip.pose);
            let out_of_question = atlas.excluded_by(&hand);
            // Some of every block that is looked at together.
            for index in (0..entries.len()).step_by(61) {
                let solids = HandSolids::of_pose(rig, &entries[index].grip.pose);
                let meets = hand.is_neared_by(solids.iter(), GIVER_CLEARANCE);
                let is_excluded = out_of_question.contains(index as u16);
                assert!(meets || !is_excluded, "{name}: {index} keeps clear");
                meeting += usize::from(meets);
                excluded += usize::from(is_excluded);
            }
        }
        // So many hands fill more cells than are kept: those that few fill are left out, and exclude little.
        assert!(
            3 * excluded > meeting,
            "{name}: {excluded} of {meeting} are excluded"
        );
        let sums: Vec<u32> = entries
            .iter()
            .map(|entry| entry.scores.iter().map(|&score| u32::from(score)).sum())
            .collect();
        assert!(sums.is_sorted_by(|a, b| a >= b), "{name}");
        assert!(atlas.bytes() < 10_000_000, "{name}: {} bytes", atlas.bytes());
    }
}
