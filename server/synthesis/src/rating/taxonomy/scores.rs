//! How well a grasp fits each type: the fit to the type's cell (what opposes what, with which fingers, where the thumb is)
//! times the fit to the type within it (size, shape, how the digits are bent). All of them from 0 to 1.
//!
//! The paper defines the types by pictures and by the cells' words; the thesis classifies by eye. What tells the types of
//! a cell apart here, and from where on, is this project's reading of those pictures.

use super::{
    features::{Features, Finger, bent, opposed, straight},
    membership::{falling, rising},
};
use crate::model::grasp_type::{Cell, GraspClass, GraspType, Opposition, ThumbPosition, VirtualFinger};

/// Heights of the thumb's tip over the palm's plane, in hand lengths, between which the thumb goes from lying beside the
/// palm to standing opposite to it: 2 and 5 cm on an adult's hand. Higher ones take more thumbs for adducted.
const THUMB_HEIGHT: [f32; 2] = [0.12, 0.26];

/// Thicknesses in hand lengths between which small becomes medium: 20 and 32 mm for an adult's hand.
const SMALL_TO_MEDIUM: [f32; 2] = [0.105, 0.17];

/// Between which medium becomes large: 53 and 72 mm for an adult's hand.
const MEDIUM_TO_LARGE: [f32; 2] = [0.28, 0.38];

/// Convergence of the outer fingers' pushes between which a prism becomes something round. On a ball, three fingertips are
/// about a radius apart, which gives 1.
const ROUND: [f32; 2] = [0.25, 0.7];

/// Pull of the digits toward the palm between which a disk becomes a ball: fingers reach past the widest part of a ball.
const BALL: [f32; 2] = [0.05, 0.3];

/// Means of the two outer joints' bend together, in degrees, between which stretched fingers become curled ones.
const CURLED: [f32; 2] = [40.0, 80.0];

/// The same between which fingers begin to go around something: they need not bend much around something large.
const AROUND: [f32; 2] = [15.0, 45.0];

/// Means of what the fingers hold with more than their last links between which precision becomes power.
const POWER: [f32; 2] = [0.3, 0.7];

/// How much less surely a side holds if a pad of the same finger touches too.
const PAD_BESIDE_SIDE: f32 = 0.8;

/// How much less surely thumb and pads hold if the palm bears the object.
const PALM_BESIDE_PAD: f32 = 0.85;

/// The scores of all types, in the order of their numbers.
pub(super) fn scores(features: &Features) -> [f32; 33] {
    let view = View::new(features);
    GraspType::ALL.map(|grasp_type| {
        let cell = view.cell(grasp_type.cell());
        // Most types fall with their cell.
        if cell == 0.0 {
            0.0
        } else {
            cell * view.within_cell(grasp_type)
        }
    })
}

/// The features as the cells and types ask for them.
struct View<'a> {
    features: &'a Features,
    /// Fingers against the palm.
    palm: f32,
    /// Pads against the thumb's, away from the palm.
    pad: f32,
    /// The thumb against the index finger's side.
    side_of_index: f32,
    /// The thumb against the middle finger's side, with the index finger's pad on the object.
    side_of_middle: f32,
    /// Index against middle finger.
    between_fingers: f32,
    /// The thumb stands opposite.
    abducted: f32,
    /// More than the last links of the fingers touch.
    inner: f32,
    round: f32,
    curled: f32,
    small: f32,
    large: f32,
}

impl<'a> View<'a> {
    fn new(features: &'a Features) -> Self {
        let Features {
            thumb,
            fingers: [index, middle, ..],
            ..
        } = features;
        let thumb_against_pads = if thumb.touches {
            opposed(thumb.press, features.pads_press())
        } else {
            0.0
        };
        let against_side = |finger: &Finger| {
            if thumb.touches {
                finger.thumbward * (1.0 - PAD_BESIDE_SIDE * finger.pad) * opposed(thumb.press, finger.press)
            } else {
                0.0
            }
        };
        Self {
            features,
            palm: features.palm_support * features.mean(|finger| finger.pad),
            pad: thumb_against_pads
                * features.mean(|finger| finger.pad)
                * (1.0 - PALM_BESIDE_PAD * features.palm_support),
            side_of_index: against_side(index),
            side_of_middle: against_side(middle)
                * index.pad
                * (1.0 - PALM_BESIDE_PAD * features.palm_support),
            between_fingers: index.littleward.min(middle.thumbward) * opposed(index.press, middle.press),
            abducted: rising(thumb.height, THUMB_HEIGHT),
            inner: features.mean(|finger| finger.inner),
            round: rising(features.convergence, ROUND),
            curled: bent(features.mean(|finger| finger.curl), CURLED),
            small: falling(features.thickness, SMALL_TO_MEDIUM),
            large: rising(features.thickness, MEDIUM_TO_LARGE),
        }
    }

