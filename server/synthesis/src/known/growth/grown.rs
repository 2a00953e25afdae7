//! The state of a growth, and excerpts of it.

use std::{cmp::Reverse, sync::Arc};

use crate::{
    known::{
        atlas::{Atlas, Grips},
        excerpt::times_listed,
        spread::Occupancy,
    },
    model::{hand::rig::Rig, object::GraspObject},
    physical::shape::HandShape,
};

/// Grips that are shipped with an object or a primitive, at about 230 bytes each.
const SHIPPED: usize = 320;

/// The state of a growth, with everything needed to resume it.
#[derive(Clone, Debug, PartialEq)]
pub struct Grown {
    /// The grips.
    pub atlas: Arc<Atlas>,
    /// The shape that each grip's hand was closed from.
    pub(in crate::known) shapes: Vec<HandShape>,
    /// Proposals tried.
    pub(in crate::known) proposed: u64,
    /// The atlas' stamp after the first [`EARLY_PROPOSALS`](super::EARLY_PROPOSALS); 0 before.
    pub(in crate::known) early_stamp: u64,
    /// Of a growth that goes on: that of the other hand, if these grips are its mirror images.
    pub(in crate::known) original: Option<Arc<Self>>,
}

impl Grown {
    /// The growth that goes on: itself, or that of which it is the mirror image.
    pub fn original(&self) -> &Self {
        self.original.as_deref().unwrap_or(self)
    }

    /// The atlas' stamp after the first [`EARLY_PROPOSALS`](super::EARLY_PROPOSALS); 0 before. Growths that differ have different
    /// stamps.
    pub fn early_stamp(&self) -> u64 {
        self.early_stamp
    }

    /// Number of proposals tried; 0 if these are the listed grips of another atlas.
    pub fn proposed(&self) -> u64 {
        self.proposed
    }

    /// The grips on any shortlist, as an incomplete atlas: nearly every giver leaves some of these few free. Resuming from it
    /// does not continue the growth of the atlas, but starts over.
    #[must_use]
    pub fn listed(&self, object: &GraspObject, rig: &Rig) -> Self {
        let listed = self.times_listed(object, rig).into_iter();
        self.only(rig, listed.map(|(entry, _)| entry))
    }

    /// The grips that are on most shortlists, likewise: as many as are shipped.
    #[must_use]
    pub fn most_listed(&self, object: &GraspObject, rig: &Rig) -> Self {
        let mut by_count = self.times_listed(object, rig);
        by_count.sort_by_key(|&(entry, times)| (Reverse(times), entry));
        let most = by_count.into_iter().take(SHIPPED);
        let mut most: Vec<u16> = most.map(|(entry, _)| entry).collect();
        most.sort_unstable();
        self.only(rig, most.into_iter())
    }

    /// The listed grips, ascending, each with the number of shortlists that it is on.
    fn times_listed(&self, object: &GraspObject, rig: &Rig) -> Vec<(u16, usize)> {
        let entries = self.atlas.entries();
        times_listed(entries, &Occupancy::of(object, rig, entries))
    }

    /// The same grips as a complete atlas.
    #[must_use]
    pub fn completed(self) -> Self {
        Self {
            atlas: Arc::new(Arc::unwrap_or_clone(self.atlas).completed()),
            ..self
        }
    }

    /// Some of the grips as an incomplete atlas.
    fn only(&self, rig: &Rig, places: impl Iterator<Item = u16>) -> Self {
        let places = places.map(usize::from);
        let (entries, shapes) = places
            .map(|place| (self.atlas.entries()[place].clone(), self.shapes[place]))
            .unzip();
        Self {
            atlas: Arc::new(Atlas::new(Grips::new(rig, entries), false)),
            shapes,
            proposed: 0,
            early_stamp: self.early_stamp,
            original: None,
        }
    }

    /// Memory use in bytes.
    pub fn bytes(&self) -> usize {
        let of_original = self.original.as_ref().map_or(0, |original| original.bytes());
        self.atlas.bytes() + size_of_val(self.shapes.as_slice()) + of_original
    }
}
