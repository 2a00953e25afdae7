//! Splits polygons into triangles.
//!
//! A polygon of n corners always becomes n - 2 triangles, so that the indices of triangles follow from the numbers of
//! corners alone. Where its first corner sees all others, which holds for every convex polygon, they are the fan from
//! that corner; otherwise ears are clipped. No corner is skipped, not even one on a straight side: the neighbouring
//! face may have a corner there, and the surface must not open at it.

use glam::{DVec2, DVec3};
use grasp_synthesis::base::stop::{Stop, Stopped};

use crate::ears;

/// Largest number of corners of a polygon that is not split into a fan. Clipping ears takes a time that grows with the
/// square of this number: up to a second for one polygon.
pub(crate) const MAX_CLIPPED_CORNERS: usize = 10_000;

/// Rounding errors of a corner's position that the sign of an area must exceed: one for each of its two sides.
const ROUNDING_ERRORS: f64 = 2.0;

/// How a polygon was split.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Split {
    /// The triangles cover the polygon once.
    Exact,
    /// The polygon intersects itself: the triangles are the fan from its first corner, and overlap.
    Overlapping,
    /// The polygon has more than [`MAX_CLIPPED_CORNERS`] corners and is not a fan; it was not split.
    TooManyCorners,
}

/// Splits a polygon of at least three corners; appends triples of corners, wound as the polygon.
///
/// The positions are taken to be exact to single precision, at least as seen from the mesh's origin. A polygon that is not flat is
/// split as its projection on the plane of its mean normal.
///
/// # Errors
/// [`Stopped`].
pub(crate) fn split(
    corners: &[DVec3],
    triangles: &mut Vec<[usize; 3]>,
    stop: Stop<'_>,
) -> Result<Split, Stopped> {
    let mut fan = || triangles.extend((2..corners.len()).map(|k| [0, k - 1, k]));
    if corners.len() == 3 {
        fan();
        return Ok(Split::Exact);
    }
    let outline = match Outline::of(corners) {
        Ok(outline) => outline,
        Err(split) => {
            fan();
            return Ok(split);
        }
    };
    if outline.first_sees_all() {
        fan();
        return Ok(Split::Exact);
    }
    if corners.len() > MAX_CLIPPED_CORNERS {
        return Ok(Split::TooManyCorners);
    }
    if !outline.crosses_itself(stop)?
        && let Some(clipped) = ears::clip(&outline, stop)?
    {
        triangles.extend(clipped);
        return Ok(Split::Exact);
    }
    fan();
    Ok(Split::Overlapping)
}

/// A polygon in its plane, counter-clockwise.
#[derive(Debug)]
pub(crate) struct Outline {
    /// Its corners, relative to the first.
    pub(crate) points: Vec<DVec2>,
    /// Rounding error of a position.
    rounding: f64,
}

impl Outline {
    /// The polygon on the plane of its mean normal; without such a plane, how its fan covers it.
    fn of(corners: &[DVec3]) -> Result<Self, Split> {
        let largest = corners
            .iter()
            .map(|corner| corner.abs().max_element())
            .fold(0.0, f64::max);
        let rounding = largest * f64::from(f32::EPSILON);
        let first = corners[0];
        let mut normal = DVec3::ZERO;
        let mut perimeter = 0.0;
        let mut has_area = false;
        for pair in corners[1..].windows(2) {
            let (a, b) = (pair[0] - first, pair[1] - first);
            let area = a.cross(b);
            let tolerance = ROUNDING_ERRORS * rounding * (a.length() + b.length());
            normal += area;
            perimeter += pair[0].distance(pair[1]);
            has_area |= area.length() > tolerance;
        }
        // A corner that is off by the rounding error adds a sliver along its sides.
        if normal.length() <= 2.0 * ROUNDING_ERRORS * rounding * perimeter {
            // Either nothing has an area, or areas of opposite windings cancel.
            return Err(if has_area {
                Split::Overlapping
            } else {
                Split::Exact
            });
        }
        let (x, y) = normal.normalize().any_orthonormal_pair();
        let points = corners
            .iter()
            .map(|&corner| DVec2::new((corner - first).dot(x), (corner - first).dot(y)))
            .collect();
        Ok(Self { points, rounding })
    }

    /// 1 if c is left of the line from a to b, -1 if it is right of it, 0 within the rounding error.
    pub(crate) fn side(&self, a: DVec2, b: DVec2, c: DVec2) -> i8 {
        let (ab, ac) = (b - a, c - a);
        let area = ab.perp_dot(ac);
        let sides = ab.abs().element_sum() + ac.abs().element_sum();
        let tolerance = ROUNDING_ERRORS * self.rounding * sides;
        i8::from(area > tolerance) - i8::from(area < -tolerance)
    }

    /// Whether the fan from the first corner covers the polygon once.
    fn first_sees_all(&self) -> bool {
        let first = self.points[0];
        let mut angle = 0.0;
        for pair in self.points[1..].windows(2) {
            let (a, b) = (pair[0] - first, pair[1] - first);
            let along = a.dot(b);
            match self.side(first, pair[0], pair[1]) {
                1 => angle += a.perp_dot(b).atan2(along),
                // A side that passes through the first corner divides the polygon there.
                0 if along >= 0.0 => {}
                _ => return false,
            }
        }
        angle < std::f64::consts::TAU
    }

