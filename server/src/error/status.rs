//! The gRPC status of every error.
//!
//! A status travels in headers, and clients drop calls with large ones: gRPC's C core at random beyond 8 kB. Message and details
//! of an error take less than 4 kB as they are sent, percent-encoded and in base64, with room for other headers and for the id of the
//! request.

use std::{cmp::Reverse, collections::HashMap, time::Duration};

use grasp_proto::v1::ErrorReason;
use http::Response;
use tonic::{Code, Status, metadata::MetadataValue};
use tonic_types::{ErrorDetails, FieldViolation, StatusExt as _};

use super::{ServiceError, ServiceError as E, Violation, count};

/// Largest message of a status, in bytes as they are sent.
pub(super) const MAX_MESSAGE: usize = 360;

/// Largest part of the message that describes the first of several violations; the rest is for their number.
pub(super) const MAX_SUMMARY: usize = 320;
pub(super) const MAX_NAME: usize = 160;
const MAX_FIELD: usize = 160;
const MAX_DESCRIPTION: usize = 900;

/// Largest size of all listed violations, in bytes before base64.
const MAX_LISTED: usize = 1600;

/// The part of [`MAX_LISTED`] for the entry about those that are not listed.
const UNLISTED_ENTRY: usize = 260;

/// Bytes of a violation in the details beside its texts.
const PER_VIOLATION: usize = 9;

/// Largest number of kinds of violations that the entry about unlisted ones names.
const NAMED_KINDS: usize = 2;
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
        let (code, reason) = code_and_reason(&error);
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
        let mut status = Self::with_error_details(code, message, details);
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
        E::RigsFull { .. } | E::RigShareFull { .. } => (Code::ResourceExhausted, R::TooManyRigs),
        E::StoreFailed => (Code::Unavailable, R::StoreFailed),
        E::Overloaded { limit, .. } => (Code::ResourceExhausted, limit.text_and_reason().1),
        E::WouldMissDeadline { .. } => (Code::ResourceExhausted, R::WouldMissDeadline),
        // As the transport answers to messages beyond its own limit.
        E::MessageTooLarge { .. } => (Code::OutOfRange, R::MessageTooLarge),
        E::ReaderStalled { .. } => (Code::DeadlineExceeded, R::ReaderStalled),
        E::UploadStalled { .. } => (Code::DeadlineExceeded, R::UploadStalled),
        E::UploadTooSlow { .. } => (Code::DeadlineExceeded, R::UploadTooSlow),
        E::TrackNotFound { .. } => (Code::NotFound, R::TrackNotFound),
        E::TrackIdle { .. } => (Code::DeadlineExceeded, R::TrackIdle),
        E::TookTooLong { .. } => (Code::DeadlineExceeded, R::CallTookTooLong),
        E::TokenMissing => (Code::Unauthenticated, R::TokenMissing),
        E::TokenUnknown => (Code::Unauthenticated, R::TokenUnknown),
        E::TokenLacksScope { .. } => (Code::PermissionDenied, R::TokenLacksScope),
        E::NotOwner { .. } => (Code::PermissionDenied, R::NotOwner),
        E::QuotaExceeded { .. } => (Code::ResourceExhausted, R::QuotaExceeded),
        E::WatcherTooSlow => (Code::ResourceExhausted, R::WatcherTooSlow),
        E::ShuttingDown => (Code::Unavailable, R::ShuttingDown),
        E::DeadlineExceeded => (Code::DeadlineExceeded, R::DeadlineExceeded),
        E::Cancelled => (Code::Cancelled, R::CallCancelled),
        E::Panicked => (Code::Internal, R::JobPanicked),
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

fn reason_name(reason: ErrorReason) -> &'static str {
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

