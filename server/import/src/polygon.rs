//! Splits polygons into triangles.
//!
//! A polygon of n corners always becomes n - 2 triangles, so that the indices of triangles follow from the numbers of
//! corners alone. Where its first corner sees all others, which holds for every convex polygon, they are the fan from
//! that corner; otherwise ears are clipped. No corner is skipped, not even one on a straight side: the neighbouring
//! face may have a corner there, and the surface must not open at it.

use std::collections::VecDeque;

use glam::{DVec2, DVec3};
use grasp_synthesis::base::stop::{Stop, Stopped};

/// Most corners of a polygon that is not split into a fan: clipping takes up to a second, and grows with the square of their number.
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
pub(crate) fn split(
    corners: &[DVec3],
    triangles: &mut Vec<[usize; 3]>,
    stop: Stop<'_>,
) -> Result<Split, Stopped> {
    let mut fan = || triangles.extend((2..corners.len()).map(|k| [0, k - 1, k]));
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
        && let Some(clipped) = clip(&outline, stop)?
    {
        triangles.extend(clipped);
        return Ok(Split::Exact);
    }
    fan();
    Ok(Split::Overlapping)
}

/// A polygon in its plane, counter-clockwise.
#[derive(Debug)]
struct Outline {
    /// Its corners, relative to the first.
    points: Vec<DVec2>,
    /// Rounding error of a position.
    rounding: f64,
}

impl Outline {
    /// The polygon on the plane of its mean normal; without such a plane, how its fan covers it.
    fn of(corners: &[DVec3]) -> Result<Self, Split> {
        let sizes = corners.iter().map(|corner| corner.abs().max_element());
        let largest = sizes.fold(0.0, f64::max);
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
        let offsets = corners.iter().map(|&corner| corner - first);
        let points = offsets
            .map(|offset| DVec2::new(offset.dot(x), offset.dot(y)))
            .collect();
        Ok(Self { points, rounding })
    }

    /// 1 if c is left of the line from a to b, -1 if it is right of it, 0 within the rounding error.
    fn side(&self, a: DVec2, b: DVec2, c: DVec2) -> i8 {
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

/// Rounds through all levels: clipping a corner without area can free ears where the polygon touches itself several times.
const ROUNDS: usize = 3;

/// How much an ear may touch the rest of the polygon. Later levels are for polygons that touch themselves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Level {
    /// Not at all.
    Clear,
    /// At its border.
    Touching,
    /// As before, and corners without area may go.
    Flat,
}

/// Triples of corners that cover a polygon that is no fan once, by clipping ears: corners whose triangle with their neighbours
/// lies inside. `None` if it intersects itself.
///
/// Clipping only shrinks the polygon, so a corner that is not an ear becomes one only when a neighbour changes
/// (O'Rourke, Computational Geometry in C, section 1.4). Polygons may touch themselves, as those do that reach a hole
/// over a side passed in both directions: a corner at the position of another one is judged by the directions of its
/// own sides.
fn clip(outline: &Outline, stop: Stop<'_>) -> Result<Option<Vec<[usize; 3]>>, Stopped> {
    let mut rest = Rest::of(outline);
    for _ in 0..ROUNDS {
        let before = rest.count;
        for level in [Level::Clear, Level::Touching, Level::Flat] {
            rest.clip(level, stop)?;
            if rest.count == 3 {
                return Ok(rest.finish());
            }
        }
        if rest.count == before {
            break;
        }
    }
    Ok(None)
}

/// The rest of a polygon.
struct Rest<'a> {
    outline: &'a Outline,
    /// The next corner of each corner that is left.
    next: Vec<usize>,
    /// The previous corner of each corner that is left.
    previous: Vec<usize>,
    /// Whether the corner is left.
    is_left: Vec<bool>,
    /// Number of corners that are left.
    count: usize,
    /// Corners that do not turn left. A corner inside a triangle implies that one of these is, too.
    blunt: Vec<usize>,
    triangles: Vec<[usize; 3]>,
}

