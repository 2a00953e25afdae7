//! Closure: the largest disturbance that the contacts resist in every direction.
//!
//! A convex polytope in six dimensions grows by one vertex at a time. All facets are simplices of six vertices. Facets that a new
//! vertex sees from outside are removed, and each ridge between a removed and a remaining facet gets a new facet with the vertex
//! (beneath and beyond). The plane of a new facet is the combination of the two planes at its ridge that contains the vertex; both
//! factors are positive, so nothing cancels and rounding errors do not grow.

use super::{Buffers, ContactCone, Load, ScaledWrench, SoftContact, dot, farthest_wrench, prepared_cones};

/// Relative error of [`epsilon`], which is a lower bound. Smaller values take longer: the polytope grows until it is
/// that close.
pub const EPSILON_TOLERANCE: f32 = 0.05;

/// Steps of Gilbert's algorithm that look for an unresisted disturbance before a polytope is built.
const GILBERT_STEPS: usize = 12;

/// Limit on the facets built, some 1 ms of work; the bound reached by then is returned.
const MAX_FACETS_MADE: usize = 10_000;

/// Contacts that resist less than this in some direction have no closure: below it, single precision decides.
const NO_CLOSURE: f64 = 1e-6;

/// Ferrari and Canny's epsilon (1992) of soft-finger contacts: the radius of the largest ball about the origin inside
/// the convex hull of the unit wrenches of all contacts. This is the L1 convention, in which the normal forces sum to
/// one newton: epsilon is the largest disturbance, as a share of the summed normal forces, that the contacts resist
/// in every direction. Torque is divided by the length of the torque scale, so epsilon has no unit. 0 means no closure.
///
/// The value is a lower bound, within [`EPSILON_TOLERANCE`] of the true one unless that takes more than about 1 ms.
/// With `required` above 0, the search ends as soon as epsilon cannot reach it, and the value is merely some number
/// below `required`.
pub fn epsilon(contacts: &[SoftContact], load: &Load, required: f32, buffers: &mut Buffers) -> f32 {
    let resisted = least_resisted(prepared_cones(contacts, load, &mut buffers.cones));
    let required = f64::from(required);
    if resisted <= NO_CLOSURE {
        return 0.0;
    }
    if resisted < required {
        return resisted as f32;
    }
    inscribed_sphere(&buffers.cones, resisted, required, &mut buffers.polytope) as f32
}

/// An upper bound of [`epsilon`], in a tenth of the time; 0 if there is certainly no closure.
pub fn epsilon_upper_bound(contacts: &[SoftContact], load: &Load, buffers: &mut Buffers) -> f32 {
    least_resisted(prepared_cones(contacts, load, &mut buffers.cones)) as f32
}

/// An upper bound of epsilon, 0 without closure, by Gilbert's walk (1966) to the hull's point nearest to the origin.
fn least_resisted(cones: &[ContactCone]) -> f64 {
    let mut point: ScaledWrench = [0.0; 6];
    for cone in cones {
        for (sum, part) in point.iter_mut().zip(cone.wrench(&cone.normal_push())) {
            *sum += part / cones.len() as f64;
        }
    }
    let mut upper = if cones.is_empty() { 0.0 } else { f64::INFINITY };
    for _ in 0..GILBERT_STEPS {
        let length = dot(&point, &point).sqrt();
        if length < 1e-9 {
            break;
        }
        let direction = point.map(|x| -x / length);
        let (reach, wrench) = farthest_wrench(cones, &direction);
        upper = upper.min(reach);
        if upper <= NO_CLOSURE {
            return 0.0;
        }
        // The point nearest to the origin on the segment to the new wrench.
        let step: ScaledWrench = std::array::from_fn(|k| wrench[k] - point[k]);
        let share = (-dot(&point, &step) / dot(&step, &step)).clamp(0.0, 1.0);
        for (x, s) in point.iter_mut().zip(step) {
            *x += share * s;
        }
    }
    upper
}

