//! The four-wide bounding volume hierarchy. The binary tree that obvhs builds is collapsed into nodes of four children
//! and packs of up to four triangles, so that one `Vec4` operation tests four boxes or four triangles (H. Dammertz, J.
//! Hanika, A. Keller: Shallow Bounding Volume Hierarchies for Fast SIMD Ray Tracing of Incoherent Rays, 2008).

use std::ops::Range;

use glam::{DVec3, Vec3, Vec3A, Vec4};
use obvhs::{
    aabb::Aabb as BuilderAabb,
    bvh2::{Bvh2, leaf_collapser::collapse, reinsertion::ReinsertionOptimizer},
    ploc::{PlocBuilder, PlocSearchDistance, SortPrecision},
};

use super::mesh::TriangleMesh;
use crate::base::stop::{Stop, Stopped};

/// Children per node and triangles per pack.
const WIDTH: usize = 4;

/// Entries of the traversal stack that queries keep on the call stack.
const STACK_ENTRIES: usize = 64;

/// Bit that marks a child as a pack of triangles.
const PACK_FLAG: u32 = 1 << 31;

/// Marks a lane of a pack that holds no triangle.
const NO_TRIANGLE: u32 = u32::MAX;

/// Largest [`overlap`] up to which reinsertion improves the tree: ordinary objects stay below 10, crumpled ones below
/// 90. Reinsertion takes time with the square of the overlap, which must be bounded for hostile uploads.
const MAX_OVERLAP: f32 = 100.0;

/// Overlap at which every tree is improved.
const ORDINARY_OVERLAP: f32 = 10.0;

/// Number of triangles above which that overlap shrinks in inverse proportion, so that the time per triangle does not grow.
const OVERLAPPING_TRIANGLES: f32 = 3_000.0;

/// Passes of reinsertion, of which pass n moves one of 2n + 1 nodes: usually, and for more than [`OVERLAPPING_TRIANGLES`].
const REINSERTION_PASSES: Range<usize> = 0..16;
const LARGE_MESH_PASSES: Range<usize> = 1..3;

/// Cost of entering a node relative to the test of a triangle: a lower one splits leaves further, a higher one fills them.
const NODE_COST: f32 = 2.0;

/// The target of a node's child.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Child {
    /// A node, by index.
    Node(usize),
    /// A pack of triangles, by index.
    Pack(usize),
}

/// A [`Child`] in four bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct ChildRef(u32);

impl ChildRef {
    fn new(child: Child) -> Self {
        match child {
            Child::Node(index) => Self(index as u32),
            Child::Pack(index) => Self(index as u32 | PACK_FLAG),
        }
    }

    /// The unpacked child.
    #[inline]
    fn child(self) -> Child {
        if self.0 & PACK_FLAG == 0 {
            Child::Node(self.0 as usize)
        } else {
            Child::Pack((self.0 & !PACK_FLAG) as usize)
        }
    }
}

/// A node: the boxes of up to four children, stored by coordinate.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    /// Smallest (0) and largest (1) x, y and z of each child's box, in metres. An unused child has +∞ as smallest and
    /// -∞ as largest, so that no query enters it.
    pub(super) bounds: [[Vec4; 3]; 2],
    /// The children.
    children: [ChildRef; WIDTH],
}

impl Node {
    const UNUSED: Self = Self {
        bounds: [[Vec4::INFINITY; 3], [Vec4::NEG_INFINITY; 3]],
        children: [ChildRef(0); WIDTH],
    };
}

/// Up to four triangles, stored by coordinate. Unused lanes hold NaN, which fails every comparison.
#[derive(Clone, Copy, Debug)]
pub(super) struct TrianglePack {
    /// First corner.
    pub(super) corner: [Vec4; 3],
    /// From the first corner to the second.
    pub(super) edge1: [Vec4; 3],
    /// From the first corner to the third.
    pub(super) edge2: [Vec4; 3],
    /// Unit normal.
    pub(super) normal: [Vec4; 3],
    /// Twice the area, in m².
    pub(super) doubled_area: Vec4,
    /// Length of the longest edge, in metres: the scale of rounding errors.
    pub(super) reach: Vec4,
    /// Indices into the mesh, [`NO_TRIANGLE`] in unused lanes.
    triangles: [u32; WIDTH],
}

