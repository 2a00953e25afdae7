//! Checks object names, and all fields of a new or changed object but its mesh.

use glam::Vec3;
use grasp_import::{Import, UpAxis};
use grasp_proto::v1;
use prost::Message as _;
use sha2::{Digest as _, Sha256};
use uuid::Uuid;

use super::{
    Field, GripFields, Labels, RegionFields, Violations, friction,
    known_grips::known_grips,
    labels::labels,
    obstacles::required,
    point, quoted,
    regions::{check_extent_of_regions, regions},
};

/// Prefix of every object's name.
pub(crate) const COLLECTION: &str = "objects/";

/// The field of a request that has the object.
pub(crate) static OBJECT: Field<'static> = Field::root("object");

/// Largest number of characters in an object's id.
pub(super) const LONGEST_ID: usize = 63;

/// What an id must be, in words.
pub(crate) const ID_RULE: &str = "1 to 63 of a-z, 0-9 and -, starting with a letter";

/// Largest mass of an object in kilograms: more than anyone can hold out.
const LARGEST_MASS: f32 = 1000.0;

/// Most names of parts of a file.
const MAX_PARTS: usize = 64;

/// Allowed lengths of a mesh's unit, in metres: a micrometre to a kilometre.
const UNIT_RANGE: std::ops::RangeInclusive<f32> = 1e-6..=1e3;

/// The checked fields of a new object, with its unread mesh.
#[derive(Debug, Default)]
pub(crate) struct ObjectFields {
    /// The last part of its name.
    pub id: String,
    /// The mesh as the content of a file.
    pub mesh: Vec<u8>,
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
    /// Parts of the surface that hands should take, leave, or not touch.
    pub regions: Vec<RegionFields>,
    /// Grips to try first, or not to answer.
    pub known_grips: Vec<GripFields>,
    /// Labels.
    pub labels: Labels,
    /// What identifies the request, if it may be repeated.
    pub request: Option<RequestKey>,
}

/// Identifies a request to create an object, so that it can be repeated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct RequestKey {
    /// The client's id of the request.
    pub id: Uuid,
    /// SHA-256 of everything else in it that counts.
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
                format!("is required: {collection} and {what}, {ID_RULE}")
            } else {
                format!(
                    "is {}; it must be {collection} and {what}, {ID_RULE}",
                    quoted(name)
                )
            },
        );
    }
    id.map(str::to_owned)
}

/// Checks the fields of a new object. Reading the mesh adds its own violations later. If the request may be repeated, this
/// hashes the mesh, which takes milliseconds.
pub(crate) fn object_fields(
    request: v1::CreateObjectRequest,
    maximum_bytes: usize,
    violations: &mut Violations,
) -> ObjectFields {
    let v1::CreateObjectRequest {
        object,
        mesh,
        request_id,
    } = request;
    let Some(object) = required(OBJECT, object, violations) else {
        return ObjectFields::default();
    };
    let request = request_key(&request_id, &object, &mesh, violations);
    if mesh.is_empty() {
        violations.add(
            Field::root("mesh"),
            "is empty; the mesh is required as GLB, glTF, OBJ, PLY or STL",
        );
    } else if mesh.len() > maximum_bytes {
        violations.add(
            Field::root("mesh"),
            format_args!("has {} bytes; the limit is {maximum_bytes}", mesh.len()),
        );
    }
    ObjectFields {
        mesh,
        request,
        ..fields_beside_mesh(object, violations)
    }
}

/// The fields of an object that was saved. What is limited in requests only is not limited here.
pub(crate) fn saved_object_fields(
    object: v1::GraspObject,
    mesh: Vec<u8>,
    violations: &mut Violations,
) -> ObjectFields {
    ObjectFields {
        mesh,
        ..unbounded_fields(object, violations)
    }
}

/// Checks everything in a request for a new object but its mesh.
pub(super) fn check_beside_mesh(request: &v1::CreateObjectRequest, violations: &mut Violations) {
    if let Some(object) = required(OBJECT, request.object.as_ref(), violations) {
        request_key(&request.request_id, object, &[], violations);
        fields_beside_mesh(object.clone(), violations);
    }
}

