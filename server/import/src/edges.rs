//! How triangles join at their edges, and triangles that are there twice.

use grasp_synthesis::base::stop::{Stop, Stopped};

use crate::raw::{Oddities, Oddity};

/// One triangle's use of an edge, in four bytes: a mesh has three per triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct EdgeUse(u32);

/// Bits beside the triangle: whether it passes from the lower vertex to the higher, and whether it is the first of its edge.
const FORWARD: u32 = 1;
const FIRST: u32 = 2;
const BITS: u32 = 2;
const SIDE: u32 = FORWARD | FIRST;

impl EdgeUse {
    /// The triangle.
    pub(crate) fn triangle(self) -> usize {
        (self.0 >> BITS) as usize
    }

    /// 1 from the lower index to the higher, -1 the other way.
    pub(crate) fn direction(self) -> i32 {
        if self.0 & FORWARD != 0 { 1 } else { -1 }
    }

    /// Makes the triangle pass the other way.
    pub(crate) fn turn(&mut self) {
        self.0 ^= FORWARD;
    }
}

/// The edges of those triangles that are not dropped, in the order of their ends: sorted by their lower vertices as they are counted,
/// which takes a quarter of the memory of a list with their ends.
fn edge_uses(triangles: &[[u32; 3]], vertices: usize, is_dropped: &[bool]) -> Vec<EdgeUse> {
    let ends = |triangle: usize, side: usize| {
        let [from, to] = [side, (side + 1) % 3].map(|corner| triangles[triangle][corner]);
        (from.min(to), from.max(to), from < to)
    };
    let kept = || (0..triangles.len()).filter(|&triangle| !is_dropped[triangle]);
    let sides = || kept().flat_map(|triangle| (0..3).map(move |side| (triangle, side)));
    let mut next = vec![0; vertices + 1];
    for (triangle, side) in sides() {
        next[ends(triangle, side).0 as usize + 1] += 1;
    }
    for vertex in 1..=vertices {
        next[vertex] += next[vertex - 1];
    }
    // First with the side in place of the bits.
    let mut uses = vec![EdgeUse(0); next[vertices]];
    for (triangle, side) in sides() {
        let place = &mut next[ends(triangle, side).0 as usize];
        uses[*place] = EdgeUse(((triangle as u32) << BITS) | side as u32);
        *place += 1;
    }
    let ends = |edge: EdgeUse| ends(edge.triangle(), (edge.0 & SIDE) as usize);
    for of_vertex in uses.chunk_by_mut(|&a, &b| ends(a).0 == ends(b).0) {
        of_vertex.sort_unstable_by_key(|&edge| (ends(edge).1, edge.0));
        let mut before = None;
        for edge in of_vertex {
            let (_, upper, is_forward) = ends(*edge);
            let forward = if is_forward { FORWARD } else { 0 };
            let is_known = before.replace(upper) == Some(upper);
            let first = if is_known { 0 } else { FIRST };
            edge.0 = (edge.0 & !SIDE) | forward | first;
        }
    }
    uses
}

/// Drops the uses by some triangles.
fn drop_uses(uses: &mut Vec<EdgeUse>, is_dropped: &[bool]) {
    let mut is_first = false;
    uses.retain_mut(|edge| {
        is_first |= edge.0 & FIRST != 0;
        let is_kept = !is_dropped[edge.triangle()];
        if is_kept && std::mem::take(&mut is_first) {
            edge.0 |= FIRST;
        }
        is_kept
    });
}

/// The uses of each edge.
pub(crate) fn by_edge(uses: &[EdgeUse]) -> impl Iterator<Item = &[EdgeUse]> {
    uses.chunk_by(|_, next| next.0 & FIRST == 0)
}

/// Disjoint sets of numbers: union-find with path halving.
pub(crate) struct Sets(Vec<u32>);

impl Sets {
    /// A set of each number below `count`.
    pub(crate) fn new(count: usize) -> Self {
        Self((0..count as u32).collect())
    }

    /// The number that stands for an item's set.
    pub(crate) fn root(&mut self, item: u32) -> usize {
        let mut item = item as usize;
        while self.0[item] as usize != item {
            let above = self.0[self.0[item] as usize];
            self.0[item] = above;
            item = above as usize;
        }
        item
    }

    pub(crate) fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[b] = a as u32;
    }
}

/// Notes edges at which other than two triangles with the same winding join, each with its first triangle.
pub(crate) fn note_odd(uses: &[EdgeUse], oddities: &mut Oddities) {
    for users in by_edge(uses) {
        let oddity = match users {
            [_] => Oddity::OpenEdge,
            [a, b] if a.direction() == b.direction() => Oddity::InconsistentEdge,
            [_, _] => continue,
            _ => Oddity::CrowdedEdge,
        };
        oddities.note(oddity, users[0].triangle());
    }
}

