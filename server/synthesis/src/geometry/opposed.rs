//! Distance between the closest places of a surface that can be pressed against each other.

use std::f32::consts::PI;

use glam::Vec3;

use super::{
    Segment,
    boxes::Aabb,
    closest::{distance_of_point, distance_of_segment, is_crossed},
    mesh::TriangleMesh,
};
use crate::base::stop::{Stop, Stopped};

/// Cosine of the angle from which two normals oppose each other: a right angle, to single precision.
const OPPOSED_COS: f32 = -1e-3;

/// Relative accuracy of the distance. Smaller values compare more of the many equal pairs of a round surface.
pub const OPPOSED_ACCURACY: f32 = 0.05;

/// Triangles in a leaf. More leaves take memory, larger ones more comparisons.
const LEAF: usize = 4;

/// Upper bound on the pairs of nodes compared, some tens of milliseconds of work.
const MAX_PAIRS: usize = 400_000;

/// Pairs compared between two polls of the stop signal.
const PAIRS_PER_CHECK: usize = 64;

/// A distance between opposed triangles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum OpposedDistance {
    /// Some are as close as required, or the search took too long.
    CloseOrUnknown,
    /// The closest are this far apart, in metres, within [`OPPOSED_ACCURACY`].
    Apart(f32),
    /// None are closer than the limit.
    BeyondLimit,
}

/// The distance between the closest two triangles, among those that `is_used` accepts, whose normals are more than a right
/// angle apart. The search ends at the first pair within `enough` metres, and ignores pairs beyond `limit` metres.
/// Meaningful for closed, consistently wound meshes.
///
/// # Errors
/// [`Stopped`].
pub fn opposed_distance(
    mesh: &TriangleMesh,
    is_used: impl Fn(u32) -> bool,
    enough: f32,
    limit: f32,
    stop: Stop<'_>,
) -> Result<OpposedDistance, Stopped> {
    let triangles: Vec<Triangle> = (0..mesh.triangles().len())
        .filter(|&triangle| is_used(triangle as u32))
        .map(|triangle| Triangle {
            corners: mesh.corners(triangle),
            normal: mesh.normal(triangle),
        })
        .collect();
    if triangles.is_empty() {
        return Ok(OpposedDistance::BeyondLimit);
    }
    stop.check()?;
    Tree::new(triangles).opposed_distance(enough, limit, stop)
}

/// A triangle with its normal.
#[derive(Clone, Copy, Debug)]
struct Triangle {
    corners: [Vec3; 3],
    normal: Vec3,
}

/// Part of the surface: its box, the cone of its normals, and its triangles or halves.
#[derive(Clone, Copy, Debug)]
struct Node {
    aabb: Aabb,
    axis: Vec3,
    /// Largest angle of a normal from the axis, in radians.
    half_angle: f32,
    /// Its triangles.
    first: usize,
    end: usize,
    /// Its halves; `None` in a leaf.
    halves: Option<[usize; 2]>,
}

/// A binary tree of a surface's parts, the root last.
struct Tree {
    triangles: Vec<Triangle>,
    nodes: Vec<Node>,
}

impl Triangle {
    fn centre(&self) -> Vec3 {
        let [a, b, c] = self.corners;
        (a + b + c) / 3.0
    }

    fn edges(&self) -> [Segment; 3] {
        let [a, b, c] = self.corners;
        [Segment::new(a, b), Segment::new(b, c), Segment::new(c, a)]
    }

    /// The distance of another triangle, in metres: at a corner, between two edges, or 0.
    fn distance(&self, other: &Self) -> f32 {
        if self
            .edges()
            .into_iter()
            .any(|edge| is_crossed(other.corners, edge))
        {
            return 0.0;
        }
        let of_edges = other.edges().map(|edge| distance_of_segment(self.corners, edge));
        let of_corners = self
            .corners
            .map(|corner| distance_of_point(other.corners, corner));
        of_edges
            .into_iter()
            .chain(of_corners)
            .fold(f32::INFINITY, f32::min)
    }
}

impl Tree {
    fn new(triangles: Vec<Triangle>) -> Self {
        let mut tree = Self {
            nodes: Vec::with_capacity(triangles.len()),
            triangles,
        };
        tree.add(0, tree.triangles.len());
        tree
    }

