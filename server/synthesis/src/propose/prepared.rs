//! Rigs and objects together with the data that proposals derive from them once.

use std::{
    ops::Deref,
    sync::{Arc, OnceLock},
};

use sha2::{Digest as _, Sha256};

use super::{
    hand_span::hand_span,
    holdable::HoldableSurface,
    opposition::Oppositions,
    placement_cache::{PlacementCache, PlacementCaches},
    surface_pairs::SurfacePairs,
};
use crate::{
    base::stop::{Stop, Stopped, unstopped},
    model::{hand::rig::Rig, object::GraspObject, regions::MAX_MISSED},
};

/// A rig and its oppositions, which are sampled on first use. Clones share both. Two are equal if their rigs make the same
/// grips, whatever their names.
#[derive(Clone, Debug)]
pub struct PreparedRig(Arc<RigParts>);

#[derive(Debug)]
struct RigParts {
    rig: Rig,
    /// SHA-256 of the rig's content.
    hash: [u8; 32],
    oppositions: OnceLock<Oppositions>,
    span: OnceLock<f32>,
}

impl PreparedRig {
    /// Wraps a rig; its oppositions are sampled on first use.
    pub fn new(rig: Rig) -> Self {
        Self(Arc::new(RigParts {
            hash: Sha256::digest(rig.content()).into(),
            rig,
            oppositions: OnceLock::new(),
            span: OnceLock::new(),
        }))
    }

    /// The rig's oppositions of thumb and fingers. The first call takes 0.1 to 0.2 s.
    pub fn oppositions(&self) -> &Oppositions {
        self.0.oppositions.get_or_init(|| Oppositions::of(&self.0.rig))
    }

    /// An upper bound on the distance of two contacts of the hand, in metres. The first call takes a millisecond.
    pub fn span(&self) -> f32 {
        *self.0.span.get_or_init(|| hand_span(&self.0.rig))
    }

    /// True once the oppositions have been sampled, so that [`Self::oppositions`] returns at once.
    pub fn is_derived(&self) -> bool {
        self.0.oppositions.get().is_some()
    }
}

impl PartialEq for PreparedRig {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0) || self.0.hash == other.0.hash
    }
}

impl Eq for PreparedRig {}

impl Deref for PreparedRig {
    type Target = Rig;

    fn deref(&self) -> &Rig {
        &self.0.rig
    }
}

/// An object, the surface points where hands may press, and its placement caches.
#[derive(Debug)]
pub struct PreparedObject {
    object: Arc<GraspObject>,
    surface_pairs: SurfacePairs,
    wanted: SurfacePairs,
    holdable: HoldableSurface,
    placements: PlacementCaches,
}

impl PreparedObject {
    /// Samples the object's surface for opposed points and handles, which takes some milliseconds.
    pub fn new(object: Arc<GraspObject>) -> Self {
        unstopped(|stop| Self::new_until(object, stop))
    }

    /// As [`Self::new`], unless it is stopped.
    ///
    /// # Errors
    /// [`Stopped`].
    pub fn new_until(object: Arc<GraspObject>, stop: Stop<'_>) -> Result<Self, Stopped> {
        let surface_pairs = SurfacePairs::of(&object, stop)?;
        let wanted = if object.regions().require_contacts() {
            surface_pairs.wanted(MAX_MISSED)
        } else {
            SurfacePairs::default()
        };
        let holdable = HoldableSurface::of(&object, &surface_pairs, stop)?;
        // Found here rather than by the first search.
        object.parts_until(stop)?;
        Ok(Self {
            object,
            surface_pairs,
            wanted,
            holdable,
            placements: PlacementCaches::default(),
        })
    }

    /// Memory use in bytes of what is derived from the plain object, placement caches of two hands included.
    pub fn derived_bytes(&self) -> usize {
        let of_pairs = self.surface_pairs.bytes() + self.wanted.bytes();
        self.object.derived_bytes() + of_pairs + 2 * PlacementCaches::BYTES_PER_RIG
    }

    /// The object itself.
    pub fn object(&self) -> &Arc<GraspObject> {
        &self.object
    }

    /// The points where opposed digits or the palm may press.
    pub fn surface_pairs(&self) -> &SurfacePairs {
        &self.surface_pairs
    }

    /// Those of them where the object's owner wants hands; none if that is everywhere.
    pub fn wanted_pairs(&self) -> &SurfacePairs {
        &self.wanted
    }

    /// Bounds on where it may be held.
    pub fn holdable(&self) -> &HoldableSurface {
        &self.holdable
    }

    /// The placements at which a hand fits at the object and is likely to hold it. The first call for a rig takes about five
    /// milliseconds.
    pub fn placement_cache(&self, rig: &PreparedRig) -> Arc<PlacementCache> {
        self.placements.of(self, rig)
    }

    /// Builds what [`Self::placement_cache`] returns, unless it is stopped.
    ///
    /// # Errors
    /// [`Stopped`].
    pub fn build_placement_cache(&self, rig: &PreparedRig, stop: Stop<'_>) -> Result<(), Stopped> {
        self.placements.build_until(self, rig, stop)
    }

    /// True if [`Self::placement_cache`] need not build it.
    pub fn has_placement_cache(&self, rig: &PreparedRig) -> bool {
        self.placements.has(rig)
    }
}

impl Deref for PreparedObject {
    type Target = GraspObject;

    fn deref(&self) -> &GraspObject {
        &self.object
    }
}
