//! What a search did.

use crate::{
    base::{rejection::Rejection, stopwatch::StepTimes},
    model::hand::HandPose,
};

/// The failed attempt that came closest to a grasp: the one that failed in the latest step (in the order of
/// [`Rejection::ALL`]), of those the one with the smallest wrench angle, of those the one with the lowest index.
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
    /// True if an attempt that failed in this way comes closer than `self`.
    pub(super) fn is_beaten_by(&self, rejection: Rejection, wrench_angle: Option<f32>, attempt: u64) -> bool {
        // All attempts that got to `NotImmobilizing` have an angle, no others do.
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
/// With `reproducible` and a grasp, it tells of the attempts up to the one that gave it, whatever else the workers had
/// begun; the attempts and prunes are then the same for any number of workers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SearchReport {
    /// Attempts that were run to their end: accepted placements, as the thesis counts.
    pub attempts: u64,
    /// Placements that the measures pruned.
    pub pruned_placements: u64,
    /// Rejections by kind, in the order of [`Rejection::ALL`].
    pub rejections: [u64; Rejection::ALL.len()],
    /// Times by step, if they were asked for.
    pub step_times: Option<StepTimes>,
    /// The index of the attempt that gave the grasp.
    pub attempt: Option<u64>,
    /// The attempt that came closest, if none was valid.
    pub nearest_miss: Option<NearestMiss>,
    /// Where the grasp came from.
    pub source: Option<GraspSource>,
    /// Valid grasps that were found.
    pub candidates: u64,
    /// Known grips that there were to try.
    pub known_grips: usize,
}

/// Where a grasp came from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GraspSource {
    /// A fresh attempt of this index.
    Attempt(u64),
    /// The atlas' grip of this index.
    Atlas(u16),
    /// The same without the fingers that the giver is in the way of: they rest elsewhere.
    Spared(u16),
    /// A grip that an earlier search found.
    Recent,
}
