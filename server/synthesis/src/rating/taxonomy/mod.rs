//! Classifies grasps by the GRASP taxonomy (thesis 2.4). The thesis judges by eye and calls grasps of no type unnatural
//! (5.2, 6.1); this computes the type of every grasp: `features` and `held_part` measure, `scores` rates each type by the fit to its
//! cell times the fit within the cell, and `KIN` says which types an expert may take for each other. The taxonomy's paper defines
//! types by pictures; criteria and thresholds are this project's reading of those.

mod features;
mod held_part;

use GraspType as T;
use held_part::{ShapeFits, falling, rising};

use self::features::{Features, Finger, bent, opposed, straight};
use crate::{
    geometry::local_shape::LocalShape,
    model::{
        grasp::Contact,
        grasp_type::{
            Cell, Classification, GraspClass, GraspType, MIN_CONFIDENCE, Opposition, ThumbPosition,
            VirtualFinger,
        },
        hand::{HandPose, rig::Rig},
    },
};

/// Share of the best rival's fit that is subtracted from the winner's if the two are not kin: a tie halves the confidence.
const DOUBT: f32 = 0.5;

/// The same share for kin. An expert who prefers the rival still accepts the winner.
const DOUBT_OF_KIN: f32 = 0.1;

/// Classifies a grasp from the receiving hand, its contacts and the shape of the held object, all in the same frame, in metres.
/// Independent of handedness and hand size.
pub fn classify(rig: &Rig, pose: &HandPose, contacts: &[Contact], shape: &LocalShape) -> Classification {
    let scores = scores(&features::Features::of(rig, pose, contacts, shape));
    let mut best = 0;
    for (index, score) in scores.iter().enumerate() {
        if *score > scores[best] {
            best = index;
        }
    }
    let mut doubt = 0.0_f32;
    for (index, score) in scores.iter().enumerate().filter(|(index, _)| *index != best) {
        let share = if KIN_OF[best] >> index & 1 == 1 {
            DOUBT_OF_KIN
        } else {
            DOUBT
        };
        doubt = doubt.max(share * score);
    }
    let confidence = scores[best] - doubt;
    Classification {
        grasp_type: (confidence >= MIN_CONFIDENCE).then_some(GraspType::ALL[best]),
        confidence,
    }
}

/// Height of the thumb's tip above the palm's plane, in hand lengths, over which the thumb goes from adducted to abducted: 2 to 5
/// cm on an adult's hand. Larger values classify more thumbs as adducted.
const THUMB_HEIGHT: [f32; 2] = [0.12, 0.26];

/// Mean flexion of the two outer joints together, in degrees, over which extended fingers become curled.
const CURLED: [f32; 2] = [40.0, 80.0];

/// Mean flexion, in degrees, over which fingers begin to wrap around something; a large object needs little.
const AROUND: [f32; 2] = [15.0, 45.0];

/// Mean of [`Finger::inner`] over which precision becomes power.
const POWER: [f32; 2] = [0.3, 0.7];

/// Fit of fingertips if more than the tips holds something for which the taxonomy shows no power type with these fingers: two or
/// three on anything but a ball, one on a ball.
const MORE_THAN_TIPS: f32 = 0.6;

/// How far a finger's side counts as its pad on an object that cannot be held against a side: a ball, or something wide.
const SIDE_AS_PAD: f32 = 0.7;

/// Discount on side opposition if a pad of the same finger touches too.
const PAD_DISCOUNT: f32 = 0.8;

/// Discount on pad and middle-finger side opposition if the palm supports the object.
const PALM_DISCOUNT: f32 = 0.85;

/// The score of each type, in the order of [`GraspType::ALL`].
fn scores(features: &Features) -> [f32; 33] {
    let view = View::new(features);
    GraspType::ALL.map(|grasp_type| {
        let cell = view.cell(grasp_type.cell());
        // Most types are ruled out by their cell.
        if cell == 0.0 {
            0.0
        } else {
            cell * view.within_cell(grasp_type)
        }
    })
}

