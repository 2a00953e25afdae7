//! Errors of calls, with the standard details that the server attached.

use std::{collections::BTreeMap, fmt, time::Duration};

use serde::Serialize;
use tonic::{Code, Status};
use tonic_types::StatusExt as _;

/// An error of a lower layer.
pub type BoxError = Box<dyn std::error::Error + Send + Sync>;

/// Why a call or a connection failed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ClientError {
    /// The endpoint is not a URL.
    #[error("endpoint {endpoint:?} is not a URL like http://[::1]:50051")]
    Endpoint {
        /// The endpoint as given.
        endpoint: String,
        /// What is wrong with it.
        source: BoxError,
    },
    /// The connection failed.
    #[error("cannot connect to {endpoint}")]
    Connect {
        /// The endpoint as given.
        endpoint: String,
        /// The cause.
        source: BoxError,
    },
    /// The request is invalid; [`ErrorDetails::field_violations`] lists why.
    #[error("invalid argument: {0}")]
    InvalidArgument(Box<CallError>),
    /// A resource named in the request does not exist; see [`ErrorDetails::resource`].
    #[error("not found: {0}")]
    NotFound(Box<CallError>),
    /// The resource to create exists.
    #[error("already exists: {0}")]
    AlreadyExists(Box<CallError>),
    /// The resource cannot be changed like this; [`ErrorDetails::reason`] says why.
    #[error("failed precondition: {0}")]
    FailedPrecondition(Box<CallError>),
    /// The resource was changed by another call; get it, and decide again.
    #[error("aborted: {0}")]
    Aborted(Box<CallError>),
    /// The server has no capacity for the request; [`ErrorDetails::retry_delay`] may say when to retry.
    #[error("resource exhausted: {0}")]
    ResourceExhausted(Box<CallError>),
    /// The server could not be reached or takes no requests, even after retries.
    #[error("unavailable: {0}")]
    Unavailable(Box<CallError>),
    /// No answer came in time.
    #[error("deadline exceeded: {0}")]
    DeadlineExceeded(Box<CallError>),
    /// The call failed in another way; see [`CallError::code`].
    #[error("{name}: {0}", name = code_name(.0.code))]
    Other(Box<CallError>),
    /// The answer violates the contract; it may come from another service or a newer server.
    #[error("malformed answer: {field} {problem}")]
    Malformed {
        /// The field's path in the answer.
        field: String,
        /// What is wrong with it.
        problem: String,
    },
}

/// A call that failed.
#[derive(Clone, Debug, PartialEq)]
pub struct CallError {
    /// The gRPC status code.
    pub code: Code,
    /// The server's message, or the transport's.
    pub message: String,
    /// Number of attempts.
    pub attempts: u32,
    /// Details that the server attached.
    pub details: ErrorDetails,
}

impl fmt::Display for CallError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)?;
        for FieldViolation { field, description } in &self.details.field_violations {
            write!(f, "; {field}: {description}")?;
        }
        if self.attempts > 1 {
            write!(f, " (tried {} times)", self.attempts)?;
        }
        Ok(())
    }
}

/// The standard error details (`google.rpc`) that the service uses.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ErrorDetails {
    /// Stable identifier of the cause, in `UPPER_SNAKE_CASE` (`ErrorInfo.reason`).
    pub reason: Option<String>,
    /// Facts about the cause by name (`ErrorInfo.metadata`).
    pub metadata: BTreeMap<String, String>,
    /// Everything wrong with the request (`BadRequest`).
    pub field_violations: Vec<FieldViolation>,
    /// The resource concerned (`ResourceInfo`).
    pub resource: Option<Resource>,
    /// Time to wait before a retry (`RetryInfo`).
    pub retry_delay: Option<Duration>,
}

/// One violation in a request.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct FieldViolation {
    /// The field's path in the request.
    pub field: String,
    /// What is wrong with its value, and what would be right.
    pub description: String,
}

/// The resource that an error concerns.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Resource {
    /// Type of the resource.
    #[serde(rename = "type")]
    pub kind: String,
    /// Its name.
    pub name: String,
    /// What is wrong with it.
    pub description: String,
}

impl ClientError {
    /// The failed call, if the error came from one.
    pub fn call(&self) -> Option<&CallError> {
        match self {
            Self::InvalidArgument(call)
            | Self::NotFound(call)
            | Self::AlreadyExists(call)
            | Self::FailedPrecondition(call)
            | Self::Aborted(call)
            | Self::ResourceExhausted(call)
            | Self::Unavailable(call)
            | Self::DeadlineExceeded(call)
            | Self::Other(call) => Some(call),
            Self::Endpoint { .. } | Self::Connect { .. } | Self::Malformed { .. } => None,
        }
    }

    /// The error of an answer's field.
    pub(crate) fn malformed(field: &str, problem: &str) -> Self {
        Self::Malformed {
            field: field.to_owned(),
            problem: problem.to_owned(),
        }
    }

