//! Grasp types of the taxonomy: of hands made to be of a type, of the thesis' examples, of
//! hands that hold simple shapes, and of implausible hands.

mod examples;
mod made_grasps;

use Digit::{Index, Middle, Ring, Thumb};
use Phalanx::{First, Second, Third};

use self::made_grasps::{Held, MIDDLE, Shape, TIP, Touching, held};
use crate::prelude::*;

/// Angles of thumbs in degrees: yaw and three pitches.
pub(crate) mod thumb {
    pub(crate) const BELOW_TIPS: [f32; 4] = [30.0, 8.0, 50.0, -15.0];
    pub(crate) const UNDER_BALL: [f32; 4] = [50.0, 15.0, 40.0, -15.0];
    pub(crate) const ON_SIDE: [f32; 4] = [10.0, 10.0, 10.0, 10.0];
    pub(crate) const OVER: [f32; 4] = [40.0, 15.0, 50.0, -15.0];
    pub(crate) const FAR: [f32; 4] = [60.0, 10.0, 30.0, 30.0];
    pub(crate) const ADDUCTED: [f32; 4] = [0.0, 10.0, 20.0, 20.0];
    pub(crate) const TO_INDEX: [f32; 4] = [30.0, 15.0, 10.0, -15.0];
    pub(crate) const TO_MIDDLE: [f32; 4] = [45.0, 15.0, 40.0, -15.0];
}

/// Angles of fingers likewise.
pub(crate) const SMALL: [f32; 4] = [0.0, 65.0, 90.0, 60.0];
const MEDIUM: [f32; 4] = [0.0, 45.0, 65.0, 45.0];
pub(crate) const LARGE: [f32; 4] = [0.0, 15.0, 40.0, 25.0];
pub(crate) const PINCH: [f32; 4] = [0.0, 55.0, 45.0, 20.0];
const IDLE: [f32; 4] = [0.0, 20.0, 30.0, 20.0];
const FLAT: [f32; 4] = [0.0, 75.0, 8.0, 4.0];
const WRITING: [f32; 4] = [0.0, 50.0, 40.0, 15.0];
const BEHIND_PEN: [f32; 4] = [-10.0, 60.0, 55.0, 30.0];

/// From the little finger's knuckle to the index finger's.
const ACROSS_FINGERS: Vec3 = Vec3::new(0.97, 0.24, 0.0);
const PEN: Shape = Shape::Rod(Vec3::new(20.0, 105.0, 60.0), Vec3::new(0.3, 0.6, 0.75), 4.0);
const NEXT_TO_INDEX: Shape = Shape::Plate(Vec3::new(36.0, 110.0, 35.0), Vec3::X, 1.0);

/// The same link of the thumb or a finger and of others up to a finger.
fn links(digits: std::ops::RangeInclusive<usize>, phalanx: Phalanx, along: f32) -> Vec<Touching> {
    Digit::ALL[digits]
        .iter()
        .map(|&digit| (digit, phalanx, along))
        .collect()
}

/// The last links of the thumb and of the first few fingers.
pub(crate) fn pads(fingers: usize) -> Vec<Touching> {
    links(0..=fingers, Third, MIDDLE)
}

/// The last link of the thumb and the second links of the first few fingers.
fn pad_and_seconds(fingers: usize) -> Vec<Touching> {
    [pads(0), links(1..=fingers, Second, MIDDLE)].concat()
}

/// The last link of the thumb and the two outer links of the first few fingers.
pub(crate) fn outer_links(fingers: usize) -> Vec<Touching> {
    [pads(fingers), links(1..=fingers, Second, MIDDLE)].concat()
}

/// All links of the fingers and the last link of the thumb.
fn all_links() -> Vec<Touching> {
    [outer_links(4), links(1..=4, First, 0.7)].concat()
}

fn all_without(digit: Digit, links: &[Touching]) -> Vec<Touching> {
    links.iter().filter(|link| link.0 != digit).copied().collect()
}

/// A thumb, and fingers that bend alike.
pub(crate) fn alike(thumb: [f32; 4], finger: [f32; 4]) -> [[f32; 4]; 5] {
    [thumb, finger, finger, finger, finger]
}

/// A thumb, and fingers that bend alike and fan out.
pub(crate) fn spread(thumb: [f32; 4], [first, second, third]: [f32; 3]) -> [[f32; 4]; 5] {
    let finger = |yaw| [yaw, first, second, third];
    [thumb, finger(-15.0), finger(-3.0), finger(8.0), finger(18.0)]
}

/// A point in millimetres or a direction.
pub(crate) fn v(x: f32, y: f32, z: f32) -> Vec3 {
    Vec3::new(x, y, z)
}

