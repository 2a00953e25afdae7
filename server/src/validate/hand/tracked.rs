//! Checks a hand given as tracked joints, and repairs missing radii.

use std::{fmt::Write as _, sync::Arc};

use grasp_assets::hands;
use grasp_proto::v1;
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::{
        Handedness,
        joints::{HandJoints, JOINT_COUNT, JOINT_NAMES, Joint, index},
    },
};

use super::{
    JointedHand,
    axes::{Fault, TurnedJoint, axes},
    proportions::{StrayJoint, strays},
    reference::{MAX_RADIUS, REFERENCE, TRACKED_HAND_RIG, replace_missing},
};
use crate::{
    convention::Convention,
    validate::{Field, pose, required_handedness},
    wire::wire_handedness,
};

/// The field that says in which axes joints are.
const CONVENTION: &str = "output.convention";

/// Largest distance from the wrist to any other joint, in metres. The longest hand on record has 0.33.
const MAX_REACH: f32 = 0.5;

/// Smallest distance from the wrist to the middle finger's knuckle, in metres.
const MIN_PALM_LENGTH: f32 = 0.01;

/// Largest vector part of a quaternion that counts as the identity: rounding of the conversion between conventions.
const IDENTITY_TOLERANCE: f32 = 1e-6;

/// The joints of a request.
struct SentJoints<'a> {
    /// The field of their list.
    field: Field<'a>,
    convention: Convention,
    lacking: AllowedGaps,
    /// In `OpenXR` order and axes.
    joints: [Joint; JOINT_COUNT],
    /// The place in the list of each joint that was sent.
    places: [Option<usize>; JOINT_COUNT],
    /// Whether the joint was sent and its pose is well-formed.
    readable: [bool; JOINT_COUNT],
}

/// What a hand may lack.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::validate) enum AllowedGaps {
    /// It has all its joints: trackers report five digits.
    Nothing,
    /// All joints of a finger may be empty. They get no radius.
    Fingers,
}

/// The hand in the client's frame; `None` if it is wrong.
pub(in crate::validate) fn tracked_hand(
    field: Field<'_>,
    hand: &v1::HandJoints,
    convention: Convention,
    lacking: AllowedGaps,
) -> Option<JointedHand> {
    let before = field.violations().len();
    let handedness_field = field.child("handedness");
    let handedness = required_handedness(handedness_field, hand.handedness);
    let joints_field = field.child("joints");
    if ![JOINT_COUNT, JOINT_COUNT - 1].contains(&hand.joints.len()) {
        return joints_field.reject(format_args!(
            "has {} joints; it must have OpenXR's {JOINT_COUNT} or WebXR's {}",
            hand.joints.len(),
            JOINT_COUNT - 1
        ));
    }
    let mut sent = SentJoints::read(joints_field, (&hand.joints, lacking), convention);
    let handedness = handedness?;
    sent.check(handedness_field, handedness);
    if field.violations().len() > before {
        return None;
    }
    let warnings = sent.replace_missing_radii();
    for digit in (1..5).filter(|&digit| !sent.readable[index::TIP_OF_DIGIT[digit]]) {
        for joint in &mut sent.joints[index::FIRST_OF_DIGIT[digit]..=index::TIP_OF_DIGIT[digit]] {
            joint.radius = 0.0;
        }
    }
    if sent.places[index::PALM].is_none() {
        sent.joints[index::PALM] = sent.synthesised_palm();
    }
    Some(JointedHand {
        joints: HandJoints {
            handedness,
            joints: sent.joints,
        },
        skin: Arc::clone(&hands::hand(TRACKED_HAND_RIG, handedness)?.skin),
        field: "holdout.presenting_hand.joints",
        warnings,
    })
}

