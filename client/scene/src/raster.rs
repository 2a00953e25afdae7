//! The rasteriser: finds the visible triangle at each sample.

use glam::Vec3;
use rayon::prelude::*;

/// The id of samples without a triangle.
pub const NOTHING: u32 = u32::MAX;

/// Rows of samples per task. Fewer balance better over threads; more repeat less work at borders.
const BAND_ROWS: usize = 48;

/// Positions are snapped to 1/256 of a sample. This makes edge functions exact integers: triangles that share an edge
/// neither overlap nor leave gaps.
const SUBSAMPLE: f32 = 256.0;

/// Coordinates beyond this many samples are clamped, which keeps edge functions inside 64 bits.
const COORDINATE_LIMIT: f32 = 1.0e6;

/// A triangle on the screen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScreenTriangle {
    /// x to the right and y down in samples; z grows toward the camera and is linear over the screen (such as the
    /// reciprocal of the distance for a perspective camera).
    pub corners: [Vec3; 3],
    /// Id of the samples that it covers; not [`NOTHING`].
    pub id: u32,
}

/// The visible triangle at every sample, row by row from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Coverage {
    /// Samples per row.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// The id of the nearest triangle, or [`NOTHING`].
    pub ids: Vec<u32>,
    /// Its z at the sample; negative infinity without a triangle.
    pub depths: Vec<f32>,
}

/// Draws triangles from either side. A sample lies in the middle of its cell. Of two triangles at the same depth, the
/// earlier one is visible. `admits(id, x, y)` can make triangles transparent at some samples.
pub fn rasterise(
    width: usize,
    height: usize,
    triangles: &[ScreenTriangle],
    admits: impl Fn(u32, usize, usize) -> bool + Sync,
) -> Coverage {
    let prepared: Vec<Prepared> = triangles
        .iter()
        .filter_map(|triangle| Prepared::new(triangle, width, height))
        .collect();
    let mut bands = vec![Vec::new(); height.div_ceil(BAND_ROWS)];
    for (index, triangle) in prepared.iter().enumerate() {
        for band in &mut bands[triangle.rows.0 / BAND_ROWS..=(triangle.rows.1 - 1) / BAND_ROWS] {
            band.push(index);
        }
    }

    let mut ids = vec![NOTHING; width * height];
    let mut depths = vec![f32::NEG_INFINITY; width * height];
    ids.par_chunks_mut((width * BAND_ROWS).max(1))
        .zip(depths.par_chunks_mut((width * BAND_ROWS).max(1)))
        .zip(bands)
        .enumerate()
        .for_each(|(band, ((ids, depths), members))| {
            for index in members {
                prepared[index].draw(band * BAND_ROWS, width, ids, depths, &admits);
            }
        });
    Coverage {
        width,
        height,
        ids,
        depths,
    }
}

/// An edge function: positive inside, with the fill rule folded into its constant.
#[derive(Clone, Copy)]
struct Edge {
    /// Change for one sample to the right.
    dx: i64,
    /// Change for one sample down.
    dy: i64,
    /// Value at the middle of the first sample.
    origin: i64,
}

/// A triangle that covers at least a part of the screen.
struct Prepared {
    edges: [Edge; 3],
    /// z at the middle of the first sample, and its change to the right and down.
    depth: (f32, f32, f32),
    /// The nearest z of its corners, which rounding in the plane above must not exceed.
    depth_range: (f32, f32),
    columns: (usize, usize),
    rows: (usize, usize),
    id: u32,
}

impl Prepared {
    fn new(triangle: &ScreenTriangle, width: usize, height: usize) -> Option<Self> {
        let [a, mut b, mut c] = triangle.corners;
        let mut snapped = triangle.corners.map(|corner| {
            let snap = |v: f32| (v.clamp(-COORDINATE_LIMIT, COORDINATE_LIMIT) * SUBSAMPLE).round() as i64;
            (snap(corner.x), snap(corner.y))
        });
        let doubled_area = |[a, b, c]: [(i64, i64); 3]| (b.0 - a.0) * (c.1 - a.1) - (b.1 - a.1) * (c.0 - a.0);
        let area = doubled_area(snapped);
        if area == 0 {
            return None;
        }
        // Both sides are drawn: flip triangles seen from behind.
        if area < 0 {
            snapped.swap(1, 2);
            std::mem::swap(&mut b, &mut c);
        }

        let range = |values: [f32; 3], end: usize| {
            let low = values.into_iter().fold(f32::INFINITY, f32::min);
            let high = values.into_iter().fold(f32::NEG_INFINITY, f32::max);
            let low = low.floor().clamp(0.0, end as f32) as usize;
            let high = (high.ceil().clamp(0.0, end as f32) as usize + 1).min(end);
            (low < high).then_some((low, high))
        };
        let columns = range([a.x, b.x, c.x], width)?;
        let rows = range([a.y, b.y, c.y], height)?;

        let step = SUBSAMPLE as i64;
        let half = step / 2;
        let edge = |from: (i64, i64), to: (i64, i64)| {
            let (ex, ey) = (to.0 - from.0, to.1 - from.1);
            // Samples exactly on an edge belong to the triangle whose top or left edge it is.
            let top_left = ey < 0 || (ey == 0 && ex > 0);
            Edge {
                dx: -ey * step,
                dy: ex * step,
                origin: ex * (half - from.1) - ey * (half - from.0) - i64::from(!top_left),
            }
        };
        let edges = [
            edge(snapped[0], snapped[1]),
            edge(snapped[1], snapped[2]),
            edge(snapped[2], snapped[0]),
        ];

        // The plane z = depth.0 + depth.1 x + depth.2 y through the corners.
        let (u, v) = (b - a, c - a);
        let determinant = u.x * v.y - u.y * v.x;
        let (dx, dy) = if determinant == 0.0 {
            (0.0, 0.0)
        } else {
            (
                (u.z * v.y - v.z * u.y) / determinant,
                (v.z * u.x - u.z * v.x) / determinant,
            )
        };
        let depth = a.z + (0.5 - a.x) * dx + (0.5 - a.y) * dy;
        Some(Self {
            edges,
            depth: (depth, dx, dy),
            depth_range: (a.z.min(b.z).min(c.z), a.z.max(b.z).max(c.z)),
            columns,
            rows,
            id: triangle.id,
        })
    }