impl TrianglePack {
    fn new(mesh: &TriangleMesh, triangles: &[u32]) -> Self {
        let unused = Vec4::NAN;
        let mut pack = Self {
            corner: [unused; 3],
            edge1: [unused; 3],
            edge2: [unused; 3],
            normal: [unused; 3],
            doubled_area: unused,
            reach: unused,
            triangles: [NO_TRIANGLE; WIDTH],
        };
        for (lane, &triangle) in triangles.iter().enumerate() {
            let [a, b, c] = mesh.corners(triangle as usize);
            let (edge1, edge2) = (b - a, c - a);
            // f64 gives slivers a sound normal.
            let [wide_a, wide_b, wide_c] = [a, b, c].map(Vec3::as_dvec3);
            let cross = (wide_b - wide_a).cross(wide_c - wide_a);
            let normal = cross.normalize_or(DVec3::Y).as_vec3();
            for axis in 0..3 {
                pack.corner[axis][lane] = a[axis];
                pack.edge1[axis][lane] = edge1[axis];
                pack.edge2[axis][lane] = edge2[axis];
                pack.normal[axis][lane] = normal[axis];
            }
            pack.doubled_area[lane] = cross.length() as f32;
            pack.reach[lane] = edge1.length().max(edge2.length()).max((c - b).length());
            pack.triangles[lane] = triangle;
        }
        pack
    }

    /// The mesh's index of the triangle in a lane.
    #[inline]
    pub(super) fn triangle(&self, lane: usize) -> u32 {
        self.triangles[lane]
    }
}

/// The hierarchy.
#[derive(Clone, Debug)]
pub(super) struct WideBvh {
    /// The nodes, the root first.
    nodes: Vec<Node>,
    /// The triangles, in the order of the leaves.
    packs: Vec<TrianglePack>,
    /// Upper bound of the entries on a query's stack.
    stack_bound: usize,
}

impl WideBvh {
    /// Builds the hierarchy of a mesh; O(n log n). A thorough one takes longer, for meshes that are queried millions of times.
    pub(super) fn build(mesh: &TriangleMesh, is_thorough: bool, stop: Stop<'_>) -> Result<Self, Stopped> {
        let is_large = mesh.triangles().len() as f32 > OVERLAPPING_TRIANGLES;
        let boxes: Vec<BuilderAabb> = (0..mesh.triangles().len())
            .map(|triangle| {
                let [a, b, c] = mesh.corners(triangle).map(Vec3A::from);
                let (low, high) = (a.min(b).min(c), a.max(b).max(c));
                let more = if is_large {
                    unequal(triangle) * (high - low)
                } else {
                    Vec3A::ZERO
                };
                BuilderAabb::new(low - more, high + more)
            })
            .collect();
        let share = (OVERLAPPING_TRIANGLES / boxes.len() as f32).min(1.0);
        let overlaps_much = overlap(&boxes) > (MAX_OVERLAP * share).max(ORDINARY_OVERLAP);
        let binary = build_binary(&boxes, is_thorough && !overlaps_much, stop)?;
        Ok(Self::collapse(&binary, mesh))
    }

    /// Collapses a binary tree: in each node, the child with the largest surface is replaced by its own two until there are four.
    fn collapse(binary: &Bvh2, mesh: &TriangleMesh) -> Self {
        let mut wide = Self {
            nodes: Vec::with_capacity(binary.nodes.len() / 3 + 1),
            packs: Vec::with_capacity(binary.nodes.len() / 2 + 1),
            stack_bound: 0,
        };
        let mut depth = 1;
        // (wide node to fill, its binary node, its depth)
        let mut open = vec![(0, 0_u32, 1_usize)];
        wide.nodes.push(Node::UNUSED);
        while let Some((slot, root, level)) = open.pop() {
            depth = depth.max(level);
            let (gathered, count) = gather(binary, root);
            let mut node = Node::UNUSED;
            for (i, &index) in gathered[..count].iter().enumerate() {
                let source = &binary.nodes[index as usize];
                let child = if source.is_leaf() {
                    let first = source.first_index as usize;
                    let last = first + source.prim_count as usize;
                    wide.packs
                        .push(TrianglePack::new(mesh, &binary.primitive_indices[first..last]));
                    Child::Pack(wide.packs.len() - 1)
                } else {
                    wide.nodes.push(Node::UNUSED);
                    open.push((wide.nodes.len() - 1, index, level + 1));
                    Child::Node(wide.nodes.len() - 1)
                };
                let aabb = source.aabb();
                for axis in 0..3 {
                    node.bounds[0][axis][i] = aabb.min[axis];
                    node.bounds[1][axis][i] = aabb.max[axis];
                }
                node.children[i] = ChildRef::new(child);
            }
            wide.nodes[slot] = node;
        }
        // Each level leaves at most three siblings on the stack while the fourth is visited, and a query may write
        // all four children of a node before it counts them.
        wide.stack_bound = 3 * depth + WIDTH;
        wide.nodes.shrink_to_fit();
        wide.packs.shrink_to_fit();
        wide
    }

