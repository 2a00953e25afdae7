//! Objects and rigs.

use crate::v1;

impl v1::CreateObjectRequest {
    /// An object of a mesh in meters and +Y up, with the server's defaults; `id` is the last part of its name.
    pub fn new(id: impl std::fmt::Display, mesh: impl Into<Vec<u8>>, mass_kg: f32) -> Self {
        Self {
            object: Some(v1::GraspObject {
                name: format!("objects/{id}"),
                mass_kg,
                ..v1::GraspObject::default()
            }),
            mesh: mesh.into(),
            request_id: String::new(),
        }
    }

    /// The object, to change it.
    pub fn object_mut(&mut self) -> &mut v1::GraspObject {
        self.object.get_or_insert_default()
    }
}

impl v1::UpdateObjectRequest {
    /// A change of these fields of an object to its values, whatever its state; `object.etag` restricts that.
    pub fn new<'a>(object: v1::GraspObject, fields: impl IntoIterator<Item = &'a str>) -> Self {
        Self {
            object: Some(object),
            update_mask: Some(prost_types::FieldMask {
                paths: fields.into_iter().map(str::to_owned).collect(),
            }),
        }
    }
}

impl v1::Region {
    /// A region of which nothing is marked yet.
    pub fn new(name: impl Into<String>, preference: v1::Preference) -> Self {
        Self {
            name: name.into(),
            preference: preference.into(),
            ..Self::default()
        }
    }
}

impl v1::KnownGrip {
    /// A grip to try first or not to answer.
    pub fn new(name: impl Into<String>, preference: v1::Preference, hand: v1::HandPose) -> Self {
        Self {
            name: name.into(),
            preference: preference.into(),
            hand: Some(hand),
            ..Self::default()
        }
    }
}

impl v1::CreateRigRequest {
    /// A rig of the hands of a model.
    pub fn of_model(rig_id: impl Into<String>, model: Vec<u8>) -> Self {
        Self {
            rig_id: rig_id.into(),
            models: vec![model],
            ..Self::default()
        }
    }
}