impl<'a> SentJoints<'a> {
    fn read(
        field: Field<'a>,
        (list, lacking): (&[v1::JointPose], AllowedGaps),
        convention: Convention,
    ) -> Self {
        let nowhere = Joint {
            pose: Pose::IDENTITY,
            radius: 0.0,
        };
        let mut sent = Self {
            field,
            convention,
            lacking,
            joints: [nowhere; JOINT_COUNT],
            places: [None; JOINT_COUNT],
            readable: [false; JOINT_COUNT],
        };
        // WebXR's joints begin with the wrist.
        let has_palm = list.len() == JOINT_COUNT;
        let index_of = |place: usize| {
            if has_palm {
                convention.joint_at(place)
            } else {
                place + 1
            }
        };
        let mut is_empty = [false; JOINT_COUNT];
        for (place, joint) in list.iter().enumerate() {
            is_empty[index_of(place)] = *joint == v1::JointPose::default();
        }
        let mut is_missing = [false; JOINT_COUNT];
        for digit in 1..5 {
            let joints = index::FIRST_OF_DIGIT[digit]..=index::TIP_OF_DIGIT[digit];
            let is_whole = is_empty[joints.clone()].iter().all(|&empty| empty);
            is_missing[joints].fill(lacking == AllowedGaps::Fingers && is_whole);
        }
        for (place, joint) in list.iter().enumerate() {
            let index = index_of(place);
            if is_missing[index] {
                continue;
            }
            sent.places[index] = Some(place);
            (sent.joints[index], sent.readable[index]) = joint_pose(field.at(place), joint, convention);
        }
        sent
    }

    /// Checks that the readable joints are those of a hand: positions first, then axes.
    fn check(&self, handedness_field: Field<'_>, handedness: Handedness) {
        let positions = self.joints.map(|joint| joint.pose.position);
        let wrist = positions[index::WRIST];
        let knuckle = index::FIRST_OF_DIGIT[2] + 1;
        let reach = |joint: usize| positions[joint].distance(wrist);
        let mut trusted = self.readable;
        let farthest = (0..JOINT_COUNT)
            .filter(|&joint| trusted[joint] && trusted[index::WRIST])
            .map(reach)
            .fold(0.0, f32::max);
        if farthest < MIN_PALM_LENGTH && self.readable[knuckle] && self.readable[index::WRIST] {
            self.add_small_palm(reach(knuckle));
            return;
        }
        let strays = strays(&positions, &mut trusted);
        for &stray in &strays {
            self.add_stray(stray);
        }
        if strays.is_empty() && trusted[index::WRIST] {
            if farthest > MAX_REACH {
                self.field.add(format_args!(
                    "reach {farthest} m from the wrist; the limit is {MAX_REACH} m"
                ));
            }
            if trusted[knuckle] && reach(knuckle) < MIN_PALM_LENGTH {
                self.add_small_palm(reach(knuckle));
            }
        }
        let is_identity = self.joints.map(|joint| {
            let orientation = self.convention.joint_from_openxr(joint.pose).orientation;
            orientation.xyz().length() < IDENTITY_TOLERANCE
        });
        let axes = axes(&self.joints, &trusted, &is_identity, handedness);
        if axes.are_foreign {
            let what = "does not fit: most joints of the hand point away from their bones, as those of another \
                        convention do";
            match self.lacking {
                AllowedGaps::Nothing => self.field.violations().add(CONVENTION, what),
                // Hands at rest are in OpenXR's axes, whatever the client's are.
                AllowedGaps::Fingers => self.field.add(what),
            }
        }
        if axes.are_mirrored {
            handedness_field.add(format_args!(
                    "is {}, but the joints are those of the other hand or upside down: +Y must point out of the back \
                     of the hand",
                    wire_handedness(handedness).as_str_name()
                ));
        }
        for &turned in &axes.turned {
            if turned.fault == Fault::Direction || !axes.are_mirrored {
                self.add_turned(turned);
            }
        }
    }

    fn add_small_palm(&self, distance: f32) {
        self.field.add(format_args!(
            "have the middle finger's proximal joint {distance} m from the wrist; it must be at least \
                 {MIN_PALM_LENGTH} m"
        ));
    }

