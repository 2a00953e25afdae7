//! The rigs that hands can have: built-in ones, and those that clients created.

pub(crate) mod store;

use std::{collections::VecDeque, sync::Arc};

use grasp_assets::hands::Hand;
use grasp_import::Binding;
use grasp_synthesis::{
    model::hand::{Handedness, rig::Rig},
    propose::prepared::PreparedRig,
};

use crate::{
    access::Owner,
    sync::{Mutex, locked},
};

/// Prefix of every rig's name.
pub(crate) const COLLECTION: &str = "rigs/";

/// A hand of a rig as searches and answers use it.
#[derive(Clone, Debug)]
pub(crate) struct RigHand {
    /// Rig and skin.
    pub hand: Arc<Hand>,
    /// The model's nodes that follow the rig; `None` without a model.
    pub binding: Option<Arc<Binding>>,
    /// How much larger the hand is than the rig's and the model's.
    pub scale: f32,
}

impl RigHand {
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
    pub owner: Owner,
    /// Left and right hand.
    pub hands: [RigHand; 2],
    /// True for the hand that is the other one's mirror image.
    pub mirrored: [bool; 2],
    /// Repairs of the model.
    pub warnings: Vec<String>,
}

impl StoredRig {
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

/// Largest number of kept hands: some six megabytes. A game has few sizes; with more in turn, each call derives a hand's
/// oppositions again, which takes tenths of a second.
const CAPACITY: usize = 16;

/// A scaled hand, with its original and the hundredths of its scale.
#[derive(Debug)]
struct ScaledHand {
    of: Arc<Hand>,
    hundredths: u16,
    hand: Arc<Hand>,
}

/// The hands that were requested last, the oldest first.
#[derive(Debug, Default)]
struct ScaledHands(Mutex<VecDeque<ScaledHand>>);

impl ScaledHands {
    /// A hand of another size.
    fn get(&self, hand: &RigHand, hundredths: u16) -> RigHand {
        let scale = f32::from(hundredths) / 100.0;
        let mut kept = locked(&self.0);
        let place = kept.iter().position(|scaled| {
            // Equal rigs may have different names, and answers name the rig.
            scaled.hundredths == hundredths
                && scaled.of == hand.hand
                && scaled.of.rig.name == hand.hand.rig.name
        });
        let entry = place.and_then(|place| kept.remove(place)).unwrap_or_else(|| {
            let scaled = Hand {
                rig: PreparedRig::new(hand.hand.rig.scaled(scale)),
                skin: Arc::clone(&hand.hand.skin),
            };
            ScaledHand {
                of: Arc::clone(&hand.hand),
                hundredths,
                hand: Arc::new(scaled),
            }
        });
        let scaled = Arc::clone(&entry.hand);
        if kept.len() == CAPACITY {
            kept.pop_front();
        }
        kept.push_back(entry);
        RigHand {
            hand: scaled,
            binding: hand.binding.clone(),
            scale: hand.scale * scale,
        }
    }
}

#[cfg(test)]
mod tests {
    use grasp_assets::hands::hand;

    use super::*;

    #[test]
    fn keeps_the_hands_requested_last() {
        let hands = ScaledHands::default();
        let adult = RigHand::without_model(hand("adult", Handedness::Right).expect("it is built in"));
        let first = hands.get(&adult, 80).hand;
        assert!((first.rig.reach / adult.hand.rig.reach - 0.8).abs() < 1e-6);
        for hundredths in 101..101 + CAPACITY as u16 - 1 {
            hands.get(&adult, hundredths);
            assert!(Arc::ptr_eq(&hands.get(&adult, 80).hand, &first));
        }
        for hundredths in 150..150 + CAPACITY as u16 {
            hands.get(&adult, hundredths);
        }
        assert!(!Arc::ptr_eq(&hands.get(&adult, 80).hand, &first));
    }
}
