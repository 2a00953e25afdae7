//! Shortlists: a few grips of an atlas of which nearly every giver leaves one free.
//!
//! The best grips by score lie next to each other on the object, and a giver that obstructs the first
//! obstructs hundreds. So a look-up starts with grips that complement one another: for each direction of
//! gravity, those that together serve a sample of givers best. A giver is served by the best listed grip that
//! is clear of it, provided that its value is within [`VALUE_MARGIN`] of the best clear grip of all. A grip's value is its score
//! and how well its forearm suits a receiver who faces the giver. They are tried by falling value, then all others are.
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
    gravity::{DIRECTIONS, direction, nearest_direction},
    inner_spheres::{first_spheres, second_spheres},
    occupancy::Occupancy,
};
use crate::{
    model::{hand::rig::Rig, score::Term},
    physical::{
        barriers::Barriers,
        grip::GIVER_CLEARANCE,
        receiver::Receiver,
        solids::{Spheres, TrackedSolids},
    },
};

/// Grips per list. Fewer leave more givers without a listed grip and lower the scores of the others; more
/// delay the first valid one. The first 48 by score alone would serve far fewer givers.
const LIST_LENGTH: usize = 96;

/// Number of sampled givers. With half as many, up to 4 of a hundred holdouts more find no listed grip. They
/// cost time in proportion: a tenth of a second when an atlas is loaded.
const SAMPLED_GIVERS: usize = 512;

/// How far a grip's value may be below that of the best clear grip to serve a giver, in steps of 1/254. More
/// finds a listed grip for more givers, at lower values.
const VALUE_MARGIN: u8 = 40;

/// Givers whose gains are added at once: a register of bytes.
const LANES: usize = 32;

/// Directions that the givers' forearms are quantized to, about 36° apart: where the receiver stands need not be known more
/// exactly, and each direction costs two milliseconds.
const FOREARMS: usize = 16;

/// Places for givers: those with forearms in the same direction share chunks of [`LANES`] places, of which some stay empty.
const PLACES: usize = SAMPLED_GIVERS + FOREARMS * LANES;

/// For each place, all bits set if a giver there is clear of a grip, else 0.
pub(super) type ClearOf = [u8; PLACES];

/// The value of a grip for givers by the direction of their forearms; 0 if it lets the object slip.
pub(super) type Row = [u8; FOREARMS];

/// The direction of the forearms of the givers of each chunk.
pub(super) type Chunks = [usize; PLACES / LANES];

/// The value that the giver at each place is served with.
pub(super) type Served = [u8; PLACES];

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
    /// The direction of each listed grip's forearm, from wrist to elbow.
    forearms: Vec<Vec3>,
    /// For each direction, the grips on its list.
    by_direction: Vec<Vec<ListedPlace>>,
}

/// A listed grip under one direction of gravity.
#[derive(Clone, Copy, Debug, PartialEq)]
struct ListedPlace {
    /// Its place among the listed grips of all directions.
    grip: u16,
    /// Its score under this gravity.
    score: u8,
}

/// Steps of a score from 0 to 1, as entries store it, and those by which values are compared.
const QUANTA: f32 = 254.0;
const VALUE_STEPS: f32 = 1e6;

/// The list for one direction of gravity.
#[derive(Clone, Copy, Debug, Default)]
pub struct Shortlist<'a> {
    /// The grips of all lists, and their first inner spheres.
    grips: &'a [Listed],
    inner_spheres: &'a [Spheres],
    forearms: &'a [Vec3],
    /// The grips on this list.
    places: &'a [ListedPlace],
}

