//! The rigs that hands can have: built-in ones, and those that clients created.

pub(crate) mod saved;
mod scaled;
pub(crate) mod store;

use std::sync::Arc;

use grasp_assets::hands::Hand;
use grasp_import::Binding;
use grasp_synthesis::model::hand::{Handedness, rig::Rig};

/// Prefix of every rig's name.
pub(crate) const COLLECTION: &str = "rigs/";

/// A hand of a rig as searches and answers use it.
#[derive(Clone, Debug)]
pub(crate) struct RigHand {
    /// Rig and skin.
    pub hand: Arc<Hand>,
    /// The model's nodes that follow the rig; none without a model.
    pub binding: Option<Arc<Binding>>,
    /// How much larger the hand is than the rig's and the model's.
    pub scale: f32,
}

impl RigHand {
    /// A hand without a model.
    pub(crate) fn without_model(hand: &Arc<Hand>) -> Self {
        Self {
            hand: Arc::clone(hand),
            binding: None,
            scale: 1.0,
        }
    }
}

/// A rig as the server keeps it.
#[derive(Clone, Debug)]
pub(crate) struct StoredRig {
    /// The last part of its name.
    pub id: String,
    /// True if it is part of the server.
    pub built_in: bool,
    /// Left and right hand.
    pub hands: [RigHand; 2],
    /// True for the hand that is the other one's mirror image.
    pub mirrored: [bool; 2],
    /// What was repaired.
    pub warnings: Vec<String>,
}

impl StoredRig {
    /// One of its hands.
    pub(crate) fn hand(&self, handedness: Handedness) -> &RigHand {
        match handedness {
            Handedness::Left => &self.hands[0],
            Handedness::Right => &self.hands[1],
        }
    }

    /// "rigs/{rig}".
    pub(crate) fn name(&self) -> String {
        name_of(&self.id)
    }
}

/// The resource name of an id: "rigs/{rig}".
pub(crate) fn name_of(id: &str) -> String {
    format!("{COLLECTION}{id}")
}

/// The resource name of a rig, which has its id as its name if it is built in.
pub(crate) fn resource_name(rig: &Rig) -> String {
    if rig.name.starts_with(COLLECTION) {
        rig.name.clone()
    } else {
        name_of(&rig.name)
    }
}
