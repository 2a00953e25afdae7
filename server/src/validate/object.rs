//! Checks object names, and all fields of a new or changed object but its mesh.

use glam::Vec3;
use grasp_import::{Import, UpAxis};
use grasp_proto::v1;
use prost::Message as _;
use sha2::{Digest as _, Sha256};
use uuid::Uuid;

use super::{
    Field, GripFields, Labels, RegionFields, Violations, friction, known_grips::known_grips, labels::labels,
    point, quoted, regions::regions,
};

/// Prefix of every object's name.
const COLLECTION: &str = "objects/";

/// Largest number of characters in an object's id.
pub(super) const LONGEST_ID: usize = 63;

/// Largest mass of an object in kilograms: more than anyone can hold out.
const LARGEST_MASS: f32 = 1000.0;

/// Most names of parts of a file.
const MAX_PARTS: usize = 64;

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
    /// The names of the file's parts that are the object; none for those that are seen.
    pub parts: Vec<String>,
    /// Mass in kilograms.
    pub mass: f32,
    /// Centre of mass in metres, in the object's frame; none to compute it.
    pub centre_of_mass: Option<Vec3>,
    /// Coefficient of static friction, if given.
    pub friction: Option<f32>,
    /// Surfaces that must not be touched.
    pub forbidden: Forbidden,
    /// Parts of the surface that hands should take, leave, or not touch.
    pub regions: Vec<RegionFields>,
    /// Grips to try first, or not to answer.
    pub known_grips: Vec<GripFields>,
    /// Labels.
    pub labels: Labels,
    /// What identifies the request, if it may be repeated.
    pub request: Option<RequestKey>,
}

/// Surfaces that must not be touched, as a client names them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Forbidden {
    /// Named parts of the mesh.
    pub groups: Vec<String>,
    /// Triangles of the file.
    pub triangles: Vec<u32>,
}

impl From<v1::ForbiddenSurfaces> for Forbidden {
    fn from(surfaces: v1::ForbiddenSurfaces) -> Self {
        let v1::ForbiddenSurfaces { groups, triangles } = surfaces;
        Self { groups, triangles }
    }
}

/// Identifies a request to create an object, so that it can be repeated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct RequestKey {
    /// The client's id of the request.
    pub id: Uuid,
    /// SHA-256 of everything else in it.
    pub content: [u8; 32],
}

/// The id of a name like `objects/remote`.
pub(crate) fn object_id_of(field: Field<'_>, name: &str, violations: &mut Violations) -> Option<String> {
    id_in(COLLECTION, "the object's id", field, name, violations)
}

/// The id, described by `what`, of a name in a collection.
pub(super) fn id_in(
    collection: &str,
    what: &str,
    field: Field<'_>,
    name: &str,
    violations: &mut Violations,
) -> Option<String> {
    let id = name.strip_prefix(collection).filter(|id| is_object_id(id));
    if id.is_none() {
        violations.add(
            field,
            if name.is_empty() {
                format!("is required: {collection} and {what}")
            } else {
                format!("is {}; it must be {collection} and {what}", quoted(name))
            },
        );
    }
    id.map(str::to_owned)
}

/// Checks the fields of a new object. Reading the mesh adds its own violations later. If the request may be repeated, this
/// hashes the mesh, which takes milliseconds.
pub(crate) fn object_fields(
    mut request: v1::CreateObjectRequest,
    maximum_bytes: usize,
    violations: &mut Violations,
) -> ObjectFields {
    let (mesh, obj) = (
        std::mem::take(&mut request.mesh),
        std::mem::take(&mut request.obj),
    );
    let request_key = request_key(
        &mut request,
        if mesh.is_empty() { &obj } else { &mesh },
        violations,
    );
    check_id(&request.object_id, violations);
    let (mesh_field, mesh) = given_mesh(mesh, obj, maximum_bytes, violations);
    ObjectFields {
        mesh,
        mesh_field,
        request: request_key,
        ..fields_beside_mesh(request, violations)
    }
}

/// Checks everything in a request for a new object but its mesh.
pub(super) fn check_beside_mesh(request: &v1::CreateObjectRequest, violations: &mut Violations) {
    request_key(&mut request.clone(), &[], violations);
    check_id(&request.object_id, violations);
    fields_beside_mesh(request.clone(), violations);
}

fn check_id(id: &str, violations: &mut Violations) {
    if !is_object_id(id) {
        violations.add(
            Field::root("object_id"),
            format_args!(
                "is {}; it must be 1 to {LONGEST_ID} of a-z, 0-9 and -, starting with a letter",
                quoted(id)
            ),
        );
    }
}

