//! Whether re-plans go to the nearest of the valid known grips, by checking all of them.

use grasp_proto::v1;
use grasp_synthesis::{
    base::pose::Pose,
    known::recheck::GripChecker,
    model::{
        hand::{Handedness, joints::openxr_from_thesis_frame},
        strategy::Validity,
    },
    physical::{
        grip::Gripper,
        scene::{ObjectScene, Presented},
    },
    search::current::METRES_PER_RADIAN,
};
use grasp_tests::random_holdouts::ClientHoldout;
use serde::Serialize;

use crate::tracks::objects::{HeldObject, default_rig};

/// How much farther than the nearest valid grip one is that counts as near.
const NEARLY_NEAREST: f32 = 1.25;

/// Rounding on the wire, in metres.
const ROUNDING: f32 = 1e-4;

/// Re-plans while a known grip of the same hand was valid.
#[derive(Debug, Default, Serialize)]
pub(crate) struct Nearness {
    /// All of them.
    replans: usize,
    /// Those that went to the nearest grip.
    nearest: usize,
    /// Those that went to a grip, or to another grasp, at most 1.25 times as far.
    near: usize,
}

impl Nearness {
    /// Counts a re-plan from one grasp to another.
    pub(crate) fn add(
        &mut self,
        object: &HeldObject,
        holdout: &ClientHoldout,
        before: &v1::Grasp,
        after: &v1::Grasp,
    ) {
        let from = wrist(before);
        let Some(least) = least_way(object, holdout, handedness(before), from) else {
            return;
        };
        self.replans += 1;
        if handedness(after) == handedness(before) {
            let length = way(from, wrist(after));
            self.nearest += usize::from(length <= least + ROUNDING);
            self.near += usize::from(length <= NEARLY_NEAREST * least + ROUNDING);
        }
    }
}

/// The way from a wrist to that of the nearest valid grip of a hand; none if none is valid.
fn least_way(object: &HeldObject, holdout: &ClientHoldout, side: Handedness, from: Pose) -> Option<f32> {
    let rig = default_rig(side);
    let holdout = holdout.holdout(object.object.clone());
    let scene = ObjectScene::new(&holdout.object, holdout.object.friction_under(Validity::Physical));
    let presented = Presented::of(&holdout);
    let checker = GripChecker::new(&scene, rig, &presented);
    let mut gripper = Gripper::default();
    let entries = object.atlas(side).entries().iter();
    entries
        .filter_map(|entry| checker.check(entry, &entry.tracked_solids(rig), &mut gripper))
        .map(|grasp| way(from, openxr_from_thesis_frame(grasp.pose.frame_from_wrist)))
        .min_by(f32::total_cmp)
}

/// The way between two wrists, as re-plans measure it.
fn way(from: Pose, to: Pose) -> f32 {
    let angle = from.orientation.angle_between(to.orientation);
    from.position.distance(to.position) + METRES_PER_RADIAN * angle
}

/// The wrist of a grasp in the object's frame.
fn wrist(grasp: &v1::Grasp) -> Pose {
    let pose = grasp.object_from_wrist().expect("it is set");
    Pose::new(pose.position(), pose.orientation().normalize())
}

fn handedness(grasp: &v1::Grasp) -> Handedness {
    match grasp.hand.as_ref().expect("it is set").handedness() {
        v1::Handedness::Left => Handedness::Left,
        _ => Handedness::Right,
    }
}
