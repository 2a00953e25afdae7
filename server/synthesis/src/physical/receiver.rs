//! Where the receiver stands, whether a hand suits that, and the arm that reaches it.
//!
//! Of the receiver's body, a client may give the shoulder; then the arm must reach the wrist. Otherwise people hand things over
//! face to face: the giver's forearm shows where the giver's body is, and the receiver stands opposite or at an angle, as
//! far away as both arms reach comfortably. Their shoulders are 0.65 to 1.2 m apart, which is personal distance (E. T. Hall,
//! "The Hidden Dimension", 1966: 0.46 to 1.22 m). People keep to a distance of their own when they hand things over (C. Hansen
//! et al., "Human-human handover tasks and how distance and object mass matter", 2017).

use std::f32::consts::PI;

use glam::{Quat, Vec3};

use super::{barriers::Barriers, solids::TaperedCapsule};
use crate::{
    base::{pose::Pose, ramp::ramp},
    geometry::mesh_bvh::MeshBvh,
    model::{
        hand::{Handedness, joints::thesis_from_openxr_frame, rig::Rig},
        holdout::{Arm, ArmPose, FOREARM_LENGTH, Stance, UPPER_ARM_LENGTH},
    },
};

/// Range of the horizontal distance of two shoulders in a handover, in metres.
const APART: [f32; 2] = [0.65, 1.2];

/// Comfortable horizontal distance of the receiver's shoulder from the object, in metres, and its range by [`APART`].
const COMFORTABLE: f32 = 0.42;
const NEAREST: f32 = 0.25;
const FARTHEST: f32 = 0.55;

/// Distance in metres by which a receiver must be nearer than comfortable to be modelled separately.
const MUCH_NEARER: f32 = 0.05;

/// Angles of the receiver's possible directions from the one opposite the giver, in radians: up to 30° to either side.
const ANGLES: [f32; 3] = [0.0, 0.524, -0.524];

/// Number of directions if nothing shows where the giver stands.
const ALL_ROUND: usize = 6;

/// Shortest horizontal part of the giver's forearm, of 1, that shows where the giver stands.
const MIN_HORIZONTAL: f32 = 0.25;

/// Lean of the giver's upper arm toward the body's back, as a tangent: an upper arm nearly hangs.
const UPPER_ARM_LEAN: f32 = 0.35;

/// Range of the shoulder's height above the object, in metres: things are handed over between a hanging hand and the shoulder.
const HEIGHTS: [f32; 2] = [0.0, 0.6];

/// Distance of the shoulder from the object up to which the arm reaches it without being stretched, in metres.
const REACH: f32 = 0.6;

/// Distance of the wrist from the held part, in metres.
const HAND: f32 = 0.1;

/// Cosines of the angle between a straight forearm and the nearest plausible one from which a hand suits, and suits best.
const TOWARD: [f32; 2] = [0.26, 0.82];

/// Factor on [`Receiver::suits`] if no arm reaches the wrist: less than [`SUITABLE`].
const OUT_OF_REACH: f32 = 0.45;

/// Cosines of the angle between the receiver's and the giver's forearm at which they are well apart, and collide: 80° and 60°.
const TOGETHER: [f32; 2] = [0.17, 0.5];

/// Smallest value of [`Receiver::suits`] of a plausible hand.
pub const SUITABLE: f32 = 0.5;

/// Where the receiver stands, prepared for many hands. All is in the object's frame.
#[derive(Clone, Debug)]
pub struct Receiver {
    stance: Stance,
    /// Plausible arms, and the directions of their forearms from wrist to elbow, unit vectors.
    arms: Vec<Arm>,
    directions: Vec<Vec3>,
    /// Direction of the giver's forearm, from wrist to elbow.
    giver: Option<Vec3>,
    /// Unit vector against gravity.
    up: Vec3,
}

impl Receiver {
    /// An unknown receiver, which any hand suits.
    pub const ANYWHERE: Self = Self {
        stance: Stance::Any,
        arms: Vec::new(),
        directions: Vec::new(),
        giver: None,
        up: Vec3::Y,
    };

    /// The receiver of an object whose centre of mass is `centre`, from a giver whose wrist has this `OpenXR` joint
    /// frame, if it is known. `up` is a unit vector.
    pub fn new(stance: Stance, giver_wrist: Option<Pose>, centre: Vec3, up: Vec3) -> Self {
        let mut receiver = Self {
            stance,
            up,
            ..Self::ANYWHERE
        };
        match (stance, giver_wrist.map(thesis_from_openxr_frame)) {
            (Stance::Any, _) | (Stance::Facing, None) => {}
            (Stance::At(arm), _) => receiver.add(arm, centre),
            (Stance::Facing, Some(wrist)) => {
                receiver.face(wrist.position, wrist.transform_vector(Vec3::NEG_Y), centre);
            }
        }
        receiver
    }