    /// Memory use in bytes.
    pub(super) fn bytes(&self) -> usize {
        self.nodes.capacity() * size_of::<Node>() + self.packs.capacity() * size_of::<TrianglePack>()
    }

    /// Visits packs of triangles in no particular order, below the children that `entered` marks in each node, until `visit` returns
    /// false.
    #[inline]
    pub(super) fn visit(&self, entered: impl Fn(&Node) -> u32, mut visit: impl FnMut(&TrianglePack) -> bool) {
        self.with_stack(|stack: &mut [ChildRef]| {
            let mut height = 1;
            while height > 0 {
                height -= 1;
                match stack[height].child() {
                    Child::Node(index) => {
                        let node = &self.nodes[index];
                        for lane in lanes(entered(node)) {
                            stack[height] = node.children[lane];
                            height += 1;
                        }
                    }
                    Child::Pack(index) => {
                        if !visit(&self.packs[index]) {
                            return;
                        }
                    }
                }
            }
        });
    }

    /// Passes triangles below a limit of distance to `found`, roughly nearest first, with their distances; it returns the new limit.
    /// `bounds` are lower bounds of the distances to the boxes of a node's children, by no more than `depth` below 0. False if
    /// `may_go_on`, which is called for each node and each pack of triangles, returned false.
    #[inline]
    pub(super) fn visit_nearest(
        &self,
        mut limit: f32,
        depth: f32,
        bounds: impl Fn(&Node) -> Vec4,
        distances: impl Fn(&TrianglePack) -> Vec4,
        mut may_go_on: impl FnMut() -> bool,
        mut found: impl FnMut(f32, u32) -> f32,
    ) -> bool {
        self.with_stack(|stack: &mut [StackEntry]| {
            let mut height = 1;
            while height > 0 {
                height -= 1;
                let entry = stack[height];
                if entry.bound() - depth > limit {
                    continue;
                }
                if !may_go_on() {
                    return false;
                }
                match entry.child() {
                    Child::Node(index) => {
                        let node = &self.nodes[index];
                        let bounds = bounds(node);
                        let near = bounds.cmple(Vec4::splat(limit)).bitmask();
                        let keys = (bounds + depth).max(Vec4::ZERO).to_array();
                        let mut children = [StackEntry::default(); WIDTH];
                        for lane in 0..WIDTH {
                            if near >> lane & 1 == 1 {
                                children[lane] = StackEntry::new(keys[lane], node.children[lane]);
                            }
                        }
                        let children = sorted_farthest_first(children);
                        // The closest child comes off the stack next; empty slots are overwritten.
                        *stack[height..]
                            .first_chunk_mut()
                            .expect("the stack is large enough for any tree") = children;
                        height += near.count_ones() as usize;
                    }
                    Child::Pack(index) => {
                        let pack = &self.packs[index];
                        let distances = distances(pack);
                        let closer = distances.cmplt(Vec4::splat(limit)).bitmask();
                        for lane in lanes(closer) {
                            if distances[lane] < limit {
                                limit = found(distances[lane], pack.triangle(lane));
                            }
                        }
                    }
                }
            }
            true
        })
    }

    /// Runs a query with a stack large enough for this tree.
    #[inline]
    fn with_stack<T: Copy + Default, R>(&self, query: impl FnOnce(&mut [T]) -> R) -> R {
        if self.stack_bound <= STACK_ENTRIES {
            query(&mut [T::default(); STACK_ENTRIES])
        } else {
            query(&mut vec![T::default(); self.stack_bound])
        }
    }
}

/// The set bits of a mask, lowest first.
#[inline]
pub(super) fn lanes(mut mask: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let lane = (mask != 0).then(|| mask.trailing_zeros() as usize & 3);
        mask &= mask.wrapping_sub(1);
        lane
    })
}

