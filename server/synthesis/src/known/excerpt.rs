//! Selects the few grips of an atlas that together serve givers best: a server keeps these of many, and these ship.
//!
//! The best grips by score lie next to each other on the object, and a giver that obstructs the first obstructs hundreds. So
//! grips are chosen that complement one another: those that serve a sample of givers best under the directions of gravity. A
//! giver is served by the best chosen grip that is clear of it, provided that its value is within [`VALUE_MARGIN`] of the best
//! clear grip of all. A grip's value is its score and how well its forearm suits a receiver who faces the giver.
//!
//! The objective is a sum of maxima (facility location), which is monotone and submodular. Greedy selection then reaches at least
//! 1 − 1/e of the optimum (G. L. Nemhauser, L. A. Wolsey and M. L. Fisher, "An analysis of approximations for maximizing
//! submodular set functions I", 1978). As gains never grow, only the top candidates are evaluated again (M. Minoux, "Accelerated
//! greedy algorithms", 1978). Once nothing serves a sampled giver better, the same is done with the grips that are left: other
//! givers leave other grips free.

use std::{
    cmp::Reverse,
    collections::{BinaryHeap, binary_heap::PeekMut},
};

use glam::Vec3;

use super::{
    atlas::QUANTA,
    entry::{DIRECTIONS, Entry, SLIPS, direction},
    spread::Occupancy,
};
use crate::{model::score::Term, physical::receiver::Receiver};

/// Grips on the shortlist of a direction of gravity.
const LIST_LENGTH: usize = 96;

/// Number of sampled givers. With half as many, up to 4 of a hundred holdouts more find no listed grip.
const SAMPLED_GIVERS: usize = 512;

/// How far a grip's value may be below that of the best clear grip to serve a giver, in steps of 1/254.
const VALUE_MARGIN: u8 = 40;

/// Givers whose gains are added at once: a register of bytes.
const LANES: usize = 32;

/// Directions that the givers' forearms are quantized to, about 36° apart: the receiver's position need not be known more exactly,
/// and each direction costs two milliseconds.
const FOREARMS: usize = 16;

/// Slots for givers: those with forearms in the same direction share chunks of [`LANES`] slots, some of them empty.
const PLACES: usize = SAMPLED_GIVERS + FOREARMS * LANES;

/// For each place, all bits set if a giver there is clear of a grip, else 0.
type ClearOf = [u8; PLACES];

/// The value of a grip for givers by the direction of their forearms; 0 if it lets the object slip.
type Row = [u8; FOREARMS];

type Chunks = [usize; PLACES / LANES];

type Served = [u8; PLACES];

struct Direction {
    values: Vec<Row>,
    least: Served,
    served: Served,
}

impl Direction {
    fn new(values: Vec<Row>, chunks: &Chunks, clear_of: &[ClearOf]) -> Self {
        let mut best = [SLIPS; PLACES];
        for (row, clear_of) in values.iter().zip(clear_of) {
            serve(&mut best, row, chunks, clear_of);
        }
        // Grips so far below the best clear one do not count.
        let least = best.map(|best| best.saturating_sub(VALUE_MARGIN));
        Self {
            values,
            least,
            served: least,
        }
    }
}

struct Candidates {
    chunks: Chunks,
    clear_of: Vec<ClearOf>,
    directions: Vec<Direction>,
}

impl Candidates {
    fn gain_of(&self, entry: u16) -> u32 {
        let clear_of = &self.clear_of[usize::from(entry)];
        let gains = self.directions.iter().map(|direction| {
            let row = &direction.values[usize::from(entry)];
            gain(row, &self.chunks, clear_of, &direction.served)
        });
        gains.sum()
    }

    fn serve_with(&mut self, entry: u16) {
        let clear_of = &self.clear_of[usize::from(entry)];
        for direction in &mut self.directions {
            let row = &direction.values[usize::from(entry)];
            serve(&mut direction.served, row, &self.chunks, clear_of);
        }
    }

    /// Moves grips from `left` to `chosen` until there are `count` or no other serves a giver better.
    fn choose(&mut self, count: usize, left: &mut Vec<u16>, chosen: &mut Vec<u16>) {
        for direction in &mut self.directions {
            direction.served = direction.least;
        }
        let mut gains: BinaryHeap<(u32, Reverse<u16>)> = left
            .iter()
            .map(|&entry| (self.gain_of(entry), Reverse(entry)))
            .filter(|&(gain, _)| gain > 0)
            .collect();
        let before = chosen.len();
        while chosen.len() < count {
            let Some(mut top) = gains.peek_mut() else { break };
            let (bound, Reverse(entry)) = *top;
            // Gains never grow, so only the top has to be up to date.
            let gain = self.gain_of(entry);
            if gain == bound {
                PeekMut::pop(top);
                self.serve_with(entry);
                chosen.push(entry);
            } else if gain > 0 {
                top.0 = gain;
            } else {
                PeekMut::pop(top);
            }
        }
        let new = &chosen[before..];
        left.retain(|entry| !new.contains(entry));
    }

