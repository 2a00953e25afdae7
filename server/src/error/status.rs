//! The gRPC status of every error.
//!
//! A status travels in headers, and clients drop calls with large ones: gRPC's C core at random beyond 8 kB. Message and details
//! of an error take less than 4 kB as they are sent, percent-encoded and in base64, with room for other headers and for the id of the
//! request.

use std::{collections::HashMap, time::Duration};

use grasp_proto::v1::ErrorReason as R;
use http::Response;
use tonic::{Code, Status, metadata::MetadataValue};
use tonic_types::{ErrorDetails, StatusExt as _};

use super::{ServiceError, ServiceError as E, listing::listed};

/// Largest message of a status, in bytes as they are sent.
const MAX_MESSAGE: usize = 360;

/// Largest part of the message that describes the first of several violations; the rest is for their number.
pub(super) const MAX_SUMMARY: usize = 320;
const MAX_NAME: usize = 160;
const ERROR_DOMAIN: &str = "grasp.v1";

/// Trailer with the delay of a gRPC client's retry policy, in milliseconds.
const RETRY_PUSHBACK: &str = "grpc-retry-pushback-ms";

/// Header that says how to authenticate (RFC 6750).
pub(crate) const CHALLENGE: &str = "www-authenticate";

fn challenge(error: &E) -> Option<&'static str> {
    match error {
        E::TokenMissing => Some("Bearer realm=\"grasp\""),
        E::TokenUnknown => Some("Bearer realm=\"grasp\", error=\"invalid_token\""),
        E::TokenLacksScope { .. } => Some("Bearer realm=\"grasp\", error=\"insufficient_scope\""),
        _ => None,
    }
}

impl From<ServiceError> for Status {
    fn from(error: ServiceError) -> Self {
        let message = clipped_message(&error.to_string(), MAX_MESSAGE);
        let reason = reason(&error);
        let mut details = ErrorDetails::with_error_info(reason_name(reason), ERROR_DOMAIN, metadata(&error));
        if let E::Invalid(violations) = &error {
            details.set_bad_request(listed(violations));
        }
        if let Some((kind, name)) = subject(&error) {
            let (name, text) = (clipped(name, MAX_NAME), message.clone());
            if kind.starts_with("grasp/") {
                details.set_resource_info(kind, name, "", text);
            } else {
                details.add_precondition_failure_violation(kind, name, text);
            }
        }
        let retry_after = retry_after(&error);
        if retry_after.is_some() {
            details.set_retry_info(retry_after);
        }
        let mut status = Self::with_error_details(code(reason), message, details);
        if let Some(challenge) = challenge(&error) {
            let challenge = MetadataValue::from_static(challenge);
            status.metadata_mut().insert(CHALLENGE, challenge);
        }
        if let Some(retry_after) = retry_after {
            let pushback = MetadataValue::from(u64::try_from(retry_after.as_millis()).unwrap_or(u64::MAX));
            status.metadata_mut().insert(RETRY_PUSHBACK, pushback);
        }
        status
    }
}

/// When a client should try again, if the server had no room for its call.
fn retry_after(error: &E) -> Option<Duration> {
    match error {
        E::Overloaded { retry_after, .. } => Some(*retry_after),
        E::WouldMissDeadline { expected } => Some(*expected),
        E::QuotaExceeded { retry_after, .. } => *retry_after,
        _ => None,
    }
}

