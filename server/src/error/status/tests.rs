//! Every error has its code, reason and details.

use std::time::Duration;

use super::*;
use crate::error::Violation;

const SECOND: Duration = Duration::from_secs(1);

/// Errors with the same code, and the reason of each.
type Errors<'a> = (Code, &'a [(E, &'a str)]);

fn assert_all_have_codes_and_reasons(table: &[Errors<'_>]) {
    for (code, errors) in table {
        for (error, reason) in *errors {
            let status = Status::from(error.clone());
            assert_eq!(status.code(), *code, "{error:?}");
            let details = status.get_error_details();
            let info = details.error_info().expect("an ErrorInfo");
            assert_eq!(
                (info.reason.as_str(), info.domain.as_str()),
                (*reason, "grasp.v1")
            );
        }
    }
}

#[test]
fn errors_of_resources_have_codes_and_reasons() {
    let [name, rig, track] = ["objects/x", "rigs/x", "tracks/x"].map(|name| move || name.to_owned());
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
    assert_all_have_codes_and_reasons(&[
        (
            Code::NotFound,
            &[
                (missing(false), "OBJECT_NOT_FOUND"),
                (missing(true), "OBJECT_EVICTED"),
                (E::RigNotFound { name: rig() }, "RIG_NOT_FOUND"),
                (E::TrackNotFound { name: track() }, "TRACK_NOT_FOUND"),
            ],
        ),
        (
            Code::AlreadyExists,
            &[
                (E::ObjectExists { name: name() }, "OBJECT_EXISTS"),
                (E::RigExists { name: rig() }, "RIG_EXISTS"),
            ],
        ),
        (
            Code::FailedPrecondition,
            &[
                (reused, "REQUEST_ID_REUSED"),
                (E::ObjectReadOnly { name: name() }, "OBJECT_READ_ONLY"),
                (E::RigBuiltIn { name: rig() }, "RIG_BUILT_IN"),
                (unloadable, "OBJECT_UNLOADABLE"),
            ],
        ),
        (Code::Aborted, &[(changed, "OBJECT_CHANGED")]),
        (
            Code::DataLoss,
            &[
                (E::RigDamaged { name: rig() }, "RIG_DAMAGED"),
                (E::ObjectDamaged { name: name() }, "OBJECT_DAMAGED"),
            ],
        ),
    ]);
}

#[test]
fn errors_of_requests_limits_and_time_have_codes_and_reasons() {
    let limit = SECOND;
    let overloaded = |limit| E::Overloaded {
        limit,
        maximum: 64,
        retry_after: SECOND,
    };
    assert_all_have_codes_and_reasons(&[
        (
            Code::InvalidArgument,
            &[
                (E::invalid("seed", "is wrong"), "INVALID_REQUEST"),
                (E::Malformed("a key has wire type 7".into()), "MALFORMED_MESSAGE"),
            ],
        ),
        (
            Code::ResourceExhausted,
            &[
                (overloaded(Limit::Searches), "TOO_MANY_SEARCHES"),
                (overloaded(Limit::Uploads), "TOO_MANY_UPLOADS"),
                (overloaded(Limit::ObjectCache), "OBJECT_CACHE_FULL"),
                (overloaded(Limit::UnreadAnswers), "TOO_MANY_UNREAD_ANSWERS"),
                (overloaded(Limit::UploadBytes), "TOO_MANY_UPLOAD_BYTES"),
                (overloaded(Limit::Watchers), "TOO_MANY_WATCHERS"),
                (overloaded(Limit::Tracks), "TOO_MANY_TRACKS"),
                (overloaded(Limit::Calls), "TOO_MANY_CALLS"),
                (E::RigsFull { maximum: 64 }, "TOO_MANY_RIGS"),
                (E::ObjectsFull { maximum: 9 }, "TOO_MANY_OBJECTS"),
                (E::WatcherTooSlow, "WATCHER_TOO_SLOW"),
            ],
        ),
        (
            Code::Unavailable,
            &[
                (E::StoreFailed, "STORE_FAILED"),
                (E::ShuttingDown, "SHUTTING_DOWN"),
            ],
        ),
        (
            Code::DeadlineExceeded,
            &[
                (E::DeadlineExceeded, "DEADLINE_EXCEEDED"),
                (E::UploadTooSlow { least: 9 }, "UPLOAD_TOO_SLOW"),
                (E::TrackIdle { limit }, "TRACK_IDLE"),
                (E::ReaderStalled { limit }, "READER_STALLED"),
                (E::UploadStalled { limit }, "UPLOAD_STALLED"),
                (E::TookTooLong { limit }, "CALL_TOOK_TOO_LONG"),
            ],
        ),
        (
            Code::OutOfRange,
            &[(E::MessageTooLarge { limit: 9 }, "MESSAGE_TOO_LARGE")],
        ),
        (Code::Internal, &[(E::Panicked, "JOB_PANICKED")]),
        (Code::Cancelled, &[(E::Cancelled, "CALL_CANCELLED")]),
    ]);
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
    for (own, code) in [
        (Status::from(E::Panicked), Code::Internal),
        (E::RigsFull { maximum: 4 }.into(), Code::ResourceExhausted),
        (Status::cancelled("gone"), Code::Cancelled),
    ] {
        assert_eq!(code_after(own).0, code);
    }
    let ok = blame_client(Response::new(7), 77);
    assert_eq!(ok.into_body(), 7);
}

#[test]
fn overload_says_when_to_retry_and_details_list_violations() {
    let status = Status::from(E::Overloaded {
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
    let violations = ["a", "b", "c"].map(|field| Violation::new(field, "is wrong"));
    let status = Status::from(E::Invalid(violations.into()));
    assert_eq!(status.message(), "a: is wrong (and 2 more)");
    let details = status.get_error_details();
    assert_eq!(details.bad_request().unwrap().field_violations.len(), 3);
}
