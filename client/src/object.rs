//! Objects that can be held out.

use std::time::Duration;

use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::{json, pose::Pose};

/// An object as the server knows it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Object {
    /// "objects/{object}".
    pub name: String,
    /// True for the objects that come with the server.
    pub built_in: bool,
    /// Triangles of the mesh.
    pub triangle_count: u32,
    /// Vertices of the mesh.
    pub vertex_count: u32,
    /// Mass in kilograms.
    pub mass_kg: f32,
    /// Centre of mass in the object's frame, in metres.
    pub centre_of_mass: Vec3,
    /// Static friction coefficient between skin and the surface.
    pub friction: f32,
    /// How many triangles may not be touched.
    pub forbidden_triangle_count: u32,
    /// The oriented bounding box: the box's frame in the object's frame.
    pub object_from_box: Pose,
    /// Half of the box's edge lengths along its own axes, in metres.
    pub box_half_extents: Vec3,
    /// SHA-256 of the mesh as the search uses it, hexadecimal.
    pub content_hash: String,
    /// What is odd about the mesh but does not stop it from being used.
    pub warnings: Vec<String>,
    /// The grasps that the server found for the object before; none if it keeps none.
    #[serde(default)]
    pub atlas: Option<AtlasState>,
}

/// The grasps that a server found for an object before.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AtlasState {
    /// How many there are.
    pub entries: u32,
    /// True if no more are being looked for.
    pub complete: bool,
    /// Names this state, hexadecimal; the same for the same entries.
    pub stamp: String,
    /// How long it took to find them.
    #[serde(rename = "build_time_seconds", with = "json::seconds")]
    pub build_time: Duration,
}

/// What may not be touched.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ForbiddenSurfaces {
    /// Names of OBJ groups (`g`), objects (`o`) or materials (`usemtl`).
    pub groups: Vec<String>,
    /// Indices of triangles in the order of the mesh after polygons were split into fans.
    pub triangles: Vec<u32>,
}

/// An object to be made.
#[derive(Clone, Debug, PartialEq)]
pub struct NewObject {
    /// The last part of the name: 1 to 63 of a-z, 0-9 and -, starting with a letter.
    pub id: String,
    /// The mesh as Wavefront OBJ text.
    pub obj: Vec<u8>,
    /// Metres per unit of the mesh, more than 0; none: 1.
    pub unit_metres: Option<f32>,
    /// Mass in kilograms, more than 0.
    pub mass_kg: f32,
    /// Centre of mass in the object's frame in metres, after scaling; none: that of the mesh's volume.
    pub centre_of_mass: Option<Vec3>,
    /// Static friction coefficient, more than 0, at most 5; none: the server's default.
    pub friction: Option<f32>,
    /// What may not be touched.
    pub forbidden: ForbiddenSurfaces,
}

impl NewObject {
    /// An object of a mesh in metres, with the server's defaults for everything else.
    pub fn new(id: impl Into<String>, obj: impl Into<Vec<u8>>, mass_kg: f32) -> Self {
        Self {
            id: id.into(),
            obj: obj.into(),
            unit_metres: None,
            mass_kg,
            centre_of_mass: None,
            friction: None,
            forbidden: ForbiddenSurfaces::default(),
        }
    }
}

/// A page of objects.
#[derive(Clone, Debug, PartialEq)]
pub struct ObjectPage {
    /// Sorted by name.
    pub objects: Vec<Object>,
    /// What to ask the next page with; none on the last page.
    pub next_page_token: Option<String>,
}

/// What a server says about its health.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Health {
    /// It answers requests.
    Serving,
    /// It is up but takes no requests, for instance because it drains.
    NotServing,
    /// It does not say.
    Unknown,
}
