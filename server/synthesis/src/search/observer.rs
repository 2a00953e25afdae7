//! What looks on while a search finds valid grasps.

use std::{cmp::Ordering, fmt, time::Duration};

use super::report::GraspSource;
use crate::model::grasp::Grasp;

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