    /// The receiver of an object whose centre of mass is `centre` from a giver whose hand is there, too, with the forearm in
    /// this direction from wrist to elbow. Both directions are unit vectors.
    pub fn facing(giver_forearm: Vec3, centre: Vec3, up: Vec3) -> Self {
        let mut receiver = Self {
            stance: Stance::Facing,
            up,
            ..Self::ANYWHERE
        };
        receiver.face(centre + giver_forearm * HAND, giver_forearm, centre);
        receiver
    }

    /// Adds the arms of receivers who face a giver with this wrist and forearm.
    fn face(&mut self, wrist: Vec3, forearm: Vec3, centre: Vec3) {
        self.giver = Some(forearm);
        let up = self.up;
        let horizontal = forearm.reject_from_normalized(up);
        let is_clear = horizontal.length() >= MIN_HORIZONTAL;
        let behind = horizontal.normalize_or(up.any_orthonormal_vector());
        let upper_arm = (up + behind * UPPER_ARM_LEAN).normalize_or(up) * UPPER_ARM_LENGTH;
        let shoulder = wrist + forearm * FOREARM_LENGTH + upper_arm;
        let from_object = shoulder - centre;
        let height = from_object.dot(up).clamp(HEIGHTS[0], HEIGHTS[1]);
        let theirs = from_object.dot(behind);
        let reached = (REACH * REACH - height * height).max(0.0).sqrt();
        let at = |distance: f32| {
            let apart = distance.max(APART[0] - theirs).min(APART[1] - theirs);
            apart.min(reached).clamp(NEAREST, FARTHEST)
        };
        let [comfortable, near] = [COMFORTABLE, NEAREST].map(at);
        let arm_toward = |angle: f32, distance: f32| Arm {
            shoulder: centre + Quat::from_axis_angle(up, angle) * -behind * distance + up * height,
            upper_arm: UPPER_ARM_LENGTH,
            forearm: FOREARM_LENGTH,
        };
        if is_clear {
            for angle in ANGLES {
                self.add(arm_toward(angle, comfortable), centre);
                if comfortable - near > MUCH_NEARER {
                    self.add(arm_toward(angle, near), centre);
                }
            }
        } else {
            for turn in 0..ALL_ROUND {
                let angle = turn as f32 * std::f32::consts::TAU / ALL_ROUND as f32;
                self.add(arm_toward(angle, near), centre);
            }
        }
    }

    /// Adds an arm, whose elbow hangs while the hand is at `centre`.
    fn add(&mut self, arm: Arm, centre: Vec3) {
        let to_shoulder = arm.shoulder - centre;
        let distance = to_shoulder.length();
        let toward = to_shoulder / distance.max(f32::MIN_POSITIVE);
        let wrist = centre + toward * HAND.min(0.5 * distance);
        let Arm {
            upper_arm, forearm, ..
        } = arm;
        // As far as the bones reach; a receiver who stands farther away leans toward the object.
        let [bent, stretched] = [1.2 * (upper_arm - forearm).abs(), 0.98 * (upper_arm + forearm)];
        let reach = (distance - HAND).max(bent).min(stretched).max(f32::MIN_POSITIVE);
        let along = (forearm * forearm - upper_arm * upper_arm + reach * reach) / (2.0 * reach);
        let drop = (forearm * forearm - along * along).max(0.0).sqrt();
        let hanging = (-self.up).reject_from(toward).normalize_or_zero();
        let elbow = wrist + toward * along + hanging * drop;
        self.arms.push(arm);
        self.directions.push((elbow - wrist).normalize_or(toward));
    }

    /// True if the receiver's arms are known or assumed.
    pub fn is_expected(&self) -> bool {
        !self.arms.is_empty()
    }

    /// True if the arm must reach the wrist.
    pub(crate) fn must_reach(&self) -> bool {
        matches!(self.stance, Stance::At(_))
    }

    /// How well a hand suits the receiver's place, 0 to 1: 1 if its forearm, straight behind the wrist, comes from there
    /// and not from the giver's side; less than [`SUITABLE`] if no plausible arm reaches the wrist. 1 for an unknown receiver.
    /// Takes about a microsecond.
    pub fn suits(&self, rig: &Rig, object_from_wrist: Pose) -> f32 {
        let suits = self.suits_forearm(object_from_wrist.transform_vector(Vec3::NEG_Y));
        if suits < SUITABLE || self.has_elbow(rig, object_from_wrist) {
            suits
        } else {
            suits * OUT_OF_REACH
        }
    }

