//! Triangles that occur more than once, with the same or with the opposite winding.

use grasp_synthesis::base::stop::{Stop, Stopped};

use crate::{
    edges::{EdgeUse, by_edge, drop_uses, edge_uses},
    raw::Occurrences,
};

/// Triangles that are there twice, by index.
#[derive(Debug, Default)]
pub(crate) struct Doubles {
    /// The edges of all triangles that are kept.
    pub(crate) uses: Vec<EdgeUse>,
    /// Whether each triangle is dropped, those without area included.
    pub(crate) is_dropped: Vec<bool>,
    /// Triangles that repeat an earlier one, with its winding.
    pub(crate) repeated: Occurrences,
    /// Triangles that repeat an earlier one with the opposite winding and were dropped.
    pub(crate) two_sided: Occurrences,
    /// Those that were kept: the rest of the surface is closed without either.
    pub(crate) undecided: Occurrences,
}

/// Two triangles of the same corners and opposite windings.
#[derive(Clone, Copy, Debug)]
struct Pair {
    earlier: u32,
    later: u32,
}

impl Doubles {
    /// Finds repeated triangles among those that are not dropped yet, and decides of which two-sided ones only the earlier side is
    /// kept.
    ///
    /// One side is kept of a patch of pairs that the rest of the surface needs to be closed, and of a sheet that touches
    /// nothing else.
    /// Which of the two it is does not matter: the winding is repaired later.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(crate) fn of(triangles: &[[u32; 3]], is_dropped: Vec<bool>, stop: Stop<'_>) -> Result<Self, Stopped> {
        let mut doubles = Self {
            is_dropped,
            ..Self::default()
        };
        let pairs = doubles.drop_repeated(triangles);
        stop.check()?;
        doubles.uses = edge_uses(triangles, &doubles.is_dropped);
        if !pairs.is_empty() {
            doubles.drop_sides(&pairs);
        }
        stop.check()?;
        Ok(doubles)
    }

    /// Drops triangles that repeat earlier ones; returns the pairs among the rest.
    fn drop_repeated(&mut self, triangles: &[[u32; 3]]) -> Vec<Pair> {
        let mut sorted = Vec::with_capacity(triangles.len());
        for ((&corners, &is_dropped), triangle) in triangles.iter().zip(&self.is_dropped).zip(0_u32..) {
            if !is_dropped {
                let mut key = corners;
                key.sort_unstable();
                sorted.push((key, triangle));
            }
        }
        sorted.sort_unstable();
        let mut pairs = Vec::new();
        for same in sorted.chunk_by(|a, b| a.0 == b.0) {
            let (_, first) = same[0];
            let mut opposite = None;
            for &(_, other) in &same[1..] {
                let is_opposite = is_even(triangles[first as usize]) != is_even(triangles[other as usize]);
                if is_opposite && opposite.is_none() {
                    opposite = Some(other);
                } else {
                    self.repeated.note_least(other as usize);
                    self.is_dropped[other as usize] = true;
                }
            }
            pairs.extend(opposite.map(|later| Pair {
                earlier: first,
                later,
            }));
        }
        pairs
    }

    fn drop_sides(&mut self, pairs: &[Pair]) {
        const UNPAIRED: u32 = u32::MAX;
        let mut pair_of = vec![UNPAIRED; self.is_dropped.len()];
        for (index, pair) in pairs.iter().enumerate() {
            pair_of[pair.earlier as usize] = index as u32;
            pair_of[pair.later as usize] = index as u32;
        }
        // Patches of pairs that share edges, and how the rest of the surface is there.
        let mut above: Vec<u32> = (0..pairs.len() as u32).collect();
        let mut root = |mut item: u32, joined: Option<u32>| {
            while above[item as usize] != item {
                above[item as usize] = above[above[item as usize] as usize];
                item = above[item as usize];
            }
            if let Some(lower) = joined {
                above[item as usize] = lower;
            }
            item
        };
        let (mut closes, mut is_spare) = (vec![false; pairs.len()], vec![false; pairs.len()]);
        for users in by_edge(&self.uses) {
            let of_pairs = || {
                users
                    .iter()
                    .map(|edge| pair_of[edge.triangle() as usize])
                    .filter(|&pair| pair != UNPAIRED)
            };
            let rest = || {
                users
                    .iter()
                    .filter(|edge| pair_of[edge.triangle() as usize] == UNPAIRED)
            };
            let Some(first) = of_pairs().next() else { continue };
            for other in of_pairs() {
                let first = root(first, None);
                if root(other, None) != first {
                    root(other, Some(first));
                }
            }
            if rest().next().is_some() {
                let is_balanced = rest().map(|edge| edge.direction()).sum::<i32>() == 0;
                let kind = if is_balanced { &mut is_spare } else { &mut closes };
                kind[first as usize] = true;
            }
        }
        for pair in 0..pairs.len() as u32 {
            let root = root(pair, None) as usize;
            closes[root] |= closes[pair as usize];
            is_spare[root] |= is_spare[pair as usize];
        }
        for (index, pair) in pairs.iter().enumerate() {
            let root = root(index as u32, None) as usize;
            if is_spare[root] && !closes[root] {
                self.undecided.note_least(pair.later as usize);
            } else {
                self.two_sided.note_least(pair.later as usize);
                self.is_dropped[pair.later as usize] = true;
            }
        }
        drop_uses(&mut self.uses, &self.is_dropped);
    }
}

/// Whether corners are in ascending order, up to rotation.
fn is_even([a, b, c]: [u32; 3]) -> bool {
    (a < b) == ((b < c) == (a < c))
}