    /// Draws the rows of one band, whose first row is `first_row`.
    fn draw(
        &self,
        first_row: usize,
        width: usize,
        ids: &mut [u32],
        depths: &mut [f32],
        admits: &impl Fn(u32, usize, usize) -> bool,
    ) {
        let band_end = first_row + ids.len() / width;
        let (left, right) = self.columns;
        for y in self.rows.0.max(first_row)..self.rows.1.min(band_end) {
            let start = (y - first_row) * width;
            let ids = &mut ids[start..start + width];
            let depths = &mut depths[start..start + width];
            let mut values = self
                .edges
                .map(|edge| edge.origin + edge.dy * i64::from(y as u32) + edge.dx * i64::from(left as u32));
            let row_depth = self.depth.0 + self.depth.2 * y as f32;
            for x in left..right {
                if (values[0] | values[1] | values[2]) >= 0 {
                    let depth =
                        (row_depth + self.depth.1 * x as f32).clamp(self.depth_range.0, self.depth_range.1);
                    if depth > depths[x] && admits(self.id, x, y) {
                        depths[x] = depth;
                        ids[x] = self.id;
                    }
                }
                for (value, edge) in values.iter_mut().zip(&self.edges) {
                    *value += edge.dx;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn count(coverage: &Coverage, id: u32) -> usize {
        coverage.ids.iter().filter(|&&i| i == id).count()
    }

    fn triangle(id: u32, corners: [[f32; 3]; 3]) -> ScreenTriangle {
        ScreenTriangle {
            corners: corners.map(Vec3::from_array),
            id,
        }
    }

    fn everywhere(_: u32, _: usize, _: usize) -> bool {
        true
    }

    #[test]
    fn triangle_covers_its_area_from_both_sides() {
        let corners = [[12.3_f32, 20.1, 1.0], [480.7, 90.4, 1.0], [200.2, 455.9, 1.0]];
        let [a, b, c] = corners;
        let area = 0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).abs();
        let front = rasterise(512, 512, &[triangle(7, corners)], everywhere);
        let back = rasterise(512, 512, &[triangle(7, [a, c, b])], everywhere);
        assert!((count(&front, 7) as f32 - area).abs() < area * 0.002);
        assert_eq!(front.ids, back.ids);
    }

    #[test]
    fn shared_edges_leave_no_gaps_or_overlaps() {
        // A fan around an odd centre, square outside; each sample must be taken exactly once.
        let centre = [151.37, 97.83, 1.0];
        let ring: Vec<[f32; 3]> = (0..29_u16)
            .map(|i| {
                let angle = f32::from(i) / 29.0 * std::f32::consts::TAU;
                [150.0 + 400.0 * angle.cos(), 100.0 + 400.0 * angle.sin(), 1.0]
            })
            .collect();
        let fan: Vec<_> = (0..ring.len())
            .map(|i| triangle(i as u32, [centre, ring[i], ring[(i + 1) % ring.len()]]))
            .collect();
        let together = rasterise(300, 200, &fan, everywhere);
        assert_eq!(count(&together, NOTHING), 0);
        let separate: usize = fan
            .iter()
            .map(|t| count(&rasterise(300, 200, &[*t], everywhere), t.id))
            .sum();
        assert_eq!(separate, 300 * 200);
    }

    #[test]
    fn nearer_triangle_is_visible_in_any_order() {
        // Two triangles that cross: each is in front on one side of x = 50.
        let rising = triangle(0, [[-200.0, 0.0, -4.0], [300.0, 0.0, 6.0], [50.0, 900.0, 1.0]]);
        let falling = triangle(1, [[-200.0, 0.0, 6.0], [300.0, 0.0, -4.0], [50.0, 900.0, 1.0]]);
        for order in [[rising, falling], [falling, rising]] {
            let seen = rasterise(100, 100, &order, everywhere);
            for (i, &id) in seen.ids.iter().enumerate() {
                // The middle columns may go either way by rounding.
                match i % 100 {
                    x if x < 49 => assert_eq!(id, 1),
                    x if x > 50 => assert_eq!(id, 0),
                    _ => {}
                }
            }
        }
    }

    #[test]
    fn ignores_degenerate_and_off_screen_triangles() {
        let off = triangle(0, [[-9.0, -9.0, 1.0], [-1.0, -9.0, 1.0], [-9.0, -1.0, 1.0]]);
        let flat = triangle(1, [[1.0, 1.0, 1.0], [5.0, 5.0, 1.0], [9.0, 9.0, 1.0]]);
        let huge = triangle(2, [[-1e9, -1e9, 1.0], [1e9, -1e9, 1.0], [0.0, 1e9, 1.0]]);
        assert_eq!(count(&rasterise(10, 10, &[off, flat], everywhere), NOTHING), 100);
        assert_eq!(count(&rasterise(10, 10, &[huge], everywhere), 2), 100);
    }
}
