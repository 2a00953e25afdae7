//! The gRPC status of every error.

use std::{collections::HashMap, time::Duration};

use http::Response;
use tonic::{Code, Status, metadata::MetadataValue};
use tonic_types::{ErrorDetails, StatusExt as _};

use super::{
    Limit, ServiceError,
    metadata::{MAX_MESSAGE, MAX_NAME, clipped, clipped_message, listed},
};

/// Domain of every `ErrorInfo`: the package of the contract.
const ERROR_DOMAIN: &str = "grasp.v1";

/// Trailer with the delay of a gRPC client's retry policy, in milliseconds.
const RETRY_PUSHBACK: &str = "grpc-retry-pushback-ms";

impl From<ServiceError> for Status {
    fn from(error: ServiceError) -> Self {
        let message = clipped_message(&error.to_string(), MAX_MESSAGE);
        match error {
            ServiceError::Invalid(violations) => {
                let mut details = info("INVALID_REQUEST", []);
                details.set_bad_request(listed(&violations));
                Status::with_error_details(Code::InvalidArgument, message, details)
            }
            ServiceError::Malformed(_) => plain_status(Code::InvalidArgument, "MALFORMED_MESSAGE", message),
            ServiceError::ObjectNotFound { name, evicted } => {
                let reason = if evicted {
                    "OBJECT_EVICTED"
                } else {
                    "OBJECT_NOT_FOUND"
                };
                object_status(Code::NotFound, reason, &name, message)
            }
            ServiceError::ObjectExists { name } => {
                object_status(Code::AlreadyExists, "OBJECT_EXISTS", &name, message)
            }
            ServiceError::RequestIdReused { request_id, name } => {
                let mut details = info(
                    "REQUEST_ID_REUSED",
                    [("name", name.clone()), ("request_id", request_id)],
                );
                details.add_precondition_failure_violation(
                    "REQUEST_ID",
                    clipped(&name, MAX_NAME),
                    message.clone(),
                );
                Status::with_error_details(Code::FailedPrecondition, message, details)
            }
            ServiceError::ObjectReadOnly { name } => {
                let mut details = info("OBJECT_READ_ONLY", [("name", name.clone())]);
                details.add_precondition_failure_violation(
                    "READ_ONLY",
                    clipped(&name, MAX_NAME),
                    message.clone(),
                );
                Status::with_error_details(Code::FailedPrecondition, message, details)
            }
            ServiceError::ObjectChanged { name, current, .. } => {
                let details = info("OBJECT_CHANGED", [("name", name.clone()), ("etag", current)]);
                resource_status(Code::Aborted, details, "grasp.v1.Object", &name, message)
            }
            ServiceError::RigNotFound { name } => rig_status(Code::NotFound, "RIG_NOT_FOUND", &name, message),
            ServiceError::RigExists { name } => rig_status(Code::AlreadyExists, "RIG_EXISTS", &name, message),
            ServiceError::RigBuiltIn { name } => {
                rig_status(Code::FailedPrecondition, "RIG_BUILT_IN", &name, message)
            }
            ServiceError::RigDamaged { name } => rig_status(Code::DataLoss, "RIG_DAMAGED", &name, message),
            ServiceError::RigsFull { maximum } => Status::with_error_details(
                Code::ResourceExhausted,
                message,
                info("TOO_MANY_RIGS", [("maximum", maximum.to_string())]),
            ),
            ServiceError::ObjectsFull { maximum } => Status::with_error_details(
                Code::ResourceExhausted,
                message,
                info("TOO_MANY_OBJECTS", [("maximum", maximum.to_string())]),
            ),
            ServiceError::ObjectDamaged { name } => {
                object_status(Code::DataLoss, "OBJECT_DAMAGED", &name, message)
            }
            ServiceError::ObjectUnloadable { name, .. } => {
                object_status(Code::FailedPrecondition, "OBJECT_UNLOADABLE", &name, message)
            }
            ServiceError::StoreFailed => plain_status(Code::Unavailable, "STORE_FAILED", message),
            ServiceError::Overloaded {
                limit,
                maximum,
                retry_after,
            } => overloaded_status(limit, maximum, retry_after, message),
            // As the transport answers to messages beyond its own limit.
            ServiceError::MessageTooLarge { .. } => {
                plain_status(Code::OutOfRange, "MESSAGE_TOO_LARGE", message)
            }
            ServiceError::ReaderStalled { .. } => late_status("READER_STALLED", message),
            ServiceError::UploadStalled { .. } => late_status("UPLOAD_STALLED", message),
            ServiceError::UploadTooSlow { .. } => late_status("UPLOAD_TOO_SLOW", message),
            ServiceError::TrackNotFound { name } => {
                let details = info("TRACK_NOT_FOUND", [("name", name.clone())]);
                resource_status(Code::NotFound, details, "grasp.v1.Track", &name, message)
            }
            ServiceError::TrackIdle { .. } => late_status("TRACK_IDLE", message),
            ServiceError::TookTooLong { .. } => late_status("CALL_TOOK_TOO_LONG", message),
            ServiceError::WatcherTooSlow => {
                plain_status(Code::ResourceExhausted, "WATCHER_TOO_SLOW", message)
            }
            ServiceError::ShuttingDown => plain_status(Code::Unavailable, "SHUTTING_DOWN", message),
            ServiceError::DeadlineExceeded => late_status("DEADLINE_EXCEEDED", message),
            ServiceError::Cancelled => plain_status(Code::Cancelled, "CALL_CANCELLED", message),
            ServiceError::Panicked => plain_status(Code::Internal, "JOB_PANICKED", message),
        }
    }
}

