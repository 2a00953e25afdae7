//! Few grips of an atlas of which nearly every giver leaves one.
//!
//! By score alone, the first grips of an atlas lie side by side on the object, and a giver that is in the way of the first
//! is in the way of hundreds. So a look-up starts with grips that complement one another: for each direction of gravity,
//! those that together serve some givers best, where each giver is served by the best grip that keeps clear of it, if that
//! is nearly as good as the best of all that do. They are tried by falling score, as all others are after them.
//!
//! What they serve is a sum of maxima, a facility location: monotone and submodular. Taking the grip that adds most, again
//! and again, then serves at least 1 − 1/e of what the best choice could (G. L. Nemhauser, L. A. Wolsey and M. L. Fisher,
//! "An analysis of approximations for maximizing submodular set functions I", 1978); and as no grip ever adds more than it
//! did before, only those near the top are asked again (M. Minoux, "Accelerated greedy algorithms", 1978).

use std::{
    cmp::Reverse,
    collections::{BinaryHeap, binary_heap::PeekMut},
};

use glam::Vec3;

use super::{
    entry::{Entry, SLIPS},
    gravity::{DIRECTIONS, nearest},
    inner_spheres::{first_spheres, second_spheres},
    occupancy::Occupancy,
};
use crate::{
    model::hand::rig::Rig,
    physical::{
        grip::GIVER_CLEARANCE,
        solids::{PreparedHand, Spheres, TrackedSolids},
    },
};

/// Grips that are on a list. With fewer, more givers are left without one, and those that are served get less of a grasp;
/// with more, the first valid one comes later. Of 400 holdouts of the built-in remote, scalpel and scissors with recorded
/// givers, about 84, 91 and 63 % leave one that holds, at the median the 26th, the 43rd and the 88th. The first 48 by score
/// alone: 53, 19 and 6 %.
const LISTED: usize = 96;

/// Givers that are asked. With half as many, up to 4 of a hundred holdouts fewer leave a listed grip, with twice as many 1 to 6
/// more (where any grip serves). They take time in proportion: a tenth of a second when an atlas is read.
const GIVERS: usize = 512;

/// How much worse than the best grip that a giver leaves one may be to serve it, in steps of 1/254 of a score. With more, more
/// givers leave a grip of the list, but a worse one than they could: scores of what is found first are 0.4 % lower than
/// without a list for the remote and 1.1 % for scalpel and scissors, and 0.9 and 1.3 % if any grip serves.
const WORSE: u8 = 40;

/// Givers whose gains are added up at once: a register's worth of bytes.
const LANES: usize = 32;

/// For each giver, all bits if it leaves a grip, or none.
type LeftBy = [u8; GIVERS];

/// A grip that is on a list. There are some hundreds in all, which nearly every look-up starts with, so that their solids
/// are kept.
#[derive(Clone, Debug, PartialEq)]
pub struct Listed {
    /// Its index in [`super::Atlas::entries`].
    pub entry: u16,
    second_spheres: Spheres,
    solids: TrackedSolids,
}

/// The lists for all directions of gravity.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Shortlists {
    grips: Vec<Listed>,
    /// The first balls inside each of them, side by side.
    inner_spheres: Vec<Spheres>,
    /// For each direction, which of them are on its list.
    of_directions: Vec<Vec<u16>>,
}

/// The list for one of them.
#[derive(Clone, Copy, Debug, Default)]
pub struct Shortlist<'a> {
    /// The grips of all lists, and the first balls inside them.
    grips: &'a [Listed],
    inner_spheres: &'a [Spheres],
    /// Which of them are on this one.
    places: &'a [u16],
}

impl<'a> Shortlist<'a> {
    /// The grips on it, by falling score.
    pub fn iter(self) -> impl Iterator<Item = &'a Listed> {
        let grips = self.grips;
        self.places.iter().map(|&place| &grips[usize::from(place)])
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.places.len()
    }

    /// True if there is none.
    pub fn is_empty(&self) -> bool {
        self.places.is_empty()
    }

    /// The grip at a place of the list with its solids.
    pub fn at(&self, place: usize) -> (u16, &'a TrackedSolids) {
        let grip = &self.grips[usize::from(self.places[place])];
        (grip.entry, &grip.solids)
    }

    /// The grip at a place of the list with its solids; none only if it comes too near to a giver's hand, and not always
    /// then.
    #[inline]
    pub fn unless_met(&self, place: usize, giver: &PreparedHand) -> Option<(u16, &'a TrackedSolids)> {
        let place = usize::from(self.places[place]);
        let meets = |spheres: &Spheres| giver.any_certainly_within(spheres, GIVER_CLEARANCE);
        if meets(&self.inner_spheres[place]) {
            return None;
        }
        let grip = &self.grips[place];
        (!meets(&grip.second_spheres)).then_some((grip.entry, &grip.solids))
    }
}

