//! Limits that keep one hand from holding an object: conditions of every valid grasp that this holdout cannot meet. They are not
//! sufficient: if no limit applies, a search may still fail for lack of time.

use std::fmt;

use glam::Vec3;

use super::{
    scene::Task,
    settings::{Query, SearchSettings},
};
use crate::{
    geometry::boxes::OrientedBox,
    known::entry::Entry,
    model::{
        grasp::GRAVITY,
        hand::{Digit, rig::Rig},
        holdout::{Holdout, Stance},
        object::GraspObject,
        requirements::{Check, Reach},
        strategy::Validity,
    },
    physical::{
        barriers::Barriers,
        contacts::TORSION_LEVER,
        grip::clear_of_barriers,
        immobility::{BALANCE_TOLERANCE, HAND_LENGTHS, MAX_CONTACT_FORCE, MAX_CONTACTS},
        presented::Presented,
        solids::{PreparedHand, link_radii},
    },
    propose::surface_pairs::{HoldableSurface, SurfacePair, SurfacePairs},
    rating::scoring::middle,
};

/// Largest total force of a hand's contacts, in newtons.
const HAND_FORCE: f32 = MAX_CONTACTS as f32 * MAX_CONTACT_FORCE;

/// Largest distance of points from the centre of the smallest ball around them, over the largest distance of two: √(3/8), by
/// Jung's theorem.
const JUNG: f32 = 0.612_373;

/// Friction up to which normals that are pairwise at most a right angle apart cannot hold.
const MAX_FRICTION_OF_WIDTH: f32 = 0.6;

/// Largest distance between opposed palm and fingers, over the widest opening of thumb and fingers: hands that hold in the palm
/// reach a little farther.
const PALM_OVER_PADS: f32 = 1.25;

/// Height above a touched point, over the finger's radius, that is surely inside the finger, even with the bone 45° off the normal.
/// As the finger clears the giver, that point is at least as far from the giver.
const INSIDE_FINGER: f32 = 0.3;

/// Share of blocked grips from which on obstacles count as the limit.
const MOST: f32 = 0.5;

/// Most known grips that are compared with obstacles, evenly among all: enough to tell most from few, in some tenths of a
/// millisecond.
const MAX_COMPARED: usize = 64;

/// Something that keeps one hand from holding an object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limit {
    /// The check that no hand passes.
    pub check: Check,
    /// The figure of this holdout, in the unit of the check.
    pub value: f32,
    /// The bound that valid grasps keep, in the same unit; `None` if there is none in advance.
    pub bound: Option<f32>,
}

impl Limit {
    fn new(check: Check, value: f32, bound: Option<f32>) -> Self {
        Self { check, value, bound }
    }

    fn if_exceeded(check: Check, value: f32, bound: f32) -> Option<Self> {
        (value > bound).then_some(Self::new(check, value, Some(bound)))
    }
}

/// The limits of a task, from the mass to the reach; empty unless the query demands `PHYSICAL` validity. Takes a fraction of a
/// millisecond, whatever the object, once the rig's oppositions are known.
pub fn limits(task: Task<'_>, query: &Query) -> Vec<Limit> {
    if query.validity != Validity::Physical {
        return Vec::new();
    }
    let Task { holdout, object, rig } = task;
    let holdable = &object.holdable;
    let friction = query.friction_on(&holdout.object);
    let span = rig.span();
    let region = holdable.region.as_ref();
    let reaches = query.requirements.reach.into_iter();
    let mut reaches = reaches.chain(arms_reach(holdout.stance));
    [
        mass_limit(&holdout.object),
        region.and_then(|region| torque_limit(holdout, region, friction, span)),
        width_limit(
            holdable,
            friction,
            (PALM_OVER_PADS * rig.oppositions().widest()).min(span),
        ),
        region.and_then(|_| giver_limit(&Presented::of(holdout), &object.surface_pairs, rig)),
        region.and_then(|region| reaches.find_map(|reach| reach_limit(reach, region, rig))),
    ]
    .into_iter()
    .flatten()
    .collect()
}

