//! Digits, hands and types as the contract names them.

use grasp_proto::v1;
use grasp_synthesis::model::{
    grasp_type::GraspType,
    hand::{Digit, Handedness},
};

pub(super) fn wire_grasp_type(grasp_type: GraspType) -> v1::GraspType {
    match grasp_type {
        GraspType::LargeDiameter => v1::GraspType::LargeDiameter,
        GraspType::SmallDiameter => v1::GraspType::SmallDiameter,
        GraspType::MediumWrap => v1::GraspType::MediumWrap,
        GraspType::AdductedThumb => v1::GraspType::AdductedThumb,
        GraspType::LightTool => v1::GraspType::LightTool,
        GraspType::Prismatic4Finger => v1::GraspType::Prismatic4Finger,
        GraspType::Prismatic3Finger => v1::GraspType::Prismatic3Finger,
        GraspType::Prismatic2Finger => v1::GraspType::Prismatic2Finger,
        GraspType::PalmarPinch => v1::GraspType::PalmarPinch,
        GraspType::PowerDisk => v1::GraspType::PowerDisk,
        GraspType::PowerSphere => v1::GraspType::PowerSphere,
        GraspType::PrecisionDisk => v1::GraspType::PrecisionDisk,
        GraspType::PrecisionSphere => v1::GraspType::PrecisionSphere,
        GraspType::Tripod => v1::GraspType::Tripod,
        GraspType::FixedHook => v1::GraspType::FixedHook,
        GraspType::Lateral => v1::GraspType::Lateral,
        GraspType::IndexFingerExtension => v1::GraspType::IndexFingerExtension,
        GraspType::ExtensionType => v1::GraspType::ExtensionType,
        GraspType::DistalType => v1::GraspType::DistalType,
        GraspType::WritingTripod => v1::GraspType::WritingTripod,
        GraspType::TripodVariation => v1::GraspType::TripodVariation,
        GraspType::ParallelExtension => v1::GraspType::ParallelExtension,
        GraspType::AdductionGrip => v1::GraspType::AdductionGrip,
        GraspType::TipPinch => v1::GraspType::TipPinch,
        GraspType::LateralTripod => v1::GraspType::LateralTripod,
        GraspType::Sphere4Finger => v1::GraspType::Sphere4Finger,
        GraspType::Quadpod => v1::GraspType::Quadpod,
        GraspType::Sphere3Finger => v1::GraspType::Sphere3Finger,
        GraspType::Stick => v1::GraspType::Stick,
        GraspType::Palmar => v1::GraspType::Palmar,
        GraspType::Ring => v1::GraspType::Ring,
        GraspType::Ventral => v1::GraspType::Ventral,
        GraspType::InferiorPincer => v1::GraspType::InferiorPincer,
    }
}

pub(crate) fn wire_digit(digit: Digit) -> v1::Digit {
    match digit {
        Digit::Thumb => v1::Digit::Thumb,
        Digit::Index => v1::Digit::Index,
        Digit::Middle => v1::Digit::Middle,
        Digit::Ring => v1::Digit::Ring,
        Digit::Little => v1::Digit::Little,
    }
}

pub(crate) fn wire_handedness(handedness: Handedness) -> v1::Handedness {
    match handedness {
        Handedness::Left => v1::Handedness::Left,
        Handedness::Right => v1::Handedness::Right,
    }
}
