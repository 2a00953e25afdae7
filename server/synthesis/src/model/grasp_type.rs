//! The 33 grasp types of the GRASP taxonomy (T. Feix et al., "The GRASP Taxonomy of Human Grasp Types", 2016; thesis
//! 2.4, Figure 2.5) and its 17 cells. Numbers and names are the paper's, as in the thesis, whose text says 34 types.

use serde::{Deserialize, Serialize};

use self::{
    GraspClass::{Intermediate, Power, Precision},
    Opposition::{Pad, Palm, Side},
    ThumbPosition::{Abducted, Adducted},
    VirtualFinger::{Three, ThreeToFive, ThreeToFour, Two, TwoToFive, TwoToFour, TwoToThree},
};

/// How firmly a grasp holds the object.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum GraspClass {
    /// The object cannot be moved in the hand.
    Power,
    /// The object can be moved a little in the hand.
    Intermediate,
    /// The fingers can manipulate the object.
    Precision,
}

/// The surface that the fingers push against.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Opposition {
    /// The palm.
    Palm,
    /// The pads of the fingers against that of the thumb.
    Pad,
    /// The side of a finger against the thumb's pad or another finger.
    Side,
}

/// The fingers that act as one against palm or thumb (VF 2), numbered as in the taxonomy: 2 is the index finger, 5
/// the little finger.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum VirtualFinger {
    /// 2.
    Two,
    /// 2 and 3.
    TwoToThree,
    /// 2 to 4.
    TwoToFour,
    /// 2 to 5.
    TwoToFive,
    /// 3.
    Three,
    /// 3 and 4.
    ThreeToFour,
    /// 3 to 5.
    ThreeToFive,
}

/// The position of the thumb.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ThumbPosition {
    /// Opposite the palm and fingers.
    Abducted,
    /// Alongside the palm.
    Adducted,
}

/// A cell of the taxonomy's table. Types in the same cell differ only by the object's size and shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Cell {
    /// How firmly the grasp holds.
    pub class: GraspClass,
    /// The surface that the fingers push against.
    pub opposition: Opposition,
    /// The fingers that act as one.
    pub virtual_finger: VirtualFinger,
    /// The position of the thumb.
    pub thumb: ThumbPosition,
}

/// A grasp type. Its discriminant is its number in the taxonomy.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GraspType {
    /// All fingers and the palm around something thick, the thumb against them.
    LargeDiameter = 1,
    /// As [`GraspType::LargeDiameter`], around something thin.
    SmallDiameter = 2,
    /// As [`GraspType::LargeDiameter`], around something between thick and thin.
    MediumWrap = 3,
    /// Fingers and palm around a handle, the full palmar side of the thumb along it.
    AdductedThumb = 4,
    /// Fingers and palm around a thin handle, the thumb's tip on it.
    LightTool = 5,
    /// The tips of four fingers in a row against the thumb's.
    #[serde(rename = "prismatic_4_finger")]
    Prismatic4Finger = 6,
    /// The tips of three fingers in a row against the thumb's.
    #[serde(rename = "prismatic_3_finger")]
    Prismatic3Finger = 7,
    /// The tips of two adjacent fingers against the thumb's.
    #[serde(rename = "prismatic_2_finger")]
    Prismatic2Finger = 8,
    /// The pads of thumb and index finger.
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
    /// A handle hangs in the hooked fingers; the thumb is passive.
    FixedHook = 15,
    /// The thumb's pad presses something flat onto the side of the index finger.
    Lateral = 16,
    /// The index finger stretched along the object, the others close around it.
    IndexFingerExtension = 17,
    /// Stretched fingers against the thumb, on something flat.
    ExtensionType = 18,
    /// The thumb against more of all fingers than their tips, as in the loops of scissors.
    DistalType = 19,
    /// Pads of thumb and index finger, and the side of the middle finger, as on a pen.
    WritingTripod = 20,
    /// As [`GraspType::WritingTripod`], with the ring finger next to the middle finger.
    TripodVariation = 21,
    /// Stretched fingers and the stretched thumb on both sides of something flat.
    ParallelExtension = 22,
    /// Between the sides of index and middle finger.
    AdductionGrip = 23,
    /// The very tips of thumb and index finger.
    TipPinch = 24,
    /// As [`GraspType::WritingTripod`], with the thumb flat alongside the fingers.
    LateralTripod = 25,
    /// The thumb and more of three fingers than their tips, around a ball.
    #[serde(rename = "sphere_4_finger")]
    Sphere4Finger = 26,
    /// The tips of thumb and three fingers around something round.
    Quadpod = 27,
    /// The thumb and more of two fingers than their tips, around a ball. The thesis's figure says "Sphere Finger".
    #[serde(rename = "sphere_3_finger")]
    Sphere3Finger = 28,
    /// As [`GraspType::Lateral`], on a rod that the other fingers' pads steady.
    Stick = 29,
    /// Stretched fingers press something flat against the palm.
    Palmar = 30,
    /// Thumb and index finger bent around the object.
    Ring = 31,
    /// As [`GraspType::Lateral`], on a handle that reaches into the palm.
    Ventral = 32,
    /// The pads of the stretched index finger and the thumb.
    InferiorPincer = 33,
}

const fn cell(
    class: GraspClass,
    opposition: Opposition,
    virtual_finger: VirtualFinger,
    thumb: ThumbPosition,
) -> Cell {
    Cell {
        class,
        opposition,
        virtual_finger,
        thumb,
    }
}

