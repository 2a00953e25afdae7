//! Atlas slots: one object's atlases, one slot per hand, and the demand for each.

use std::{sync::Arc, time::Duration};

use grasp_assets::hands::Hand;
use grasp_synthesis::known::{atlas::Atlas, growth::Grown};

use crate::sync::{Mutex, locked};

/// Time after which a call counts half.
const HALF_LIFE: Duration = Duration::from_mins(5);

/// A decayed count of calls, as the binary logarithm of a count in which later calls weigh more instead of earlier ones less: all
/// counts decay alike, so that comparing them needs no clock.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub(crate) struct Demand(f64);

impl Default for Demand {
    fn default() -> Self {
        Self::NONE
    }
}

impl Demand {
    /// Never requested.
    pub(crate) const NONE: Self = Self(f64::NEG_INFINITY);

    /// One call more, at a time since the clock's start.
    #[must_use]
    pub(crate) fn with_call(self, at: Duration) -> Self {
        let call = at.as_secs_f64() / HALF_LIFE.as_secs_f64();
        let (more, less) = (self.0.max(call), self.0.min(call));
        Self(more + (less - more).exp2().ln_1p() / std::f64::consts::LN_2)
    }

    /// A share of the calls, more than 0.
    #[must_use]
    pub(crate) fn share(self, of_calls: f64) -> Self {
        Self(self.0 + of_calls.log2())
    }

    /// Orders demands, none first.
    pub(crate) fn cmp(self, other: Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0)
    }
}

/// How far the building of an atlas has got.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum BuildState {
    /// Never requested, or dropped from memory.
    #[default]
    Absent,
    /// In the build queue, or being built.
    Growing,
    Finished,
    /// Nothing is added, because others in more demand take all the memory.
    NoRoom,
    /// Nothing is added, because building it panicked.
    Failed,
}

/// One hand's atlas.
#[derive(Clone, Debug, Default)]
pub(crate) struct Slot {
    pub state: BuildState,
    /// The grips that requests are answered from, and from which growth resumes.
    pub grown: Option<Arc<Grown>>,
    /// Grips that searches found and that `grown` lacks.
    pub learned: Arc<Atlas>,
    /// How long this process has worked on the atlas.
    pub build_time: Duration,
    pub demand: Demand,
}

impl Slot {
    /// Size of its grips in bytes.
    pub(crate) fn bytes(&self) -> usize {
        self.grown.as_ref().map_or(0, |grown| grown.bytes()) + self.learned.bytes()
    }

    /// Number of its grips that requests are answered from.
    pub(crate) fn entries(&self) -> usize {
        self.grown.as_ref().map_or(0, |grown| grown.atlas.entries().len())
    }

    /// True if nothing more is added. Complete grips are published a moment before their build has ended.
    pub(crate) fn is_complete(&self) -> bool {
        self.state == BuildState::Finished
            || self.grown.as_ref().is_some_and(|grown| grown.atlas.is_complete())
    }
}

/// Largest number of slots of an object: hands come in as many sizes and shapes as clients create.
const MAX_HANDS: usize = 16;

/// The slots of one object, for each hand that was requested; beyond [`MAX_HANDS`], the one in least demand is dropped.
#[derive(Debug, Default)]
pub(crate) struct AtlasSlots(Mutex<Vec<(Arc<Hand>, Slot)>>);

impl AtlasSlots {
    /// A copy of a hand's slot. `None` if the hand was never requested.
    pub(crate) fn get(&self, hand: &Arc<Hand>) -> Option<Slot> {
        let slots = locked(&self.0);
        let slot = slots.iter().find(|(other, _)| other == hand);
        slot.map(|(_, slot)| slot.clone())
    }

    /// The demand for a hand's atlas. `None` if the hand was never requested.
    pub(crate) fn demand(&self, hand: &Arc<Hand>) -> Option<Demand> {
        self.get(hand).map(|slot| slot.demand)
    }

