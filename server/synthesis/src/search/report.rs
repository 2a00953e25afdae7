//! What a search did, and who looks on.

use std::{cmp::Ordering, fmt, time::Duration};

use super::limits::Limit;
use crate::{
    base::{rejection::Rejection, stopwatch::StepTimes},
    model::{grasp::Grasp, hand::HandPose},
};

/// The failed attempt that came closest to a grasp: the one that failed in the latest step (in the order of
/// [`Rejection::ALL`]); then by smallest wrench angle; then by lowest index.
#[derive(Clone, Debug, PartialEq)]
pub struct NearestMiss {
    /// Why it failed.
    pub rejection: Rejection,
    /// Its index.
    pub attempt: u64,
    /// For `NotImmobilizing`: the smallest wrench angle, in radians.
    pub wrench_angle: Option<f32>,
    /// The hand in the object's frame.
    pub pose: HandPose,
}

impl NearestMiss {
    /// True if an attempt that failed in this way came closer than `self`.
    pub(super) fn is_farther_than(
        &self,
        rejection: Rejection,
        wrench_angle: Option<f32>,
        attempt: u64,
    ) -> bool {
        // Exactly the attempts that reached `NotImmobilizing` have an angle.
        let angle = |angle: Option<f32>| angle.unwrap_or(0.0);
        rejection
            .index()
            .cmp(&self.rejection.index())
            .then_with(|| angle(self.wrench_angle).total_cmp(&angle(wrench_angle)))
            .then_with(|| self.attempt.cmp(&attempt))
            .is_gt()
    }
}

/// What a search did.
///
/// With `reproducible` and a grasp, it covers the attempts up to the one that found it, whatever else the
/// workers had started: attempts and prunes are then the same for any number of workers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SearchReport {
    /// Completed attempts: accepted placements, as the thesis counts.
    pub attempts: u64,
    /// Placements discarded by the pruning measures.
    pub pruned_placements: u64,
    /// Rejections by kind, in the order of [`Rejection::ALL`].
    pub rejections: [u64; Rejection::ALL.len()],
    /// Times by step, if recorded.
    pub step_times: Option<StepTimes>,
    /// The index of the attempt that found the grasp.
    pub attempt: Option<u64>,
    /// The closest failed attempt, if none was valid.
    pub nearest_miss: Option<NearestMiss>,
    /// Where the grasp came from.
    pub source: Option<GraspSource>,
    /// Number of valid grasps found.
    pub candidates: u64,
    /// What keeps one hand from holding the object, if no grasp was found; left empty by the search itself, see
    /// [`limits`](super::limits::limits).
    pub limits: Vec<Limit>,
}

impl SearchReport {
    /// Merges another part of the same search: a worker's share, or a later slice. Keeps the nearer miss of
    /// both. Takes the attempt and source of `part` if its grasp `is_better`.
    pub fn merge(&mut self, part: Self, is_better: bool) {
        self.attempts += part.attempts;
        self.pruned_placements += part.pruned_placements;
        for (sum, count) in self.rejections.iter_mut().zip(part.rejections) {
            *sum += count;
        }
        if let Some(times) = part.step_times {
            let sums = self.step_times.get_or_insert_default();
            for (sum, time) in sums.iter_mut().zip(times) {
                *sum += time;
            }
        }
        if is_better {
            self.attempt = part.attempt;
            self.source = part.source;
        }
        if let Some(miss) = part.nearest_miss
            && self.nearest_miss.as_ref().is_none_or(|nearest| {
                nearest.is_farther_than(miss.rejection, miss.wrench_angle, miss.attempt)
            })
        {
            self.nearest_miss = Some(miss);
        }
        self.candidates += part.candidates;
    }
}

/// Where a grasp came from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GraspSource {
    /// A fresh attempt, by index.
    Attempt(u64),
    /// A grip of the atlas, by index.
    Atlas(u16),
    /// A grip that an earlier search found, by index.
    Learned(u16),
    /// The current grasp, as it is or with digits moved out of the way.
    Current,
    /// A preferred hand, by index.
    Preferred(u16),
}

impl GraspSource {
    /// True for a preferred hand, which precedes all others.
    pub fn is_preferred(self) -> bool {
        matches!(self, Self::Preferred(_))
    }

