//! Grips that searches found lately: an object that is held out a moment later, or a little otherwise, is mostly held by
//! one of them.
//!
//! A search runs only where no known grip is left by the giver, or none is known yet. Who asks again while the giver's hand
//! moves would wait for another one each time. What the first one found is kept beside the atlas, not in it, so that the
//! atlas stays the same for the same object and hand.

use std::sync::Arc;

use super::entry::Entry;

/// Grips that are kept. They are tried one by one, in some microseconds each, where nothing else is left: more serve more
/// places to which the giver may return, and keep searches waiting.
const KEPT: usize = 32;

/// Grips, the one that was found last first.
#[derive(Clone, Debug, Default)]
pub struct RecentGrips(Arc<[Arc<Entry>]>);

impl RecentGrips {
    /// These and a newer one; where there are too many, without the oldest. The same hand is kept once: reproducible requests
    /// find it again and again.
    #[must_use]
    pub fn with(&self, newest: Entry) -> Self {
        let others = self.0.iter().filter(|entry| entry.grip.pose != newest.grip.pose);
        let older: Vec<_> = others.take(KEPT - 1).cloned().collect();
        Self(std::iter::once(Arc::new(newest)).chain(older).collect())
    }

    /// These without the oldest.
    #[must_use]
    pub fn without_oldest(&self) -> Self {
        let count = self.0.len().saturating_sub(1);
        Self(self.0[..count].into())
    }

    /// The grips, the newest first.
    pub fn entries(&self) -> &[Arc<Entry>] {
        &self.0
    }

    /// True if there is none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}
