//! Hooks: when a load hangs in bent fingers, against closed forms and gravity that is tilted step by step.

use grasp_synthesis::physical::{
    closing::ClosedDigit,
    hanging::{Hang, MAX_SWING, MIN_LIP, SIDEWAYS_SHARE},
};

use crate::prelude::*;

const RADIUS: f32 = 0.008;

/// The load is a bar of this radius along x, at the origin, with something heavy below it.
const BAR: f32 = 0.01;

/// Depth of the load's centre of mass below the bar.
const DEPTH: f32 = 0.2;

const CENTRE_OF_MASS: Vec3 = Vec3::new(0.0, -DEPTH, 0.0);

/// A finger that comes down behind the bar at `x`, runs below it, and goes from the point below the bar over a `run` forward
/// and a `rise` up to its tip.
fn finger(x: f32, run: f32, rise: f32) -> ClosedDigit {
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
        digits[place + 1] = finger(x, run, rise);
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
    digits[1] = finger(0.0, tips[0][0], tips[0][1]);
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
        digits[finger_index] = finger(x, 0.01, 0.05);
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
