//! Shortlists: a few grips of an atlas of which nearly every giver leaves one free.
//!
//! The best grips by score lie next to each other on the object, and a giver that obstructs the first
//! obstructs hundreds. So a look-up starts with grips that complement one another: for each direction of
//! gravity, those that together serve a sample of givers best. A giver is served by the best listed grip that
//! is clear of it, provided that its score is within [`SCORE_MARGIN`] of the best clear grip of all. They are
//! tried by falling score, then all others are.
//!
//! The objective is a sum of maxima (facility location), which is monotone and submodular. Greedy selection
//! then reaches at least 1 − 1/e of the optimum (G. L. Nemhauser, L. A. Wolsey and M. L. Fisher, "An analysis
//! of approximations for maximizing submodular set functions I", 1978). As gains never grow, only the top
//! candidates are evaluated again (M. Minoux, "Accelerated greedy algorithms", 1978).

use std::{
    cmp::Reverse,
    collections::{BinaryHeap, binary_heap::PeekMut},
};

use glam::Vec3;

use super::{
    entry::{Entry, SLIPS},
    gravity::{DIRECTIONS, nearest_direction},
    inner_spheres::{first_spheres, second_spheres},
    occupancy::Occupancy,
};
use crate::{
    model::hand::rig::Rig,
    physical::{
        barriers::Barriers,
        grip::GIVER_CLEARANCE,
        solids::{Spheres, TrackedSolids},
    },
};

/// Grips per list. Fewer leave more givers without a listed grip and lower the scores of the others; more
/// delay the first valid one. The first 48 by score alone would serve far fewer givers.
const LIST_LENGTH: usize = 96;

/// Number of sampled givers. With half as many, up to 4 of a hundred holdouts more find no listed grip. They
/// cost time in proportion: a tenth of a second when an atlas is loaded.
const SAMPLED_GIVERS: usize = 512;

/// How far a grip's score may be below that of the best clear grip to serve a giver, in steps of 1/254. More
/// finds a listed grip for more givers, at lower scores.
const SCORE_MARGIN: u8 = 40;

/// Givers whose gains are added at once: a register of bytes.
const LANES: usize = 32;

/// For each giver, all bits set if it is clear of a grip, else 0.
type ClearOf = [u8; SAMPLED_GIVERS];

/// A grip on a list. There are a few hundred in all, and nearly every look-up starts with them, so their
/// solids are kept.
#[derive(Clone, Debug, PartialEq)]
pub struct Listed {
    /// Its index in [`super::atlas::Atlas::entries`].
    pub entry: u16,
    second_spheres: Spheres,
    solids: TrackedSolids,
}

/// The lists for all directions of gravity.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Shortlists {
    grips: Vec<Listed>,
    /// The first inner spheres of each listed grip, contiguous.
    inner_spheres: Vec<Spheres>,
    /// For each direction, the grips on its list.
    by_direction: Vec<Vec<u16>>,
}

/// The list for one direction of gravity.
#[derive(Clone, Copy, Debug, Default)]
pub struct Shortlist<'a> {
    /// The grips of all lists, and their first inner spheres.
    grips: &'a [Listed],
    inner_spheres: &'a [Spheres],
    /// The indices of the grips on this list.
    places: &'a [u16],
}

impl<'a> Shortlist<'a> {
    /// The grips on the list, by falling score.
    pub fn iter(self) -> impl Iterator<Item = &'a Listed> {
        let grips = self.grips;
        self.places.iter().map(|&place| &grips[usize::from(place)])
    }

    /// The length of the list.
    pub fn len(&self) -> usize {
        self.places.len()
    }

    /// True if the list is empty.
    pub fn is_empty(&self) -> bool {
        self.places.is_empty()
    }

    /// The grip at a place of the list, with its solids.
    pub fn at(&self, place: usize) -> (u16, &'a TrackedSolids) {
        let grip = &self.grips[usize::from(self.places[place])];
        (grip.entry, &grip.solids)
    }

    /// The grip at a place of the list with its solids, unless its inner spheres show that it is too close to
    /// a barrier. Conservative: a grip that passes may still collide.
    #[inline]
    pub fn screen(&self, place: usize, barriers: Barriers<'_>) -> Option<(u16, &'a TrackedSolids)> {
        let place = usize::from(self.places[place]);
        let collides = |spheres: &Spheres| barriers.any_certainly_within(spheres, GIVER_CLEARANCE);
        if collides(&self.inner_spheres[place]) {
            return None;
        }
        let grip = &self.grips[place];
        (!collides(&grip.second_spheres)).then_some((grip.entry, &grip.solids))
    }
}