/// Epsilon from below: the polytope grows at its facet nearest to the origin until lower and upper bound meet.
fn inscribed_sphere(cones: &[ContactCone], upper: f64, required: f64, polytope: &mut Polytope) -> f64 {
    if !polytope.start(|direction| farthest_wrench(cones, direction)) {
        return 0.0;
    }
    let mut upper = upper;
    loop {
        let facet = polytope.nearest_facet();
        let (normal, lower) = polytope.plane(facet);
        let (reach, wrench) = farthest_wrench(cones, &normal);
        upper = upper.min(reach);
        if upper <= NO_CLOSURE {
            return 0.0;
        }
        if upper < required {
            return upper;
        }
        let near = lower >= (1.0 - f64::from(EPSILON_TOLERANCE)) * upper;
        if near || polytope.made > MAX_FACETS_MADE || !polytope.expand(facet, wrench) {
            // Rounding must not lift the result above the upper bound.
            return lower.clamp(0.0, upper);
        }
    }
}

/// Numbers in a wrench.
const DIMENSIONS: usize = 6;

/// A vertex sees a facet if it is farther than this outside.
const OUTSIDE: f64 = 1e-10;

/// A hull thinner than this in some direction has no volume.
const FLAT: f64 = 1e-7;

/// Flag in a removed facet's neighbour index: the new facet at that ridge.
const NEW: u32 = 1 << 31;

#[derive(Clone, Copy, Debug)]
struct Facet {
    /// Outward unit normal.
    normal: ScaledWrench,
    vertices: [u16; DIMENSIONS],
    /// Neighbour k shares all vertices but the k-th.
    neighbours: [u32; DIMENSIONS],
    /// Signed distance of the newest vertex, valid if `seen_by` names it.
    height: f64,
    seen_by: u32,
}

/// A polytope with simplicial facets.
#[derive(Clone, Debug, Default)]
pub(super) struct Polytope {
    vertices: u32,
    /// Facets built so far, including removed ones.
    made: usize,
    facets: Vec<Facet>,
    /// Signed distance of each facet's plane from the origin: negative if the origin is outside, infinite for removed facets.
    offsets: Vec<f64>,
    removed: Vec<u32>,
    removing: Vec<u32>,
    /// New facets, each with the facet it replaces at its ridge.
    created: Vec<(u32, u32)>,
}

impl Polytope {
    /// Starts with a simplex of seven support points from `farthest`; false if all points lie in a hyperplane.
    fn start(&mut self, farthest: impl Fn(&ScaledWrench) -> (f64, ScaledWrench)) -> bool {
        let mut corners = [[0.0; DIMENSIONS]; DIMENSIONS + 1];
        corners[0] = farthest(&[1.0, 0.0, 0.0, 0.0, 0.0, 0.0]).1;
        // An orthonormal basis of the directions spanned so far.
        let mut basis = [[0.0; DIMENSIONS]; DIMENSIONS];
        for count in 0..DIMENSIONS {
            let direction = perpendicular(&basis[..count]);
            let height =
                |corner: &ScaledWrench| (dot(corner, &direction) - dot(&corners[0], &direction)).abs();
            let forward = farthest(&direction).1;
            let backward = farthest(&direction.map(|x| -x)).1;
            let corner = if height(&forward) >= height(&backward) {
                forward
            } else {
                backward
            };
            if height(&corner) < FLAT {
                return false;
            }
            corners[count + 1] = corner;
            let edge = std::array::from_fn(|k| corner[k] - corners[0][k]);
            basis[count] = orthonormalised(edge, &basis[..count]);
        }
        let Some(coordinates) = barycentric_coordinates(&corners) else {
            return false;
        };
        self.vertices = DIMENSIONS as u32 + 1;
        self.made = DIMENSIONS + 1;
        self.facets.clear();
        self.offsets.clear();
        self.removed.clear();
        for (k, &(gradient, constant)) in coordinates.iter().enumerate() {
            // 0 on the facet opposite corner k, 1 at that corner.
            let length = dot(&gradient, &gradient).sqrt();
            let others = std::array::from_fn(|i| if i < k { i } else { i + 1 });
            self.facets.push(Facet {
                normal: gradient.map(|x| -x / length),
                vertices: others.map(|i| i as u16),
                neighbours: others.map(|i| i as u32),
                height: 0.0,
                seen_by: 0,
            });
            self.offsets.push(constant / length);
        }
        true
    }