impl<'a> Shortlist<'a> {
    /// The grips on the list, by falling score.
    pub fn iter(self) -> impl Iterator<Item = &'a Listed> {
        let grips = self.grips;
        self.places.iter().map(|place| &grips[usize::from(place.grip)])
    }

    /// The places of the list by falling value, with `stance` the value of a forearm's direction for where the receiver
    /// stands, 0 to 1. In order of the list where values are equal.
    pub fn by_value(&self, stance: impl Fn(Vec3) -> f32) -> Vec<u16> {
        let mut order: Vec<(u32, u16)> = (0..)
            .zip(self.places)
            .map(|(index, place)| {
                let stance = stance(self.forearms[usize::from(place.grip)]);
                (rank(place.score, stance), index)
            })
            .collect();
        order.sort_unstable();
        order.into_iter().map(|(_, index)| index).collect()
    }

    /// The length of the list.
    pub fn len(&self) -> usize {
        self.places.len()
    }

    /// True if the list is empty.
    pub fn is_empty(&self) -> bool {
        self.places.is_empty()
    }

    /// The index of the grip at a place of the list among the entries.
    pub fn entry(&self, place: usize) -> u16 {
        self.grips[usize::from(self.places[place].grip)].entry
    }

    /// The grip at a place of the list, with its solids.
    pub fn at(&self, place: usize) -> (u16, &'a TrackedSolids) {
        let grip = &self.grips[usize::from(self.places[place].grip)];
        (grip.entry, &grip.solids)
    }

    /// The grip at a place of the list with its solids, unless its inner spheres show that it is too close to
    /// a barrier. Conservative: a grip that passes may still collide.
    #[inline]
    pub fn screen(&self, place: usize, barriers: Barriers<'_>) -> Option<(u16, &'a TrackedSolids)> {
        let place = usize::from(self.places[place].grip);
        let collides = |spheres: &Spheres| barriers.any_certainly_within(spheres, GIVER_CLEARANCE);
        if collides(&self.inner_spheres[place]) {
            return None;
        }
        let grip = &self.grips[place];
        (!collides(&grip.second_spheres)).then_some((grip.entry, &grip.solids))
    }
}

/// The place of a grip by falling value: lower for a higher score and a forearm that better suits where the receiver stands.
pub(super) fn rank(score: u8, stance: f32) -> u32 {
    let value = f32::from(score) / QUANTA + Term::Stance.share() * stance;
    u32::MAX - (value * VALUE_STEPS) as u32
}

impl Shortlists {
    /// Builds the lists of a rig's grips, whose hands fill the cells of `occupancy`.
    pub(super) fn of(rig: &Rig, entries: &[Entry], occupancy: &Occupancy) -> Self {
        let (clear_of, chunks) = clear_of_sampled_givers(entries, occupancy);
        let list = |up: usize| shortlist(&values(entries, up), &chunks, &clear_of);
        let lists: Vec<Vec<u16>> = (0..DIRECTIONS).map(list).collect();
        let mut listed: Vec<u16> = lists.concat();
        listed.sort_unstable();
        listed.dedup();
        let by_direction = (0..).zip(&lists).map(|(up, list): (usize, &Vec<u16>)| {
            let mut list: Vec<ListedPlace> = list
                .iter()
                .map(|entry| ListedPlace {
                    grip: listed.partition_point(|listed| listed < entry) as u16,
                    score: entries[usize::from(*entry)].scores[up],
                })
                .collect();
            list.sort_by_key(|place| Reverse(place.score));
            list
        });
        let mut shortlists = Self {
            by_direction: by_direction.collect(),
            ..Self::default()
        };
        for entry in listed {
            let solids = entries[usize::from(entry)].tracked_solids(rig);
            shortlists.inner_spheres.push(first_spheres(&solids.hand));
            shortlists.forearms.push(entries[usize::from(entry)].forearm());
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
            forearms: &self.forearms,
            places: self
                .by_direction
                .get(nearest_direction(up))
                .map_or(&[], Vec::as_slice),
        }
    }

    /// True if there are no lists, not even empty ones.
    pub(super) fn is_empty(&self) -> bool {
        self.by_direction.is_empty()
    }

    /// The grips of all lists, in the order of the entries.
    pub(super) fn all(&self) -> &[Listed] {
        &self.grips
    }

    /// The number of lists that each of them is on.
    pub(super) fn times_listed(&self) -> Vec<usize> {
        let mut times = vec![0; self.grips.len()];
        for place in self.by_direction.iter().flatten() {
            times[usize::from(place.grip)] += 1;
        }
        times
    }

    /// Memory use in bytes.
    pub(super) fn bytes(&self) -> usize {
        let lists = self.by_direction.iter();
        let lists = lists.map(|list| size_of_val(list.as_slice()));
        size_of_val(self.grips.as_slice())
            + size_of_val(self.inner_spheres.as_slice())
            + size_of_val(self.forearms.as_slice())
            + lists.sum::<usize>()
    }
}

