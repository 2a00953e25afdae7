//! The shape of the part of a mesh that a hand holds: how flat, long or round it is there.

use std::ops::{Add, AddAssign, Mul};

use glam::{Vec3, Vec3A, Vec3Swizzles, Vec4};

use super::surface_samples::SurfaceSample;

/// Most samples in a patch. Smaller patches follow the surface better, but each look-up visits all of them.
const PATCH_SAMPLES: usize = 16;

/// Distance in metres that counts as much as a unit of difference between normals when samples are grouped.
const NORMAL_LENGTH: f32 = 0.02;

/// Distance from the centre, as a multiple of the radius, at which a patch's weight reaches 0.
const FADED: f32 = 1.4;

/// Height of a patch over the centre, as a share of the radius, above which it faces away from the centre.
const TURNED: f32 = 0.02;

/// Smallest variance of unit normals for a full [`Part::sphericity`]: that of a cap of 16°. Less shows no curvature.
const MIN_NORMAL_VARIANCE: f32 = 0.02;

/// Distance in metres from a touched point at which a quarter of a patch's weight is left: the width of a fingertip.
const TOUCHED: f32 = 0.015;

/// Cosine between the normals of a touched point and a patch up to which the patch is on another side of the object.
const OTHER_SIDE: f32 = 0.3;

/// Squared lengths of a patch's mean normal up to which it spans an edge, such as the rim of a can, and from which it is smooth.
const EDGE: [f32; 2] = [0.8, 0.9];

/// Number of touched points on a patch that counts as none: that of one point about 4 cm away.
const NEGLIGIBLE: f32 = 0.01;

/// Groups of samples of a mesh that lie and face alike.
#[derive(Clone, Debug, Default)]
pub struct LocalShape {
    patches: Vec<Patch>,
}

/// A piece of the surface.
#[derive(Clone, Copy, Debug)]
struct Patch {
    /// Mean position.
    position: Vec3A,
    /// Mean normal; shorter than 1 if the patch is curved.
    normal: Vec3A,
    /// Number of samples, a measure of area.
    weight: f32,
    /// Covariance of positions, in m².
    spread: Symmetric,
    /// Second moments of the normals about zero.
    facing: Symmetric,
    /// Symmetric part of the covariance between positions and normals, in metres.
    bulge: Symmetric,
}

/// The part of a mesh around a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Part {
    /// Standard deviations of the surface along its principal axes, in metres, descending. A wide sheet's last is half its
    /// thickness, a long rod's last two are its radius over √2.
    pub spreads: [f32; 3],
    /// How well a sphere fits, 0 to 1: the squared correlation of positions and normals. 1 for any piece of a ball, 0.6 for a
    /// cube, at most 0.75 for cylinders with or without caps, near 0 for long rods and sheets.
    pub sphericity: f32,
    /// Covariance of the surface's points, in m².
    pub spread: Symmetric,
    /// Second moments of the unit normals; their trace is 1.
    pub facing: Symmetric,
}

/// How a surface curves under some of its points. Its axis is the direction along which it curves least there.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Curvature {
    /// How well a circle fits across the axis, 0 to 1: the squared correlation of positions and normals, 1 for anything round,
    /// 0.75 for a square rod.
    pub roundness: f32,
    /// Curvature along the axis over that across it, 0 to 1: 0 for rods, 1 for balls. Edges do not count.
    pub along: f32,
}

/// A symmetric matrix.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Symmetric {
    /// xx, yy and zz.
    diagonal: Vec3A,
    /// yz, zx and xy.
    others: Vec3A,
}

impl LocalShape {
    /// Groups samples that are spread evenly over a mesh; takes a fifth of a millisecond.
    pub fn of(samples: &[SurfaceSample]) -> Self {
        let mut samples = samples.to_vec();
        let mut patches = Vec::with_capacity(2 * samples.len() / PATCH_SAMPLES);
        group(&mut samples, &mut patches);
        patches.shrink_to_fit();
        Self { patches }
    }

