//! The valid grasps of a race, and which of them wins.

use crate::{model::grasp::Grasp, search::report::GraspSource};

/// A valid grasp.
pub(super) struct Winner {
    pub(super) source: GraspSource,
    pub(super) grasp: Box<Grasp>,
    pub(super) value: f32,
    /// The last attempt of a reproducible search that replaces it, if a person would choose the grasp of that but not this one.
    pub(super) last_replacing: u64,
}

/// The valid grasps so far.
#[derive(Default)]
pub(super) struct Winners {
    /// The best, the first, or the one with the lowest index that a person would choose.
    pub(super) chosen: Option<Winner>,
    /// Those that a person would not choose.
    pub(super) others: Vec<Winner>,
}

impl Winner {
    /// The index of the attempt that found it; `None` for known grips.
    pub(super) fn index(&self) -> Option<u64> {
        match self.source {
            GraspSource::Attempt(index) => Some(index),
            GraspSource::Atlas(_)
            | GraspSource::Learned(_)
            | GraspSource::Current
            | GraspSource::Preferred(_) => None,
        }
    }
}

impl Winners {
    /// The winner and, if a person would not choose it, the last attempt of a reproducible search that may replace it, or any
    /// number.
    pub(super) fn decided(self, is_reproducible: bool) -> (Option<Winner>, Option<u64>) {
        let Self { chosen, others } = self;
        let last = others.iter().map(|other| other.last_replacing).min();
        // Beyond the last, attempts may have run that need not have.
        let counts = |winner: &Winner| !is_reproducible || winner.index() <= last;
        if let Some(chosen) = chosen
            && (last.is_none() || counts(&chosen))
        {
            return (Some(chosen), None);
        }
        let better = |a: &Winner, b: &Winner| a.value.total_cmp(&b.value).then(b.index().cmp(&a.index()));
        (others.into_iter().filter(counts).max_by(better), last)
    }
}
