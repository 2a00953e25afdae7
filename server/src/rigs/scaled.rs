//! Hands of other sizes than their rigs'.

use std::{
    collections::VecDeque,
    sync::{Arc, Mutex, PoisonError},
};

use grasp_assets::hands::Hand;
use grasp_synthesis::propose::prepared::PreparedRig;

use super::RigHand;

/// Largest number of kept hands: some six megabytes. A game has few sizes; with more in turn, each call derives a hand's
/// oppositions again, which takes tenths of a second.
const CAPACITY: usize = 16;

/// A hand with the one and the hundredths that it was made from.
#[derive(Debug)]
struct Scaled {
    of: Arc<Hand>,
    hundredths: u16,
    hand: Arc<Hand>,
}

/// The hands that were asked for last, the oldest first.
#[derive(Debug, Default)]
pub(super) struct ScaledHands(Mutex<VecDeque<Scaled>>);

impl ScaledHands {
    /// A hand of another size.
    pub(super) fn get(&self, hand: &RigHand, hundredths: u16) -> RigHand {
        let scale = f32::from(hundredths) / 100.0;
        // No code panics while it holds the lock; if some did, the list would still be consistent.
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let place = kept.iter().position(|scaled| {
            // Equal rigs may have different names, which answers have.
            scaled.hundredths == hundredths
                && scaled.of == hand.hand
                && scaled.of.rig.name == hand.hand.rig.name
        });
        let entry = place.and_then(|place| kept.remove(place)).unwrap_or_else(|| {
            let scaled = Hand {
                rig: PreparedRig::new(hand.hand.rig.scaled(scale)),
                skin: Arc::clone(&hand.hand.skin),
            };
            Scaled {
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
    use grasp_synthesis::model::hand::Handedness;

    use super::*;

    #[test]
    fn keeps_the_hands_asked_for_last() {
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