    /// The grips that serve the givers best under one direction of gravity, with these values.
    fn shortlist(&mut self, values: Vec<Row>) -> Vec<u16> {
        self.directions = vec![Direction::new(values, &self.chunks, &self.clear_of)];
        let mut left = (0..self.clear_of.len() as u16).collect();
        let mut list = Vec::with_capacity(LIST_LENGTH);
        self.choose(LIST_LENGTH, &mut left, &mut list);
        list
    }

    fn fill(&mut self, count: usize, left: &mut Vec<u16>, chosen: &mut Vec<u16>) {
        while chosen.len() < count {
            let before = chosen.len();
            self.choose(count, left, chosen);
            if chosen.len() == before {
                break;
            }
        }
    }
}

pub(super) struct Wanted {
    pub(super) places: Vec<u16>,
    pub(super) count: usize,
}

/// Up to `count` of the grips, whose hands fill the cells of `occupancy`, as ascending indices.
pub(super) fn excerpt(
    entries: &[Entry],
    occupancy: &Occupancy,
    count: usize,
    mut wanted: Wanted,
) -> Vec<usize> {
    let mut left: Vec<u16> = (0..entries.len()).map(|entry| entry as u16).collect();
    let mut chosen = Vec::new();
    if left.len() <= count {
        chosen = left;
    } else {
        let (clear_of, chunks) = clear_of_sampled_givers(entries, occupancy);
        let mut candidates = Candidates {
            directions: (0..DIRECTIONS)
                .map(|up| Direction::new(values(entries, up), &chunks, &clear_of))
                .collect(),
            chunks,
            clear_of,
        };
        candidates.fill(wanted.count, &mut wanted.places, &mut chosen);
        left.retain(|entry| !chosen.contains(entry));
        candidates.fill(count, &mut left, &mut chosen);
    }
    chosen.sort_unstable();
    chosen.into_iter().map(usize::from).collect()
}

/// The grips on the shortlists of all directions of gravity, ascending, each with the number of lists that it is on.
pub(super) fn times_listed(entries: &[Entry], occupancy: &Occupancy) -> Vec<(u16, usize)> {
    let (clear_of, chunks) = clear_of_sampled_givers(entries, occupancy);
    let mut candidates = Candidates {
        chunks,
        clear_of,
        directions: Vec::new(),
    };
    let mut times = vec![0; entries.len()];
    for up in 0..DIRECTIONS {
        for entry in candidates.shortlist(values(entries, up)) {
            times[usize::from(entry)] += 1;
        }
    }
    (0..).zip(times).filter(|&(_, times)| times > 0).collect()
}

/// The givers that are clear of each grip, and the forearms of the givers.
fn clear_of_sampled_givers(entries: &[Entry], occupancy: &Occupancy) -> (Vec<ClearOf>, Chunks) {
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
                let collides = occupancy.colliding_with(giver);
                for (entry, clear_of) in clear_of.iter_mut().enumerate() {
                    if !collides(entry) {
                        clear_of[LANES * chunk + lane] = u8::MAX;
                    }
                }
            }
            chunk += 1;
        }
    }
    (clear_of, chunks)
}

fn forearm(index: usize) -> Vec3 {
    direction(index * (DIRECTIONS / FOREARMS))
}

fn nearest_forearm(along: Vec3) -> usize {
    let cosine = |&index: &usize| forearm(index).dot(along);
    (0..FOREARMS)
        .max_by(|a, b| cosine(a).total_cmp(&cosine(b)))
        .unwrap_or(0)
}

fn values(entries: &[Entry], up: usize) -> Vec<Row> {
    let receivers: [Receiver; FOREARMS] =
        std::array::from_fn(|giver| Receiver::facing(forearm(giver), Vec3::ZERO, direction(up)));
    let of_stance = QUANTA * Term::Stance.share();
    let row = |entry: &Entry| {
        let score = entry.scores[up];
        let along = entry.forearm();
        receivers.each_ref().map(|receiver| match score {
            SLIPS => SLIPS,
            _ => score.saturating_add((of_stance * receiver.suits_forearm(along)).round() as u8),
        })
    };
    entries.iter().map(row).collect()
}

/// Serves the givers clear of a grip that is better than their best so far.
fn serve(served: &mut Served, row: &Row, chunks: &Chunks, clear_of: &ClearOf) {
    let (served, clear_of) = (served.as_chunks_mut::<LANES>().0, clear_of.as_chunks::<LANES>().0);
    for ((served, clear_of), &forearm) in served.iter_mut().zip(clear_of).zip(chunks) {
        let value = row[forearm];
        for lane in 0..LANES {
            served[lane] = served[lane].max(value & clear_of[lane]);
        }
    }
}

/// The sum of the improvements that a grip brings to the givers that are clear of it.
fn gain(row: &Row, chunks: &Chunks, clear_of: &ClearOf, served: &Served) -> u32 {
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

    fn chunks() -> Chunks {
        std::array::from_fn(|chunk| chunk % FOREARMS)
    }

    fn shortlist(values: &[Row], clear_of: &[ClearOf]) -> Vec<u16> {
        let mut candidates = Candidates {
            chunks: chunks(),
            clear_of: clear_of.to_vec(),
            directions: Vec::new(),
        };
        candidates.shortlist(values.to_vec())
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

    /// The objective of a list: the excess of each giver's best clear grip over the margin.
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
            assert_eq!(shortlist(&values, &clear_of), plain, "seed {seed}");
        }
    }
}