/// The degrees of membership that cells and types combine, 0 to 1.
struct View<'a> {
    features: &'a Features,
    shape: ShapeFits,
    palm: f32,
    pad: f32,
    side_of_index: f32,
    /// Thumb against the middle finger's side, with the index finger's pad on the object.
    side_of_middle: f32,
    between_fingers: f32,
    abducted: f32,
    inner: f32,
    curled: f32,
    around: f32,
    index_extended: f32,
    tips: f32,
    /// A pad of another finger than the index supports the object.
    supported: f32,
}

impl<'a> View<'a> {
    fn new(features: &'a Features) -> Self {
        let Features {
            thumb,
            fingers: [index, middle, ..],
            ..
        } = features;
        let shape = ShapeFits::of(features);
        let side_as_pad = SIDE_AS_PAD * (1.0 - shape.between_sides);
        let pad = |finger: &Finger| finger.pad + side_as_pad * (1.0 - finger.pad);
        let thumb_against_pads = if thumb.touches {
            opposed(thumb.press, features.mean_press(pad))
        } else {
            0.0
        };
        let against_side = |finger: &Finger| {
            if thumb.touches {
                finger.radial * (1.0 - PAD_DISCOUNT * finger.pad) * opposed(thumb.press, finger.press)
            } else {
                0.0
            }
        };
        let pads = features.mean(pad);
        let away_from_palm = 1.0 - PALM_DISCOUNT * features.palm_support;
        let curl = features.mean(|finger| finger.curl);
        Self {
            features,
            palm: features.palm_support * pads,
            pad: thumb_against_pads * pads * away_from_palm,
            side_of_index: against_side(index),
            side_of_middle: against_side(middle) * index.pad * away_from_palm,
            between_fingers: index.ulnar.min(middle.radial) * opposed(index.press, middle.press),
            abducted: rising(thumb.height, THUMB_HEIGHT),
            inner: features.mean(|finger| finger.inner),
            curled: bent(curl, CURLED),
            around: bent(curl, AROUND),
            index_extended: straight(index.knuckle + index.curl, [30.0, 70.0]),
            tips: thumb.tip.max(0.3) * index.tip,
            supported: features.fingers[1..]
                .iter()
                .map(|finger| finger.pad)
                .fold(0.0, f32::max),
            shape,
        }
    }

    fn cell(&self, cell: Cell) -> f32 {
        let thumb = match cell.thumb {
            ThumbPosition::Abducted => self.abducted,
            ThumbPosition::Adducted => 1.0 - self.abducted,
        };
        let fingers = virtual_finger(self.features.touching, cell);
        let no_thumb = !self.features.thumb.touches;
        match (cell.class, cell.opposition, cell.virtual_finger) {
            // A thumb without contact opposes nothing.
            (_, Opposition::Palm, _) if no_thumb && cell.thumb == ThumbPosition::Abducted => 0.0,
            (_, Opposition::Palm, _) if no_thumb => fingers,
            (_, Opposition::Palm, _) => self.palm * thumb * fingers,
            // A thumb that opposes pads needs no test of its position. Parallel Extension, adducted in the table, itself requires
            // the thumb along the fingers.
            (GraspClass::Power, Opposition::Pad, _) => self.pad * rising(self.inner, POWER) * fingers,
            (_, Opposition::Pad, VirtualFinger::Two) => {
                let precise = falling(self.inner, POWER).max(MORE_THAN_TIPS * self.shape.ball);
                self.pad * precise * fingers
            }
            (_, Opposition::Pad, VirtualFinger::TwoToFive) => self.pad * falling(self.inner, POWER) * fingers,
            (_, Opposition::Pad, _) => {
                let precise = falling(self.inner, POWER).max(MORE_THAN_TIPS * (1.0 - self.shape.ball));
                self.pad * precise * fingers
            }
            (_, Opposition::Side, VirtualFinger::Two) if cell.thumb == ThumbPosition::Abducted => {
                self.between_fingers
            }
            (_, Opposition::Side, VirtualFinger::Two) => self.side_of_index,
            (_, Opposition::Side, _) => self.side_of_middle * thumb * fingers,
        }
    }

