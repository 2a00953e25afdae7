//! Sleeves: show whose hand it is and where its forearm runs.

use glam::{Vec2, Vec3};
use grasp_synthesis::model::hand::joints::{HandJoints, index};

use crate::{
    primitives::lathe,
    scene::{Finish, Part},
};

/// Length of the sleeve, in metres; long enough to leave the picture.
const LENGTH: f32 = 0.17;

/// Distance of the cuff's edge from the wrist joint, away from the hand, in metres.
const CUFF_START: f32 = 0.006;

/// Gap between wrist and cuff, in metres.
const CLEARANCE: f32 = 0.003;

/// Width of the cuff along the arm, and its thickness over the sleeve, in metres.
const CUFF_WIDTH: f32 = 0.020;
const CUFF_THICKNESS: f32 = 0.0022;

/// Ratio of the sleeve's widths at its end and at the cuff.
const WIDENING: f32 = 1.28;

/// Skin within this distance of the joint along the arm belongs to the wrist, in metres.
const WRIST_BAND: f32 = 0.012;

/// Skin farther from the joint than this belongs to a curled finger, not to the wrist, in metres.
const MAX_WRIST_DISTANCE: f32 = 0.055;

/// A sleeve from the wrist away from the hand. `skin` is the posed skin around the joints.
pub(crate) fn sleeve(name: &str, joints: &HandJoints, skin: &[Vec3], colour: [f32; 4]) -> Part {
    let wrist = joints.joints[index::WRIST];
    let (centre, half_widths) = wrist_section(joints, skin);
    let outer = half_widths + CLEARANCE;
    let mean = 0.5 * (outer.x + outer.y);
    let cuff = mean + CUFF_THICKNESS;
    let inner = mean - CLEARANCE * 0.5;
    let end = mean * WIDENING;
    // From inside the cuff around its hem, over the cuff's border, down to the end.
    let profile = [
        Vec2::new(0.0, 0.010),
        Vec2::new(inner, 0.010),
        Vec2::new(inner, 0.001),
        Vec2::new(mean, 0.0),
        Vec2::new(cuff, 0.001),
        Vec2::new(cuff * 1.01, CUFF_WIDTH),
        Vec2::new(mean * 1.015, CUFF_WIDTH + 0.0012),
        Vec2::new(0.5 * (mean + end), LENGTH * 0.55),
        Vec2::new(end, LENGTH - 0.004),
        Vec2::new(end - 0.0015, LENGTH - 0.001),
        Vec2::new(end - 0.005, LENGTH),
        Vec2::new(0.0, LENGTH),
    ];
    let mut part = lathe(name, Vec3::ZERO, Vec3::Z, &profile, colour).with_finish(Finish::Cloth);
    let stretch = (outer / mean).extend(1.0);
    let offset = centre.extend(CUFF_START);
    for position in &mut part.positions {
        // The joint's +z points away from the fingertips.
        *position = wrist.pose.transform_point(*position * stretch + offset);
    }
    part
}

/// Centre and half widths of the wrist's cross-section in the wrist joint's x and y, in metres.
fn wrist_section(joints: &HandJoints, skin: &[Vec3]) -> (Vec2, Vec2) {
    let wrist = joints.joints[index::WRIST];
    let joint_from_world = wrist.pose.inverse();
    let mut low = Vec2::INFINITY;
    let mut high = Vec2::NEG_INFINITY;
    for &position in skin {
        let local = joint_from_world.transform_point(position);
        if local.z.abs() < WRIST_BAND && local.truncate().length() < MAX_WRIST_DISTANCE {
            low = low.min(local.truncate());
            high = high.max(local.truncate());
        }
    }
    let half = (high - low) * 0.5;
    if half.is_finite() && half.min_element() > 0.005 {
        ((high + low) * 0.5, half)
    } else {
        (Vec2::ZERO, Vec2::splat(wrist.radius.max(0.015)))
    }
}
