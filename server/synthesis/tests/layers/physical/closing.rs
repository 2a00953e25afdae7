//! The closing of digits, against a plane's closed form and against very small steps.

use crate::prelude::*;
use grasp_synthesis::model::hand::kinematics::DigitPlane;
use grasp_synthesis::model::hand::rig::{AngleRange, DigitLimits, PALM_PART};
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
        yaw_sign: 1.0,
        lengths: [0.045, 0.025, 0.020],
        diameters: [0.020, 0.017, 0.014],
        limits: DigitLimits {
            base_yaw: AngleRange::from_degrees(-10.0, 10.0),
            base_pitch: AngleRange::from_degrees(0.0, 90.0),
            second_pitch: AngleRange::from_degrees(0.0, 100.0),
            third_pitch: AngleRange::from_degrees(0.0, 80.0),
        },
    }
}

/// The surface of a box between two corners.
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
fn the_tip_meets_a_plane_where_the_closed_form_does() {
    let digit = finger();
    for height in [0.02, 0.035, 0.05] {
        // So large that only its lower face can be met.
        let plate = cuboid(Vec3::new(-0.5, -0.5, height), Vec3::new(0.5, 0.5, height + 0.05));
        for ratio in [0.7, 1.0, 1.42] {
            let closed = closing(&plate, &digit, ratio)
                .close()
                .expect("the finger starts free");
            assert!(closed.touches[2], "{closed:?}");
            // Depth of the deepest ball past the plane at an angle of the sweep.
            let depth = |way: f32| {
                let links = links_at(&digit, Pose::IDENTITY, closed_by(&digit, ratio, way));
                let balls = links
                    .iter()
                    .flat_map(|link| [(link.start, link.start_radius), (link.end, link.end_radius)]);
                let depths = balls.map(|(centre, radius)| centre.z + radius - height);
                depths.fold(f32::NEG_INFINITY, f32::max)
            };
            let mut way = 0.0;
            while depth(way) < TOUCH_DEPTH {
                way += 1e-4;
            }
            // A fifth of a millimetre is 0.2° at the finger's length.
            let found = closed.angles.base_pitch;
            assert!((found - way).abs() < 0.005, "{found} at {way}");
        }
    }
}

#[test]
fn joints_beyond_a_touching_link_keep_closing() {
    let digit = finger();
    // A bar across the first link: the others wrap around it.
    let bar = cuboid(Vec3::new(-0.1, 0.015, 0.014), Vec3::new(0.1, 0.030, 0.029));
    let closed = closing(&bar, &digit, 1.0)
        .close()
        .expect("the finger starts free");
    assert!(closed.touches[0]);
    let angles = closed.angles;
    assert!(angles.base_pitch < 0.3, "the first joint is held: {angles:?}");
    assert!(
        closed.touches[1] || closed.touches[2] || angles.second_pitch > 1.7,
        "the others close until they touch or reach their limits: {angles:?}"
    );
    assert!(angles.second_pitch > angles.base_pitch + 0.3, "{angles:?}");
}

#[test]
fn a_digit_that_starts_inside_does_not_close() {
    let digit = finger();
    let around_the_tip = cuboid(Vec3::new(-0.02, 0.07, -0.02), Vec3::new(0.02, 0.12, 0.02));
    assert!(closing(&around_the_tip, &digit, 1.0).close().is_none());
    // Nor where a sheet thinner than the finger cuts through it.
    let sheet = cuboid(Vec3::new(-0.05, 0.05, -0.05), Vec3::new(0.05, 0.0505, 0.05));
    assert!(closing(&sheet, &digit, 1.0).close().is_none());
}