    /// The part of the mesh within a distance of a point, in metres; it fades out beyond. If there is none, the part next to
    /// the point. `None` if nothing was sampled.
    pub fn around(&self, centre: Vec3, radius: f32) -> Option<Part> {
        if self.patches.is_empty() {
            return None;
        }
        let centre = Vec3A::from(centre);
        let squared = self
            .patches
            .iter()
            .map(|patch| patch.position.distance_squared(centre));
        let radius = radius
            .max(squared.fold(f32::INFINITY, f32::min).sqrt())
            .max(f32::MIN_POSITIVE);
        let (per_radius, per_turn) = (1.0 / ((FADED - 1.0) * radius), 1.0 / (TURNED * radius));
        let out_of_reach = (FADED * radius).powi(2);
        let mut sum = Sum::default();
        for patch in &self.patches {
            let offset = patch.position - centre;
            let squared = offset.length_squared();
            if squared < out_of_reach {
                let beyond = (squared.sqrt() - radius).max(0.0) * per_radius;
                let height = offset.dot(patch.normal);
                let turn = (height * per_turn).clamp(-1.0, 1.0);
                sum.add(patch, offset, patch.weight * (1.0 - beyond), turn);
            }
        }
        Some(sum.part())
    }

    /// How the surface curves under some of its points, which lie within a distance of a centre, in metres, and whose normals
    /// point outward; flat if it is sampled nowhere near them.
    pub fn under(
        &self,
        centre: Vec3,
        radius: f32,
        points: impl IntoIterator<Item = SurfaceSample>,
    ) -> Curvature {
        let centre = Vec3A::from(centre);
        let points = TouchedPoints::new(points);
        let out_of_reach = (FADED * radius).powi(2);
        let mut sum = Sum::default();
        // Of the covariances within patches.
        let (mut spread, mut facing) = <(Symmetric, Symmetric)>::default();
        for patch in &self.patches {
            let offset = patch.position - centre;
            if offset.length_squared() < out_of_reach {
                let smooth = (patch.normal.length_squared() - EDGE[0]) / (EDGE[1] - EDGE[0]);
                let weight = points.nearness(patch) * smooth.clamp(0.0, 1.0);
                if weight > 0.0 {
                    sum.add(patch, offset, patch.weight * weight, 1.0);
                    spread += patch.spread * (patch.weight * weight);
                    facing +=
                        (patch.facing + Symmetric::square(patch.normal) * -1.0) * (patch.weight * weight);
                }
            }
        }
        sum.curvature(spread, facing)
    }

    /// Memory use in bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(self.patches.as_slice())
    }
}

/// Weighted sums over patches; positions are relative to the centre.
#[derive(Default)]
struct Sum {
    weight: f32,
    position: Vec3A,
    normal: Vec3A,
    spread: Symmetric,
    facing: Symmetric,
    bulge: Symmetric,
}

impl Sum {
    /// Adds a patch; `turn` of -1 turns it over.
    fn add(&mut self, patch: &Patch, offset: Vec3A, weight: f32, turn: f32) {
        self.weight += weight;
        self.position += offset * weight;
        self.normal += patch.normal * (weight * turn);
        self.spread += (patch.spread + Symmetric::square(offset)) * weight;
        self.facing += patch.facing * weight;
        self.bulge += (patch.bulge + Symmetric::product(offset, patch.normal)) * (weight * turn);
    }

    fn part(self) -> Part {
        let share = 1.0 / self.weight;
        let (position, normal) = (self.position * share, self.normal * share);
        let spread = self.spread * share + Symmetric::square(position) * -1.0;
        let facing = self.facing * share;
        let bulge = self.bulge.trace() * share - position.dot(normal);
        let normal_variance = (1.0 - normal.length_squared()).max(MIN_NORMAL_VARIANCE);
        let variance = spread.trace().max(f32::MIN_POSITIVE);
        Part {
            spreads: spread.eigenvalues().map(|variance| variance.max(0.0).sqrt()),
            sphericity: (bulge * bulge / (variance * normal_variance)).min(1.0),
            spread,
            facing,
        }
    }