/// The mesh, from the one of two fields that has it.
fn given_mesh(
    mesh: Vec<u8>,
    obj: Vec<u8>,
    maximum_bytes: usize,
    violations: &mut Violations,
) -> (&'static str, Vec<u8>) {
    let (mesh_field, mesh) = match (mesh, obj) {
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
    (mesh_field, mesh)
}

/// The fields of a new object without its mesh.
fn fields_beside_mesh(request: v1::CreateObjectRequest, violations: &mut Violations) -> ObjectFields {
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
    let unit_metres = unit_metres(request.unit_metres, violations);
    check_mass(Field::root("mass_kg"), request.mass_kg, violations);
    let centre_of_mass = request
        .centre_of_mass
        .map(|v| point(Field::root("centre_of_mass"), v, 1.0, violations));
    let friction = request
        .friction
        .map(|value| friction(Field::root("friction"), value, violations));
    labels(Field::root("labels"), &request.labels, violations);
    if request.parts.len() > MAX_PARTS {
        violations.add(
            Field::root("parts"),
            format_args!(
                "has {} names; at most {MAX_PARTS} are allowed",
                request.parts.len()
            ),
        );
    }
    let regions = regions(Field::root("regions"), request.regions, violations);
    let known_grips = known_grips(Field::root("known_grips"), request.known_grips, violations);
    ObjectFields {
        id: request.object_id,
        mesh: Vec::new(),
        mesh_field: "mesh",
        import: Import { unit_metres, up_axis },
        parts: request.parts,
        mass: request.mass_kg,
        centre_of_mass,
        friction,
        forbidden: request.forbidden.unwrap_or_default().into(),
        regions,
        known_grips,
        labels: request.labels,
        request: None,
    }
}

/// Metres per unit of a mesh; 1 if the unit is absent or wrong, so that the mesh is still read, to find its violations too.
pub(super) fn unit_metres(given: Option<f32>, violations: &mut Violations) -> f32 {
    match given {
        None => 1.0,
        Some(unit) if UNIT_RANGE.contains(&unit) => unit,
        Some(unit) => {
            let [least, most] = [UNIT_RANGE.start(), UNIT_RANGE.end()];
            violations.add(
                Field::root("unit_metres"),
                format_args!("is {unit}; it must be {least} to {most}"),
            );
            1.0
        }
    }
}

/// Takes the id out of a request whose mesh was taken out, and identifies the request by it; none without an id.
fn request_key(
    request: &mut v1::CreateObjectRequest,
    mesh: &[u8],
    violations: &mut Violations,
) -> Option<RequestKey> {
    let id = std::mem::take(&mut request.request_id);
    if id.is_empty() {
        return None;
    }
    let Ok(id) = Uuid::try_parse(&id) else {
        violations.add(
            Field::root("request_id"),
            format_args!(
                "is {}; it must be a UUID like 3f2a9c1e-8d57-4b06-9e1b-5a70c4d2f683",
                quoted(&id)
            ),
        );
        return None;
    };
    let mut hash = Sha256::new();
    hash.update(Sha256::digest(request.encode_to_vec()));
    hash.update(mesh);
    Some(RequestKey {
        id,
        content: hash.finalize().into(),
    })
}

/// Checks a mass.
pub(super) fn check_mass(field: Field<'_>, mass_kg: f32, violations: &mut Violations) {
    if !(mass_kg > 0.0 && mass_kg <= LARGEST_MASS) {
        violations.add(
            field,
            format_args!("is {mass_kg}; it must be more than 0 and at most {LARGEST_MASS}"),
        );
    }
}

/// True for the last part of an object's or a rig's name.
pub(super) fn is_object_id(id: &str) -> bool {
    id.len() <= LONGEST_ID
        && id.starts_with(|c: char| c.is_ascii_lowercase())
        && id
            .bytes()
            .all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'-')
}

#[cfg(test)]
impl ObjectFields {
    /// Fields without a mesh, for tests to complete.
    pub(crate) fn named(id: &str, mass: f32) -> Self {
        Self {
            id: id.to_owned(),
            mesh: Vec::new(),
            mesh_field: "mesh",
            import: Import::METRES,
            parts: Vec::new(),
            mass,
            centre_of_mass: None,
            friction: None,
            forbidden: Forbidden::default(),
            regions: Vec::new(),
            known_grips: Vec::new(),
            labels: Labels::new(),
            request: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::ServiceError;

    fn valid() -> v1::CreateObjectRequest {
        v1::CreateObjectRequest {
            object_id: "mug-1".into(),
            mesh: b"v 0 0 0".to_vec(),
            mass_kg: 0.3,
            ..Default::default()
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
        let request = v1::CreateObjectRequest {
            request_id: "1234".into(),
            labels: [("K".to_owned(), String::new())].into(),
            ..valid()
        };
        assert_eq!(fields_of_violations(request), ["request_id", "labels"]);
        let all = v1::CreateObjectRequest::default();
        assert_eq!(fields_of_violations(all), ["object_id", "mesh", "mass_kg"]);
    }

    #[test]
    fn a_request_is_identified_by_its_id_and_fields() {
        let key = |request: v1::CreateObjectRequest| {
            let mut violations = Violations::default();
            let fields = object_fields(request, 100, &mut violations);
            assert!(violations.is_empty());
            fields.request
        };
        let with_id = || v1::CreateObjectRequest {
            request_id: "3f2a9c1e-8d57-4b06-9e1b-5a70c4d2f683".into(),
            labels: [("a".to_owned(), "b".to_owned()), ("c".to_owned(), "d".to_owned())].into(),
            ..valid()
        };
        assert_eq!(key(valid()), None);
        let [first, second] = [key(with_id()), key(with_id())];
        assert!(first.is_some() && first == second);
        let heavier = v1::CreateObjectRequest {
            mass_kg: 0.4,
            ..with_id()
        };
        assert_ne!(key(heavier), first);
        let other_mesh = v1::CreateObjectRequest {
            mesh: b"v 0 0 1".to_vec(),
            ..with_id()
        };
        assert_ne!(key(other_mesh), first);
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
