//! A giver's hand prepared for being compared with many others, coordinate by coordinate: one ball is compared with all of
//! its solids at once.

use glam::Vec3;

use super::{
    TaperedCapsule, TrackedSolids,
    hand_clearance::Bounded,
    spheres::{SPHERES, Spheres},
};

/// Solids that are compared at once: those of a giver, filled up to whole registers.
const LANES: usize = TrackedSolids::COUNT.next_multiple_of(8);

/// The solids of a giver, indices of [`TrackedSolids::iter`], in the order in which they settle most: each is the one that
/// met most of the receiving hands that those before it did not, of 933,479 known grips of the built-in objects that meet
/// a recorded giver and are not [excluded](crate::known::atlas::Atlas::excluded_by) before. The first four meet 79 % of them,
/// eight 95 %.
const MET_FIRST: [usize; TrackedSolids::COUNT] = [
    8, 2, 18, 5, 15, 11, 29, 6, 13, 25, 17, 30, 3, 14, 12, 1, 16, 22, 7, 26, 4, 9, 39, 21, 20, 10, 24, 19,
    23, 37, 34, 31, 38, 36, 33, 32, 27, 0, 28, 35,
];

/// Solids of a hand that one solid is compared with at once: a register's worth of single precision.
const GROUP: usize = 8;

/// Solids that some balls are compared with before it is asked whether that settled it. Fewer ask more often, more
/// compare in vain: a look-up takes a tenth longer with four, and a fifth to a half with twenty.
const SOLIDS_AT_ONCE: usize = 8;

/// Solids that tell how far a hand is at most. With eight, more hands have to be compared exactly, and finding those that are
/// least in a giver's way takes a quarter longer; with 24, it takes as long.
const SETTLING: usize = 16;

/// More than what single precision makes of distances within reach of an arm, in metres: what is decided at once is right
/// by that much, and the rest is left to exact distances.
const ROUNDING: f32 = 2e-6;

/// One number of each solid.
type Lanes = [f32; LANES];

/// The solids of a giver's hand, which stays where it is while others are compared with it.
#[derive(Clone, Debug)]
pub struct PreparedHand {
    solids: [Bounded; TrackedSolids::COUNT],
    /// Starts of the axes, in metres.
    seeds: [Lanes; 3],
    /// From there to their ends.
    axes: [Lanes; 3],
    /// One over the axes' squared lengths.
    inverse_squares: Lanes,
    start_radii: Lanes,
    /// End radius less start radius.
    rises: Lanes,
}

/// What a point is from the axes of a hand's solids, the foot of its perpendicular cut off at the ends.
struct ToAxes {
    squares: Lanes,
    /// The feet, from 0 at the start to 1 at the end.
    along: Lanes,
}

/// What some balls' middles are from the axis of one solid, as [`ToAxes`].
struct ToAxis {
    squares: [f32; SPHERES],
    /// The solid's radii at the feet.
    radii: [f32; SPHERES],
}

impl PreparedHand {
    /// Prepares a hand: below a microsecond.
    pub fn new(giver: &TrackedSolids) -> Self {
        Self::in_order(giver, &MET_FIRST)
    }

    /// The same with its solids compared in the order of [`TrackedSolids::iter`].
    pub(crate) fn in_anatomical_order(giver: &TrackedSolids) -> Self {
        Self::in_order(giver, &std::array::from_fn(|solid| solid))
    }

    fn in_order(giver: &TrackedSolids, order: &[usize; TrackedSolids::COUNT]) -> Self {
        let all = giver.to_array();
        let mut solids = [Bounded::new(all[0]); TrackedSolids::COUNT];
        for (place, &solid) in solids.iter_mut().zip(order) {
            *place = Bounded::new(all[solid]);
        }
        let mut prepared = Self {
            solids,
            seeds: [[0.0; LANES]; 3],
            axes: [[0.0; LANES]; 3],
            inverse_squares: [0.0; LANES],
            start_radii: [0.0; LANES],
            rises: [0.0; LANES],
        };
        for i in 0..LANES {
            // The rest repeats the last solid, which changes nothing.
            let solid = &solids[i.min(TrackedSolids::COUNT - 1)].solid;
            let way = solid.end - solid.start;
            for axis in 0..3 {
                prepared.seeds[axis][i] = solid.start[axis];
                prepared.axes[axis][i] = way[axis];
            }
            let square = solid.start.distance_squared(solid.end);
            prepared.inverse_squares[i] = square.max(f32::MIN_POSITIVE).recip();
            prepared.start_radii[i] = solid.start_radius;
            prepared.rises[i] = solid.end_radius - solid.start_radius;
        }
        prepared
    }

    /// Its solids, those first that most other hands meet.
    pub fn iter(&self) -> impl Iterator<Item = &TaperedCapsule> {
        self.solids.iter().map(|bounded| &bounded.solid)
    }