    /// How the patches curve, given the sums of the covariances within them by the same weights.
    fn curvature(self, spread_within: Symmetric, facing_within: Symmetric) -> Curvature {
        if self.weight == 0.0 {
            return Curvature::default();
        }
        let share = 1.0 / self.weight;
        let (position, normal) = (self.position * share, self.normal * share);
        let [_, _, least] = facing_within.eigenvalues();
        let axis = facing_within.eigenvector(least).into();
        let parted = |covariance: Symmetric| {
            let along = covariance.between(axis, axis);
            (along.max(0.0), (covariance.trace() - along).max(0.0))
        };
        let (_, spread) = parted(self.spread * share + Symmetric::square(position) * -1.0);
        let (_, facing) = parted(self.facing * share + Symmetric::square(normal) * -1.0);
        let (_, bulge) = parted(self.bulge * share + Symmetric::product(position, normal) * -1.0);
        let (spread_along, spread_across) = parted(spread_within);
        let (facing_along, facing_across) = parted(facing_within);
        let ratio = facing_along * spread_across / (facing_across * spread_along).max(f32::MIN_POSITIVE);
        Curvature {
            roundness: (bulge * bulge / (spread * facing).max(f32::MIN_POSITIVE)).min(1.0),
            along: ratio.min(1.0).sqrt(),
        }
    }
}

/// Parts the samples along the axis of position or normal in which they differ most, until each group is a patch.
fn group(samples: &mut [SurfaceSample], patches: &mut Vec<Patch>) {
    if samples.len() <= PATCH_SAMPLES {
        patches.extend(Patch::of(samples));
        return;
    }
    let coordinates = |sample: &SurfaceSample| (sample.position, sample.normal * NORMAL_LENGTH);
    let (mut least, mut most) = (
        (Vec3::INFINITY, Vec3::INFINITY),
        (Vec3::NEG_INFINITY, Vec3::NEG_INFINITY),
    );
    for (position, normal) in samples.iter().map(coordinates) {
        least = (least.0.min(position), least.1.min(normal));
        most = (most.0.max(position), most.1.max(normal));
    }
    let (position_range, normal_range) = (most.0 - least.0, most.1 - least.1);
    let by_position = position_range.max_element() >= normal_range.max_element();
    let range = if by_position { position_range } else { normal_range };
    let axis = range.max_position();
    let key = |sample: &SurfaceSample| if by_position { sample.position } else { sample.normal }[axis];
    let middle = if by_position {
        let middle = samples.len() / 2;
        samples.select_nth_unstable_by(middle, |a, b| key(a).total_cmp(&key(b)));
        middle
    } else {
        // Halfway between the normals, so that the two sides of a wall part, however many samples each has.
        samples.sort_unstable_by(|a, b| key(a).total_cmp(&key(b)));
        let halfway = 0.5 * (key(&samples[0]) + key(&samples[samples.len() - 1]));
        let middle = samples.partition_point(|sample| key(sample) <= halfway);
        middle.clamp(1, samples.len() - 1)
    };
    let (low, high) = samples.split_at_mut(middle);
    group(low, patches);
    group(high, patches);
}

impl Patch {
    fn of(samples: &[SurfaceSample]) -> Option<Self> {
        let count = samples.len() as f32;
        let share = (count > 0.0).then(|| 1.0 / count)?;
        let mean = |of: fn(&SurfaceSample) -> Vec3| samples.iter().map(of).sum::<Vec3>() * share;
        let position = Vec3A::from(mean(|sample| sample.position));
        let normal = Vec3A::from(mean(|sample| sample.normal));
        let (mut spread, mut facing, mut bulge) = <(Symmetric, Symmetric, Symmetric)>::default();
        for sample in samples {
            let (offset, normal) = (Vec3A::from(sample.position) - position, sample.normal.into());
            spread += Symmetric::square(offset) * share;
            facing += Symmetric::square(normal) * share;
            bulge += Symmetric::product(offset, normal) * share;
        }
        Some(Self {
            position,
            normal,
            weight: count,
            spread,
            facing,
            bulge,
        })
    }
}

/// Most groups of touched points: enough for a contact on each link and the palm. Further points are ignored.
const MAX_GROUPS: usize = 4;

/// Points of a surface, in groups of four that are compared with a patch at once.
struct TouchedPoints {
    groups: [PointGroup; MAX_GROUPS],
    count: usize,
}

/// The coordinates of four points and of the normals there. By default, the normals are zero, so that no patch is near.
#[derive(Clone, Copy, Default)]
struct PointGroup {
    position: [Vec4; 3],
    normal: [Vec4; 3],
}

impl TouchedPoints {
    fn new(points: impl IntoIterator<Item = SurfaceSample>) -> Self {
        let mut groups = [PointGroup::default(); MAX_GROUPS];
        let mut count = 0;
        for (index, point) in points.into_iter().take(4 * MAX_GROUPS).enumerate() {
            let (group, lane) = (&mut groups[index / 4], index % 4);
            for axis in 0..3 {
                group.position[axis][lane] = point.position[axis];
                group.normal[axis][lane] = point.normal[axis];
            }
            count = index / 4 + 1;
        }
        Self { groups, count }
    }

