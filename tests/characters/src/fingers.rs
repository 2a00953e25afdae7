//! Hands with fewer fingers, as in cartoons: those that are left are spread over the palm and are thicker.

use std::{ops::RangeInclusive, sync::Arc};

use glam::Vec3;
use grasp_assets::hands::{Hand, hand};
use grasp_synthesis::model::hand::{
    Digit, HandPose, Handedness,
    joints::{HandJoints, Skin, index, thesis_from_openxr_frame},
    rig::Rig,
};

use crate::Style;

/// How much thicker the digits are for each finger that is missing.
const THICKER: f32 = 0.15;

/// Radius of what is left of a missing finger, and how far it is behind the knuckle, as shares of the knuckle's radius: it hides
/// between or in the neighbours, which bend without it.
const STUMP: [f32; 2] = [0.8, 0.6];

/// A hand as it is bound.
pub(crate) struct Shape {
    /// Triangles, joints and weights.
    pub(crate) skin: Arc<Skin>,
    /// The joints; those of missing fingers have no radius.
    pub(crate) bind: HandJoints,
    /// The vertices of the skin.
    pub(crate) positions: Vec<Vec3>,
}

impl Shape {
    /// The adult's hand with some of its fingers, in order.
    pub(crate) fn new(side: Handedness, style: &Style) -> Self {
        let Hand { rig, skin } = hand("adult", side).expect("the rig is built in").as_ref();
        let skin = Arc::clone(skin);
        let fingers = style.fingers;
        if fingers.len() == 4 {
            let mut bind = if style.bend > 0.0 {
                bent(rig, &skin.bind, style.bend)
            } else {
                skin.bind.clone()
            };
            for joint in &mut bind.joints[index::FIRST_OF_DIGIT[0]..] {
                joint.radius *= style.thickness;
            }
            let is_adult = bind == skin.bind;
            let positions = if is_adult {
                skin.positions.clone()
            } else {
                skin.posed(&bind)
            };
            return Self {
                skin,
                bind,
                positions,
            };
        }
        let mut bind = skin.bind.clone();
        let offsets = offsets(&skin.bind, fingers);
        let thickness = 1.0 + THICKER * (4 - fingers.len()) as f32;
        for (digit, offsets) in offsets.iter().enumerate() {
            for (place, joint) in bind.joints[links(digit)].iter_mut().enumerate() {
                joint.pose.position += offsets[place.min(1)];
                joint.radius *= thickness;
            }
        }
        let mut positions = skin.posed(&bind);
        for digit in Digit::ALL[1..].iter().filter(|digit| !fingers.contains(digit)) {
            close(&skin, &bind, digit.index(), &mut positions);
            for joint in &mut bind.joints[links(digit.index())] {
                joint.radius = 0.0;
            }
        }
        Self {
            skin,
            bind,
            positions,
        }
    }
}

/// The joints of a digit.
fn links(digit: usize) -> RangeInclusive<usize> {
    index::FIRST_OF_DIGIT[digit]..=index::TIP_OF_DIGIT[digit]
}

/// The joints of a hand whose fingers are bent by an angle at each joint.
fn bent(rig: &Rig, bind: &HandJoints, bend: f32) -> HandJoints {
    let mut digits = rig.stretched();
    for angles in &mut digits[1..] {
        angles.base_pitch = bend;
        angles.second_pitch = bend;
        angles.third_pitch = bend;
    }
    let pose = HandPose {
        frame_from_wrist: thesis_from_openxr_frame(bind.joints[index::WRIST].pose),
        digits,
    };
    HandJoints::of_pose(rig, &pose)
}

/// How far the metacarpal's base and the rest of each digit move: the fingers are spread evenly from where the first to where the
/// last one of four is, and missing ones go with those next to them.
fn offsets(bind: &HandJoints, fingers: &[Digit]) -> [[Vec3; 2]; 5] {
    let [bases, knuckles] = [0, 1].map(|place| {
        [1, 2, 3, 4].map(|digit| bind.joints[index::FIRST_OF_DIGIT[digit] + place].pose.position)
    });
    let last = (fingers.len() - 1) as f32;
    let mut offsets = [[Vec3::ZERO; 2]; 5];
    for finger in 0..4 {
        // Its rank among those that are left, between the ranks of its neighbours if it is missing.
        let before = fingers.iter().filter(|other| other.index() <= finger).count() as f32;
        let is_there = fingers.iter().any(|other| other.index() == finger + 1);
        let rank = if is_there { before } else { before - 0.5 };
        let place = (3.0 * rank / last).clamp(0.0, 3.0);
        let along = |row: &[Vec3; 4]| {
            let start = (place as usize).min(2);
            row[start].lerp(row[start + 1], place - start as f32)
        };
        offsets[finger + 1] = [&bases, &knuckles].map(|row| along(row) - row[finger]);
    }
    offsets
}

/// Draws the skin of a missing finger back to a rounded knuckle.
fn close(skin: &Skin, bind: &HandJoints, digit: usize, positions: &mut [Vec3]) {
    let [base, knuckle] = [0, 1].map(|place| bind.joints[index::FIRST_OF_DIGIT[digit] + place]);
    let [radius, behind] = STUMP.map(|share| share * knuckle.radius);
    let along = (knuckle.pose.position - base.pose.position).normalize_or(Vec3::Y);
    let centre = knuckle.pose.position - behind * along;
    let links = index::FIRST_OF_DIGIT[digit] + 1..=index::TIP_OF_DIGIT[digit];
    let joints = skin.joint_indices.iter().zip(&skin.weights);
    for (position, (joints, weights)) in positions.iter_mut().zip(joints) {
        let moved = joints.iter().zip(weights);
        let moved = moved.filter(|(joint, _)| links.contains(&usize::from(**joint)));
        let of_finger: f32 = moved.map(|(_, weight)| weight).sum();
        let from_centre = *position - centre;
        if from_centre.length() > radius {
            let closed = centre + radius * from_centre.normalize_or(Vec3::Y);
            *position = position.lerp(closed, of_finger.min(1.0));
        }
    }
}
