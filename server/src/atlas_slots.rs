//! Atlas slots: one object's atlases, one slot per hand.

use std::{
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::Duration,
};

use grasp_assets::hands::Hand;
use grasp_synthesis::known::{atlas::Atlas, growth::Grown};

use crate::demand::Demand;

/// How far the building of an atlas has got.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum BuildState {
    /// Never requested, or dropped from memory.
    #[default]
    Absent,
    /// In the build queue, or being built.
    Growing,
    /// Complete.
    Finished,
    /// Nothing is added, because others that are asked for more take all the memory.
    NoRoom,
    /// Nothing is added, because building it panicked.
    Failed,
}

/// One hand's atlas.
#[derive(Clone, Debug, Default)]
pub(crate) struct Slot {
    /// State of the build.
    pub state: BuildState,
    /// The grips that requests are answered from, and from which growth resumes.
    pub grown: Option<Arc<Grown>>,
    /// Grips that searches found and that `grown` lacks.
    pub learned: Arc<Atlas>,
    /// Size of both in bytes.
    pub bytes: usize,
    /// How long this process has worked on the atlas.
    pub build_time: Duration,
    /// How much it is asked for.
    pub demand: Demand,
}

impl Slot {
    /// True if nothing more is added. Complete grips are published a moment before their build has ended.
    pub(crate) fn is_complete(&self) -> bool {
        self.state == BuildState::Finished
            || self.grown.as_ref().is_some_and(|grown| grown.atlas.is_complete())
    }
}

/// Largest number of slots of an object. Hands come in as many sizes and shapes as clients create; more in turn than this
/// lose their atlases to one another.
const MAX_HANDS: usize = 16;

/// The slots of one object, for each hand that was requested; beyond [`MAX_HANDS`], the one asked for least is dropped.
#[derive(Debug, Default)]
pub(crate) struct AtlasSlots(Mutex<Vec<(Arc<Hand>, Slot)>>);

impl AtlasSlots {
    /// A copy of a hand's slot; none if the hand was never requested.
    pub(crate) fn get(&self, hand: &Arc<Hand>) -> Option<Slot> {
        let slots = self.lock();
        let slot = slots.iter().find(|(other, _)| other == hand);
        slot.map(|(_, slot)| slot.clone())
    }

    /// How much a hand's atlas is asked for; none if the hand was never requested.
    pub(crate) fn demand(&self, hand: &Arc<Hand>) -> Option<Demand> {
        self.demand_and_bytes(hand).map(|(demand, _)| demand)
    }

    /// How much a hand's atlas is asked for, and its size in bytes; none if the hand was never requested.
    pub(crate) fn demand_and_bytes(&self, hand: &Arc<Hand>) -> Option<(Demand, usize)> {
        let slots = self.lock();
        let slot = slots.iter().find(|(other, _)| other == hand);
        slot.map(|(_, slot)| (slot.demand, slot.bytes))
    }

    /// Records a call at a time since the server's start. True if the atlas must be put in the build queue.
    pub(crate) fn request(&self, hand: &Arc<Hand>, at: Duration) -> bool {
        let mut slots = self.lock();
        if slots.len() >= MAX_HANDS && slots.iter().all(|(other, _)| other != hand) {
            let least = slots
                .iter()
                .enumerate()
                .min_by(|(_, (_, a)), (_, (_, b))| a.demand.cmp(b.demand));
            if let Some((place, _)) = least {
                slots.swap_remove(place);
            }
        }
        drop(slots);
        self.with(hand, |slot| {
            slot.demand = slot.demand.with_call(at);
            let is_needed = matches!(slot.state, BuildState::Absent | BuildState::NoRoom);
            if is_needed {
                slot.state = BuildState::Growing;
            }
            is_needed
        })
    }

    /// Replaces the atlas; `spent` is the work done on it since the last time.
    pub(crate) fn publish(&self, hand: &Arc<Hand>, grown: Arc<Grown>, spent: Duration) {
        self.with(hand, |slot| {
            slot.bytes = grown.bytes() + slot.learned.bytes();
            slot.grown = Some(grown);
            slot.build_time += spent;
        });
    }

    /// Replaces the learned grips.
    pub(crate) fn learn(&self, hand: &Arc<Hand>, learned: Arc<Atlas>) {
        self.with(hand, |slot| {
            slot.bytes = learned.bytes() + slot.grown.as_ref().map_or(0, |grown| grown.bytes());
            slot.learned = learned;
        });
    }

    /// Copies of all slots with their hands.
    pub(crate) fn all(&self) -> Vec<(Arc<Hand>, Slot)> {
        self.lock().clone()
    }

    /// Fills a hand's slot with that of another object of the same grips. Growth of that object's atlas ends with the object, so
    /// what is not complete is absent here until it is requested.
    pub(crate) fn take_over(&self, hand: &Arc<Hand>, slot: Slot) {
        self.with(hand, |own| {
            *own = Slot {
                state: match slot.state {
                    BuildState::Growing => BuildState::Absent,
                    state => state,
                },
                ..slot
            };
        });
    }

    /// Ends the growth of an atlas.
    pub(crate) fn end(&self, hand: &Arc<Hand>, state: BuildState) {
        self.with(hand, |slot| slot.state = state);
    }

    /// Drops the atlas and what was learned. One in the build queue stays there.
    pub(crate) fn evict(&self, hand: &Arc<Hand>) {
        self.with(hand, |slot| {
            *slot = Slot {
                state: match slot.state {
                    BuildState::Growing => BuildState::Growing,
                    _ => BuildState::Absent,
                },
                demand: slot.demand,
                build_time: slot.build_time,
                ..Slot::default()
            };
        });
    }

    fn with<T>(&self, hand: &Arc<Hand>, change: impl FnOnce(&mut Slot) -> T) -> T {
        let mut slots = self.lock();
        let place = slots.iter().position(|(other, _)| other == hand);
        let place = place.unwrap_or_else(|| {
            slots.push((Arc::clone(hand), Slot::default()));
            slots.len() - 1
        });
        change(&mut slots[place].1)
    }

    fn lock(&self) -> MutexGuard<'_, Vec<(Arc<Hand>, Slot)>> {
        // No code panics while it holds the lock; if some did, the slots would still be consistent.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use grasp_assets::hands::hand;
    use grasp_synthesis::{model::hand::Handedness, propose::prepared::PreparedRig};

    use super::*;

    #[test]
    fn drops_the_hand_asked_for_least() {
        let adult = hand("adult", Handedness::Right).expect("the rig is built in");
        let hands: Vec<Arc<Hand>> = (0..=MAX_HANDS)
            .map(|size| {
                Arc::new(Hand {
                    rig: PreparedRig::new(adult.rig.scaled(1.0 + 0.01 * size as f32)),
                    skin: Arc::clone(&adult.skin),
                })
            })
            .collect();
        let slots = AtlasSlots::default();
        for (now, hand) in hands[..MAX_HANDS].iter().enumerate() {
            assert!(slots.request(hand, Duration::from_secs(now as u64)));
        }
        assert!(!slots.request(&hands[0], Duration::from_secs(100)));
        assert!(slots.request(&hands[MAX_HANDS], Duration::from_secs(101)));
        let is_there = |place: usize| slots.get(&hands[place]).is_some();
        assert!(is_there(0) && !is_there(1) && is_there(2) && is_there(MAX_HANDS));
        // The identity of a hand is its content.
        let twin = Arc::new(Hand::clone(&hands[2]));
        assert!(slots.get(&twin).is_some());
    }
}
