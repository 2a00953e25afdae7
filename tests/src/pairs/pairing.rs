//! Draws pairs of a plausible and an implausible grasp.

use grasp_synthesis::model::score::TERMS;
use rand::{RngExt as _, SeedableRng as _};
use rand_xoshiro::Xoshiro256PlusPlus;

use super::{
    gathering::{Candidate, Offer},
    reasons::Reason,
};

/// Most pairs of one reason and object, so that no object dominates.
pub const MAX_PER_REASON: usize = 6;

/// An offer with the grasps gathered of it.
#[derive(Clone, Debug)]
pub struct Gathered {
    /// Number of the object.
    pub object: usize,
    /// Number of the offer among those of the object.
    pub number: usize,
    /// The offer.
    pub offer: Offer,
    /// The grasps.
    pub candidates: Vec<Candidate>,
}

/// A plausible and an implausible grasp of one offer.
#[derive(Clone, Copy, Debug)]
pub struct Pair<'a> {
    /// Of what they are.
    pub gathered: &'a Gathered,
    /// Number of the candidate that a person would plausibly choose.
    pub plausible: usize,
    /// Number of the one that a person would not.
    pub implausible: usize,
    /// Why not.
    pub reason: Reason,
}

impl Pair<'_> {
    /// The totals of both scores, that of the plausible grasp first.
    pub fn totals(&self) -> [f32; 2] {
        [self.plausible, self.implausible].map(|number| self.gathered.candidates[number].score.total())
    }

    /// How much higher the plausible grasp scores.
    pub fn margin(&self) -> f32 {
        let [plausible, implausible] = self.totals();
        plausible - implausible
    }

    /// True if the score would choose the plausible grasp.
    pub fn is_right(&self) -> bool {
        self.margin() > 0.0
    }

    /// The differences of the terms, plausible less implausible.
    pub fn differences(&self) -> [f64; TERMS] {
        let value =
            |number: usize, term: usize| f64::from(self.gathered.candidates[number].score.values[term]);
        std::array::from_fn(|term| value(self.plausible, term) - value(self.implausible, term))
    }
}

/// Pairs of all offers, at most [`MAX_PER_REASON`] of one reason and object, in the order of reasons and objects. Equal for
/// equal arguments.
pub fn pairs(all: &[Gathered], seed: u64) -> Vec<Pair<'_>> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let objects = all.iter().map(|gathered| gathered.object + 1).max().unwrap_or(0);
    let mut drawn = Vec::new();
    for reason in Reason::ALL {
        for object in 0..objects {
            let own = all.iter().filter(|gathered| gathered.object == object);
            let mut possible: Vec<Pair<'_>> = own.flat_map(|gathered| possible(gathered, reason)).collect();
            for _ in 0..MAX_PER_REASON.min(possible.len()) {
                drawn.push(possible.swap_remove(random.random_range(0..possible.len())));
            }
        }
    }
    drawn
}

/// All pairs of an offer and a reason.
fn possible(gathered: &Gathered, reason: Reason) -> Vec<Pair<'_>> {
    let numbers = |wanted: &dyn Fn(&Candidate) -> bool| {
        let all = gathered.candidates.iter().enumerate();
        all.filter(|(_, candidate)| wanted(candidate))
            .map(|(number, _)| number)
            .collect::<Vec<_>>()
    };
    let plausible = numbers(&|candidate| candidate.verdicts.are_plausible());
    let implausible = numbers(&|candidate| candidate.verdicts.only_reason() == Some(reason));
    let both = implausible
        .iter()
        .flat_map(|&implausible| plausible.iter().map(move |&plausible| (plausible, implausible)));
    both.map(|(plausible, implausible)| Pair {
        gathered,
        plausible,
        implausible,
        reason,
    })
    .collect()
}
