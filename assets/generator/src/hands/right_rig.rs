//! Builds the right-handed rigs from the figures of [`super::anatomy`].

use glam::{Mat3, Quat, Vec3};
use grasp_synthesis::{
    base::pose::Pose,
    geometry::Segment,
    model::hand::{
        Handedness,
        joints::{JOINT_COUNT, index},
        rig::{AngleRange, DigitLimits, DigitRig, Rig},
    },
};

use super::anatomy;

/// Which of the two built-in rigs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum RigKind {
    /// 22 cm from wrist to tip with the limits of Table 4.1.
    Thesis,
    /// An adult's hand with anatomical limits.
    Adult,
}

impl RigKind {
    /// Both, in the order in which they are written.
    pub(super) const ALL: [Self; 2] = [Self::Thesis, Self::Adult];

    /// The rig's name.
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Thesis => "thesis",
            Self::Adult => "adult",
        }
    }

    /// Metres per millimetre of the figures: the hand of the thesis is an adult's hand made larger.
    pub(super) fn metres_per_mm(self) -> f32 {
        match self {
            Self::Thesis => 1e-3 * anatomy::THESIS_REACH_MM / reach_mm(),
            Self::Adult => 1e-3,
        }
    }

    const fn limits(self) -> &'static [anatomy::LimitsDegrees; 5] {
        match self {
            Self::Thesis => &anatomy::THESIS_LIMITS,
            Self::Adult => &anatomy::ADULT_LIMITS,
        }
    }
}

/// The knuckle of a finger (0 for the index) in millimetres: its metacarpal's length away from the metacarpal's start.
fn knuckle_mm(finger: usize) -> Vec3 {
    let start = Vec3::from(anatomy::METACARPAL_START_MM[finger]);
    let [x, z] = anatomy::KNUCKLE_XZ_MM[finger];
    let across = (x - start.x).powi(2) + (z - start.z).powi(2);
    let length = anatomy::METACARPAL_MM[finger];
    Vec3::new(x, start.y + (length * length - across).sqrt(), z)
}

/// Distance from the wrist to the tip of the stretched middle finger in millimetres.
fn reach_mm() -> f32 {
    let length: f32 = anatomy::LINK_MM[2].iter().sum();
    (knuckle_mm(1) + finger_orientation(1) * Vec3::Y * length).length()
}

/// The orientation of a stretched finger (0 for the index).
fn finger_orientation(finger: usize) -> Quat {
    Quat::from_rotation_z(-anatomy::FAN_DEGREES[finger].to_radians())
        * Quat::from_rotation_y(-anatomy::ROLL_DEGREES[finger].to_radians())
}

/// The orientation of the thumb next to the flat hand.
fn thumb_orientation() -> Quat {
    let (radial, palmar) = (
        anatomy::THUMB_RADIAL_DEGREES.to_radians(),
        anatomy::THUMB_PALMAR_DEGREES.to_radians(),
    );
    let along = Vec3::new(
        radial.sin() * palmar.cos(),
        radial.cos() * palmar.cos(),
        palmar.sin(),
    );
    let pad = anatomy::THUMB_PAD_DEGREES.to_radians();
    let pad = Vec3::new(-pad.sin(), 0.0, pad.cos());
    let pad = (pad - along * pad.dot(along)).normalize_or(Vec3::Z);
    Quat::from_mat3(&Mat3::from_cols(along.cross(pad), along, pad)).normalize()
}

/// The right-handed rig. Its palm segments and the radii of wrist and metacarpals are missing until the skin is known.
pub(super) fn right_rig(kind: RigKind) -> Rig {
    let metres = kind.metres_per_mm();
    let digits = std::array::from_fn(|digit| {
        let (base, orientation, yaw_sign) = if digit == 0 {
            (Vec3::from(anatomy::THUMB_BASE_MM), thumb_orientation(), -1.0)
        } else {
            (knuckle_mm(digit - 1), finger_orientation(digit - 1), 1.0)
        };
        let [base_yaw, base_pitch, second_pitch, third_pitch] =
            kind.limits()[digit].map(|[min, max]| AngleRange::from_degrees(min, max));
        DigitRig {
            wrist_from_base: Pose::new(metres * base, orientation),
            yaw_sign,
            lengths: anatomy::LINK_MM[digit].map(|mm| mm * metres),
            diameters: anatomy::link_diameters_mm(digit).map(|mm| mm * metres),
            limits: DigitLimits {
                base_yaw,
                base_pitch,
                second_pitch,
                third_pitch,
            },
        }
    });
    let finger_metacarpals = anatomy::METACARPAL_START_MM.map(|mm| metres * Vec3::from(mm));
    let mut joint_radii = [0.0; JOINT_COUNT];
    joint_radii[index::PALM] = anatomy::PALM_RADIUS_MM * metres;
    for digit in 0..5 {
        let tip = index::TIP_OF_DIGIT[digit];
        for (i, diameter) in anatomy::joint_diameters_mm(digit).into_iter().enumerate() {
            joint_radii[tip - 3 + i] = 0.5 * diameter * metres;
        }
        joint_radii[tip] = anatomy::tip_radius_mm(digit) * metres;
    }
    let middle_start = finger_metacarpals[1];
    let middle_knuckle = metres * knuckle_mm(1);
    let along = (middle_knuckle - middle_start).normalize_or(Vec3::Y);
    let palmar = Quat::from_rotation_arc(Vec3::Y, along) * Vec3::Z;
    Rig {
        name: kind.name().to_owned(),
        handedness: Handedness::Right,
        palm: 0.5 * (middle_start + middle_knuckle) + joint_radii[index::PALM] * palmar,
        reach: metres * reach_mm(),
        digits,
        finger_metacarpals,
        palm_segments: [Segment::new(Vec3::ZERO, Vec3::ZERO); 10],
        joint_radii,
        rest_overlaps: None,
        palm_flesh: None,
    }
}
