//! A giver's hand prepared for comparison with many others. Its solids are stored by coordinate, so that one sphere
//! is compared with all of them at once.

use glam::{Mat3, Vec3};

use super::{TaperedCapsule, TrackedSolids, clearance::Bounded};
use crate::{base::pose::Pose, model::holdout::HandMesh};

/// Number of the giver's solids, padded to whole registers.
const LANES: usize = TrackedSolids::COUNT.next_multiple_of(8);

/// Solids of the giver compared with one solid at once: one register of single precision.
const GROUP: usize = 8;

/// Solids compared with a group of spheres between checks for a decision.
const SOLIDS_AT_ONCE: usize = 8;

/// Solids behind the upper bounds on distance.
const BOUNDING_SOLIDS: usize = 16;

/// Upper bound on the rounding error of distances within arm's reach, in metres.
const ROUNDING: f32 = 2e-6;

/// One value per solid.
type Lanes = [f32; LANES];

/// The solids of a giver's hand, fixed while others are compared with it.
#[derive(Clone, Debug)]
pub struct PreparedHand {
    solids: [Bounded; TrackedSolids::COUNT],
    /// Starts of the axes, in metres.
    starts: [Lanes; 3],
    /// Vectors from there to their ends, in metres.
    axes: [Lanes; 3],
    /// Reciprocals of the axes' squared lengths.
    inverse_squares: Lanes,
    start_radii: Lanes,
    /// End radius less start radius.
    rises: Lanes,
}

/// Squared distances of a point from the axes of the solids, with the feet of its perpendiculars clamped to the ends.
struct AxisDistances {
    squares: Lanes,
    /// The feet, from 0 at the start to 1 at the end.
    along: Lanes,
}

/// Squared distances of a group of spheres' centres from the axis of one solid, as in [`AxisDistances`].
struct SphereAxisDistances {
    squares: [f32; SPHERES],
    /// The solid's radii at the feet.
    radii: [f32; SPHERES],
}

impl PreparedHand {
    /// Prepares a hand, in less than a microsecond.
    pub fn new(giver: &TrackedSolids) -> Self {
        let all = giver.to_array();
        Self::of(&COLLISION_ORDER.map(|solid| Bounded::new(all[solid])))
    }

    /// Prepares balls inside a mesh: distances from them are upper bounds of those from the mesh.
    pub(crate) fn inside(mesh: &HandMesh) -> Self {
        // Without volume, a point of the surface.
        let point = mesh.surface.mesh().corners(0)[0];
        let mut balls = [TaperedCapsule::new(point, point, 0.0, 0.0); TrackedSolids::COUNT];
        for (place, ball) in balls.iter_mut().zip(&mesh.balls) {
            *place = TaperedCapsule::new(ball.centre, ball.centre, ball.radius, ball.radius);
        }
        Self::of(&balls.map(Bounded::new))
    }

    fn of(solids: &[Bounded; TrackedSolids::COUNT]) -> Self {
        let mut prepared = Self {
            solids: *solids,
            starts: [[0.0; LANES]; 3],
            axes: [[0.0; LANES]; 3],
            inverse_squares: [0.0; LANES],
            start_radii: [0.0; LANES],
            rises: [0.0; LANES],
        };
        for i in 0..LANES {
            // The padding repeats the last solid, which changes nothing.
            let solid = &solids[i.min(TrackedSolids::COUNT - 1)].solid;
            let axis_vector = solid.end - solid.start;
            for axis in 0..3 {
                prepared.starts[axis][i] = solid.start[axis];
                prepared.axes[axis][i] = axis_vector[axis];
            }
            let square = solid.start.distance_squared(solid.end);
            prepared.inverse_squares[i] = square.max(f32::MIN_POSITIVE).recip();
            prepared.start_radii[i] = solid.start_radius;
            prepared.rises[i] = solid.end_radius - solid.start_radius;
        }
        prepared
    }

    /// Its solids, in the order of comparison.
    pub fn iter(&self) -> impl Iterator<Item = &TaperedCapsule> {
        self.solids.iter().map(|bounded| &bounded.solid)
    }

    /// True only if a sphere comes closer to the hand than `distance` metres; near that distance it may be false
    /// regardless.
    #[inline]
    pub fn certainly_within(&self, centre: Vec3, radius: f32, distance: f32) -> bool {
        let AxisDistances { squares, along } = self.axis_distances(centre);
        let reach = radius + distance - ROUNDING;
        let mut nears = 0_u32;
        for i in 0..LANES {
            // The sphere around the foot is part of the solid.
            let reach = (reach + self.start_radii[i] + self.rises[i] * along[i]).max(0.0);
            nears |= u32::from(squares[i] < reach * reach);
        }
        nears != 0
    }

