//! Grasp types of the taxonomy: of made hands, of the thesis' examples, and of hands that hold simple shapes.

mod examples;
mod made_grasps;

use Digit::{Index, Middle, Ring, Thumb};
use Phalanx::{First, Second, Third};

use self::made_grasps::{Degrees, Held, MIDDLE, Shape, TIP, Touching, held};
use crate::prelude::*;

const BELOW_TIPS: Degrees = [30, 8, 50, -15];
const UNDER_BALL: Degrees = [50, 15, 40, -15];
const ON_SIDE: Degrees = [10, 10, 10, 10];
const AT_SIDE: Degrees = [5, 10, 10, 10];
const OVER: Degrees = [40, 15, 50, -15];
const FAR: Degrees = [60, 10, 30, 30];
const ADDUCTED: Degrees = [0, 10, 20, 20];
const TO_INDEX: Degrees = [30, 15, 10, -15];
const TO_MIDDLE: Degrees = [45, 15, 40, -15];

const SMALL: Degrees = [0, 65, 90, 60];
const MEDIUM: Degrees = [0, 45, 65, 45];
const LARGE: Degrees = [0, 15, 40, 25];
const PINCH: Degrees = [0, 55, 45, 20];
const IDLE: Degrees = [0, 20, 30, 20];
const FLAT: Degrees = [0, 75, 8, 4];
const WRITING: Degrees = [0, 50, 40, 15];
const BEHIND_PEN: Degrees = [-10, 60, 55, 30];
const ON_TOP: Degrees = [0, 40, 50, 25];

/// From the little finger's knuckle to the index finger's.
const ACROSS_FINGERS: Vec3 = Vec3::new(0.97, 0.24, 0.0);
const PEN: Shape = Shape::Rod(Vec3::new(20.0, 105.0, 60.0), Vec3::new(0.3, 0.6, 0.75), 4.0);
const NEXT_TO_INDEX: Shape = Shape::Plate(Vec3::new(36.0, 110.0, 35.0), Vec3::X, 1.0);

/// The same link of each digit in a range.
fn links(digits: std::ops::RangeInclusive<usize>, phalanx: Phalanx, along: f32) -> Vec<Touching> {
    let digits = Digit::ALL[digits].iter();
    digits.map(|&digit| (digit, phalanx, along)).collect()
}

/// The last links of the thumb and of the first few fingers.
fn pads(fingers: usize) -> Vec<Touching> {
    links(0..=fingers, Third, MIDDLE)
}

/// The last link of the thumb and the second links of the first few fingers.
fn pad_and_seconds(fingers: usize) -> Vec<Touching> {
    [pads(0), links(1..=fingers, Second, MIDDLE)].concat()
}

/// The last link of the thumb and the two outer links of the first few fingers.
fn outer_links(fingers: usize) -> Vec<Touching> {
    [pads(fingers), links(1..=fingers, Second, MIDDLE)].concat()
}

/// All links of the fingers and the last link of the thumb.
fn all_links() -> Vec<Touching> {
    [outer_links(4), links(1..=4, First, 0.7)].concat()
}

fn all_without(digit: Digit, links: &[Touching]) -> Vec<Touching> {
    links.iter().filter(|link| link.0 != digit).copied().collect()
}

fn alike(thumb: Degrees, finger: Degrees) -> [Degrees; 5] {
    [thumb, finger, finger, finger, finger]
}

fn some(thumb: Degrees, fingers: &[Degrees]) -> [Degrees; 5] {
    let mut hand = alike(thumb, IDLE);
    hand[1..=fingers.len()].copy_from_slice(fingers);
    hand
}

/// A thumb, and fingers that bend alike and fan out.
fn spread(thumb: Degrees, [first, second, third]: [i16; 3]) -> [Degrees; 5] {
    let finger = |yaw| [yaw, first, second, third];
    [thumb, finger(-15), finger(-3), finger(8), finger(18)]
}

fn mm(x: i16, y: i16, z: i16) -> Vec3 {
    Vec3::new(x.into(), y.into(), z.into())
}

