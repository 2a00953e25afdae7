//! Errors as Connect writes them: JSON with the details, and a status of HTTP per code.

use base64::{Engine as _, engine::general_purpose::STANDARD_NO_PAD};
use grasp_proto::json::text_of;
use http::StatusCode;
use prost::Message as _;
use serde::Serialize;
use serde_json::Value;
use tonic::{Code, Status};
use tonic_types::pb;

use crate::methods::message;

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

/// Connect's error.
#[derive(Debug, Serialize)]
pub(super) struct ErrorBody {
    code: &'static str,
    #[serde(skip_serializing_if = "String::is_empty")]
    message: String,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    details: Vec<Detail>,
}

#[derive(Debug, Serialize)]
struct Detail {
    #[serde(rename = "type")]
    name: String,
    value: String,
    /// The detail as JSON, if its type is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    debug: Option<Value>,
}

impl From<&Status> for ErrorBody {
    fn from(status: &Status) -> Self {
        let details = pb::Status::decode(status.details()).unwrap_or_default().details;
        let details = details.into_iter().map(|detail| {
            let name = detail.type_url.rsplit('/').next().unwrap_or_default();
            Detail {
                name: name.to_owned(),
                value: STANDARD_NO_PAD.encode(&detail.value),
                debug: debug(name, &detail.value),
            }
        });
        Self {
            code: http_status(status.code()).1,
            message: status.message().to_owned(),
            details: details.collect(),
        }
    }
}

fn debug(name: &str, value: &[u8]) -> Option<Value> {
    let text = text_of(&message(name)?, value).ok()?;
    serde_json::from_slice(&text).ok()
}