/// For each grip, which givers are clear of it, and the forearms of the givers. Grips of the same atlas serve as givers: hands
/// that hold an object out hold it like others do.
pub(super) fn clear_of_sampled_givers(entries: &[Entry], occupancy: &Occupancy) -> (Vec<ClearOf>, Chunks) {
    let count = entries.len();
    let givers = count.min(SAMPLED_GIVERS);
    let mut by_forearm: [Vec<usize>; FOREARMS] = std::array::from_fn(|_| Vec::new());
    for giver in 0..givers {
        // Spread evenly over the entries, as complete atlases start with the best ones.
        let giver = giver * count / givers;
        by_forearm[nearest_forearm(entries[giver].forearm())].push(giver);
    }
    let mut clear_of = vec![[0; PLACES]; count];
    let mut chunks = [0; PLACES / LANES];
    let mut chunk = 0;
    for (forearm, givers) in by_forearm.iter().enumerate() {
        for together in givers.chunks(LANES) {
            chunks[chunk] = forearm;
            for (lane, &giver) in together.iter().enumerate() {
                let colliding = occupancy.colliding_with(giver);
                for (entry, clear_of) in clear_of.iter_mut().enumerate() {
                    if !colliding.contains(entry) {
                        clear_of[LANES * chunk + lane] = u8::MAX;
                    }
                }
            }
            chunk += 1;
        }
    }
    (clear_of, chunks)
}

/// One of [`FOREARMS`] evenly spread directions.
fn forearm(index: usize) -> Vec3 {
    direction(index * (DIRECTIONS / FOREARMS))
}

/// The index of the nearest one.
fn nearest_forearm(along: Vec3) -> usize {
    let cosine = |&index: &usize| forearm(index).dot(along);
    (0..FOREARMS)
        .max_by(|a, b| cosine(a).total_cmp(&cosine(b)))
        .unwrap_or(0)
}

/// The values of all grips for one direction against gravity.
pub(super) fn values(entries: &[Entry], up: usize) -> Vec<Row> {
    let receivers: [Receiver; FOREARMS] =
        std::array::from_fn(|giver| Receiver::facing(forearm(giver), Vec3::ZERO, direction(up)));
    let of_stance = QUANTA * Term::Stance.share();
    let row = |entry: &Entry| {
        let score = entry.scores[up];
        let along = entry.forearm();
        receivers.map(|receiver| match score {
            SLIPS => SLIPS,
            _ => score.saturating_add((of_stance * receiver.suits_forearm(along)).round() as u8),
        })
    };
    entries.iter().map(row).collect()
}

/// What each giver counts as served with before any grip is listed: the value that does not count next to its best clear grip.
pub(super) fn least_served(values: &[Row], chunks: &Chunks, clear_of: &[ClearOf]) -> Served {
    let mut served = [SLIPS; PLACES];
    for (row, clear_of) in values.iter().zip(clear_of) {
        serve(&mut served, row, chunks, clear_of);
    }
    served.map(|best| best.saturating_sub(VALUE_MARGIN))
}

/// The list for one direction: the grips that serve the givers best.
fn shortlist(values: &[Row], chunks: &Chunks, clear_of: &[ClearOf]) -> Vec<u16> {
    let mut served = least_served(values, chunks, clear_of);
    let gain_of = |entry: usize, served: &Served| gain(&values[entry], chunks, &clear_of[entry], served);
    let mut gains: BinaryHeap<(u32, Reverse<u16>)> = (0..clear_of.len())
        .map(|entry| (gain_of(entry, &served), Reverse(entry as u16)))
        .filter(|&(gain, _)| gain > 0)
        .collect();
    let mut list = Vec::with_capacity(LIST_LENGTH);
    while list.len() < LIST_LENGTH {
        let Some(mut top) = gains.peek_mut() else { break };
        let (bound, Reverse(entry)) = *top;
        let index = usize::from(entry);
        let gain = gain_of(index, &served);
        if gain == bound {
            PeekMut::pop(top);
            serve(&mut served, &values[index], chunks, &clear_of[index]);
            list.push(entry);
        } else if gain > 0 {
            top.0 = gain;
        } else {
            PeekMut::pop(top);
        }
    }
    list
}

/// Serves the givers that are clear of a grip, if it is better than what they have.
pub(super) fn serve(served: &mut Served, row: &Row, chunks: &Chunks, clear_of: &ClearOf) {
    let (served, clear_of) = (served.as_chunks_mut::<LANES>().0, clear_of.as_chunks::<LANES>().0);
    for ((served, clear_of), &forearm) in served.iter_mut().zip(clear_of).zip(chunks) {
        let value = row[forearm];
        for lane in 0..LANES {
            served[lane] = served[lane].max(value & clear_of[lane]);
        }
    }
}

/// The sum of the improvements that a grip brings to the givers that are clear of it.
pub(super) fn gain(row: &Row, chunks: &Chunks, clear_of: &ClearOf, served: &Served) -> u32 {
    const { assert!(PLACES / LANES * u8::MAX as usize <= u16::MAX as usize) };
    let (clear_of, served) = (clear_of.as_chunks::<LANES>().0, served.as_chunks::<LANES>().0);
    let mut gains = [0_u16; LANES];
    for ((clear_of, served), &forearm) in clear_of.iter().zip(served).zip(chunks) {
        let value = row[forearm];
        for lane in 0..LANES {
            gains[lane] += u16::from(value.saturating_sub(served[lane]) & clear_of[lane]);
        }
    }
    gains.into_iter().map(u32::from).sum()
}

