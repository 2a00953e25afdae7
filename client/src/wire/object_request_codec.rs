//! Objects to create and changes of objects.

use grasp_proto::v1;
use uuid::Uuid;

#[cfg(feature = "messages")]
use super::{
    Malformed, each, geometry_codec::vector_from_wire, known_grip_codec::known_grip_from_wire,
    region_codec::region_from_wire,
};
use super::{
    geometry_codec::vector_to_wire, known_grip_codec::known_grip_to_wire, region_codec::region_to_wire,
};
use crate::object::{ForbiddenSurfaces, NewObject, ObjectUpdate, Reset, UpAxis};

/// The request, with a new id if the object has none.
pub(crate) fn new_object_to_wire(object: &NewObject) -> v1::CreateObjectRequest {
    v1::CreateObjectRequest {
        mesh: object.mesh.clone(),
        ..described_object_to_wire(object)
    }
}

/// The request without its mesh, with a new id if the object has none.
pub(crate) fn described_object_to_wire(object: &NewObject) -> v1::CreateObjectRequest {
    let request_id = object.request_id.clone();
    v1::CreateObjectRequest {
        object_id: object.id.clone(),
        obj: Vec::new(),
        mesh: Vec::new(),
        up_axis: match object.up_axis {
            UpAxis::Y => v1::UpAxis::Y,
            UpAxis::Z => v1::UpAxis::Z,
        }
        .into(),
        parts: object.parts.clone(),
        unit_metres: object.unit_metres,
        mass_kg: object.mass_kg,
        centre_of_mass: object.centre_of_mass.map(vector_to_wire),
        friction: object.friction,
        forbidden: Some(forbidden_to_wire(&object.forbidden)),
        regions: object.regions.iter().map(region_to_wire).collect(),
        known_grips: object.known_grips.iter().map(known_grip_to_wire).collect(),
        labels: object.labels.clone(),
        request_id: request_id.unwrap_or_else(|| Uuid::new_v4().to_string()),
    }
}

#[cfg(feature = "messages")]
impl NewObject {
    /// The object that a request would create.
    ///
    /// # Errors
    /// [`ClientError::Malformed`](crate::ClientError::Malformed) if a required field is missing or an enum has an unknown value.
    pub fn from_message(request: v1::CreateObjectRequest) -> Result<Self, crate::ClientError> {
        // Every field, so that none is forgotten.
        let v1::CreateObjectRequest {
            object_id,
            mesh,
            obj,
            up_axis,
            parts,
            unit_metres,
            mass_kg,
            centre_of_mass,
            friction,
            forbidden,
            labels,
            request_id,
            regions,
            known_grips,
        } = request;
        let v1::ForbiddenSurfaces { groups, triangles } = forbidden.unwrap_or_default();
        Ok(Self {
            id: object_id,
            mesh: if mesh.is_empty() { obj } else { mesh },
            up_axis: match v1::UpAxis::try_from(up_axis) {
                Ok(v1::UpAxis::Z) => UpAxis::Z,
                Ok(v1::UpAxis::Y | v1::UpAxis::Unspecified) => UpAxis::Y,
                Err(_) => return Err(Malformed::unknown_value("up_axis", up_axis).into()),
            },
            parts,
            unit_metres,
            mass_kg,
            centre_of_mass: centre_of_mass.map(vector_from_wire),
            friction,
            forbidden: ForbiddenSurfaces { groups, triangles },
            regions: each("regions", regions, region_from_wire)?,
            known_grips: each("known_grips", known_grips, known_grip_from_wire)?,
            labels,
            request_id: (!request_id.is_empty()).then_some(request_id),
        })
    }
}

fn forbidden_to_wire(forbidden: &ForbiddenSurfaces) -> v1::ForbiddenSurfaces {
    v1::ForbiddenSurfaces {
        groups: forbidden.groups.clone(),
        triangles: forbidden.triangles.clone(),
    }
}

