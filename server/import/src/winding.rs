//! Makes triangles face outward where it is certain which way that is.
//!
//! A patch is a set of triangles joined across edges of exactly two. Within a patch, neighbours are made to agree, unless it is
//! one-sided like a Möbius strip. Patches that are closed, alone or together, then face outward if nothing encloses them; what is
//! enclosed is turned with what encloses it, since it may be the wall of a cavity. Open patches keep the side that most of their
//! area faces.

use std::{f64::consts::TAU, ops::Range};

use glam::{DVec3, Vec3};
use grasp_synthesis::base::stop::{Stop, Stopped};

use crate::{
    edges::{EdgeUse, Sets, by_edge},
    raw::{Oddities, Oddity},
};

/// Marks a triangle without a patch.
const NO_PATCH: u32 = u32::MAX;

/// Work per triangle of the mesh that may be spent on comparing parts: triangles seen from a point, and boxes compared.
const WORK_PER_TRIANGLE: usize = 64;

/// Work that may be spent in any case.
const MIN_WORK: usize = 1 << 16;

/// Share of a box's volume below which an enclosed volume counts as rounding error.
const NO_VOLUME: f64 = 1e-9;

/// Turns triangles, which it notes, and the uses of their edges.
pub(crate) fn face_outward(
    positions: &[Vec3],
    triangles: &mut [[u32; 3]],
    uses: &mut [EdgeUse],
    oddities: &mut Oddities,
    stop: Stop<'_>,
) -> Result<(), Stopped> {
    let mut patches = Patches::of(triangles.len(), uses);
    patches.keep_larger_side(positions, triangles);
    turn(triangles, uses, &patches.turns);
    stop.check()?;

    let sets = patches.closed(uses).into_iter();
    let parts = sets.map(|set| {
        let members = set.iter().flat_map(|&patch| patches.members(patch)).copied();
        ClosedPart::new(members.collect(), positions, triangles)
    });
    let parts: Vec<ClosedPart> = parts.collect();
    let mut is_inward = vec![false; triangles.len()];
    for part in facing_inward(&parts, positions, triangles, stop)? {
        for &triangle in &parts[part].triangles {
            is_inward[triangle as usize] = true;
        }
    }
    turn(triangles, uses, &is_inward);

    for (triangle, &inward) in is_inward.iter().enumerate() {
        if patches.turns[triangle] != inward {
            let is_mixed = patches.list[patches.of[triangle] as usize].is_mixed;
            let oddity = if is_mixed {
                Oddity::Disagreeing
            } else {
                Oddity::InsideOut
            };
            oddities.note(oddity, triangle);
        }
    }
    Ok(())
}

/// Turns the chosen triangles.
fn turn(triangles: &mut [[u32; 3]], uses: &mut [EdgeUse], is_chosen: &[bool]) {
    for (triangle, _) in triangles.iter_mut().zip(is_chosen).filter(|&(_, &chosen)| chosen) {
        triangle.swap(1, 2);
    }
    for edge in uses {
        if is_chosen[edge.triangle()] {
            edge.turn();
        }
    }
}

/// Triangles joined across edges of two.
#[derive(Debug)]
struct Patch {
    /// Its triangles among [`Patches::members`].
    members: Range<usize>,
    /// False for a one-sided one, whose triangles stay as they are.
    is_orientable: bool,
    /// Whether some of its triangles are turned and others are not.
    is_mixed: bool,
}

/// A triangle across an edge, and whether it faces the opposite way, in four bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Neighbour(u32);

impl Neighbour {
    const NONE: Self = Self(u32::MAX);

    fn new(triangle: usize, opposes: bool) -> Self {
        Self((triangle as u32) << 1 | u32::from(opposes))
    }

    fn parts(self) -> Option<(usize, bool)> {
        (self != Self::NONE).then_some(((self.0 >> 1) as usize, self.0 & 1 == 1))
    }
}

/// All patches of a mesh.
#[derive(Debug)]
struct Patches {
    list: Vec<Patch>,
    /// Triangles, patch after patch.
    members: Vec<u32>,
    /// The patch of each triangle.
    of: Vec<u32>,
    /// Whether each triangle has to be turned to agree with its patch.
    turns: Vec<bool>,
}