/// The violations that the details list, in their order: the first of each kind, then the second of each and so on, while there is
/// room. If any are left out, the last entry says how many, and has no field.
pub(super) fn listed(violations: &[Violation]) -> Vec<FieldViolation> {
    let entry = |violation: &Violation| {
        let field = clipped(&violation.field, MAX_FIELD);
        FieldViolation::new(field, clipped(&violation.description, MAX_DESCRIPTION))
    };
    let entries: Vec<FieldViolation> = violations.iter().map(entry).collect();
    let bytes = |entry: &FieldViolation| entry.field.len() + entry.description.len() + PER_VIOLATION;
    let total = count(violations);
    if total == entries.len() && entries.iter().map(bytes).sum::<usize>() <= MAX_LISTED {
        return entries;
    }
    let kinds: Vec<String> = violations.iter().map(|one| kind(&one.field)).collect();
    let mut of_kind: HashMap<&str, usize> = HashMap::new();
    let mut ranked: Vec<(usize, usize)> = Vec::new();
    for (place, kind) in kinds.iter().enumerate() {
        let rank = of_kind.entry(kind).or_default();
        ranked.push((*rank, place));
        *rank += 1;
    }
    ranked.sort_unstable();
    let mut room = MAX_LISTED - UNLISTED_ENTRY;
    let mut is_listed = vec![false; entries.len()];
    for (_, place) in ranked {
        let bytes = bytes(&entries[place]);
        is_listed[place] = bytes <= room;
        room -= if bytes <= room { bytes } else { 0 };
    }
    let mut left_out: Vec<(usize, usize)> = Vec::new();
    for place in (0..entries.len()).filter(|&place| !is_listed[place]) {
        match left_out
            .iter_mut()
            .find(|(first, _)| kinds[*first] == kinds[place])
        {
            Some((_, count)) => *count += 1,
            None => left_out.push((place, 1)),
        }
    }
    left_out.sort_by_key(|&(_, count)| Reverse(count));
    let named = left_out.into_iter().take(NAMED_KINDS).map(|(first, count)| {
        format!(
            "{count} like {}",
            clipped(&violations[first].field, MAX_FIELD / 2)
        )
    });
    let named = named.collect::<Vec<_>>().join(", ");
    let colon = if named.is_empty() { "" } else { ": " };
    let listed = entries
        .into_iter()
        .zip(is_listed)
        .filter(|(_, is_listed)| *is_listed);
    let mut listed: Vec<FieldViolation> = listed.map(|(entry, _)| entry).collect();
    let rest = total - listed.len();
    let rest = format!("{rest} more violations are not listed{colon}{named}");
    listed.push(FieldViolation::new("", rest));
    listed
}

