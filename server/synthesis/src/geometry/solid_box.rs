//! Boxes as obstacles: distances of points and tapered capsules from them.

use glam::{DMat3, DVec3, Vec3};

use super::{oriented_box::OrientedBox, tapered_capsule::TaperedCapsule};

/// Upper bound on the error of distances from capsules, in metres. Smaller values take longer and change nothing that
/// single precision shows within arm's reach.
const TOLERANCE: f64 = 1e-7;

/// A box prepared for many distances. It computes in double precision, because a floor is wide and the hand on it small.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolidBox {
    centre: DVec3,
    /// Rows are the box's axes.
    box_from_frame: DMat3,
    half_extents: DVec3,
}

/// The signed distance of a moving point from the box, and its rate of change.
#[derive(Clone, Copy, Debug)]
struct Rate {
    distance: f64,
    /// One of the rates where several faces are equally near.
    slope: f64,
}

impl SolidBox {
    /// Prepares a box, in the frame of its `object_from_box`.
    pub fn new(of: &OrientedBox) -> Self {
        let orientation = of.object_from_box.orientation.as_dquat().normalize();
        Self {
            centre: of.object_from_box.position.as_dvec3(),
            box_from_frame: DMat3::from_quat(orientation).transpose(),
            half_extents: of.half_extents.as_dvec3(),
        }
    }

    /// Distance from a point to the surface, in metres; negative inside.
    pub fn signed_distance(&self, point: Vec3) -> f32 {
        self.at(self.local(point), DVec3::ZERO).distance as f32
    }

    /// The direction in which the distance from a point grows fastest, a unit vector: from the nearest point of the
    /// surface, or out of the nearest face.
    pub fn outward(&self, point: Vec3) -> Vec3 {
        let local = self.local(point);
        let beyond = local.abs() - self.half_extents;
        let outside = beyond.max(DVec3::ZERO);
        let nearest_face = DVec3::AXES[beyond.max_position()];
        let direction = outside.try_normalize().unwrap_or(nearest_face) * local.signum();
        (self.box_from_frame.transpose() * direction).as_vec3()
    }

    /// Distance between the surfaces of the box and a capsule, in metres; if negative, how far the capsule must move to
    /// clear the box. Exact to 0.1 µm.
    ///
    /// The capsule is the union of the balls around its axis, so the distance is the minimum of d(a(t)) - r(t), where d
    /// is the signed distance from the box. The box is convex, so d is, and r is linear: the minimum lies where the
    /// slope changes its sign, which bisection finds.
    pub fn distance(&self, capsule: &TaperedCapsule) -> f32 {
        let start = self.local(capsule.start);
        let axis = self.box_from_frame * (capsule.end - capsule.start).as_dvec3();
        let radius = f64::from(capsule.start_radius);
        let rise = f64::from(capsule.end_radius) - radius;
        let gap = |along: f64| {
            let rate = self.at(start + axis * along, axis);
            Rate {
                distance: rate.distance - radius - rise * along,
                slope: rate.slope - rise,
            }
        };
        let (first, last) = (gap(0.0), gap(1.0));
        if first.slope >= 0.0 {
            return first.distance as f32;
        }
        if last.slope <= 0.0 {
            return last.distance as f32;
        }
        let mut least = first.distance.min(last.distance);
        let steepest = axis.length() + rise.abs();
        let (mut from, mut to) = (0.0, 1.0);
        while (to - from) * steepest > TOLERANCE {
            let along = 0.5 * (from + to);
            let middle = gap(along);
            least = least.min(middle.distance);
            if middle.slope >= 0.0 {
                to = along;
            } else {
                from = along;
            }
        }
        least as f32
    }

    /// A point in the box's frame.
    fn local(&self, point: Vec3) -> DVec3 {
        self.box_from_frame * (point.as_dvec3() - self.centre)
    }

    /// The distance at a point of the box's frame that moves with a velocity.
    fn at(&self, point: DVec3, velocity: DVec3) -> Rate {
        let beyond = point.abs() - self.half_extents;
        let outside = beyond.max(DVec3::ZERO);
        let outward = velocity * point.signum();
        let distance = outside.length();
        if distance > 0.0 {
            return Rate {
                distance,
                slope: outside.dot(outward) / distance,
            };
        }
        let nearest = beyond.max_position();
        Rate {
            distance: beyond[nearest],
            slope: outward[nearest],
        }
    }
}
