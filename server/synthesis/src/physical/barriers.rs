//! Barriers that a hand keeps clear of in addition to the object: other people's hands, and obstacles.

use std::{fmt, sync::Arc};

use glam::Vec3;

use super::{
    grip::GIVER_CLEARANCE,
    presented::Presented,
    solids::{
        Bounded, PreparedHand, SPHERES, SolidPart, Spheres, TaperedCapsule, TrackedSolids, clearance, closest,
    },
};
use crate::{
    geometry::boxes::SolidBox,
    model::holdout::{HandMesh, HandShape, Holdout, Obstacle},
};

/// How much closer than to another hand a hand may come to an obstacle, in metres: 0.1 mm remain, against rounding.
pub(super) const CLOSER_TO_OBSTACLES: f32 = 0.0009;

/// Clearance between the hand and forearm and obstacles, in metres.
pub const OBSTACLE_CLEARANCE: f32 = GIVER_CLEARANCE - CLOSER_TO_OBSTACLES;

/// Approximate cost of a comparison with a mesh, in comparisons of prepared hands.
const MESH_COMPARISONS: usize = 16;

/// A prepared obstacle. `CLOSER_TO_OBSTACLES` is added to its distances, so that one threshold serves hands and obstacles.
#[derive(Clone, Copy, Debug)]
pub enum PreparedObstacle {
    /// A capsule.
    Capsule(Bounded),
    /// A box.
    Box(SolidBox),
}

/// Hands and obstacles to keep clear of, all in the object's frame.
#[derive(Clone, Copy, Debug)]
pub struct Barriers<'a> {
    /// The hands, the giver's first.
    pub hands: &'a [PreparedHand],
    /// The hands given as meshes. Their prepared solids lie certainly inside; distances are from the mesh.
    pub meshes: &'a [Arc<HandMesh>],
    /// The obstacles.
    pub obstacles: &'a [PreparedObstacle],
}

/// Distances of a hand from its barriers, in metres.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BarrierClearances {
    /// From the nearest of the other hands; `None` without any.
    pub hands: Option<f32>,
    /// From the nearest obstacle; `None` without any.
    pub obstacles: Option<f32>,
}

impl PreparedObstacle {
    /// Prepares an obstacle.
    pub fn new(obstacle: &Obstacle) -> Self {
        match obstacle {
            Obstacle::Capsule(capsule) => Self::Capsule(Bounded::new(*capsule)),
            Obstacle::Box(solid) => Self::Box(SolidBox::new(solid)),
        }
    }

    /// Distance of a point from the surface in metres, negative inside.
    pub(crate) fn point_distance(&self, point: Vec3) -> f32 {
        match self {
            Self::Capsule(capsule) => capsule.solid.signed_distance(point) + CLOSER_TO_OBSTACLES,
            Self::Box(solid) => solid.signed_distance(point) + CLOSER_TO_OBSTACLES,
        }
    }

    /// The direction in which the distance from a point grows fastest: a unit vector, or 0 on the axis of a capsule.
    pub(super) fn outward(&self, point: Vec3) -> Vec3 {
        match self {
            Self::Capsule(capsule) => capsule.solid.outward(point),
            Self::Box(solid) => solid.outward(point),
        }
    }

    /// Distance from a solid in metres, negative where they overlap.
    pub fn distance(&self, solid: &TaperedCapsule) -> f32 {
        match self {
            Self::Capsule(capsule) => capsule.solid.distance(solid) + CLOSER_TO_OBSTACLES,
            Self::Box(obstacle) => obstacle.distance(solid) + CLOSER_TO_OBSTACLES,
        }
    }

    /// True if a solid is certainly farther away than `distance` metres.
    fn is_beyond(&self, solid: &Bounded, distance: f32) -> bool {
        match self {
            Self::Capsule(capsule) => solid.is_beyond(capsule, distance),
            Self::Box(obstacle) => obstacle.signed_distance(solid.centre) - solid.radius > distance,
        }
    }
}

