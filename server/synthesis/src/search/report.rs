//! The results of a search: its statistics, its observer, and the best grasps that differ.

use std::{cmp::Ordering, fmt, time::Duration};

use glam::Vec3;

use super::limits::Limit;
use crate::{
    base::{rejection::Rejection, stopwatch::StepTimes},
    geometry::boxes::Aabb,
    known::entry::nearest_axis,
    model::{
        grasp::{Contact, Grasp},
        grasp_type::GraspType,
        hand::{HandPose, Handedness},
        object::GraspObject,
    },
    rating::scoring::middle,
};

/// The failed attempt that came closest to a grasp: it failed in the latest step (in the order of [`Rejection::ALL`]), then with
/// the smallest wrench angle, then with the lowest index.
#[derive(Clone, Debug, PartialEq)]
pub struct NearestMiss {
    /// Why it failed.
    pub rejection: Rejection,
    /// Index of the attempt.
    pub attempt: u64,
    /// For `NotImmobilizing`: the smallest wrench angle, in radians.
    pub wrench_angle: Option<f32>,
    /// The hand in the object's frame.
    pub pose: HandPose,
}

/// The statistics of a search.
///
/// If reproducible and successful, they cover the attempts up to the winner only, so they do not depend on the number of workers.
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
    /// The closest failed attempt, if none was valid.
    pub nearest_miss: Option<NearestMiss>,
    /// Source of the grasp.
    pub source: Option<GraspSource>,
    /// Number of valid grasps found.
    pub candidates: u64,
    /// Limits that keep one hand from holding the object, if no grasp was found. Callers fill them in by
    /// [`limits`](super::limits::limits).
    pub limits: Vec<Limit>,
}

impl SearchReport {
    /// The index of the attempt that found the grasp.
    pub fn attempt(&self) -> Option<u64> {
        self.source.and_then(GraspSource::attempt)
    }

    /// Keeps a failed attempt if it came closer than those before.
    pub(super) fn note_miss(
        &mut self,
        rejection: Rejection,
        wrench_angle: Option<f32>,
        attempt: u64,
        pose: impl FnOnce() -> HandPose,
    ) {
        // Exactly the attempts that reached `NotImmobilizing` have an angle.
        let angle = |angle: Option<f32>| angle.unwrap_or(0.0);
        let is_closer = self.nearest_miss.as_ref().is_none_or(|nearest| {
            let by_step = rejection.index().cmp(&nearest.rejection.index());
            by_step
                .then_with(|| angle(nearest.wrench_angle).total_cmp(&angle(wrench_angle)))
                .then_with(|| nearest.attempt.cmp(&attempt))
                .is_gt()
        });
        if is_closer {
            self.nearest_miss = Some(NearestMiss {
                rejection,
                attempt,
                wrench_angle,
                pose: pose(),
            });
        }
    }

    /// Merges another part of the same search: a worker's share, or a later slice. Keeps the nearer miss, and the source of `part`
    /// if its grasp `is_better`.
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
            self.source = part.source;
        }
        if let Some(miss) = part.nearest_miss {
            self.note_miss(miss.rejection, miss.wrench_angle, miss.attempt, || miss.pose);
        }
        self.candidates += part.candidates;
    }
}

/// Source of a grasp, in the order in which sources are tried.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum GraspSource {
    /// A preferred hand, by index.
    Preferred(u16),
    /// A grip of the atlas, by index.
    Atlas(u16),
    /// A grip that an earlier search found, by index.
    Learned(u16),
    /// The current grasp, as it is or with digits moved out of the way.
    Current,
    /// A fresh attempt, by index.
    Attempt(u64),
}

impl GraspSource {
    /// True for a preferred hand, which precedes all others.
    pub fn is_preferred(self) -> bool {
        matches!(self, Self::Preferred(_))
    }

    /// The index of an attempt.
    pub fn attempt(self) -> Option<u64> {
        match self {
            Self::Attempt(index) => Some(index),
            _ => None,
        }
    }

    /// True for a learned grip, which gives way to those of atlases.
    pub fn is_learned(self) -> bool {
        matches!(self, Self::Learned(_))
    }
}

/// Sees each valid grasp of a search, on the thread that found it. No lock of the search is held meanwhile, but that worker waits.
pub trait GraspObserver: fmt::Debug + Send + Sync {
    /// True if the observer wants to have a grasp; cheap, because most are not wanted.
    fn wants(&self, grasp: &Grasp, source: GraspSource, value: f32) -> bool;

    /// Takes a wanted grasp, which another may have overtaken.
    fn keep(&self, found: FoundGrasp);

    /// True if a search for the best continues after a preferred grip.
    fn goes_on_after_preferred(&self) -> bool;
}

/// A valid grasp that was found.
#[derive(Clone, Debug)]
pub struct FoundGrasp {
    /// The grasp, with the receiver's arm.
    pub grasp: Box<Grasp>,
    /// Source of the grasp.
    pub source: GraspSource,
    /// Its quality; higher is better.
    pub value: f32,
    /// When it was found, by the search's clock.
    pub at: Duration,
}

impl FoundGrasp {
    /// Compares two grasps of one hand, the better one being greater: a preferred grip, then a higher quality, then the earlier
    /// source. Equal only for the same grasp.
    pub fn quality(&self, other: &Self) -> Ordering {
        let (this, that) = (self.source, other.source);
        let by_value = self.value.total_cmp(&other.value);
        let by_rank = this.is_preferred().cmp(&that.is_preferred());
        by_rank.then(by_value).then(that.cmp(&this))
    }
}

/// Unsettled attempts kept before the worker checks which are settled. More cost memory (24 bytes each), fewer cost time.
const SETTLE_INTERVAL: usize = 4096;

