//! Registers one object.

use grasp_client::{ClientError, GraspClient, v1};
use prost::Message as _;
use sha2::{Digest as _, Sha256};
use uuid::Builder;

use super::{
    atlases::atlases,
    folder::{Baked, new_object},
    results::Row,
};
use crate::{Failure, blocking, format::joined};

/// Creates an object unless an earlier run did. What is wrong with the object is in its row.
pub(super) async fn register(client: &GraspClient, baked: Baked, replace: bool) -> Result<Row, Failure> {
    let mut row = Row::new(&baked.id, &baked.mesh);
    let (object, density) = match blocking(move || Ok(new_object(baked))).await? {
        Ok(made) => made,
        Err(wrong) => {
            row.error = Some(wrong);
            return Ok(row);
        }
    };
    row.density = density;
    let object = v1::CreateObjectRequest {
        request_id: request_id(&object),
        ..object
    };
    let before = match client.get_object(&row.name).await {
        Err(ClientError::NotFound(_)) => None,
        before => Some(before?),
    };
    let created = match client.create_object(&object).await {
        Err(ClientError::AlreadyExists(_)) if replace => {
            client.delete_object(&row.name, None).await?;
            client.create_object(&object).await
        }
        created => created,
    };
    match created {
        Ok(created) => {
            row.created = before.is_none_or(|before| before.create_time != created.create_time);
            row.describe(&created, &atlases(client, &row.name).await?);
        }
        Err(ClientError::AlreadyExists(_)) => {
            row.error = Some("was created from another file; --replace deletes that object first".to_owned());
        }
        Err(ClientError::InvalidArgument(call) | ClientError::FailedPrecondition(call)) => {
            let violations = call.details.field_violations.iter();
            let all = violations.map(|wrong| format!("{}: {}", wrong.field, wrong.description));
            let all = joined("; ", all);
            row.error = Some(if all.is_empty() { call.message } else { all });
        }
        Err(error) => return Err(error.into()),
    }
    Ok(row)
}

/// A UUID of everything that the request says: the same object has the same in every run.
fn request_id(request: &v1::CreateObjectRequest) -> String {
    // Messages are encoded in order of their fields and of the keys of maps.
    let hash = Sha256::digest(request.encode_to_vec());
    let mut bytes = [0; 16];
    bytes.copy_from_slice(&hash[..16]);
    Builder::from_custom_bytes(bytes).into_uuid().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn request_ids_depend_on_content_alone() {
        let object = v1::CreateObjectRequest::new("mug", b"v 0 0 0", 0.3);
        let same = request_id(&object.clone());
        assert_eq!(request_id(&object), same);
        let mut heavier = object.clone();
        heavier.object_mut().mass_kg = 0.300_000_04;
        let mut labelled = object.clone();
        labelled.object_mut().labels = [("level".to_owned(), String::new())].into();
        let other_mesh = v1::CreateObjectRequest {
            mesh: b"v 0 0 1".to_vec(),
            ..object
        };
        for other in [heavier, other_mesh, labelled] {
            assert_ne!(request_id(&other), same);
        }
    }
}