fn reason(error: &E) -> R {
    match error {
        E::Invalid(_) => R::InvalidRequest,
        E::Malformed(_) => R::MalformedMessage,
        E::ObjectNotFound { evicted: true, .. } => R::ObjectEvicted,
        E::ObjectNotFound { evicted: false, .. } => R::ObjectNotFound,
        E::ObjectExists { .. } => R::ObjectExists,
        E::RequestIdReused { .. } => R::RequestIdReused,
        E::ObjectReadOnly { .. } => R::ObjectReadOnly,
        E::ObjectChanged { .. } => R::ObjectChanged,
        E::ObjectDamaged { .. } => R::ObjectDamaged,
        E::ObjectUnloadable { .. } => R::ObjectUnloadable,
        E::ObjectsFull { .. } => R::TooManyObjects,
        E::RigNotFound { .. } => R::RigNotFound,
        E::RigExists { .. } => R::RigExists,
        E::RigBuiltIn { .. } => R::RigBuiltIn,
        E::RigDamaged { .. } => R::RigDamaged,
        E::RigsFull { .. } | E::RigShareFull { .. } => R::TooManyRigs,
        E::StoreFailed => R::StoreFailed,
        E::Overloaded { limit, .. } => limit.text_and_reason().1,
        E::WouldMissDeadline { .. } => R::WouldMissDeadline,
        E::MessageTooLarge { .. } => R::MessageTooLarge,
        E::ReaderStalled { .. } => R::ReaderStalled,
        E::UploadStalled { .. } => R::UploadStalled,
        E::UploadTooSlow { .. } => R::UploadTooSlow,
        E::TrackNotFound { .. } => R::TrackNotFound,
        E::TrackIdle { .. } => R::TrackIdle,
        E::TookTooLong { .. } => R::CallTookTooLong,
        E::TokenMissing => R::TokenMissing,
        E::TokenUnknown => R::TokenUnknown,
        E::TokenLacksScope { .. } => R::TokenLacksScope,
        E::NotOwner { .. } => R::NotOwner,
        E::QuotaExceeded { .. } => R::QuotaExceeded,
        E::WatcherTooSlow => R::WatcherTooSlow,
        E::ShuttingDown => R::ShuttingDown,
        E::DeadlineExceeded => R::DeadlineExceeded,
        E::Cancelled => R::CallCancelled,
        E::Panicked => R::JobPanicked,
    }
}

fn code(reason: R) -> Code {
    match reason {
        R::InvalidRequest | R::MalformedMessage => Code::InvalidArgument,
        // As the transport answers to messages beyond its own limit.
        R::MessageTooLarge => Code::OutOfRange,
        R::ObjectNotFound | R::ObjectEvicted | R::RigNotFound | R::TrackNotFound => Code::NotFound,
        R::ObjectExists | R::RigExists => Code::AlreadyExists,
        R::ObjectChanged => Code::Aborted,
        R::ObjectReadOnly | R::ObjectUnloadable | R::RequestIdReused | R::RigBuiltIn => {
            Code::FailedPrecondition
        }
        R::ObjectDamaged | R::RigDamaged => Code::DataLoss,
        R::TooManySearches
        | R::TooManyUploads
        | R::TooManyUploadBytes
        | R::TooManyUnreadAnswers
        | R::TooManyWatchers
        | R::TooManyTracks
        | R::TooManyReads
        | R::TooManyCalls
        | R::TooManyObjects
        | R::TooManyRigs
        | R::ObjectCacheFull
        | R::WouldMissDeadline
        | R::QuotaExceeded
        | R::WatcherTooSlow => Code::ResourceExhausted,
        R::DeadlineExceeded
        | R::CallTookTooLong
        | R::ReaderStalled
        | R::TrackIdle
        | R::UploadStalled
        | R::UploadTooSlow => Code::DeadlineExceeded,
        R::CallCancelled => Code::Cancelled,
        R::StoreFailed | R::ShuttingDown => Code::Unavailable,
        R::TokenMissing | R::TokenUnknown => Code::Unauthenticated,
        R::TokenLacksScope | R::NotOwner => Code::PermissionDenied,
        R::JobPanicked => Code::Internal,
        R::Unspecified => Code::Unknown,
    }
}

/// The type of the resource that an error is about, or of the precondition that it fails, and its name.
fn subject(error: &E) -> Option<(&'static str, &str)> {
    Some(match error {
        E::ObjectNotFound { name, .. }
        | E::ObjectExists { name }
        | E::ObjectChanged { name, .. }
        | E::ObjectDamaged { name }
        | E::ObjectUnloadable { name, .. } => ("grasp/GraspObject", name),
        E::RigNotFound { name } | E::RigExists { name } | E::RigBuiltIn { name } | E::RigDamaged { name } => {
            ("grasp/HandRig", name)
        }
        E::TrackNotFound { name } => ("grasp/Track", name),
        E::NotOwner { name, .. } => ("OWNER", name),
        E::RequestIdReused { name, .. } => ("REQUEST_ID", name),
        E::ObjectReadOnly { name } => ("READ_ONLY", name),
        _ => return None,
    })
}

