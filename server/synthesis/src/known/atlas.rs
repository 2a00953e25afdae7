//! The atlas: the known grips of one hand on one object, ordered for look-up.

use glam::Vec3;
use sha2::{Digest as _, Sha256};

use super::{
    entry::Entry,
    gravity::nearest_direction,
    gravity_order::GravityOrder,
    grips::Grips,
    occupancy::Occupancy,
    shortlist::{Shortlists, rank},
};
use crate::{
    model::{hand::rig::Rig, object::GraspObject},
    physical::solids::PreparedHand,
    propose::mirror::Mirror,
};

pub use crate::known::occupancy::Excluded;
pub use crate::known::shortlist::{Listed, Shortlist};

/// The known grips of one hand on one object.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Atlas {
    grips: Grips,
    order: GravityOrder,
    shortlists: Shortlists,
    occupancy: Occupancy,
    complete: bool,
    stamp: u64,
    /// The plane in which these are mirror images of another hand's grips, whose scores they keep.
    mirror: Option<Mirror>,
}

impl Atlas {
    /// Builds the atlas of an object and a rig. `complete` if it will not grow any further.
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
            mirror: None,
        }
    }

    /// Mirror images of another hand's grips, as a [compact](Self::compact) atlas.
    pub(super) fn of_mirrored(grips: Grips, complete: bool, mirror: Mirror) -> Self {
        Self {
            mirror: Some(mirror),
            ..Self::compact(grips, complete)
        }
    }

    /// The direction under which its grips have their scores for `up`, a unit vector against gravity in the object's frame.
    fn rated_up(&self, up: Vec3) -> Vec3 {
        self.mirror.map_or(up, |mirror| mirror.direction(up))
    }

    /// Its place in an entry's scores.
    pub(crate) fn direction(&self, up: Vec3) -> usize {
        nearest_direction(self.rated_up(up))
    }

    /// An atlas of a few grips, without what makes look-ups in thousands quick: all are tried one by one. Takes a third of the
    /// memory, and no time to build.
    pub fn compact(grips: Grips, complete: bool) -> Self {
        let entries = grips.entries();
        Self {
            order: GravityOrder::of(entries),
            stamp: stamp(entries),
            grips,
            complete,
            ..Self::default()
        }
    }

    /// True if it has no shortlists, because it has few grips.
    pub fn is_compact(&self) -> bool {
        self.shortlists.is_empty()
    }

    /// The grips that hold under this gravity by falling value, with `stance` the value of a forearm's direction for where the
    /// receiver stands, 0 to 1. Takes some microseconds for hundreds of grips.
    pub fn by_value(&self, up: Vec3, stance: impl Fn(Vec3) -> f32) -> Vec<u16> {
        let direction = self.direction(up);
        let value = |&entry: &u16| {
            let place = usize::from(entry);
            let score = self.entries()[place].scores[direction];
            (rank(score, stance(self.grips.forearms()[place])), entry)
        };
        let mut order: Vec<u16> = self.holding_under(up).to_vec();
        order.sort_by_cached_key(value);
        order
    }

    /// The grips, in the order found; once complete, by falling score.
    pub fn entries(&self) -> &[Entry] {
        self.grips.entries()
    }

    /// The same grips with the data that screens them against a giver.
    pub fn grips(&self) -> &Grips {
        &self.grips
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

    /// Indices into [`Atlas::entries`] by falling score for `up`, a unit vector against gravity in the
    /// object's frame. Grips that let the object slip come last.
    pub fn by_score(&self, up: Vec3) -> &[u16] {
        self.order.under(self.rated_up(up))
    }

    /// A few grips that hold under this gravity, by falling score, chosen so that nearly every giver leaves
    /// at least one free. Try these first when there is a giver and any valid grasp will do.
    pub fn shortlist(&self, up: Vec3) -> Shortlist<'_> {
        self.shortlists.under(self.rated_up(up))
    }

    /// The grips on any shortlist, as ascending indices into [`Atlas::entries`].
    pub fn listed(&self) -> impl Iterator<Item = u16> {
        self.shortlists.all().iter().map(|listed| listed.entry)
    }

    /// The same grips, each with the number of shortlists that it is on.
    pub fn times_listed(&self) -> Vec<(u16, usize)> {
        self.listed().zip(self.shortlists.times_listed()).collect()
    }

    /// The part of [`Atlas::by_score`] that holds the object.
    pub fn holding_under(&self, up: Vec3) -> &[u16] {
        self.order.holding_under(self.rated_up(up))
    }

    /// The grips that certainly come too close to a giver's hand or forearm; others may, too.
    pub fn excluded_by(&self, giver: &PreparedHand) -> Excluded<'_> {
        self.occupancy.excluded_by(giver)
    }

    /// Memory use in bytes.
    pub fn bytes(&self) -> usize {
        self.grips.bytes() + self.order.bytes() + self.shortlists.bytes() + self.occupancy.bytes()
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