impl Shortlists {
    /// The lists of some grips of a rig that fill space as is said.
    pub(super) fn of(rig: &Rig, entries: &[Entry], occupancy: &Occupancy) -> Self {
        let left_by = left_by_givers(entries.len(), occupancy);
        let list = |direction: usize| shortlist(|entry| entries[entry].scores[direction], &left_by);
        let mut of_directions: Vec<Vec<u16>> = (0..DIRECTIONS).map(list).collect();
        let mut listed: Vec<u16> = of_directions.concat();
        listed.sort_unstable();
        listed.dedup();
        for entry in of_directions.iter_mut().flatten() {
            let place = listed.partition_point(|listed| listed < entry);
            *entry = place as u16;
        }
        let mut shortlists = Self {
            of_directions,
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
            places: self.of_directions.get(nearest(up)).map_or(&[], Vec::as_slice),
        }
    }

    /// The grips of all lists, in the order of the entries.
    pub(super) fn all(&self) -> &[Listed] {
        &self.grips
    }

    /// Bytes that they take in memory.
    pub(super) fn bytes(&self) -> usize {
        let lists = self.of_directions.iter();
        let lists = lists.map(|list| size_of_val(list.as_slice()));
        size_of_val(self.grips.as_slice()) + size_of_val(self.inner_spheres.as_slice()) + lists.sum::<usize>()
    }
}

/// For each of `count` grips, which givers keep clear of it. The givers are grips of the same atlas, as the hands that
/// objects are held out with hold them like others do.
fn left_by_givers(count: usize, occupancy: &Occupancy) -> Vec<LeftBy> {
    let givers = count.min(GIVERS);
    let mut left_by = vec![[0; GIVERS]; count];
    for giver in 0..givers {
        // Evenly from the first to the last: complete atlases have the best first.
        let met = occupancy.met_by(giver * count / givers);
        for (entry, left_by) in left_by.iter_mut().enumerate() {
            if !met.contains(entry) {
                left_by[giver] = u8::MAX;
            }
        }
    }
    left_by
}

/// Of grips that some givers leave, those that serve the givers best, by falling score.
fn shortlist(score: impl Fn(usize) -> u8, left_by: &[LeftBy]) -> Vec<u16> {
    // What each giver is served with so far; at first with what is as good as nothing beside the best that it leaves.
    let mut served = [SLIPS; GIVERS];
    for (entry, left_by) in left_by.iter().enumerate() {
        serve(&mut served, score(entry), left_by);
    }
    for best in &mut served {
        *best = best.saturating_sub(WORSE);
    }
    let mut gains: BinaryHeap<(u32, Reverse<u16>)> = (0..left_by.len())
        .map(|entry| {
            (
                gain(score(entry), &left_by[entry], &served),
                Reverse(entry as u16),
            )
        })
        .filter(|&(gain, _)| gain > 0)
        .collect();
    let mut list = Vec::with_capacity(LISTED);
    while list.len() < LISTED {
        let Some(mut most) = gains.peek_mut() else { break };
        let (bound, Reverse(entry)) = *most;
        let (score, left_by) = (score(usize::from(entry)), &left_by[usize::from(entry)]);
        let gain = gain(score, left_by, &served);
        if gain == bound {
            PeekMut::pop(most);
            serve(&mut served, score, left_by);
            list.push(entry);
        } else if gain > 0 {
            most.0 = gain;
        } else {
            PeekMut::pop(most);
        }
    }
    list.sort_by_key(|&entry| Reverse(score(usize::from(entry))));
    list
}

/// Serves the givers that leave a grip of a score with it, if they have no better one.
fn serve(served: &mut [u8; GIVERS], score: u8, left_by: &LeftBy) {
    for (served, left) in served.iter_mut().zip(left_by) {
        *served = (*served).max(score & left);
    }
}

