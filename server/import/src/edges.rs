//! How triangles join at their edges, and what is wrong with it.

use crate::raw::{Occurrences, Place};

/// One triangle's use of an edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct EdgeUse {
    /// The vertices, the lower index first.
    pub(crate) ends: [u32; 2],
    pub(crate) triangle: u32,
    /// Whether the triangle passes from the lower index to the higher.
    pub(crate) is_forward: bool,
}

impl EdgeUse {
    /// 1 from the lower index to the higher, -1 the other way.
    pub(crate) fn direction(self) -> i32 {
        if self.is_forward { 1 } else { -1 }
    }
}

/// The edges of some triangles, in the order of their ends.
pub(crate) fn edge_uses(triangles: impl Iterator<Item = (u32, [u32; 3])>) -> Vec<EdgeUse> {
    let mut uses: Vec<EdgeUse> = triangles
        .flat_map(|(triangle, [a, b, c])| [(a, b), (b, c), (c, a)].map(|(from, to)| (triangle, from, to)))
        .map(|(triangle, from, to)| EdgeUse {
            ends: [from.min(to), from.max(to)],
            triangle,
            is_forward: from < to,
        })
        .collect();
    uses.sort_unstable();
    uses
}

/// The uses of each edge.
pub(crate) fn by_edge(uses: &[EdgeUse]) -> impl Iterator<Item = &[EdgeUse]> {
    uses.chunk_by(|a, b| a.ends == b.ends)
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
    /// Counts the edges of triangles over `vertices` vertices.
    pub(crate) fn of(uses: &[EdgeUse], vertices: usize) -> Self {
        let mut edges = Self {
            components: components(uses, vertices),
            ..Self::default()
        };
        for users in by_edge(uses) {
            let first = users[0].triangle as usize;
            match users {
                [_] => edges.open.note_least(first),
                [a, b] if a.is_forward == b.is_forward => edges.inconsistent.note_least(first),
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
fn components(uses: &[EdgeUse], vertices: usize) -> usize {
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
    for edge in uses {
        let [a, b] = edge.ends.map(|end| root(&mut parents, end));
        parents[b as usize] = a;
        is_used[edge.ends[0] as usize] = true;
        is_used[edge.ends[1] as usize] = true;
    }
    let is_root = |&vertex: &usize| is_used[vertex] && parents[vertex] == vertex as u32;
    (0..vertices).filter(is_root).count()
}
