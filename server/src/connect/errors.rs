//! Errors as Connect writes them: JSON with the details, and a status of HTTP per code.

use base64::{Engine as _, engine::general_purpose::STANDARD_NO_PAD};
use grasp_proto::json::text_of;
use http::StatusCode;
use prost::Message as _;
use serde_json::{Map, Value, json};
use tonic::{Code, Status};
use tonic_types::pb;

use super::methods::message;

/// The status of HTTP and the name of a code.
pub(super) fn http_status(code: Code) -> (StatusCode, &'static str) {
    let (status, name) = match code {
        Code::Ok => (200, "ok"),
        Code::Cancelled => (499, "canceled"),
        Code::Unknown => (500, "unknown"),
        Code::InvalidArgument => (400, "invalid_argument"),
        Code::DeadlineExceeded => (504, "deadline_exceeded"),
        Code::NotFound => (404, "not_found"),
        Code::AlreadyExists => (409, "already_exists"),
        Code::PermissionDenied => (403, "permission_denied"),
        Code::ResourceExhausted => (429, "resource_exhausted"),
        Code::FailedPrecondition => (400, "failed_precondition"),
        Code::Aborted => (409, "aborted"),
        Code::OutOfRange => (400, "out_of_range"),
        Code::Unimplemented => (501, "unimplemented"),
        Code::Internal => (500, "internal"),
        Code::Unavailable => (503, "unavailable"),
        Code::DataLoss => (500, "data_loss"),
        Code::Unauthenticated => (401, "unauthenticated"),
    };
    (StatusCode::from_u16(status).unwrap_or_default(), name)
}

/// A status as Connect's error.
pub(super) fn error(status: &Status) -> Value {
    let mut error = Map::new();
    error.insert("code".to_owned(), http_status(status.code()).1.into());
    if !status.message().is_empty() {
        error.insert("message".to_owned(), status.message().into());
    }
    let details = pb::Status::decode(status.details()).unwrap_or_default().details;
    if !details.is_empty() {
        let details = details.iter().map(|detail| {
            let name = detail.type_url.rsplit('/').next().unwrap_or_default();
            let mut shown = json!({"type": name, "value": STANDARD_NO_PAD.encode(&detail.value)});
            if let Some(debug) = debug(name, &detail.value) {
                shown["debug"] = debug;
            }
            shown
        });
        error.insert("details".to_owned(), details.collect());
    }
    error.into()
}

/// A detail as JSON, if its type is known.
fn debug(name: &str, value: &[u8]) -> Option<Value> {
    let text = text_of(&message(name)?, value).ok()?;
    serde_json::from_slice(&text).ok()
}
