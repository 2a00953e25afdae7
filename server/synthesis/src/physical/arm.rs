//! A receiver's arm of two bones: whether it reaches a wrist pose, and where its elbow then is.

use std::f32::consts::PI;

use glam::Vec3;

use super::solids::TaperedCapsule;
use crate::{
    base::pose::Pose,
    model::{
        hand::{Handedness, rig::Rig},
        receiver::{Arm, ArmPose},
    },
};

/// Flexion, extension, and deviation toward thumb and little finger of a wrist, in radians (American Academy of Orthopaedic
/// Surgeons: 80°, 70°, 20° and 30°).
const FLEXION: f32 = 80.0 / 180.0 * PI;
const EXTENSION: f32 = 70.0 / 180.0 * PI;
const TOWARD_THUMB: f32 = 20.0 / 180.0 * PI;
const TOWARD_LITTLE: f32 = 30.0 / 180.0 * PI;

/// Cosine of the smallest angle between the bones: an elbow flexes by 145°.
const FLEXED_COS: f32 = 0.819;

/// Number of swivel angles of the elbow about the line from shoulder to wrist that are tried.
const SWIVELS: usize = 15;

/// Range of the swivel, from inward to outward, in radians. 0 is the hanging elbow, a right angle an elbow as high as the
/// shoulder if that is level with the wrist. Of a receiver of whom nothing is known, the elbow hangs.
const SWIVEL_RANGE: [f32; 2] = [-1.75, 1.75];
const HANGING_RANGE: [f32; 2] = [-0.55, 1.05];

/// How far above the shoulder the elbow may be, as the sine of the upper arm's rise: raising it further takes effort that
/// nobody spends on taking something. The elbow of an assumed receiver is no higher than the shoulder.
const MAX_RISE: f32 = 0.4;

/// Weight of a swivel of one radian against a wrist at the end of its range: people let the elbow hang, and turn it out before
/// the wrist is strained.
const SWIVEL_WEIGHT: f32 = 0.35;

/// Radii of an arm at wrist, elbow and shoulder, in metres (ANSUR II: circumferences of 0.17, 0.28 and 0.34 m).
const RADII: [f32; 3] = [0.027, 0.044, 0.052];

/// An elbow's position and how uncomfortable it is, from 0.
#[derive(Clone, Copy, Debug)]
pub(super) struct Elbow {
    pub(super) pose: ArmPose,
    pub(super) strain: f32,
}

/// The elbows with which an arm reaches a wrist, in no order. `up` is a unit vector; all are in one frame.
pub(super) fn elbows(
    arm: Arm,
    (rig, wrist): (&Rig, Pose),
    up: Vec3,
    is_assumed: bool,
) -> impl Iterator<Item = Elbow> {
    let Arm {
        shoulder,
        upper_arm,
        forearm,
    } = arm;
    let reach = wrist.position - shoulder;
    let distance = reach.length();
    let toward = reach / distance.max(f32::MIN_POSITIVE);
    // The law of cosines, for the elbow's place along the line from the shoulder to the wrist and its distance from it.
    let along = (upper_arm * upper_arm - forearm * forearm + distance * distance) / (2.0 * distance);
    let square = upper_arm * upper_arm - along * along;
    let flexed = upper_arm * upper_arm + forearm * forearm - 2.0 * upper_arm * forearm * FLEXED_COS;
    let is_in_reach = square >= 0.0 && distance * distance >= flexed;
    let hanging = (-up).reject_from(toward);
    let hanging = hanging.normalize_or(toward.any_orthonormal_vector());
    let out = toward.cross(hanging);
    let radius = square.max(0.0).sqrt();
    let count = if is_in_reach { SWIVELS } else { 0 };
    let outward = match rig.handedness {
        Handedness::Right => -1.0,
        Handedness::Left => 1.0,
    };
    let ([innermost, outermost], max_rise) = if is_assumed {
        (HANGING_RANGE, 0.0)
    } else {
        (SWIVEL_RANGE, MAX_RISE)
    };
    let (wrist_from_frame, range) = (wrist.inverse(), WristRange::of(rig.handedness));
    (0..count).filter_map(move |index| {
        let share = index as f32 / (SWIVELS - 1) as f32;
        let swivel = innermost + share * (outermost - innermost);
        let (sin, cos) = (outward * swivel).sin_cos();
        let elbow = shoulder + toward * along + (hanging * cos + out * sin) * radius;
        let back = wrist_from_frame.transform_vector(elbow - wrist.position);
        let is_raised = (elbow - shoulder).dot(up) > max_rise * upper_arm;
        if is_raised || !range.allows(back) {
            return None;
        }
        let (flexion, deviation) = wrist_angles(rig.handedness, back);
        let bent = [
            flexion / if flexion > 0.0 { FLEXION } else { EXTENSION },
            deviation
                / if deviation > 0.0 {
                    TOWARD_LITTLE
                } else {
                    TOWARD_THUMB
                },
        ];
        let strain = bent[0].powi(2) + bent[1].powi(2) + SWIVEL_WEIGHT * swivel * swivel;
        Some(Elbow {
            pose: ArmPose {
                shoulder,
                elbow,
                flexion,
                deviation,
                is_assumed,
            },
            strain,
        })
    })
}

/// Flexion of a wrist toward the palm and its deviation toward the little finger, in radians, by the direction to the elbow in
/// the wrist's frame.
fn wrist_angles(handedness: Handedness, back: Vec3) -> (f32, f32) {
    let flexion = f32::atan2(back.z, -back.y);
    let deviation = f32::atan2(little(handedness, back), back.y.hypot(back.z));
    (flexion, deviation)
}

/// The part of a direction in the wrist's frame that points to the side of the little finger.
fn little(handedness: Handedness, direction: Vec3) -> f32 {
    match handedness {
        Handedness::Right => -direction.x,
        Handedness::Left => direction.x,
    }
}

/// The directions in which a forearm may go in the wrist's frame.
///
/// Each of flexion and deviation is measured as the other axis shows it, straight from behind, so that both are in range
/// whichever of them comes first.
#[derive(Clone, Copy)]
struct WristRange {
    handedness: Handedness,
    /// Tangents of the least and the largest angle.
    flexion: [f32; 2],
    deviation: [f32; 2],
}

impl WristRange {
    fn of(handedness: Handedness) -> Self {
        Self {
            handedness,
            flexion: [-EXTENSION, FLEXION].map(f32::tan),
            deviation: [-TOWARD_THUMB, TOWARD_LITTLE].map(f32::tan),
        }
    }

    /// True if the wrist bends so far that its forearm goes in a direction.
    fn allows(&self, back: Vec3) -> bool {
        let is_between =
            |part: f32, [least, most]: [f32; 2]| part >= least * -back.y && part <= most * -back.y;
        back.y < 0.0
            && is_between(back.z, self.flexion)
            && is_between(little(self.handedness, back), self.deviation)
    }
}

/// Forearm and upper arm as solids, in the arm's frame. The forearm starts some way behind the wrist, where the hand's own
/// solids end.
pub(super) fn solids_of(arm: &ArmPose, wrist: Vec3) -> [TaperedCapsule; 2] {
    const START: f32 = 0.15;
    let [at_wrist, at_elbow, at_shoulder] = RADII;
    let start = wrist.lerp(arm.elbow, START);
    let start_radius = at_wrist + START * (at_elbow - at_wrist);
    [
        TaperedCapsule::new(start, arm.elbow, start_radius, at_elbow),
        TaperedCapsule::new(arm.elbow, arm.shoulder, at_elbow, at_shoulder),
    ]
}