impl Patches {
    /// Finds patches, and which of their triangles disagree with the first.
    fn of(triangles: usize, uses: &[EdgeUse]) -> Self {
        let mut neighbours = vec![[Neighbour::NONE; 3]; triangles];
        let mut is_used = vec![false; triangles];
        for users in by_edge(uses) {
            for edge in users {
                is_used[edge.triangle()] = true;
            }
            if let &[a, b] = users {
                for (from, to) in [(a, b), (b, a)] {
                    let slots = &mut neighbours[from.triangle()];
                    if let Some(free) = slots.iter_mut().find(|other| **other == Neighbour::NONE) {
                        *free = Neighbour::new(to.triangle(), a.direction() == b.direction());
                    }
                }
            }
        }
        let mut patches = Self {
            list: Vec::new(),
            members: Vec::with_capacity(triangles),
            of: vec![NO_PATCH; triangles],
            turns: vec![false; triangles],
        };
        for first in (0..triangles).filter(|&triangle| is_used[triangle]) {
            if patches.of[first] == NO_PATCH {
                patches.add(first, &neighbours);
            }
        }
        patches
    }

    /// Adds the patch of a triangle.
    fn add(&mut self, first: usize, neighbours: &[[Neighbour; 3]]) {
        let patch = self.list.len() as u32;
        let start = self.members.len();
        let mut is_orientable = true;
        self.of[first] = patch;
        self.members.push(first as u32);
        let mut next = start;
        while let Some(&triangle) = self.members.get(next) {
            let triangle = triangle as usize;
            for (other, opposes) in neighbours[triangle].iter().filter_map(|other| other.parts()) {
                let turns = self.turns[triangle] != opposes;
                if self.of[other] == NO_PATCH {
                    self.of[other] = patch;
                    self.turns[other] = turns;
                    self.members.push(other as u32);
                } else {
                    is_orientable &= self.turns[other] == turns;
                }
            }
            next += 1;
        }
        let members = start..self.members.len();
        if !is_orientable {
            for &member in &self.members[members.clone()] {
                self.turns[member as usize] = false;
            }
        }
        let mut own = self.members[members.clone()].iter();
        self.list.push(Patch {
            is_mixed: own.any(|&member| self.turns[member as usize]),
            members,
            is_orientable,
        });
    }

    fn members(&self, patch: u32) -> &[u32] {
        &self.members[self.list[patch as usize].members.clone()]
    }

    /// Of each patch with triangles of both sides, turns those of the smaller area.
    fn keep_larger_side(&mut self, positions: &[Vec3], triangles: &[[u32; 3]]) {
        for patch in self.list.iter().filter(|patch| patch.is_mixed) {
            let members = &self.members[patch.members.clone()];
            let areas = members.iter().map(|&member| {
                let [a, b, c] = corners(positions, triangles[member as usize]);
                let area = (b - a).cross(c - a).length();
                if self.turns[member as usize] { area } else { -area }
            });
            if areas.sum::<f64>() > 0.0 {
                for &member in members {
                    self.turns[member as usize] ^= true;
                }
            }
        }
    }

    /// The sets of patches that enclose a volume, each patch alone if possible.
    fn closed(&self, uses: &[EdgeUse]) -> Vec<Vec<u32>> {
        let count = self.list.len();
        let mut is_open = vec![false; count];
        let mut balances: Vec<(u32, i32)> = Vec::new();
        for users in by_edge(uses) {
            self.balance(users, &mut balances);
            for &(patch, balance) in &balances {
                is_open[patch as usize] |= balance != 0;
            }
        }
        // Open patches that share an edge may close each other.
        let mut joined = Sets::new(count);
        let mut is_unbalanced = vec![false; count];
        for users in by_edge(uses) {
            self.balance(users, &mut balances);
            balances.retain(|&(patch, _)| is_open[patch as usize]);
            let sum: i32 = balances.iter().map(|&(_, balance)| balance).sum();
            let Some(&(first, _)) = balances.first() else {
                continue;
            };
            is_unbalanced[first as usize] |= sum != 0;
            for &(patch, _) in &balances[1..] {
                joined.join(first, patch);
            }
        }
        for patch in 0..count {
            let root = joined.root(patch as u32);
            is_unbalanced[root] |= is_unbalanced[patch];
        }
        let mut sets: Vec<Vec<u32>> = vec![Vec::new(); count];
        for (patch, Patch { is_orientable, .. }) in (0..).zip(&self.list) {
            let root = joined.root(patch);
            if *is_orientable && !is_unbalanced[root] {
                sets[root].push(patch);
            }
        }
        sets.retain(|set| !set.is_empty());
        sets
    }

