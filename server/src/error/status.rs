//! The gRPC status of every error.

use std::{collections::HashMap, time::Duration};

use grasp_proto::v1::ErrorReason;
use http::Response;
use tonic::{Code, Status, metadata::MetadataValue};
use tonic_types::{ErrorDetails, StatusExt as _};

use super::{
    Limit, ServiceError,
    metadata::{MAX_MESSAGE, MAX_NAME, clipped, clipped_message, listed},
};

/// Domain of every `ErrorInfo`: the package of the contract.
const ERROR_DOMAIN: &str = "grasp.v1";

/// Types of resources, as the contract names them.
const OBJECT: &str = "grasp/GraspObject";
const RIG: &str = "grasp/HandRig";
const TRACK: &str = "grasp/Track";

/// Trailer with the delay of a gRPC client's retry policy, in milliseconds.
const RETRY_PUSHBACK: &str = "grpc-retry-pushback-ms";

impl From<ServiceError> for Status {
    fn from(error: ServiceError) -> Self {
        let message = clipped_message(&error.to_string(), MAX_MESSAGE);
        match error {
            ServiceError::Invalid(violations) => {
                let mut details = info(ErrorReason::InvalidRequest, []);
                details.set_bad_request(listed(&violations));
                Status::with_error_details(Code::InvalidArgument, message, details)
            }
            ServiceError::Malformed(_) => {
                plain_status(Code::InvalidArgument, ErrorReason::MalformedMessage, message)
            }
            ServiceError::ObjectNotFound { name, evicted } => {
                let reason = if evicted {
                    ErrorReason::ObjectEvicted
                } else {
                    ErrorReason::ObjectNotFound
                };
                object_status(Code::NotFound, reason, &name, message)
            }
            ServiceError::ObjectExists { name } => {
                object_status(Code::AlreadyExists, ErrorReason::ObjectExists, &name, message)
            }
            ServiceError::RequestIdReused { request_id, name } => {
                let details = info(
                    ErrorReason::RequestIdReused,
                    [("name", name.clone()), ("request_id", request_id)],
                );
                precondition_status("REQUEST_ID", details, &name, message)
            }
            ServiceError::ObjectReadOnly { name } => {
                let details = info(ErrorReason::ObjectReadOnly, [("name", name.clone())]);
                precondition_status("READ_ONLY", details, &name, message)
            }
            ServiceError::ObjectChanged { name, current, .. } => {
                let details = info(
                    ErrorReason::ObjectChanged,
                    [("name", name.clone()), ("etag", current)],
                );
                resource_status(Code::Aborted, details, OBJECT, &name, message)
            }
            ServiceError::RigNotFound { name } => {
                rig_status(Code::NotFound, ErrorReason::RigNotFound, &name, message)
            }
            ServiceError::RigExists { name } => {
                rig_status(Code::AlreadyExists, ErrorReason::RigExists, &name, message)
            }
            ServiceError::RigBuiltIn { name } => {
                rig_status(Code::FailedPrecondition, ErrorReason::RigBuiltIn, &name, message)
            }
            ServiceError::RigDamaged { name } => {
                rig_status(Code::DataLoss, ErrorReason::RigDamaged, &name, message)
            }
            ServiceError::RigsFull { maximum } => full_status(ErrorReason::TooManyRigs, maximum, message),
            ServiceError::ObjectsFull { maximum } => {
                full_status(ErrorReason::TooManyObjects, maximum, message)
            }
            ServiceError::ObjectDamaged { name } => {
                object_status(Code::DataLoss, ErrorReason::ObjectDamaged, &name, message)
            }
            ServiceError::ObjectUnloadable { name, .. } => object_status(
                Code::FailedPrecondition,
                ErrorReason::ObjectUnloadable,
                &name,
                message,
            ),
            ServiceError::StoreFailed => plain_status(Code::Unavailable, ErrorReason::StoreFailed, message),
            ServiceError::Overloaded {
                limit,
                maximum,
                retry_after,
            } => overloaded_status(limit, maximum, retry_after, message),
            // As the transport answers to messages beyond its own limit.
            ServiceError::MessageTooLarge { .. } => {
                plain_status(Code::OutOfRange, ErrorReason::MessageTooLarge, message)
            }
            ServiceError::ReaderStalled { .. } => late_status(ErrorReason::ReaderStalled, message),
            ServiceError::UploadStalled { .. } => late_status(ErrorReason::UploadStalled, message),
            ServiceError::UploadTooSlow { .. } => late_status(ErrorReason::UploadTooSlow, message),
            ServiceError::TrackNotFound { name } => {
                let details = info(ErrorReason::TrackNotFound, [("name", name.clone())]);
                resource_status(Code::NotFound, details, TRACK, &name, message)
            }
            ServiceError::TrackIdle { .. } => late_status(ErrorReason::TrackIdle, message),
            ServiceError::TookTooLong { .. } => late_status(ErrorReason::CallTookTooLong, message),
            ServiceError::WatcherTooSlow => {
                plain_status(Code::ResourceExhausted, ErrorReason::WatcherTooSlow, message)
            }
            ServiceError::ShuttingDown => plain_status(Code::Unavailable, ErrorReason::ShuttingDown, message),
            ServiceError::DeadlineExceeded => late_status(ErrorReason::DeadlineExceeded, message),
            ServiceError::Cancelled => plain_status(Code::Cancelled, ErrorReason::CallCancelled, message),
            ServiceError::Panicked => plain_status(Code::Internal, ErrorReason::JobPanicked, message),
        }
    }
}

