//! Checks the first part of an upload.

use grasp_proto::v1;

use super::{Violations, check_within, object::check_beside_mesh};
use crate::error::ServiceError;

/// A checked first part.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct UploadQuery {
    /// The request to create the object, without its mesh.
    pub request: v1::CreateObjectRequest,
    /// Number of bytes of the mesh.
    pub bytes: usize,
}

/// Checks the first part of an upload.
pub(crate) fn upload_query(
    request: v1::CreateObjectRequest,
    total_bytes: u64,
    maximum_bytes: usize,
) -> Result<UploadQuery, ServiceError> {
    let violations = Violations::default();
    let field = violations.field("create");
    if !request.mesh.is_empty() {
        field
            .child("mesh")
            .add("must be empty; the mesh follows in pieces");
    }
    let of_object = Violations::default();
    check_beside_mesh(&request, &of_object);
    violations.add_all("create.", of_object);
    let bytes = usize::try_from(total_bytes).unwrap_or(usize::MAX);
    check_within(
        violations.field("total_bytes"),
        total_bytes,
        1..=maximum_bytes as u64,
    );
    violations.finish(UploadQuery { request, bytes })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::validate::testing::blamed;

    #[test]
    fn reports_every_violation_by_its_path() {
        let request = v1::CreateObjectRequest::new("Mug", b"v", -1.0);
        assert_eq!(
            blamed(upload_query(request, 11, 10)),
            [
                "create.mesh",
                "create.object.name",
                "create.object.mass_kg",
                "total_bytes"
            ]
        );
    }

    #[test]
    fn keeps_the_request_of_a_valid_part() {
        let request = v1::CreateObjectRequest::new("mug", [], 0.3);
        let query = upload_query(request.clone(), 10, 10).unwrap();
        assert_eq!((query.request, query.bytes), (request, 10));
    }
}