    /// True only if a ball comes nearer to the hand than `distance` metres; not always then.
    #[inline]
    pub fn surely_nears(&self, middle: Vec3, radius: f32, distance: f32) -> bool {
        let ToAxes { squares, along } = self.to_axes(middle);
        let reach = radius + distance - ROUNDING;
        let mut nears = 0_u32;
        for i in 0..LANES {
            // The ball around the foot is one of those that the solid is made of.
            let reach = (reach + self.start_radii[i] + self.rises[i] * along[i]).max(0.0);
            nears |= u32::from(squares[i] < reach * reach);
        }
        nears != 0
    }

    /// Metres that a point is at most from the hand's skin, and hardly less where solids taper as a hand's do; below 0
    /// inside.
    #[inline]
    pub fn point_distance_upper_bound(&self, point: Vec3) -> f32 {
        let ToAxes { squares, along } = self.to_axes(point);
        let mut distances = [0.0; LANES];
        for i in 0..LANES {
            distances[i] = squares[i].sqrt() - (self.start_radii[i] + self.rises[i] * along[i]);
        }
        least_of(&distances)
    }

    /// True only if one of some balls comes nearer to the hand than `distance` metres; not always then. Some 20 ns where
    /// the first solids settle it.
    #[inline]
    pub fn surely_nears_any(&self, spheres: &Spheres, distance: f32) -> bool {
        let mut reaches = spheres.radii;
        for reach in &mut reaches {
            *reach += distance - ROUNDING;
        }
        (0..LANES).step_by(SOLIDS_AT_ONCE).any(|first| {
            let nears = self.near_some(first, spheres, &reaches);
            nears.iter().fold(0, |any, near| any | near) != 0
        })
    }

    /// Which of some balls surely come nearer to the hand than `distance` metres, a bit each; only some of them if those
    /// settle it.
    #[inline]
    pub fn surely_near(&self, spheres: &Spheres, distance: f32, is_settled: impl Fn(u8) -> bool) -> u8 {
        let mut reaches = spheres.radii;
        for reach in &mut reaches {
            *reach += distance - ROUNDING;
        }
        let mut near = 0_u8;
        for first in (0..LANES).step_by(SOLIDS_AT_ONCE) {
            let nears = self.near_some(first, spheres, &reaches);
            let bits = nears
                .iter()
                .enumerate()
                .map(|(ball, &nears)| (nears as u8) << ball);
            near |= bits.fold(0, |bits, bit| bits | bit);
            if is_settled(near) {
                break;
            }
        }
        near
    }