/// The status of a call that the state of a resource rules out.
fn precondition_status(kind: &str, mut details: ErrorDetails, name: &str, message: String) -> Status {
    details.add_precondition_failure_violation(kind, clipped(name, MAX_NAME), message.clone());
    Status::with_error_details(Code::FailedPrecondition, message, details)
}

/// The status of a server that saves as many resources as it may.
fn full_status(reason: ErrorReason, maximum: usize, message: String) -> Status {
    let details = info(reason, [("maximum", maximum.to_string())]);
    Status::with_error_details(Code::ResourceExhausted, message, details)
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

/// The name of a reason as it is sent.
fn reason_name(reason: ErrorReason) -> &'static str {
    let name = reason.as_str_name();
    name.strip_prefix("ERROR_REASON_").unwrap_or(name)
}

/// Details with the `ErrorInfo` that every status carries.
fn info<const N: usize>(reason: ErrorReason, metadata: [(&str, String); N]) -> ErrorDetails {
    let metadata: HashMap<String, String> = metadata
        .into_iter()
        .map(|(key, value)| (key.to_owned(), clipped(&value, MAX_NAME)))
        .collect();
    ErrorDetails::with_error_info(reason_name(reason), ERROR_DOMAIN, metadata)
}

/// The status of an error that its reason and message describe.
fn plain_status(code: Code, reason: ErrorReason, message: String) -> Status {
    Status::with_error_details(code, message, info(reason, []))
}

