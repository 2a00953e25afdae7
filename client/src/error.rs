//! Errors of calls, with the standard details that the server attached.

use std::fmt;

use grasp_proto::code_name;
use tonic::{Code, Status};
use tonic_types::{ErrorDetails, FieldViolation, StatusExt as _};

/// An error of a lower layer.
pub type BoxError = Box<dyn std::error::Error + Send + Sync>;

/// Why a call or a connection failed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ClientError {
    /// The endpoint is not a URL, or cannot be used with the given certificates.
    #[error("endpoint {endpoint:?} is not a URL like http://[::1]:50051")]
    Endpoint {
        /// The endpoint as given.
        endpoint: String,
        /// Why it is invalid.
        source: BoxError,
    },
    /// The token has characters that no header can have.
    #[error("the token has characters other than those of printable ASCII")]
    Token,
    /// The connection failed.
    #[error("cannot connect to {endpoint}")]
    Connect {
        /// The endpoint as given.
        endpoint: String,
        /// The cause.
        source: BoxError,
    },
    /// The call failed, even after retries; its code says how.
    #[error("{0}")]
    Call(Box<CallError>),
    /// The answer violates the contract; it may come from another service or a newer server.
    #[error("malformed answer: {0}")]
    Malformed(&'static str),
}

/// A call that failed.
#[derive(Clone, Debug)]
pub struct CallError {
    /// The gRPC status code.
    pub code: Code,
    /// The server's message, or the transport's.
    pub message: String,
    /// Number of attempts.
    pub attempts: u32,
    /// Details that the server attached. Undecodable ones count as absent: the message still names the error.
    pub details: ErrorDetails,
}

impl CallError {
    /// Everything wrong with the request.
    pub fn violations(&self) -> &[FieldViolation] {
        let request = self.details.bad_request();
        request.map_or(&[], |request| &request.field_violations)
    }
}

impl fmt::Display for CallError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", code_name(self.code), self.message)?;
        for violation in self.violations() {
            write!(f, "; {}: {}", violation.field, violation.description)?;
        }
        if self.attempts > 1 {
            write!(f, " (tried {} times)", self.attempts)?;
        }
        Ok(())
    }
}

impl ClientError {
    /// The failed call, if the error came from one.
    pub fn call(&self) -> Option<&CallError> {
        match self {
            Self::Call(call) => Some(call),
            _ => None,
        }
    }

    /// The code of the failed call, if the error came from one.
    pub fn code(&self) -> Option<Code> {
        self.call().map(|call| call.code)
    }

    /// The error of a call whose last attempt, number `attempts`, ended with `status`.
    pub(crate) fn from_status(status: &Status, attempts: u32) -> Self {
        Self::Call(Box::new(CallError {
            code: status.code(),
            message: status.message().to_owned(),
            attempts,
            details: status.get_error_details(),
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_details_of_a_status_are_decoded_and_others_leave_the_message() {
        let mut details = ErrorDetails::with_bad_request_violation("budget", "is -1 s");
        details.add_bad_request_violation("object", "is empty");
        let status = Status::with_error_details(Code::InvalidArgument, "2 fields are wrong", details);
        let error = ClientError::from_status(&status, 1);
        let expected = "INVALID_ARGUMENT: 2 fields are wrong; budget: is -1 s; object: is empty";
        assert_eq!(error.to_string(), expected);
        let broken = tonic::codegen::Bytes::from_static(b"\xff\xff\xff");
        let error = ClientError::from_status(&Status::with_details(Code::Internal, "it broke", broken), 3);
        assert_eq!(error.to_string(), "INTERNAL: it broke (tried 3 times)");
        assert_eq!(error.code(), Some(Code::Internal));
    }
}
