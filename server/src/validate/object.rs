//! Checks object names, and all fields of a new object but its mesh.

use glam::Vec3;
use grasp_import::{Import, UpAxis};
use grasp_proto::v1;

use super::{Field, Violations, friction, point, quoted};

/// Prefix of every object's name.
const COLLECTION: &str = "objects/";

/// Largest number of characters in an object's id.
const LONGEST_ID: usize = 63;

/// Largest mass of an object in kilograms: more than anyone can hold out.
const LARGEST_MASS: f32 = 1000.0;

/// Allowed lengths of a mesh's unit, in metres: a micrometre to a kilometre.
const UNIT_RANGE: std::ops::RangeInclusive<f32> = 1e-6..=1e3;

/// The checked fields of a new object, with its unread mesh.
#[derive(Debug)]
pub(crate) struct ObjectFields {
    /// The last part of its name.
    pub id: String,
    /// The mesh as the content of a file.
    pub mesh: Vec<u8>,
    /// The field that has it.
    pub mesh_field: &'static str,
    /// Unit and axes of the file.
    pub import: Import,
    /// Mass in kilograms.
    pub mass: f32,
    /// Centre of mass in metres, in the object's frame; none to compute it.
    pub centre_of_mass: Option<Vec3>,
    /// Coefficient of static friction, if given.
    pub friction: Option<f32>,
    /// Named parts of the mesh that must not be touched.
    pub forbidden_groups: Vec<String>,
    /// Triangles that must not be touched.
    pub forbidden_triangles: Vec<u32>,
}

/// The id of a name like `objects/remote`.
pub(crate) fn object_id_of(field: Field<'_>, name: &str, violations: &mut Violations) -> Option<String> {
    match name.strip_prefix(COLLECTION) {
        Some(id) if is_object_id(id) => Some(id.to_owned()),
        _ => {
            violations.add(
                field,
                if name.is_empty() {
                    "is required: objects/ and the object's id".to_owned()
                } else {
                    format!("is {}; it must be objects/ and the object's id", quoted(name))
                },
            );
            None
        }
    }
}

/// Checks the fields of a new object. Reading the mesh adds its own violations later.
pub(crate) fn object_fields(
    request: v1::CreateObjectRequest,
    maximum_bytes: usize,
    violations: &mut Violations,
) -> ObjectFields {
    if !is_object_id(&request.object_id) {
        violations.add(
            Field::root("object_id"),
            format_args!(
                "is {}; it must be 1 to {LONGEST_ID} of a-z, 0-9 and -, starting with a letter",
                quoted(&request.object_id)
            ),
        );
    }
    let (mesh_field, mesh) = match (request.mesh, request.obj) {
        (mesh, obj) if obj.is_empty() => ("mesh", mesh),
        (mesh, obj) if mesh.is_empty() => ("obj", obj),
        (mesh, _) => {
            violations.add(
                Field::root("obj"),
                "is the former name of mesh, which is given, too; give one of them",
            );
            ("mesh", mesh)
        }
    };
    if mesh.is_empty() {
        violations.add(
            Field::root(mesh_field),
            "is empty; the mesh is required as GLB, glTF, OBJ, PLY or STL",
        );
    } else if mesh.len() > maximum_bytes {
        violations.add(
            Field::root(mesh_field),
            format_args!("has {} bytes; the limit is {maximum_bytes}", mesh.len()),
        );
    }
    let up_axis = match v1::UpAxis::try_from(request.up_axis) {
        Ok(v1::UpAxis::Unspecified | v1::UpAxis::Y) => UpAxis::Y,
        Ok(v1::UpAxis::Z) => UpAxis::Z,
        Err(_) => {
            violations.add(
                Field::root("up_axis"),
                format_args!("is {}; it must be UP_AXIS_Y or UP_AXIS_Z", request.up_axis),
            );
            UpAxis::Y
        }
    };
    let unit_metres = match request.unit_metres {
        None => 1.0,
        Some(unit) if UNIT_RANGE.contains(&unit) => unit,
        Some(unit) => {
            violations.add(
                Field::root("unit_metres"),
                format_args!(
                    "is {unit}; it must be {} to {}",
                    UNIT_RANGE.start(),
                    UNIT_RANGE.end()
                ),
            );
            // The mesh is still read, to find its violations too.
            1.0
        }
    };
    if !(request.mass_kg > 0.0 && request.mass_kg <= LARGEST_MASS) {
        violations.add(
            Field::root("mass_kg"),
            format_args!(
                "is {}; it must be more than 0 and at most {LARGEST_MASS}",
                request.mass_kg
            ),
        );
    }
    let centre_of_mass = request
        .centre_of_mass
        .map(|v| point(Field::root("centre_of_mass"), v, 1.0, violations));
    let friction = request
        .friction
        .map(|value| friction(Field::root("friction"), value, violations));
    let forbidden = request.forbidden.unwrap_or_default();
    ObjectFields {
        id: request.object_id,
        mesh,
        mesh_field,
        import: Import { unit_metres, up_axis },
        mass: request.mass_kg,
        centre_of_mass,
        friction,
        forbidden_groups: forbidden.groups,
        forbidden_triangles: forbidden.triangles,
    }
}

