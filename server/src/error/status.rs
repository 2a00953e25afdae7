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
mod tests;
