//! Objects that can be held out.

use std::{
    collections::BTreeMap,
    time::{Duration, SystemTime},
};

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

use crate::{json, known_grip::KnownGrip, pose::Pose, region::Region};

/// An object on the server.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Object {
    /// "objects/{object}".
    pub name: String,
    /// True for the objects that ship with the server.
    pub built_in: bool,
    /// Number of triangles.
    pub triangle_count: u32,
    /// Number of vertices.
    pub vertex_count: u32,
    /// Mass in kilograms.
    pub mass_kg: f32,
    /// Centre of mass in the object's frame, in metres.
    pub centre_of_mass: Vec3,
    /// Coefficient of static friction between skin and surface; `None` leaves it to the server.
    pub friction: Option<f32>,
    /// Number of triangles that must not be touched.
    pub forbidden_triangle_count: u32,
    /// The oriented bounding box: the box's frame in the object's frame.
    pub object_from_box: Pose,
    /// Half the edge lengths of the box along its axes, in metres.
    pub box_half_extents: Vec3,
    /// SHA-256 of the mesh used by searches, in hexadecimal.
    pub content_hash: String,
    /// Defects of the mesh that do not prevent its use.
    pub warnings: Vec<String>,
    /// The object's atlas for the right hand; none if the server keeps no atlases.
    #[serde(default)]
    pub atlas: Option<AtlasState>,
    /// The object's atlas for the left hand; none if the server keeps no atlases.
    #[serde(default)]
    pub left_atlas: Option<AtlasState>,
    /// Where the origin of the object's frame is in the mesh file, in the file's units and axes; none: at the file's origin.
    #[serde(default)]
    pub origin_in_file: Option<DVec3>,
    /// Its regions, as clients gave them; none in lists, news and meshes.
    #[serde(default)]
    pub regions: Vec<Region>,
    /// Its known grips, as clients gave them; none in lists, news and meshes.
    #[serde(default)]
    pub known_grips: Vec<KnownGrip>,
    /// Labels that clients gave it.
    #[serde(default)]
    pub labels: BTreeMap<String, String>,
    /// Identifies this state of the object: every change by a client gives another one.
    pub etag: String,
    /// When it was created; for objects that the server started with, the start.
    #[serde(with = "json::time")]
    pub create_time: SystemTime,
    /// When a client last changed it; the time of creation if none did.
    #[serde(with = "json::time")]
    pub update_time: SystemTime,
}

/// State of an object's atlas: the grasps found for it in advance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AtlasState {
    /// Number of grasps.
    pub entries: u32,
    /// True once the atlas is complete. It may have no entries then, if nothing was found.
    pub complete: bool,
    /// Identifies this state, in hexadecimal; the same for the same entries.
    pub stamp: String,
    /// Processor time the server has spent on the atlas since it started.
    #[serde(rename = "build_time_seconds", with = "json::seconds")]
    pub build_time: Duration,
    /// Whether it grows and, if not, why.
    pub growth: AtlasGrowth,
    /// Number of further grasps, learned from searches for holdouts for which the atlas had none.
    #[serde(default)]
    pub learned: u32,
}

/// Whether an atlas grows. Atlases of the objects that are asked for most come first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AtlasGrowth {
    /// It has no entries yet, and waits for its turn or is being grown.
    Waiting,
    /// It has entries that answer requests, and grows on when its turn comes.
    Growing,
    /// It is complete.
    Complete,
    /// It is complete without entries: of thousands of hands tried, none holds the object.
    NothingFound,
    /// It is not in memory; the next request for the object reads or grows it again.
    AtRest,
    /// Objects, and atlases that are asked for more, take all the memory; the next request tries again.
    NoMemory,
    /// The server failed to grow it; its log says how.
    Failed,
    /// Of a newer or older server.
    Unrecognised,
}

/// Surfaces that must not be touched.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ForbiddenSurfaces {
    /// Names of groups (`g`), objects (`o`) and materials (`usemtl`) of OBJ, of solids of STL, and of nodes, meshes and materials
    /// of glTF.
    pub groups: Vec<String>,
    /// Indices of triangles, counted from 0 in the file's order after polygons are split: n - 2 for a polygon of n corners,
    /// the fan from its first corner if that corner sees all others.
    pub triangles: Vec<u32>,
}

/// The axis that points up in a mesh file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum UpAxis {
    /// +Y: the file's axes are the object's.
    #[default]
    Y,
    /// +Z: (x, y, z) of the file becomes (x, z, −y) of the object.
    Z,
}