#[cfg(test)]
mod tests {
    use grasp_cases::cases;

    use super::*;
    use crate::base::random::AttemptStream;

    /// Givers whose forearms point in all directions.
    fn chunks() -> Chunks {
        std::array::from_fn(|chunk| chunk % FOREARMS)
    }

    /// Grips with random values; each of the first `givers` is clear of a random share of them.
    fn drawn(
        stream: &mut AttemptStream,
        count: usize,
        givers: usize,
        share: f32,
    ) -> (Vec<Row>, Vec<ClearOf>) {
        let grip = |_| {
            let mut clear_of = [0; PLACES];
            for clear in &mut clear_of[..givers] {
                *clear = if stream.unit() < share { u8::MAX } else { 0 };
            }
            // Some slip, and many have equal or similar values.
            let score = stream.below(6) as u8 * 5 * stream.below(7) as u8;
            let row = std::array::from_fn(|_| score.saturating_add(10 * stream.below(4) as u8));
            (if score == SLIPS { [SLIPS; FOREARMS] } else { row }, clear_of)
        };
        (0..count).map(grip).unzip()
    }

    /// The objective of a list: by how much the best clear grip of each giver exceeds what does not count.
    fn total_service(list: &[u16], values: &[Row], clear_of: &[ClearOf]) -> u32 {
        let chunks = chunks();
        let best = |entries: &mut dyn Iterator<Item = usize>, giver: usize| {
            let clear = entries.filter(|&entry| clear_of[entry][giver] != 0);
            clear
                .map(|entry| u32::from(values[entry][chunks[giver / LANES]]))
                .max()
                .unwrap_or(0)
        };
        let served = |giver: usize| {
            let of_all = best(&mut (0..values.len()), giver);
            let of_list = best(&mut list.iter().map(|&entry| usize::from(entry)), giver);
            of_list.saturating_sub(of_all.saturating_sub(u32::from(VALUE_MARGIN)))
        };
        (0..PLACES).map(served).sum()
    }

    #[test]
    fn lazy_greedy_matches_plain_greedy() {
        for seed in 0..u64::from(cases(20)) {
            let mut stream = AttemptStream::new(7, seed);
            let (values, clear_of) = drawn(&mut stream, 150, 200, 0.05);
            let mut plain: Vec<u16> = Vec::new();
            while plain.len() < LIST_LENGTH {
                let with = |entry: u16| {
                    let longer = [plain.as_slice(), &[entry]].concat();
                    total_service(&longer, &values, &clear_of)
                };
                let top = (0..150).max_by_key(|&entry| (with(entry), Reverse(entry)));
                let top = top.expect("there are grips");
                if with(top) == total_service(&plain, &values, &clear_of) {
                    break;
                }
                plain.push(top);
            }
            assert_eq!(shortlist(&values, &chunks(), &clear_of), plain, "seed {seed}");
        }
    }

    #[test]
    fn list_longer_than_the_atlas_serves_as_well_as_all_grips() {
        for seed in 0..20 {
            let mut stream = AttemptStream::new(8, seed);
            let (values, clear_of) = drawn(&mut stream, 12, 40, 0.3);
            let list = shortlist(&values, &chunks(), &clear_of);
            let all: Vec<u16> = (0..12).collect();
            assert_eq!(
                total_service(&list, &values, &clear_of),
                total_service(&all, &values, &clear_of),
                "seed {seed}"
            );
            assert!(
                list.iter()
                    .all(|&entry| values[usize::from(entry)] != [SLIPS; FOREARMS])
            );
        }
    }

    #[test]
    fn gain_sums_improvements_over_givers_clear_of_the_grip() {
        let mut stream = AttemptStream::new(9, 0);
        let served: [u8; PLACES] = std::array::from_fn(|_| stream.below(256) as u8);
        let (values, clear_of) = drawn(&mut stream, 50, PLACES, 0.5);
        for (row, clear_of) in values.iter().zip(&clear_of) {
            let value = |giver: usize| row[chunks()[giver / LANES]];
            let more = (0..PLACES).filter(|&giver| clear_of[giver] != 0 && value(giver) > served[giver]);
            let sum: u32 = more
                .map(|giver| u32::from(value(giver)) - u32::from(served[giver]))
                .sum();
            assert_eq!(gain(row, &chunks(), clear_of, &served), sum);
        }
    }
}
