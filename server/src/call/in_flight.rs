//! The number of calls in flight.

use std::sync::{
    Arc,
    atomic::{AtomicUsize, Ordering},
};

use tokio::sync::Notify;

/// Counts the calls in flight.
#[derive(Clone, Debug, Default)]
pub(crate) struct CallsInFlight(Arc<Counter>);

#[derive(Debug, Default)]
struct Counter {
    count: AtomicUsize,
    reached_zero: Notify,
}

impl CallsInFlight {
    /// Number of calls.
    pub(crate) fn count(&self) -> usize {
        self.0.count.load(Ordering::Acquire)
    }

    /// Waits until there are none.
    pub(crate) async fn none(&self) {
        loop {
            let reached_zero = self.0.reached_zero.notified();
            if self.count() == 0 {
                return;
            }
            reached_zero.await;
        }
    }

    /// Counts a call until the returned guard is dropped.
    pub(super) fn enter(&self) -> InFlight {
        self.0.count.fetch_add(1, Ordering::AcqRel);
        InFlight(Arc::clone(&self.0))
    }
}

/// A counted call.
#[derive(Debug)]
pub(super) struct InFlight(Arc<Counter>);

impl Drop for InFlight {
    fn drop(&mut self) {
        if self.0.count.fetch_sub(1, Ordering::AcqRel) == 1 {
            self.0.reached_zero.notify_waiters();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn waits_until_all_calls_have_ended() {
        let calls = CallsInFlight::default();
        calls.none().await;
        let (first, second) = (calls.enter(), calls.enter());
        drop(first);
        let waiting = tokio::spawn({
            let calls = calls.clone();
            async move { calls.none().await }
        });
        tokio::task::yield_now().await;
        assert!(!waiting.is_finished());
        drop(second);
        waiting.await.unwrap();
    }
}