/// A completed attempt.
#[derive(Clone, Copy, Debug)]
pub(super) struct Record {
    pub(super) attempt: u64,
    pub(super) pruned: u64,
    /// Why it failed; `None` if it was valid.
    pub(super) rejection: Option<Rejection>,
}

/// The counts of one worker.
#[derive(Debug, Default)]
pub(super) struct Tally {
    pub(super) report: SearchReport,
    unsettled: Vec<Record>,
    pub(super) interrupted_prunes: u64,
}

impl Tally {
    /// Counts an attempt once no earlier attempt can be the winner.
    pub(super) fn count_when_settled(&mut self, record: Record, last_settled: impl FnOnce() -> Option<u64>) {
        self.unsettled.push(record);
        if self.unsettled.len().is_multiple_of(SETTLE_INTERVAL)
            && let Some(last) = last_settled()
        {
            self.settle(last);
        }
    }

    fn settle(&mut self, last: u64) {
        // A worker's indices ascend.
        let settled = self.unsettled.partition_point(|record| record.attempt <= last);
        for record in self.unsettled.drain(..settled) {
            self.report.attempts += 1;
            self.report.pruned_placements += record.pruned;
            if let Some(rejection) = record.rejection {
                self.report.rejections[rejection.index()] += 1;
            }
        }
    }

    /// Adds this worker's counts to a report; only attempts up to `last_counted`, if given.
    pub(super) fn add_to(mut self, report: &mut SearchReport, last_counted: Option<u64>) {
        self.settle(last_counted.unwrap_or(u64::MAX));
        if last_counted.is_none() {
            report.pruned_placements += self.interrupted_prunes;
        }
        report.merge(self.report, false);
    }
}

/// The features in which alternatives must differ.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Differences {
    /// The side of the object that the hand comes from, and the hand.
    pub approach: bool,
    /// The grasp type.
    pub grasp_type: bool,
    /// The part of the object that is held.
    pub region: bool,
}

/// The features that the grasps of a class share; `None` for those that do not matter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Class {
    /// The side that the palm faces away from most, 0 to 5 for x, -x, y, -y, z, -z, and the hand.
    pub approach: Option<(u8, Handedness)>,
    /// The type; the inner `None` for a grasp without a type.
    pub grasp_type: Option<Option<GraspType>>,
    /// The part that is held.
    pub region: Option<Part>,
}

/// A part of an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The region with most contacts, by its place; `None` off all regions.
    Region(Option<usize>),
    /// Without regions: an eighth of the bounding box. A bit per axis is 1 in its upper half.
    Octant(u8),
}

impl Class {
    /// The class of a grasp on an object.
    pub fn of(grasp: &Grasp, handedness: Handedness, object: &GraspObject, by: Differences) -> Self {
        Self {
            approach: by.approach.then(|| {
                let away = grasp.pose.frame_from_wrist.transform_vector(Vec3::NEG_Z);
                (nearest_axis(away), handedness)
            }),
            grasp_type: by.grasp_type.then_some(grasp.classification.grasp_type),
            region: by.region.then(|| part_of(&grasp.contacts, object)),
        }
    }
}

fn part_of(contacts: &[Contact], object: &GraspObject) -> Part {
    let regions = object.regions();
    if !regions.is_empty() {
        return Part::Region(regions.with_most(contacts));
    }
    let Aabb { min, max } = object.mesh.aabb();
    let upper = middle(contacts.iter()).cmpgt(0.5 * (min + max));
    Part::Octant(upper.bitmask() as u8)
}

/// The best grasps of different classes. The result does not depend on the order in which grasps are offered.
#[derive(Clone, Debug)]
pub struct Alternatives {
    most: usize,
    /// The best of each class, best first.
    pub best: Vec<Alternative>,
}

/// The best grasp of its class.
#[derive(Clone, Debug)]
pub struct Alternative {
    /// The class.
    pub class: Class,
    /// The hand.
    pub handedness: Handedness,
    /// The grasp.
    pub found: FoundGrasp,
}

impl Alternative {
    /// Orders the better alternative first, and of equal ones the right hand's.
    fn order(&self, other: &Self) -> Ordering {
        let hand = |of: &Self| of.handedness == Handedness::Left;
        let by_quality = other.found.quality(&self.found);
        by_quality.then(hand(self).cmp(&hand(other)))
    }
}

impl Alternatives {
    /// No alternatives yet, and at most so many.
    pub fn new(most: usize) -> Self {
        Self {
            most,
            best: Vec::with_capacity(most + 1),
        }
    }

    /// The quality that a further grasp has to reach; `None` until the list is full.
    pub fn least(&self) -> Option<f32> {
        let is_full = self.best.len() >= self.most;
        self.best
            .last()
            .filter(|_| is_full)
            .map(|worst| worst.found.value)
    }

    /// Offers a grasp. Grasps that were crowded out can be forgotten: the final best of a class is better than the worst grasp
    /// kept when it is offered.
    pub fn offer(&mut self, new: Alternative) {
        match self.best.iter().position(|kept| kept.class == new.class) {
            Some(place) if new.order(&self.best[place]).is_lt() => {
                self.best.remove(place);
            }
            Some(_) => return,
            None => {}
        }
        let place = self.best.partition_point(|kept| kept.order(&new).is_lt());
        self.best.insert(place, new);
        self.best.truncate(self.most);
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
    fn merge_adds_counts_and_keeps_the_nearest_miss_and_the_better_source() {
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
        let mut better = SearchReport {
            source: Some(GraspSource::Current),
            ..SearchReport::default()
        };
        better.merge(total.clone(), false);
        assert_eq!(better.source, Some(GraspSource::Current));
        total.merge(better, true);
        assert_eq!(total.source, Some(GraspSource::Current));
    }
}
