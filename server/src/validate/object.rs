//! Checks object names, and all fields of a new or changed object but its mesh.

use std::{collections::BTreeMap, ops::RangeInclusive};

use glam::Vec3;
use grasp_import::{Import, UpAxis};
use grasp_proto::v1;
use prost::Message as _;
use sha2::{Digest as _, Sha256};
use uuid::Uuid;

use super::{
    Field, GripFields, RegionFields, Violations, check_count, check_positive, check_within, factor, friction,
    point, quoted,
    regions::{bounded_regions, known_grips, regions},
    required,
};
use crate::{convention::Convention, error::ServiceError};

pub(crate) const COLLECTION: &str = "objects/";
pub(super) const MAX_ID: usize = 63;
pub(crate) const ID_RULE: &str = "1 to 63 of a-z, 0-9 and -, starting with a letter";

/// Largest mass of an object in kilograms: more than anyone can hold out.
pub(super) const MAX_MASS: f32 = 1000.0;
const MAX_PARTS: usize = 64;

/// Allowed lengths of a mesh's unit, in metres: a micrometre to a kilometre.
pub(super) const UNIT_RANGE: RangeInclusive<f32> = 1e-6..=1e3;
const MAX_LABELS: usize = 16;

/// Largest number of bytes in a label's key, and in its value.
const MAX_LABEL: usize = 63;

pub(crate) type Labels = BTreeMap<String, String>;

#[derive(Debug, Default)]
pub(crate) struct ObjectFields {
    pub id: String,
    pub mesh: Vec<u8>,
    pub import: Import,
    /// The names of the file's parts that are the object; empty for all visible ones.
    pub parts: Vec<String>,
    pub mass: f32,
    /// Centre of mass in metres, in the object's frame; `None` to compute it.
    pub centre_of_mass: Option<Vec3>,
    pub friction: Option<f32>,
    /// Parts of the surface that hands should take, leave, or not touch.
    pub regions: Vec<RegionFields>,
    /// Grips to try first, or not to answer.
    pub known_grips: Vec<GripFields>,
    pub labels: Labels,
    pub request: Option<RequestKey>,
}

/// Identifies a request to create an object, so that it can be repeated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct RequestKey {
    pub id: Uuid,
    /// SHA-256 of everything else in it that counts.
    pub content: [u8; 32],
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct UploadQuery {
    pub request: v1::CreateObjectRequest,
    pub bytes: usize,
}

pub(crate) fn object_id_of(field: Field<'_>, name: &str) -> Option<String> {
    id_in(COLLECTION, "the object's id", field, name)
}

/// The id, described by `what`, of a name in a collection.
pub(super) fn id_in(collection: &str, what: &str, field: Field<'_>, name: &str) -> Option<String> {
    let rule = || format!("{collection} and {what}, {ID_RULE}");
    match name.strip_prefix(collection).filter(|id| is_object_id(id)) {
        Some(id) => Some(id.to_owned()),
        None if name.is_empty() => field.reject(format_args!("is required: {}", rule())),
        None => field.reject(format_args!("is {}; it must be {}", quoted(name), rule())),
    }
}

pub(super) fn labels(field: Field<'_>, labels: &Labels) {
    check_count(field, labels.len(), MAX_LABELS, "labels");
    for (key, value) in labels {
        let is_key = (1..=MAX_LABEL).contains(&key.len()) && key.chars().all(is_key_character);
        if !is_key {
            field.add(format_args!(
                "has the key {}; it must be 1 to {MAX_LABEL} of a-z, 0-9, -, _, . and /",
                quoted(key)
            ));
        }
        if value.len() > MAX_LABEL || value.chars().any(char::is_control) {
            field.add(format_args!(
                "has the value {} of {}; it must be at most {MAX_LABEL} bytes without control characters",
                quoted(value),
                quoted(key)
            ));
        }
    }
}

pub(super) fn is_key_character(c: char) -> bool {
    c.is_ascii_lowercase() || c.is_ascii_digit() || matches!(c, '-' | '_' | '.' | '/')
}

/// Checks the fields of a new object. Reading the mesh adds its own violations later. If the request may be repeated, this
/// hashes the mesh, which takes milliseconds.
pub(crate) fn object_fields(
    request: v1::CreateObjectRequest,
    maximum_bytes: usize,
    violations: &Violations,
) -> ObjectFields {
    let v1::CreateObjectRequest {
        object,
        mesh,
        request_id,
    } = request;
    let field = violations.field("object");
    let Some(object) = required(field, object) else {
        return ObjectFields::default();
    };
    let request = request_key(&request_id, &object, &mesh, violations);
    let (mesh_field, bytes) = (violations.field("mesh"), mesh.len());
    let text = "is empty; the mesh is required as GLB, glTF, OBJ, PLY or STL";
    mesh_field.check(bytes > 0, text);
    let text = format_args!("has {bytes} bytes; the limit is {maximum_bytes}");
    mesh_field.check(bytes <= maximum_bytes, text);
    ObjectFields {
        mesh,
        request,
        ..fields_beside_mesh(field, object)
    }
}