    /// The facet whose plane is nearest to the origin, or farthest beyond it if the origin is outside.
    fn nearest_facet(&self) -> u32 {
        let mut nearest = (f64::INFINITY, 0);
        for (index, &offset) in self.offsets.iter().enumerate() {
            if offset < nearest.0 {
                nearest = (offset, index as u32);
            }
        }
        nearest.1
    }

    /// Outward unit normal of a facet and its signed distance from the origin.
    fn plane(&self, facet: u32) -> (ScaledWrench, f64) {
        (self.facets[facet as usize].normal, self.offsets[facet as usize])
    }

    /// Adds a vertex outside `facet`; false if it is not outside, or if rounding has broken the polytope.
    fn expand(&mut self, facet: u32, vertex: ScaledWrench) -> bool {
        let height = dot(&self.facets[facet as usize].normal, &vertex) - self.offsets[facet as usize];
        if height <= OUTSIDE {
            return false;
        }
        let name = self.vertices;
        self.vertices += 1;
        self.created.clear();
        self.removing.clear();
        self.removing.push(facet);
        self.facets[facet as usize].height = height;
        self.facets[facet as usize].seen_by = name;
        let mut visited = 0;
        while visited < self.removing.len() {
            let from = self.removing[visited];
            visited += 1;
            for ridge in 0..DIMENSIONS {
                let to = self.facets[from as usize].neighbours[ridge];
                let neighbour = &mut self.facets[to as usize];
                if neighbour.seen_by != name {
                    neighbour.seen_by = name;
                    neighbour.height = dot(&neighbour.normal, &vertex) - self.offsets[to as usize];
                    if neighbour.height > OUTSIDE {
                        self.removing.push(to);
                    }
                }
                if self.facets[to as usize].height <= OUTSIDE {
                    self.create(from, ridge, to, name);
                }
            }
        }
        self.made += self.created.len();
        for k in 0..self.created.len() {
            let (index, replaced) = self.created[k];
            if self.link(index, replaced).is_none() {
                return false;
            }
        }
        for &index in &self.removing {
            self.offsets[index as usize] = f64::INFINITY;
        }
        self.removed.append(&mut self.removing);
        true
    }

    /// Creates the facet at the ridge of facet `removing`, opposite its vertex `ridge`, that borders on facet `remaining`.
    fn create(&mut self, removing: u32, ridge: usize, remaining: u32, name: u32) {
        let (from, to) = (&self.facets[removing as usize], &self.facets[remaining as usize]);
        let (a, b) = ((-to.height).max(0.0), from.height);
        let sum: ScaledWrench = std::array::from_fn(|k| a * from.normal[k] + b * to.normal[k]);
        let scale = dot(&sum, &sum).sqrt().recip();
        let offset = (a * self.offsets[removing as usize] + b * self.offsets[remaining as usize]) * scale;
        let mut facet = Facet {
            normal: sum.map(|x| x * scale),
            vertices: from.vertices,
            // The others are linked once all new facets exist.
            neighbours: [removing; DIMENSIONS],
            height: 0.0,
            seen_by: name,
        };
        facet.vertices[ridge] = name as u16;
        facet.neighbours[ridge] = remaining;
        let index = if let Some(index) = self.removed.pop() {
            self.facets[index as usize] = facet;
            self.offsets[index as usize] = offset;
            index
        } else {
            self.facets.push(facet);
            self.offsets.push(offset);
            self.facets.len() as u32 - 1
        };
        self.created.push((index, removing));
        self.facets[removing as usize].neighbours[ridge] = NEW | index;
        for neighbour in &mut self.facets[remaining as usize].neighbours {
            if *neighbour == removing {
                *neighbour = index;
            }
        }
    }