    /// How well a cell fits.
    fn cell(&self, cell: Cell) -> f32 {
        let thumb = match cell.thumb {
            ThumbPosition::Abducted => self.abducted,
            ThumbPosition::Adducted => 1.0 - self.abducted,
        };
        let fingers = virtual_finger(self.features.touching, cell);
        let no_thumb = !self.features.thumb.touches;
        match (cell.class, cell.opposition, cell.virtual_finger) {
            // A thumb that touches nothing opposes nothing.
            (_, Opposition::Palm, _) if no_thumb && cell.thumb == ThumbPosition::Abducted => 0.0,
            (_, Opposition::Palm, _) if no_thumb => fingers,
            (_, Opposition::Palm, _) => self.palm * thumb * fingers,
            // Where pads oppose the thumb, it is opposite to them by that alone; of Parallel Extension, adducted in the
            // table, the type itself asks that it lies along the fingers.
            (GraspClass::Power, Opposition::Pad, _) => self.pad * rising(self.inner, POWER) * fingers,
            (_, Opposition::Pad, _) => self.pad * falling(self.inner, POWER) * fingers,
            (_, Opposition::Side, VirtualFinger::Two) if cell.thumb == ThumbPosition::Abducted => {
                self.between_fingers
            }
            (_, Opposition::Side, VirtualFinger::Two) => self.side_of_index,
            (_, Opposition::Side, _) => self.side_of_middle * thumb * fingers,
        }
    }

    /// How well a type fits among those of its cell.
    #[expect(clippy::match_same_arms, reason = "types stand by their cells")]
    fn within_cell(&self, grasp_type: GraspType) -> f32 {
        let Features {
            thumb,
            fingers,
            palm_touches,
            pull,
            ..
        } = *self.features;
        let index = fingers[0];
        let prismatic = 1.0 - self.round;
        let straight_fingers = 1.0 - self.curled;
        let around = prismatic * bent(self.features.mean(|finger| finger.curl), AROUND);
        let ball = rising(pull, BALL);
        let parallel = straight_fingers * rising(self.along_fingers(), [0.6, 0.85]);
        let supported = self.supported();
        match grasp_type {
            GraspType::LargeDiameter => around * self.large,
            GraspType::SmallDiameter => around * self.small,
            GraspType::MediumWrap => around * (1.0 - self.small) * (1.0 - self.large),
            GraspType::PowerDisk => self.round * (1.0 - ball),
            GraspType::PowerSphere => self.round * ball,

            GraspType::AdductedThumb if thumb.touches => {
                self.wrapped()
                    * if thumb.is_inner {
                        1.0
                    } else {
                        0.6 * (1.0 - self.small)
                    }
            }
            GraspType::LightTool if thumb.touches => {
                self.wrapped() * if thumb.is_inner { 0.4 * self.small } else { 1.0 }
            }
            GraspType::AdductedThumb | GraspType::LightTool => 0.0,
            GraspType::Palmar => straight_fingers * self.palm,
            GraspType::FixedHook if thumb.touches => 0.0,
            GraspType::FixedHook => {
                self.curled * straight(self.features.mean(|finger| finger.knuckle), [35.0, 65.0])
            }

            // An index finger that lies on nothing points past the object.
            GraspType::IndexFingerExtension if !index.touches => 0.0,
            GraspType::IndexFingerExtension => {
                let others = fingers[1..].iter().map(|finger| finger.curl).sum::<f32>() / 3.0;
                self.index_stretched() * bent(others, CURLED)
            }

            GraspType::Ring => bent(index.knuckle + index.curl, [60.0, 100.0]),
            GraspType::Sphere3Finger => 0.5 + 0.5 * self.round,
            GraspType::ExtensionType => straight_fingers * prismatic,
            GraspType::Sphere4Finger => self.curled.max(self.round),
            GraspType::DistalType => 1.0,

            GraspType::PalmarPinch => (1.0 - self.tips()) * bent(index.curl, [15.0, 35.0]),
            GraspType::TipPinch => self.tips(),
            GraspType::InferiorPincer => (1.0 - self.tips()) * straight(index.curl, [15.0, 35.0]),
            GraspType::Prismatic2Finger | GraspType::Prismatic3Finger => prismatic,
            GraspType::Tripod | GraspType::Quadpod => self.round,
            GraspType::Prismatic4Finger => prismatic * (1.0 - parallel),
            GraspType::PrecisionDisk => self.round * (1.0 - ball),
            GraspType::PrecisionSphere => self.round * ball,
            GraspType::ParallelExtension => prismatic * parallel,

            GraspType::Lateral => (1.0 - supported) * if palm_touches { 0.0 } else { 1.0 },
            GraspType::Stick => supported * if palm_touches { 0.0 } else { 1.0 },
            GraspType::Ventral => f32::from(u8::from(palm_touches)),
            // A thumb that touches too does not belong to the grip between the fingers.
            GraspType::AdductionGrip if thumb.touches => 0.4,
            GraspType::AdductionGrip => 1.0,
            GraspType::LateralTripod | GraspType::WritingTripod | GraspType::TripodVariation => 1.0,
        }
    }

