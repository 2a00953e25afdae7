//! The atlases of one object.

use std::{
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::Duration,
};

use grasp_assets::hands::Hand;
use grasp_synthesis::known::{entry::Entry, growth::Grown, recent_grips::RecentGrips};

/// What is being done about an atlas.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Standing {
    /// Nothing: nobody asked for it, or it gave way.
    #[default]
    Absent,
    /// It waits to be built, or is being built.
    Growing,
    /// It does not grow any more.
    Finished,
}

/// An atlas, as far as it is known.
#[derive(Clone, Debug, Default)]
pub(crate) struct Slot {
    /// What is being done about it.
    pub standing: Standing,
    /// What has been found.
    pub grown: Option<Arc<Grown>>,
    /// What searches found lately.
    pub recent: RecentGrips,
    /// Bytes that it takes.
    pub bytes: usize,
    /// How long this process has worked on it.
    pub build_time: Duration,
    /// When it was asked for last, in uses of all atlases.
    pub last_used: u64,
}

/// The atlases of an object: one for each hand that was asked for.
#[derive(Debug, Default)]
pub(crate) struct Shelf(Mutex<Vec<(&'static Hand, Slot)>>);

impl Shelf {
    /// What is known of a hand's atlas; none if nobody asked for it yet.
    pub(crate) fn slot(&self, hand: &'static Hand) -> Option<Slot> {
        let slots = self.lock();
        let slot = slots.iter().find(|(other, _)| std::ptr::eq(*other, hand));
        slot.map(|(_, slot)| slot.clone())
    }

    /// Notes that an atlas is used now. True if it is to be built and nobody was told so yet.
    pub(super) fn ask(&self, hand: &'static Hand, now: u64) -> bool {
        self.with(hand, |slot| {
            slot.last_used = now;
            let is_new = slot.standing == Standing::Absent;
            if is_new {
                slot.standing = Standing::Growing;
            }
            is_new
        })
    }

    /// Puts what has grown into its place. `spent` is how long it took since the last time.
    pub(super) fn put(&self, hand: &'static Hand, grown: Arc<Grown>, bytes: usize, spent: Duration) {
        self.with(hand, |slot| {
            slot.grown = Some(grown);
            slot.bytes = bytes;
            slot.build_time += spent;
        });
    }

    /// Notes that an atlas does not grow any more.
    pub(super) fn finish(&self, hand: &'static Hand) {
        self.with(hand, |slot| slot.standing = Standing::Finished);
    }

    /// Keeps a grip that a search found. True if one more is kept now than before: not if it was kept already, nor if another
    /// went for it.
    pub(super) fn remember(&self, hand: &'static Hand, grip: Entry) -> bool {
        self.with(hand, |slot| {
            let before = slot.recent.entries().len();
            slot.recent = slot.recent.with(grip);
            slot.recent.entries().len() > before
        })
    }

    /// Forgets the grip that is kept for longest.
    pub(super) fn forget_oldest(&self, hand: &'static Hand) {
        self.with(hand, |slot| slot.recent = slot.recent.without_oldest());
    }

    /// Takes an atlas away. One that waits to grow still waits.
    pub(super) fn drop_grown(&self, hand: &'static Hand) {
        self.with(hand, |slot| {
            *slot = Slot {
                standing: match slot.standing {
                    Standing::Growing => Standing::Growing,
                    Standing::Absent | Standing::Finished => Standing::Absent,
                },
                last_used: slot.last_used,
                recent: std::mem::take(&mut slot.recent),
                ..Slot::default()
            };
        });
    }

    fn with<T>(&self, hand: &'static Hand, change: impl FnOnce(&mut Slot) -> T) -> T {
        let mut slots = self.lock();
        let place = slots.iter().position(|(other, _)| std::ptr::eq(*other, hand));
        let place = place.unwrap_or_else(|| {
            slots.push((hand, Slot::default()));
            slots.len() - 1
        });
        change(&mut slots[place].1)
    }

    fn lock(&self) -> MutexGuard<'_, Vec<(&'static Hand, Slot)>> {
        // No code panics while it holds the lock; were it to, the slots would still be whole.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
