//! The built-in objects: scissors, scalpel, remote (thesis 5.1).

use std::sync::{Arc, LazyLock};

use glam::{Quat, Vec3};
use grasp_import::{Import, ImportedMesh, MeshLimits, read_mesh};
use grasp_synthesis::{model::object::GraspObject, propose::prepared::PreparedObject};
use serde::{Deserialize, Serialize};

/// A built-in object.
#[derive(Clone, Debug)]
pub struct BuiltInObject {
    /// "scissors", "scalpel" or "remote".
    pub name: &'static str,
    /// Its mesh as OBJ text.
    pub obj: &'static str,
    /// Its manifest as JSON text; see [`Manifest`].
    pub manifest: &'static str,
    /// The object as searches use it.
    pub object: Arc<GraspObject>,
    /// The same, with the data that proposals derive from it.
    pub prepared: Arc<PreparedObject>,
}

/// The contents of the JSON file next to a mesh.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// The object's name.
    pub name: String,
    /// A description for people.
    pub description: String,
    /// How the object is placed in its frame.
    pub frame: String,
    /// In kilograms.
    pub mass_kg: f32,
    /// In metres, in the object's frame.
    pub centre_of_mass_m: Vec3,
    /// Coefficient of static friction between skin and the surface.
    pub friction: f32,
    /// Groups of the mesh that may not be touched.
    pub forbidden_groups: Vec<String>,
    /// The snug box around the mesh, B of thesis 4.3, rounded to micrometres.
    pub oriented_box: ManifestBox,
    /// Triangles of the mesh.
    pub triangles: usize,
    /// Vertices of the mesh.
    pub vertices: usize,
    /// Sources of the mesh and the figures.
    pub source: String,
    /// Their licence, as an SPDX expression.
    pub licence: String,
}

/// A box in the object's frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ManifestBox {
    /// Its centre, in metres.
    pub centre_m: Vec3,
    /// Orientation of its axes in the object's frame: a unit quaternion x, y, z, w.
    pub orientation: Quat,
    /// Half its edge lengths along its own axes, in metres.
    pub half_extents_m: Vec3,
}

impl Manifest {
    /// Reads a manifest.
    ///
    /// # Errors
    /// The text is not JSON, or a field is missing or unknown.
    pub fn parse(json: &str) -> Result<Self, serde_json::Error> {
        serde_json::from_str(json)
    }
}

/// Name, mesh and manifest of the built-in objects, sorted by name.
const FILES: [[&str; 3]; 3] = [
    [
        "remote",
        include_str!("../objects/remote.obj"),
        include_str!("../objects/remote.json"),
    ],
    [
        "scalpel",
        include_str!("../objects/scalpel.obj"),
        include_str!("../objects/scalpel.json"),
    ],
    [
        "scissors",
        include_str!("../objects/scissors.obj"),
        include_str!("../objects/scissors.json"),
    ],
];

/// The built-in meshes are small and known; these limits only catch mistakes of the generator.
const LIMITS: MeshLimits = MeshLimits {
    bytes: 1 << 20,
    vertices: 10_000,
    triangles: 10_000,
};

/// All built-in objects, sorted by name; parsed on first use.
pub fn objects() -> &'static [BuiltInObject] {
    static OBJECTS: LazyLock<[BuiltInObject; 3]> =
        LazyLock::new(|| FILES.map(|[name, obj, manifest]| parse(name, obj, manifest)));
    &*OBJECTS
}

/// A built-in object by name.
pub fn object(name: &str) -> Option<&'static BuiltInObject> {
    objects().iter().find(|object| object.name == name)
}

/// Parses embedded files. They are part of the program, so an error in them is a bug.
fn parse(name: &'static str, obj: &'static str, manifest: &'static str) -> BuiltInObject {
    let about = Manifest::parse(manifest)
        .unwrap_or_else(|error| panic!("the manifest of the built-in {name} is broken: {error}"));
    let ImportedMesh { mesh, groups, .. } = read_mesh(obj.as_bytes(), Import::METRES, LIMITS)
        .unwrap_or_else(|errors| panic!("the mesh of the built-in {name} is broken: {errors:?}"));
    let forbidden = groups
        .into_iter()
        .filter(|(group, _)| about.forbidden_groups.contains(group));
    let forbidden: Vec<u32> = forbidden.flat_map(|(_, triangles)| triangles).collect();
    let object = GraspObject::new(
        mesh,
        about.mass_kg,
        about.centre_of_mass_m,
        // The manifest's friction is the thesis' value; other validities assume their own.
        None,
        &forbidden,
    )
    .unwrap_or_else(|errors| panic!("the built-in {name} is broken: {errors:?}"));
    let object = Arc::new(object);
    BuiltInObject {
        name,
        obj,
        manifest,
        prepared: Arc::new(PreparedObject::new(Arc::clone(&object))),
        object,
    }
}