impl Shortlists {
    /// Builds the lists of a rig's grips, whose hands fill the cells of `occupancy`.
    pub(super) fn of(rig: &Rig, entries: &[Entry], occupancy: &Occupancy) -> Self {
        let clear_of = clear_of_sampled_givers(entries.len(), occupancy);
        let list = |direction: usize| shortlist(|entry| entries[entry].scores[direction], &clear_of);
        let mut by_direction: Vec<Vec<u16>> = (0..DIRECTIONS).map(list).collect();
        let mut listed: Vec<u16> = by_direction.concat();
        listed.sort_unstable();
        listed.dedup();
        for entry in by_direction.iter_mut().flatten() {
            let place = listed.partition_point(|listed| listed < entry);
            *entry = place as u16;
        }
        let mut shortlists = Self {
            by_direction,
            ..Self::default()
        };
        for entry in listed {
            let solids = entries[usize::from(entry)].tracked_solids(rig);
            shortlists.inner_spheres.push(first_spheres(&solids.hand));
            shortlists.grips.push(Listed {
                entry,
                second_spheres: second_spheres(&solids.hand),
                solids,
            });
        }
        shortlists
    }

    /// The list for a direction against gravity.
    pub(super) fn under(&self, up: Vec3) -> Shortlist<'_> {
        Shortlist {
            grips: &self.grips,
            inner_spheres: &self.inner_spheres,
            places: self
                .by_direction
                .get(nearest_direction(up))
                .map_or(&[], Vec::as_slice),
        }
    }

    /// The grips of all lists, in the order of the entries.
    pub(super) fn all(&self) -> &[Listed] {
        &self.grips
    }

    /// Memory use in bytes.
    pub(super) fn bytes(&self) -> usize {
        let lists = self.by_direction.iter();
        let lists = lists.map(|list| size_of_val(list.as_slice()));
        size_of_val(self.grips.as_slice()) + size_of_val(self.inner_spheres.as_slice()) + lists.sum::<usize>()
    }
}

/// For each of `count` grips, which givers are clear of it. Grips of the same atlas serve as givers: hands
/// that hold an object out hold it like others do.
fn clear_of_sampled_givers(count: usize, occupancy: &Occupancy) -> Vec<ClearOf> {
    let givers = count.min(SAMPLED_GIVERS);
    let mut clear_of = vec![[0; SAMPLED_GIVERS]; count];
    for giver in 0..givers {
        // Spread evenly over the entries, as complete atlases start with the best ones.
        let colliding = occupancy.colliding_with(giver * count / givers);
        for (entry, clear_of) in clear_of.iter_mut().enumerate() {
            if !colliding.contains(entry) {
                clear_of[giver] = u8::MAX;
            }
        }
    }
    clear_of
}

/// The list for one direction: the grips that serve the givers best, by falling score.
fn shortlist(score: impl Fn(usize) -> u8, clear_of: &[ClearOf]) -> Vec<u16> {
    // The score that each giver is served with so far. The initial one is what does not count next to its
    // best clear grip.
    let mut served = [SLIPS; SAMPLED_GIVERS];
    for (entry, clear_of) in clear_of.iter().enumerate() {
        serve(&mut served, score(entry), clear_of);
    }
    for best in &mut served {
        *best = best.saturating_sub(SCORE_MARGIN);
    }
    let mut gains: BinaryHeap<(u32, Reverse<u16>)> = (0..clear_of.len())
        .map(|entry| {
            (
                gain(score(entry), &clear_of[entry], &served),
                Reverse(entry as u16),
            )
        })
        .filter(|&(gain, _)| gain > 0)
        .collect();
    let mut list = Vec::with_capacity(LIST_LENGTH);
    while list.len() < LIST_LENGTH {
        let Some(mut top) = gains.peek_mut() else { break };
        let (bound, Reverse(entry)) = *top;
        let (score, clear_of) = (score(usize::from(entry)), &clear_of[usize::from(entry)]);
        let gain = gain(score, clear_of, &served);
        if gain == bound {
            PeekMut::pop(top);
            serve(&mut served, score, clear_of);
            list.push(entry);
        } else if gain > 0 {
            top.0 = gain;
        } else {
            PeekMut::pop(top);
        }
    }
    list.sort_by_key(|&entry| Reverse(score(usize::from(entry))));
    list
}

/// Serves the givers that are clear of a grip, if it is better than what they have.
fn serve(served: &mut [u8; SAMPLED_GIVERS], score: u8, clear_of: &ClearOf) {
    for (served, clear) in served.iter_mut().zip(clear_of) {
        *served = (*served).max(score & clear);
    }
}

