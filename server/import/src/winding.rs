//! Makes triangles face outward where it is certain which way that is.
//!
//! A patch is a set of triangles joined across edges of exactly two. Within a patch, neighbours are made to agree, unless it is
//! one-sided like a Möbius strip. Patches that are closed, alone or together, then face outward if nothing encloses them; what is
//! enclosed is turned with what encloses it, since it may be the wall of a cavity. Open patches keep the side that most of their
//! area faces.

use glam::{DVec3, Vec3};
use grasp_synthesis::base::stop::{Stop, Stopped};

use crate::{
    edges::{EdgeUse, by_edge},
    nesting::{Closed, facing_inward},
    raw::Occurrences,
};

/// Marks a triangle without a patch.
const NO_PATCH: u32 = u32::MAX;

/// What was turned, by triangle.
#[derive(Debug, Default)]
pub(crate) struct Turned {
    /// Triangles that disagreed with the rest of their patch.
    pub(crate) disagreeing: Occurrences,
    /// Triangles of closed parts that were inside out.
    pub(crate) inside_out: Occurrences,
}

/// Triangles joined across edges of two.
#[derive(Debug)]
struct Patch {
    /// Its triangles, as a range of [`Patches::members`].
    start: usize,
    end: usize,
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

    fn new(triangle: u32, opposes: bool) -> Self {
        Self(triangle << 1 | u32::from(opposes))
    }