/// The request whose mask lists what is to change.
pub(crate) fn update_to_wire(name: String, update: &ObjectUpdate) -> v1::UpdateObjectRequest {
    let ObjectUpdate {
        etag,
        unit_metres,
        mass_kg,
        centre_of_mass,
        friction,
        forbidden,
        regions,
        known_grips,
        labels,
    } = update;
    let listed = [
        ("unit_metres", unit_metres.is_some()),
        ("mass_kg", mass_kg.is_some()),
        ("centre_of_mass", centre_of_mass.is_some()),
        ("friction", friction.is_some()),
        ("forbidden", forbidden.is_some()),
        ("labels", labels.is_some()),
        ("regions", regions.is_some()),
        ("known_grips", known_grips.is_some()),
    ];
    let paths = listed.iter().filter(|(_, is_listed)| *is_listed);
    v1::UpdateObjectRequest {
        name,
        update_mask: Some(prost_types::FieldMask {
            paths: paths.map(|(path, _)| (*path).to_owned()).collect(),
        }),
        etag: etag.clone().unwrap_or_default(),
        unit_metres: *unit_metres,
        mass_kg: *mass_kg,
        centre_of_mass: given(*centre_of_mass).map(vector_to_wire),
        friction: given(*friction),
        forbidden: forbidden.as_ref().map(forbidden_to_wire),
        labels: labels.clone().unwrap_or_default(),
        regions: regions.iter().flatten().map(region_to_wire).collect(),
        known_grips: known_grips.iter().flatten().map(known_grip_to_wire).collect(),
    }
}

fn given<T>(value: Option<Reset<T>>) -> Option<T> {
    match value {
        Some(Reset::To(value)) => Some(value),
        Some(Reset::Default) | None => None,
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    #[test]
    fn an_update_lists_what_changes() {
        let wire = update_to_wire(
            "objects/mug".to_owned(),
            &ObjectUpdate {
                mass_kg: Some(0.3),
                friction: Some(Reset::Default),
                centre_of_mass: Some(Reset::To(Vec3::X)),
                regions: Some(Vec::new()),
                ..ObjectUpdate::default()
            },
        );
        assert_eq!(
            wire.update_mask.unwrap().paths,
            ["mass_kg", "centre_of_mass", "friction", "regions"]
        );
        assert_eq!((wire.mass_kg, wire.friction), (Some(0.3), None));
        assert_eq!(wire.centre_of_mass.unwrap().x, 1.0);
        assert_eq!(wire.etag, "");
    }

    #[test]
    fn every_request_has_an_id_of_its_own_unless_one_is_given() {
        let mut object = NewObject::new("mug", b"v 0 0 0".as_slice(), 0.3);
        let [first, second] = [(); 2].map(|()| new_object_to_wire(&object).request_id);
        assert!(first != second && Uuid::try_parse(&first).is_ok());
        object.request_id = Some(first.clone());
        assert_eq!(new_object_to_wire(&object).request_id, first);
    }

    #[test]
    fn converts_every_field_of_a_new_object() {
        let mut object = NewObject::new("mug", b"v 0 0 0".as_slice(), 0.3);
        object.centre_of_mass = Some(Vec3::new(1.0, 2.0, 3.0));
        object.unit_metres = Some(0.001);
        object.forbidden.groups = vec!["rim".to_owned()];
        object.forbidden.triangles = vec![4, 5];
        let wire = new_object_to_wire(&object);
        assert_eq!(wire.object_id, "mug");
        assert_eq!(wire.mesh, b"v 0 0 0");
        assert_eq!(wire.unit_metres, Some(0.001));
        assert_eq!(wire.friction, None);
        assert_eq!(wire.centre_of_mass.unwrap().z, 3.0);
        let forbidden = wire.forbidden.unwrap();
        assert_eq!(forbidden.groups, ["rim"]);
        assert_eq!(forbidden.triangles, [4, 5]);
    }

    #[cfg(feature = "messages")]
    #[test]
    fn an_object_to_create_survives_its_message() {
        let object = NewObject {
            up_axis: UpAxis::Z,
            parts: vec!["body".to_owned()],
            unit_metres: Some(0.01),
            centre_of_mass: Some(Vec3::Y),
            friction: Some(0.5),
            forbidden: ForbiddenSurfaces {
                groups: vec!["rim".to_owned()],
                triangles: vec![3],
            },
            regions: vec![crate::Region::of_shapes(
                "grip",
                crate::RegionKind::Prefer,
                vec![crate::RegionShape::Sphere {
                    centre: Vec3::X,
                    radius: 0.1,
                }],
            )],
            known_grips: vec![crate::KnownGrip::banned(
                "below",
                crate::Handedness::Left,
                crate::Pose::default(),
            )],
            labels: [("level".to_owned(), "kitchen".to_owned())].into(),
            request_id: Some("id".to_owned()),
            ..NewObject::new("mug", b"solid".to_vec(), 0.3)
        };
        assert_eq!(
            NewObject::from_message(new_object_to_wire(&object)).unwrap(),
            object
        );
        let wrong = v1::CreateObjectRequest {
            regions: vec![v1::Region::default()],
            ..new_object_to_wire(&object)
        };
        let error = NewObject::from_message(wrong).unwrap_err().to_string();
        assert!(error.contains("regions[0].kind"), "{error}");
    }
}