/// Obstacles, if they block most known grips or, without any, all opposed places; or else the weight's torque, if no known grip
/// resists it. Unlike the other limits, this one proves nothing, as known grips are not all grips.
pub fn known_limit(task: Task<'_>, settings: &SearchSettings) -> Option<Limit> {
    let Task { holdout, object, rig } = task;
    let presented = Presented::of(holdout);
    let obstacles = Barriers {
        obstacles: presented.barriers().obstacles,
        ..Barriers::NONE
    };
    let atlas = settings.known.atlas.as_deref();
    let entries = atlas.map_or(&[][..], |atlas| atlas.entries());
    let stride = entries.len().div_ceil(MAX_COMPARED).max(1);
    let compared = || entries.iter().step_by(stride);
    let (blocked, all) = if entries.is_empty() {
        let pairs = &object.surface_pairs.pairs;
        let is_blocked = |pair: &SurfacePair| !pair.is_free_of(obstacles);
        let all_blocked = !obstacles.is_empty() && pairs.iter().all(is_blocked);
        (usize::from(all_blocked && !pairs.is_empty()), 1)
    } else {
        let is_blocked = |entry: &&Entry| {
            !obstacles.is_empty() && clear_of_barriers(&entry.tracked_solids(rig), obstacles).is_none()
        };
        (compared().filter(is_blocked).count(), compared().count())
    };
    let share = blocked as f32 / all as f32;
    if share > MOST {
        return Some(Limit::new(Check::ObstacleClearance, share, None));
    }
    let holds_none = atlas.is_some_and(|atlas| atlas.holding_under(presented.up).is_empty());
    if !holds_none || entries.is_empty() {
        return None;
    }
    let arm = |entry: &Entry| {
        let offset = middle(entry.contacts.iter()) - holdout.object.centre_of_mass;
        offset
            .reject_from_normalized(presented.up.normalize_or(Vec3::Y))
            .length()
    };
    let least = entries.iter().map(arm).fold(f32::INFINITY, f32::min);
    let torque = holdout.object.mass * GRAVITY * least;
    Some(Limit::new(Check::Torque, torque, None))
}

fn mass_limit(object: &GraspObject) -> Option<Limit> {
    let bound = HAND_FORCE / (GRAVITY * (1.0 - BALANCE_TOLERANCE));
    Limit::if_exceeded(Check::Mass, object.mass, bound)
}

/// Torques balance about the middle of the contacts, which lies in the region.
fn torque_limit(holdout: &Holdout, region: &OrientedBox, friction: f32, span: f32) -> Option<Limit> {
    let weight = holdout.object.mass * GRAVITY;
    let arm = horizontal_distance(region, holdout.object.centre_of_mass, holdout.up);
    let lever = region.half_extents.length().min(JUNG * span);
    let unbalanced = BALANCE_TOLERANCE * weight * HAND_LENGTHS[1];
    let bound = HAND_FORCE * (lever + friction * TORSION_LEVER) + unbalanced;
    Limit::if_exceeded(Check::Torque, weight * arm, bound)
}

/// Contacts that hold have normals more than a right angle apart, and lie within an opening of each other.
fn width_limit(holdable: &HoldableSurface, friction: f32, opening: f32) -> Option<Limit> {
    let forbidden = Limit::new(Check::Forbidden, holdable.forbidden_share, None);
    if holdable.region.is_none() {
        return Some(forbidden);
    }
    let is_wide =
        |width: Option<f32>| width.filter(|&width| width > opening && friction <= MAX_FRICTION_OF_WIDTH);
    is_wide(holdable.width)?;
    Some(
        is_wide(holdable.width_of_all)
            .map_or(forbidden, |width| Limit::new(Check::Width, width, Some(opening))),
    )
}

