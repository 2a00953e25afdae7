//! Checks a hand given as tracked joints, and repairs missing radii.

use std::{
    fmt::{Display, Write as _},
    ops::RangeInclusive,
    sync::Arc,
};

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
    anatomy::{
        MAX_RADIUS, REFERENCE, StrayJoint, TRACKED_HAND_RIG, TurnedJoint, axes, replace_missing, strays,
    },
};
use crate::{
    convention::Convention,
    validate::{Field, check_within, pose, required_handedness},
    wire::wire_handedness,
};

/// Largest distance from the wrist to any other joint, in metres. The longest hand on record has 0.33.
const MAX_REACH: f32 = 0.5;

/// Smallest distance from the wrist to the middle finger's knuckle, in metres.
const MIN_PALM_LENGTH: f32 = 0.01;

/// Largest vector part of a quaternion that counts as the identity: rounding of the conversion between conventions.
const IDENTITY_TOLERANCE: f32 = 1e-6;

struct SentJoints<'a> {
    field: Field<'a>,
    convention: Convention,
    lacking: AllowedGaps,
    /// In `OpenXR` order and axes.
    joints: [Joint; JOINT_COUNT],
    /// The place in the list of each joint that was sent.
    places: [Option<usize>; JOINT_COUNT],
    readable: [bool; JOINT_COUNT],
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::validate) enum AllowedGaps {
    /// It has all its joints: trackers report five digits.
    Nothing,
    /// All joints of a finger may be empty. They get no radius.
    Fingers,
}

pub(in crate::validate) fn tracked_hand(
    field: Field<'_>,
    hand: &v1::HandJoints,
    convention: Convention,
    lacking: AllowedGaps,
) -> Option<JointedHand> {
    let handedness_field = field.child("handedness");
    let joints_field = field.child("joints");
    let (handedness, mut sent) = field.if_right(|| {
        let handedness = required_handedness(handedness_field, hand.handedness);
        if ![JOINT_COUNT, JOINT_COUNT - 1].contains(&hand.joints.len()) {
            return joints_field.reject(format_args!(
                "has {} joints; it must have OpenXR's {JOINT_COUNT} or WebXR's {}",
                hand.joints.len(),
                JOINT_COUNT - 1
            ));
        }
        let sent = SentJoints::read(joints_field, (&hand.joints, lacking), convention);
        let handedness = handedness?;
        sent.check(handedness_field, handedness);
        Some((handedness, sent))
    })??;
    let warnings = sent.replace_missing_radii();
    for digit in (1..5).filter(|&digit| !sent.readable[index::TIP_OF_DIGIT[digit]]) {
        for joint in &mut sent.joints[joints_of(digit)] {
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

const fn joints_of(digit: usize) -> RangeInclusive<usize> {
    index::FIRST_OF_DIGIT[digit]..=index::TIP_OF_DIGIT[digit]
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
        let mut is_missing = [false; JOINT_COUNT];
        for (place, joint) in list.iter().enumerate() {
            is_missing[index_of(place)] = *joint == v1::JointPose::default();
        }
        is_missing[..index::FIRST_OF_DIGIT[1]].fill(false);
        for digit in 1..5 {
            let joints = &mut is_missing[joints_of(digit)];
            let is_whole = joints.iter().all(|&is_missing| is_missing);
            joints.fill(lacking == AllowedGaps::Fingers && is_whole);
        }
        for (place, joint) in list.iter().enumerate() {
            let index = index_of(place);
            if !is_missing[index] {
                sent.places[index] = Some(place);
                (sent.joints[index], sent.readable[index]) = joint_pose(field.at(place), joint, convention);
            }
        }
        sent
    }

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
        let check_palm = || {
            let distance = reach(knuckle);
            self.field.check(
                distance >= MIN_PALM_LENGTH,
                format_args!(
                    "have the middle finger's proximal joint {distance} m from the wrist; it must be at least \
                     {MIN_PALM_LENGTH} m"
                ),
            );
        };
        if farthest < MIN_PALM_LENGTH && self.readable[knuckle] && self.readable[index::WRIST] {
            check_palm();
            return;
        }
        let strays = strays(&positions, &mut trusted);
        for &stray in &strays {
            self.add_stray(stray);
        }
        if strays.is_empty() && trusted[index::WRIST] {
            let text = format_args!("reach {farthest} m from the wrist; the limit is {MAX_REACH} m");
            self.field.check(farthest <= MAX_REACH, text);
            if trusted[knuckle] {
                check_palm();
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
                AllowedGaps::Nothing => self.field.violations().add("output.convention", what),
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
            if !(turned.is_rolled && axes.are_mirrored) {
                self.add_turned(turned);
            }
        }
    }

    fn add_stray(&self, stray: StrayJoint) {
        let [joint, neighbour] = [stray.joint, stray.neighbour].map(|joint| JOINT_NAMES[joint]);
        let at = self.joints[stray.joint].pose.position;
        let at = self.convention.point_from_openxr(at);
        let StrayJoint { length, limit, .. } = stray;
        let wrong = if length > limit {
            format!("{length:.3} m from {neighbour}; in a hand of this size it can be at most {limit:.3} m")
        } else {
            "exactly where another joint is; no two joints but those at the wrist may coincide".to_owned()
        };
        let text = format_args!("({joint}) is at {at}, {wrong} (did it lose tracking?)");
        self.add_at(stray.joint, text);
    }

    fn add_turned(&self, turned: TurnedJoint) {
        let what = if turned.is_rolled {
            "is rolled: its +X must lie across the knuckles, and +Y point out of the back of the hand,"
        } else {
            "points away from the tip: its -Z must follow the bone"
        };
        let TurnedJoint {
            joint, angle, limit, ..
        } = turned;
        let by = self.convention.joint_from_openxr(self.joints[joint].pose);
        self.add_at(
            joint,
            format_args!(
                "({}) is turned by {} and {what} in OpenXR's axes, within {limit:.0}°, and is {angle:.0}° off (did it \
                 lose tracking?)",
                JOINT_NAMES[joint],
                by.orientation
            ),
        );
    }

    fn add_at(&self, joint: usize, text: impl Display) {
        if let Some(place) = self.places[joint] {
            self.field.at(place).add(text);
        }
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
        let missing = (0..JOINT_COUNT).filter(|&joint| replaced[joint]);
        let mut missing: Vec<_> = missing
            .filter_map(|joint| Some((self.places[joint]?, joint)))
            .collect();
        missing.sort_unstable();
        let mut warning = format!(
            "{}: {} radii are 0 and were replaced by the adult rig's, scaled to the neighbouring joints or the hand:",
            self.field,
            missing.len()
        );
        for (place, joint) in missing {
            let radius = self.convention.length_from_openxr(self.joints[joint].radius);
            // Writing to a string cannot fail.
            let _ = write!(warning, " [{place}] {radius:.4}");
        }
        vec![warning]
    }
}

fn joint_pose(field: Field<'_>, sent: &v1::JointPose, convention: Convention) -> (Joint, bool) {
    let radius = convention.length_to_openxr(sent.radius);
    // 0 if it is unknown.
    let largest = convention.length_from_openxr(MAX_RADIUS);
    check_within(field.child("radius"), sent.radius, 0.0..=largest);
    let pose_field = field.child("pose");
    let read = pose_field.if_right(|| {
        pose_field.check(sent.pose.is_some(), "is absent; every joint must have a pose");
        convention.joint_to_openxr(pose(pose_field, sent.pose, convention))
    });
    let pose = read.unwrap_or(Pose::IDENTITY);
    (Joint { pose, radius }, read.is_some())
}