/// Number of connected sets of triangles over `vertices` vertices; two sets share no vertex.
pub(crate) fn components(triangles: impl Iterator<Item = [u32; 3]>, vertices: usize) -> usize {
    let mut sets = Sets::new(vertices);
    let mut is_used = vec![false; vertices];
    for [a, b, c] in triangles {
        sets.join(a, b);
        sets.join(b, c);
        for corner in [a, b, c] {
            is_used[corner as usize] = true;
        }
    }
    let mut is_root = |vertex: &usize| is_used[*vertex] && sets.root(*vertex as u32) == *vertex;
    (0..vertices).filter(|vertex| is_root(vertex)).count()
}

/// Triangles that are there twice, by index.
#[derive(Debug, Default)]
pub(crate) struct Doubles {
    /// The edges of all triangles that are kept.
    pub(crate) uses: Vec<EdgeUse>,
    /// Whether each triangle is dropped, those without area included.
    pub(crate) is_dropped: Vec<bool>,
}

impl Doubles {
    /// Finds repeated triangles among those that are not dropped yet, and decides of which two-sided ones only the earlier side is
    /// kept.
    ///
    /// One side is kept of a patch of pairs that the rest of the surface needs to be closed, and of a sheet that touches
    /// nothing else. Which of the two it is does not matter: the winding is repaired later.
    pub(crate) fn of(
        triangles: &[[u32; 3]],
        vertices: usize,
        is_dropped: Vec<bool>,
        oddities: &mut Oddities,
        stop: Stop<'_>,
    ) -> Result<Self, Stopped> {
        let mut doubles = Self {
            is_dropped,
            ..Self::default()
        };
        let pairs = doubles.drop_repeated(triangles, oddities);
        stop.check()?;
        doubles.uses = edge_uses(triangles, vertices, &doubles.is_dropped);
        if !pairs.is_empty() {
            doubles.drop_sides(&pairs, oddities);
        }
        stop.check()?;
        Ok(doubles)
    }

    /// Drops triangles that repeat earlier ones; returns the pairs of opposite windings among the rest, the earlier one first.
    fn drop_repeated(&mut self, triangles: &[[u32; 3]], oddities: &mut Oddities) -> Vec<[u32; 2]> {
        let mut sorted = Vec::with_capacity(triangles.len());
        for ((&corners, &is_dropped), triangle) in triangles.iter().zip(&self.is_dropped).zip(0_u32..) {
            if !is_dropped {
                let mut key = corners;
                key.sort_unstable();
                sorted.push((key, triangle));
            }
        }
        sorted.sort_unstable();
        let mut pairs = Vec::new();
        for same in sorted.chunk_by(|a, b| a.0 == b.0) {
            let (_, first) = same[0];
            let mut opposite = None;
            for &(_, other) in &same[1..] {
                let is_opposite = is_even(triangles[first as usize]) != is_even(triangles[other as usize]);
                if is_opposite && opposite.is_none() {
                    opposite = Some(other);
                } else {
                    oddities.note(Oddity::Repeated, other as usize);
                    self.is_dropped[other as usize] = true;
                }
            }
            pairs.extend(opposite.map(|later| [first, later]));
        }
        pairs
    }

    fn drop_sides(&mut self, pairs: &[[u32; 2]], oddities: &mut Oddities) {
        const UNPAIRED: u32 = u32::MAX;
        let mut pair_of = vec![UNPAIRED; self.is_dropped.len()];
        for (pair, triangles) in (0..).zip(pairs) {
            for &triangle in triangles {
                pair_of[triangle as usize] = pair;
            }
        }
        // Patches of pairs that share edges, and how the rest of the surface is there.
        let mut patches = Sets::new(pairs.len());
        let (mut closes, mut is_spare) = (vec![false; pairs.len()], vec![false; pairs.len()]);
        for users in by_edge(&self.uses) {
            let pair = |edge: &EdgeUse| pair_of[edge.triangle()];
            let mut of_pairs = users.iter().map(pair).filter(|&pair| pair != UNPAIRED);
            let Some(first) = of_pairs.next() else { continue };
            for other in of_pairs {
                patches.join(first, other);
            }
            let mut rest = users.iter().filter(|&edge| pair(edge) == UNPAIRED).peekable();
            if rest.peek().is_some() {
                let is_balanced = rest.map(|edge| edge.direction()).sum::<i32>() == 0;
                let kind = if is_balanced { &mut is_spare } else { &mut closes };
                kind[first as usize] = true;
            }
        }
        for pair in 0..pairs.len() {
            let root = patches.root(pair as u32);
            closes[root] |= closes[pair];
            is_spare[root] |= is_spare[pair];
        }
        for (pair, &[_, later]) in (0..).zip(pairs) {
            let root = patches.root(pair);
            if is_spare[root] && !closes[root] {
                oddities.note(Oddity::Undecided, later as usize);
            } else {
                oddities.note(Oddity::TwoSided, later as usize);
                self.is_dropped[later as usize] = true;
            }
        }
        drop_uses(&mut self.uses, &self.is_dropped);
    }
}

/// Whether corners are in ascending order, up to rotation.
fn is_even([a, b, c]: [u32; 3]) -> bool {
    (a < b) == ((b < c) == (a < c))
}