    /// An upper bound on the distance of a point from the hand's skin in metres, negative inside; tight for solids
    /// that taper like a hand's.
    #[inline]
    pub fn point_distance_upper_bound(&self, point: Vec3) -> f32 {
        let AxisDistances { squares, along } = self.axis_distances(point);
        let mut distances = [0.0; LANES];
        for i in 0..LANES {
            distances[i] = squares[i].sqrt() - (self.start_radii[i] + self.rises[i] * along[i]);
        }
        least_of(&distances)
    }

    /// True only if one of the spheres comes closer to the hand than `distance` metres; near that distance it may be
    /// false regardless. Takes some 20 ns if the first solids decide.
    #[inline]
    pub fn any_certainly_within(&self, spheres: &Spheres, distance: f32) -> bool {
        let mut reaches = spheres.radii;
        for reach in &mut reaches {
            *reach += distance - ROUNDING;
        }
        (0..LANES).step_by(SOLIDS_AT_ONCE).any(|first| {
            let nears = self.near_group(first, spheres, &reaches);
            nears.iter().fold(0, |any, near| any | near) != 0
        })
    }

    /// Upper bounds on the distance of each sphere from the hand, in metres.
    #[inline]
    pub fn distance_upper_bounds(&self, spheres: &Spheres) -> [f32; SPHERES] {
        let mut least = [f32::INFINITY; SPHERES];
        for k in 0..BOUNDING_SOLIDS {
            let SphereAxisDistances { squares, radii } = self.sphere_axis_distances(k, spheres);
            for i in 0..SPHERES {
                let distance = squares[i].sqrt() - (spheres.radii[i] + radii[i]);
                least[i] = if distance < least[i] { distance } else { least[i] };
            }
        }
        for distance in &mut least {
            *distance += ROUNDING;
        }
        least
    }

