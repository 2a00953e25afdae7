//! The types of grasps.

use serde::{Deserialize, Serialize};

/// A type of the GRASP taxonomy (T. Feix et al., "The GRASP Taxonomy of Human Grasp Types", 2016), with its number there
/// as value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GraspType {
    /// All fingers and the palm around something thick, the thumb against them.
    LargeDiameter = 1,
    /// As [`GraspType::LargeDiameter`], around something thin.
    SmallDiameter = 2,
    /// As [`GraspType::LargeDiameter`], around something between thick and thin.
    MediumWrap = 3,
    /// Fingers and palm around a handle, the thumb adducted along it.
    AdductedThumb = 4,
    /// Fingers and palm around a thin handle, the thumb's tip on it.
    LightTool = 5,
    /// The tips of four fingers in a row against the thumb's.
    #[serde(rename = "prismatic_4_finger")]
    Prismatic4Finger = 6,
    /// The tips of three fingers in a row against the thumb's.
    #[serde(rename = "prismatic_3_finger")]
    Prismatic3Finger = 7,
    /// The tips of two fingers in a row against the thumb's.
    #[serde(rename = "prismatic_2_finger")]
    Prismatic2Finger = 8,
    /// Between the pads of thumb and index finger.
    PalmarPinch = 9,
    /// The palm on a disk's face, the digits around its rim.
    PowerDisk = 10,
    /// Palm and digits around a ball.
    PowerSphere = 11,
    /// The tips of all digits around a disk's rim.
    PrecisionDisk = 12,
    /// The tips of all digits around a ball.
    PrecisionSphere = 13,
    /// The tips of thumb, index and middle finger around something round.
    Tripod = 14,
    /// A handle hangs in the hooked fingers; the thumb is idle.
    FixedHook = 15,
    /// The thumb's pad presses something flat against the side of the index finger.
    Lateral = 16,
    /// The index finger stretched along the object, the others close around it.
    IndexFingerExtension = 17,
    /// Stretched fingers against the thumb, on something flat.
    ExtensionType = 18,
    /// The distal links of the fingers, not just their tips, against the thumb, as in the loops of scissors.
    DistalType = 19,
    /// Pads of thumb and index finger, and the side of the middle finger, as on a pen.
    WritingTripod = 20,
    /// As [`GraspType::WritingTripod`], with the ring finger next to the middle one.
    TripodVariation = 21,
    /// Stretched fingers and stretched thumb on opposite faces of something flat.
    ParallelExtension = 22,
    /// Between the sides of index and middle finger.
    AdductionGrip = 23,
    /// Between the very tips of thumb and index finger.
    TipPinch = 24,
    /// As [`GraspType::WritingTripod`], with the thumb flat against the fingers' sides.
    LateralTripod = 25,
    /// Three fingers, more than their tips, and the thumb around a ball.
    #[serde(rename = "sphere_4_finger")]
    Sphere4Finger = 26,
    /// The tips of thumb and three fingers around something round.
    Quadpod = 27,
    /// Two fingers, more than their tips, and the thumb around a ball. The thesis's figure says "Sphere Finger".
    #[serde(rename = "sphere_3_finger")]
    Sphere3Finger = 28,
    /// As [`GraspType::Lateral`], on a rod steadied by the pads of the other fingers.
    Stick = 29,
    /// Stretched fingers press something flat against the palm.
    Palmar = 30,
    /// Thumb and index finger bent around the object.
    Ring = 31,
    /// As [`GraspType::Lateral`], on a handle that reaches into the palm.
    Ventral = 32,
    /// Between the pads of the stretched index finger and the thumb.
    InferiorPincer = 33,
}

impl GraspType {
    /// All types by number.
    pub const ALL: [Self; 33] = [
        Self::LargeDiameter,
        Self::SmallDiameter,
        Self::MediumWrap,
        Self::AdductedThumb,
        Self::LightTool,
        Self::Prismatic4Finger,
        Self::Prismatic3Finger,
        Self::Prismatic2Finger,
        Self::PalmarPinch,
        Self::PowerDisk,
        Self::PowerSphere,
        Self::PrecisionDisk,
        Self::PrecisionSphere,
        Self::Tripod,
        Self::FixedHook,
        Self::Lateral,
        Self::IndexFingerExtension,
        Self::ExtensionType,
        Self::DistalType,
        Self::WritingTripod,
        Self::TripodVariation,
        Self::ParallelExtension,
        Self::AdductionGrip,
        Self::TipPinch,
        Self::LateralTripod,
        Self::Sphere4Finger,
        Self::Quadpod,
        Self::Sphere3Finger,
        Self::Stick,
        Self::Palmar,
        Self::Ring,
        Self::Ventral,
        Self::InferiorPincer,
    ];
}