    /// How well a forearm's direction from wrist to elbow, a unit vector, suits the receiver's place: [`Self::suits`] of
    /// a wrist that an arm reaches. Takes some nanoseconds.
    #[inline]
    pub fn suits_forearm(&self, along: Vec3) -> f32 {
        if self.arms.is_empty() {
            return 1.0;
        }
        let nearest = self
            .directions
            .iter()
            .map(|direction| direction.dot(along))
            .fold(-1.0, f32::max);
        let toward = ramp(nearest, TOWARD);
        let together = self.giver.map_or(0.0, |giver| ramp(giver.dot(along), TOGETHER));
        toward * (1.0 - together)
    }

    /// The arm of a hand, the least strained of those that are clear of `barriers` and of the object; `None` if it does not reach
    /// the wrist.
    pub fn arm(&self, rig: &Rig, wrist: Pose, surface: &MeshBvh, barriers: Barriers<'_>) -> Option<ArmPose> {
        let is_assumed = !self.must_reach();
        let mut all: Vec<Elbow> = self
            .arms
            .iter()
            .flat_map(|&arm| elbows(arm, (rig, wrist), self.up, is_assumed))
            .collect();
        all.sort_by(|a, b| a.strain.total_cmp(&b.strain));
        let is_clear = |elbow: &&Elbow| {
            let solids = solids_of(&elbow.pose, wrist.position);
            !barriers.comes_within(solids.iter(), 0.0)
                && solids.iter().all(|solid| !surface.comes_within(solid, 0.0))
        };
        all.iter().find(is_clear).map(|elbow| elbow.pose)
    }

    /// True if the arm need not reach the wrist, or does.
    pub fn reaches(&self, rig: &Rig, wrist: Pose) -> bool {
        !self.must_reach() || self.has_elbow(rig, wrist)
    }

    /// If the arm must reach the wrist: the distance of its shoulder from there, and the length of its stretched bones, in metres.
    pub(crate) fn shoulder_distance(&self, wrist: Pose) -> Option<[f32; 2]> {
        match self.stance {
            Stance::At(arm) => Some([arm.shoulder.distance(wrist.position), arm.upper_arm + arm.forearm]),
            Stance::Any | Stance::Facing => None,
        }
    }

    /// True if one of the arms reaches the wrist, or if none is expected.
    fn has_elbow(&self, rig: &Rig, wrist: Pose) -> bool {
        let has_elbow = |&arm: &Arm| {
            elbows(arm, (rig, wrist), self.up, !self.must_reach())
                .next()
                .is_some()
        };
        self.arms.is_empty() || self.arms.iter().any(has_elbow)
    }
}

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

/// Range of the swivel, from inward to outward, in radians. 0 is the hanging elbow.
const SWIVEL_RANGE: [f32; 2] = [-1.75, 1.75];
const HANGING_RANGE: [f32; 2] = [-0.55, 1.05];

/// Sine of the upper arm's largest rise above the shoulder. An assumed receiver's elbow is no higher than the shoulder.
const MAX_RISE: f32 = 0.4;

/// Weight of a swivel of one radian against a wrist at the end of its range: people turn out the elbow before straining the wrist.
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
    let outward = -rig.handedness.thumb_side();
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
        let bent = |angle: f32, [least, most]: [f32; 2]| angle / if angle > 0.0 { most } else { least };
        let flexed = bent(flexion, [EXTENSION, FLEXION]);
        let deviated = bent(deviation, [TOWARD_THUMB, TOWARD_LITTLE]);
        let strain = flexed.powi(2) + deviated.powi(2) + SWIVEL_WEIGHT * swivel * swivel;
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

/// Flexion toward the palm and deviation toward the little finger, in radians, of a wrist with the elbow in this direction.
fn wrist_angles(handedness: Handedness, back: Vec3) -> (f32, f32) {
    (
        f32::atan2(back.z, -back.y),
        f32::atan2(little(handedness, back), back.y.hypot(back.z)),
    )
}

/// The part of a direction in the wrist's frame that points to the side of the little finger.
fn little(handedness: Handedness, direction: Vec3) -> f32 {
    -handedness.thumb_side() * direction.x
}

/// The directions that a forearm may take in the wrist's frame, with flexion and deviation each in range.
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
