//! Grips that searches found for holdouts for which the atlas has none.
//!
//! Givers that leave no grip of the atlas free come back: an animation holds an object out the same way each time, and a
//! tracked hand moves little between two frames. Each of their searches would take milliseconds. So what they find is
//! learned, and tried after everything else that is known: it answers only what would otherwise be searched, and no seeds
//! are taken from it. First valid grasps that the atlas gives, and attempts that are replayed, do not depend on it.

use super::{atlas::stamp, entry::Entry, grips::Grips};
use crate::model::hand::rig::Rig;

/// Grips that searches found, the oldest first.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LearnedGrips {
    grips: Grips,
    stamp: u64,
}

impl LearnedGrips {
    /// The same with a grip of the rig, from [`Entry::of_grasp`], without the oldest beyond `most`. A hand that is already
    /// there becomes the newest: reproducible requests find the same one repeatedly.
    #[must_use]
    pub fn with(&self, rig: &Rig, newest: Entry, most: usize) -> Self {
        let mut grips = self.grips.clone();
        let is_newest = |entry: &Entry| entry.grip.pose == newest.grip.pose;
        if let Some(place) = grips.entries().iter().position(is_newest) {
            grips.remove(place);
        }
        grips.push(rig, newest);
        while grips.entries().len() > most {
            grips.remove(0);
        }
        Self {
            stamp: stamp(grips.entries()),
            grips,
        }
    }

    /// The grips.
    pub fn entries(&self) -> &[Entry] {
        self.grips.entries()
    }

    /// The same with the data that screens them against a giver.
    pub fn grips(&self) -> &Grips {
        &self.grips
    }

    /// Identifies the grips: equal for the same grips in the same order.
    pub fn stamp(&self) -> u64 {
        self.stamp
    }

    /// True if there are none.
    pub fn is_empty(&self) -> bool {
        self.entries().is_empty()
    }

    /// Memory use in bytes.
    pub fn bytes(&self) -> usize {
        self.grips.bytes()
    }
}