/// The status of an error that time causes.
fn late_status(reason: ErrorReason, message: String) -> Status {
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
fn object_status(code: Code, reason: ErrorReason, name: &str, message: String) -> Status {
    let details = info(reason, [("name", name.to_owned())]);
    resource_status(code, details, OBJECT, name, message)
}

/// The status of an error about one rig.
fn rig_status(code: Code, reason: ErrorReason, name: &str, message: String) -> Status {
    let details = info(reason, [("name", name.to_owned())]);
    resource_status(code, details, RIG, name, message)
}

/// The status of an error about a resource of a type.
fn resource_status(code: Code, mut details: ErrorDetails, kind: &str, name: &str, message: String) -> Status {
    details.set_resource_info(kind, clipped(name, MAX_NAME), "", message.clone());
    Status::with_error_details(code, message, details)
}

fn limit_reason(limit: Limit) -> ErrorReason {
    match limit {
        Limit::Searches => ErrorReason::TooManySearches,
        Limit::Uploads => ErrorReason::TooManyUploads,
        Limit::ObjectCache => ErrorReason::ObjectCacheFull,
        Limit::UnreadAnswers => ErrorReason::TooManyUnreadAnswers,
        Limit::UploadBytes => ErrorReason::TooManyUploadBytes,
        Limit::Watchers => ErrorReason::TooManyWatchers,
        Limit::Tracks => ErrorReason::TooManyTracks,
        Limit::Calls => ErrorReason::TooManyCalls,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Violation;

    const SECOND: Duration = Duration::from_secs(1);

    /// Errors about rigs, with their code and reason.
    fn errors_of_rigs() -> [(ServiceError, Code, ErrorReason); 5] {
        [
            (
                ServiceError::RigDamaged {
                    name: "rigs/x".into(),
                },
                Code::DataLoss,
                ErrorReason::RigDamaged,
            ),
            (
                ServiceError::RigNotFound {
                    name: "rigs/x".into(),
                },
                Code::NotFound,
                ErrorReason::RigNotFound,
            ),
            (
                ServiceError::RigExists {
                    name: "rigs/x".into(),
                },
                Code::AlreadyExists,
                ErrorReason::RigExists,
            ),
            (
                ServiceError::RigBuiltIn {
                    name: "rigs/adult".into(),
                },
                Code::FailedPrecondition,
                ErrorReason::RigBuiltIn,
            ),
            (
                ServiceError::RigsFull { maximum: 64 },
                Code::ResourceExhausted,
                ErrorReason::TooManyRigs,
            ),
        ]
    }

    /// Errors of saved objects, with their code and reason.
    fn errors_of_the_store() -> [(ServiceError, Code, ErrorReason); 4] {
        let name = || "objects/x".to_owned();
        [
            (
                ServiceError::ObjectsFull { maximum: 9 },
                Code::ResourceExhausted,
                ErrorReason::TooManyObjects,
            ),
            (
                ServiceError::ObjectDamaged { name: name() },
                Code::DataLoss,
                ErrorReason::ObjectDamaged,
            ),
            (
                ServiceError::ObjectUnloadable {
                    name: name(),
                    reason: "mesh: is too large".to_owned(),
                },
                Code::FailedPrecondition,
                ErrorReason::ObjectUnloadable,
            ),
            (
                ServiceError::StoreFailed,
                Code::Unavailable,
                ErrorReason::StoreFailed,
            ),
        ]
    }

    /// Errors of calls that stream, with their code and reason.
    fn errors_of_streams() -> [(ServiceError, Code, ErrorReason); 9] {
        [
            (
                ServiceError::UploadTooSlow { least: 9 },
                Code::DeadlineExceeded,
                ErrorReason::UploadTooSlow,
            ),
            (
                ServiceError::TrackNotFound {
                    name: "tracks/x".into(),
                },
                Code::NotFound,
                ErrorReason::TrackNotFound,
            ),
            (
                ServiceError::TrackIdle { limit: SECOND },
                Code::DeadlineExceeded,
                ErrorReason::TrackIdle,
            ),
            (
                ServiceError::MessageTooLarge { limit: 9 },
                Code::OutOfRange,
                ErrorReason::MessageTooLarge,
            ),
            (
                ServiceError::ReaderStalled { limit: SECOND },
                Code::DeadlineExceeded,
                ErrorReason::ReaderStalled,
            ),
            (
                ServiceError::UploadStalled { limit: SECOND },
                Code::DeadlineExceeded,
                ErrorReason::UploadStalled,
            ),
            (
                ServiceError::TookTooLong { limit: SECOND },
                Code::DeadlineExceeded,
                ErrorReason::CallTookTooLong,
            ),
            (
                ServiceError::WatcherTooSlow,
                Code::ResourceExhausted,
                ErrorReason::WatcherTooSlow,
            ),
            (
                ServiceError::ShuttingDown,
                Code::Unavailable,
                ErrorReason::ShuttingDown,
            ),
        ]
    }

    #[test]
    fn reasons_are_sent_without_the_name_of_their_type() {
        assert_eq!(reason_name(ErrorReason::InvalidRequest), "INVALID_REQUEST");
    }

    #[test]
    fn every_status_has_a_reason_in_the_domain() {
        let errors = [
            (
                ServiceError::invalid("seed", "is wrong"),
                Code::InvalidArgument,
                ErrorReason::InvalidRequest,
            ),
            (
                ServiceError::ObjectNotFound {
                    name: "objects/x".into(),
                    evicted: false,
                },
                Code::NotFound,
                ErrorReason::ObjectNotFound,
            ),
            (
                ServiceError::ObjectNotFound {
                    name: "objects/x".into(),
                    evicted: true,
                },
                Code::NotFound,
                ErrorReason::ObjectEvicted,
            ),
            (
                ServiceError::ObjectExists {
                    name: "objects/x".into(),
                },
                Code::AlreadyExists,
                ErrorReason::ObjectExists,
            ),
            (
                ServiceError::RequestIdReused {
                    request_id: "3f2a9c1e-8d57-4b06-9e1b-5a70c4d2f683".into(),
                    name: "objects/x".into(),
                },
                Code::FailedPrecondition,
                ErrorReason::RequestIdReused,
            ),
            (
                ServiceError::ObjectReadOnly {
                    name: "objects/remote".into(),
                },
                Code::FailedPrecondition,
                ErrorReason::ObjectReadOnly,
            ),
            (
                ServiceError::ObjectChanged {
                    name: "objects/x".into(),
                    etag: "1-2".into(),
                    current: "1-3".into(),
                },
                Code::Aborted,
                ErrorReason::ObjectChanged,
            ),
            (
                ServiceError::Overloaded {
                    limit: Limit::Searches,
                    maximum: 64,
                    retry_after: Duration::from_millis(50),
                },
                Code::ResourceExhausted,
                ErrorReason::TooManySearches,
            ),
            (
                ServiceError::DeadlineExceeded,
                Code::DeadlineExceeded,
                ErrorReason::DeadlineExceeded,
            ),
            (
                ServiceError::Malformed("a key has wire type 7".into()),
                Code::InvalidArgument,
                ErrorReason::MalformedMessage,
            ),
            (
                ServiceError::Cancelled,
                Code::Cancelled,
                ErrorReason::CallCancelled,
            ),
            (ServiceError::Panicked, Code::Internal, ErrorReason::JobPanicked),
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
            assert_eq!(
                (info.reason.as_str(), info.domain.as_str()),
                (reason_name(reason), "grasp.v1")
            );
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
