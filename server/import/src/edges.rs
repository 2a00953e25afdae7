//! How triangles join at their edges, and what is wrong with it.

/// Counts of edges by how the triangles at them join.
#[derive(Debug)]
pub(crate) struct Edges {
    /// Edges of a single triangle.
    open: usize,
    /// Edges of two triangles with opposite windings.
    inconsistent: usize,
    /// Edges of more than two triangles.
    crowded: usize,
    /// Edges that are not traversed equally often in both directions.
    unbalanced: usize,
    /// Connected sets of triangles; two sets share no vertex.
    components: usize,
}

impl Edges {
    /// Counts the edges of triangles over `vertices` vertices.
    pub(crate) fn of(triangles: &[[u32; 3]], vertices: usize) -> Self {
        let mut directed: Vec<([u32; 2], i32)> = triangles
            .iter()
            .flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)])
            .map(|(from, to)| ([from.min(to), from.max(to)], if from < to { 1 } else { -1 }))
            .collect();
        directed.sort_unstable();
        let mut edges = Self {
            open: 0,
            inconsistent: 0,
            crowded: 0,
            unbalanced: 0,
            components: components(triangles, vertices),
        };
        for passes in directed.chunk_by(|(first, _), (second, _)| first == second) {
            let balance: i32 = passes.iter().map(|(_, direction)| direction).sum();
            match passes.len() {
                1 => edges.open += 1,
                2 if balance != 0 => edges.inconsistent += 1,
                2 => {}
                _ => edges.crowded += 1,
            }
            edges.unbalanced += usize::from(balance != 0);
        }
        edges
    }

    /// Whether the surface encloses a volume.
    pub(crate) fn is_closed(&self) -> bool {
        self.unbalanced == 0
    }

    /// One line per kind of defect.
    pub(crate) fn warnings(&self) -> impl Iterator<Item = String> {
        [
            (
                self.open,
                0,
                "edges are open: the surface has holes and its volume is an estimate",
            ),
            (
                self.inconsistent,
                0,
                "edges join triangles that face opposite ways: the winding is inconsistent",
            ),
            (self.crowded, 0, "edges join more than two triangles"),
            (self.components, 1, "parts are disconnected: they share no vertex"),
        ]
        .into_iter()
        .filter(|(count, usual, _)| count > usual)
        .map(|(count, _, what)| format!("{count} {what}"))
    }
}

/// Number of connected sets of triangles, by union-find with path halving.
fn components(triangles: &[[u32; 3]], vertices: usize) -> usize {
    fn root(parents: &mut [u32], mut vertex: u32) -> u32 {
        while parents[vertex as usize] != vertex {
            let above = parents[parents[vertex as usize] as usize];
            parents[vertex as usize] = above;
            vertex = above;
        }
        vertex
    }
    let mut parents: Vec<u32> = (0..vertices as u32).collect();
    for &[a, b, c] in triangles {
        let first = root(&mut parents, a);
        for other in [b, c] {
            let other = root(&mut parents, other);
            parents[other as usize] = first;
        }
    }
    let mut roots: Vec<u32> = triangles
        .iter()
        .map(|triangle| root(&mut parents, triangle[0]))
        .collect();
    roots.sort_unstable();
    roots.dedup();
    roots.len()
}