    /// True if any of the solids comes closer to the hand than `distance` metres.
    pub fn comes_within<'a>(
        &self,
        solids: impl Iterator<Item = &'a TaperedCapsule> + Clone,
        distance: f32,
    ) -> bool {
        let middle_nears =
            |solid: &TaperedCapsule| self.certainly_within(solid.at(0.5), solid.radius_at(0.5), distance);
        solids.clone().any(middle_nears) || self.least_distance(solids, distance, distance).is_none()
    }

    /// The distance of another hand in metres, if it is at least `required`.
    pub fn clearance(&self, other: &TrackedSolids, required: f32) -> Option<f32> {
        // From the middle of each solid: an upper bound on the smallest distance, and a lower bound for each pair.
        let mut bounds = [f32::INFINITY; LANES];
        let mut lower_bounds = [[0.0; LANES]; TrackedSolids::COUNT];
        for (our, lower_bounds) in other.iter().zip(&mut lower_bounds) {
            let AxisDistances { squares, along } = self.axis_distances(our.at(0.5));
            let radius = our.radius_at(0.5);
            let around = 0.5 * our.length() + our.start_radius.max(our.end_radius) + ROUNDING;
            for i in 0..LANES {
                let to_axis = squares[i].sqrt();
                let distance = to_axis - (radius + self.start_radii[i] + self.rises[i] * along[i]);
                bounds[i] = if distance < bounds[i] { distance } else { bounds[i] };
                lower_bounds[i] = to_axis - (around + self.start_radii[i] + self.rises[i].max(0.0));
            }
        }
        let mut least = least_of(&bounds) + ROUNDING;
        if least < required {
            return None;
        }
        // Of the remaining pairs, a better direction leaves one or two.
        for (our, lower_bounds) in other.iter().zip(&lower_bounds) {
            for (group, group_bounds) in lower_bounds.as_chunks::<GROUP>().0.iter().enumerate() {
                if group_bounds
                    .iter()
                    .fold(0, |any, bound| any | u32::from(*bound <= least))
                    == 0
                {
                    continue;
                }
                let pair_bounds = self.distance_lower_bounds(our, group);
                let theirs = self.solids.iter().skip(group * GROUP);
                for (their, bound) in theirs.zip(pair_bounds) {
                    if bound <= least {
                        least = least.min(our.distance(&their.solid));
                    }
                    if least < required {
                        return None;
                    }
                }
            }
        }
        Some(least)
    }

    /// Lower bounds, in metres, on the distance of a group of the solids from another one: gaps between their projections along
    /// the direction between nearly nearest points of the axes.
    #[inline]
    fn distance_lower_bounds(&self, our: &TaperedCapsule, group: usize) -> [f32; GROUP] {
        let of = |lanes: &Lanes| lanes.as_chunks::<GROUP>().0[group];
        let [sx, sy, sz] = self.starts.each_ref().map(of);
        let [ax, ay, az] = self.axes.each_ref().map(of);
        let (inverse_squares, start_radii, rises) =
            (of(&self.inverse_squares), of(&self.start_radii), of(&self.rises));
        let (middle, axis) = (our.at(0.5), our.end - our.start);
        let inverse_square = axis.length_squared().max(f32::MIN_POSITIVE).recip();
        let rise = our.end_radius - our.start_radius;
        let mut kept = [0.0; GROUP];
        for i in 0..GROUP {
            // The foot of our middle on their axis, its foot on ours, and the foot of that on theirs again.
            let (x, y, z) = (middle.x - sx[i], middle.y - sy[i], middle.z - sz[i]);
            let t = ((x * ax[i] + y * ay[i] + z * az[i]) * inverse_squares[i]).clamp(0.0, 1.0);
            let (x, y, z) = (our.start.x - sx[i], our.start.y - sy[i], our.start.z - sz[i]);
            let (fx, fy, fz) = (x - ax[i] * t, y - ay[i] * t, z - az[i] * t);
            let u = -(fx * axis.x + fy * axis.y + fz * axis.z) * inverse_square;
            let u = u.clamp(0.0, 1.0);
            let (px, py, pz) = (x + axis.x * u, y + axis.y * u, z + axis.z * u);
            let t = ((px * ax[i] + py * ay[i] + pz * az[i]) * inverse_squares[i]).clamp(0.0, 1.0);

            let (nx, ny, nz) = (px - ax[i] * t, py - ay[i] * t, pz - az[i] * t);
            let square = nx * nx + ny * ny + nz * nz;
            let inverse = square.max(f32::MIN_POSITIVE).sqrt().recip();
            let (nx, ny, nz) = (nx * inverse, ny * inverse, nz * inverse);
            // Each solid is the hull of the spheres at its ends; coordinates along the direction, relative to their
            // start.
            let our_start = x * nx + y * ny + z * nz - our.start_radius;
            let our_end = our_start + axis.x * nx + axis.y * ny + axis.z * nz - rise;
            let their_end = ax[i] * nx + ay[i] * ny + az[i] * nz + rises[i];
            kept[i] = our_start.min(our_end) - start_radii[i] - their_end.max(0.0) - ROUNDING;
        }
        kept
    }

    /// The smallest distance of some solids from the hand in metres, or `enough` if it is larger; `None` if it is
    /// below `required`.
    pub fn least_distance<'a>(
        &self,
        solids: impl Iterator<Item = &'a TaperedCapsule>,
        enough: f32,
        required: f32,
    ) -> Option<f32> {
        let mut least = enough;
        for solid in solids {
            let our = Bounded::new(*solid);
            let AxisDistances { squares, .. } = self.axis_distances(our.centre);
            let mut is_near = [false; LANES];
            for i in 0..LANES {
                let thickest = self.start_radii[i] + self.rises[i].max(0.0);
                let reach = (least + our.radius + thickest + ROUNDING).max(0.0);
                is_near[i] = squares[i] <= reach * reach;
            }
            for (their, _) in self.solids.iter().zip(is_near).filter(|(_, near)| *near) {
                if !our.is_beyond(their, least) {
                    least = least.min(our.solid.distance(&their.solid));
                    if least < required {
                        return None;
                    }
                }
            }
        }
        Some(least)
    }

    /// For each sphere, 1 if its centre is certainly within its reach of one of the [`SOLIDS_AT_ONCE`] solids from `first`.
    #[inline]
    fn near_group(&self, first: usize, spheres: &Spheres, reaches: &[f32; SPHERES]) -> [u32; SPHERES] {
        let mut nears = [0; SPHERES];
        for k in first..first + SOLIDS_AT_ONCE {
            let SphereAxisDistances { squares, radii } = self.sphere_axis_distances(k, spheres);
            for i in 0..SPHERES {
                // As in `certainly_within`.
                let reach = (reaches[i] + radii[i]).max(0.0);
                nears[i] |= u32::from(squares[i] < reach * reach);
            }
        }
        nears
    }

    #[inline]
    fn axis_distances(&self, point: Vec3) -> AxisDistances {
        let (mut squares, mut along) = ([0.0; LANES], [0.0; LANES]);
        let ([sx, sy, sz], [ax, ay, az]) = (&self.starts, &self.axes);
        for i in 0..LANES {
            let (x, y, z) = (point.x - sx[i], point.y - sy[i], point.z - sz[i]);
            let t = (x * ax[i] + y * ay[i] + z * az[i]) * self.inverse_squares[i];
            let t = t.clamp(0.0, 1.0);
            let (x, y, z) = (x - ax[i] * t, y - ay[i] * t, z - az[i] * t);
            squares[i] = x * x + y * y + z * z;
            along[i] = t;
        }
        AxisDistances { squares, along }
    }

    #[inline]
    fn sphere_axis_distances(&self, k: usize, spheres: &Spheres) -> SphereAxisDistances {
        let [xs, ys, zs] = &spheres.centres;
        let ([sx, sy, sz], [ax, ay, az]) = (&self.starts, &self.axes);
        let (mut squares, mut radii) = ([0.0; SPHERES], [0.0; SPHERES]);
        for i in 0..SPHERES {
            let (x, y, z) = (xs[i] - sx[k], ys[i] - sy[k], zs[i] - sz[k]);
            let t = (x * ax[k] + y * ay[k] + z * az[k]) * self.inverse_squares[k];
            let t = t.clamp(0.0, 1.0);
            let (x, y, z) = (x - ax[k] * t, y - ay[k] * t, z - az[k] * t);
            squares[i] = x * x + y * y + z * z;
            radii[i] = self.start_radii[k] + self.rises[k] * t;
        }
        SphereAxisDistances { squares, radii }
    }
}

