//! The solids of a hand.

use std::array;

use glam::Vec3;

use super::TaperedCapsule;
use crate::{
    hand::{
        Digit, HandPose,
        joints::{HandJoints, index, thesis_from_openxr_frame},
        rig::Rig,
    },
    pose::Pose,
};

/// Solids that the palm is made of.
pub const PALM_SOLIDS: usize = 8;

/// Solids that the forearm is made of: side by side, since it is twice as wide as thick at the wrist.
pub const FOREARM_SOLIDS: usize = 2;

/// How much of the forearm counts, in metres behind the wrist: to the elbow's end of an adult's forearm.
const FOREARM_LENGTH: f32 = 0.25;

/// How much thicker the forearm is at its far end than at the wrist: mean circumferences of forearm and wrist in
/// ANSUR II are 0.31 m and 0.18 m.
const FOREARM_TAPER: f32 = 1.7;

/// Breadth of a wrist per thickness.
const WRIST_BREADTH: f32 = 1.45;

/// A posed hand and its forearm as solids, in the frame of the pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HandSolids {
    /// The three links of each digit, thumb first. The thumb's first one is its metacarpal.
    pub phalanges: [[TaperedCapsule; 3]; 5],
    /// The metacarpals of index, middle, ring and little finger, then what fills the palm between them and the thumb.
    pub palm: [TaperedCapsule; PALM_SOLIDS],
    /// The forearm, from the wrist backward.
    pub forearm: [TaperedCapsule; FOREARM_SOLIDS],
}

impl HandSolids {
    /// The solids of a posed rig.
    pub fn of_pose(rig: &Rig, pose: &HandPose) -> Self {
        Self::of_joints(&HandJoints::of_pose(rig, pose))
    }

    /// The solids of tracked joints, in their frame.
    pub fn of_joints(joints: &HandJoints) -> Self {
        let at = |joint: usize| joints.joints[joint].pose.position;
        let radius = |joint: usize| joints.joints[joint].radius;
        let bone = |from: usize, to: usize| TaperedCapsule::new(at(from), at(to), radius(from), radius(to));

        let phalanges = array::from_fn(|digit| {
            let joints = joints_of_digit(digit);
            link_solids(joints.map(at), joints.map(radius))
        });
        let metacarpals: [_; 4] =
            array::from_fn(|i| bone(index::FIRST_OF_DIGIT[i + 1], index::FIRST_OF_DIGIT[i + 1] + 1));
        let between = |i: usize, j: usize| {
            let (a, b): (TaperedCapsule, TaperedCapsule) = (metacarpals[i], metacarpals[j]);
            TaperedCapsule::new(
                (a.start + b.start) * 0.5,
                (a.end + b.end) * 0.5,
                0.5 * (a.start_radius + b.start_radius),
                0.5 * (a.end_radius + b.end_radius),
            )
        };
        let palm = [
            metacarpals[0],
            metacarpals[1],
            metacarpals[2],
            metacarpals[3],
            between(0, 1),
            between(1, 2),
            between(2, 3),
            // The web between the thumb and the index finger.
            bone(index::FIRST_OF_DIGIT[0] + 1, index::FIRST_OF_DIGIT[1]),
        ];
        Self {
            phalanges,
            palm,
            forearm: forearm(
                thesis_from_openxr_frame(joints.joints[index::WRIST].pose),
                radius(index::WRIST),
                Vec3::NEG_Y,
            ),
        }
    }

    /// All solids: phalanges by digit, palm, forearm.
    pub fn iter(&self) -> impl Iterator<Item = &TaperedCapsule> {
        self.phalanges
            .as_flattened()
            .iter()
            .chain(&self.palm)
            .chain(&self.forearm)
    }
}

/// The `OpenXR` joints at the ends of a digit's three links.
fn joints_of_digit(digit: usize) -> [usize; 4] {
    let tip = index::TIP_OF_DIGIT[digit];
    [tip - 3, tip - 2, tip - 1, tip]
}

/// Distances from joint to skin at the ends of a digit's three links, in metres.
pub fn link_radii(rig: &Rig, digit: Digit) -> [f32; 4] {
    joints_of_digit(digit.index()).map(|joint| rig.joint_radii[joint])
}

/// The links of a digit, whose joints and tip are at `points`, with distances from there to the skin. The tip lies on
/// the skin, so the last ball ends there.
pub fn link_solids(points: [Vec3; 4], radii: [f32; 4]) -> [TaperedCapsule; 3] {
    let link = |i: usize| TaperedCapsule::new(points[i], points[i + 1], radii[i], radii[i + 1]);
    let last = link(2);
    let direction = (last.end - last.start).normalize_or_zero();
    let inset = last.end_radius.min(last.length());
    let end = last.end - direction * inset;
    [link(0), link(1), TaperedCapsule { end, ..last }]
}

/// The forearm behind a wrist of `radius` metres (half its thickness), toward a unit vector of the wrist frame.
fn forearm(frame_from_wrist: Pose, radius: f32, toward: Vec3) -> [TaperedCapsule; FOREARM_SOLIDS] {
    let far = toward * FOREARM_LENGTH;
    let across = Vec3::X * (radius * (WRIST_BREADTH - 1.0));
    [-1.0, 1.0].map(|side| {
        TaperedCapsule::new(
            frame_from_wrist.transform_point(across * side),
            frame_from_wrist.transform_point(far + across * side),
            radius,
            radius * FOREARM_TAPER,
        )
    })
}