impl<'a> Rest<'a> {
    fn of(outline: &'a Outline) -> Self {
        let count = outline.points.len();
        let mut rest = Self {
            outline,
            next: (0..count).map(|corner| (corner + 1) % count).collect(),
            previous: (0..count).map(|corner| (corner + count - 1) % count).collect(),
            is_left: vec![true; count],
            count,
            blunt: Vec::new(),
            triangles: Vec::with_capacity(count - 2),
        };
        rest.blunt = (0..count).filter(|&corner| rest.turn(corner) <= 0).collect();
        rest
    }

    fn point(&self, corner: usize) -> DVec2 {
        self.outline.points[corner]
    }

    fn side(&self, a: usize, b: usize, c: usize) -> i8 {
        self.outline.side(self.point(a), self.point(b), self.point(c))
    }

    /// 1 if the polygon turns left at the corner, -1 if right.
    fn turn(&self, corner: usize) -> i8 {
        self.side(self.previous[corner], corner, self.next[corner])
    }

    /// Clips ears until none is left or one triangle remains.
    fn clip(&mut self, level: Level, stop: Stop<'_>) -> Result<(), Stopped> {
        let corners = 0..self.is_left.len();
        let mut candidates: VecDeque<usize> = corners.filter(|&corner| self.is_left[corner]).collect();
        while let Some(corner) = candidates.pop_front()
            && self.count > 3
        {
            stop.check()?;
            if self.is_left[corner] && self.is_ear(corner, level) {
                candidates.extend(self.remove(corner));
            }
        }
        Ok(())
    }

    /// Makes a triangle of the corner and its neighbours; returns these.
    fn remove(&mut self, corner: usize) -> [usize; 2] {
        let (before, after) = (self.previous[corner], self.next[corner]);
        self.triangles.push([before, corner, after]);
        self.next[before] = after;
        self.previous[after] = before;
        self.is_left[corner] = false;
        self.count -= 1;
        self.blunt
            .retain(|blunt| ![before, corner, after].contains(blunt));
        for neighbour in [before, after] {
            if self.turn(neighbour) <= 0 {
                self.blunt.push(neighbour);
            }
        }
        [before, after]
    }

    fn is_ear(&self, corner: usize, level: Level) -> bool {
        let (before, after) = (self.previous[corner], self.next[corner]);
        let [a, b, c] = [before, corner, after].map(|corner| self.point(corner));
        match self.turn(corner) {
            1 => {}
            // A repeated corner or the tip of a spike bounds nothing.
            0 if self.turns_back(corner) => return true,
            0 => return level == Level::Flat,
            _ => return false,
        }
        // Whether the way between the ends of the ear starts inside the polygon.
        let opens_inward = |end: usize, side: i8| match self.turn(end) {
            1 => side >= 0,
            // The tip of a spike goes first.
            0 => !self.turns_back(end),
            _ => true,
        };
        opens_inward(before, self.side(self.previous[before], before, after))
            && opens_inward(after, self.side(after, self.next[after], before))
            && !self.blunt.iter().any(|&blunt| {
                let p = self.point(blunt);
                let inside = |from, to| self.outline.side(from, to, p);
                let depth = i8::from(level != Level::Clear);
                ![a, b, c].contains(&p)
                    && inside(a, b) >= depth
                    && inside(b, c) >= depth
                    && inside(c, a) >= depth
            })
    }

    /// Whether a corner that turns neither left nor right is not straight either: the polygon stops or turns back.
    fn turns_back(&self, corner: usize) -> bool {
        let [a, b, c] = [self.previous[corner], corner, self.next[corner]].map(|corner| self.point(corner));
        (b - a).dot(c - b) <= 0.0
    }

    /// Adds the last triangle; `None` if it is wound against the others.
    fn finish(mut self) -> Option<Vec<[usize; 3]>> {
        let corner = self.is_left.iter().position(|&is_left| is_left)?;
        if self.turn(corner) < 0 {
            return None;
        }
        let (before, after) = (self.previous[corner], self.next[corner]);
        self.triangles.push([before, corner, after]);
        Some(self.triangles)
    }
}
