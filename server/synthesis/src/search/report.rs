//! What a search did.

use super::limits::Limit;
use crate::{
    base::{rejection::Rejection, stopwatch::StepTimes},
    model::hand::HandPose,
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
            self.step_times.get_or_insert_default().add(&times);
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

#[cfg(test)]
mod tests {
    use std::time::Duration;

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
            step_times: Some(StepTimes {
                finger_posing: Duration::from_micros(3),
                ..StepTimes::default()
            }),
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
            step_times: Some(StepTimes {
                finger_posing: Duration::from_micros(12),
                ..StepTimes::default()
            }),
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
