//! The tapered capsule, or cone-sphere: the convex hull of two spheres.

use glam::{DVec3, Vec3};

use crate::base::pose::Pose;

/// Squared sine of the angle below which two axes count as parallel: they diverge by a micrometre over 10 cm.
const PARALLEL: f64 = 1e-10;

/// Steps of the search along an axis, each of which leaves two thirds of it: 25 cm become less than a micrometre.
const SKIN_STEPS: usize = 32;

/// The convex hull of two spheres: all points within [`TaperedCapsule::radius_at`] of a point of the axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TaperedCapsule {
    /// Centre of the first sphere, in metres.
    pub start: Vec3,
    /// Centre of the second sphere, in metres.
    pub end: Vec3,
    /// Radius of the sphere around `start`, in metres.
    pub start_radius: f32,
    /// Radius of the sphere around `end`, in metres.
    pub end_radius: f32,
}

impl TaperedCapsule {
    /// The hull of a sphere of `start_radius` around `start` and one of `end_radius` around `end`, in metres.
    pub const fn new(start: Vec3, end: Vec3, start_radius: f32, end_radius: f32) -> Self {
        Self {
            start,
            end,
            start_radius,
            end_radius,
        }
    }

    /// The point of the axis at a parameter from 0 (start) to 1 (end).
    pub fn at(&self, along: f32) -> Vec3 {
        self.start + (self.end - self.start) * along
    }

    /// The radius at a parameter of the axis, in metres: linear from start to end.
    pub fn radius_at(&self, along: f32) -> f32 {
        self.start_radius + (self.end_radius - self.start_radius) * along
    }

    /// Length of the axis, in metres.
    pub fn length(&self) -> f32 {
        self.start.distance(self.end)
    }

    /// The same solid in another frame.
    #[must_use]
    pub fn transformed(&self, a_from_b: Pose) -> Self {
        Self {
            start: a_from_b.transform_point(self.start),
            end: a_from_b.transform_point(self.end),
            ..*self
        }
    }

    /// The same solid, `scale` times as large about the origin.
    #[must_use]
    pub fn scaled(&self, scale: f32) -> Self {
        Self::new(
            self.start * scale,
            self.end * scale,
            self.start_radius * scale,
            self.end_radius * scale,
        )
    }

    /// Centre and radius of the smallest enclosing sphere, in metres.
    pub(crate) fn bounding_sphere(&self) -> (Vec3, f32) {
        let length = self.length();
        let (start, end) = (self.start_radius, self.end_radius);
        if length <= (end - start).abs() {
            return if end > start {
                (self.end, end)
            } else {
                (self.start, start)
            };
        }
        let radius = 0.5 * (length + start + end);
        (self.at((radius - start) / length), radius)
    }

    /// Exact distance from a point to the surface, in metres; negative inside.
    pub fn signed_distance(&self, point: Vec3) -> f32 {
        self.nearest(point.as_dvec3()).1 as f32
    }

    /// Axis parameter (0 to 1) of the sphere closest to the point, and the signed distance to it, in metres.
    ///
    /// The solid is the union of the spheres around its axis, so the distance is the minimum of |p - a(t)| - r(t). That
    /// function is convex in t, and stationary where the line to the point meets the axis at the cone's opening angle.
    pub(crate) fn nearest(&self, point: DVec3) -> (f64, f64) {
        let start = self.start.as_dvec3();
        let axis = self.end.as_dvec3() - start;
        let (r0, r1) = (f64::from(self.start_radius), f64::from(self.end_radius));
        let length = axis.length();
        let value = |t: f64| (start + axis * t).distance(point) - (r0 + (r1 - r0) * t);
        let slope = (r1 - r0) / length;
        // One sphere contains the other, or both coincide and the slope is NaN.
        if slope.is_nan() || slope.abs() >= 1.0 {
            let t = if r1 > r0 { 1.0 } else { 0.0 };
            return (t, value(t));
        }
        let direction = axis / length;
        let offset = point - start;
        let along = offset.dot(direction);
        let across = (offset - direction * along).length();
        let t = ((along + across * slope / (1.0 - slope * slope).sqrt()) / length).clamp(0.0, 1.0);
        (t, value(t))
    }