/// The sum of the improvements that a grip brings to the givers that are clear of it.
fn gain(score: u8, clear_of: &ClearOf, served: &[u8; SAMPLED_GIVERS]) -> u32 {
    const { assert!(SAMPLED_GIVERS / LANES * u8::MAX as usize <= u16::MAX as usize) };
    let (clear_of, served) = (clear_of.as_chunks::<LANES>().0, served.as_chunks::<LANES>().0);
    let mut gains = [0_u16; LANES];
    for (clear_of, served) in clear_of.iter().zip(served) {
        for lane in 0..LANES {
            gains[lane] += u16::from(score.saturating_sub(served[lane]) & clear_of[lane]);
        }
    }
    gains.into_iter().map(u32::from).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::random::AttemptStream;

    /// Grips with random scores; each of the first `givers` is clear of a random share of them.
    fn drawn(stream: &mut AttemptStream, count: usize, givers: usize, share: f32) -> (Vec<u8>, Vec<ClearOf>) {
        let grip = |_| {
            let mut clear_of = [0; SAMPLED_GIVERS];
            for clear in &mut clear_of[..givers] {
                *clear = if stream.unit() < share { u8::MAX } else { 0 };
            }
            // Some slip, and many have equal or similar scores.
            (stream.below(6) as u8 * 5 * stream.below(11) as u8, clear_of)
        };
        (0..count).map(grip).unzip()
    }

    /// The objective of a list: by how much the best clear grip of each giver exceeds what does not count.
    fn total_service(list: &[u16], scores: &[u8], clear_of: &[ClearOf]) -> u32 {
        let best = |entries: &mut dyn Iterator<Item = usize>, giver: usize| {
            let clear = entries.filter(|&entry| clear_of[entry][giver] != 0);
            clear.map(|entry| u32::from(scores[entry])).max().unwrap_or(0)
        };
        let served = |giver: usize| {
            let of_all = best(&mut (0..scores.len()), giver);
            let of_list = best(&mut list.iter().map(|&entry| usize::from(entry)), giver);
            of_list.saturating_sub(of_all.saturating_sub(u32::from(SCORE_MARGIN)))
        };
        (0..SAMPLED_GIVERS).map(served).sum()
    }

    #[test]
    fn lazy_greedy_matches_plain_greedy() {
        for seed in 0..20 {
            let mut stream = AttemptStream::new(7, seed);
            let (scores, clear_of) = drawn(&mut stream, 150, 200, 0.05);
            let mut plain: Vec<u16> = Vec::new();
            while plain.len() < LIST_LENGTH {
                let with = |entry: u16| {
                    let longer = [plain.as_slice(), &[entry]].concat();
                    total_service(&longer, &scores, &clear_of)
                };
                let top = (0..150).max_by_key(|&entry| (with(entry), Reverse(entry)));
                let top = top.expect("there are grips");
                if with(top) == total_service(&plain, &scores, &clear_of) {
                    break;
                }
                plain.push(top);
            }
            plain.sort_by_key(|&entry| Reverse(scores[usize::from(entry)]));
            assert_eq!(shortlist(|entry| scores[entry], &clear_of), plain, "seed {seed}");
        }
    }

    #[test]
    fn list_longer_than_the_atlas_serves_as_well_as_all_grips() {
        for seed in 0..20 {
            let mut stream = AttemptStream::new(8, seed);
            let (scores, clear_of) = drawn(&mut stream, 12, 40, 0.3);
            let list = shortlist(|entry| scores[entry], &clear_of);
            let all: Vec<u16> = (0..12).collect();
            assert_eq!(
                total_service(&list, &scores, &clear_of),
                total_service(&all, &scores, &clear_of),
                "seed {seed}"
            );
            assert!(list.iter().all(|&entry| scores[usize::from(entry)] != SLIPS));
        }
    }

    #[test]
    fn gain_sums_improvements_over_givers_clear_of_the_grip() {
        let mut stream = AttemptStream::new(9, 0);
        let served: [u8; SAMPLED_GIVERS] = std::array::from_fn(|_| stream.below(256) as u8);
        let (scores, clear_of) = drawn(&mut stream, 50, SAMPLED_GIVERS, 0.5);
        for (&score, clear_of) in scores.iter().zip(&clear_of) {
            let more = (0..SAMPLED_GIVERS).filter(|&giver| clear_of[giver] != 0 && score > served[giver]);
            let sum: u32 = more
                .map(|giver| u32::from(score) - u32::from(served[giver]))
                .sum();
            assert_eq!(gain(score, clear_of, &served), sum);
        }
    }
}