/// The smallest of some values, by groups: a sequential minimum would take as long as computing them.
#[inline]
fn least_of(numbers: &Lanes) -> f32 {
    let mut least = [f32::INFINITY; GROUP];
    for group in numbers.as_chunks::<GROUP>().0 {
        for k in 0..GROUP {
            least[k] = if group[k] < least[k] { group[k] } else { least[k] };
        }
    }
    least.into_iter().fold(f32::INFINITY, f32::min)
}

/// Indices of [`TrackedSolids::iter`].
#[rustfmt::skip]
pub(super) const COLLISION_ORDER: [usize; TrackedSolids::COUNT] = [
    2, 10, 4, 18, 8, 30, 14, 25, 11, 5, 3, 12, 29, 22, 1, 6, 15, 33, 26, 7,
    13, 0, 23, 24, 27, 9, 16, 17, 19, 20, 21, 28, 31, 32, 34, 35, 36, 37, 38, 39,
];

/// Spheres per group: one register of single precision; a group takes two cache lines.
pub const SPHERES: usize = 8;

/// Eight spheres.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(align(128))]
pub struct Spheres {
    /// Coordinates of the centres, in metres.
    pub(super) centres: [[f32; SPHERES]; 3],
    /// The radii in metres.
    pub(super) radii: [f32; SPHERES],
}

impl Spheres {
    /// Spheres from a function of their index that returns centre and radius in metres.
    #[inline]
    pub fn new(sphere: impl Fn(usize) -> (Vec3, f32)) -> Self {
        let mut spheres = Self::default();
        // A loop, because mapped arrays are not inlined.
        for i in 0..SPHERES {
            let (centre, radius) = sphere(i);
            for axis in 0..3 {
                spheres.centres[axis][i] = centre[axis];
            }
            spheres.radii[i] = radius;
        }
        spheres
    }

    /// Packs spheres into groups of eight, padded with spheres that are near nothing.
    pub fn of_all<const GROUPS: usize>(spheres: &[(Vec3, f32)]) -> [Self; GROUPS] {
        debug_assert!(
            spheres.len() <= GROUPS * SPHERES,
            "{} spheres do not fit",
            spheres.len()
        );
        let padding = (Vec3::ZERO, f32::NEG_INFINITY);
        std::array::from_fn(|group| {
            Self::new(|i| spheres.get(group * SPHERES + i).copied().unwrap_or(padding))
        })
    }

    /// The centres and radii, in metres.
    pub fn iter(&self) -> impl Iterator<Item = (Vec3, f32)> {
        let [xs, ys, zs] = &self.centres;
        (0..SPHERES).map(|i| (Vec3::new(xs[i], ys[i], zs[i]), self.radii[i]))
    }

    /// The spheres for which `is_kept` is true; the others are replaced by ones that are near nothing.
    #[must_use]
    pub fn kept(mut self, is_kept: impl Fn(usize) -> bool) -> Self {
        for (i, radius) in self.radii.iter_mut().enumerate() {
            if !is_kept(i) {
                *radius = f32::NEG_INFINITY;
            }
        }
        self
    }

    /// The same spheres in another frame, or under a rigid motion.
    #[must_use]
    pub fn transformed(&self, a_from_b: Pose) -> Self {
        let [x_axis, y_axis, z_axis] = Mat3::from_quat(a_from_b.orientation).to_cols_array_2d();
        let [xs, ys, zs] = &self.centres;
        let mut moved = *self;
        for axis in 0..3 {
            let from = a_from_b.position[axis];
            for i in 0..SPHERES {
                moved.centres[axis][i] =
                    from + x_axis[axis] * xs[i] + y_axis[axis] * ys[i] + z_axis[axis] * zs[i];
            }
        }
        moved
    }
}