    /// The point of the skin that is nearest to a convex body, by the signed distance of a point from the body and the direction
    /// in which that distance grows. Exact to about a micrometre, in about a hundred evaluations.
    pub(crate) fn skin_toward(&self, distance: impl Fn(Vec3) -> f32, outward: impl Fn(Vec3) -> Vec3) -> Vec3 {
        // Distance less radius is convex along the axis.
        let value = |t: f32| distance(self.at(t)) - self.radius_at(t);
        let along = [0.0, least_along(SKIN_STEPS, value), 1.0]
            .into_iter()
            .min_by(|&a, &b| value(a).total_cmp(&value(b)))
            .unwrap_or_default();
        self.at(along) - outward(self.at(along)) * self.radius_at(along)
    }

    /// The direction in which the distance from a point grows fastest: a unit vector, or 0 on the axis.
    pub fn outward(&self, point: Vec3) -> Vec3 {
        let (along, _) = self.nearest(point.as_dvec3());
        (point - self.at(along as f32)).normalize_or_zero()
    }

    /// Distance between the surfaces of two solids, in metres; if negative, how far one must move to clear the other.
    ///
    /// The minimum of |a(t) - b(u)| - r(t) - q(u), which is convex in t and u. It lies either at an interior
    /// stationary point, where the line between the axes meets each at its cone's angle, or at an end of one axis.
    pub fn distance(&self, other: &Self) -> f32 {
        let axis = (other.end - other.start).as_dvec3();
        let rise = f64::from(other.end_radius) - f64::from(other.start_radius);
        let start_radius = f64::from(other.start_radius);
        if let Some((_, distance)) = self.stationary(other.start.as_dvec3(), axis, start_radius, rise) {
            // A stationary point of a convex function is its minimum.
            return distance as f32;
        }
        let ends = [
            self.nearest(other.start.as_dvec3()).1 - f64::from(other.start_radius),
            self.nearest(other.end.as_dvec3()).1 - f64::from(other.end_radius),
            other.nearest(self.start.as_dvec3()).1 - f64::from(self.start_radius),
            other.nearest(self.end.as_dvec3()).1 - f64::from(self.end_radius),
        ];
        ends.into_iter().fold(f64::INFINITY, f64::min) as f32
    }

    /// The stationary point of |a(t) - b(u)| - r(t) - q(u) with both t and u in [0, 1], if there is one: t and the
    /// value there. The other axis runs from `b` to `b + along_b`; its radius grows from `radius_b` by `rise_b`.
    pub(super) fn stationary(
        &self,
        b: DVec3,
        along_b: DVec3,
        radius_b: f64,
        rise_b: f64,
    ) -> Option<(f64, f64)> {
        let a = self.start.as_dvec3();
        let along_a = self.end.as_dvec3() - a;
        let rise_a = f64::from(self.end_radius) - f64::from(self.start_radius);
        // The unit vector n from b(u) to a(t) satisfies n · along_a = rise_a and n · along_b = -rise_b. That fixes
        // its component parallel to both axes; the rest is perpendicular to both.
        let across = along_a.cross(along_b);
        let (aa, ab, bb) = (along_a.dot(along_a), along_a.dot(along_b), along_b.dot(along_b));
        let determinant = across.length_squared();
        if determinant <= PARALLEL * aa * bb {
            return None;
        }
        let in_plane = along_a * ((rise_a * bb + rise_b * ab) / determinant)
            - along_b * ((rise_b * aa + rise_a * ab) / determinant);
        let rest = 1.0 - in_plane.length_squared();
        if rest <= 0.0 {
            return None;
        }
        let from_b = a - b;
        let distance = from_b.dot(across).abs() / (determinant * rest).sqrt();
        // from_b + along_a t - along_b u = distance n; its component in the plane of the axes gives t and u.
        let (ta, tb) = (
            rise_a * distance - from_b.dot(along_a),
            -rise_b * distance - from_b.dot(along_b),
        );
        let t = (ta * bb - tb * ab) / determinant;
        let u = (ta * ab - tb * aa) / determinant;
        let is_inside = (0.0..=1.0).contains(&t) && (0.0..=1.0).contains(&u);
        is_inside.then(|| {
            let reach = f64::from(self.start_radius) + rise_a * t + radius_b + rise_b * u;
            (t, (from_b + along_a * t - along_b * u).length() - reach)
        })
    }
}

/// The parameter of the axis at which a convex function of it is least, after so many steps that each leave two thirds.
pub(super) fn least_along(steps: usize, value: impl Fn(f32) -> f32) -> f32 {
    let (mut from, mut to) = (0.0_f32, 1.0_f32);
    for _ in 0..steps {
        let third = (to - from) / 3.0;
        if value(from + third) <= value(to - third) {
            to -= third;
        } else {
            from += third;
        }
    }
    0.5 * (from + to)
}