    fn add_stray(&self, stray: StrayJoint) {
        let Some(place) = self.places[stray.joint] else {
            return;
        };
        let [joint, neighbour] = [stray.joint, stray.neighbour].map(|joint| JOINT_NAMES[joint]);
        let position = self
            .convention
            .point_from_openxr(self.joints[stray.joint].pose.position);
        let StrayJoint { length, limit, .. } = stray;
        if length > limit {
            self.field.at(place).add(format_args!(
                    "({joint}) is at {position}, {length:.3} m from {neighbour}; in a hand of this size it can be at \
                     most {limit:.3} m (did it lose tracking?)"
                ));
        } else {
            self.field.at(place).add(format_args!(
                    "({joint}) is at {position}, exactly where another joint is; no two joints but those at the wrist \
                     may coincide (did it lose tracking?)"
                ));
        }
    }

    fn add_turned(&self, turned: TurnedJoint) {
        let Some(place) = self.places[turned.joint] else {
            return;
        };
        let what = match turned.fault {
            Fault::Direction => "points away from the tip: its -Z must follow the bone",
            Fault::Roll => {
                "is rolled: its +X must lie across the knuckles, and +Y point out of the back of the hand,"
            }
        };
        let orientation = self
            .convention
            .joint_from_openxr(self.joints[turned.joint].pose)
            .orientation;
        self.field.at(place).add(format_args!(
                "({}) is turned by {orientation} and {what} in OpenXR's axes, within {:.0}°, and is {:.0}° off (did it \
                 lose tracking?)",
                JOINT_NAMES[turned.joint], turned.limit, turned.angle,
            ));
    }

    /// The palm joint, which `WebXR` lacks: in the middle of the middle finger's metacarpal, or of another one's without that.
    fn synthesised_palm(&self) -> Joint {
        let has = |digit: &usize| self.readable[index::FIRST_OF_DIGIT[*digit]];
        let digit = [2, 3, 1, 4].into_iter().find(has).unwrap_or(2);
        let metacarpal = self.joints[index::FIRST_OF_DIGIT[digit]];
        let proximal = self.joints[index::FIRST_OF_DIGIT[digit] + 1];
        Joint {
            pose: Pose {
                position: (metacarpal.pose.position + proximal.pose.position) * 0.5,
                orientation: metacarpal.pose.orientation,
            },
            radius: metacarpal.radius,
        }
    }

    /// Replaces missing radii; returns a warning if there are any.
    fn replace_missing_radii(&mut self) -> Vec<String> {
        let is_missing = |joint: usize| self.places[joint].is_some() && self.joints[joint].radius == 0.0;
        if !(0..JOINT_COUNT).any(is_missing) {
            return Vec::new();
        }
        let positions = self.joints.map(|joint| joint.pose.position);
        let scale = REFERENCE.scale_of(&positions, &self.readable).unwrap_or(1.0);
        let replaced = replace_missing(&mut self.joints, scale);
        let mut list = String::new();
        let mut count = 0;
        for place in 0..JOINT_COUNT {
            let Some(joint) = self.places.iter().position(|&other| other == Some(place)) else {
                continue;
            };
            if replaced[joint] {
                count += 1;
                let radius = self.convention.length_from_openxr(self.joints[joint].radius);
                let _ = write!(list, " [{place}] {radius:.4}");
            }
        }
        vec![format!(
            "{}: {count} radii are 0 and were replaced by the adult rig's, scaled to the neighbouring joints or the \
             hand:{list}",
            self.field
        )]
    }
}

/// A joint, and whether its pose is well-formed.
fn joint_pose(field: Field<'_>, sent: &v1::JointPose, convention: Convention) -> (Joint, bool) {
    let radius = convention.length_to_openxr(sent.radius);
    if !(0.0..=MAX_RADIUS).contains(&radius) {
        field.child("radius").add(format_args!(
            "is {}; it must be more than 0 and at most {}, or 0 if it is unknown",
            sent.radius,
            convention.length_from_openxr(MAX_RADIUS)
        ));
    }
    let pose_field = field.child("pose");
    let before = field.violations().len();
    if sent.pose.is_none() {
        pose_field.add("is absent; every joint must have a pose");
    }
    let pose = convention.joint_to_openxr(pose(pose_field, sent.pose, convention));
    (Joint { pose, radius }, field.violations().len() == before)
}
