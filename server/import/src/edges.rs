//! How triangles join at their edges, and what is wrong with it.

use crate::raw::{Occurrences, Place};

/// One triangle's use of an edge, in four bytes: a mesh has three per triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct EdgeUse(u32);

/// Bits beside the triangle: whether it passes from the lower vertex to the higher, and whether it is the first of its edge.
const FORWARD: u32 = 1;
const FIRST: u32 = 2;
const BITS: u32 = 2;

impl EdgeUse {
    /// The triangle.
    pub(crate) fn triangle(self) -> u32 {
        self.0 >> BITS
    }

    /// Whether the triangle passes from the lower index to the higher.
    pub(crate) fn is_forward(self) -> bool {
        self.0 & FORWARD != 0
    }

    /// 1 from the lower index to the higher, -1 the other way.
    pub(crate) fn direction(self) -> i32 {
        if self.is_forward() { 1 } else { -1 }
    }

    /// Makes the triangle pass the other way.
    pub(crate) fn turn(&mut self) {
        self.0 ^= FORWARD;
    }
}

/// The edges of those triangles that are not dropped, in the order of their ends.
pub(crate) fn edge_uses(triangles: &[[u32; 3]], is_dropped: &[bool]) -> Vec<EdgeUse> {
    let kept = is_dropped.iter().filter(|is_dropped| !**is_dropped).count();
    // The ends of the edge, the lower index first, and the use.
    let mut uses: Vec<([u32; 2], u32)> = Vec::with_capacity(3 * kept);
    for (triangle, &[a, b, c]) in triangles.iter().enumerate() {
        if !is_dropped[triangle] {
            uses.extend([(a, b), (b, c), (c, a)].map(|(from, to)| {
                let forward = if from < to { FORWARD } else { 0 };
                ([from.min(to), from.max(to)], (triangle as u32) << BITS | forward)
            }));
        }
    }
    uses.sort_unstable();
    let mut before = None;
    let mut of_edges = Vec::with_capacity(uses.len());
    of_edges.extend(uses.iter().map(|&(ends, user)| {
        let is_first = before.replace(ends) != Some(ends);
        EdgeUse(if is_first { user | FIRST } else { user })
    }));
    of_edges
}

/// Drops the uses by some triangles.
pub(crate) fn drop_uses(uses: &mut Vec<EdgeUse>, is_dropped: &[bool]) {
    let mut is_first = false;
    uses.retain_mut(|edge| {
        is_first |= edge.0 & FIRST != 0;
        let is_kept = !is_dropped[edge.triangle() as usize];
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

/// Edges by how the triangles at them join; the first of a kind is that of the first triangle.
#[derive(Debug, Default)]
pub(crate) struct Edges {
    /// Edges of a single triangle.
    open: Occurrences,
    /// Edges of two triangles with opposite windings.
    inconsistent: Occurrences,
    /// Edges of more than two triangles.
    crowded: Occurrences,
    /// Connected sets of triangles; two sets share no vertex.
    components: usize,
}

impl Edges {
    /// Counts the edges of triangles over `vertices` vertices, which the uses are of.
    pub(crate) fn of(uses: &[EdgeUse], triangles: impl Iterator<Item = [u32; 3]>, vertices: usize) -> Self {
        let mut edges = Self {
            components: components(triangles, vertices),
            ..Self::default()
        };
        for users in by_edge(uses) {
            let first = users[0].triangle() as usize;
            match users {
                [_] => edges.open.note_least(first),
                [a, b] if a.is_forward() == b.is_forward() => edges.inconsistent.note_least(first),
                [_, _] => {}
                _ => edges.crowded.note_least(first),
            }
        }
        edges
    }

    /// One line per kind of defect; `place_of` gives the place of a triangle.
    pub(crate) fn warnings(&self, place_of: impl Fn(usize) -> Place) -> impl Iterator<Item = String> {
        let edges = [
            (
                self.open,
                "edges are open: the surface has holes and its volume is an estimate",
            ),
            (
                self.inconsistent,
                "edges join triangles that face opposite ways: the winding is inconsistent",
            ),
            (self.crowded, "edges join more than two triangles"),
        ]
        .into_iter()
        .filter(|(edges, _)| edges.count > 0)
        .map(move |(Occurrences { count, first }, what)| {
            format!("{count} {what}; the first is at {}", place_of(first).face())
        });
        let components = self.components;
        let parts =
            (components > 1).then(|| format!("{components} parts are disconnected: they share no vertex"));
        edges.chain(parts)
    }
}

/// Number of connected sets of triangles, by union-find with path halving.
fn components(triangles: impl Iterator<Item = [u32; 3]>, vertices: usize) -> usize {
    fn root(parents: &mut [u32], mut vertex: u32) -> u32 {
        while parents[vertex as usize] != vertex {
            let above = parents[parents[vertex as usize] as usize];
            parents[vertex as usize] = above;
            vertex = above;
        }
        vertex
    }
    let mut parents: Vec<u32> = (0..vertices as u32).collect();
    let mut is_used = vec![false; vertices];
    for [a, b, c] in triangles {
        for (from, to) in [(a, b), (b, c)] {
            let [from, to] = [from, to].map(|end| root(&mut parents, end));
            parents[to as usize] = from;
        }
        for corner in [a, b, c] {
            is_used[corner as usize] = true;
        }
    }
    let is_root = |&vertex: &usize| is_used[vertex] && parents[vertex] == vertex as u32;
    (0..vertices).filter(is_root).count()
}
