//! Closed meshes from rings of vertices.
//!
//! A ring runs counter-clockwise about the direction in which the surface is built. Strips between rings then face
//! outward by construction. Lengths are millimetres until [`MeshBuilder::finish`].

use std::fmt::Write as _;

use glam::DVec3;

/// Vertices of a closed curve, in order.
pub(crate) type Ring = Vec<usize>;

/// A mesh in metres with the names of its groups, ready to be written.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Shape {
    /// Vertices in whole micrometres, centred on their bounding box.
    pub(crate) micrometres: Vec<[i64; 3]>,
    /// Group names and their triangles, in the order of the file.
    pub(crate) groups: Vec<(&'static str, Vec<[usize; 3]>)>,
}

impl Shape {
    /// The mesh as OBJ text in metres with six decimals; `comment` is its first line.
    pub(crate) fn obj(&self, comment: &str) -> String {
        let mut text = format!("# {comment}\n");
        let mut line = |arguments: std::fmt::Arguments<'_>| {
            text.write_fmt(arguments).expect("a string takes any text");
        };
        for vertex in &self.micrometres {
            let [x, y, z] = vertex.map(metres);
            line(format_args!("v {x} {y} {z}\n"));
        }
        for (group, triangles) in &self.groups {
            line(format_args!("g {group}\n"));
            for triangle in triangles {
                let [a, b, c] = triangle.map(|vertex| vertex + 1);
                line(format_args!("f {a} {b} {c}\n"));
            }
        }
        text
    }
}

/// Whole micrometres as metres with six decimals.
fn metres(micrometres: i64) -> String {
    let sign = if micrometres < 0 { "-" } else { "" };
    let size = micrometres.unsigned_abs();
    format!("{sign}{}.{:06}", size / 1_000_000, size % 1_000_000)
}

/// A mesh under construction.
#[derive(Debug)]
pub(crate) struct MeshBuilder {
    positions: Vec<DVec3>,
    groups: Vec<(&'static str, Vec<[usize; 3]>)>,
}

impl MeshBuilder {
    /// Nothing yet; triangles will be sorted into these groups.
    pub(crate) fn new(groups: &[&'static str]) -> Self {
        Self {
            positions: Vec::new(),
            groups: groups.iter().map(|&name| (name, Vec::new())).collect(),
        }
    }

    /// Adds a group, empty so far.
    pub(crate) fn group(&mut self, name: &'static str) {
        self.groups.push((name, Vec::new()));
    }

    /// Adds a vertex.
    pub(crate) fn vertex(&mut self, position: DVec3) -> usize {
        self.positions.push(position);
        self.positions.len() - 1
    }

    /// Adds the vertices of a ring.
    pub(crate) fn ring(&mut self, positions: impl IntoIterator<Item = DVec3>) -> Ring {
        positions
            .into_iter()
            .map(|position| self.vertex(position))
            .collect()
    }

    /// Where a vertex is.
    pub(crate) fn position(&self, vertex: usize) -> DVec3 {
        self.positions[vertex]
    }

    /// Adds a triangle, counter-clockwise seen from outside.
    fn triangle(&mut self, group: &str, corners: [usize; 3]) {
        self.groups
            .iter_mut()
            .find(|(name, _)| *name == group)
            .expect("groups are declared when the builder is made")
            .1
            .push(corners);
    }

    /// Joins two rings of equal length; `group` names the group of the quad between vertex `k` and the one after it,
    /// or none where the surface stays open.
    pub(crate) fn strip(
        &mut self,
        from: &[usize],
        to: &[usize],
        group: impl Fn(usize) -> Option<&'static str>,
    ) {
        assert_eq!(from.len(), to.len(), "a strip joins rings of equal length");
        for k in 0..from.len() {
            let next = (k + 1) % from.len();
            if let Some(group) = group(k) {
                self.quad(group, [from[k], from[next], to[next], to[k]]);
            }
        }
    }

    /// Adds a quad, split along its shorter diagonal.
    pub(crate) fn quad(&mut self, group: &str, [a, b, c, d]: [usize; 4]) {
        let diagonal = |p: usize, q: usize| self.positions[p].distance_squared(self.positions[q]);
        if diagonal(a, c) <= diagonal(b, d) {
            self.triangle(group, [a, b, c]);
            self.triangle(group, [a, c, d]);
        } else {
            self.triangle(group, [a, b, d]);
            self.triangle(group, [b, c, d]);
        }
    }

    /// Closes a ring with a point ahead of it.
    pub(crate) fn fan(&mut self, ring: &[usize], apex: usize, group: impl Fn(usize) -> &'static str) {
        for k in 0..ring.len() {
            self.triangle(group(k), [ring[k], ring[(k + 1) % ring.len()], apex]);
        }
    }

    /// Drops vertices that no triangle uses, centres the mesh on its bounding box and rounds it to micrometres.
    ///
    /// Rounding makes the file's decimals exact and hides the last bits of the arithmetic.
    pub(crate) fn finish(mut self) -> Shape {
        self.drop_unused();
        let low = self
            .positions
            .iter()
            .fold(DVec3::INFINITY, |low, &position| low.min(position));
        let high = self
            .positions
            .iter()
            .fold(DVec3::NEG_INFINITY, |high, &position| high.max(position));
        let centre = (low + high) / 2.0;
        Shape {
            micrometres: self
                .positions
                .iter()
                .map(|&position| {
                    ((position - centre) * 1000.0)
                        .to_array()
                        .map(|coordinate| coordinate.round() as i64)
                })
                .collect(),
            groups: self.groups,
        }
    }

    fn drop_unused(&mut self) {
        let mut new_index = vec![None; self.positions.len()];
        for (_, triangles) in &self.groups {
            for &vertex in triangles.iter().flatten() {
                new_index[vertex] = Some(0);
            }
        }
        for (kept, index) in new_index.iter_mut().flatten().enumerate() {
            *index = kept;
        }
        let mut flags = new_index.iter();
        self.positions
            .retain(|_| flags.next().is_some_and(Option::is_some));
        for (_, triangles) in &mut self.groups {
            for vertex in triangles.iter_mut().flatten() {
                *vertex = new_index[*vertex].expect("every vertex of a triangle was marked");
            }
        }
    }
}

/// Sine and cosine of an angle in degrees.
///
/// From their power series rather than the platform's library, whose last bit differs from platform to platform.
pub(crate) fn sin_cos_degrees(degrees: f64) -> (f64, f64) {
    let x = (degrees - 360.0 * (degrees / 360.0).round()).to_radians();
    // |x| is at most π: the 28th power over 28 factorial is below 1e-15.
    let (mut sine, mut cosine, mut term) = (0.0, 0.0, 1.0);
    for power in 0..28 {
        match power % 4 {
            0 => cosine += term,
            1 => sine += term,
            2 => cosine -= term,
            _ => sine -= term,
        }
        term *= x / f64::from(power + 1);
    }
    (sine, cosine)
}
