//! The log line of a call, and the number of calls in flight.

use std::{
    fmt,
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    },
    time::Duration,
};

use tokio::sync::Notify;
use tonic::Code;

use super::CallContext;

/// Services whose calls are logged at level info. Probes and tools call the others.
const LOGGED_PACKAGE: &str = "/grasp.v1.";

/// Largest number of logged characters of a method's path.
const MAX_LOGGED_METHOD: usize = 96;

/// A call's log line, written when the call ends, for whatever reason.
#[derive(Debug)]
pub(super) struct LogLine {
    method: String,
    context: CallContext,
    code: Option<Code>,
    _in_flight: InFlight,
}

impl LogLine {
    /// The line of a call that has arrived.
    pub(super) fn new(path: &str, context: CallContext, in_flight: InFlight) -> Self {
        Self {
            method: path.chars().take(MAX_LOGGED_METHOD).collect(),
            context,
            code: None,
            _in_flight: in_flight,
        }
    }

    /// Records the status. A line without one is logged as cancelled.
    pub(super) fn set_code(&mut self, code: Code) {
        self.code = Some(code);
    }
}

impl Drop for LogLine {
    fn drop(&mut self) {
        let fields = &self.context.log_fields;
        let search = fields.search.get();
        let status = GrpcName(self.code.unwrap_or(Code::Cancelled));
        let total_us = micros(self.context.arrived.elapsed());
        macro_rules! log {
            ($level:ident) => {
                tracing::$level!(
                    method = %self.method,
                    object = fields.object.get(),
                    outcome = search.map(|s| s.outcome),
                    attempts = search.map(|s| s.attempts),
                    search_us = search.map(|s| micros(s.time)),
                    reserve_us = fields.reserve.get().copied().map(micros),
                    total_us,
                    %status,
                    "call"
                )
            };
        }
        if self.method.starts_with(LOGGED_PACKAGE) {
            log!(info);
        } else {
            log!(debug);
        }
    }
}

fn micros(duration: Duration) -> u64 {
    u64::try_from(duration.as_micros()).unwrap_or(u64::MAX)
}

/// A code in the spelling of gRPC: `INVALID_ARGUMENT`.
struct GrpcName(Code);

impl fmt::Display for GrpcName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (place, character) in format!("{:?}", self.0).chars().enumerate() {
            if place > 0 && character.is_ascii_uppercase() {
                f.write_str("_")?;
            }
            write!(f, "{}", character.to_ascii_uppercase())?;
        }
        Ok(())
    }
}

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

    #[test]
    fn status_codes_are_spelled_as_in_grpc() {
        assert_eq!(GrpcName(Code::InvalidArgument).to_string(), "INVALID_ARGUMENT");
        assert_eq!(GrpcName(Code::Ok).to_string(), "OK");
    }

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