    /// The error of a call whose last attempt, number `attempts`, ended with `status`.
    pub(crate) fn from_status(status: &Status, attempts: u32) -> Self {
        let call = Box::new(CallError {
            code: status.code(),
            message: status.message().to_owned(),
            attempts,
            details: decode_details(status),
        });
        match call.code {
            Code::InvalidArgument => Self::InvalidArgument(call),
            Code::NotFound => Self::NotFound(call),
            Code::AlreadyExists => Self::AlreadyExists(call),
            Code::FailedPrecondition => Self::FailedPrecondition(call),
            Code::Aborted => Self::Aborted(call),
            Code::ResourceExhausted => Self::ResourceExhausted(call),
            Code::Unavailable => Self::Unavailable(call),
            Code::DeadlineExceeded => Self::DeadlineExceeded(call),
            _ => Self::Other(call),
        }
    }
}

/// The details of a status. Undecodable details count as absent: the message still says what is wrong.
fn decode_details(status: &Status) -> ErrorDetails {
    let details = status.get_error_details();
    let violations = details.bad_request().map(|bad| bad.field_violations.as_slice());
    ErrorDetails {
        reason: details.error_info().map(|info| info.reason.clone()),
        metadata: details
            .error_info()
            .map(|info| info.metadata.clone().into_iter().collect())
            .unwrap_or_default(),
        field_violations: violations
            .unwrap_or_default()
            .iter()
            .map(|violation| FieldViolation {
                field: violation.field.clone(),
                description: violation.description.clone(),
            })
            .collect(),
        resource: details.resource_info().map(|info| Resource {
            kind: info.resource_type.clone(),
            name: info.resource_name.clone(),
            description: info.description.clone(),
        }),
        retry_delay: details.retry_info().and_then(|info| info.retry_delay),
    }
}

/// The name of a code as the gRPC specification writes it, such as `INVALID_ARGUMENT`.
pub fn code_name(code: Code) -> &'static str {
    match code {
        Code::Ok => "OK",
        Code::Cancelled => "CANCELLED",
        Code::Unknown => "UNKNOWN",
        Code::InvalidArgument => "INVALID_ARGUMENT",
        Code::DeadlineExceeded => "DEADLINE_EXCEEDED",
        Code::NotFound => "NOT_FOUND",
        Code::AlreadyExists => "ALREADY_EXISTS",
        Code::PermissionDenied => "PERMISSION_DENIED",
        Code::ResourceExhausted => "RESOURCE_EXHAUSTED",
        Code::FailedPrecondition => "FAILED_PRECONDITION",
        Code::Aborted => "ABORTED",
        Code::OutOfRange => "OUT_OF_RANGE",
        Code::Unimplemented => "UNIMPLEMENTED",
        Code::Internal => "INTERNAL",
        Code::Unavailable => "UNAVAILABLE",
        Code::DataLoss => "DATA_LOSS",
        Code::Unauthenticated => "UNAUTHENTICATED",
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;

    use super::*;

    #[test]
    fn the_details_of_a_status_are_decoded() {
        let mut details = tonic_types::ErrorDetails::with_bad_request_violation("budget", "is -1 s");
        details.add_bad_request_violation("object", "is empty");
        let metadata = HashMap::from([("limit".to_owned(), "10".to_owned())]);
        details.set_error_info("INVALID_REQUEST", "grasp", metadata);
        details.set_resource_info("grasp/GraspObject", "objects/anvil", "", "no such");
        details.set_retry_info(Some(Duration::from_millis(250)));
        let status = Status::with_error_details(Code::InvalidArgument, "2 fields are wrong", details);
        let error = ClientError::from_status(&status, 1);
        assert_eq!(
            error.to_string(),
            "invalid argument: 2 fields are wrong; budget: is -1 s; object: is empty"
        );
        let ClientError::InvalidArgument(call) = error else {
            panic!("{error:?}")
        };
        let details = call.details;
        assert_eq!(details.reason.as_deref(), Some("INVALID_REQUEST"));
        assert_eq!(details.metadata["limit"], "10");
        assert_eq!(details.resource.unwrap().name, "objects/anvil");
        assert_eq!(details.retry_delay, Some(Duration::from_millis(250)));
    }

    #[test]
    fn every_code_with_an_error_of_its_own_has_it() {
        for number in 0..=16 {
            let code = Code::from(number);
            let error = ClientError::from_status(&Status::new(code, "no"), 1);
            let name = format!("{error:?}");
            let is_own = name.starts_with(&format!("{code:?}("));
            assert!(is_own || name.starts_with("Other("), "{name}");
            assert_eq!(error.call().unwrap().code, code);
        }
    }

    #[test]
    fn undecodable_details_leave_the_message() {
        let status = Status::with_details(
            Code::Internal,
            "it broke",
            tonic::codegen::Bytes::from_static(b"\xff\xff\xff"),
        );
        let error = ClientError::from_status(&status, 3);
        assert_eq!(error.to_string(), "INTERNAL: it broke (tried 3 times)");
        assert_eq!(error.call().unwrap().details, ErrorDetails::default());
    }
}