/// All types by number.
#[rustfmt::skip]
const TAXONOMY: [(GraspType, &str, Cell); 33] = [
    (GraspType::LargeDiameter, "Large Diameter", cell(Power, Palm, TwoToFive, Abducted)),
    (GraspType::SmallDiameter, "Small Diameter", cell(Power, Palm, TwoToFive, Abducted)),
    (GraspType::MediumWrap, "Medium Wrap", cell(Power, Palm, TwoToFive, Abducted)),
    (GraspType::AdductedThumb, "Adducted Thumb", cell(Power, Palm, TwoToFive, Adducted)),
    (GraspType::LightTool, "Light Tool", cell(Power, Palm, TwoToFive, Adducted)),
    (GraspType::Prismatic4Finger, "Prismatic 4 Finger", cell(Precision, Pad, TwoToFive, Abducted)),
    (GraspType::Prismatic3Finger, "Prismatic 3 Finger", cell(Precision, Pad, TwoToFour, Abducted)),
    (GraspType::Prismatic2Finger, "Prismatic 2 Finger", cell(Precision, Pad, TwoToThree, Abducted)),
    (GraspType::PalmarPinch, "Palmar Pinch", cell(Precision, Pad, Two, Abducted)),
    (GraspType::PowerDisk, "Power Disk", cell(Power, Palm, TwoToFive, Abducted)),
    (GraspType::PowerSphere, "Power Sphere", cell(Power, Palm, TwoToFive, Abducted)),
    (GraspType::PrecisionDisk, "Precision Disk", cell(Precision, Pad, TwoToFive, Abducted)),
    (GraspType::PrecisionSphere, "Precision Sphere", cell(Precision, Pad, TwoToFive, Abducted)),
    (GraspType::Tripod, "Tripod", cell(Precision, Pad, TwoToThree, Abducted)),
    (GraspType::FixedHook, "Fixed Hook", cell(Power, Palm, TwoToFive, Adducted)),
    (GraspType::Lateral, "Lateral", cell(Intermediate, Side, Two, Adducted)),
    (GraspType::IndexFingerExtension, "Index Finger Extension", cell(Power, Palm, ThreeToFive, Adducted)),
    (GraspType::ExtensionType, "Extension Type", cell(Power, Pad, TwoToFour, Abducted)),
    (GraspType::DistalType, "Distal Type", cell(Power, Pad, TwoToFive, Abducted)),
    (GraspType::WritingTripod, "Writing Tripod", cell(Precision, Side, Three, Abducted)),
    (GraspType::TripodVariation, "Tripod Variation", cell(Intermediate, Side, ThreeToFour, Abducted)),
    (GraspType::ParallelExtension, "Parallel Extension", cell(Precision, Pad, TwoToFive, Adducted)),
    (GraspType::AdductionGrip, "Adduction Grip", cell(Intermediate, Side, Two, Abducted)),
    (GraspType::TipPinch, "Tip Pinch", cell(Precision, Pad, Two, Abducted)),
    (GraspType::LateralTripod, "Lateral Tripod", cell(Intermediate, Side, Three, Adducted)),
    (GraspType::Sphere4Finger, "Sphere 4-Finger", cell(Power, Pad, TwoToFour, Abducted)),
    (GraspType::Quadpod, "Quadpod", cell(Precision, Pad, TwoToFour, Abducted)),
    (GraspType::Sphere3Finger, "Sphere 3-Finger", cell(Power, Pad, TwoToThree, Abducted)),
    (GraspType::Stick, "Stick", cell(Intermediate, Side, Two, Adducted)),
    (GraspType::Palmar, "Palmar", cell(Power, Palm, TwoToFive, Adducted)),
    (GraspType::Ring, "Ring", cell(Power, Pad, Two, Abducted)),
    (GraspType::Ventral, "Ventral", cell(Intermediate, Side, Two, Adducted)),
    (GraspType::InferiorPincer, "Inferior Pincer", cell(Precision, Pad, Two, Abducted)),
];

impl GraspType {
    /// All types by number.
    pub const ALL: [Self; TAXONOMY.len()] = {
        let mut all = [Self::LargeDiameter; TAXONOMY.len()];
        let mut index = 0;
        while index < all.len() {
            all[index] = TAXONOMY[index].0;
            index += 1;
        }
        all
    };

    /// The type with a number of the taxonomy, 1 to 33; `None` for any other.
    pub fn from_number(number: u32) -> Option<Self> {
        let index = usize::try_from(number.checked_sub(1)?).ok()?;
        Self::ALL.get(index).copied()
    }

    /// Its number in the taxonomy, from 1 to 33.
    pub const fn number(self) -> u32 {
        self as u32
    }

    /// Its name in the taxonomy.
    pub const fn name(self) -> &'static str {
        TAXONOMY[self as usize - 1].1
    }

    /// Its cell of the taxonomy's table.
    pub const fn cell(self) -> Cell {
        TAXONOMY[self as usize - 1].2
    }
}

/// Smallest confidence, 0 to 1, at which a grasp is assigned a type. A higher one leaves more grasps without a type.
pub const MIN_CONFIDENCE: f32 = 0.25;

/// Smallest confidence, 0 to 1, of a clear type: below it, the grasp resembles several types, or hardly one.
pub const CLEAR_CONFIDENCE: f32 = 0.5;

/// The result of classifying a grasp.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Classification {
    /// The type; `None` for an unnatural grasp, which resembles no type.
    pub grasp_type: Option<GraspType>,
    /// The confidence, 0 to 1: the share of experts expected to name this type or one close to it, say the next size of wrap.
    /// It is the fit of the best type less half the fit of the best contradicting one, or a tenth of that of the best type
    /// close to it. Below [`MIN_CONFIDENCE`] if there is no type.
    pub confidence: f32,
}

impl Classification {
    /// True if the grasp has a type with at least [`CLEAR_CONFIDENCE`].
    pub fn is_clear(&self) -> bool {
        self.grasp_type.is_some() && self.confidence >= CLEAR_CONFIDENCE
    }
}
