//! Splits a polygon that is not a fan by clipping ears: corners whose triangle with their neighbours lies inside.
//!
//! Clipping only shrinks the polygon, so a corner that is not an ear becomes one only when a neighbour changes
//! (O'Rourke, Computational Geometry in C, section 1.4). Polygons may touch themselves, as those do that reach a hole
//! over a side passed in both directions: a corner at the position of another one is judged by the directions of its
//! own sides.

use std::collections::VecDeque;

use glam::DVec2;
use grasp_synthesis::base::stop::{Stop, Stopped};

use crate::polygon::Outline;

/// Rounds through all levels. Clipping a corner without area can free ears elsewhere, once for each place where the
/// polygon touches itself several times.
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

/// Triples of corners that cover the polygon once; `None` if it intersects itself.
///
/// # Errors
/// [`Stopped`].
pub(crate) fn clip(outline: &Outline, stop: Stop<'_>) -> Result<Option<Vec<[usize; 3]>>, Stopped> {
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

/// What is left of a polygon.
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
        let mut candidates: VecDeque<usize> = (0..self.is_left.len())
            .filter(|&corner| self.is_left[corner])
            .collect();
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
        self.opens_inward(before, after) && self.opens_inward_reversed(after, before) && {
            !self.blunt.iter().any(|&blunt| {
                let p = self.point(blunt);
                if p == a || p == b || p == c {
                    return false;
                }
                let inside = |from, to| self.outline.side(from, to, p);
                let depth = match level {
                    Level::Clear => 0,
                    Level::Touching | Level::Flat => 1,
                };
                inside(a, b) >= depth && inside(b, c) >= depth && inside(c, a) >= depth
            })
        }
    }

    /// Whether the way from `before` to `after`, the other end of an ear, starts inside the polygon.
    fn opens_inward(&self, before: usize, after: usize) -> bool {
        match self.turn(before) {
            1 => self.side(self.previous[before], before, after) >= 0,
            // The tip of a spike goes first.
            0 => !self.turns_back(before),
            _ => true,
        }
    }

    /// The same from the ear's end to its start.
    fn opens_inward_reversed(&self, after: usize, before: usize) -> bool {
        match self.turn(after) {
            1 => self.side(after, self.next[after], before) >= 0,
            0 => !self.turns_back(after),
            _ => true,
        }
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