fn is_object_id(id: &str) -> bool {
    id.len() <= LONGEST_ID
        && id.starts_with(|c: char| c.is_ascii_lowercase())
        && id
            .bytes()
            .all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'-')
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::ServiceError;

    fn valid() -> v1::CreateObjectRequest {
        v1::CreateObjectRequest {
            object_id: "mug-1".into(),
            obj: Vec::new(),
            mesh: b"v 0 0 0".to_vec(),
            up_axis: 0,
            unit_metres: None,
            mass_kg: 0.3,
            centre_of_mass: None,
            friction: None,
            forbidden: None,
        }
    }

    fn fields_of_violations(request: v1::CreateObjectRequest) -> Vec<String> {
        let mut violations = Violations::default();
        object_fields(request, 100, &mut violations);
        match violations.finish(()) {
            Ok(()) => Vec::new(),
            Err(ServiceError::Invalid(violations)) => violations.into_iter().map(|v| v.field).collect(),
            Err(other) => panic!("{other}"),
        }
    }

    #[test]
    fn optional_fields_have_defaults() {
        let mut violations = Violations::default();
        let fields = object_fields(valid(), 100, &mut violations);
        assert!(violations.is_empty());
        assert_eq!((fields.import, fields.friction), (Import::METRES, None));
    }

    #[test]
    fn reports_every_violation_by_field() {
        for id in ["", "1mug", "Mug", "mug_1", "mug/1", "mög", &"m".repeat(64)] {
            let request = v1::CreateObjectRequest {
                object_id: id.into(),
                ..valid()
            };
            assert_eq!(fields_of_violations(request), ["object_id"], "{id}");
        }
        for mass_kg in [0.0, -1.0, f32::NAN, f32::INFINITY, 1001.0] {
            let request = v1::CreateObjectRequest { mass_kg, ..valid() };
            assert_eq!(fields_of_violations(request), ["mass_kg"], "{mass_kg}");
        }
        for friction in [0.0, -0.1, 5.1, f32::NAN, f32::INFINITY] {
            let request = v1::CreateObjectRequest {
                friction: Some(friction),
                ..valid()
            };
            assert_eq!(fields_of_violations(request), ["friction"], "{friction}");
        }
        for unit in [0.0, -1.0, f32::NAN, f32::INFINITY, 1e4, 1e-9] {
            let request = v1::CreateObjectRequest {
                unit_metres: Some(unit),
                ..valid()
            };
            assert_eq!(fields_of_violations(request), ["unit_metres"], "{unit}");
        }
        for x in [f32::NAN, f32::NEG_INFINITY, 2000.0] {
            let centre_of_mass = Some(v1::Vector3 { x, y: 0.0, z: 0.0 });
            let request = v1::CreateObjectRequest {
                centre_of_mass,
                ..valid()
            };
            assert_eq!(fields_of_violations(request), ["centre_of_mass"], "{x}");
        }
        for mesh in [vec![], vec![b' '; 101]] {
            let request = v1::CreateObjectRequest { mesh, ..valid() };
            assert_eq!(fields_of_violations(request), ["mesh"]);
        }
        for (mesh, obj) in [(vec![b' '], vec![b' ']), (vec![], vec![b' '; 101])] {
            let request = v1::CreateObjectRequest { mesh, obj, ..valid() };
            assert_eq!(fields_of_violations(request), ["obj"]);
        }
        let request = v1::CreateObjectRequest {
            up_axis: 9,
            ..valid()
        };
        assert_eq!(fields_of_violations(request), ["up_axis"]);
        let all = v1::CreateObjectRequest::default();
        assert_eq!(fields_of_violations(all), ["object_id", "mesh", "mass_kg"]);
    }

    #[test]
    fn names_consist_of_collection_and_id() {
        let mut violations = Violations::default();
        let field = Field::root("name");
        assert_eq!(
            object_id_of(field, "objects/remote", &mut violations).as_deref(),
            Some("remote")
        );
        for name in [
            "",
            "remote",
            "objects/",
            "objects/Remote",
            "objects/a/b",
            "hands/remote",
        ] {
            assert_eq!(object_id_of(field, name, &mut violations), None, "{name}");
        }
        assert_eq!(violations.len(), 6);
    }
}
