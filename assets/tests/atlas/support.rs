//! Atlases that several tests use.

use grasp_assets::{hands, objects};
use grasp_synthesis::{
    atlas::growth::{Grown, Growth},
    hand::{Handedness, rig::Rig},
    object::GraspObject,
    physical::grip::Gripper,
};

pub(crate) fn object(name: &str) -> &'static GraspObject {
    &objects::object(name).expect("it is built in").object
}

pub(crate) fn adult(handedness: Handedness) -> &'static Rig {
    &hands::hand("adult", handedness).expect("it is built in").rig
}

/// What grows in some rounds.
pub(crate) fn grown(mut growth: Growth<'_>, rounds: usize) -> Grown {
    let mut gripper = Gripper::default();
    for _ in 0..rounds {
        growth.round(&mut gripper);
    }
    growth.grown()
}
