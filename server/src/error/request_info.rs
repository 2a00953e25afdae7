//! The id of a call in the details of its error.

use grasp_proto::v1::ErrorReason;
use http::HeaderMap;
use prost::Message as _;
use prost_types::Any;
use tonic::Status;
use tonic_types::pb;

const TYPES: &str = "type.googleapis.com/";
const REQUEST_INFO: &str = "google.rpc.RequestInfo";
const ERROR_INFO: &str = "google.rpc.ErrorInfo";

/// Adds the id of a call to the details of the status in its headers or trailers. Returns the reason of the error. Nothing changes if
/// the status has no details: it is no error, or one of the transport.
pub(crate) fn add_request_id(headers: &mut HeaderMap, id: &str) -> Option<ErrorReason> {
    let status = Status::from_header_map(headers).filter(|status| !status.details().is_empty())?;
    let mut details = pb::Status::decode(status.details()).ok()?;
    let reason = details.details.iter().find_map(reason);
    let info = pb::RequestInfo {
        request_id: id.to_owned(),
        serving_data: String::new(),
    };
    details.details.push(Any {
        type_url: format!("{TYPES}{REQUEST_INFO}"),
        value: info.encode_to_vec(),
    });
    let details = details.encode_to_vec().into();
    // Its message was in headers before, so that it can be again.
    let _ = Status::with_details(status.code(), status.message(), details).add_header(headers);
    reason
}

fn reason(detail: &Any) -> Option<ErrorReason> {
    let is_info = detail.type_url.strip_prefix(TYPES) == Some(ERROR_INFO);
    let info = pb::ErrorInfo::decode(&*detail.value).ok().filter(|_| is_info)?;
    ErrorReason::from_str_name(&format!("ERROR_REASON_{}", info.reason))
}

#[cfg(test)]
mod tests {
    use tonic::Code;
    use tonic_types::StatusExt as _;

    use super::*;
    use crate::error::ServiceError;

    #[test]
    fn an_error_has_the_id_beside_its_other_details() {
        let error = || Status::from(ServiceError::invalid("seed", "is 50 % wrong\u{e9}"));
        let mut headers = error().into_http::<()>().into_parts().0.headers;
        let reason = add_request_id(&mut headers, "an-id");
        assert_eq!(reason, Some(ErrorReason::InvalidRequest));
        let status = Status::from_header_map(&headers).unwrap();
        assert_eq!(
            (status.code(), status.message()),
            (error().code(), error().message())
        );
        let details = status.get_error_details();
        assert_eq!(details.request_info().unwrap().request_id, "an-id");
        let violations = &details.bad_request().unwrap().field_violations;
        assert_eq!(violations[0].field, "seed");
    }

    #[test]
    fn a_status_without_details_stays() {
        for status in [Status::new(Code::Ok, ""), Status::unimplemented("no such method")] {
            let before = status.into_http::<()>().into_parts().0.headers;
            let mut headers = before.clone();
            assert_eq!(add_request_id(&mut headers, "an-id"), None);
            assert_eq!(headers, before);
        }
    }
}