    /// How many points are on a patch; those nearby count in part.
    fn nearness(&self, patch: &Patch) -> f32 {
        let (position, normal) = (patch.position.to_array(), patch.normal.to_array());
        let mut sum = Vec4::ZERO;
        for group in &self.groups[..self.count] {
            let (mut cosine, mut squared) = (Vec4::ZERO, Vec4::ZERO);
            for axis in 0..3 {
                cosine += group.normal[axis] * normal[axis];
                let offset = group.position[axis] - position[axis];
                squared += offset * offset;
            }
            let fraction = TOUCHED * TOUCHED / (squared + TOUCHED * TOUCHED);
            sum += (cosine - OTHER_SIDE).max(Vec4::ZERO) * fraction * fraction;
        }
        (sum.element_sum() - NEGLIGIBLE).max(0.0)
    }
}

impl Symmetric {
    /// The product of a vector with itself, v vᵀ.
    fn square(v: Vec3A) -> Self {
        Self {
            diagonal: v * v,
            others: v.yzx() * v.zxy(),
        }
    }

    /// The symmetric part of the product of two vectors, (a bᵀ + b aᵀ) / 2.
    fn product(a: Vec3A, b: Vec3A) -> Self {
        Self {
            diagonal: a * b,
            others: (a.yzx() * b.zxy() + a.zxy() * b.yzx()) * 0.5,
        }
    }

    fn trace(&self) -> f32 {
        self.diagonal.element_sum()
    }

    /// The product aᵀ M b.
    pub fn between(&self, a: Vec3, b: Vec3) -> f32 {
        let (a, b) = (Vec3A::from(a), Vec3A::from(b));
        let crossed = a.yzx() * b.zxy() + a.zxy() * b.yzx();
        self.diagonal.dot(a * b) + self.others.dot(crossed)
    }

    /// The eigenvalues, descending, in closed form (O. K. Smith, "Eigenvalues of a symmetric 3 × 3 matrix", 1961).
    fn eigenvalues(&self) -> [f32; 3] {
        let [xx, yy, zz] = self.diagonal.to_array().map(f64::from);
        let [yz, xz, xy] = self.others.to_array().map(f64::from);
        let mean = (xx + yy + zz) / 3.0;
        let [x, y, z] = [xx - mean, yy - mean, zz - mean];
        let off_diagonal = xy * xy + xz * xz + yz * yz;
        let scale = ((x * x + y * y + z * z + 2.0 * off_diagonal) / 6.0).sqrt();
        if scale == 0.0 {
            return [mean as f32; 3];
        }
        let determinant = x * (y * z - yz * yz) - xy * (xy * z - yz * xz) + xz * (xy * yz - y * xz);
        let angle = (0.5 * determinant / scale.powi(3)).clamp(-1.0, 1.0).acos() / 3.0;
        let first = mean + 2.0 * scale * angle.cos();
        let last = mean + 2.0 * scale * (angle + std::f64::consts::TAU / 3.0).cos();
        [first, 3.0 * mean - first - last, last].map(|value| value as f32)
    }

    /// The eigenvector of an eigenvalue, a unit vector; zero if all directions of a plane are eigenvectors.
    fn eigenvector(&self, value: f32) -> Vec3A {
        let [xx, yy, zz] = (self.diagonal - value).to_array();
        let [yz, xz, xy] = self.others.to_array();
        let [x, y, z] = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]].map(Vec3A::from);
        // All rows are perpendicular to it; the longest product is the most exact.
        let mut longest = x.cross(y);
        for product in [y.cross(z), z.cross(x)] {
            if product.length_squared() > longest.length_squared() {
                longest = product;
            }
        }
        longest.normalize_or_zero()
    }
}

impl Add for Symmetric {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            diagonal: self.diagonal + other.diagonal,
            others: self.others + other.others,
        }
    }
}

impl AddAssign for Symmetric {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Mul<f32> for Symmetric {
    type Output = Self;

    fn mul(self, factor: f32) -> Self {
        Self {
            diagonal: self.diagonal * factor,
            others: self.others * factor,
        }
    }
}
