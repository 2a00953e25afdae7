//! The parsers of what clients send and files contain, for fuzz targets: only with `--cfg fuzzing`.

use std::{sync::LazyLock, time::Instant};

use grasp_import::MeshLimits;
use grasp_proto::{
    codec::decoded,
    v1::{self, track_holdout_request::Message as OfTrack, upload_object_request::Part},
};
use grasp_synthesis::base::stop::Stop;
use prost::{Message, Name};
use tonic::Status;

use crate::{
    access::{Owner, Tokens},
    connect::{BYTES_OF_VALUE, protobuf},
    error::ServiceError,
    limits::MAX_FIND_REQUEST,
    methods::message,
    objects::{
        StoredObject,
        build::{build_object, changed},
        directory::read_manifest,
        saved::SavedObject,
    },
    rigs::store::{RigStore, request_of},
    saved::names_of,
    services::build_rig,
    validate::{
        Field, Violations, evaluate_query, find_query, object_fields, object_id_of, page_query, rig_fields,
        rig_id_of, rig_page_query, saved_object_fields, stream_query, track_query, update_query,
        upload_query, validate_query, watch_query,
    },
};

/// A usual server's bounds on meshes.
pub const MESH_LIMITS: MeshLimits = MeshLimits {
    bytes: 64 << 20,
    vertices: 200_000,
    triangles: 200_000,
};

/// Decodes a message and checks it as its method does.
type Check = fn(&[u8]);

/// The requests' messages, by name.
const REQUESTS: [(&str, Check); 18] = [
    ("FindGraspRequest", |sent| {
        check(sent, |sent| find_query(sent, rigs(), exists))
    }),
    ("StreamGraspsRequest", |sent| {
        check(sent, |sent| stream_query(sent, rigs(), exists))
    }),
    ("ValidateGraspRequest", |sent| {
        check(sent, |sent| validate_query(sent, rigs(), exists))
    }),
    ("EvaluateHoldoutRequest", |sent| {
        check(sent, |sent| evaluate_query(sent, rigs(), exists))
    }),
    ("TrackHoldoutRequest", |sent| check(sent, part_of_track)),
    ("Track", |sent| {
        check(sent, |track| track_query(track, true, rigs(), exists))
    }),
    ("TrackFrame", |sent| check(sent, frame)),
    ("CreateObjectRequest", |sent| check(sent, create_object)),
    ("UploadObjectRequest", |sent| check(sent, upload_part)),
    ("UpdateObjectRequest", |sent| check(sent, update_object)),
    ("ListObjectsRequest", |sent| check(sent, |sent| page_query(&sent))),
    ("WatchObjectsRequest", |sent| {
        check(sent, |sent| watch_query(&sent))
    }),
    ("GetObjectRequest", |sent| {
        check(sent, |sent: v1::GetObjectRequest| id(&sent.name, object_id_of))
    }),
    ("GetMeshRequest", |sent| {
        check(sent, |sent: v1::GetMeshRequest| id(&sent.name, object_id_of))
    }),
    ("DeleteObjectRequest", |sent| {
        check(sent, |sent: v1::DeleteObjectRequest| id(&sent.name, object_id_of))
    }),
    ("CreateRigRequest", |sent| check(sent, create_rig)),
    ("ListRigsRequest", |sent| {
        check(sent, |sent| rig_page_query(&sent))
    }),
    ("GetRigRequest", |sent| {
        check(sent, |sent: v1::GetRigRequest| id(&sent.name, rig_id_of))
    }),
];

/// The names of the requests' messages, whose places other functions take.
pub fn request_names() -> impl Iterator<Item = &'static str> {
    REQUESTS.iter().map(|(name, _)| *name)
}

/// Decodes a message of a request, checks it, and makes the answer if it is refused.
pub fn read_request(place: usize, message: &[u8]) {
    REQUESTS[place % REQUESTS.len()].1(message);
}

/// The message of a request in JSON.
///
/// # Errors
/// The answer to a request that is refused.
pub fn message_of_json(place: usize, text: &[u8]) -> Result<Vec<u8>, Status> {
    let (name, _) = REQUESTS[place % REQUESTS.len()];
    let descriptor = message(&format!("grasp.v1.{name}")).expect("the contract has it");
    Ok(protobuf(&descriptor, text, MAX_FIND_REQUEST / BYTES_OF_VALUE)?)
}

