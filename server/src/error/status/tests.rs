//! Every error has its code, reason and details.

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
