//! The closing of digits against very small steps, and hands that hang.

use crate::prelude::*;
use grasp_synthesis::model::hand::kinematics::DigitPlane;
use grasp_synthesis::model::hand::rig::PALM_PART;
use grasp_synthesis::physical::closer::Obstacle;
use grasp_synthesis::physical::closing::{ClosedDigit, Closing, TOUCH_DEPTH};
use grasp_synthesis::physical::hanging::{Hang, MAX_SWING, MIN_LIP, SIDEWAYS_SHARE};
use grasp_synthesis::physical::shape::Flexing;
use grasp_synthesis::physical::solids::link_solids;

const RADII: [f32; 4] = [0.010, 0.009, 0.008, 0.006];

/// How far a touch may be from [`TOUCH_DEPTH`], in metres.
const TOLERANCE: f32 = 0.0003;

/// A finger of 9 cm along +y whose pad faces +z.
fn finger() -> DigitRig {
    DigitRig {
        wrist_from_base: Pose::IDENTITY,
        lengths: [0.045, 0.025, 0.020],
        ..simple_rig().digits[1]
    }
}

fn cuboid(low: Vec3, high: Vec3) -> MeshBvh {
    box_at(low.midpoint(high), 0.5 * (high - low), 1)
}

fn closing<'a>(surface: &'a MeshBvh, digit: &'a DigitRig, bend_ratio: f32) -> Closing<'a> {
    Closing {
        surface,
        flexing: Flexing {
            digit,
            base_yaw: 0.0,
            bend_ratio,
        },
        radii: RADII,
        plane: DigitPlane::new(digit, Pose::IDENTITY, 0.0),
        preshape: 0.0,
        obstacles: &[],
        rest_overlaps: None,
        curls_last: false,
    }
}

/// The angles of a digit that closes freely, by how far its first joint is bent.
fn closed_by(digit: &DigitRig, ratio: f32, way: f32) -> DigitAngles {
    let third = ratio * way * DigitAngles::THIRD_PITCH_SHARE;
    angles([
        0.0,
        way,
        (ratio * way).min(digit.limits.second_pitch.max),
        third.min(digit.limits.third_pitch.max),
    ])
}

fn links_at(digit: &DigitRig, wrist: Pose, angles: DigitAngles) -> [TaperedCapsule; 3] {
    let frames = digit_frames(digit, wrist, angles);
    let [a, b, c] = frames.links.map(|link| link.position);
    link_solids([a, b, c, frames.tip], RADII)
}

#[test]
fn a_digit_that_starts_inside_does_not_close() {
    let digit = finger();
    let around_the_tip = cuboid(Vec3::new(-0.02, 0.07, -0.02), Vec3::new(0.02, 0.12, 0.02));
    assert!(closing(&around_the_tip, &digit, 1.0).close().is_none());
    // The same where a sheet thinner than the finger cuts through it.
    let sheet = cuboid(Vec3::new(-0.05, 0.05, -0.05), Vec3::new(0.05, 0.0505, 0.05));
    assert!(closing(&sheet, &digit, 1.0).close().is_none());
}

#[test]
fn closing_passes_through_nothing() {
    let digit = finger();
    let mut random = Random::new(20);
    let mut closed_count = 0;
    for _ in 0..200 {
        let half = Vec3::new(
            random.between(0.002, 0.02),
            random.between(0.002, 0.02),
            random.between(0.0005, 0.02),
        );
        let box_mesh = cuboid(-half, half);
        let wrist = Pose {
            position: random.direction() * random.between(0.03, 0.08),
            orientation: random.rotation(),
        };
        let ratio = [0.7, 1.0, 1.42][random.index(3)];
        let closing = Closing {
            plane: DigitPlane::new(&digit, wrist, 0.0),
            ..closing(&box_mesh, &digit, ratio)
        };
        let Some(closed) = closing.close() else { continue };
        closed_count += 1;
        let deepest = |links: &[_]| {
            let clearances = links.iter().map(|link| clearance(link, &box_mesh, 1.0));
            clearances.fold(1.0, f32::min)
        };
        assert!(deepest(&closed.links) > -(TOUCH_DEPTH + TOLERANCE), "{closed:?}");
        // Until the first joint stops, all three move together: there must be room at every step.
        let steps = (closed.angles.base_pitch / 0.01) as usize;
        for step in 0..steps {
            let way = step as f32 * 0.01;
            let links = links_at(&digit, wrist, closed_by(&digit, ratio, way));
            let depth = -deepest(&links);
            assert!(depth < TOUCH_DEPTH + TOLERANCE, "passed at {way}: {closed:?}");
        }
        for (touches, link) in closed.touches.iter().zip(&closed.links) {
            let gap = clearance(link, &box_mesh, 1.0);
            assert!(!touches || gap < TOLERANCE, "a touch {gap} m away");
        }
    }
    assert!(closed_count > 100, "{closed_count} closed");
}