    /// Adds the node of a range of triangles, which it sorts, and those below it. The depth is logarithmic.
    fn add(&mut self, first: usize, end: usize) -> usize {
        let part = &mut self.triangles[first..end];
        let aabb = Aabb::around(part.iter().flat_map(|triangle| triangle.corners));
        let axis = part
            .iter()
            .map(|triangle| triangle.normal)
            .sum::<Vec3>()
            .normalize_or_zero();
        let half_angle = part
            .iter()
            .map(|triangle| angle_between(axis, triangle.normal))
            .fold(0.0, f32::max);
        let halves = (part.len() > LEAF).then(|| {
            let centres = Aabb::around(part.iter().map(Triangle::centre));
            let along = centres.extents().max_position();
            let middle = part.len() / 2;
            part.select_nth_unstable_by(middle, |a, b| a.centre()[along].total_cmp(&b.centre()[along]));
            first + middle
        });
        let halves = halves.map(|middle| [self.add(first, middle), self.add(middle, end)]);
        self.nodes.push(Node {
            aabb,
            axis,
            half_angle,
            first,
            end,
            halves,
        });
        self.nodes.len() - 1
    }

    fn opposed_distance(&self, enough: f32, limit: f32, stop: Stop<'_>) -> Result<OpposedDistance, Stopped> {
        let root = self.nodes.len() - 1;
        let mut best = limit;
        let mut pairs = vec![[root, root]];
        let mut compared = 0;
        while let Some([a, b]) = pairs.pop() {
            let (of_a, of_b) = (&self.nodes[a], &self.nodes[b]);
            let may_improve = box_distance(&of_a.aabb, &of_b.aabb) < best * (1.0 - OPPOSED_ACCURACY);
            if !may_improve || !of_a.may_oppose(of_b) {
                continue;
            }
            compared += 1;
            if compared > MAX_PAIRS {
                return Ok(OpposedDistance::CloseOrUnknown);
            }
            stop.check_every(PAIRS_PER_CHECK, compared)?;
            match (of_a.halves, of_b.halves) {
                (None, None) => {
                    best = best.min(self.least_distance(of_a, of_b));
                    if best <= enough {
                        return Ok(OpposedDistance::CloseOrUnknown);
                    }
                }
                (Some([c, d]), _) if a == b => pairs.extend([[c, c], [d, d], [c, d]]),
                (Some([c, d]), None) => pairs.extend([[c, b], [d, b]]),
                (Some([c, d]), Some(_)) if of_a.aabb.diagonal() >= of_b.aabb.diagonal() => {
                    pairs.extend([[c, b], [d, b]]);
                }
                (_, Some([c, d])) => pairs.extend([[a, c], [a, d]]),
            }
        }
        Ok(if best < limit {
            OpposedDistance::Apart(best)
        } else {
            OpposedDistance::BeyondLimit
        })
    }

    /// The least distance between opposed triangles of two leaves, in metres; infinite if none oppose.
    fn least_distance(&self, a: &Node, b: &Node) -> f32 {
        let mut least = f32::INFINITY;
        for ours in &self.triangles[a.first..a.end] {
            for theirs in &self.triangles[b.first..b.end] {
                if ours.normal.dot(theirs.normal) < OPPOSED_COS {
                    least = least.min(ours.distance(theirs));
                }
            }
        }
        least
    }
}

impl Node {
    /// False only if no normals of the two parts oppose each other.
    fn may_oppose(&self, other: &Self) -> bool {
        let widest = angle_between(self.axis, other.axis) + self.half_angle + other.half_angle;
        widest.min(PI).cos() < 0.5 * OPPOSED_COS
    }
}

/// The angle between two unit vectors, in radians; π if one is zero.
fn angle_between(a: Vec3, b: Vec3) -> f32 {
    if a == Vec3::ZERO || b == Vec3::ZERO {
        return PI;
    }
    f32::atan2(a.cross(b).length(), a.dot(b))
}

/// The distance between two boxes, in metres; 0 if they overlap.
fn box_distance(a: &Aabb, b: &Aabb) -> f32 {
    (a.min - b.max).max(b.min - a.max).max(Vec3::ZERO).length()
}