    /// Links a new facet to its new neighbours: walks through the removed facets around each shared ridge. `None` if a walk
    /// does not end because rounding has broken the surface.
    fn link(&mut self, index: u32, replaced: u32) -> Option<()> {
        let newest = (self.vertices - 1) as u16;
        let at_newest = position(&self.facets[index as usize].vertices, newest)?;
        for other in (0..DIMENSIONS).filter(|&k| k != at_newest) {
            if self.facets[index as usize].neighbours[other] != replaced {
                // Already linked from the other side.
                continue;
            }
            let mut from = replaced;
            let mut pivot = self.facets[from as usize].vertices[at_newest];
            let mut across = other;
            let mut steps = 0;
            loop {
                let to = self.facets[from as usize].neighbours[across];
                if to & NEW != 0 {
                    // The new facet's vertices keep the positions they have in the facet it replaces.
                    let found = to & !NEW;
                    let back = position(&self.facets[from as usize].vertices, pivot)?;
                    self.facets[index as usize].neighbours[other] = found;
                    self.facets[found as usize].neighbours[back] = index;
                    break;
                }
                // Enter `to`, whose unshared vertex becomes the one to keep, and leave it opposite the pivot.
                let entered = &self.facets[to as usize];
                let back = position(&entered.neighbours, from)?;
                across = position(&entered.vertices, pivot)?;
                pivot = entered.vertices[back];
                from = to;
                steps += 1;
                if steps > self.removing.len() {
                    return None;
                }
            }
        }
        Some(())
    }
}

fn position<T: Copy + PartialEq>(values: &[T; DIMENSIONS], value: T) -> Option<usize> {
    values.iter().position(|&v| v == value)
}

/// The normalised part of a vector that is orthogonal to an orthonormal basis.
fn orthonormalised(vector: ScaledWrench, basis: &[ScaledWrench]) -> ScaledWrench {
    let mut rest = vector;
    // Twice, because a single pass loses digits when little is left.
    for _ in 0..2 {
        for axis in basis {
            let along = dot(&rest, axis);
            for (x, a) in rest.iter_mut().zip(axis) {
                *x -= along * a;
            }
        }
    }
    let length = dot(&rest, &rest).sqrt();
    rest.map(|x| x / length)
}

/// A unit vector orthogonal to an orthonormal basis that does not span everything, from the axis that the basis covers least.
fn perpendicular(basis: &[ScaledWrench]) -> ScaledWrench {
    let covered = |k: usize| basis.iter().map(|axis| axis[k] * axis[k]).sum::<f64>();
    let mut least = 0;
    for k in 1..DIMENSIONS {
        if covered(k) < covered(least) {
            least = k;
        }
    }
    let mut axis = [0.0; DIMENSIONS];
    axis[least] = 1.0;
    orthonormalised(axis, basis)
}

/// Gradient and constant of each barycentric coordinate, by Gauss-Jordan elimination; `None` for a flat simplex.
fn barycentric_coordinates(
    corners: &[ScaledWrench; DIMENSIONS + 1],
) -> Option<[(ScaledWrench, f64); DIMENSIONS + 1]> {
    const N: usize = DIMENSIONS + 1;
    let mut left = [[1.0; N]; N];
    let mut right = [[0.0; N]; N];
    for (k, corner) in corners.iter().enumerate() {
        left[k][..DIMENSIONS].copy_from_slice(corner);
        right[k][k] = 1.0;
    }
    for column in 0..N {
        let mut pivot = column;
        for row in column + 1..N {
            if left[row][column].abs() > left[pivot][column].abs() {
                pivot = row;
            }
        }
        left.swap(column, pivot);
        right.swap(column, pivot);
        let scale = left[column][column].recip();
        if !scale.is_finite() {
            return None;
        }
        left[column] = left[column].map(|x| x * scale);
        right[column] = right[column].map(|x| x * scale);
        let (left_pivot, right_pivot) = (left[column], right[column]);
        for row in (0..N).filter(|&row| row != column) {
            let factor = left[row][column];
            for k in 0..N {
                left[row][k] -= factor * left_pivot[k];
                right[row][k] -= factor * right_pivot[k];
            }
        }
    }
    Some(std::array::from_fn(|k| {
        (std::array::from_fn(|i| right[i][k]), right[DIMENSIONS][k])
    }))
}
