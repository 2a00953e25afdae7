//! Rigs and objects with what proposals derive from them once.

use std::{
    ops::Deref,
    sync::{Arc, OnceLock},
};

use super::{
    opposition::Oppositions,
    placement_cache::{PlacementCache, PlacementCaches},
    surface_pairs::SurfacePairs,
};
use crate::{
    base::mechanisms::Mechanisms,
    model::{hand::rig::Rig, object::GraspObject},
};

/// A rig with how its digits can oppose each other, derived on first use. Copies share both.
#[derive(Clone, Debug)]
pub struct PreparedRig(Arc<RigParts>);

#[derive(Debug)]
struct RigParts {
    rig: Rig,
    oppositions: OnceLock<Oppositions>,
}

impl PreparedRig {
    /// A rig whose oppositions are derived when they are first used.
    pub fn new(rig: Rig) -> Self {
        Self(Arc::new(RigParts {
            rig,
            oppositions: OnceLock::new(),
        }))
    }

    /// How thumb and fingers can oppose each other. The first call takes 0.1 to 0.2 s.
    pub fn oppositions(&self) -> &Oppositions {
        self.0.oppositions.get_or_init(|| Oppositions::of(&self.0.rig))
    }

    /// True once the oppositions are derived: from then on they take no time.
    pub fn is_derived(&self) -> bool {
        self.0.oppositions.get().is_some()
    }

    /// True if both are copies of one.
    pub(super) fn is_same(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

impl Deref for PreparedRig {
    type Target = Rig;

    fn deref(&self) -> &Rig {
        &self.0.rig
    }
}

/// An object with the points where hands may press, and the placements that have room, per hand.
#[derive(Debug)]
pub struct PreparedObject {
    object: Arc<GraspObject>,
    surface_pairs: SurfacePairs,
    placements: PlacementCaches,
}

impl PreparedObject {
    /// Samples the object's surface for opposed points: some milliseconds.
    pub fn new(object: Arc<GraspObject>) -> Self {
        let surface_pairs = SurfacePairs::of(&object.surface, |triangle| object.is_forbidden(triangle));
        Self {
            object,
            surface_pairs,
            placements: PlacementCaches::default(),
        }
    }

    /// The object itself.
    pub fn object(&self) -> &Arc<GraspObject> {
        &self.object
    }

    /// Where opposed digits and the palm may press.
    pub fn surface_pairs(&self) -> &SurfacePairs {
        &self.surface_pairs
    }

    /// Where a hand has room at the object and is likely to hold it, whoever presents it. The first call for a hand takes
    /// some five milliseconds.
    pub fn placement_cache(&self, rig: &PreparedRig) -> Arc<PlacementCache> {
        self.placement_cache_with(Mechanisms::ALL, rig)
    }

    /// The same by some of the mechanisms.
    pub fn placement_cache_with(&self, mechanisms: Mechanisms, rig: &PreparedRig) -> Arc<PlacementCache> {
        self.placements.of(self, rig, mechanisms)
    }
}

impl Deref for PreparedObject {
    type Target = GraspObject;

    fn deref(&self) -> &GraspObject {
        &self.object
    }
}