/// By how much a grip of a score serves the givers that leave it better than they are served.
fn gain(score: u8, left_by: &LeftBy, served: &[u8; GIVERS]) -> u32 {
    const { assert!(GIVERS / LANES * u8::MAX as usize <= u16::MAX as usize) };
    let (left_by, served) = (left_by.as_chunks::<LANES>().0, served.as_chunks::<LANES>().0);
    let mut gains = [0_u16; LANES];
    for (left_by, served) in left_by.iter().zip(served) {
        for lane in 0..LANES {
            gains[lane] += u16::from(score.saturating_sub(served[lane]) & left_by[lane]);
        }
    }
    gains.into_iter().map(u32::from).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::random::AttemptStream;

    /// Grips with a score each, and the first `givers` that leave some of them at random.
    fn drawn(stream: &mut AttemptStream, count: usize, givers: usize, share: f32) -> (Vec<u8>, Vec<LeftBy>) {
        let grip = |_| {
            let mut left_by = [0; GIVERS];
            for left in &mut left_by[..givers] {
                *left = if stream.unit() < share { u8::MAX } else { 0 };
            }
            // Some slip, and many are worth the same, or nearly.
            (stream.below(6) as u8 * 5 * stream.below(11) as u8, left_by)
        };
        (0..count).map(grip).unzip()
    }

    /// What a list is worth: of each giver, how much better the best that is left of it is than what is too bad to count.
    fn worth(list: &[u16], scores: &[u8], left_by: &[LeftBy]) -> u32 {
        let best = |entries: &mut dyn Iterator<Item = usize>, giver: usize| {
            let left = entries.filter(|&entry| left_by[entry][giver] != 0);
            left.map(|entry| u32::from(scores[entry])).max().unwrap_or(0)
        };
        let served = |giver: usize| {
            let of_all = best(&mut (0..scores.len()), giver);
            let of_list = best(&mut list.iter().map(|&entry| usize::from(entry)), giver);
            of_list.saturating_sub(of_all.saturating_sub(u32::from(WORSE)))
        };
        (0..GIVERS).map(served).sum()
    }

    #[test]
    fn a_list_is_what_adding_the_most_useful_again_and_again_gives() {
        for seed in 0..20 {
            let mut stream = AttemptStream::new(7, seed);
            let (scores, left_by) = drawn(&mut stream, 150, 200, 0.05);
            let mut plain: Vec<u16> = Vec::new();
            while plain.len() < LISTED {
                let with = |entry: u16| {
                    let longer = [plain.as_slice(), &[entry]].concat();
                    worth(&longer, &scores, &left_by)
                };
                let most = (0..150).max_by_key(|&entry| (with(entry), Reverse(entry)));
                let most = most.expect("there are grips");
                if with(most) == worth(&plain, &scores, &left_by) {
                    break;
                }
                plain.push(most);
            }
            plain.sort_by_key(|&entry| Reverse(scores[usize::from(entry)]));
            assert_eq!(shortlist(|entry| scores[entry], &left_by), plain, "seed {seed}");
        }
    }

    #[test]
    fn a_list_with_room_for_all_serves_as_much_as_all() {
        for seed in 0..20 {
            let mut stream = AttemptStream::new(8, seed);
            let (scores, left_by) = drawn(&mut stream, 12, 40, 0.3);
            let list = shortlist(|entry| scores[entry], &left_by);
            let all: Vec<u16> = (0..12).collect();
            assert_eq!(
                worth(&list, &scores, &left_by),
                worth(&all, &scores, &left_by),
                "seed {seed}"
            );
            assert!(list.iter().all(|&entry| scores[usize::from(entry)] != SLIPS));
        }
    }

    #[test]
    fn gains_are_sums_over_the_givers_that_leave_the_grip() {
        let mut stream = AttemptStream::new(9, 0);
        let served: [u8; GIVERS] = std::array::from_fn(|_| stream.below(256) as u8);
        let (scores, left_by) = drawn(&mut stream, 50, GIVERS, 0.5);
        for (&score, left_by) in scores.iter().zip(&left_by) {
            let more = (0..GIVERS).filter(|&giver| left_by[giver] != 0 && score > served[giver]);
            let sum: u32 = more
                .map(|giver| u32::from(score) - u32::from(served[giver]))
                .sum();
            assert_eq!(gain(score, left_by, &served), sum);
        }
    }
}