    /// Records a call at a time since the server's start. True if the atlas must be put in the build queue.
    pub(crate) fn request(&self, hand: &Arc<Hand>, at: Duration) -> bool {
        let mut slots = locked(&self.0);
        let place = slots.iter().position(|(other, _)| other == hand);
        let place = place.unwrap_or_else(|| {
            if slots.len() >= MAX_HANDS {
                let demand = |place: &usize| slots[*place].1.demand;
                let least = (0..slots.len()).min_by(|a, b| demand(a).cmp(demand(b)));
                let _ = least.map(|place| slots.swap_remove(place));
            }
            slots.push((Arc::clone(hand), Slot::default()));
            slots.len() - 1
        });
        let slot = &mut slots[place].1;
        slot.demand = slot.demand.with_call(at);
        let is_needed = matches!(slot.state, BuildState::Absent | BuildState::NoRoom);
        if is_needed {
            slot.state = BuildState::Growing;
        }
        is_needed
    }

    /// Replaces the grips of a hand, and the time that they took.
    pub(crate) fn set_grips(&self, hand: &Arc<Hand>, changed: Slot) {
        self.change(hand, |slot| {
            slot.grown = changed.grown;
            slot.learned = changed.learned;
            slot.build_time = changed.build_time;
        });
    }

    pub(crate) fn all(&self) -> Vec<(Arc<Hand>, Slot)> {
        locked(&self.0).clone()
    }

    /// Fills the slots with those of another object of the same grips. Growth of that object's atlases ends with the object, so
    /// an incomplete atlas is absent here until it is requested.
    pub(crate) fn take_over(&self, of: &Self) {
        let mut slots = of.all();
        for (_, slot) in &mut slots {
            if slot.state == BuildState::Growing {
                slot.state = BuildState::Absent;
            }
        }
        *locked(&self.0) = slots;
    }

    /// Ends the growth of an atlas.
    pub(crate) fn end(&self, hand: &Arc<Hand>, state: BuildState) {
        self.change(hand, |slot| slot.state = state);
    }

    /// Drops the atlas and the learned grips. An atlas in the build queue stays there.
    pub(crate) fn evict(&self, hand: &Arc<Hand>) {
        self.change(hand, |slot| {
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

    /// Changes a hand's slot, unless other hands have taken its place.
    fn change(&self, hand: &Arc<Hand>, change: impl FnOnce(&mut Slot)) {
        let mut slots = locked(&self.0);
        if let Some((_, slot)) = slots.iter_mut().find(|(other, _)| other == hand) {
            change(slot);
        }
    }
}

#[cfg(test)]
mod tests {
    use grasp_assets::hands::hand;
    use grasp_synthesis::{model::hand::Handedness, propose::prepared::PreparedRig};

    use super::*;

    #[test]
    fn drops_the_hand_in_least_demand() {
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
        // The end of its growth does not bring it back.
        slots.end(&hands[1], BuildState::Finished);
        assert!(!is_there(1) && slots.all().len() == MAX_HANDS);
        // The identity of a hand is its content.
        let twin = Arc::new(Hand::clone(&hands[2]));
        assert!(slots.get(&twin).is_some());
    }

    /// The count itself, with each call halved as often as half-lives have passed by `now`.
    fn count(calls: &[Duration], now: Duration) -> f64 {
        let age = |at: &Duration| (now.as_secs_f64() - at.as_secs_f64()) / HALF_LIFE.as_secs_f64();
        calls.iter().map(|at| (-age(at)).exp2()).sum()
    }

    fn demand(calls: &[Duration]) -> Demand {
        calls.iter().fold(Demand::NONE, |sum, &at| sum.with_call(at))
    }

    #[test]
    fn orders_like_counts_that_decay() {
        let seconds =
            |calls: &[u64]| -> Vec<Duration> { calls.iter().map(|&at| Duration::from_secs(at)).collect() };
        let now = Duration::from_secs(100_000);
        let all = [
            seconds(&[0; 40]),
            seconds(&[99_990]),
            seconds(&[99_000, 99_100, 99_200]),
            seconds(&[98_000, 99_500, 99_980]),
            seconds(&[99_990, 99_991]),
        ];
        for (a, b) in all.iter().flat_map(|a| all.iter().map(move |b| (a, b))) {
            let expected = count(a, now).total_cmp(&count(b, now));
            assert_eq!(demand(a).cmp(demand(b)), expected, "{a:?} {b:?}");
        }
        let shared = demand(&all[4]).share(0.25);
        let expected = demand(&all[4][..1]).share(0.5);
        assert!((shared.0 - expected.0).abs() < 0.01, "{shared:?} {expected:?}");
        assert!(Demand::NONE < demand(&all[0]));
    }
}
