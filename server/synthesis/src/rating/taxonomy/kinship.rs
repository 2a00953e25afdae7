//! Which grasp types are close enough that an expert who sees one may well name the other.

use crate::model::grasp_type::GraspType;
use GraspType as T;

/// Pairs of types that pass into each other: on one shape they differ in the object's size, the number of fingers by one, the
/// thumb's place, or how much of the fingers holds; between a ball and a disk, in the palm's side.
const KIN: [(GraspType, GraspType); 44] = [
    // By diameter.
    (T::SmallDiameter, T::MediumWrap),
    (T::MediumWrap, T::LargeDiameter),
    // By the place of thumb or index finger.
    (T::SmallDiameter, T::AdductedThumb),
    (T::SmallDiameter, T::LightTool),
    (T::MediumWrap, T::AdductedThumb),
    (T::AdductedThumb, T::LightTool),
    (T::AdductedThumb, T::IndexFingerExtension),
    (T::LightTool, T::IndexFingerExtension),
    // Between ball and disk, palm and fingertips.
    (T::PowerDisk, T::PowerSphere),
    (T::PowerDisk, T::PrecisionDisk),
    (T::PowerSphere, T::PrecisionSphere),
    (T::PrecisionDisk, T::PrecisionSphere),
    // By the number of fingers around something round.
    (T::PowerSphere, T::Sphere4Finger),
    (T::Sphere4Finger, T::Sphere3Finger),
    (T::PrecisionSphere, T::Quadpod),
    (T::PrecisionDisk, T::Quadpod),
    (T::Quadpod, T::Tripod),
    (T::Sphere4Finger, T::Quadpod),
    (T::Sphere4Finger, T::PrecisionSphere),
    (T::Sphere3Finger, T::Tripod),
    // By the number of fingertips in a row.
    (T::Prismatic4Finger, T::Prismatic3Finger),
    (T::Prismatic3Finger, T::Prismatic2Finger),
    (T::Prismatic2Finger, T::PalmarPinch),
    // Between fingertips in a row and around something.
    (T::Prismatic2Finger, T::Tripod),
    (T::Prismatic3Finger, T::Quadpod),
    (T::Prismatic4Finger, T::PrecisionSphere),
    // By the flexion of fingers on something flat.
    (T::Prismatic4Finger, T::ParallelExtension),
    (T::ParallelExtension, T::ExtensionType),
    (T::Prismatic3Finger, T::ExtensionType),
    (T::Prismatic4Finger, T::DistalType),
    // Two digits.
    (T::PalmarPinch, T::TipPinch),
    (T::PalmarPinch, T::InferiorPincer),
    (T::TipPinch, T::InferiorPincer),
    (T::PalmarPinch, T::Ring),
    // Pens: by the side of the middle finger that touches, the number of fingers, and the thumb's place.
    (T::Prismatic2Finger, T::WritingTripod),
    (T::Prismatic3Finger, T::TripodVariation),
    (T::WritingTripod, T::TripodVariation),
    (T::WritingTripod, T::LateralTripod),
    // Against the side of a finger.
    (T::Lateral, T::Stick),
    (T::Lateral, T::Ventral),
    (T::Stick, T::Ventral),
    (T::Lateral, T::LateralTripod),
    (T::Ventral, T::AdductedThumb),
    (T::Ventral, T::LightTool),
];

/// For each type, by its number less one, one bit for each of its kin.
const KIN_OF: [u64; GraspType::ALL.len()] = {
    let mut kin_of = [0; GraspType::ALL.len()];
    let mut pair = 0;
    while pair < KIN.len() {
        let (a, b) = (KIN[pair].0 as usize - 1, KIN[pair].1 as usize - 1);
        kin_of[a] |= 1 << b;
        kin_of[b] |= 1 << a;
        pair += 1;
    }
    kin_of
};

/// True if the types with two indices of [`GraspType::ALL`] are kin.
pub(super) fn are_kin(a: usize, b: usize) -> bool {
    KIN_OF[a] >> b & 1 == 1
}