/// Replaces what the transport answers to bytes that are no message, `INTERNAL` as if the server had failed, and to messages
/// of more than `limit` bytes, packed or unpacked, which it answers without details. Every other
/// status in the headers of a response comes from a handler, and has details.
pub(crate) fn blame_client<R: Default>(response: Response<R>, limit: usize) -> Response<R> {
    let Some(status) = Status::from_header_map(response.headers()) else {
        return response;
    };
    let error = match status.code() {
        _ if !status.details().is_empty() => return response,
        Code::Internal => ServiceError::Malformed(status.message().to_owned()),
        Code::OutOfRange | Code::ResourceExhausted => ServiceError::MessageTooLarge { limit },
        _ => return response,
    };
    Status::from(error).into_http()
}

/// Details with the `ErrorInfo` that every status carries.
fn info<const N: usize>(reason: &str, metadata: [(&str, String); N]) -> ErrorDetails {
    let metadata: HashMap<String, String> = metadata
        .into_iter()
        .map(|(key, value)| (key.to_owned(), clipped(&value, MAX_NAME)))
        .collect();
    ErrorDetails::with_error_info(reason, ERROR_DOMAIN, metadata)
}

/// The status of an error that its reason and message describe.
fn plain_status(code: Code, reason: &str, message: String) -> Status {
    Status::with_error_details(code, message, info(reason, []))
}

/// The status of an error that time causes.
fn late_status(reason: &str, message: String) -> Status {
    plain_status(Code::DeadlineExceeded, reason, message)
}

/// The status of a server at a limit, with when to try again.
fn overloaded_status(limit: Limit, maximum: usize, retry_after: Duration, message: String) -> Status {
    let mut details = info(limit_reason(limit), [("maximum", maximum.to_string())]);
    details.set_retry_info(Some(retry_after));
    let mut status = Status::with_error_details(Code::ResourceExhausted, message, details);
    let pushback = MetadataValue::from(u64::try_from(retry_after.as_millis()).unwrap_or(u64::MAX));
    status.metadata_mut().insert(RETRY_PUSHBACK, pushback);
    status
}

/// The status of an error about one object.
fn object_status(code: Code, reason: &str, name: &str, message: String) -> Status {
    let details = info(reason, [("name", name.to_owned())]);
    resource_status(code, details, "grasp.v1.Object", name, message)
}

/// The status of an error about one rig.
fn rig_status(code: Code, reason: &str, name: &str, message: String) -> Status {
    let details = info(reason, [("name", name.to_owned())]);
    resource_status(code, details, "grasp.v1.Rig", name, message)
}

/// The status of an error about a resource of a type.
fn resource_status(code: Code, mut details: ErrorDetails, kind: &str, name: &str, message: String) -> Status {
    details.set_resource_info(kind, clipped(name, MAX_NAME), "", message.clone());
    Status::with_error_details(code, message, details)
}

