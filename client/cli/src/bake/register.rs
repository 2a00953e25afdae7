//! Registers one object.

use grasp_client::{ClientError, GraspClient, NewObject, Object};
use sha2::{Digest as _, Sha256};
use uuid::Builder;

use super::{
    folder::{Baked, new_object},
    results::Row,
};
use crate::{blocking, failure::Failure, objects::create_or_upload};

/// Creates an object unless an earlier run did. What is wrong with the object is in its row.
///
/// # Errors
/// The server does not answer.
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
    let object = NewObject {
        request_id: Some(request_id(&object)),
        ..object
    };
    let before = match client.get_object(&row.name).await {
        Err(ClientError::NotFound(_)) => None,
        before => Some(before?),
    };
    let created = match create_or_upload(client, &object).await {
        Err(ClientError::AlreadyExists(_)) if replace => {
            client.delete_object(&row.name, None).await?;
            create_or_upload(client, &object).await
        }
        created => created,
    };
    match created {
        Ok(created) => {
            row.created = before.is_none_or(|before: Object| before.create_time != created.create_time);
            row.describe(&created);
        }
        Err(ClientError::AlreadyExists(_)) => {
            row.error = Some("was created from another file; --replace deletes that object first".to_owned());
        }
        Err(ClientError::InvalidArgument(call) | ClientError::FailedPrecondition(call)) => {
            let violations = call.details.field_violations.iter();
            let all: Vec<String> = violations
                .map(|violation| format!("{}: {}", violation.field, violation.description))
                .collect();
            row.error = Some(if all.is_empty() {
                call.message
            } else {
                all.join("; ")
            });
        }
        Err(error) => return Err(error.into()),
    }
    Ok(row)
}

/// A UUID of everything that the request says: the same object has the same in every run.
fn request_id(object: &NewObject) -> String {
    let mut hash = Sha256::new();
    // Every field, so that none is forgotten. Debug output tells all floats and texts apart.
    let NewObject {
        id,
        mesh,
        up_axis,
        parts,
        unit_metres,
        mass_kg,
        centre_of_mass,
        friction,
        forbidden,
        labels,
        regions,
        known_grips,
        request_id: _,
    } = object;
    let beside_mesh = format!(
        "{id:?} {up_axis:?} {unit_metres:?} {mass_kg:?} {centre_of_mass:?} {friction:?} {forbidden:?} {labels:?} \
         {regions:?} {known_grips:?} {parts:?}"
    );
    hash.update(Sha256::digest(mesh));
    hash.update(beside_mesh);
    let hash = hash.finalize();
    let mut bytes = [0; 16];
    bytes.copy_from_slice(&hash[..16]);
    Builder::from_custom_bytes(bytes).into_uuid().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn request_ids_depend_on_content_alone() {
        let object = NewObject::new("mug", b"v 0 0 0".to_vec(), 0.3);
        let same = request_id(&object.clone());
        assert_eq!(request_id(&object), same);
        let heavier = NewObject {
            mass_kg: 0.300_000_04,
            ..object.clone()
        };
        let other_mesh = NewObject {
            mesh: b"v 0 0 1".to_vec(),
            ..object.clone()
        };
        let labelled = NewObject {
            labels: [("level".to_owned(), String::new())].into(),
            ..object
        };
        for other in [heavier, other_mesh, labelled] {
            assert_ne!(request_id(&other), same);
        }
    }
}