/// The fields of an object that was saved. Limits of requests do not hold here.
pub(crate) fn saved_object_fields(
    object: v1::GraspObject,
    mesh: Vec<u8>,
    violations: &Violations,
) -> ObjectFields {
    ObjectFields {
        mesh,
        ..unbounded_fields(violations.field("object"), object)
    }
}

pub(crate) fn upload_query(
    request: v1::CreateObjectRequest,
    total_bytes: u64,
    maximum_bytes: usize,
) -> Result<UploadQuery, ServiceError> {
    let violations = Violations::default();
    let text = "must be empty; the mesh follows in pieces";
    violations.field("mesh").check(request.mesh.is_empty(), text);
    let field = violations.field("object");
    if let Some(object) = required(field, request.object.as_ref()) {
        request_key(&request.request_id, object, &[], &violations);
        fields_beside_mesh(field, object.clone());
    }
    violations.move_path("", "create.");
    let bytes = usize::try_from(total_bytes).unwrap_or(usize::MAX);
    check_within(
        violations.field("total_bytes"),
        total_bytes,
        1..=maximum_bytes as u64,
    );
    violations.finish(UploadQuery { request, bytes })
}

fn fields_beside_mesh(field: Field<'_>, object: v1::GraspObject) -> ObjectFields {
    let regions = bounded_regions(field.child("regions"), object.regions);
    unbounded_fields(field, v1::GraspObject { regions, ..object })
}

fn unbounded_fields(field: Field<'_>, object: v1::GraspObject) -> ObjectFields {
    let id = object_id_of(field.child("name"), &object.name).unwrap_or_default();
    let unit_metres = factor(field.child("meters_per_unit"), object.meters_per_unit, UNIT_RANGE);
    check_positive(field.child("mass_kg"), object.mass_kg, MAX_MASS);
    let centre_of_mass = centre_of_mass(field, object.center_of_mass);
    let friction = friction(field.child("friction"), object.friction);
    labels(field.child("labels"), &object.labels);
    check_count(field.child("parts"), object.parts.len(), MAX_PARTS, "names");
    let regions = regions(field.child("regions"), object.regions);
    let known_grips = known_grips(field.child("known_grips"), object.known_grips);
    ObjectFields {
        id,
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

pub(super) fn centre_of_mass(field: Field<'_>, sent: Option<v1::Vector3>) -> Option<Vec3> {
    sent.map(|sent| point(field.child("center_of_mass"), sent, Convention::OpenXr))
}

/// The identity of a request; `None` without an id.
fn request_key(
    id: &str,
    object: &v1::GraspObject,
    mesh: &[u8],
    violations: &Violations,
) -> Option<RequestKey> {
    if id.is_empty() {
        return None;
    }
    let Ok(id) = Uuid::try_parse(id) else {
        return violations.field("request_id").reject(format_args!(
            "is {}; it must be a UUID like 3f2a9c1e-8d57-4b06-9e1b-5a70c4d2f683",
            quoted(id)
        ));
    };
    let mut hash = Sha256::new();
    hash.update(Sha256::digest(written(object).encode_to_vec()));
    hash.update(mesh);
    Some(RequestKey {
        id,
        content: hash.finalize().into(),
    })
}

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
        owner: String::new(),
        ..object.clone()
    }
}

pub(super) fn is_object_id(id: &str) -> bool {
    id.len() <= MAX_ID
        && id.starts_with(|c: char| c.is_ascii_lowercase())
        && id
            .bytes()
            .all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'-')
}

#[cfg(test)]
impl ObjectFields {
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
    use crate::validate::fixtures::{Change, SetNumber, assert_blamed, blamed, table, violations_of};

    fn valid() -> v1::CreateObjectRequest {
        v1::CreateObjectRequest::new("mug-1", b"v 0 0 0", 0.3)
    }

    fn with(change: impl FnOnce(&mut v1::GraspObject)) -> v1::CreateObjectRequest {
        let mut request = valid();
        change(request.object_mut());
        request
    }

    fn fields_of_violations(request: v1::CreateObjectRequest) -> Vec<String> {
        let violations = Violations::default();
        object_fields(request, 100, &violations);
        blamed(violations.finish(()))
    }