    /// How often each patch at an edge passes it forward, less how often backward.
    fn balance(&self, users: &[EdgeUse], balances: &mut Vec<(u32, i32)>) {
        balances.clear();
        let directions = users
            .iter()
            .map(|edge| (self.of[edge.triangle()], edge.direction()));
        balances.extend(directions);
        balances.sort_unstable();
        balances.dedup_by(|next, kept| {
            let is_same = next.0 == kept.0;
            kept.1 += if is_same { next.1 } else { 0 };
            is_same
        });
    }
}

/// The corners of a triangle in double precision.
fn corners(positions: &[Vec3], triangle: [u32; 3]) -> [DVec3; 3] {
    triangle.map(|vertex| positions[vertex as usize].as_dvec3())
}

/// A closed part of a mesh.
#[derive(Debug)]
struct ClosedPart {
    triangles: Vec<u32>,
    low: Vec3,
    high: Vec3,
    /// Enclosed volume; negative if the part is inside out, 0 if there is none.
    volume: f64,
}

impl ClosedPart {
    fn new(members: Vec<u32>, positions: &[Vec3], triangles: &[[u32; 3]]) -> Self {
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for corner in members.iter().flat_map(|&member| triangles[member as usize]) {
            low = low.min(positions[corner as usize]);
            high = high.max(positions[corner as usize]);
        }
        let middle = low.as_dvec3().midpoint(high.as_dvec3());
        let tetrahedra = members.iter().map(|&member| {
            let [a, b, c] = corners(positions, triangles[member as usize]).map(|corner| corner - middle);
            a.dot(b.cross(c)) / 6.0
        });
        let volume: f64 = tetrahedra.sum();
        let of_box = (high.as_dvec3() - low.as_dvec3()).element_product();
        let has_volume = volume.abs() > NO_VOLUME * of_box;
        Self {
            triangles: members,
            low,
            high,
            volume: if has_volume { volume } else { 0.0 },
        }
    }

    fn is_in_box_of(&self, other: &Self) -> bool {
        self.low.cmpge(other.low).all() && self.high.cmple(other.high).all()
    }

    /// Whether the part encloses a point: how often, by the solid angles of its triangles.
    fn encloses(&self, point: DVec3, positions: &[Vec3], triangles: &[[u32; 3]]) -> bool {
        let shares = self.triangles.iter().map(|&member| {
            let [a, b, c] = corners(positions, triangles[member as usize]).map(|corner| corner - point);
            let (la, lb, lc) = (a.length(), b.length(), c.length());
            let below = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
            a.dot(b.cross(c)).atan2(below) / TAU
        });
        shares.sum::<f64>().abs() > 0.5
    }
}

/// The parts to turn, by index: those that are inside out and not enclosed, and all that these enclose.
///
/// A part that faces inward inside another is the wall of a cavity. If there are too many parts to compare, all are turned if
/// their volumes together are negative, and none otherwise.
fn facing_inward(
    parts: &[ClosedPart],
    positions: &[Vec3],
    triangles: &[[u32; 3]],
    stop: Stop<'_>,
) -> Result<Vec<usize>, Stopped> {
    if parts.iter().all(|part| part.volume >= 0.0) {
        return Ok(Vec::new());
    }
    let with_volume = (0..parts.len()).filter(|&part| parts[part].volume != 0.0);
    let mut by_volume: Vec<usize> = with_volume.collect();
    by_volume.sort_by(|&a, &b| parts[b].volume.abs().total_cmp(&parts[a].volume.abs()));
    let mut work = MIN_WORK + WORK_PER_TRIANGLE * triangles.len();
    let mut outermost: Vec<usize> = Vec::new();
    let mut is_inward = vec![false; parts.len()];
    for &index in &by_volume {
        stop.check()?;
        let part = &parts[index];
        let [point, ..] = corners(positions, triangles[part.triangles[0] as usize]);
        let mut around = None;
        for &other in &outermost {
            let candidate = &parts[other];
            let is_near = part.is_in_box_of(candidate);
            let cost = if is_near { candidate.triangles.len() } else { 1 };
            let Some(left) = work.checked_sub(cost) else {
                let sum: f64 = parts.iter().map(|part| part.volume).sum();
                return Ok(if sum < 0.0 { by_volume } else { Vec::new() });
            };
            work = left;
            if is_near && candidate.encloses(point, positions, triangles) {
                around = Some(other);
                break;
            }
        }
        is_inward[index] = around.map_or(part.volume < 0.0, |other| is_inward[other]);
        if around.is_none() {
            outermost.push(index);
        }
    }
    Ok((0..parts.len()).filter(|&part| is_inward[part]).collect())
}