impl<'a> Barriers<'a> {
    /// No barriers.
    pub const NONE: Barriers<'static> = Barriers {
        hands: &[],
        meshes: &[],
        obstacles: &[],
    };

    /// A giver's hand alone.
    pub const fn of_giver(giver: &'a PreparedHand) -> Self {
        Self {
            hands: std::slice::from_ref(giver),
            ..Barriers::NONE
        }
    }

    /// True without barriers.
    pub fn is_empty(&self) -> bool {
        self.hands.is_empty() && self.obstacles.is_empty()
    }

    /// The number of comparisons between two polls of the stop signal, given their number with a single hand.
    pub(crate) fn comparisons_per_check(&self, with_giver: usize) -> usize {
        let meshes = MESH_COMPARISONS * self.meshes.len();
        (with_giver / (self.hands.len().max(1) + self.obstacles.len() + meshes)).max(1)
    }

    /// True only if a point is closer to a hand than `from_hands` metres, or to an obstacle than `from_obstacles`; near
    /// those distances it may be false regardless.
    #[inline]
    pub(crate) fn certainly_cover(&self, point: Vec3, from_hands: f32, from_obstacles: f32) -> bool {
        self.hands
            .iter()
            .any(|hand| hand.certainly_within(point, 0.0, from_hands))
            || self
                .obstacles
                .iter()
                .any(|obstacle| obstacle.point_distance(point) < from_obstacles)
    }

    /// As [`PreparedHand::any_certainly_within`].
    #[inline]
    pub fn any_certainly_within(&self, spheres: &Spheres, distance: f32) -> bool {
        self.hands
            .iter()
            .any(|hand| hand.any_certainly_within(spheres, distance))
            || self.obstacles.iter().any(|obstacle| {
                spheres
                    .iter()
                    .any(|(centre, radius)| obstacle.point_distance(centre) < radius + distance)
            })
    }

    /// The common translation, in metres, that takes some spheres `distance` away from every obstacle that they are too
    /// close to: out of one after the other, each time by the deepest sphere.
    pub(crate) fn way_out_of_obstacles(&self, spheres: &[Spheres], distance: f32) -> Vec3 {
        self.obstacles.iter().fold(Vec3::ZERO, |way, obstacle| {
            let depth = |(centre, radius): (Vec3, f32)| {
                let centre = centre + way;
                (radius + distance - obstacle.point_distance(centre), centre)
            };
            let deepest = spheres
                .iter()
                .flat_map(Spheres::iter)
                .map(depth)
                .max_by(|(a, _), (b, _)| a.total_cmp(b));
            match deepest {
                Some((depth, centre)) if depth > 0.0 => way + obstacle.outward(centre) * depth,
                _ => way,
            }
        })
    }

    /// As [`PreparedHand::distance_upper_bounds`].
    #[inline]
    pub fn distance_upper_bounds(&self, spheres: &Spheres) -> [f32; SPHERES] {
        let mut least = [f32::INFINITY; SPHERES];
        for hand in self.hands {
            for (least, distance) in least.iter_mut().zip(hand.distance_upper_bounds(spheres)) {
                *least = least.min(distance);
            }
        }
        for obstacle in self.obstacles {
            for (least, (centre, radius)) in least.iter_mut().zip(spheres.iter()) {
                *least = least.min(obstacle.point_distance(centre) - radius);
            }
        }
        least
    }

    /// As [`PreparedHand::point_distance_upper_bound`], for the nearest hand; `None` without hands.
    #[inline]
    pub(crate) fn hand_distance_upper_bound(&self, point: Vec3) -> Option<f32> {
        self.hands
            .iter()
            .map(|hand| hand.point_distance_upper_bound(point))
            .reduce(f32::min)
    }

    /// As [`PreparedHand::comes_within`].
    pub fn comes_within<'b>(
        &self,
        solids: impl Iterator<Item = &'b TaperedCapsule> + Clone,
        distance: f32,
    ) -> bool {
        self.hands
            .iter()
            .any(|hand| hand.comes_within(solids.clone(), distance))
            || self
                .least_from_obstacles(solids.clone(), distance, distance)
                .is_none()
            || self.least_from_meshes(solids, distance, distance).is_none()
    }

    /// As [`PreparedHand::least_distance`].
    pub fn least_distance<'b>(
        &self,
        solids: impl Iterator<Item = &'b TaperedCapsule> + Clone,
        enough: f32,
        required: f32,
    ) -> Option<f32> {
        let least = self.hands.iter().try_fold(enough, |least, hand| {
            hand.least_distance(solids.clone(), least, required)
        })?;
        let least = self.least_from_obstacles(solids.clone(), least, required)?;
        self.least_from_meshes(solids, least, required)
    }

    /// As [`PreparedHand::least_distance`], for the meshes alone.
    fn least_from_meshes<'b>(
        &self,
        solids: impl Iterator<Item = &'b TaperedCapsule>,
        enough: f32,
        required: f32,
    ) -> Option<f32> {
        let mut least = enough;
        if self.meshes.is_empty() {
            return Some(least);
        }
        for solid in solids {
            for mesh in self.meshes {
                least = least.min(clearance(solid, &mesh.surface, least));
                if least < required {
                    return None;
                }
            }
        }
        Some(least)
    }

    /// As [`PreparedHand::least_distance`], for the obstacles alone.
    fn least_from_obstacles<'b>(
        &self,
        solids: impl Iterator<Item = &'b TaperedCapsule>,
        enough: f32,
        required: f32,
    ) -> Option<f32> {
        let mut least = enough;
        if self.obstacles.is_empty() {
            return Some(least);
        }
        for solid in solids {
            let our = Bounded::new(*solid);
            for obstacle in self.obstacles {
                if !obstacle.is_beyond(&our, least) {
                    least = least.min(obstacle.distance(solid));
                    if least < required {
                        return None;
                    }
                }
            }
        }
        Some(least)
    }

    /// The distances of a hand, if those from hands are at least `required` metres and those from obstacles at least
    /// `CLOSER_TO_OBSTACLES` less.
    pub fn clearances(&self, hand: &TrackedSolids, required: f32) -> Option<BarrierClearances> {
        let mut clearances = BarrierClearances::default();
        for other in self.hands {
            let clearance = other.clearance(hand, required)?;
            clearances.hands = Some(clearances.hands.map_or(clearance, |least| least.min(clearance)));
        }
        if !self.meshes.is_empty() {
            let enough = clearances.hands.unwrap_or(f32::INFINITY);
            clearances.hands = Some(self.least_from_meshes(hand.iter(), enough, required)?);
        }
        if !self.obstacles.is_empty() {
            let least = self.least_from_obstacles(hand.iter(), f32::INFINITY, required)?;
            clearances.obstacles = Some(least - CLOSER_TO_OBSTACLES);
        }
        Some(clearances)
    }
}