    fn parts(self) -> Option<(u32, bool)> {
        (self != Self::NONE).then_some((self.0 >> 1, self.0 & 1 == 1))
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

/// Turns triangles and the uses of their edges.
///
/// # Errors
/// [`Stopped`].
pub(crate) fn repair(
    positions: &[Vec3],
    triangles: &mut [[u32; 3]],
    uses: &mut [EdgeUse],
    stop: Stop<'_>,
) -> Result<Turned, Stopped> {
    let mut patches = Patches::of(triangles.len(), uses);
    patches.keep_larger_side(positions, triangles);
    turn(triangles, uses, &patches.turns);
    stop.check()?;

    let closed = patches.closed(uses);
    let mut is_inward = vec![false; patches.list.len()];
    for part in facing_inward(
        &patches.volumes(&closed, positions, triangles),
        positions,
        triangles,
        stop,
    )? {
        for &patch in &closed[part] {
            is_inward[patch as usize] = true;
        }
    }
    let inward: Vec<bool> = (0..triangles.len())
        .map(|triangle| patches.of[triangle] != NO_PATCH && is_inward[patches.of[triangle] as usize])
        .collect();
    turn(triangles, uses, &inward);

    let mut turned = Turned::default();
    for (triangle, &inward) in inward.iter().enumerate() {
        if patches.turns[triangle] != inward {
            let patch = &patches.list[patches.of[triangle] as usize];
            let of_kind = if patch.is_mixed {
                &mut turned.disagreeing
            } else {
                &mut turned.inside_out
            };
            of_kind.note(triangle);
        }
    }
    Ok(turned)
}

/// Turns the chosen triangles.
fn turn(triangles: &mut [[u32; 3]], uses: &mut [EdgeUse], is_chosen: &[bool]) {
    for (triangle, _) in triangles.iter_mut().zip(is_chosen).filter(|&(_, &chosen)| chosen) {
        triangle.swap(1, 2);
    }
    for edge in uses {
        if is_chosen[edge.triangle() as usize] {
            edge.turn();
        }
    }
}

impl Patches {
    /// Finds patches, and which of their triangles disagree with the first.
    fn of(triangles: usize, uses: &[EdgeUse]) -> Self {
        let mut neighbours = vec![[Neighbour::NONE; 3]; triangles];
        let mut is_used = vec![false; triangles];
        for users in by_edge(uses) {
            for edge in users {
                is_used[edge.triangle() as usize] = true;
            }
            if let &[a, b] = users {
                for (from, to) in [(a, b), (b, a)] {
                    let slots = &mut neighbours[from.triangle() as usize];
                    if let Some(free) = slots.iter_mut().find(|other| **other == Neighbour::NONE) {
                        *free = Neighbour::new(to.triangle(), a.is_forward() == b.is_forward());
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
        for (first, _) in is_used.iter().enumerate().filter(|(_, is_used)| **is_used) {
            if patches.of[first] == NO_PATCH {
                patches.add(first as u32, &neighbours);
            }
        }
        patches
    }

    /// Adds the patch of a triangle.
    fn add(&mut self, first: u32, neighbours: &[[Neighbour; 3]]) {
        let patch = self.list.len() as u32;
        let start = self.members.len();
        let mut is_orientable = true;
        self.of[first as usize] = patch;
        self.members.push(first);
        let mut next = start;
        while let Some(&triangle) = self.members.get(next) {
            for neighbour in &neighbours[triangle as usize] {
                let Some((other, opposes)) = neighbour.parts() else {
                    continue;
                };
                let turns = self.turns[triangle as usize] != opposes;
                if self.of[other as usize] == NO_PATCH {
                    self.of[other as usize] = patch;
                    self.turns[other as usize] = turns;
                    self.members.push(other);
                } else {
                    is_orientable &= self.turns[other as usize] == turns;
                }
            }
            next += 1;
        }
        let end = self.members.len();
        if !is_orientable {
            for &member in &self.members[start..end] {
                self.turns[member as usize] = false;
            }
        }
        let is_mixed = self.members[start..end]
            .iter()
            .any(|&member| self.turns[member as usize]);
        self.list.push(Patch {
            start,
            end,
            is_orientable,
            is_mixed,
        });
    }

    fn members(&self, patch: u32) -> &[u32] {
        let Patch { start, end, .. } = self.list[patch as usize];
        &self.members[start..end]
    }

    /// Of each patch with triangles of both sides, turns those of the smaller area.
    fn keep_larger_side(&mut self, positions: &[Vec3], triangles: &[[u32; 3]]) {
        for patch in 0..self.list.len() as u32 {
            if !self.list[patch as usize].is_mixed {
                continue;
            }
            let areas = self.members(patch).iter().map(|&member| {
                let [a, b, c] = corners(positions, triangles[member as usize]);
                let area = (b - a).cross(c - a).length();
                if self.turns[member as usize] { area } else { -area }
            });
            if areas.sum::<f64>() > 0.0 {
                let Patch { start, end, .. } = self.list[patch as usize];
                for &member in &self.members[start..end] {
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
        let mut above: Vec<u32> = (0..count as u32).collect();
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
                let (a, b) = (root(&mut above, first), root(&mut above, patch));
                above[b as usize] = a;
            }
        }
        for patch in 0..count as u32 {
            if is_unbalanced[patch as usize] {
                let root = root(&mut above, patch);
                is_unbalanced[root as usize] = true;
            }
        }
        let mut sets: Vec<Vec<u32>> = vec![Vec::new(); count];
        for patch in 0..count as u32 {
            let root = root(&mut above, patch);
            if self.list[patch as usize].is_orientable && !is_unbalanced[root as usize] {
                sets[root as usize].push(patch);
            }
        }
        sets.retain(|set| !set.is_empty());
        sets
    }

    /// How often each patch at an edge passes it forward, less how often backward.
    fn balance(&self, users: &[EdgeUse], balances: &mut Vec<(u32, i32)>) {
        balances.clear();
        balances.extend(
            users
                .iter()
                .map(|edge| (self.of[edge.triangle() as usize], edge.direction())),
        );
        balances.sort_unstable();
        balances.dedup_by(|next, kept| {
            let is_same = next.0 == kept.0;
            kept.1 += if is_same { next.1 } else { 0 };
            is_same
        });
    }

    /// Volume and box of each closed set of patches.
    fn volumes(&self, closed: &[Vec<u32>], positions: &[Vec3], triangles: &[[u32; 3]]) -> Vec<Closed> {
        closed
            .iter()
            .map(|set| {
                let members = set.iter().flat_map(|&patch| self.members(patch)).copied();
                Closed::new(members.collect(), positions, triangles)
            })
            .collect()
    }
}

fn root(above: &mut [u32], mut item: u32) -> u32 {
    while above[item as usize] != item {
        above[item as usize] = above[above[item as usize] as usize];
        item = above[item as usize];
    }
    item
}

/// The corners of a triangle in double precision.
pub(crate) fn corners(positions: &[Vec3], triangle: [u32; 3]) -> [DVec3; 3] {
    triangle.map(|vertex| positions[vertex as usize].as_dvec3())
}