/// An object to create.
#[derive(Clone, Debug, PartialEq)]
pub struct NewObject {
    /// Last part of the name: 1 to 63 characters of a-z, 0-9 and -, starting with a letter.
    pub id: String,
    /// The mesh as the content of an OBJ, STL, PLY, GLB or glTF file, recognised by content.
    pub mesh: Vec<u8>,
    /// The axis that points up in the file.
    pub up_axis: UpAxis,
    /// Names of the file's parts that are the object; empty: all that are seen, without colliders and lower levels of detail.
    pub parts: Vec<String>,
    /// Metres per unit of the mesh; more than 0; none: 1.
    pub unit_metres: Option<f32>,
    /// Mass in kilograms; more than 0.
    pub mass_kg: f32,
    /// Centre of mass in the object's frame, in metres after scaling (see [`Object::origin_in_file`]); none: that of the
    /// mesh's volume.
    pub centre_of_mass: Option<Vec3>,
    /// Coefficient of static friction; more than 0, at most 5; none: the server's default.
    pub friction: Option<f32>,
    /// Surfaces that must not be touched.
    pub forbidden: ForbiddenSurfaces,
    /// Parts of the surface that hands should take, leave, or not touch; at most 32.
    pub regions: Vec<Region>,
    /// Grips to try first, or not to answer; at most 32.
    pub known_grips: Vec<KnownGrip>,
    /// Labels: at most 16, with keys of 1 to 63 of a-z, 0-9, -, _, . and /, and values of at most 63 bytes.
    pub labels: BTreeMap<String, String>,
    /// A UUID that lets the server recognise the request when it comes again; none: the client draws one for each call, so
    /// that its own retries are recognised.
    pub request_id: Option<String>,
}

impl NewObject {
    /// An object with a mesh in metres, +Y up, and the server's defaults for everything else.
    pub fn new(id: impl Into<String>, mesh: impl Into<Vec<u8>>, mass_kg: f32) -> Self {
        Self {
            id: id.into(),
            mesh: mesh.into(),
            up_axis: UpAxis::Y,
            parts: Vec::new(),
            unit_metres: None,
            mass_kg,
            centre_of_mass: None,
            friction: None,
            forbidden: ForbiddenSurfaces::default(),
            regions: Vec::new(),
            known_grips: Vec::new(),
            labels: BTreeMap::new(),
            request_id: None,
        }
    }
}

/// Changes of an object; none keeps what is.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ObjectUpdate {
    /// The etag of the state to change; the call fails if the object has another one by now. None: any state.
    pub etag: Option<String>,
    /// Metres per unit of the mesh; more than 0. What was given in metres or kilograms stays as it is.
    pub unit_metres: Option<f32>,
    /// Mass in kilograms; more than 0.
    pub mass_kg: Option<f32>,
    /// Centre of mass in the object's frame, in metres.
    pub centre_of_mass: Option<Reset<Vec3>>,
    /// Coefficient of static friction; more than 0, at most 5.
    pub friction: Option<Reset<f32>>,
    /// Surfaces that must not be touched, instead of all former ones.
    pub forbidden: Option<ForbiddenSurfaces>,
    /// Regions, instead of all former ones.
    pub regions: Option<Vec<Region>>,
    /// Known grips, instead of all former ones.
    pub known_grips: Option<Vec<KnownGrip>>,
    /// Labels, instead of all former ones.
    pub labels: Option<BTreeMap<String, String>>,
}

impl ObjectUpdate {
    /// True if it changes nothing.
    pub fn is_empty(&self) -> bool {
        let without_etag = Self {
            etag: None,
            ..self.clone()
        };
        without_etag == Self::default()
    }
}

/// A new value, or the one that an object has if its creator gives none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reset<T> {
    /// This value.
    To(T),
    /// The server's default.
    Default,
}

/// Which objects to list, and in which order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ObjectQuery {
    /// Labels that the objects must have, such as `level=kitchen AND fragile`; empty: all objects.
    pub filter: String,
    /// `name`, `create_time` or `update_time`, each optionally followed by `desc`, with commas in between; empty: by name.
    pub order_by: String,
}

/// An object's mesh as searches use it.
#[derive(Clone, Debug, PartialEq)]
pub struct ObjectMesh {
    /// A GLB file in the object's frame, in metres and +Y up. Triangles that may be touched have the material `surface`, the
    /// others `forbidden`.
    pub glb: Vec<u8>,
    /// The state of the object that it belongs to.
    pub object: Object,
}

/// What happened to an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ObjectChange {
    /// It was there when the watch began.
    Present,
    /// All objects that were there have been reported; about no object.
    PresentEnd,
    /// A client created it, or changed its labels so that they match.
    Created,
    /// A client changed it.
    Updated,
    /// Its atlas for the right hand answers most requests.
    AtlasUseful,
    /// Its atlas for the right hand is complete.
    AtlasComplete,
    /// Its atlas for the left hand is complete.
    LeftAtlasComplete,
    /// A client deleted it, or changed its labels so that they no longer match.
    Deleted,
    /// The server dropped it to make room for others.
    Evicted,
    /// Of a newer server.
    Unrecognised,
}

/// What happened to an object since the last news of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ObjectNews {
    /// What happened, in this order.
    pub changes: Vec<ObjectChange>,
    /// "objects/{object}"; none if the news is about no object.
    pub name: Option<String>,
    /// The latest state; none if the object is gone.
    pub object: Option<Object>,
}

/// A page of objects.
#[derive(Clone, Debug, PartialEq)]
pub struct ObjectPage {
    /// In the order of the query.
    pub objects: Vec<Object>,
    /// Token of the next page; none on the last page.
    pub next_page_token: Option<String>,
}

/// Health of a server.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Health {
    /// Accepts requests.
    Serving,
    /// Up, but accepts no requests, for instance while draining.
    NotServing,
    /// Not reported.
    Unknown,
}