/// Reads the file of a saved object with this id, without its hash.
pub fn read_saved_object(id: &str, record: &[u8]) {
    if let Ok(saved) = SavedObject::from_message(id, record) {
        let _ = (saved.record(), saved.request_key(), saved.mesh_hash());
        let violations = Violations::default();
        let fields = saved_object_fields(saved.given(), TETRAHEDRON.to_vec(), &violations);
        let _ = build_object(&fields, MESH_LIMITS, violations, Stop::NEVER);
    }
}

/// Reads the file of a saved rig, without its hash.
pub fn read_saved_rig(record: &[u8]) {
    if let Some(request) = request_of(record) {
        let _ = create_rig(request);
    }
}

/// Reads the file of the names of all that is saved, without its hash.
pub fn read_saved_names(record: &[u8]) {
    names_of(record);
}

/// Reads a file of tokens.
pub fn read_tokens(text: &str) {
    let _ = Tokens::parse(text, &Tokens::default());
}

/// Reads an object's manifest.
pub fn read_object_manifest(text: &[u8]) {
    let violations = Violations::default();
    if let Some(object) = read_manifest("mug", text, &violations) {
        let mut request = v1::CreateObjectRequest::new("mug", TETRAHEDRON, 1.0);
        request.object = Some(object);
        let _ = create_object(request);
    }
}

fn check<M: Message + Name + Default, T>(bytes: &[u8], check: impl FnOnce(M) -> Result<T, ServiceError>) {
    if let Ok(sent) = decoded(bytes) {
        let _ = check(sent).map_err(refuse);
    }
}

/// Makes the answer to a wrong request, whose texts quote it.
fn refuse(error: ServiceError) {
    let _ = Status::from(error);
}

fn rigs() -> (&'static str, &'static RigStore) {
    static RIGS: LazyLock<RigStore> = LazyLock::new(|| RigStore::new(0, None));
    ("adult", &RIGS)
}

fn exists(id: &str) -> bool {
    id == "mug"
}

fn id(name: &str, read: impl FnOnce(Field<'_>, &str) -> Option<String>) -> Result<String, ServiceError> {
    let violations = Violations::default();
    let id = read(violations.field("name"), name);
    id.ok_or_else(|| violations.into_error())
}

fn part_of_track(sent: v1::TrackHoldoutRequest) -> Result<(), ServiceError> {
    match sent.message {
        Some(OfTrack::Track(track)) => track_query(track, false, rigs(), exists).map(drop),
        Some(OfTrack::Frame(sent)) => frame(sent),
        None => Ok(()),
    }
}

/// Checks a frame twice: what hands miss is taken from the frame before.
fn frame(frame: v1::TrackFrame) -> Result<(), ServiceError> {
    let track = v1::Track {
        holdout: Some(v1::Holdout::new("objects/mug")),
        ..Default::default()
    };
    let mut intake = track_query(track, false, rigs(), exists)?.intake;
    let arrived = Instant::now();
    intake.check(frame.clone(), arrived, rigs(), exists)?;
    intake.check(frame, arrived, rigs(), exists).map(drop)
}

fn create_object(request: v1::CreateObjectRequest) -> Result<StoredObject, ServiceError> {
    let violations = Violations::default();
    let fields = object_fields(request, MESH_LIMITS.bytes, &violations);
    build_object(&fields, MESH_LIMITS, violations, Stop::NEVER)
}

fn upload_part(sent: v1::UploadObjectRequest) -> Result<(), ServiceError> {
    match sent.part {
        Some(Part::Create(request)) => upload_query(request, sent.total_bytes, MESH_LIMITS.bytes).map(drop),
        _ => Ok(()),
    }
}

fn update_object(request: v1::UpdateObjectRequest) -> Result<(), ServiceError> {
    static STORED: LazyLock<StoredObject> = LazyLock::new(|| {
        let request = v1::CreateObjectRequest::new("mug", TETRAHEDRON, 1.0);
        create_object(request).expect("the tetrahedron is sound")
    });
    let query = update_query(request)?;
    changed(&STORED, &query.change).map(drop)
}

fn create_rig(request: v1::CreateRigRequest) -> Result<(), ServiceError> {
    let violations = Violations::default();
    let fields = rig_fields(request, MESH_LIMITS.bytes, &violations);
    build_rig(fields, Owner::default(), MESH_LIMITS, violations).map(drop)
}

/// A mesh of two groups.
const TETRAHEDRON: &[u8] = b"v 0 0 0
v .1 0 0
v 0 .1 0
v 0 0 .1
g sides
f 1 2 4
f 2 3 4
f 1 4 3
g base
f 1 3 2
";
