//! The gRPC status of every error.

use std::collections::HashMap;

use grasp_proto::v1::ErrorReason;
use http::Response;
use tonic::{Code, Status, metadata::MetadataValue};
use tonic_types::{ErrorDetails, StatusExt as _};

use super::{
    Limit, ServiceError, ServiceError as E,
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
        let (code, reason) = code_and_reason(&error);
        let mut details = ErrorDetails::with_error_info(reason_name(reason), ERROR_DOMAIN, metadata(&error));
        let mut precondition = |kind, name: &str| {
            details.add_precondition_failure_violation(kind, clipped(name, MAX_NAME), message.clone());
        };
        match &error {
            E::RequestIdReused { name, .. } => precondition("REQUEST_ID", name),
            E::ObjectReadOnly { name } => precondition("READ_ONLY", name),
            E::Invalid(violations) => {
                details.set_bad_request(listed(violations));
            }
            E::Overloaded { retry_after, .. } => {
                details.set_retry_info(Some(*retry_after));
            }
            _ => {}
        }
        if let Some((kind, name)) = resource(&error) {
            details.set_resource_info(kind, clipped(name, MAX_NAME), "", message.clone());
        }
        let mut status = Self::with_error_details(code, message, details);
        if let E::Overloaded { retry_after, .. } = error {
            let pushback = MetadataValue::from(u64::try_from(retry_after.as_millis()).unwrap_or(u64::MAX));
            status.metadata_mut().insert(RETRY_PUSHBACK, pushback);
        }
        status
    }
}

/// The code of an error, and the reason in its `ErrorInfo`.
fn code_and_reason(error: &E) -> (Code, ErrorReason) {
    use ErrorReason as R;
    match error {
        E::Invalid(_) => (Code::InvalidArgument, R::InvalidRequest),
        E::Malformed(_) => (Code::InvalidArgument, R::MalformedMessage),
        E::ObjectNotFound { evicted: true, .. } => (Code::NotFound, R::ObjectEvicted),
        E::ObjectNotFound { evicted: false, .. } => (Code::NotFound, R::ObjectNotFound),
        E::ObjectExists { .. } => (Code::AlreadyExists, R::ObjectExists),
        E::RequestIdReused { .. } => (Code::FailedPrecondition, R::RequestIdReused),
        E::ObjectReadOnly { .. } => (Code::FailedPrecondition, R::ObjectReadOnly),
        E::ObjectChanged { .. } => (Code::Aborted, R::ObjectChanged),
        E::ObjectDamaged { .. } => (Code::DataLoss, R::ObjectDamaged),
        E::ObjectUnloadable { .. } => (Code::FailedPrecondition, R::ObjectUnloadable),
        E::ObjectsFull { .. } => (Code::ResourceExhausted, R::TooManyObjects),
        E::RigNotFound { .. } => (Code::NotFound, R::RigNotFound),
        E::RigExists { .. } => (Code::AlreadyExists, R::RigExists),
        E::RigBuiltIn { .. } => (Code::FailedPrecondition, R::RigBuiltIn),
        E::RigDamaged { .. } => (Code::DataLoss, R::RigDamaged),
        E::RigsFull { .. } => (Code::ResourceExhausted, R::TooManyRigs),
        E::StoreFailed => (Code::Unavailable, R::StoreFailed),
        E::Overloaded { limit, .. } => (Code::ResourceExhausted, limit_reason(*limit)),
        // As the transport answers to messages beyond its own limit.
        E::MessageTooLarge { .. } => (Code::OutOfRange, R::MessageTooLarge),
        E::ReaderStalled { .. } => (Code::DeadlineExceeded, R::ReaderStalled),
        E::UploadStalled { .. } => (Code::DeadlineExceeded, R::UploadStalled),
        E::UploadTooSlow { .. } => (Code::DeadlineExceeded, R::UploadTooSlow),
        E::TrackNotFound { .. } => (Code::NotFound, R::TrackNotFound),
        E::TrackIdle { .. } => (Code::DeadlineExceeded, R::TrackIdle),
        E::TookTooLong { .. } => (Code::DeadlineExceeded, R::CallTookTooLong),
        E::WatcherTooSlow => (Code::ResourceExhausted, R::WatcherTooSlow),
        E::ShuttingDown => (Code::Unavailable, R::ShuttingDown),
        E::DeadlineExceeded => (Code::DeadlineExceeded, R::DeadlineExceeded),
        E::Cancelled => (Code::Cancelled, R::CallCancelled),
        E::Panicked => (Code::Internal, R::JobPanicked),
    }
}

/// The type and name of the resource that an error is about.
fn resource(error: &E) -> Option<(&'static str, &str)> {
    match error {
        E::ObjectNotFound { name, .. }
        | E::ObjectExists { name }
        | E::ObjectChanged { name, .. }
        | E::ObjectDamaged { name }
        | E::ObjectUnloadable { name, .. } => Some((OBJECT, name)),
        E::RigNotFound { name } | E::RigExists { name } | E::RigBuiltIn { name } | E::RigDamaged { name } => {
            Some((RIG, name))
        }
        E::TrackNotFound { name } => Some((TRACK, name)),
        _ => None,
    }
}

/// The facts about an error in its `ErrorInfo`.
fn metadata(error: &E) -> HashMap<String, String> {
    let facts = match error {
        E::RequestIdReused { request_id, name } => {
            vec![("name", name.clone()), ("request_id", request_id.clone())]
        }
        E::ObjectChanged { name, current, .. } => vec![("name", name.clone()), ("etag", current.clone())],
        E::ObjectReadOnly { name } => vec![("name", name.clone())],
        E::RigsFull { maximum } | E::ObjectsFull { maximum } | E::Overloaded { maximum, .. } => {
            vec![("maximum", maximum.to_string())]
        }
        other => resource(other).map_or_else(Vec::new, |(_, name)| vec![("name", name.to_owned())]),
    };
    let clip = |(key, value): (&str, String)| (key.to_owned(), clipped(&value, MAX_NAME));
    facts.into_iter().map(clip).collect()
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
