//! Grips that recent searches found. If an object is held out again a moment later, or slightly differently,
//! one of them is mostly still valid.
//!
//! A search runs only where the giver obstructs all known grips, or none is known yet. A client that asks
//! repeatedly while the giver's hand moves would wait for a search each time. The grips found are kept next
//! to the atlas, not in it, so that the atlas depends only on object and hand.

use std::sync::Arc;

use super::entry::Entry;

/// Number of grips kept. Each takes some microseconds to try after all others failed: more cover more
/// positions of the giver's hand, and delay fresh searches.
const KEPT: usize = 32;

/// Grips, the newest first.
#[derive(Clone, Debug, Default)]
pub struct RecentGrips(Arc<[Arc<Entry>]>);

impl RecentGrips {
    /// Adds a grip, dropping the oldest if there are too many. A hand that is already known moves to the
    /// front: reproducible requests find the same one repeatedly.
    #[must_use]
    pub fn with(&self, newest: Entry) -> Self {
        let others = self.0.iter().filter(|entry| entry.grip.pose != newest.grip.pose);
        let older: Vec<_> = others.take(KEPT - 1).cloned().collect();
        Self(std::iter::once(Arc::new(newest)).chain(older).collect())
    }

    /// Drops the oldest grip.
    #[must_use]
    pub fn without_oldest(&self) -> Self {
        let count = self.0.len().saturating_sub(1);
        Self(self.0[..count].into())
    }

    /// The grips, the newest first.
    pub fn entries(&self) -> &[Arc<Entry>] {
        &self.0
    }

    /// True if there are none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}
