//! Boxes: axis-aligned ones, tight oriented ones, and solid ones that hands keep clear of.

use glam::{DMat3, DQuat, DVec2, DVec3, Vec3, Vec3A};

use super::{Segment, mesh::TriangleMesh, surface_samples::principal_axes, tapered_capsule::TaperedCapsule};
use crate::base::{
    pose::Pose,
    stop::{Stop, Stopped, unstopped},
};

/// A box whose faces are perpendicular to the axes, in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// The corner with the smallest coordinates.
    pub min: Vec3,
    /// The corner with the largest coordinates.
    pub max: Vec3,
}

impl Aabb {
    /// The empty box, the neutral element of [`Aabb::including`].
    pub const EMPTY: Self = Self {
        min: Vec3::INFINITY,
        max: Vec3::NEG_INFINITY,
    };

    /// The smallest box around points; [`Aabb::EMPTY`] for none.
    pub fn around(points: impl IntoIterator<Item = Vec3>) -> Self {
        points.into_iter().fold(Self::EMPTY, Self::including)
    }

    /// The smallest box around this one and a point.
    #[must_use]
    pub fn including(self, point: Vec3) -> Self {
        Self {
            min: self.min.min(point),
            max: self.max.max(point),
        }
    }

    /// True if the point lies inside or on a face.
    pub fn contains(&self, point: Vec3) -> bool {
        point.cmpge(self.min).all() && point.cmple(self.max).all()
    }

    /// False only if the segment certainly misses the box, because all of it lies beyond one face. A conservative
    /// test: it may be true for a segment that misses.
    #[inline]
    pub(crate) fn may_intersect(&self, segment: Segment) -> bool {
        let (start, end) = (Vec3A::from(segment.start), Vec3A::from(segment.end));
        let beyond_max = start.min(end) - Vec3A::from(self.max);
        let below_min = Vec3A::from(self.min) - start.max(end);
        // A single comparison: six unpredictable branches would take longer than all the arithmetic.
        !beyond_max.max(below_min).cmpgt(Vec3A::ZERO).any()
    }

    /// Distance from a point to the box, in metres; 0 inside.
    #[inline]
    pub fn distance(&self, point: Vec3) -> f32 {
        (self.min - point).max(point - self.max).max(Vec3::ZERO).length()
    }

    /// Edge lengths, in metres.
    pub fn extents(&self) -> Vec3 {
        self.max - self.min
    }

    /// The centre.
    pub fn centre(&self) -> Vec3 {
        // Halve before adding: the sum of two huge coordinates would overflow.
        self.min * 0.5 + self.max * 0.5
    }

    /// Length of the diagonal, in metres.
    pub fn diagonal(&self) -> f32 {
        self.extents().length()
    }
}

/// Number of directions whose outermost vertices the box is fitted to: about 7° apart.
const SUPPORT_DIRECTIONS: usize = 256;

/// Number of initial orientations in addition to the object's axes and its principal axes, against local minima.
const EXTRA_ORIENTATIONS: usize = 10;

/// Upper bound of turns from one initial orientation. Most fits end after ten.
const MAX_TURNS: usize = 100;

/// Thickness added in comparisons of volume, as a share of the diagonal, so that flat boxes compare by area.
const COMPARED_THICKNESS: f64 = 1e-4;

/// A tight box around an object: B of thesis 4.3.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrientedBox {
    /// The box's frame, with its origin at the centre, in the object's frame.
    pub object_from_box: Pose,
    /// Half the edge lengths along the box's axes, in metres.
    pub half_extents: Vec3,
}

impl OrientedBox {
    /// A tight box around a mesh, never larger than the axis-aligned one; deterministic.
    ///
    /// From each of several fixed initial orientations, the box is turned about one axis at a time to the smallest
    /// cross-section, by rotating calipers, until no turn shrinks it: the local search of C.-T. Chang, B. Gorissen,
    /// S. Melchior, "Fast Oriented Bounding Box Optimization on the Rotation Group SO(3, R)", 2011.
    pub fn around(mesh: &TriangleMesh) -> Self {
        unstopped(|stop| Self::around_until(mesh, stop))
    }

    /// The box scaled about the origin of the object's frame.
    #[must_use]
    pub fn scaled(&self, scale: f32) -> Self {
        let Pose {
            position,
            orientation,
        } = self.object_from_box;
        Self {
            object_from_box: Pose::new(position * scale, orientation),
            half_extents: self.half_extents * scale,
        }
    }