#[test]
fn a_relaxed_digit_bends_as_far_as_requested_and_stays_clear() {
    let digit = finger();
    let far = cuboid(Vec3::splat(0.5), Vec3::splat(0.6));
    let free = closing(&far, &digit, 1.0).relax(1.15);
    assert!((free.flexion() - 1.15).abs() < 1e-3, "{}", free.flexion());
    let plate = cuboid(Vec3::new(-0.5, -0.5, 0.02), Vec3::new(0.5, 0.5, 0.07));
    let blocked = closing(&plate, &digit, 1.0).relax(1.15);
    assert!(blocked.flexion() < 1.0);
    let nearest = blocked
        .links
        .iter()
        .map(|link| clearance(link, &plate, 1.0))
        .fold(1.0, f32::min);
    assert!((0.0005..0.0015).contains(&nearest), "{nearest} m of room");
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

#[test]
fn a_preshaped_digit_avoids_what_an_open_one_would_meet() {
    let digit = finger();
    let around_the_tip = cuboid(Vec3::new(-0.02, 0.08, -0.02), Vec3::new(0.02, 0.12, 0.02));
    let opened = closing(&around_the_tip, &digit, 1.0);
    assert!(opened.close().is_none());
    let preshaped = Closing {
        preshape: 0.4,
        ..opened
    };
    let closed = preshaped.close().expect("the tip is clear of it");
    assert!(closed.flexion() >= opened.flexing.closed_by(0.4).base_pitch);
    let relaxed = opened.relax(0.3).links;
    assert!(
        relaxed
            .iter()
            .all(|link| clearance(link, &around_the_tip, 1.0) > 0.0)
    );
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

/// Touches the bar from below, or from the side by an angle.
fn touch(finger: Digit, x: f32, angle: f32) -> Contact {
    let normal = Quat::from_rotation_x(angle) * Vec3::NEG_Y;
    contact(
        Vec3::X * x + normal * BAR,
        normal,
        HandPart::Phalanx(finger, Phalanx::Second),
    )
}

/// Index and middle finger below the bar, with tips at these offsets from where it rests.
fn hook(tips: [[f32; 2]; 2], up: Vec3) -> Option<Hang> {
    let mut digits = [ClosedDigit::default(); 5];
    let places = [0.01, -0.01];
    for (place, (x, [run, rise])) in places.into_iter().zip(tips).enumerate() {
        digits[place + 1] = hooked_finger(x, run, rise);
    }
    let contacts = [
        touch(Digit::Index, places[0], 0.0),
        touch(Digit::Middle, places[1], 0.0),
    ];
    Hang::of(&contacts, &digits, CENTRE_OF_MASS, up)
}

/// The height of a tip's skin above where the bar rests, in a frame turned so that gravity leans toward the tip by the angle
/// of the sideways push.
fn lip_in_tilted_frame([run, rise]: [f32; 2]) -> f32 {
    let level = Quat::from_rotation_x(SIDEWAYS_SHARE.atan());
    let to_tip = level * Vec3::new(0.0, rise - RADIUS, run);
    // The skin is a radius from the tip's centre, of which the closed form counts the part along the untilted vertical.
    to_tip.y + RADIUS * SIDEWAYS_SHARE.atan().cos()
}

#[test]
fn the_lip_is_the_height_of_the_tip_under_tilted_gravity() {
    for tip in [[0.0, 0.02], [0.01, 0.015], [0.02, 0.02], [0.015, 0.03]] {
        let hang = hook([tip, [0.0, 0.05]], Vec3::Y).expect("it hangs");
        let expected = lip_in_tilted_frame(tip);
        assert!(
            (hang.lip - expected).abs() < 1e-6,
            "{tip:?}: {} {expected}",
            hang.lip
        );
    }
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
    let contacts = [touch(Digit::Index, 0.0, 0.0)];
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

#[test]
fn a_load_at_rest_is_below_the_middle_of_the_bar() {
    let up = Quat::from_rotation_x(0.3) * Vec3::Y;
    let mut digits = [ClosedDigit::default(); 5];
    let mut contacts = Vec::new();
    // Touching the bar at different sides, the fingers push through its axis.
    for (finger_index, x, angle) in [(1, 0.03, 0.2), (2, 0.01, -0.1), (3, -0.01, 0.4), (4, -0.03, 0.0)] {
        digits[finger_index] = hooked_finger(x, 0.01, 0.05);
        contacts.push(touch(Digit::ALL[finger_index], x, angle));
    }
    let hang = Hang::of(&contacts, &digits, CENTRE_OF_MASS, up).expect("it hangs");
    assert!(hang.pivot.length() < 0.001, "{}", hang.pivot);
    let load = hang.load_at_rest(Load {
        mass: 1.0,
        centre_of_mass: CENTRE_OF_MASS,
        up,
        torque_scale: TorqueScale::of(&[]),
    });
    let expected = hang.pivot - up * DEPTH;
    assert!(load.centre_of_mass.distance(expected) < 0.001, "{load:?}");
}