fn limit_reason(limit: Limit) -> &'static str {
    match limit {
        Limit::Searches => "TOO_MANY_SEARCHES",
        Limit::Uploads => "TOO_MANY_UPLOADS",
        Limit::ObjectCache => "OBJECT_CACHE_FULL",
        Limit::UnreadAnswers => "TOO_MANY_UNREAD_ANSWERS",
        Limit::UploadBytes => "TOO_MANY_UPLOAD_BYTES",
        Limit::Watchers => "TOO_MANY_WATCHERS",
        Limit::Tracks => "TOO_MANY_TRACKS",
        Limit::Calls => "TOO_MANY_CALLS",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Violation;

    const SECOND: Duration = Duration::from_secs(1);

    /// Errors about rigs, with their code and reason.
    fn errors_of_rigs() -> [(ServiceError, Code, &'static str); 5] {
        [
            (
                ServiceError::RigDamaged {
                    name: "rigs/x".into(),
                },
                Code::DataLoss,
                "RIG_DAMAGED",
            ),
            (
                ServiceError::RigNotFound {
                    name: "rigs/x".into(),
                },
                Code::NotFound,
                "RIG_NOT_FOUND",
            ),
            (
                ServiceError::RigExists {
                    name: "rigs/x".into(),
                },
                Code::AlreadyExists,
                "RIG_EXISTS",
            ),
            (
                ServiceError::RigBuiltIn {
                    name: "rigs/adult".into(),
                },
                Code::FailedPrecondition,
                "RIG_BUILT_IN",
            ),
            (
                ServiceError::RigsFull { maximum: 64 },
                Code::ResourceExhausted,
                "TOO_MANY_RIGS",
            ),
        ]
    }

    /// Errors of saved objects, with their code and reason.
    fn errors_of_the_store() -> [(ServiceError, Code, &'static str); 4] {
        let name = || "objects/x".to_owned();
        [
            (
                ServiceError::ObjectsFull { maximum: 9 },
                Code::ResourceExhausted,
                "TOO_MANY_OBJECTS",
            ),
            (
                ServiceError::ObjectDamaged { name: name() },
                Code::DataLoss,
                "OBJECT_DAMAGED",
            ),
            (
                ServiceError::ObjectUnloadable {
                    name: name(),
                    reason: "mesh: is too large".to_owned(),
                },
                Code::FailedPrecondition,
                "OBJECT_UNLOADABLE",
            ),
            (ServiceError::StoreFailed, Code::Unavailable, "STORE_FAILED"),
        ]
    }

    /// Errors of calls that stream, with their code and reason.
    fn errors_of_streams() -> [(ServiceError, Code, &'static str); 9] {
        [
            (
                ServiceError::UploadTooSlow { least: 9 },
                Code::DeadlineExceeded,
                "UPLOAD_TOO_SLOW",
            ),
            (
                ServiceError::TrackNotFound {
                    name: "tracks/x".into(),
                },
                Code::NotFound,
                "TRACK_NOT_FOUND",
            ),
            (
                ServiceError::TrackIdle { limit: SECOND },
                Code::DeadlineExceeded,
                "TRACK_IDLE",
            ),
            (
                ServiceError::MessageTooLarge { limit: 9 },
                Code::OutOfRange,
                "MESSAGE_TOO_LARGE",
            ),
            (
                ServiceError::ReaderStalled { limit: SECOND },
                Code::DeadlineExceeded,
                "READER_STALLED",
            ),
            (
                ServiceError::UploadStalled { limit: SECOND },
                Code::DeadlineExceeded,
                "UPLOAD_STALLED",
            ),
            (
                ServiceError::TookTooLong { limit: SECOND },
                Code::DeadlineExceeded,
                "CALL_TOOK_TOO_LONG",
            ),
            (
                ServiceError::WatcherTooSlow,
                Code::ResourceExhausted,
                "WATCHER_TOO_SLOW",
            ),
            (ServiceError::ShuttingDown, Code::Unavailable, "SHUTTING_DOWN"),
        ]
    }

    #[test]
    fn every_status_has_a_reason_in_the_domain() {
        let errors = [
            (
                ServiceError::invalid("seed", "is wrong"),
                Code::InvalidArgument,
                "INVALID_REQUEST",
            ),
            (
                ServiceError::ObjectNotFound {
                    name: "objects/x".into(),
                    evicted: false,
                },
                Code::NotFound,
                "OBJECT_NOT_FOUND",
            ),
            (
                ServiceError::ObjectNotFound {
                    name: "objects/x".into(),
                    evicted: true,
                },
                Code::NotFound,
                "OBJECT_EVICTED",
            ),
            (
                ServiceError::ObjectExists {
                    name: "objects/x".into(),
                },
                Code::AlreadyExists,
                "OBJECT_EXISTS",
            ),
            (
                ServiceError::RequestIdReused {
                    request_id: "3f2a9c1e-8d57-4b06-9e1b-5a70c4d2f683".into(),
                    name: "objects/x".into(),
                },
                Code::FailedPrecondition,
                "REQUEST_ID_REUSED",
            ),
            (
                ServiceError::ObjectReadOnly {
                    name: "objects/remote".into(),
                },
                Code::FailedPrecondition,
                "OBJECT_READ_ONLY",
            ),
            (
                ServiceError::ObjectChanged {
                    name: "objects/x".into(),
                    etag: "1-2".into(),
                    current: "1-3".into(),
                },
                Code::Aborted,
                "OBJECT_CHANGED",
            ),
            (
                ServiceError::Overloaded {
                    limit: Limit::Searches,
                    maximum: 64,
                    retry_after: Duration::from_millis(50),
                },
                Code::ResourceExhausted,
                "TOO_MANY_SEARCHES",
            ),
            (
                ServiceError::DeadlineExceeded,
                Code::DeadlineExceeded,
                "DEADLINE_EXCEEDED",
            ),
            (
                ServiceError::Malformed("a key has wire type 7".into()),
                Code::InvalidArgument,
                "MALFORMED_MESSAGE",
            ),
            (ServiceError::Cancelled, Code::Cancelled, "CALL_CANCELLED"),
            (ServiceError::Panicked, Code::Internal, "JOB_PANICKED"),
        ];
        for (error, code, reason) in errors
            .into_iter()
            .chain(errors_of_streams())
            .chain(errors_of_rigs())
            .chain(errors_of_the_store())
        {
            let status = Status::from(error);
            assert_eq!(status.code(), code);
            let details = status.get_error_details();
            let info = details.error_info().expect("an ErrorInfo");
            assert_eq!((info.reason.as_str(), info.domain.as_str()), (reason, "grasp.v1"));
        }
    }

    #[test]
    fn what_the_transport_answers_without_details_is_the_clients_fault() {
        let code_after = |status: Status| {
            let response = blame_client(status.into_http::<()>(), 77);
            let status = Status::from_header_map(response.headers()).expect("it has a status");
            (status.code(), status.message().to_owned())
        };
        let (code, message) = code_after(Status::internal("failed to decode: invalid wire type"));
        assert_eq!(code, Code::InvalidArgument);
        assert_eq!(
            message,
            "the request is not a valid message: failed to decode: invalid wire type"
        );
        for too_large in [
            Status::out_of_range("found 78"),
            Status::resource_exhausted("unpacked"),
        ] {
            let (code, message) = code_after(too_large);
            assert_eq!(code, Code::OutOfRange);
            assert!(message.contains("more than 77 bytes"), "{message}");
        }
        assert_eq!(code_after(ServiceError::Panicked.into()).0, Code::Internal);
        let overloaded = ServiceError::Overloaded {
            limit: Limit::Uploads,
            maximum: 4,
            retry_after: SECOND,
        };
        assert_eq!(code_after(overloaded.into()).0, Code::ResourceExhausted);
        assert_eq!(code_after(Status::cancelled("gone")).0, Code::Cancelled);
        let ok = blame_client(Response::new(7), 77);
        assert_eq!(ok.into_body(), 7);
    }

    #[test]
    fn overload_says_when_to_retry() {
        let status = Status::from(ServiceError::Overloaded {
            limit: Limit::Uploads,
            maximum: 4,
            retry_after: Duration::from_millis(250),
        });
        assert_eq!(status.metadata().get(RETRY_PUSHBACK).unwrap(), "250");
        let details = status.get_error_details();
        assert_eq!(
            details.retry_info().unwrap().retry_delay,
            Some(Duration::from_millis(250))
        );
    }

    #[test]
    fn details_list_violations_and_the_message_counts_them() {
        let violations = (0..3)
            .map(|i| Violation::new(format!("f{i}"), "is wrong"))
            .collect();
        let status = Status::from(ServiceError::Invalid(violations));
        assert_eq!(status.message(), "f0: is wrong (and 2 more)");
        assert_eq!(
            status
                .get_error_details()
                .bad_request()
                .unwrap()
                .field_violations
                .len(),
            3
        );
    }
}