    /// As [`Self::around`], unless it is stopped.
    pub(crate) fn around_until(mesh: &TriangleMesh, stop: Stop<'_>) -> Result<Self, Stopped> {
        let used = used_vertices(mesh);
        let vertices = || used.iter().map(|&v| mesh.positions()[v as usize].as_dvec3());
        let points = outermost(vertices, stop)?;
        let thickness = COMPARED_THICKNESS * f64::from(mesh.aabb().diagonal());
        let size = |axes: DMat3| extents(&points, axes).map(|e| e + thickness).element_product();

        let mut best = DMat3::IDENTITY;
        for initial in initial_axes(&points) {
            stop.check()?;
            let axes = refine(&points, initial, size);
            // Smaller by a thousandth, so that rounding does not choose between equals.
            if size(axes) < 0.999 * size(best) {
                best = axes;
            }
        }
        let fitted = Self::with_axes(vertices, best);
        let aligned = Self::with_axes(vertices, DMat3::IDENTITY);
        Ok(if fitted.volume() <= aligned.volume() {
            fitted
        } else {
            aligned
        })
    }

    /// The tight box with the given axes.
    fn with_axes<I: Iterator<Item = DVec3>>(vertices: impl Fn() -> I, axes: DMat3) -> Self {
        let axes = nearest_to_identity(axes);
        let orientation = DQuat::from_mat3(&axes).normalize().as_quat();
        let box_from_object = orientation.as_dquat().normalize().conjugate();
        let (min, max) = bounds(vertices().map(|vertex| box_from_object * vertex));
        let centre = box_from_object.conjugate() * ((min + max) * 0.5);
        // Rounding centre and rotation to f32 may leave vertices this far outside.
        let rounding = 2.0 * f64::from(f32::EPSILON) * (centre.length() + (max - min).length());
        let half_extents = ((max - min) * 0.5 + DVec3::splat(rounding)).as_vec3();
        Self {
            object_from_box: Pose::new(centre.as_vec3(), orientation),
            half_extents,
        }
    }

    /// Volume, in m³.
    pub fn volume(&self) -> f32 {
        8.0 * self.half_extents.element_product()
    }

    /// True if a point of the object's frame lies inside or on a face.
    pub fn contains(&self, point: Vec3) -> bool {
        self.local(point).abs().cmple(self.half_extents).all()
    }

    /// Distance from a point of the object's frame to the box, in metres; 0 inside. The object's surface is at least
    /// as far away.
    pub fn distance(&self, point: Vec3) -> f32 {
        (self.local(point).abs() - self.half_extents)
            .max(Vec3::ZERO)
            .length()
    }

    /// Distance from a point of the object's frame to the box's surface, in metres; negative inside.
    pub fn signed_distance(&self, point: Vec3) -> f32 {
        let beyond = self.local(point).abs() - self.half_extents;
        beyond.max(Vec3::ZERO).length() + beyond.max_element().min(0.0)
    }

    /// A point of the object's frame in the box's frame.
    fn local(&self, point: Vec3) -> Vec3 {
        self.object_from_box.inverse().transform_point(point)
    }
}

/// The vertices of the triangles, each where it occurs last.
fn used_vertices(mesh: &TriangleMesh) -> Vec<u32> {
    let mut is_met = vec![false; mesh.positions().len()];
    let corners = mesh.triangles().as_flattened().iter().rev().copied();
    let mut used: Vec<u32> = corners
        .filter(|&vertex| !std::mem::replace(&mut is_met[vertex as usize], true))
        .collect();
    used.reverse();
    used
}

/// The vertices that are outermost in at least one of [`SUPPORT_DIRECTIONS`] directions.
fn outermost<I: Iterator<Item = DVec3>>(
    vertices: impl Fn() -> I,
    stop: Stop<'_>,
) -> Result<Vec<DVec3>, Stopped> {
    let all: Vec<DVec3> = vertices().collect();
    let mut chosen: Vec<usize> = Vec::new();
    for direction in directions(SUPPORT_DIRECTIONS) {
        stop.check()?;
        let along = |i: &usize, j: &usize| direction.dot(all[*i]).total_cmp(&direction.dot(all[*j]));
        chosen.extend((0..all.len()).max_by(along));
    }
    chosen.sort_unstable();
    chosen.dedup();
    Ok(chosen.into_iter().map(|index| all[index]).collect())
}

/// Directions spread evenly over the sphere by a golden-angle spiral (R. Swinbank, R. J. Purser: Fibonacci grids, 2006).
fn directions(count: usize) -> impl Iterator<Item = DVec3> {
    let golden_angle = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    (0..count).map(move |i| {
        let z = 1.0 - (2.0 * i as f64 + 1.0) / count as f64;
        let (sin, cos) = (golden_angle * i as f64).sin_cos();
        let radius = (1.0 - z * z).sqrt();
        DVec3::new(radius * cos, radius * sin, z)
    })
}