    /// Metres that each of some balls is at most from the hand.
    #[inline]
    pub fn distance_upper_bounds(&self, spheres: &Spheres) -> [f32; SPHERES] {
        let mut least = [f32::INFINITY; SPHERES];
        for k in 0..SETTLING {
            let ToAxis { squares, radii } = self.to_axis(k, spheres);
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

    /// True if any of some solids comes nearer to the hand than `distance` metres.
    pub fn is_neared_by<'a>(
        &self,
        solids: impl Iterator<Item = &'a TaperedCapsule> + Clone,
        distance: f32,
    ) -> bool {
        let middle_nears =
            |solid: &TaperedCapsule| self.surely_nears(solid.at(0.5), solid.radius_at(0.5), distance);
        solids.clone().any(middle_nears) || self.least_distance(solids, distance, distance).is_none()
    }

    /// The smallest distance of another hand in metres, if it is at least `required`.
    pub fn clearance(&self, other: &TrackedSolids, required: f32) -> Option<f32> {
        // Middle by middle, a distance that the smallest does not exceed, and for each pair one that it surely keeps.
        let mut bounds = [f32::INFINITY; LANES];
        let mut sure = [[0.0; LANES]; TrackedSolids::COUNT];
        for (our, sure) in other.iter().zip(&mut sure) {
            let ToAxes { squares, along } = self.to_axes(our.at(0.5));
            let radius = our.radius_at(0.5);
            let around = 0.5 * our.length() + our.start_radius.max(our.end_radius) + ROUNDING;
            for i in 0..LANES {
                let to_axis = squares[i].sqrt();
                let distance = to_axis - (radius + self.start_radii[i] + self.rises[i] * along[i]);
                bounds[i] = if distance < bounds[i] { distance } else { bounds[i] };
                sure[i] = to_axis - (around + self.start_radii[i] + self.rises[i].max(0.0));
            }
        }
        let mut least = least_of(&bounds) + ROUNDING;
        if least < required {
            return None;
        }
        // Of the pairs that this leaves, one or two are left by what a better direction shows.
        for (our, sure) in other.iter().zip(&sure) {
            for (group, sure) in sure.as_chunks::<GROUP>().0.iter().enumerate() {
                if sure.iter().fold(0, |any, sure| any | u32::from(*sure <= least)) == 0 {
                    continue;
                }
                let kept = self.kept_distances(our, group);
                let theirs = self.solids.iter().skip(group * GROUP);
                for (their, kept) in theirs.zip(kept) {
                    if kept <= least {
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

    /// Distances in metres that a group of the solids surely keep from another one.
    ///
    /// Whatever the direction, two convex solids are at least as far apart as what they take up along it. The way between
    /// about the nearest points of their axes is a direction that shows nearly the whole distance.
    #[inline]
    fn kept_distances(&self, our: &TaperedCapsule, group: usize) -> [f32; GROUP] {
        let of = |lanes: &Lanes| lanes.as_chunks::<GROUP>().0[group];
        let [sx, sy, sz] = self.seeds.each_ref().map(of);
        let [ax, ay, az] = self.axes.each_ref().map(of);
        let (inverse_squares, start_radii, rises) =
            (of(&self.inverse_squares), of(&self.start_radii), of(&self.rises));
        let (middle, axis) = (our.at(0.5), our.end - our.start);
        let inverse_square = axis.length_squared().max(f32::MIN_POSITIVE).recip();
        let rise = our.end_radius - our.start_radius;
        let mut kept = [0.0; GROUP];
        for i in 0..GROUP {
            // The foot of our middle on their axis, its foot on ours, and that one's on theirs again.
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
            // Both are the hulls of their balls at the ends; from their start, along the direction.
            let our_start = x * nx + y * ny + z * nz - our.start_radius;
            let our_end = our_start + axis.x * nx + axis.y * ny + axis.z * nz - rise;
            let their_end = ax[i] * nx + ay[i] * ny + az[i] * nz + rises[i];
            kept[i] = our_start.min(our_end) - start_radii[i] - their_end.max(0.0) - ROUNDING;
        }
        kept
    }

    /// The smallest distance of some solids in metres, or `enough` if it is more than that; none if it is below
    /// `required`.
    pub fn least_distance<'a>(
        &self,
        solids: impl Iterator<Item = &'a TaperedCapsule>,
        enough: f32,
        required: f32,
    ) -> Option<f32> {
        let mut least = enough;
        for solid in solids {
            let our = Bounded::new(*solid);
            let ToAxes { squares, .. } = self.to_axes(our.centre);
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

    /// For each of some balls, 1 if it surely comes nearer to one of the solids from `first` on, [`SOLIDS_AT_ONCE`], than how
    /// far it reaches.
    #[inline]
    fn near_some(&self, first: usize, spheres: &Spheres, reaches: &[f32; SPHERES]) -> [u32; SPHERES] {
        let mut nears = [0; SPHERES];
        for k in first..first + SOLIDS_AT_ONCE {
            let ToAxis { squares, radii } = self.to_axis(k, spheres);
            for i in 0..SPHERES {
                // As in `surely_nears`.
                let reach = (reaches[i] + radii[i]).max(0.0);
                nears[i] |= u32::from(squares[i] < reach * reach);
            }
        }
        nears
    }

    #[inline]
    fn to_axes(&self, point: Vec3) -> ToAxes {
        let (mut squares, mut along) = ([0.0; LANES], [0.0; LANES]);
        let ([sx, sy, sz], [ax, ay, az]) = (&self.seeds, &self.axes);
        for i in 0..LANES {
            let (x, y, z) = (point.x - sx[i], point.y - sy[i], point.z - sz[i]);
            let t = (x * ax[i] + y * ay[i] + z * az[i]) * self.inverse_squares[i];
            let t = t.clamp(0.0, 1.0);
            let (x, y, z) = (x - ax[i] * t, y - ay[i] * t, z - az[i] * t);
            squares[i] = x * x + y * y + z * z;
            along[i] = t;
        }
        ToAxes { squares, along }
    }

    #[inline]
    fn to_axis(&self, k: usize, spheres: &Spheres) -> ToAxis {
        let [xs, ys, zs] = &spheres.middles;
        let ([sx, sy, sz], [ax, ay, az]) = (&self.seeds, &self.axes);
        let (mut squares, mut radii) = ([0.0; SPHERES], [0.0; SPHERES]);
        for i in 0..SPHERES {
            let (x, y, z) = (xs[i] - sx[k], ys[i] - sy[k], zs[i] - sz[k]);
            let t = (x * ax[k] + y * ay[k] + z * az[k]) * self.inverse_squares[k];
            let t = t.clamp(0.0, 1.0);
            let (x, y, z) = (x - ax[k] * t, y - ay[k] * t, z - az[k] * t);
            squares[i] = x * x + y * y + z * z;
            radii[i] = self.start_radii[k] + self.rises[k] * t;
        }
        ToAxis { squares, radii }
    }
}

/// The least of some numbers: group by group, as one after the other takes as long as finding them.
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
