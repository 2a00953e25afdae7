//! Planes in which one hand is the mirror image of the other.

use glam::{Mat3, Quat, Vec3};

use super::{prepared::PreparedObject, surface_pairs::SurfacePoint};
use crate::{base::pose::Pose, model::object::GraspObject, physical::shape::Proposal};

/// Largest rise of an upright plane's normal, as its sine: objects are not held exactly level.
const MAX_NORMAL_RISE: f32 = 0.5;

/// Smallest distance of a hand from a plane in whose mirror image the other hand holds, in metres: half a hand's breadth.
const MIN_DISTANCE: f32 = 0.05;

/// Largest distance of a mirror image from the surface of a symmetric object, in metres: a tenth of how deep digits touch. Points of
/// the surface that are compared at most.
const ASYMMETRY: f32 = 5e-5;
const COMPARED_POINTS: usize = 512;

/// A plane in which a hand has its mirror image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mirror {
    /// A point of the plane, in metres.
    point: Vec3,
    /// Its unit normal.
    normal: Vec3,
}

impl Mirror {
    /// The upright planes through the centre of mass, along the axes of the object's bounding box. `up` is a unit
    /// vector.
    pub fn of_object(object: &GraspObject, up: Vec3) -> impl Iterator<Item = Self> {
        let axes = object.bounding_box.object_from_box;
        Vec3::AXES
            .map(|axis| axes.transform_vector(axis))
            .into_iter()
            .filter(move |axis| axis.dot(up).abs() <= MAX_NORMAL_RISE)
            .map(|normal| Self {
                point: object.centre_of_mass,
                normal,
            })
    }

    /// The upright plane through the centre of mass that faces `place`; `None` if that is above or below it.
    pub fn facing(object: &GraspObject, up: Vec3, place: Vec3) -> Option<Self> {
        let outward = (place - object.centre_of_mass).reject_from_normalized(up);
        outward.try_normalize().map(|normal| Self {
            point: object.centre_of_mass,
            normal,
        })
    }

    /// A plane about which an object is symmetric, with its centre of mass and its forbidden surface, if there is one. Takes less than a
    /// millisecond. Where hands are wanted, one side may be preferred to the other: there is none then.
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
        let points = object.surface_pairs().points();
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
