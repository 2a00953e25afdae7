//! Grips of an object as starts for searches on the same object at another size or of another mass.

use std::sync::Arc;

use super::{atlas::Atlas, entry::Entry, farthest::farthest, grips::Grips};
use crate::{
    model::{hand::rig::Rig, requirements::Requirements},
    physical::barriers::Barriers,
};

/// An atlas of an object that is held out at another size. Its grips are known to hold the object as it was: searches use them
/// as seeds.
#[derive(Clone, Debug)]
pub struct ResizedGrips {
    atlas: Arc<Atlas>,
    scale: f32,
}

impl ResizedGrips {
    /// Grips for an object that is `scale` times as large as that of the atlas.
    pub fn new(atlas: Arc<Atlas>, scale: f32) -> Self {
        Self { atlas, scale }
    }

    /// The atlas of the object at its original size.
    pub fn atlas(&self) -> &Arc<Atlas> {
        &self.atlas
    }

    /// The grips of some entries of the atlas that meet the requirements and are farthest from the barriers, on the object at
    /// its new size; the first entries win ties. `rig` is the hand that the grips were made for. None if interrupted.
    pub fn away_from(
        &self,
        entries: impl Iterator<Item = u16>,
        rig: &Rig,
        barriers: Barriers<'_>,
        requirements: &Requirements,
        interrupted: &impl Fn() -> bool,
    ) -> Option<Grips> {
        let entry = |index: u16| &self.atlas.entries()[usize::from(index)];
        let clearance = |index: u16| {
            let way = entry(index).way_on_resized(self.scale);
            let grips = self.atlas.grips();
            grips.moved_clearance_upper_bound(usize::from(index), way, barriers)
        };
        let resized = |index: u16| -> Entry { entry(index).on_resized(self.scale) };
        let entries = farthest(entries, clearance, resized, (barriers, requirements), interrupted)?;
        Some(Grips::new(rig, entries))
    }
}
