//! The atlas: the known grips of one hand on one object, ordered for look-up.

use glam::Vec3;
use sha2::{Digest as _, Sha256};

use super::{
    entry::Entry, gravity_order::GravityOrder, grips::Grips, occupancy::Occupancy, shortlist::Shortlists,
};
use crate::{
    model::{hand::rig::Rig, object::GraspObject},
    physical::solids::PreparedHand,
};

pub use crate::known::occupancy::Excluded;
pub use crate::known::shortlist::{Listed, Shortlist};

/// What is known of how a hand holds an object.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Atlas {
    grips: Grips,
    order: GravityOrder,
    shortlists: Shortlists,
    occupancy: Occupancy,
    complete: bool,
    stamp: u64,
}

impl Atlas {
    /// An atlas of what is known of an object and a rig; `complete` if it is not going to grow.
    pub fn new(object: &GraspObject, rig: &Rig, grips: Grips, complete: bool) -> Self {
        let entries = grips.entries();
        let occupancy = Occupancy::of(object, rig, entries);
        Self {
            order: GravityOrder::of(entries),
            shortlists: Shortlists::of(rig, entries, &occupancy),
            occupancy,
            stamp: stamp(entries),
            grips,
            complete,
        }
    }

    /// The grips: in the order in which they were found, or by falling score once they are complete.
    pub fn entries(&self) -> &[Entry] {
        self.grips.entries()
    }

    /// The same with what tells soonest that they are in a giver's way.
    pub fn grips(&self) -> &Grips {
        &self.grips
    }

    /// True if it is not going to grow.
    pub fn is_complete(&self) -> bool {
        self.complete
    }

    /// A number that names these grips: the same for the same grips in the same order.
    pub fn stamp(&self) -> u64 {
        self.stamp
    }

    /// The grips in the order of their score when `up` (a unit vector in the object's frame) is against gravity, as
    /// indices of [`Atlas::entries`]; those that the object would slip out of come last.
    pub fn by_score(&self, up: Vec3) -> &[u16] {
        self.order.under(up)
    }

    /// Some of the grips that the object does not slip out of, by falling score, of which nearly every giver leaves one:
    /// those to be tried first where there is a giver and any valid one will do.
    pub fn shortlist(&self, up: Vec3) -> Shortlist<'_> {
        self.shortlists.under(up)
    }

    /// The grips that are on any of these lists, as rising indices of [`Atlas::entries`].
    pub fn listed(&self) -> impl Iterator<Item = u16> {
        self.shortlists.all().iter().map(|listed| listed.entry)
    }

    /// Those of [`Atlas::by_score`] that the object does not slip out of.
    pub fn holding_under(&self, up: Vec3) -> &[u16] {
        self.order.holding_under(up)
    }

    /// The grips that certainly come too near to a giver's hand, or to its forearm; others may, too.
    pub fn excluded_by(&self, giver: &PreparedHand) -> Excluded<'_> {
        self.occupancy.excluded_by(giver)
    }

    /// Bytes that it takes in memory.
    pub fn bytes(&self) -> usize {
        self.grips.bytes() + self.order.bytes() + self.shortlists.bytes() + self.occupancy.bytes()
    }
}

/// The first bytes of a hash over where the hands are and what they are worth.
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