/// The fields of a new object without its mesh.
fn fields_beside_mesh(object: v1::GraspObject, violations: &mut Violations) -> ObjectFields {
    let regions = OBJECT.child("regions");
    if check_extent_of_regions(regions, &object.regions, violations) {
        unbounded_fields(object, violations)
    } else {
        let regions = Vec::new();
        unbounded_fields(v1::GraspObject { regions, ..object }, violations)
    }
}

/// The same, however much its regions mark.
fn unbounded_fields(object: v1::GraspObject, violations: &mut Violations) -> ObjectFields {
    let id = object_id_of(OBJECT.child("name"), &object.name, violations);
    let unit_metres = unit_metres(object.meters_per_unit, violations);
    check_mass(OBJECT.child("mass_kg"), object.mass_kg, violations);
    let centre_of_mass = object
        .center_of_mass
        .map(|v| point(OBJECT.child("center_of_mass"), v, 1.0, violations));
    let friction = object
        .friction
        .map(|value| friction(OBJECT.child("friction"), value, violations));
    labels(OBJECT.child("labels"), &object.labels, violations);
    if object.parts.len() > MAX_PARTS {
        violations.add(
            OBJECT.child("parts"),
            format_args!(
                "has {} names; at most {MAX_PARTS} are allowed",
                object.parts.len()
            ),
        );
    }
    let regions = regions(OBJECT.child("regions"), object.regions, violations);
    let known_grips = known_grips(OBJECT.child("known_grips"), object.known_grips, violations);
    ObjectFields {
        id: id.unwrap_or_default(),
        mesh: Vec::new(),
        import: Import {
            unit_metres,
            up_axis: if object.z_up { UpAxis::Z } else { UpAxis::Y },
        },
        parts: object.parts,
        mass: object.mass_kg,
        centre_of_mass,
        friction,
        regions,
        known_grips,
        labels: object.labels,
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
                OBJECT.child("meters_per_unit"),
                format_args!("is {unit}; it must be {least} to {most}"),
            );
            1.0
        }
    }
}

/// What identifies a request; none without an id.
fn request_key(
    id: &str,
    object: &v1::GraspObject,
    mesh: &[u8],
    violations: &mut Violations,
) -> Option<RequestKey> {
    if id.is_empty() {
        return None;
    }
    let Ok(id) = Uuid::try_parse(id) else {
        violations.add(
            Field::root("request_id"),
            format_args!(
                "is {}; it must be a UUID like 3f2a9c1e-8d57-4b06-9e1b-5a70c4d2f683",
                quoted(id)
            ),
        );
        return None;
    };
    let mut hash = Sha256::new();
    hash.update(Sha256::digest(written(object).encode_to_vec()));
    hash.update(mesh);
    Some(RequestKey {
        id,
        content: hash.finalize().into(),
    })
}