/// The room of the thinnest finger between object and giver.
fn giver_limit(presented: &Presented, surface: &SurfacePairs, rig: &Rig) -> Option<Limit> {
    let giver: &PreparedHand = presented.hands.first()?;
    let digits = Digit::ALL.into_iter().filter(|&digit| rig.has(digit));
    let radii = digits.flat_map(|digit| link_radii(rig, digit));
    let needed = INSIDE_FINGER * radii.fold(f32::INFINITY, f32::min);
    let sides: &[f32] = if surface.pairs.iter().any(SurfacePair::is_of_sheet) {
        &[1.0, -1.0]
    } else {
        &[1.0]
    };
    let mut room = 0.0_f32;
    for point in &surface.points {
        for side in sides {
            let above: Vec3 = point.position + point.normal * (side * needed);
            room = room.max(giver.point_distance_upper_bound(above));
        }
        if room >= needed {
            return None;
        }
    }
    (!surface.points.is_empty()).then_some(Limit::new(Check::GiverClearance, room, Some(needed)))
}

/// The range of a given arm: no wrist is farther from the shoulder than the stretched bones.
fn arms_reach(stance: Stance) -> Option<Reach> {
    match stance {
        Stance::At(arm) => Some(Reach {
            shoulder: arm.shoulder,
            distance: arm.upper_arm + arm.forearm,
        }),
        Stance::Any | Stance::Facing => None,
    }
}

/// The wrist is within reach of the shoulder, and every contact within the hand's length of the wrist.
fn reach_limit(reach: Reach, region: &OrientedBox, rig: &Rig) -> Option<Limit> {
    let length = rig
        .digits
        .iter()
        .map(|digit| digit.wrist_from_base.position.length() + digit.lengths.iter().sum::<f32>());
    let value = region.distance(reach.shoulder);
    let bound = reach.distance + length.fold(rig.reach, f32::max);
    Limit::if_exceeded(Check::Reach, value, bound)
}

/// The distance of a box from the vertical line through a point, in metres; 0 if they meet.
fn horizontal_distance(region: &OrientedBox, point: Vec3, up: Vec3) -> f32 {
    let (object_from_box, half_extents) = (region.object_from_box, region.half_extents);
    let offset = object_from_box.position - point;
    let half_edges = Vec3::AXES.map(|axis| object_from_box.transform_vector(axis) * half_extents.dot(axis));
    let gap = |direction: Vec3| {
        let direction = direction.normalize_or_zero();
        let extent: f32 = half_edges.iter().map(|edge| edge.dot(direction).abs()).sum();
        offset.dot(direction).abs() - extent
    };
    let of_edges = half_edges.into_iter().map(|edge| gap(up.cross(edge)));
    let of_corners = (0..8).map(|corner| {
        let to_corner = (0..3).fold(offset, |sum, axis| {
            sum + half_edges[axis] * if corner >> axis & 1 == 0 { 1.0 } else { -1.0 }
        });
        gap(to_corner - up * to_corner.dot(up))
    });
    of_edges.chain(of_corners).fold(0.0, f32::max)
}

impl fmt::Display for Limit {
    /// A phrase that completes "limited by".
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let value = self.value;
        let bound = self.bound.unwrap_or_default();
        match self.check {
            Check::Mass => write!(f, "mass: {value:.1} kg, one hand carries up to {bound:.1} kg"),
            Check::Torque if self.bound.is_none() => write!(
                f,
                "torque: {value:.1} N·m about the nearest known grip, and none of them resists the weight as it pulls"
            ),
            Check::Torque => write!(
                f,
                "torque: {value:.1} N·m about the nearest place that may be held, one hand resists up to {bound:.1} N·m"
            ),
            Check::Width => write!(
                f,
                "width: {value:.2} m between the closest opposed places, a hand closes around up to {bound:.2} m"
            ),
            Check::Forbidden => write!(
                f,
                "forbidden surfaces: {:.0} % of the surface, and the rest offers one hand no opposed places",
                100.0 * value
            ),
            Check::GiverClearance => write!(
                f,
                "the giver: {:.1} mm are free at the freest place, a finger needs {:.1} mm",
                1e3 * value,
                1e3 * bound
            ),
            Check::Reach => write!(
                f,
                "reach: {value:.2} m from the shoulder to the nearest place that may be held, arm and hand reach {bound:.2} m"
            ),
            Check::ObstacleClearance => write!(
                f,
                "obstacles: they are in the way of {:.0} % of the grips that would hold it; slide it over an edge or lift a rim \
                 first",
                100.0 * value
            ),
            other => write!(f, "{other:?}: {value:.2}"),
        }
    }
}