    const NUMBERS: &[SetNumber<v1::CreateObjectRequest>] = table! {
        "object.mass_kg", "and at most 1000", [0.0, -1.0, f32::NAN, f32::INFINITY, 1001.0]
            => |r, x| r.object_mut().mass_kg = x;
        "object.friction", "and at most 5", [0.0, -0.1, 5.1, f32::NAN] => |r, x| r.object_mut().friction = Some(x);
        "object.meters_per_unit", "it must be 0.000001 to 1000", [0.0, -1.0, f32::NAN, 1e4, 1e-9]
            => |r, x| r.object_mut().meters_per_unit = Some(x);
        "object.center_of_mass", "", [f32::NAN, f32::NEG_INFINITY, 2000.0]
            => |r, x| r.object_mut().center_of_mass = Some((Vec3::X * x).into());
    };

    const CHANGES: &[Change<v1::CreateObjectRequest>] = table! {
        "object", "is absent" => |r| r.object = None;
        "object.name", "is required" => |r| r.object_mut().name.clear();
        "object.parts", "has 65 names" => |r| r.object_mut().parts = vec![String::new(); 65];
        "object.labels", "has 17 labels" => |r| r.object_mut().labels = (10..27).map(|n| (n.to_string(), String::new())).collect();
        "mesh", "is empty" => |r| r.mesh.clear();
        "mesh", "has 101 bytes; the limit is 100" => |r| r.mesh = vec![b' '; 101];
        "request_id", "it must be a UUID" => |r| r.request_id = "1234".into();
    };

    #[test]
    fn every_field_of_an_object_is_checked() {
        assert_blamed(&valid(), NUMBERS, CHANGES, |request| {
            let violations = Violations::default();
            object_fields(request, 100, &violations);
            violations_of(violations.finish(()))
        });
        for id in ["", "1mug", "Mug", "mug_1", "mug/1", "mög", &"m".repeat(64)] {
            let request = with(|object| object.name = format!("objects/{id}"));
            assert_eq!(fields_of_violations(request), ["object.name"], "{id}");
        }
        let label = |key: &str, value: &str| {
            fields_of_violations(with(|object| {
                object.labels = [(key.to_owned(), value.to_owned())].into();
            }))
        };
        let long = ["k".repeat(63), "k".repeat(64), "é".repeat(32)];
        for (key, value) in [(&*long[0], &*long[0]), ("a/b_c.d-9", ""), ("owner", "Ada Ł.")] {
            assert_eq!(label(key, value), [""; 0]);
        }
        for (key, value) in [
            ("", "v"),
            ("Key", "v"),
            ("k y", "v"),
            ("k", "a\nb"),
            (&long[1], "v"),
            ("k", &long[2]),
        ] {
            assert_eq!(label(key, value), ["object.labels"], "{key} {value}");
        }
    }

    #[test]
    fn a_saved_object_may_have_more_regions_than_a_new_one() {
        let region = |number: usize| v1::Region {
            triangles: vec![0],
            ..v1::Region::new(number.to_string(), v1::Preference::Forbidden)
        };
        let request = with(|object| object.regions = (0..33).map(region).collect());
        let object = request.object.clone().unwrap();
        assert_eq!(fields_of_violations(request), ["object.regions"]);
        let violations = Violations::default();
        let fields = saved_object_fields(object, Vec::new(), &violations);
        assert!(violations.is_empty() && fields.regions.len() == 33);
    }

    #[test]
    fn a_request_is_identified_by_its_id_and_fields() {
        let key = |request| object_fields(request, 100, &Violations::default()).request;
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
        // Fields that only the server writes do not count.
        assert_eq!(key(with_id(|object| object.triangle_count = 4)), first);
        let other_mesh = v1::CreateObjectRequest {
            mesh: b"v 0 0 1".to_vec(),
            ..with_id(|_| {})
        };
        assert_ne!(key(other_mesh), first);
    }

    #[test]
    fn an_upload_blames_its_own_parts_and_keeps_a_valid_request() {
        let request = v1::CreateObjectRequest::new("Mug", b"v", -1.0);
        let fields = [
            "create.mesh",
            "create.object.name",
            "create.object.mass_kg",
            "total_bytes",
        ];
        assert_eq!(blamed(upload_query(request, 11, 10)), fields);
        let request = v1::CreateObjectRequest::new("mug", [], 0.3);
        let query = upload_query(request.clone(), 10, 10).unwrap();
        assert_eq!((query.request, query.bytes), (request, 10));
    }
}
