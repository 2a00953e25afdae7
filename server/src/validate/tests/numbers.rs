//! Fields with numbers.

use glam::Vec3;
use grasp_proto::v1;

use super::{FINITE, NAN, Request};
use crate::validate::testing::{
    giver, half_extents, half_space, placed, shoulder, standing, thesis, tube, turned, vector,
};

const SIZE: &str = "every size must be more than 0 and at most 1000 (1 km)";
const NEAR: &str = "no coordinate may be more than 1000 from 0 (1 km)";
const NOT_ZERO: &str = "it must be finite and not 0";
const UNIT: &str = "it must be a unit quaternion, within 1 %";
const INFINITY: f32 = f32::INFINITY;

/// Gives a field a number.
type SetNumber = fn(&mut Request, f32);

/// Fields, what they must be, and numbers that they must not be.
pub(super) const NUMBERS: &[(&str, &str, &[f32], SetNumber)] = &[
    (
        "holdout.scale",
        "it must be 0.25 to 4",
        &[0.0, -1.0, 0.24, 4.01, NAN, INFINITY, -INFINITY],
        |r, x| r.holdout_mut().scale = Some(x),
    ),
    (
        "holdout.mass_kg",
        "it must be more than 0 and at most 1000",
        &[0.0, -1.0, 1001.0, NAN, INFINITY],
        |r, x| r.holdout_mut().mass_kg = Some(x),
    ),
    ("holdout.up", NOT_ZERO, &[0.0, NAN, INFINITY], |r, x| {
        r.holdout_mut().up = Some(vector(x));
    }),
    (
        "holdout.client_from_object.orientation",
        UNIT,
        &[0.0, 0.98, 1.02, NAN, INFINITY, -INFINITY, 1e30],
        |r, x| r.holdout_mut().client_from_object = Some(turned(x)),
    ),
    (
        "holdout.client_from_object.position",
        FINITE,
        &[NAN, INFINITY],
        |r, x| r.holdout_mut().client_from_object = Some(placed(x)),
    ),
    (
        "holdout.client_from_object.position",
        NEAR,
        &[1e6, -1001.0],
        |r, x| r.holdout_mut().client_from_object = Some(placed(x)),
    ),
    (
        "holdout.presenting_hand.pose.scale",
        "it must be 0.5 to 2",
        &[0.49, 2.01, NAN],
        |r, x| giver(r).scale = Some(x),
    ),
    (
        "holdout.presenting_hand.pose.object_from_wrist.orientation",
        UNIT,
        &[0.0, NAN],
        |r, x| giver(r).object_from_wrist = Some(turned(x)),
    ),
    (
        "holdout.presenting_hand.pose.index.base_pitch",
        "the rig allows",
        &[4.0, -4.0, NAN],
        |r, x| giver(r).index.as_mut().unwrap().base_pitch = x,
    ),
    (
        "holdout.presenting_hand.pose.little.third_pitch",
        "the rig allows",
        &[9.0, NAN],
        |r, x| giver(r).little.as_mut().unwrap().third_pitch = Some(x),
    ),
    (
        "holdout.obstacles[0].tube.radii[0]",
        SIZE,
        &[0.0, -0.1, 1001.0, NAN],
        |r, x| tube(r).radii = vec![x],
    ),
    (
        "holdout.obstacles[1].box.half_extents",
        SIZE,
        &[0.0, -1.0, 1001.0],
        |r, x| half_extents(r, Vec3::new(1.0, x, 1.0)),
    ),
    (
        "holdout.obstacles[1].box.half_extents",
        FINITE,
        &[NAN, INFINITY],
        |r, x| half_extents(r, Vec3::new(1.0, x, 1.0)),
    ),
    (
        "holdout.obstacles[2].half_space.normal",
        NOT_ZERO,
        &[0.0, NAN],
        |r, x| half_space(r).normal = Some(vector(x)),
    ),
    ("holdout.obstacles[2].half_space.point", NEAR, &[1e6], |r, x| {
        half_space(r).point = Some(vector(x));
    }),
    (
        "receiver.scale",
        "it must be 0.5 to 2",
        &[0.49, 2.01, NAN],
        |r, x| {
            r.receiver_mut().scale = Some(x);
        },
    ),
    (
        "receiver.max_reach",
        "it must be more than 0 and at most 1000 (1 km)",
        &[0.0, -0.7, NAN, INFINITY],
        |r, x| r.receiver_mut().max_reach = Some(x),
    ),
    (
        "receiver.upper_arm_length",
        "it must be 0.1 to 0.6 (0.1 to 0.6 m)",
        &[0.09, 0.61, -0.3, NAN],
        |r, x| r.receiver_mut().upper_arm_length = Some(x),
    ),
    (
        "receiver.forearm_length",
        "it must be 0.1 to 0.6 (0.1 to 0.6 m)",
        &[0.09, 0.61, INFINITY],
        |r, x| r.receiver_mut().forearm_length = Some(x),
    ),
    (
        "receiver.height",
        "it must be 0.8 to 2.5 (0.8 to 2.5 m)",
        &[0.0, 0.79, 2.51, NAN],
        |r, x| standing(r, v1::Pose::default(), x),
    ),
    (
        "receiver.client_from_root.orientation",
        UNIT,
        &[0.5, NAN],
        |r, x| standing(r, turned(x), 1.7),
    ),
    (
        "receiver.client_from_root.position",
        FINITE,
        &[NAN, INFINITY],
        |r, x| standing(r, placed(x), 1.7),
    ),
    (
        "receiver.client_from_root",
        "it must be within 3 (3 m)",
        &[4.0],
        |r, x| standing(r, placed(x), 1.7),
    ),
    ("receiver.client_shoulder", FINITE, &[NAN], |r, x| shoulder(r, x)),
    ("receiver.client_shoulder", NEAR, &[1e6], |r, x| shoulder(r, x)),
    (
        "receiver.client_shoulder",
        "it must be within 3 (3 m)",
        &[3.1, -99.0],
        |r, x| shoulder(r, x),
    ),
    (
        "requirements.friction",
        "it must be more than 0 and at most 5",
        &[0.0, -1.0, 50.0, NAN],
        |r, x| r.requirements_mut().friction = Some(x),
    ),
    (
        "requirements.max_approach_angle",
        "with client_approach, it must be more than 0 and at most 3.1415927",
        &[0.0, -0.1, 3.2, NAN],
        |r, x| r.requirements_mut().max_approach_angle = x,
    ),
    ("requirements.client_approach", NOT_ZERO, &[0.0, NAN], |r, x| {
        r.requirements_mut().client_approach = Some(vector(x));
    }),
    (
        "requirements.thesis.max_comfort",
        "it must be finite and at least 0",
        &[-1.0, NAN, INFINITY],
        |r, x| thesis(r).max_comfort = Some(x),
    ),
    (
        "current.min_score_gain",
        "it must be 0 to 1, a difference of scores",
        &[-0.1, 1.1, NAN],
        |r, x| r.current.as_mut().unwrap().min_score_gain = Some(x),
    ),
];
