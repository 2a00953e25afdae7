//! A hand for each type.

use glam::Vec3;
use grasp_synthesis::model::{
    grasp_type::GraspType,
    hand::{Digit, Phalanx},
};

use super::made_grasps::{Held, MIDDLE, Shape, TIP, Touching, held};
use Digit::{Index, Middle, Ring, Thumb};
use Phalanx::{First, Second, Third};

/// The last links of the thumb and of the first few fingers.
pub(crate) fn pads(fingers: usize) -> Vec<Touching> {
    Digit::ALL[..=fingers]
        .iter()
        .map(|&digit| (digit, Third, MIDDLE))
        .collect()
}

/// The second links of the first few fingers.
fn seconds(fingers: usize) -> Vec<Touching> {
    Digit::ALL[1..=fingers]
        .iter()
        .map(|&digit| (digit, Second, MIDDLE))
        .collect()
}

/// The last link of the thumb and the two outer links of the first few fingers.
pub(crate) fn outer_links(fingers: usize) -> Vec<Touching> {
    [pads(fingers), seconds(fingers)].concat()
}

/// All links of the fingers and the last link of the thumb.
fn all_links() -> Vec<Touching> {
    let firsts = Digit::ALL[1..].iter().map(|&digit| (digit, First, 0.7));
    outer_links(4).into_iter().chain(firsts).collect()
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

/// From the little finger's knuckle to the index finger's.
const ACROSS_FINGERS: Vec3 = Vec3::new(0.97, 0.24, 0.0);
/// A surface against the palm.
pub(crate) const PALM_BELOW: Shape = Shape::Plate(Vec3::new(0.0, 80.0, 30.0), Vec3::Z, 16.0);

/// A point in millimetres or a direction.
pub(crate) fn v(x: f32, y: f32, z: f32) -> Vec3 {
    Vec3::new(x, y, z)
}

/// A rod across the fingers, at height and distance from the wrist in millimetres.
pub(crate) fn rod(y: f32, z: f32, radius: f32) -> Shape {
    Shape::Rod(v(0.0, y, z), ACROSS_FINGERS, radius)
}

const PEN: Shape = Shape::Rod(Vec3::new(20.0, 105.0, 60.0), Vec3::new(0.3, 0.6, 0.75), 4.0);
pub(crate) const THUMB_BELOW_TIPS: [f32; 4] = [30.0, 8.0, 50.0, -15.0];
pub(crate) const THUMB_UNDER_BALL: [f32; 4] = [50.0, 15.0, 40.0, -15.0];
const THUMB_ON_SIDE: [f32; 4] = [10.0, 10.0, 10.0, 10.0];
const NEXT_TO_INDEX: Shape = Shape::Plate(Vec3::new(36.0, 110.0, 35.0), Vec3::X, 1.0);
pub(crate) const THUMB_OVER_FINGERS: [f32; 4] = [40.0, 15.0, 50.0, -15.0];
pub(crate) const THUMB_FAR: [f32; 4] = [60.0, 10.0, 30.0, 30.0];
const THUMB_ADDUCTED: [f32; 4] = [0.0, 10.0, 20.0, 20.0];
const THUMB_TO_INDEX: [f32; 4] = [30.0, 15.0, 10.0, -15.0];
const THUMB_TO_MIDDLE: [f32; 4] = [45.0, 15.0, 40.0, -15.0];

/// Every type with a hand of it.
#[expect(clippy::too_many_lines, reason = "a list")]
pub(crate) fn cases() -> Vec<(GraspType, Held)> {
    use GraspType as T;
    let small = [0.0, 65.0, 90.0, 60.0];
    let medium = [0.0, 45.0, 65.0, 45.0];
    let large = [0.0, 15.0, 40.0, 25.0];
    let pinch = [0.0, 55.0, 45.0, 20.0];
    let idle = [0.0, 20.0, 30.0, 20.0];
    let slanted = v(0.0, 0.87, 0.5);
    let mut thumb_inside = all_links();
    thumb_inside.push((Thumb, Second, MIDDLE));
    let mut index_along = all_links();
    index_along.retain(|&(digit, ..)| digit != Index);
    index_along.extend([(Index, Second, MIDDLE), (Index, Third, MIDDLE)]);
    let mut hook = outer_links(4);
    hook.retain(|&(digit, ..)| digit != Thumb);
    let side_of_index = [(Thumb, Third, MIDDLE), (Index, Second, MIDDLE)];
    let tripod = [
        (Thumb, Third, MIDDLE),
        (Index, Third, MIDDLE),
        (Middle, Third, MIDDLE),
    ];
    vec![
        (
            T::LargeDiameter,
            held(
                alike(THUMB_FAR, large),
                rod(95.0, 50.0, 40.0),
                &outer_links(4),
                Some(PALM_BELOW),
            ),
        ),
        (
            T::SmallDiameter,
            held(
                alike(THUMB_OVER_FINGERS, small),
                rod(92.0, 24.0, 9.0),
                &all_links(),
                Some(PALM_BELOW),
            ),
        ),
        (
            T::MediumWrap,
            held(
                alike(THUMB_OVER_FINGERS, medium),
                rod(88.0, 32.0, 20.0),
                &all_links(),
                Some(PALM_BELOW),
            ),
        ),
        (
            T::AdductedThumb,
            held(
                alike(THUMB_ADDUCTED, medium),
                rod(88.0, 32.0, 18.0),
                &thumb_inside,
                Some(PALM_BELOW),
            ),
        ),
        (
            T::LightTool,
            held(
                alike(THUMB_ADDUCTED, small),
                rod(92.0, 24.0, 8.0),
                &all_links(),
                Some(PALM_BELOW),
            ),
        ),
        (
            T::Prismatic4Finger,
            held(
                alike(THUMB_BELOW_TIPS, pinch),
                rod(98.0, 56.0, 5.0),
                &pads(4),
                None,
            ),
        ),
        (
            T::Prismatic3Finger,
            held(
                alike(THUMB_BELOW_TIPS, pinch),
                rod(100.0, 57.0, 5.0),
                &pads(3),
                None,
            ),
        ),
        (
            T::Prismatic2Finger,
            held(
                [THUMB_BELOW_TIPS, pinch, pinch, idle, idle],
                rod(100.0, 57.0, 5.0),
                &pads(2),
                None,
            ),
        ),
        (
            T::PalmarPinch,
            held(
                [THUMB_TO_INDEX, pinch, idle, idle, idle],
                Shape::Plate(v(28.0, 103.0, 61.0), slanted, 1.0),
                &pads(1),
                None,
            ),
        ),
        (
            T::PowerDisk,
            held(
                spread([30.0, -10.0, 0.0, 0.0], [10.0, 60.0, 30.0]),
                Shape::Disk(v(0.0, 90.0, 25.0), Vec3::Z, 40.0),
                &pads(4),
                Some(PALM_BELOW),
            ),
        ),
        (
            T::PowerSphere,
            held(
                spread(THUMB_FAR, [35.0, 60.0, 40.0]),
                Shape::Ball(v(0.0, 90.0, 42.0), 28.0),
                &outer_links(4),
                Some(PALM_BELOW),
            ),
        ),
        (
            T::PrecisionDisk,
            held(
                spread(THUMB_FAR, [50.0, 40.0, 20.0]),
                Shape::Disk(v(0.0, 90.0, 60.0), v(0.0, 0.2, 1.0), 25.0),
                &pads(4),
                None,
            ),
        ),
        (
            T::PrecisionSphere,
            held(
                spread(THUMB_UNDER_BALL, [45.0, 40.0, 20.0]),
                Shape::Ball(v(0.0, 95.0, 60.0), 16.0),
                &pads(4),
                None,
            ),
        ),
        (
            T::Tripod,
            held(
                [THUMB_TO_MIDDLE, pinch, pinch, idle, idle],
                Shape::Ball(v(15.0, 97.0, 55.0), 8.0),
                &pads(2),
                None,
            ),
        ),
        (
            T::FixedHook,
            held(
                alike([0.0; 4], [0.0, 15.0, 90.0, 60.0]),
                rod(110.0, 20.0, 10.0),
                &hook,
                None,
            ),
        ),
        (
            T::Lateral,
            held(
                [THUMB_ON_SIDE, medium, medium, medium, medium],
                NEXT_TO_INDEX,
                &side_of_index,
                None,
            ),
        ),
        (
            T::IndexFingerExtension,
            held(
                [THUMB_ADDUCTED, [0.0, 8.0, 5.0, 5.0], small, small, small],
                Shape::Plate(v(0.0, 90.0, 24.0), Vec3::Z, 8.0),
                &index_along,
                Some(PALM_BELOW),
            ),
        ),
        (
            T::ExtensionType,
            held(
                alike(THUMB_UNDER_BALL, [0.0, 75.0, 8.0, 4.0]),
                Shape::Plate(v(10.0, 87.0, 60.0), Vec3::Y, 4.0),
                &[
                    &pads(0)[..],
                    &seconds(3),
                    &[Index, Middle, Ring].map(|digit| (digit, First, 0.7)),
                ]
                .concat(),
                None,
            ),
        ),
        (
            T::DistalType,
            held(
                alike(THUMB_TO_MIDDLE, [0.0, 55.0, 50.0, 30.0]),
                rod(95.0, 45.0, 5.0),
                &[pads(0), seconds(4)].concat(),
                None,
            ),
        ),
        (
            T::WritingTripod,
            held(
                [
                    THUMB_TO_INDEX,
                    [0.0, 50.0, 40.0, 15.0],
                    [-10.0, 60.0, 55.0, 30.0],
                    small,
                    small,
                ],
                PEN,
                &tripod,
                None,
            ),
        ),
        (
            T::TripodVariation,
            held(
                [
                    THUMB_TO_INDEX,
                    [0.0, 50.0, 40.0, 15.0],
                    [-10.0, 60.0, 55.0, 30.0],
                    [-10.0, 60.0, 55.0, 30.0],
                    small,
                ],
                PEN,
                &[&tripod[..], &[(Ring, Third, MIDDLE)]].concat(),
                None,
            ),
        ),
        (
            T::LateralTripod,
            held(
                [
                    [5.0, 10.0, 10.0, 10.0],
                    [0.0, 40.0, 50.0, 25.0],
                    medium,
                    small,
                    small,
                ],
                Shape::Plate(v(14.0, 95.0, 50.0), v(1.0, 0.0, 0.3), 2.0),
                &[(Thumb, Third, MIDDLE), (Middle, Third, MIDDLE)],
                None,
            )
            .also(rod(95.0, 40.0, 4.0), &[(Index, Third, MIDDLE)]),
        ),
        (
            T::ParallelExtension,
            held(
                alike(THUMB_TO_MIDDLE, [0.0, 75.0, 8.0, 4.0]),
                Shape::Plate(v(10.0, 98.0, 60.0), Vec3::Y, 4.0),
                &pads(4),
                None,
            ),
        ),
        (
            T::AdductionGrip,
            held(
                alike([0.0; 4], [0.0, 20.0, 15.0, 10.0]),
                Shape::Rod(v(15.0, 150.0, 20.0), Vec3::Z, 3.0),
                &[(Index, Second, MIDDLE), (Middle, Second, 0.3)],
                None,
            ),
        ),
        (
            T::TipPinch,
            held(
                [[20.0, -6.0, 50.0, 0.0], [0.0, 30.0, 50.0, 80.0], idle, idle, idle],
                Shape::Ball(v(27.0, 112.0, 48.5), 2.0),
                &[(Thumb, Third, TIP), (Index, Third, TIP)],
                None,
            ),
        ),
        (
            T::Sphere4Finger,
            held(
                spread(THUMB_UNDER_BALL, [45.0, 50.0, 30.0]),
                Shape::Ball(v(5.0, 95.0, 55.0), 20.0),
                &[pads(0), seconds(3)].concat(),
                None,
            ),
        ),
        (
            T::Quadpod,
            held(
                spread(THUMB_UNDER_BALL, [50.0, 40.0, 20.0]),
                Shape::Ball(v(5.0, 95.0, 63.0), 15.0),
                &pads(3),
                None,
            ),
        ),
        (
            T::Sphere3Finger,
            held(
                spread(THUMB_UNDER_BALL, [45.0, 50.0, 30.0]),
                Shape::Ball(v(15.0, 97.0, 55.0), 20.0),
                &[pads(0), seconds(2)].concat(),
                None,
            ),
        ),
        (
            T::Stick,
            held(
                [THUMB_ON_SIDE, medium, small, small, small],
                NEXT_TO_INDEX,
                &side_of_index,
                None,
            )
            .also(
                rod(90.0, 10.0, 4.0),
                &[(Middle, Third, MIDDLE), (Ring, Third, MIDDLE)],
            ),
        ),
        (
            T::Palmar,
            held(
                alike(THUMB_ADDUCTED, [0.0, 75.0, 8.0, 4.0]),
                Shape::Plate(v(0.0, 85.0, 40.0), Vec3::Y, 8.0),
                &[pads(4), vec![(Index, First, MIDDLE), (Middle, First, MIDDLE)]].concat(),
                Some(PALM_BELOW),
            ),
        ),
        (
            T::Ring,
            held(
                [THUMB_TO_INDEX, medium, idle, idle, idle],
                rod(98.0, 35.0, 15.0),
                &[
                    (Thumb, Third, MIDDLE),
                    (Index, First, 0.7),
                    (Index, Second, MIDDLE),
                    (Index, Third, MIDDLE),
                ],
                None,
            ),
        ),
        (
            T::Ventral,
            held(
                [THUMB_ON_SIDE, medium, medium, medium, medium],
                NEXT_TO_INDEX,
                &side_of_index,
                Some(PALM_BELOW),
            ),
        ),
        (
            T::InferiorPincer,
            held(
                [[40.0, 15.0, 10.0, -15.0], [0.0, 70.0, 5.0, 5.0], idle, idle, idle],
                Shape::Plate(v(28.0, 102.0, 70.0), Vec3::Y, 1.0),
                &pads(1),
                None,
            ),
        ),
    ]
}
