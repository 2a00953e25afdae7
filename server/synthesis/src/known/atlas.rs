//! The atlas: the known grips of one hand on one object.

use std::cmp::Reverse;

use glam::Vec3;
use sha2::{Digest as _, Sha256};

use super::{
    entry::{Entry, SLIPS},
    gravity::nearest_direction,
    grips::Grips,
};
use crate::{
    model::{hand::rig::Rig, score::Term},
    propose::mirror::Mirror,
};

/// Steps of a score from 0 to 1, as entries store it, and those by which values are compared.
pub(super) const QUANTA: f32 = 254.0;
const VALUE_STEPS: f32 = 1e6;

/// The known grips of one hand on one object.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Atlas {
    grips: Grips,
    complete: bool,
    stamp: u64,
    /// The plane in which these are mirror images of another hand's grips, whose scores they keep.
    mirror: Option<Mirror>,
}

impl Atlas {
    /// An atlas of some grips; `complete` if it will not grow any further.
    pub fn new(grips: Grips, complete: bool) -> Self {
        Self {
            stamp: stamp(grips.entries()),
            grips,
            complete,
            mirror: None,
        }
    }

    /// The same with a learned grip of the rig, from [`Entry::of_grasp`], without the oldest beyond `most`. A hand that is already
    /// there becomes the newest, which is the last: reproducible requests find the same one repeatedly.
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
        Self::new(grips, self.complete)
    }

    /// True if there are no grips.
    pub fn is_empty(&self) -> bool {
        self.entries().is_empty()
    }

    /// Mirror images of another hand's grips.
    pub(super) fn of_mirrored(grips: Grips, complete: bool, mirror: Mirror) -> Self {
        Self {
            mirror: Some(mirror),
            ..Self::new(grips, complete)
        }
    }

    /// The place in an entry's scores of a direction `up`, a unit vector against gravity in the object's frame.
    pub(crate) fn direction(&self, up: Vec3) -> usize {
        nearest_direction(self.mirror.map_or(up, |mirror| mirror.direction(up)))
    }

    /// Indices into [`Atlas::entries`] by falling value under this gravity, with `stance` the value of a forearm's direction for
    /// where the receiver stands, 0 to 1. Grips that let the object slip come last. Takes some microseconds for hundreds of grips.
    pub fn by_value(&self, up: Vec3, stance: impl Fn(Vec3) -> f32) -> Vec<u16> {
        let direction = self.direction(up);
        let value = |&entry: &u16| {
            let value = match self.entries()[usize::from(entry)].scores[direction] {
                SLIPS => 0.0,
                score => {
                    let stance = stance(self.grips.forearms()[usize::from(entry)]);
                    f32::from(score) / QUANTA + Term::Stance.share() * stance
                }
            };
            (Reverse((value * VALUE_STEPS) as u32), entry)
        };
        let mut order: Vec<u16> = self.indices().collect();
        order.sort_by_cached_key(value);
        order
    }

    /// Indices into [`Atlas::entries`] by falling score for `up`, a unit vector against gravity in the object's frame. Grips
    /// that let the object slip come last.
    pub fn by_score(&self, up: Vec3) -> Vec<u16> {
        let direction = self.direction(up);
        let mut order: Vec<u16> = self.indices().collect();
        // Stable: equal scores keep the order of the entries.
        order.sort_by_key(|&entry| Reverse(self.entries()[usize::from(entry)].scores[direction]));
        order
    }

    /// The part of [`Atlas::by_score`] that holds the object.
    pub fn holding_under(&self, up: Vec3) -> Vec<u16> {
        let direction = self.direction(up);
        let mut order = self.by_score(up);
        order.retain(|&entry| self.entries()[usize::from(entry)].scores[direction] != SLIPS);
        order
    }

    fn indices(&self) -> impl Iterator<Item = u16> + use<> {
        0..self.entries().len() as u16
    }

    /// The grips, in the order found; once complete, by falling score.
    pub fn entries(&self) -> &[Entry] {
        self.grips.entries()
    }

    /// The same grips with the data that screens them against barriers.
    pub fn grips(&self) -> &Grips {
        &self.grips
    }

    /// The grips alone.
    pub fn into_grips(self) -> Grips {
        self.grips
    }

    /// True if the atlas will not grow any further.
    pub fn is_complete(&self) -> bool {
        self.complete
    }

    /// The same grips as an atlas that does not grow any further.
    #[must_use]
    pub(super) fn completed(self) -> Self {
        Self {
            complete: true,
            ..self
        }
    }

    /// Identifies the grips: equal for the same grips in the same order.
    pub fn stamp(&self) -> u64 {
        self.stamp
    }

    /// Memory use in bytes.
    pub fn bytes(&self) -> usize {
        self.grips.bytes()
    }
}

/// The first eight bytes of a hash of the hand poses and their scores.
pub(super) fn stamp(entries: &[Entry]) -> u64 {
    let mut hash = Sha256::new();
    for entry in entries {
        let pose = &entry.grip.pose;
        let wrist = pose.frame_from_wrist;
        let angles = pose.digits.iter().flat_map(|digit| {
            [
                digit.base_yaw,
                digit.base_pitch,
                digit.second_pitch,
                digit.third_pitch,
            ]
        });
        let numbers = wrist.position.to_array().into_iter();
        for number in numbers.chain(wrist.orientation.to_array()).chain(angles) {
            hash.update(number.to_le_bytes());
        }
        hash.update(entry.scores);
    }
    let digest = hash.finalize();
    digest
        .iter()
        .take(8)
        .fold(0, |stamp, &byte| stamp << 8 | u64::from(byte))
}
