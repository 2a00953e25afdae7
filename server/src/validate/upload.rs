//! Checks the header of an upload.

use grasp_proto::v1;

use super::{Field, Violations, object::check_beside_mesh};
use crate::error::ServiceError;

/// A checked header.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct UploadQuery {
    /// The request to create the object, without its mesh.
    pub request: v1::CreateObjectRequest,
    /// Number of bytes of the mesh.
    pub bytes: usize,
}

/// Checks the header of an upload.
///
/// # Errors
/// [`ServiceError::Invalid`] with every violation.
pub(crate) fn upload_query(
    header: v1::UploadHeader,
    maximum_bytes: usize,
) -> Result<UploadQuery, ServiceError> {
    let mut violations = Violations::default();
    let field = Field::root("header");
    let request = header.object.unwrap_or_default();
    let object = field.child("object");
    for (name, bytes) in [("mesh", &request.mesh), ("obj", &request.obj)] {
        if !bytes.is_empty() {
            violations.add(object.child(name), "must be empty; the mesh follows in pieces");
        }
    }
    let mut of_object = Violations::default();
    check_beside_mesh(&request, &mut of_object);
    violations.add_all_within(object, of_object);
    let bytes = usize::try_from(header.total_bytes).unwrap_or(usize::MAX);
    if !(1..=maximum_bytes).contains(&bytes) {
        violations.add(
            field.child("total_bytes"),
            format_args!("is {}; it must be 1 to {maximum_bytes}", header.total_bytes),
        );
    }
    violations.finish(UploadQuery { request, bytes })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reports_every_violation_by_its_path() {
        let header = v1::UploadHeader {
            object: Some(v1::CreateObjectRequest {
                object_id: "Mug".to_owned(),
                mesh: vec![b'v'],
                mass_kg: -1.0,
                ..Default::default()
            }),
            total_bytes: 11,
        };
        let ServiceError::Invalid(violations) = upload_query(header, 10).unwrap_err() else {
            panic!("it is invalid");
        };
        let fields: Vec<&str> = violations.iter().map(|v| v.field.as_str()).collect();
        assert_eq!(
            fields,
            [
                "header.object.mesh",
                "header.object.object_id",
                "header.object.mass_kg",
                "header.total_bytes"
            ]
        );
    }

    #[test]
    fn keeps_the_request_of_a_valid_header() {
        let request = v1::CreateObjectRequest {
            object_id: "mug".to_owned(),
            mass_kg: 0.3,
            ..Default::default()
        };
        let header = v1::UploadHeader {
            object: Some(request.clone()),
            total_bytes: 10,
        };
        let query = upload_query(header, 10).unwrap();
        assert_eq!((query.request, query.bytes), (request, 10));
    }
}