/// An object without what only the server writes.
fn written(object: &v1::GraspObject) -> v1::GraspObject {
    v1::GraspObject {
        etag: String::new(),
        built_in: false,
        triangle_count: 0,
        forbidden_triangle_count: 0,
        bounding_box: None,
        content_hash: String::new(),
        warnings: Vec::new(),
        origin_in_file: Vec::new(),
        create_time: None,
        update_time: None,
        ..object.clone()
    }
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
            mass,
            ..Self::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::ServiceError;

    fn valid() -> v1::CreateObjectRequest {
        v1::CreateObjectRequest::new("mug-1", b"v 0 0 0", 0.3)
    }

    /// The valid request with a change of its object.
    fn with(change: impl FnOnce(&mut v1::GraspObject)) -> v1::CreateObjectRequest {
        let mut request = valid();
        change(request.object_mut());
        request
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
        assert_eq!(fields.id, "mug-1");
    }

    #[test]
    fn reports_every_violation_by_field() {
        for id in ["", "1mug", "Mug", "mug_1", "mug/1", "mög", &"m".repeat(64)] {
            let request = with(|object| object.name = format!("objects/{id}"));
            assert_eq!(fields_of_violations(request), ["object.name"], "{id}");
        }
        for mass_kg in [0.0, -1.0, f32::NAN, f32::INFINITY, 1001.0] {
            let request = with(|object| object.mass_kg = mass_kg);
            assert_eq!(fields_of_violations(request), ["object.mass_kg"], "{mass_kg}");
        }
        for friction in [0.0, -0.1, 5.1, f32::NAN, f32::INFINITY] {
            let request = with(|object| object.friction = Some(friction));
            assert_eq!(fields_of_violations(request), ["object.friction"], "{friction}");
        }
        for unit in [0.0, -1.0, f32::NAN, f32::INFINITY, 1e4, 1e-9] {
            let request = with(|object| object.meters_per_unit = Some(unit));
            assert_eq!(
                fields_of_violations(request),
                ["object.meters_per_unit"],
                "{unit}"
            );
        }
        for x in [f32::NAN, f32::NEG_INFINITY, 2000.0] {
            let request = with(|object| object.center_of_mass = Some((Vec3::X * x).into()));
            assert_eq!(fields_of_violations(request), ["object.center_of_mass"], "{x}");
        }
        for mesh in [vec![], vec![b' '; 101]] {
            let request = v1::CreateObjectRequest { mesh, ..valid() };
            assert_eq!(fields_of_violations(request), ["mesh"]);
        }
        let request = v1::CreateObjectRequest {
            request_id: "1234".into(),
            ..with(|object| object.labels = [("K".to_owned(), String::new())].into())
        };
        assert_eq!(fields_of_violations(request), ["request_id", "object.labels"]);
        let all = v1::CreateObjectRequest {
            object: Some(v1::GraspObject::default()),
            ..Default::default()
        };
        assert_eq!(
            fields_of_violations(all),
            ["mesh", "object.name", "object.mass_kg"]
        );
        let all = v1::CreateObjectRequest::default();
        assert_eq!(fields_of_violations(all), ["object"]);
    }

    #[test]
    fn a_saved_object_may_have_more_regions_than_a_new_one() {
        let regions = |count: usize| -> Vec<v1::Region> {
            let region = |number: usize| v1::Region {
                triangles: vec![0],
                ..v1::Region::new(number.to_string(), v1::Preference::Forbidden)
            };
            (0..count).map(region).collect()
        };
        let request = with(|object| object.regions = regions(33));
        let object = request.object.clone().unwrap();
        assert_eq!(fields_of_violations(request), ["object.regions"]);
        let mut violations = Violations::default();
        let fields = saved_object_fields(object, Vec::new(), &mut violations);
        assert!(violations.is_empty() && fields.regions.len() == 33);
    }

    #[test]
    fn a_request_is_identified_by_its_id_and_fields() {
        let key = |request: v1::CreateObjectRequest| {
            let mut violations = Violations::default();
            let fields = object_fields(request, 100, &mut violations);
            assert!(violations.is_empty());
            fields.request
        };
        let with_id = |change: fn(&mut v1::GraspObject)| v1::CreateObjectRequest {
            request_id: "3f2a9c1e-8d57-4b06-9e1b-5a70c4d2f683".into(),
            ..with(|object| {
                object.labels = [("a".to_owned(), "b".to_owned()), ("c".to_owned(), "d".to_owned())].into();
                change(object);
            })
        };
        assert_eq!(key(valid()), None);
        let [first, second] = [key(with_id(|_| {})), key(with_id(|_| {}))];
        assert!(first.is_some() && first == second);
        assert_ne!(key(with_id(|object| object.mass_kg = 0.4)), first);
        // What only the server writes does not count.
        assert_eq!(key(with_id(|object| object.triangle_count = 4)), first);
        let other_mesh = v1::CreateObjectRequest {
            mesh: b"v 0 0 1".to_vec(),
            ..with_id(|_| {})
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
