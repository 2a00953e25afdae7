//! The log line of a call.

use std::{fmt, time::Duration};

use tonic::Code;

use super::{CallContext, in_flight::InFlight};

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn status_codes_are_spelled_as_in_grpc() {
        assert_eq!(GrpcName(Code::InvalidArgument).to_string(), "INVALID_ARGUMENT");
        assert_eq!(GrpcName(Code::Ok).to_string(), "OK");
    }
}