    /// Fit of a type within its cell.
    #[expect(clippy::match_same_arms, reason = "the arms are grouped by cell")]
    fn within_cell(&self, grasp_type: GraspType) -> f32 {
        let Features {
            thumb,
            fingers,
            palm_touches,
            ..
        } = self.features;
        let index = &fingers[0];
        let shape = &self.shape;
        let straight_fingers = 1.0 - self.curled;
        let wrapped = shape.bar * self.curled * (1.0 - self.index_extended);
        match grasp_type {
            GraspType::LargeDiameter => shape.bar * self.around * shape.large,
            GraspType::SmallDiameter => shape.bar * self.around * shape.small,
            GraspType::MediumWrap => shape.bar * self.around * shape.medium,
            GraspType::PowerDisk => shape.disk,
            GraspType::PowerSphere => shape.ball_in_fist,

            GraspType::AdductedThumb if thumb.is_inner => wrapped,
            GraspType::AdductedThumb if thumb.touches => 0.5 * wrapped * (1.0 - shape.small),
            GraspType::LightTool if thumb.is_inner => 0.4 * wrapped * shape.small,
            GraspType::LightTool if thumb.touches => wrapped * shape.light,
            GraspType::AdductedThumb | GraspType::LightTool => 0.0,
            GraspType::Palmar => shape.flat * straight_fingers * self.palm,
            GraspType::FixedHook if thumb.touches => 0.0,
            GraspType::FixedHook => {
                shape.bar * self.curled * straight(self.features.mean(|finger| finger.knuckle), [35.0, 65.0])
            }

            // An index finger without contact points past the object.
            GraspType::IndexFingerExtension if !index.touches => 0.0,
            GraspType::IndexFingerExtension => {
                let others = fingers[1..].iter().map(|finger| finger.curl).sum::<f32>() / 3.0;
                shape.bar * self.index_extended * bent(others, CURLED)
            }

            GraspType::Ring => shape.ring * bent(index.knuckle + index.curl, [60.0, 100.0]),
            GraspType::Sphere3Finger | GraspType::Sphere4Finger => shape.ball,
            GraspType::ExtensionType => shape.flat * straight_fingers,
            GraspType::DistalType => shape.loops,

            GraspType::PalmarPinch => shape.pinchable * (1.0 - self.tips) * bent(index.curl, [15.0, 35.0]),
            GraspType::TipPinch => shape.pinchable * self.tips,
            GraspType::InferiorPincer => {
                shape.pinchable * (1.0 - self.tips) * straight(index.curl, [15.0, 35.0])
            }
            GraspType::Prismatic2Finger | GraspType::Prismatic3Finger => shape.prismatic,
            GraspType::Tripod | GraspType::Quadpod => shape.compact,
            GraspType::Prismatic4Finger => shape.prismatic * (1.0 - shape.plate * self.parallel()),
            GraspType::PrecisionDisk => shape.disk,
            GraspType::PrecisionSphere => shape.ball,
            GraspType::ParallelExtension => shape.flat * self.parallel(),

            GraspType::Lateral if *palm_touches => 0.0,
            GraspType::Lateral => shape.between_sides * (1.0 - self.supported * shape.stick),
            GraspType::Stick if *palm_touches => 0.0,
            GraspType::Stick => shape.between_sides * shape.stick * self.supported,
            GraspType::Ventral if *palm_touches => shape.between_sides * shape.bar,
            GraspType::Ventral => 0.0,
            // A touching thumb is no part of a grip between two fingers.
            GraspType::AdductionGrip if thumb.touches => 0.4,
            GraspType::AdductionGrip => 1.0,
            GraspType::LateralTripod | GraspType::WritingTripod | GraspType::TripodVariation => shape.pen,
        }
    }

    /// Degree to which thumb and fingers are extended side by side.
    fn parallel(&self) -> f32 {
        let bend = self.features.mean(|finger| finger.knuckle);
        let along_fingers = glam::Vec3::new(0.0, bend.cos(), bend.sin());
        (1.0 - self.curled) * rising(self.features.thumb.along.dot(along_fingers), [0.6, 0.85])
    }
}

/// How well the touching fingers match those of a cell. Against the palm, one outer finger more or less matters little.
#[expect(
    clippy::match_same_arms,
    reason = "palm and thumb oppositions are grouped separately"
)]
fn virtual_finger(touching: u8, cell: Cell) -> f32 {
    // Lowest bit first: index, middle, ring, little finger. Literals read from little to index finger.
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