    /// How surely the index finger is stretched.
    fn index_stretched(&self) -> f32 {
        let index = self.features.fingers[0];
        straight(index.knuckle + index.curl, [30.0, 70.0])
    }

    /// How surely all fingers are curled, the index finger too.
    fn wrapped(&self) -> f32 {
        self.curled * (1.0 - self.index_stretched())
    }

    /// How surely thumb and index finger touch with their tips.
    fn tips(&self) -> f32 {
        self.features.thumb.tip.max(0.3) * self.features.fingers[0].tip
    }

    /// How surely pads of the fingers beside the index finger steady the object.
    fn supported(&self) -> f32 {
        let others = &self.features.fingers[1..];
        others.iter().map(|finger| finger.pad).fold(0.0, f32::max)
    }

    /// Cosine of the angle between the thumb's last link and where stretched fingers point.
    fn along_fingers(&self) -> f32 {
        let mut knuckles = 0.0;
        for finger in self.features.touching_fingers() {
            knuckles += finger.knuckle;
        }
        let bend = knuckles / self.features.touching.count_ones().max(1) as f32;
        let along = glam::Vec3::new(0.0, bend.cos(), bend.sin());
        self.features.thumb.along.dot(along)
    }
}

/// How well the fingers that touch are those of a cell. Against the palm, an outermost finger more or less matters little.
/// Against the thumb, neighbours that are moved on by one finger do: a pinch with the middle finger is one still, with the
/// ring finger it has no name. A skipped finger between two that touch matters more.
#[expect(
    clippy::match_same_arms,
    reason = "the palm's fingers stand apart from the thumb's"
)]
fn virtual_finger(touching: u8, cell: Cell) -> f32 {
    // From the lowest bit: index, middle, ring, little finger; written from the little one to the index finger.
    match (cell.opposition, cell.virtual_finger, touching) {
        (_, VirtualFinger::TwoToFive, 0b1111)
        | (Opposition::Palm, VirtualFinger::ThreeToFive, 0b1110 | 0b1111)
        | (Opposition::Pad, VirtualFinger::Two, 0b0001)
        | (Opposition::Pad, VirtualFinger::TwoToThree, 0b0011)
        | (Opposition::Pad, VirtualFinger::TwoToFour, 0b0111)
        | (Opposition::Side, VirtualFinger::Three, 0b0011)
        | (Opposition::Side, VirtualFinger::ThreeToFour, 0b0111 | 0b1111) => 1.0,

        (Opposition::Palm, VirtualFinger::TwoToFive, 0b0111) => 0.8,
        (Opposition::Palm, VirtualFinger::ThreeToFive, 0b0110 | 0b0111) => 0.7,
        (Opposition::Palm, VirtualFinger::TwoToFive, 0b1110) => 0.6,
        (Opposition::Palm, VirtualFinger::TwoToFive, 0b0011 | 0b0110) => 0.5,
        (Opposition::Palm, VirtualFinger::TwoToFive, 0b1011 | 0b1101) => 0.4,

        (Opposition::Pad, VirtualFinger::Two, 0b0010)
        | (Opposition::Pad, VirtualFinger::TwoToThree, 0b0110)
        | (Opposition::Pad, VirtualFinger::TwoToFour, 0b1110) => 0.6,
        (Opposition::Pad, VirtualFinger::TwoToThree, 0b0101)
        | (Opposition::Pad, VirtualFinger::TwoToFour, 0b1011 | 0b1101)
        | (Opposition::Side, VirtualFinger::Three, 0b0111 | 0b1111) => 0.4,
        _ => 0.0,
    }
}
