//! The object of a picture. The server does not return meshes: they come from the built-in assets or from a file.

use std::{path::Path, sync::Arc};

use grasp_assets::objects::object;
use grasp_import::{MeshLimits, obj::read_obj};
use grasp_scene::{Finish, linear_from_srgb};
use grasp_synthesis::{geometry::mesh::TriangleMesh, model::object::GraspObject};

use crate::failure::Failure;

/// Limits of a mesh file for a picture: ample for detailed scans; larger ones would take minutes to draw.
const LIMITS: MeshLimits = MeshLimits {
    bytes: 64 << 20,
    vertices: 1_000_000,
    triangles: 1_000_000,
};

/// An object's mesh and its forbidden triangles.
#[derive(Clone, Debug)]
pub(crate) struct Model {
    surface: Surface,
    forbidden: Vec<u32>,
    colour: [f32; 4],
    finish: Finish,
}

#[derive(Clone, Debug)]
enum Surface {
    BuiltIn(Arc<GraspObject>),
    File(TriangleMesh),
}

impl Model {
    /// A built-in object, by its name with or without the collection; none if it is not built in.
    pub(crate) fn built_in(name: &str) -> Option<Self> {
        let built_in = object(name.strip_prefix("objects/").unwrap_or(name))?;
        let object = Arc::clone(&built_in.object);
        let triangles = 0..object.surface.mesh().triangles().len() as u32;
        let (colour, finish) = match built_in.name {
            "remote" => (linear_from_srgb(70, 74, 82), Finish::Satin),
            _ => (linear_from_srgb(198, 203, 210), Finish::Metal),
        };
        Some(Self {
            forbidden: triangles
                .filter(|&triangle| object.is_forbidden(triangle))
                .collect(),
            surface: Surface::BuiltIn(object),
            colour,
            finish,
        })
    }

    /// The mesh of an OBJ file with units of `unit_metres`.
    pub(crate) fn from_file(path: &Path, unit_metres: f32) -> Result<Self, Failure> {
        let text = std::fs::read(path)
            .map_err(|error| Failure::other(format!("cannot read {}", path.display()), error))?;
        let read = read_obj(&text, unit_metres, LIMITS).map_err(|errors| {
            let errors: Vec<_> = errors.iter().map(ToString::to_string).collect();
            Failure::other(format!("cannot read {}", path.display()), errors.join("; "))
        })?;
        Ok(Self {
            surface: Surface::File(read.mesh),
            forbidden: Vec::new(),
            colour: linear_from_srgb(186, 176, 150),
            finish: Finish::Satin,
        })
    }

    pub(super) fn mesh(&self) -> &TriangleMesh {
        match &self.surface {
            Surface::BuiltIn(object) => object.surface.mesh(),
            Surface::File(mesh) => mesh,
        }
    }

    pub(super) fn forbidden(&self) -> &[u32] {
        &self.forbidden
    }

    pub(super) fn colour(&self) -> [f32; 4] {
        self.colour
    }

    pub(super) fn finish(&self) -> Finish {
        self.finish
    }
}
