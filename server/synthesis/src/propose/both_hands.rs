//! Proposals for two hands that hold an object together: each a part of it that one hand can hold or press, on both sides of its
//! centre of mass.
//!
//! Most objects that take two hands are symmetric about an upright plane, and people hold them symmetrically. The mirror image of
//! a hand is the same person's other hand, so one that fits on one side has a fitting partner on the other.

use glam::{Mat3, Quat, Vec3};

use super::{
    prepared::PreparedObject,
    proposal::{MAX_LOCATIONS, ProposalContext, palm_shape},
    surface_pairs::{SurfacePair, SurfacePoint},
};
use crate::{
    base::{pose::Pose, random::AttemptStream, stop::Stop},
    model::{hand::rig::Rig, object::GraspObject},
    physical::shape::{HandShape, Proposal},
};

/// Locations drawn per proposal; the best is used. More find holds of plain objects sooner, but less varied ones.
const COMPARED: usize = 4;

/// Share of proposals with the palm on the object where all of it is within a hand's span. Elsewhere, only palms can hold it.
const MIN_PALM_SHARE: f32 = 0.3;

/// Preferred position of one of two hands.
#[derive(Clone, Copy, Debug)]
pub enum Aim {
    /// Far from the line along `up`, a unit vector, through `centre`, with palms facing it.
    Outside {
        /// The object's centre of mass, in metres.
        centre: Vec3,
        /// Against gravity.
        up: Vec3,
    },
    /// Near a point, in metres.
    Near(Vec3),
}

impl Aim {
    fn merit_of_pair(&self, pair: &SurfacePair) -> f32 {
        let middle = (pair.start + pair.end) * 0.5;
        match *self {
            Self::Outside { centre, up } => (middle - centre).reject_from_normalized(up).length(),
            Self::Near(target) => -middle.distance(target),
        }
    }

    fn merit_of_point(&self, point: &SurfacePoint) -> f32 {
        match *self {
            Self::Outside { centre, up } => {
                let outward = (point.position - centre).reject_from_normalized(up);
                outward.normalize_or_zero().dot(point.normal)
            }
            Self::Near(target) => -point.position.distance(target),
        }
    }
}

impl ProposalContext<'_> {
    /// Proposes one of two hands, with pads or palm on the best of some locations and a wrist pose that `admits` accepts. Returns
    /// `None` if no sampled hand fits, or if stopped.
    pub fn propose_half(
        &self,
        aim: Aim,
        admits: impl Fn(Pose) -> bool,
        stream: &mut AttemptStream,
        stop: Stop<'_>,
    ) -> Option<Proposal> {
        let palm_share = 1.0 - (1.0 - MIN_PALM_SHARE) * self.surface.spanned_share();
        let in_palm = stream.unit() < palm_share;
        (0..MAX_LOCATIONS).take_while(|_| !stop.is_over()).find_map(|_| {
            if in_palm {
                let shape = flat_palm_shape(self.rig, stream);
                let point = best_of(|| self.free_point(stream), |point| aim.merit_of_point(point))?;
                self.palm_on(point, shape, &admits, stream)
            } else {
                let pair = best_of(|| self.free_pair(stream), |pair| aim.merit_of_pair(pair))?;
                Some(self.candidate_on(pair, &admits, stream)?.proposal())
            }
        })
    }
}

/// Draws the shape of a hand with the palm on a part too wide for one hand: nearly flat, so that a thumb far out of the palm's
/// plane does not start inside.
fn flat_palm_shape(rig: &Rig, stream: &mut AttemptStream) -> HandShape {
    let shape = palm_shape(rig, stream);
    HandShape {
        thumb_yaw: shape.thumb_yaw * stream.unit(),
        ..shape
    }
}

fn best_of<T>(mut draw: impl FnMut() -> Option<T>, merit: impl Fn(&T) -> f32) -> Option<T> {
    (0..COMPARED)
        .map_while(|_| draw())
        .max_by(|a, b| merit(a).total_cmp(&merit(b)))
}

/// Largest rise of an upright plane's normal, as its sine: objects are not held exactly level.
const MAX_NORMAL_RISE: f32 = 0.5;

/// Smallest distance of a hand from a plane in whose mirror image the other hand holds, in metres: half a hand's breadth.
const MIN_DISTANCE: f32 = 0.05;

/// Largest distance of a mirror image from the surface of a symmetric object, in metres: a tenth of how deep digits touch.
const ASYMMETRY: f32 = 5e-5;
const COMPARED_POINTS: usize = 512;