/// A rod across the fingers, at height and distance from the wrist in millimetres.
pub(crate) fn rod(y: f32, z: f32, radius: f32) -> Shape {
    Shape::Rod(v(0.0, y, z), ACROSS_FINGERS, radius)
}

fn plate(middle: Vec3, thin: Vec3, half: f32) -> Shape {
    Shape::Plate(middle, thin, half)
}

/// Every type with a hand of it.
pub(crate) fn cases() -> [(GraspType, Held); 33] {
    GraspType::ALL.map(|grasp_type| (grasp_type, made(grasp_type)))
}

/// A hand of a type.
#[expect(clippy::too_many_lines, reason = "one hand for each type of the taxonomy")]
pub(crate) fn made(grasp_type: GraspType) -> Held {
    use GraspType as T;
    let side_of_index = [(Thumb, Third, MIDDLE), (Index, Second, MIDDLE)];
    let held = match grasp_type {
        T::LargeDiameter => held(alike(thumb::FAR, LARGE), rod(95.0, 50.0, 40.0), &outer_links(4)),
        T::SmallDiameter => held(alike(thumb::OVER, SMALL), rod(92.0, 24.0, 9.0), &all_links()),
        T::MediumWrap => held(alike(thumb::OVER, MEDIUM), rod(88.0, 32.0, 20.0), &all_links()),
        T::AdductedThumb => {
            let links = [&all_links()[..], &[(Thumb, Second, MIDDLE)]].concat();
            held(alike(thumb::ADDUCTED, MEDIUM), rod(88.0, 32.0, 18.0), &links)
        }
        T::LightTool => held(alike(thumb::ADDUCTED, SMALL), rod(92.0, 24.0, 8.0), &all_links()),
        T::Prismatic4Finger => held(alike(thumb::BELOW_TIPS, PINCH), rod(98.0, 56.0, 5.0), &pads(4)),
        T::Prismatic3Finger => held(alike(thumb::BELOW_TIPS, PINCH), rod(100.0, 57.0, 5.0), &pads(3)),
        T::Prismatic2Finger => {
            let hand = [thumb::BELOW_TIPS, PINCH, PINCH, IDLE, IDLE];
            held(hand, rod(100.0, 57.0, 5.0), &pads(2))
        }
        T::PalmarPinch => {
            let slanted = plate(v(28.0, 103.0, 61.0), v(0.0, 0.87, 0.5), 1.0);
            held([thumb::TO_INDEX, PINCH, IDLE, IDLE, IDLE], slanted, &pads(1))
        }
        T::PowerDisk => {
            let disk = Shape::Disk(v(0.0, 90.0, 25.0), Vec3::Z, 40.0);
            held(
                spread([30.0, -10.0, 0.0, 0.0], [10.0, 60.0, 30.0]),
                disk,
                &pads(4),
            )
        }
        T::PowerSphere => {
            let ball = Shape::Ball(v(0.0, 90.0, 42.0), 28.0);
            held(spread(thumb::FAR, [35.0, 60.0, 40.0]), ball, &outer_links(4))
        }
        T::PrecisionDisk => {
            let disk = Shape::Disk(v(0.0, 90.0, 60.0), v(0.0, 0.2, 1.0), 25.0);
            held(spread(thumb::FAR, [50.0, 40.0, 20.0]), disk, &pads(4))
        }
        T::PrecisionSphere => {
            let ball = Shape::Ball(v(0.0, 95.0, 60.0), 16.0);
            held(spread(thumb::UNDER_BALL, [45.0, 40.0, 20.0]), ball, &pads(4))
        }
        T::Tripod => {
            let hand = [thumb::TO_MIDDLE, PINCH, PINCH, IDLE, IDLE];
            held(hand, Shape::Ball(v(15.0, 97.0, 55.0), 8.0), &pads(2))
        }
        T::FixedHook => {
            let hand = alike([0.0; 4], [0.0, 15.0, 90.0, 60.0]);
            held(hand, rod(110.0, 20.0, 10.0), &all_without(Thumb, &outer_links(4)))
        }
        T::Lateral | T::Ventral => held(alike(thumb::ON_SIDE, MEDIUM), NEXT_TO_INDEX, &side_of_index),
        T::IndexFingerExtension => {
            let hand = [thumb::ADDUCTED, [0.0, 8.0, 5.0, 5.0], SMALL, SMALL, SMALL];
            let index = [(Index, Second, MIDDLE), (Index, Third, MIDDLE)];
            let links = [&all_without(Index, &all_links())[..], &index].concat();
            held(hand, plate(v(0.0, 90.0, 24.0), Vec3::Z, 8.0), &links)
        }
        T::ExtensionType => {
            let links = [pad_and_seconds(3), links(1..=3, First, 0.7)].concat();
            held(
                alike(thumb::UNDER_BALL, FLAT),
                plate(v(10.0, 87.0, 60.0), Vec3::Y, 4.0),
                &links,
            )
        }
        T::DistalType => {
            let hand = alike(thumb::TO_MIDDLE, [0.0, 55.0, 50.0, 30.0]);
            held(hand, rod(95.0, 45.0, 5.0), &pad_and_seconds(4))
        }
        T::WritingTripod => held(
            [thumb::TO_INDEX, WRITING, BEHIND_PEN, SMALL, SMALL],
            PEN,
            &pads(2),
        ),
        T::TripodVariation => held(
            [thumb::TO_INDEX, WRITING, BEHIND_PEN, BEHIND_PEN, SMALL],
            PEN,
            &pads(3),
        ),
        T::LateralTripod => {
            let hand = [
                [5.0, 10.0, 10.0, 10.0],
                [0.0, 40.0, 50.0, 25.0],
                MEDIUM,
                SMALL,
                SMALL,
            ];
            let side = [(Thumb, Third, MIDDLE), (Middle, Third, MIDDLE)];
            held(hand, plate(v(14.0, 95.0, 50.0), v(1.0, 0.0, 0.3), 2.0), &side)
                .also(rod(95.0, 40.0, 4.0), &[(Index, Third, MIDDLE)])
        }
        T::ParallelExtension => held(
            alike(thumb::TO_MIDDLE, FLAT),
            plate(v(10.0, 98.0, 60.0), Vec3::Y, 4.0),
            &pads(4),
        ),
        T::AdductionGrip => {
            let between = [(Index, Second, MIDDLE), (Middle, Second, 0.3)];
            let rod = Shape::Rod(v(15.0, 150.0, 20.0), Vec3::Z, 3.0);
            held(alike([0.0; 4], [0.0, 20.0, 15.0, 10.0]), rod, &between)
        }
        T::TipPinch => {
            let hand = [[20.0, -6.0, 50.0, 0.0], [0.0, 30.0, 50.0, 80.0], IDLE, IDLE, IDLE];
            let ball = Shape::Ball(v(27.0, 112.0, 48.5), 2.0);
            held(hand, ball, &[(Thumb, Third, TIP), (Index, Third, TIP)])
        }
        T::Sphere4Finger => {
            let ball = Shape::Ball(v(5.0, 95.0, 55.0), 20.0);
            held(
                spread(thumb::UNDER_BALL, [45.0, 50.0, 30.0]),
                ball,
                &pad_and_seconds(3),
            )
        }
        T::Quadpod => {
            let ball = Shape::Ball(v(5.0, 95.0, 63.0), 15.0);
            held(spread(thumb::UNDER_BALL, [50.0, 40.0, 20.0]), ball, &pads(3))
        }
        T::Sphere3Finger => {
            let ball = Shape::Ball(v(15.0, 97.0, 55.0), 20.0);
            held(
                spread(thumb::UNDER_BALL, [45.0, 50.0, 30.0]),
                ball,
                &pad_and_seconds(2),
            )
        }
        T::Stick => {
            let hand = [thumb::ON_SIDE, MEDIUM, SMALL, SMALL, SMALL];
            let stick = [(Middle, Third, MIDDLE), (Ring, Third, MIDDLE)];
            held(hand, NEXT_TO_INDEX, &side_of_index).also(rod(90.0, 10.0, 4.0), &stick)
        }
        T::Palmar => {
            let links = [pads(4), links(1..=2, First, MIDDLE)].concat();
            held(
                alike(thumb::ADDUCTED, FLAT),
                plate(v(0.0, 85.0, 40.0), Vec3::Y, 8.0),
                &links,
            )
        }
        T::Ring => {
            let index = [
                (Index, First, 0.7),
                (Index, Second, MIDDLE),
                (Index, Third, MIDDLE),
            ];
            let links = [&pads(0)[..], &index].concat();
            held(
                [thumb::TO_INDEX, MEDIUM, IDLE, IDLE, IDLE],
                rod(98.0, 35.0, 15.0),
                &links,
            )
        }
        T::InferiorPincer => {
            let hand = [[40.0, 15.0, 10.0, -15.0], [0.0, 70.0, 5.0, 5.0], IDLE, IDLE, IDLE];
            held(hand, plate(v(28.0, 102.0, 70.0), Vec3::Y, 1.0), &pads(1))
        }
    };
    let on_palm = [
        T::LargeDiameter,
        T::SmallDiameter,
        T::MediumWrap,
        T::AdductedThumb,
        T::LightTool,
        T::PowerDisk,
        T::PowerSphere,
        T::IndexFingerExtension,
        T::Palmar,
        T::Ventral,
    ];
    if on_palm.contains(&grasp_type) {
        held.on_palm()
    } else {
        held
    }
}
