//! Templates of grasp types, and how far a grasp of the synthesis is from one.

use glam::Vec3;
use grasp_synthesis::model::hand::{Digit, HandPose, Phalanx};

use serde::Deserialize;

use super::{hold_figures::Figures, posing::Side};

/// The role of the palm.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum PalmRole {
    /// The object is pressed into it.
    Touches,
    /// It stays away, as in every precision grasp.
    Away,
    /// Either.
    Any,
}

/// How a grasp type looks on an object.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct GraspTemplate {
    /// The links that should touch, and with which side.
    pub(crate) touching: Vec<(Digit, Phalanx, Side)>,
    /// The digits that should not touch.
    pub(crate) idle: Vec<Digit>,
    /// The digits that bend around the object, and the least sum of their first two joint angles in degrees.
    #[serde(default)]
    pub(crate) bent: Vec<(Digit, f32)>,
    /// The palm.
    pub(crate) palm: PalmRole,
    /// Where the object should be held, in millimetres of its frame.
    pub(crate) held_at_mm: [f32; 3],
    /// Radius around that place within which any place is as good, in millimetres.
    pub(crate) near_mm: f32,
    /// The smallest and the largest share of the surface that the hand should cover.
    pub(crate) covered: (f32, f32),
}

/// How far a hand is from the template, in about millimetres: 0 is a textbook grasp, 10 is hard to recognise.
pub(crate) fn misfit(template: &GraspTemplate, figures: &Figures, pose: &HandPose) -> f32 {
    let mm = |metres: f32| metres * 1e3;
    let beyond = |value: f32, allowed: f32| (value - allowed).max(0.0);

    // Nothing overlaps.
    let mut cost = 1.5 * beyond(mm(figures.depth()), 1.0)
        + 1.0 * beyond(mm(figures.self_overlap), 1.5)
        + 1.0 * mm(figures.forearm_overlap);

    // The links of the type touch, with the right side.
    let mut centre = Vec3::ZERO;
    let (mut thumb, mut fingers) = (Vec3::ZERO, Vec3::ZERO);
    for &(digit, phalanx, side) in &template.touching {
        let link = figures.links[digit.index()][phalanx.index()];
        // A side other than the pad is what distinguishes its type.
        let sidedness = if side == Side::Pad { 4.0 } else { 8.0 };
        cost += beyond(mm(link.clearance), 0.5) + sidedness * (1.0 - link.side.dot(side.direction()));
        centre += link.closest / template.touching.len() as f32;
        if digit == Digit::Thumb {
            thumb += link.towards;
        } else {
            fingers += link.towards;
        }
    }
    // The thumb opposes the fingers.
    cost += 5.0 * (1.0 + thumb.normalize_or_zero().dot(fingers.normalize_or_zero()));

    // The others keep away.
    for digit in &template.idle {
        let nearest = figures.links[digit.index()]
            .iter()
            .map(|link| link.clearance)
            .fold(f32::INFINITY, f32::min);
        cost += 0.7 * beyond(2.0, mm(nearest));
    }
    cost += match template.palm {
        PalmRole::Touches => 0.6 * beyond(mm(figures.palm), 2.0),
        PalmRole::Away => 0.3 * beyond(15.0, mm(figures.palm)),
        PalmRole::Any => 0.0,
    };

    let bend = |digit: usize| {
        let angles = pose.digits[digit];
        angles.base_pitch + angles.second_pitch
    };
    for &(digit, degrees) in &template.bent {
        cost += 0.15 * beyond(degrees, bend(digit.index()).to_degrees());
    }

    // A thumb that is bent far backward looks broken.
    let thumb_back = (-pose.digits[0].second_pitch).to_degrees();
    cost += 0.15 * beyond(thumb_back, 15.0);

    // Neighbouring fingers bend alike: a bent finger next to a stretched one is hard to hold.
    for finger in 1..4 {
        cost += 1.0 * beyond((bend(finger) - bend(finger + 1)).abs(), 0.35);
    }

    cost + 0.15
        * beyond(
            (centre * 1e3).distance(Vec3::from(template.held_at_mm)),
            template.near_mm,
        )
}

/// How far a coverage is from the template, in the unit of [`misfit`].
pub(crate) fn coverage_misfit(template: &GraspTemplate, covered: f32) -> f32 {
    let (least, most) = template.covered;
    60.0 * ((least - covered).max(0.0) + (covered - most).max(0.0))
}