/// A plane in which a hand has its mirror image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mirror {
    /// A point of the plane, in metres.
    point: Vec3,
    normal: Vec3,
}

impl Mirror {
    /// The upright planes through the centre of mass, along the axes of the object's bounding box. `up` is a unit vector.
    fn of_object(object: &GraspObject, up: Vec3) -> impl Iterator<Item = Self> {
        let axes = object.bounding_box.object_from_box;
        let point = object.centre_of_mass;
        Vec3::AXES
            .into_iter()
            .map(move |axis| axes.transform_vector(axis))
            .filter(move |normal| normal.dot(up).abs() <= MAX_NORMAL_RISE)
            .map(move |normal| Self { point, normal })
    }

    /// The upright planes in whose mirror image the other hand has room next to one at `place`: one that faces it, and those along
    /// the axes of the object's bounding box. `up` is a unit vector.
    pub fn beside(object: &GraspObject, up: Vec3, place: Vec3) -> impl Iterator<Item = Self> {
        let facing = Self::facing(object, up, place).into_iter();
        let all = facing.chain(Self::of_object(object, up));
        all.filter(move |mirror| mirror.has_room(place))
    }

    /// The upright plane through the centre of mass that faces `place`; `None` if that is above or below it.
    pub fn facing(object: &GraspObject, up: Vec3, place: Vec3) -> Option<Self> {
        let point = object.centre_of_mass;
        let normal = (place - point).reject_from_normalized(up).try_normalize()?;
        Some(Self { point, normal })
    }

    /// A plane about which an object is symmetric, with its centre of mass and its forbidden surface. Takes less than a
    /// millisecond. There is none on an object with wishes for hands, as these may prefer one side.
    pub fn of_symmetric(object: &PreparedObject) -> Option<Self> {
        if object.regions().require_contacts() {
            return None;
        }
        let box_axes = object.bounding_box.object_from_box;
        let of_box = Vec3::AXES.map(|axis| box_axes.transform_vector(axis));
        let mut candidates = Vec3::AXES.into_iter().chain(of_box).flat_map(|normal| {
            let middles = [
                object.mesh.aabb().centre(),
                box_axes.position,
                object.centre_of_mass,
            ];
            middles.map(|point| Self { point, normal })
        });
        let points = &object.surface_pairs.points;
        let stride = points.len().div_ceil(COMPARED_POINTS).max(1);
        let is_symmetric = |mirror: &Self| {
            let is_central = mirror
                .point(object.centre_of_mass)
                .distance(object.centre_of_mass)
                <= 2.0 * ASYMMETRY;
            let has_image = |point: &SurfacePoint| mirror.has_image(object, point);
            is_central && !points.is_empty() && points.iter().step_by(stride).all(has_image)
        };
        candidates.find(is_symmetric)
    }

    /// True if the mirror image of a point that may be touched is one, too.
    fn has_image(&self, object: &GraspObject, point: &SurfacePoint) -> bool {
        let nearest = object
            .surface
            .closest_point_within(self.point(point.position), ASYMMETRY);
        nearest.is_some_and(|nearest| !object.is_forbidden(nearest.triangle))
    }

    /// True if the other hand has room next to one at `place`.
    pub fn has_room(&self, place: Vec3) -> bool {
        (place - self.point).dot(self.normal).abs() >= MIN_DISTANCE
    }

    /// The mirror image of a point.
    pub fn point(&self, point: Vec3) -> Vec3 {
        point - self.normal * (2.0 * (point - self.point).dot(self.normal))
    }

    /// The mirror image of a direction.
    pub fn direction(&self, direction: Vec3) -> Vec3 {
        direction - self.normal * (2.0 * direction.dot(self.normal))
    }

    /// The wrist pose of the other hand in the mirror image of a hand.
    pub fn wrist(&self, wrist: Pose) -> Pose {
        let reflected = |axis: Vec3| self.direction(wrist.transform_vector(axis));
        // The other hand's own x axis is reversed, so that its frame is right-handed too.
        let axes = Mat3::from_cols(-reflected(Vec3::X), reflected(Vec3::Y), reflected(Vec3::Z));
        Pose::new(self.point(wrist.position), Quat::from_mat3(&axes).normalize())
    }

    /// The mirror image of a proposal, for the other hand.
    pub fn proposal(&self, proposal: &Proposal) -> Proposal {
        Proposal {
            object_from_wrist: self.wrist(proposal.object_from_wrist),
            ..*proposal
        }
    }
}