/// The path of a field without the places in its lists.
fn kind(field: &str) -> String {
    let mut parts = field.split('[');
    let first = parts.next().unwrap_or_default().to_owned();
    parts.fold(first, |kind, part| {
        kind + part.split_once(']').map_or(part, |(_, after)| after)
    })
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use proptest::prelude::*;

    use super::*;
    use crate::error::{Limit, Quota};

    #[test]
    fn every_error_has_its_code_and_reason() {
        let [name, rig] = ["objects/x", "rigs/x"].map(|name| move || name.to_owned());
        let limit = Duration::from_secs(1);
        let missing = |evicted| E::ObjectNotFound {
            name: name(),
            evicted,
        };
        let reused = E::RequestIdReused {
            request_id: "3f2a9c1e-8d57-4b06-9e1b-5a70c4d2f683".into(),
            name: name(),
        };
        let changed = E::ObjectChanged {
            name: name(),
            etag: "1-2".into(),
            current: "1-3".into(),
        };
        let unloadable = E::ObjectUnloadable {
            name: name(),
            reason: "mesh: is too large".into(),
        };
        let overloaded = |limit| E::Overloaded {
            limit,
            maximum: 64,
            retry_after: Duration::from_secs(1),
        };
        // Codes by number, as they are sent.
        for (error, code, reason) in [
            (missing(false), 5, "OBJECT_NOT_FOUND"),
            (missing(true), 5, "OBJECT_EVICTED"),
            (E::RigNotFound { name: rig() }, 5, "RIG_NOT_FOUND"),
            (E::TrackNotFound { name: rig() }, 5, "TRACK_NOT_FOUND"),
            (E::ObjectExists { name: name() }, 6, "OBJECT_EXISTS"),
            (E::RigExists { name: rig() }, 6, "RIG_EXISTS"),
            (reused, 9, "REQUEST_ID_REUSED"),
            (E::ObjectReadOnly { name: name() }, 9, "OBJECT_READ_ONLY"),
            (E::RigBuiltIn { name: rig() }, 9, "RIG_BUILT_IN"),
            (unloadable, 9, "OBJECT_UNLOADABLE"),
            (changed, 10, "OBJECT_CHANGED"),
            (E::RigDamaged { name: rig() }, 15, "RIG_DAMAGED"),
            (E::ObjectDamaged { name: name() }, 15, "OBJECT_DAMAGED"),
            (E::invalid("seed", "is wrong"), 3, "INVALID_REQUEST"),
            (E::Malformed("a key".into()), 3, "MALFORMED_MESSAGE"),
            (overloaded(Limit::Searches), 8, "TOO_MANY_SEARCHES"),
            (overloaded(Limit::Uploads), 8, "TOO_MANY_UPLOADS"),
            (overloaded(Limit::ObjectCache), 8, "OBJECT_CACHE_FULL"),
            (overloaded(Limit::UnreadAnswers), 8, "TOO_MANY_UNREAD_ANSWERS"),
            (overloaded(Limit::UploadBytes), 8, "TOO_MANY_UPLOAD_BYTES"),
            (overloaded(Limit::Watchers), 8, "TOO_MANY_WATCHERS"),
            (overloaded(Limit::Tracks), 8, "TOO_MANY_TRACKS"),
            (overloaded(Limit::Calls), 8, "TOO_MANY_CALLS"),
            (E::RigsFull { maximum: 64 }, 8, "TOO_MANY_RIGS"),
            (E::ObjectsFull { maximum: 9 }, 8, "TOO_MANY_OBJECTS"),
            (E::WatcherTooSlow, 8, "WATCHER_TOO_SLOW"),
            (E::RigShareFull { held: 5, maximum: 9 }, 8, "TOO_MANY_RIGS"),
            (E::TokenMissing, 16, "TOKEN_MISSING"),
            (E::TokenUnknown, 16, "TOKEN_UNKNOWN"),
            (
                E::TokenLacksScope {
                    client: "a".into(),
                    scope: "find".into(),
                },
                7,
                "TOKEN_LACKS_SCOPE",
            ),
            (
                E::NotOwner {
                    name: name(),
                    owner: "a".into(),
                },
                7,
                "NOT_OWNER",
            ),
            (
                E::QuotaExceeded {
                    quota: Quota::Searches,
                    maximum: 1,
                    retry_after: None,
                },
                8,
                "QUOTA_EXCEEDED",
            ),
            (E::StoreFailed, 14, "STORE_FAILED"),
            (E::ShuttingDown, 14, "SHUTTING_DOWN"),
            (E::DeadlineExceeded, 4, "DEADLINE_EXCEEDED"),
            (E::UploadTooSlow { least: 9 }, 4, "UPLOAD_TOO_SLOW"),
            (E::TrackIdle { limit }, 4, "TRACK_IDLE"),
            (E::ReaderStalled { limit }, 4, "READER_STALLED"),
            (E::UploadStalled { limit }, 4, "UPLOAD_STALLED"),
            (E::TookTooLong { limit }, 4, "CALL_TOOK_TOO_LONG"),
            (E::MessageTooLarge { limit: 9 }, 11, "MESSAGE_TOO_LARGE"),
            (E::Panicked, 13, "JOB_PANICKED"),
            (E::Cancelled, 1, "CALL_CANCELLED"),
        ] {
            let status = Status::from(error);
            let details = status.get_error_details();
            let info = details.error_info().expect("an ErrorInfo");
            assert_eq!((i32::from(status.code()), info.reason.as_str()), (code, reason));
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

    fn violations(fields: impl IntoIterator<Item = String>) -> Vec<Violation> {
        let text = "is [0, 0, 0, 0], of norm 0; it must be a unit quaternion, within 1 %";
        fields
            .into_iter()
            .map(|field| Violation::new(field, text))
            .collect()
    }

    #[test]
    fn of_many_violations_the_first_of_each_kind_are_listed_and_the_others_counted() {
        let orientation = |place| format!("holdout.presenting_hand.joints.joints[{place}].pose.orientation");
        let few = violations((0..3).map(orientation));
        let fields: Vec<String> = listed(&few).into_iter().map(|entry| entry.field).collect();
        assert_eq!(fields, [0, 1, 2].map(orientation));
        let mut all = violations((0..26).map(orientation));
        all.extend(violations(["search.budget".to_owned()]));
        all.last_mut().unwrap().unlisted = 900;
        let status = Status::from(ServiceError::Invalid(all));
        assert!(
            status.message().ends_with("(and 926 more)"),
            "{}",
            status.message()
        );
        let details = status.get_error_details();
        let (last, listed) = details
            .bad_request()
            .unwrap()
            .field_violations
            .split_last()
            .unwrap();
        let (budget, orientations) = listed.split_last().unwrap();
        let count = orientations.len();
        assert!(count > 2 && orientations[1].field == orientation(1), "{listed:?}");
        assert_eq!(
            (budget.field.as_str(), last.field.as_str()),
            ("search.budget", "")
        );
        let (rest, left) = (926 - count, 26 - count);
        let text = format!(
            "{rest} more violations are not listed: {left} like {}",
            orientation(count)
        );
        assert_eq!(last.description, text);
    }

    #[test]
    fn texts_are_cut_at_characters_and_only_if_they_are_too_long() {
        assert_eq!(clipped("aéb", 4), "aéb");
        assert_eq!(clipped("aébcde", 6), "aé…");
        assert_eq!(clipped_message("a b", 5), "a b");
        assert_eq!(clipped_message("a bcdefghijkl", 12), "a…");
        assert_eq!(kind("a[1].b[22].c"), "a.b.c");
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