/// Builds the binary tree as `obvhs::bvh2::builder::build_bvh2` does, but without pre-splitting, which duplicates triangles.
fn build_binary(boxes: &[BuilderAabb], is_thorough: bool, stop: Stop<'_>) -> Result<Bvh2, Stopped> {
    stop.check()?;
    let (search_distance, depth_threshold) = if is_thorough {
        (PlocSearchDistance::High, 2)
    } else {
        (PlocSearchDistance::Minimum, 0)
    };
    let all = (0..boxes.len() as u32).collect();
    let builder = &mut PlocBuilder::with_capacity(boxes.len());
    let mut tree = builder.build(search_distance, boxes, all, SortPrecision::U64, depth_threshold);
    if is_thorough {
        reinsert(&mut tree, stop)?;
    }
    collapse(&mut tree, WIDTH as u32, NODE_COST);
    if is_thorough {
        reinsert(&mut tree, stop)?;
    }
    Ok(tree)
}

/// Moves subtrees to better places, in passes over fewer and fewer of them.
fn reinsert(tree: &mut Bvh2, stop: Stop<'_>) -> Result<(), Stopped> {
    let passes = if tree.primitive_indices.len() as f32 > OVERLAPPING_TRIANGLES {
        LARGE_MESH_PASSES
    } else {
        REINSERTION_PASSES
    };
    let mut optimizer = ReinsertionOptimizer::default();
    for pass in passes {
        stop.check()?;
        optimizer.run(tree, 1.0, Some(vec![1.0 / (2 * pass + 1) as f32]));
    }
    Ok(())
}

/// Relative enlargement of a triangle's box, different for each: the builder takes quadratic time for equal boxes.
fn unequal(triangle: usize) -> f32 {
    /// Fractional parts of its multiples are spread evenly.
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    /// Enough to tell boxes apart, and too little to slow queries.
    const MOST: f64 = 1e-3;
    (MOST * (GOLDEN * triangle as f64).fract()) as f32
}

/// The summed surface of the boxes, as a multiple of the surface of the box around them all.
fn overlap(boxes: &[BuilderAabb]) -> f32 {
    let mut whole = BuilderAabb::empty();
    let mut sum = 0.0;
    for aabb in boxes {
        whole.extend(aabb.min);
        whole.extend(aabb.max);
        sum += aabb.half_area();
    }
    sum / whole.half_area()
}

/// The up to four descendants of a binary node that become one wide node's children, and their number.
fn gather(binary: &Bvh2, root: u32) -> ([u32; WIDTH], usize) {
    let mut gathered = [root; WIDTH];
    let mut count = 1;
    while count < WIDTH {
        let largest_inner = (0..count)
            .filter(|&i| !binary.nodes[gathered[i] as usize].is_leaf())
            .max_by(|&i, &j| {
                let area = |k: usize| binary.nodes[gathered[k] as usize].aabb().half_area();
                area(i).total_cmp(&area(j))
            });
        let Some(i) = largest_inner else { break };
        let first = binary.nodes[gathered[i] as usize].first_index;
        gathered[i] = first;
        gathered[count] = first + 1;
        count += 1;
    }
    (gathered, count)
}

/// A child to visit with, in the upper 32 bits, a lower bound of its distance, by which entries sort; 0 for an empty slot.
#[derive(Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
struct StackEntry(u64);

impl StackEntry {
    /// An entry for a child; `bound` must not be negative.
    fn new(bound: f32, child: ChildRef) -> Self {
        Self(u64::from(bound.to_bits()) << 32 | u64::from(child.0))
    }

    /// The lower bound of the distance.
    fn bound(self) -> f32 {
        f32::from_bits((self.0 >> 32) as u32)
    }

    /// The child.
    fn child(self) -> Child {
        ChildRef(self.0 as u32).child()
    }
}

/// Sorts four entries, farthest first, by the shortest sorting network for four.
#[inline]
fn sorted_farthest_first(mut entries: [StackEntry; WIDTH]) -> [StackEntry; WIDTH] {
    for (i, j) in [(0, 1), (2, 3), (0, 2), (1, 3), (1, 2)] {
        (entries[i], entries[j]) = (entries[i].max(entries[j]), entries[i].min(entries[j]));
    }
    entries
}