/// Initial axes of the fit: the object's own, its principal axes, and some spread evenly over the sphere.
fn initial_axes(points: &[DVec3]) -> impl Iterator<Item = DMat3> {
    let spread = directions(EXTRA_ORIENTATIONS).map(|direction| {
        // Each direction becomes the z axis.
        DMat3::from_quat(DQuat::from_rotation_arc(DVec3::Z, direction))
    });
    [DMat3::IDENTITY, principal_axes(points)]
        .into_iter()
        .chain(spread)
}

/// Turns the box repeatedly, each time about the axis that shrinks it most, until no turn shrinks it.
fn refine(points: &[DVec3], initial: DMat3, size: impl Fn(DMat3) -> f64) -> DMat3 {
    let mut axes = initial;
    for _ in 0..MAX_TURNS {
        let turns = [0, 1, 2].map(|fixed| turn_about(points, axes, fixed));
        let Some(turned) = turns.into_iter().min_by(|&a, &b| size(a).total_cmp(&size(b))) else {
            break;
        };
        // A gain below a millionth is rounding.
        if size(turned) > (1.0 - 1e-6) * size(axes) {
            break;
        }
        axes = turned;
    }
    axes
}

/// The axes turned about the `fixed` one to the minimum-area rectangle, by rotating calipers (Freeman and Shapira, 1975).
fn turn_about(points: &[DVec3], axes: DMat3, fixed: usize) -> DMat3 {
    let (x, y) = (axes.col((fixed + 1) % 3), axes.col((fixed + 2) % 3));
    let hull = convex_hull(points.iter().map(|p| DVec2::new(p.dot(x), p.dot(y))).collect());
    let area_along = |side: DVec2| {
        let spread = |direction: DVec2| {
            let (min, max) = hull
                .iter()
                .map(|p| p.dot(direction))
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(min, max), d| {
                    (min.min(d), max.max(d))
                });
            max - min
        };
        spread(side) * spread(side.perp())
    };
    let sides = (0..hull.len()).filter_map(|i| (hull[(i + 1) % hull.len()] - hull[i]).try_normalize());
    let Some((side, _)) = sides
        .map(|side| (side, area_along(side)))
        .min_by(|a, b| a.1.total_cmp(&b.1))
    else {
        return axes;
    };
    let mut columns = [axes.col(0), axes.col(1), axes.col(2)];
    columns[(fixed + 1) % 3] = (x * side.x + y * side.y).normalize_or(x);
    columns[(fixed + 2) % 3] = columns[fixed].cross(columns[(fixed + 1) % 3]);
    DMat3::from_cols(columns[0], columns[1], columns[2])
}

/// The convex hull of points in the plane, counter-clockwise, by Andrew's monotone chain (1979).
fn convex_hull(mut points: Vec<DVec2>) -> Vec<DVec2> {
    points.sort_unstable_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    points.dedup();
    if points.len() < 3 {
        return points;
    }
    let half = |ordered: &mut dyn Iterator<Item = DVec2>| {
        let mut chain: Vec<DVec2> = Vec::new();
        for point in ordered {
            while let [.., a, b] = chain[..] {
                if (b - a).perp_dot(point - b) > 0.0 {
                    break;
                }
                chain.pop();
            }
            chain.push(point);
        }
        chain.pop();
        chain
    };
    let mut hull = half(&mut points.iter().copied());
    hull.extend(half(&mut points.iter().rev().copied()));
    hull
}

/// Edge lengths of the box with the given axes, in metres.
fn extents(points: &[DVec3], axes: DMat3) -> DVec3 {
    let box_from_object = axes.transpose();
    let (min, max) = bounds(points.iter().map(|&point| box_from_object * point));
    max - min
}

/// The smallest and the largest coordinates.
fn bounds(points: impl Iterator<Item = DVec3>) -> (DVec3, DVec3) {
    points.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(min, max), point| {
        (min.min(point), max.max(point))
    })
}

/// The axes of the same box, permuted and reversed to be as close to the object's as possible.
fn nearest_to_identity(axes: DMat3) -> DMat3 {
    /// The permutations of the axes; reversals restore a right-handed frame.
    const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]];
    let columns = [axes.col(0), axes.col(1), axes.col(2)];
    let reversed_if_needed = |axis: DVec3, component: f64| if component < 0.0 { -axis } else { axis };
    let order = ORDERS
        .into_iter()
        .max_by(|a, b| {
            let trace = |order: &[usize; 3]| -> f64 { (0..3).map(|i| columns[order[i]][i].abs()).sum() };
            trace(a).total_cmp(&trace(b))
        })
        .unwrap_or(ORDERS[0]);
    let x = reversed_if_needed(columns[order[0]], columns[order[0]].x);
    let y = reversed_if_needed(columns[order[1]], columns[order[1]].y);
    DMat3::from_cols(x, y, x.cross(y))
}

/// Upper bound on the error of distances from capsules, in metres.
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