/// A rod across the fingers, at height and distance from the wrist in millimetres.
fn rod(y: i16, z: i16, radius: i16) -> Shape {
    Shape::Rod(mm(0, y, z), ACROSS_FINGERS, radius.into())
}

fn ball(middle: Vec3, radius: i16) -> Shape {
    Shape::Ball(middle, radius.into())
}

fn plate(middle: Vec3, thin: Vec3, half: i16) -> Shape {
    Shape::Plate(middle, thin, half.into())
}

/// A hand that also holds something with its palm.
fn on_palm(hand: [Degrees; 5], shape: Shape, touching: &[Touching]) -> Held {
    held(hand, shape, touching).on_palm()
}

fn cases() -> [(GraspType, Held); 33] {
    GraspType::ALL.map(|grasp_type| (grasp_type, made(grasp_type)))
}

#[expect(clippy::too_many_lines, reason = "one hand for each type of the taxonomy")]
fn made(grasp_type: GraspType) -> Held {
    use GraspType as T;
    let side_of_index = [(Thumb, Third, MIDDLE), (Index, Second, MIDDLE)];
    match grasp_type {
        T::LargeDiameter => on_palm(alike(FAR, LARGE), rod(95, 50, 40), &outer_links(4)),
        T::SmallDiameter => on_palm(alike(OVER, SMALL), rod(92, 24, 9), &all_links()),
        T::MediumWrap => on_palm(alike(OVER, MEDIUM), rod(88, 32, 20), &all_links()),
        T::AdductedThumb => {
            let links = [&all_links()[..], &[(Thumb, Second, MIDDLE)]].concat();
            on_palm(alike(ADDUCTED, MEDIUM), rod(88, 32, 18), &links)
        }
        T::LightTool => on_palm(alike(ADDUCTED, SMALL), rod(92, 24, 8), &all_links()),
        T::Prismatic4Finger => held(alike(BELOW_TIPS, PINCH), rod(98, 56, 5), &pads(4)),
        T::Prismatic3Finger => held(alike(BELOW_TIPS, PINCH), rod(100, 57, 5), &pads(3)),
        T::Prismatic2Finger => held(some(BELOW_TIPS, &[PINCH; 2]), rod(100, 57, 5), &pads(2)),
        T::PalmarPinch => {
            let slanted = plate(mm(28, 103, 61), Vec3::new(0.0, 0.87, 0.5), 1);
            held(some(TO_INDEX, &[PINCH]), slanted, &pads(1))
        }
        T::PowerDisk => {
            let disk = Shape::Disk(mm(0, 90, 25), Vec3::Z, 40.0);
            on_palm(spread([30, -10, 0, 0], [10, 60, 30]), disk, &pads(4))
        }
        T::PowerSphere => on_palm(
            spread(FAR, [35, 60, 40]),
            ball(mm(0, 90, 42), 28),
            &outer_links(4),
        ),
        T::PrecisionDisk => {
            let disk = Shape::Disk(mm(0, 90, 60), Vec3::new(0.0, 0.2, 1.0), 25.0);
            held(spread(FAR, [50, 40, 20]), disk, &pads(4))
        }
        T::PrecisionSphere => held(
            spread(UNDER_BALL, [45, 40, 20]),
            ball(mm(0, 95, 60), 16),
            &pads(4),
        ),
        T::Tripod => held(some(TO_MIDDLE, &[PINCH; 2]), ball(mm(15, 97, 55), 8), &pads(2)),
        T::FixedHook => {
            let links = all_without(Thumb, &outer_links(4));
            held(alike([0; 4], [0, 15, 90, 60]), rod(110, 20, 10), &links)
        }
        T::Lateral => held(alike(ON_SIDE, MEDIUM), NEXT_TO_INDEX, &side_of_index),
        T::Ventral => on_palm(alike(ON_SIDE, MEDIUM), NEXT_TO_INDEX, &side_of_index),
        T::IndexFingerExtension => {
            let index = [(Index, Second, MIDDLE), (Index, Third, MIDDLE)];
            let links = [&all_without(Index, &all_links())[..], &index].concat();
            let hand = [ADDUCTED, [0, 8, 5, 5], SMALL, SMALL, SMALL];
            on_palm(hand, plate(mm(0, 90, 24), Vec3::Z, 8), &links)
        }
        T::ExtensionType => {
            let links = [pad_and_seconds(3), links(1..=3, First, 0.7)].concat();
            held(alike(UNDER_BALL, FLAT), plate(mm(10, 87, 60), Vec3::Y, 4), &links)
        }
        T::DistalType => {
            let hand = alike(TO_MIDDLE, [0, 55, 50, 30]);
            held(hand, rod(95, 45, 5), &pad_and_seconds(4))
        }
        T::WritingTripod => held([TO_INDEX, WRITING, BEHIND_PEN, SMALL, SMALL], PEN, &pads(2)),
        T::TripodVariation => {
            let hand = [TO_INDEX, WRITING, BEHIND_PEN, BEHIND_PEN, SMALL];
            held(hand, PEN, &pads(3))
        }
        T::LateralTripod => {
            let side = [(Thumb, Third, MIDDLE), (Middle, Third, MIDDLE)];
            let upright = plate(mm(14, 95, 50), Vec3::new(1.0, 0.0, 0.3), 2);
            held([AT_SIDE, ON_TOP, MEDIUM, SMALL, SMALL], upright, &side)
                .also(rod(95, 40, 4), &[(Index, Third, MIDDLE)])
        }
        T::ParallelExtension => held(
            alike(TO_MIDDLE, FLAT),
            plate(mm(10, 98, 60), Vec3::Y, 4),
            &pads(4),
        ),
        T::AdductionGrip => {
            let between = [(Index, Second, MIDDLE), (Middle, Second, 0.3)];
            let rod = Shape::Rod(mm(15, 150, 20), Vec3::Z, 3.0);
            held(alike([0; 4], [0, 20, 15, 10]), rod, &between)
        }
        T::TipPinch => {
            let hand = some([20, -6, 50, 0], &[[0, 30, 50, 80]]);
            let tips = [(Thumb, Third, TIP), (Index, Third, TIP)];
            held(hand, Shape::Ball(Vec3::new(27.0, 112.0, 48.5), 2.0), &tips)
        }
        T::Sphere4Finger => {
            let hand = spread(UNDER_BALL, [45, 50, 30]);
            held(hand, ball(mm(5, 95, 55), 20), &pad_and_seconds(3))
        }
        T::Quadpod => held(
            spread(UNDER_BALL, [50, 40, 20]),
            ball(mm(5, 95, 63), 15),
            &pads(3),
        ),
        T::Sphere3Finger => {
            let hand = spread(UNDER_BALL, [45, 50, 30]);
            held(hand, ball(mm(15, 97, 55), 20), &pad_and_seconds(2))
        }
        T::Stick => {
            let stick = [(Middle, Third, MIDDLE), (Ring, Third, MIDDLE)];
            held(
                [ON_SIDE, MEDIUM, SMALL, SMALL, SMALL],
                NEXT_TO_INDEX,
                &side_of_index,
            )
            .also(rod(90, 10, 4), &stick)
        }
        T::Palmar => {
            let links = [pads(4), links(1..=2, First, MIDDLE)].concat();
            on_palm(alike(ADDUCTED, FLAT), plate(mm(0, 85, 40), Vec3::Y, 8), &links)
        }
        T::Ring => {
            let index =
                [First, Second, Third].map(|link| (Index, link, if link == First { 0.7 } else { MIDDLE }));
            held(
                some(TO_INDEX, &[MEDIUM]),
                rod(98, 35, 15),
                &[&pads(0)[..], &index].concat(),
            )
        }
        T::InferiorPincer => {
            let hand = some([40, 15, 10, -15], &[[0, 70, 5, 5]]);
            held(hand, plate(mm(28, 102, 70), Vec3::Y, 1), &pads(1))
        }
    }
}