#[test]
fn a_digit_stops_at_other_parts_of_the_hand() {
    let digit = finger();
    let far = cuboid(Vec3::splat(0.5), Vec3::splat(0.6));
    let free = closing(&far, &digit, 1.0).close().expect("nothing is near");
    let mut random = Random::new(31);
    let mut stopped = 0;
    for _ in 0..200 {
        let middle = Vec3::new(
            random.between(-0.02, 0.02),
            random.between(0.0, 0.09),
            random.between(0.02, 0.09),
        );
        let half = random.direction() * random.between(0.005, 0.03);
        let part = TaperedCapsule::new(middle - half, middle + half, 0.009, 0.007);
        let first_link = random.index(2);
        let obstacles = [Obstacle::new(part, [0, PALM_PART][first_link])];
        let closing = Closing {
            obstacles: &obstacles,
            ..closing(&far, &digit, 1.0)
        };
        let Some(closed) = closing.close() else { continue };
        assert_eq!(closed.touches, [false; 3], "the object is far away");
        let nearest = closed.links[first_link..]
            .iter()
            .map(|link| link.distance(&part))
            .fold(f32::INFINITY, f32::min);
        assert!(nearest >= -SOFT_CONTACT, "{nearest} m from {part:?}");
        // A digit that stops short must be touching its obstacle.
        if closed.flexion() < free.flexion() - 0.01 {
            stopped += 1;
            assert!(nearest < 0.0005, "{nearest} m from {part:?}");
        }
    }
    assert!(stopped > 50, "{stopped}");
}

#[test]
fn a_hooking_finger_supports_a_bar_before_its_tip_curls_around_it() {
    let digit = finger();
    let bar = cuboid(Vec3::new(-0.05, 0.020, 0.022), Vec3::new(0.05, 0.0335, 0.036));
    let hooking = closing(&bar, &digit, 4.0);
    let hooking = Closing {
        preshape: hooking.flexing.closure_at(0.3),
        curls_last: true,
        ..hooking
    };
    let closed = hooking.close().expect("it starts clear of the bar");
    assert!(closed.touches[1], "{closed:?}");
    // Then the last link bends by itself, until it touches or is at its limit.
    let is_at_limit = closed.angles.third_pitch > digit.limits.third_pitch.max - 1e-4;
    assert!(closed.touches[2] || is_at_limit, "{closed:?}");
    assert!(closed.angles.third_pitch > 0.3, "{closed:?}");
}

const RADIUS: f32 = 0.008;

/// The load is a bar of this radius along x, at the origin, with something heavy below it.
const BAR: f32 = 0.01;

/// Depth of the load's centre of mass below the bar.
const DEPTH: f32 = 0.2;

const CENTRE_OF_MASS: Vec3 = Vec3::new(0.0, -DEPTH, 0.0);

/// A finger that comes down behind the bar at `x`, runs below it, and goes from the point below the bar over a `run` forward
/// and a `rise` up to its tip.
fn hooked_finger(x: f32, run: f32, rise: f32) -> ClosedDigit {
    let level = -BAR - RADIUS;
    let points = [
        Vec3::new(x, 0.03, -0.02),
        Vec3::new(x, level, -0.02),
        Vec3::new(x, level, 0.0),
        Vec3::new(x, level + rise, run),
    ];
    ClosedDigit {
        links: std::array::from_fn(|link| {
            TaperedCapsule::new(points[link], points[link + 1], RADIUS, RADIUS)
        }),
        touches: [false, true, false],
        ..ClosedDigit::default()
    }
}

fn touch(finger: Digit, x: f32) -> Contact {
    let part = HandPart::Phalanx(finger, Phalanx::Second);
    contact(Vec3::new(x, -BAR, 0.0), Vec3::NEG_Y, part)
}

/// Index and middle finger below the bar, with tips at these offsets from where it rests.
fn hook(tips: [[f32; 2]; 2], up: Vec3) -> Option<Hang> {
    let mut digits = [ClosedDigit::default(); 5];
    let places = [0.01, -0.01];
    for (place, (x, [run, rise])) in places.into_iter().zip(tips).enumerate() {
        digits[place + 1] = hooked_finger(x, run, rise);
    }
    let contacts = [touch(Digit::Index, places[0]), touch(Digit::Middle, places[1])];
    Hang::of(&contacts, &digits, CENTRE_OF_MASS, up)
}

#[test]
fn fingers_hold_only_while_the_way_out_leads_uphill() {
    let run = 0.02;
    // rise - s run = MIN_LIP √(1 + s²), since the tip's skin is where its centre is above the other links' centres.
    let least = MIN_LIP * SIDEWAYS_SHARE.hypot(1.0) + SIDEWAYS_SHARE * run;
    let hangs = |rise: f32| hook([[run, rise], [run, 0.05]], Vec3::Y).is_some();
    assert!(hangs(least + 1e-5) && !hangs(least - 1e-5));
    // Straight fingers carry a bar that rolls off at a touch.
    assert!(hook([[run, 0.0]; 2], Vec3::Y).is_none());
}

#[test]
fn a_bar_in_one_finger_does_not_hang() {
    let tips = [[0.01, 0.03]; 2];
    let mut digits = [ClosedDigit::default(); 5];
    digits[1] = hooked_finger(0.0, tips[0][0], tips[0][1]);
    let contacts = [touch(Digit::Index, 0.0)];
    assert!(hook(tips, Vec3::Y).is_some());
    assert!(Hang::of(&contacts, &digits, CENTRE_OF_MASS, Vec3::Y).is_none());
}

#[test]
fn a_load_hangs_only_below_the_fingers() {
    let tips = [[0.01, 0.05]; 2];
    for axis in [Vec3::X, Vec3::Z] {
        let under = |angle: f32| hook(tips, Quat::from_axis_angle(axis, angle) * Vec3::Y);
        assert!(under(0.35).is_some() && under(-0.35).is_some(), "{axis}");
        assert!(under(MAX_SWING + 0.01).is_none() && under(-MAX_SWING - 0.01).is_none());
        assert!(under(std::f32::consts::PI).is_none());
    }
}