    /// Whether two sides cross at a point inside both.
    fn crosses_itself(&self, stop: Stop<'_>) -> Result<bool, Stopped> {
        let ends = self.points.iter().copied().cycle().skip(1);
        let mut sides: Vec<[DVec2; 2]> = self.points.iter().copied().zip(ends).map(Into::into).collect();
        let left = |[a, b]: [DVec2; 2]| a.x.min(b.x);
        sides.sort_unstable_by(|&a, &b| left(a).total_cmp(&left(b)));
        for (place, &[a, b]) in sides.iter().enumerate() {
            stop.check()?;
            let right = a.x.max(b.x);
            let crosses = sides[place + 1..]
                .iter()
                .take_while(|&&side| left(side) <= right)
                .any(|&[c, d]| {
                    a.y.min(b.y) <= c.y.max(d.y)
                        && c.y.min(d.y) <= a.y.max(b.y)
                        && self.side(a, b, c) * self.side(a, b, d) < 0
                        && self.side(c, d, a) * self.side(c, d, b) < 0
                });
            if crosses {
                return Ok(true);
            }
        }
        Ok(false)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flat(corners: &[(f64, f64)]) -> Vec<DVec3> {
        corners.iter().map(|&(x, y)| DVec3::new(x, y, 0.0)).collect()
    }

    /// Twice the area of each triangle, positive if counter-clockwise seen from +Z.
    fn split_areas(corners: &[(f64, f64)]) -> (Split, Vec<f64>) {
        let corners = flat(corners);
        let mut triangles = Vec::new();
        let split = split(&corners, &mut triangles, Stop::NEVER).unwrap();
        let areas = triangles
            .iter()
            .map(|triangle| {
                let [a, b, c] = triangle.map(|corner| corners[corner]);
                (b - a).cross(c - a).z
            })
            .collect();
        (split, areas)
    }

    #[test]
    fn hole_at_a_bridge_stays_open() {
        // A square of 4 with a square hole of 2, joined by a side that is passed in both directions.
        let ring = [
            (0.0, 0.0),
            (4.0, 0.0),
            (4.0, 4.0),
            (0.0, 4.0),
            (0.0, 0.0),
            (1.0, 1.0),
            (1.0, 3.0),
            (3.0, 3.0),
            (3.0, 1.0),
            (1.0, 1.0),
        ];
        for start in 0..ring.len() {
            let mut turned = ring;
            turned.rotate_left(start);
            let (split, areas) = split_areas(&turned);
            assert_eq!(split, Split::Exact, "{start}");
            assert_eq!(areas.len(), 8);
            assert!(areas.iter().all(|&area| area >= 0.0), "{start}: {areas:?}");
            assert_eq!(areas.iter().sum::<f64>(), 2.0 * 12.0, "{start}");
        }
    }

    #[test]
    fn spike_and_repeated_corner_have_no_area() {
        // An L whose corners repeat, with a spike of no width at its end.
        let outline = [
            (0.0, 0.0),
            (2.0, 0.0),
            (5.0, 0.0),
            (2.0, 0.0),
            (2.0, 1.0),
            (2.0, 1.0),
            (1.0, 1.0),
            (1.0, 2.0),
            (0.0, 2.0),
        ];
        for start in 0..outline.len() {
            let mut turned = outline;
            turned.rotate_left(start);
            let (split, areas) = split_areas(&turned);
            assert_eq!(split, Split::Exact, "{start}");
            assert_eq!(areas.len(), 7);
            assert!(areas.iter().all(|&area| area >= 0.0), "{start}: {areas:?}");
            assert_eq!(areas.iter().sum::<f64>(), 2.0 * 3.0, "{start}");
        }
    }

    #[test]
    fn polygons_that_cross_themselves_are_overlapping_fans() {
        let bow_tie = [(0.0, 0.0), (2.0, 2.0), (2.0, 0.0), (0.0, 2.0)];
        let uneven_bow_tie = [(0.0, 0.0), (3.0, 3.0), (3.0, 0.0), (0.0, 2.0)];
        let star: [(f64, f64); 5] = std::array::from_fn(|k| {
            let angle = 0.8 * std::f64::consts::PI * k as f64;
            (angle.cos(), angle.sin())
        });
        for crossed in [&bow_tie[..], &uneven_bow_tie, &star] {
            let mut triangles = Vec::new();
            assert_eq!(
                split(&flat(crossed), &mut triangles, Stop::NEVER),
                Ok(Split::Overlapping)
            );
            let fan: Vec<_> = (2..crossed.len()).map(|k| [0, k - 1, k]).collect();
            assert_eq!(triangles, fan);
        }
    }

    #[test]
    fn line_is_a_fan_without_area() {
        let (split, areas) = split_areas(&[(0.0, 0.0), (1.0, 1.0), (3.0, 3.0), (2.0, 2.0)]);
        assert_eq!(split, Split::Exact);
        assert_eq!(areas, [0.0; 2]);
    }

    #[test]
    fn refuses_to_clip_more_corners_than_the_limit() {
        let teeth = |corners: usize| -> Vec<DVec3> {
            let tooth = |k: usize| DVec3::new(k as f64, (k % 2) as f64, 0.0);
            std::iter::once(DVec3::new(0.0, -1.0, 0.0))
                .chain((1..corners).map(tooth))
                .collect()
        };
        let mut triangles = Vec::new();
        assert_eq!(
            split(&teeth(MAX_CLIPPED_CORNERS + 1), &mut triangles, Stop::NEVER),
            Ok(Split::TooManyCorners)
        );
        assert_eq!(split(&teeth(1001), &mut triangles, Stop::NEVER), Ok(Split::Exact));
        assert_eq!(triangles.len(), 999);
    }
}