/// A barrier by its place in the holdout; displayed as the field of a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Barrier {
    /// The giver's hand.
    PresentingHand,
    /// One of the further hands.
    OtherHand(usize),
    /// One of the obstacles.
    Obstacle(usize),
}

impl fmt::Display for Barrier {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::PresentingHand => f.write_str("holdout.presenting_hand"),
            Self::OtherHand(place) => write!(f, "holdout.other_hands[{place}]"),
            Self::Obstacle(place) => write!(f, "holdout.obstacles[{place}]"),
        }
    }
}

/// The smallest distance of a hand from some barriers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Nearest {
    /// In metres, negative inside.
    pub distance: f32,
    /// The part of the hand that is nearest.
    pub part: SolidPart,
    /// A point there, in the object's frame: of the hand's skin, or of the mesh if the barrier is one.
    pub at: Vec3,
    /// The nearest barrier.
    pub barrier: Barrier,
}

/// The nearest of the holdout's hands; `None` without any. `presented` must be the holdout's.
pub(crate) fn nearest_hand(
    hand: &TrackedSolids,
    holdout: &Holdout,
    presented: &Presented,
) -> Option<Nearest> {
    let presenting = holdout.presenting_hand.as_ref();
    let presenting = presenting.map(|giver| (Barrier::PresentingHand, &giver.shape));
    let others = holdout.other_hands.iter().enumerate();
    let others = others.map(|(place, shape)| (Barrier::OtherHand(place), shape));
    let shapes = presenting.into_iter().chain(others);
    let mut nearest: Option<Nearest> = None;
    for ((barrier, shape), prepared) in shapes.zip(&presented.hands) {
        for (part, solid) in hand.parts() {
            let least = nearest.map_or(f32::INFINITY, |nearest| nearest.distance);
            let found = match shape {
                HandShape::Mesh(mesh) => {
                    closest(solid, &mesh.surface, least).map(|touch| (touch.gap, touch.position))
                }
                HandShape::Joints(_) => prepared
                    .least_distance(std::iter::once(solid), least, f32::NEG_INFINITY)
                    .filter(|&distance| distance < least)
                    .map(|distance| (distance, skin_toward_hand(solid, prepared.iter()))),
            };
            if let Some((distance, at)) = found.filter(|&(distance, _)| distance < least) {
                nearest = Some(Nearest {
                    distance,
                    part,
                    at,
                    barrier,
                });
            }
        }
    }
    nearest
}

/// The nearest obstacle; `None` without any.
pub(crate) fn nearest_obstacle(hand: &TrackedSolids, presented: &Presented) -> Option<Nearest> {
    let mut nearest: Option<Nearest> = None;
    for (place, obstacle) in presented.obstacles.iter().enumerate() {
        for (part, solid) in hand.parts() {
            let distance = obstacle.distance(solid) - CLOSER_TO_OBSTACLES;
            if nearest.is_none_or(|nearest| distance < nearest.distance) {
                nearest = Some(Nearest {
                    distance,
                    part,
                    at: solid.skin_toward(
                        |point| obstacle.point_distance(point),
                        |point| obstacle.outward(point),
                    ),
                    barrier: Barrier::Obstacle(place),
                });
            }
        }
    }
    nearest
}

/// The point of a solid's skin nearest to a hand's solids.
fn skin_toward_hand<'a>(solid: &TaperedCapsule, hand: impl Iterator<Item = &'a TaperedCapsule>) -> Vec3 {
    let nearest = hand.min_by(|a, b| solid.distance(a).total_cmp(&solid.distance(b)));
    nearest.map_or_else(|| solid.at(0.5), |their| skin_toward_solid(solid, their))
}

/// The point of a solid's skin nearest to another solid.
pub(crate) fn skin_toward_solid(solid: &TaperedCapsule, other: &TaperedCapsule) -> Vec3 {
    solid.skin_toward(|point| other.signed_distance(point), |point| other.outward(point))
}