fn metadata(error: &E) -> HashMap<String, String> {
    let other = match error {
        E::RequestIdReused { request_id, .. } => Some(("request_id", request_id.clone())),
        E::ObjectChanged { current, .. } => Some(("etag", current.clone())),
        E::TokenLacksScope { scope, .. } => Some(("scope", scope.clone())),
        E::NotOwner { owner, .. } => Some(("owner", owner.clone())),
        E::QuotaExceeded { quota, .. } => Some(("quota", quota.key().to_owned())),
        E::RigShareFull { maximum, .. }
        | E::RigsFull { maximum }
        | E::ObjectsFull { maximum }
        | E::Overloaded { maximum, .. } => Some(("maximum", maximum.to_string())),
        _ => None,
    };
    let name = subject(error).map(|(_, name)| ("name", name.to_owned()));
    let facts = name.into_iter().chain(other);
    facts
        .map(|(key, value)| (key.to_owned(), clipped(&value, MAX_NAME)))
        .collect()
}

/// Replaces the transport's errors for malformed messages (`INTERNAL`, as if the server had failed) and for messages of more than
/// `limit` bytes. Every other status in the headers of a response comes from a handler, and has details.
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

fn reason_name(reason: R) -> &'static str {
    let name = reason.as_str_name();
    name.strip_prefix("ERROR_REASON_").unwrap_or(name)
}

pub(super) fn clipped(text: &str, most: usize) -> String {
    clipped_by(text, most, char::len_utf8)
}

/// A text of at most `most` bytes once it is percent-encoded, as gRPC sends messages.
pub(super) fn clipped_message(text: &str, most: usize) -> String {
    clipped_by(text, most, |character| {
        let is_plain = matches!(character, '!'..='~') && !"\"#%<>`?{}".contains(character);
        if is_plain { 1 } else { 3 * character.len_utf8() }
    })
}