    /// True for a learned grip, which gives way to those of atlases.
    pub fn is_learned(self) -> bool {
        matches!(self, Self::Learned(_))
    }
}

/// Sees each valid grasp of a search, from the thread that found it. No lock of the search is held meanwhile, but its work waits.
pub trait GraspObserver: fmt::Debug + Send + Sync {
    /// True if the observer wants to have a grasp; cheap, because most are not wanted.
    fn wants(&self, grasp: &Grasp, source: GraspSource, value: f32) -> bool;

    /// Takes a grasp that was wanted, which another one may have overtaken meanwhile.
    fn keep(&self, found: FoundGrasp);

    /// True if a preferred grip is to be no end of the search for the best.
    fn goes_on_after_preferred(&self) -> bool;
}

/// A valid grasp that was found.
#[derive(Clone, Debug)]
pub struct FoundGrasp {
    /// The grasp, with the receiver's arm.
    pub grasp: Box<Grasp>,
    /// Where it came from.
    pub source: GraspSource,
    /// Its quality; higher is better.
    pub value: f32,
    /// When it was found, by the search's clock.
    pub at: Duration,
}

impl FoundGrasp {
    /// Compares two grasps of one hand, the better one being greater: a preferred grip, then a higher quality, then one known
    /// for longer. Equal only for the same grasp.
    pub fn quality(&self, other: &Self) -> Ordering {
        let (this, that) = (self.source, other.source);
        let by_value = self.value.total_cmp(&other.value);
        let by_rank = this.is_preferred().cmp(&that.is_preferred());
        by_rank.then(by_value).then(order(that).cmp(&order(this)))
    }
}

/// The order in which sources are tried.
fn order(source: GraspSource) -> (u8, u64) {
    match source {
        GraspSource::Preferred(index) => (0, u64::from(index)),
        GraspSource::Atlas(index) => (1, u64::from(index)),
        GraspSource::Learned(index) => (2, u64::from(index)),
        GraspSource::Current => (3, 0),
        GraspSource::Attempt(index) => (4, index),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{base::pose::Pose, model::hand::DigitAngles};

    fn miss(rejection: Rejection, wrench_angle: Option<f32>, attempt: u64) -> NearestMiss {
        NearestMiss {
            rejection,
            attempt,
            wrench_angle,
            pose: HandPose {
                frame_from_wrist: Pose::IDENTITY,
                digits: [DigitAngles::default(); 5],
            },
        }
    }

    fn part(nearest_miss: Option<NearestMiss>) -> SearchReport {
        SearchReport {
            attempts: 5,
            pruned_placements: 7,
            rejections: [1, 0, 0, 0, 0, 0, 0, 4, 0],
            step_times: Some([0, 3, 0, 0, 0].map(Duration::from_micros)),
            nearest_miss,
            candidates: 2,
            ..SearchReport::default()
        }
    }

    #[test]
    fn merge_adds_counts_and_keeps_the_nearest_miss() {
        let mut total = SearchReport::default();
        for nearest_miss in [
            Some(miss(Rejection::NotImmobilizing, Some(0.4), 3)),
            Some(miss(Rejection::PalmCollision, None, 8)),
            Some(miss(Rejection::NotImmobilizing, Some(0.2), 12)),
            None,
        ] {
            total.merge(part(nearest_miss), false);
        }
        let expected = SearchReport {
            attempts: 20,
            pruned_placements: 28,
            rejections: [4, 0, 0, 0, 0, 0, 0, 16, 0],
            step_times: Some([0, 12, 0, 0, 0].map(Duration::from_micros)),
            nearest_miss: Some(miss(Rejection::NotImmobilizing, Some(0.2), 12)),
            candidates: 8,
            ..SearchReport::default()
        };
        assert_eq!(total, expected);
    }

    #[test]
    fn merge_takes_the_source_of_the_better_grasp() {
        let of_attempt = |attempt| SearchReport {
            attempt: Some(attempt),
            source: Some(GraspSource::Attempt(attempt)),
            ..SearchReport::default()
        };
        let mut total = of_attempt(1);
        total.merge(of_attempt(2), false);
        assert_eq!(total, of_attempt(1));
        total.merge(of_attempt(3), true);
        assert_eq!(total, of_attempt(3));
    }
}