/// A text of at most `most` units, of which each character takes some. One that is cut ends with an ellipsis.
fn clipped_by(text: &str, most: usize, units: impl Fn(char) -> usize) -> String {
    const ELLIPSIS: char = '…';
    let (mut taken, mut cut) = (0, 0);
    for (place, character) in text.char_indices() {
        if taken + units(ELLIPSIS) <= most {
            cut = place;
        }
        taken += units(character);
        if taken > most {
            return format!("{}{ELLIPSIS}", &text[..cut]);
        }
    }
    text.to_owned()
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use proptest::prelude::*;

    use super::*;
    use crate::error::{Limit, Violation};

    #[test]
    fn every_reason_has_the_code_of_its_row_in_the_page_about_errors() {
        let page = include_str!("../../../proto/ERRORS.md");
        for reason in (1..=255).filter_map(|number| R::try_from(number).ok()) {
            let name = format!("`{}`", reason_name(reason));
            let rows = page
                .lines()
                .filter_map(|line| line.strip_prefix("| ")?.split_once(" | "));
            let codes: Vec<_> = rows
                .filter(|(names, _)| names.split(", ").any(|other| other == name))
                .map(|(_, rest)| rest.split('`').nth(1).unwrap().replace('_', "").to_lowercase())
                .collect();
            assert_eq!(codes, [format!("{:?}", code(reason)).to_lowercase()], "{name}");
        }
    }

    #[test]
    fn an_error_has_code_reason_and_domain() {
        for (error, code, reason) in [
            (
                E::ObjectNotFound {
                    name: "objects/x".into(),
                    evicted: true,
                },
                Code::NotFound,
                "OBJECT_EVICTED",
            ),
            (
                E::invalid("seed", "is wrong"),
                Code::InvalidArgument,
                "INVALID_REQUEST",
            ),
            (E::Panicked, Code::Internal, "JOB_PANICKED"),
        ] {
            let status = Status::from(error);
            let details = status.get_error_details();
            let info = details.error_info().expect("an ErrorInfo");
            assert_eq!((status.code(), info.reason.as_str()), (code, reason));
            assert_eq!(info.domain, "grasp.v1");
        }
    }

    #[test]
    fn errors_of_the_transport_without_details_are_the_clients_fault() {
        let code_after = |status: Status| {
            let response = blame_client(status.into_http::<()>(), 77);
            let status = Status::from_header_map(response.headers()).expect("it has a status");
            (status.code(), status.message().to_owned())
        };
        let (code, message) = code_after(Status::internal("failed to decode: invalid wire type"));
        assert_eq!(code, Code::InvalidArgument);
        let text = "the request is not a valid message: failed to decode: invalid wire type";
        assert_eq!(message, text);
        for too_large in [
            Status::out_of_range("found 78"),
            Status::resource_exhausted("unpacked"),
        ] {
            let (code, message) = code_after(too_large);
            assert!(
                code == Code::OutOfRange && message.contains("more than 77 bytes"),
                "{message}"
            );
        }
        for (own, code) in [
            (Status::from(E::Panicked), Code::Internal),
            (E::RigsFull { maximum: 4 }.into(), Code::ResourceExhausted),
            (Status::cancelled("gone"), Code::Cancelled),
        ] {
            assert_eq!(code_after(own).0, code);
        }
        assert_eq!(blame_client(Response::new(7), 77).into_body(), 7);
    }

    #[test]
    fn overload_says_when_to_retry() {
        let retry_after = Duration::from_millis(250);
        let status = Status::from(E::Overloaded {
            limit: Limit::Uploads,
            maximum: 4,
            retry_after,
        });
        assert_eq!(status.metadata().get(RETRY_PUSHBACK).unwrap(), "250");
        let details = status.get_error_details();
        assert_eq!(details.retry_info().unwrap().retry_delay, Some(retry_after));
    }

    /// Size of the headers of an error's answer: each its name, its value and 32 bytes (RFC 9113, 6.5.2).
    fn header_bytes(error: ServiceError) -> usize {
        let answer = Status::from(error).into_http::<()>();
        let sizes = answer
            .headers()
            .iter()
            .map(|(name, value)| name.as_str().len() + value.len() + 32);
        sizes.sum()
    }

    /// Less than 4 kB by the other headers of a page's answer, and by twice the id of the request.
    const MAX_HEADERS: usize = 3480;

    #[test]
    fn texts_are_cut_at_characters_and_only_if_they_are_too_long() {
        assert_eq!(clipped("aéb", 4), "aéb");
        assert_eq!(clipped("aébcde", 6), "aé…");
        assert_eq!(clipped_message("a b", 5), "a b");
        assert_eq!(clipped_message("a bcdefghijkl", 12), "a…");
    }

    proptest! {
        /// However many and long the violations are, they arrive.
        #[test]
        fn errors_are_small_enough_to_arrive(
            texts in prop::collection::vec((".{0,300}", ".{0,2000}", 0_usize..10), 0..40),
        ) {
            let all = texts.iter().map(|(field, description, unlisted)| Violation {
                unlisted: *unlisted,
                ..Violation::new(field.as_str(), description.as_str())
            });
            let bytes = header_bytes(ServiceError::Invalid(all.collect()));
            prop_assert!(bytes < MAX_HEADERS, "{bytes}");
        }

        #[test]
        fn long_names_are_small_enough_to_arrive(name in ".{0,4000}", other in ".{0,4000}") {
            for error in [
                E::ObjectNotFound { name: name.clone(), evicted: true },
                E::RequestIdReused { request_id: other.clone(), name: name.clone() },
                E::ObjectReadOnly { name: name.clone() },
                E::ObjectChanged { name: name.clone(), etag: other.clone(), current: other.clone() },
                E::ObjectUnloadable { name: name.clone(), reason: other.clone() },
                E::RigNotFound { name: name.clone() },
                E::TrackNotFound { name },
                E::Malformed(other),
            ] {
                let bytes = header_bytes(error.clone());
                prop_assert!(bytes < MAX_HEADERS, "{bytes} of {error:?}");
            }
        }
    }
}
