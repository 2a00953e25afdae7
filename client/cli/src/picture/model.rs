//! The object of a picture. The server does not return meshes: they come from the built-in assets or from a file.

use std::{fmt::Display, path::Path, sync::Arc};

use grasp_assets::objects::object;
use grasp_everyday::{EverydayObject, Surface as Material};
use grasp_import::{Import, ImportedMesh, MeshLimits, read_mesh};
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

    /// An everyday object.
    pub(crate) fn everyday(object: &EverydayObject) -> Result<Self, Failure> {
        let read = read(object.obj().as_bytes(), 1.0, object.name)?;
        let is_forbidden = |name: &String| object.forbidden.contains(&name.as_str());
        let groups = read.groups.iter().filter(|(name, _)| is_forbidden(name));
        let (colour, finish) = look(object.surface);
        Ok(Self {
            forbidden: groups.flat_map(|(_, triangles)| triangles).copied().collect(),
            surface: Surface::File(read.mesh),
            colour,
            finish,
        })
    }

    /// The mesh of an OBJ file with units of `unit_metres`.
    pub(crate) fn from_file(path: &Path, unit_metres: f32) -> Result<Self, Failure> {
        let text = std::fs::read(path)
            .map_err(|error| Failure::other(format!("cannot read {}", path.display()), error))?;
        let read = read(&text, unit_metres, path.display())?;
        Ok(Self {
            surface: Surface::File(read.mesh),
            forbidden: Vec::new(),
            colour: linear_from_srgb(186, 176, 150),
            finish: Finish::Satin,
        })
    }

    /// The object at another size. The server rounds sizes to hundredths.
    pub(crate) fn scaled(self, scale: f32) -> Result<Self, Failure> {
        let scale = (100.0 * scale).round() / 100.0;
        if scale == 1.0 {
            return Ok(self);
        }
        let mesh = self.mesh().scaled(scale);
        let mesh = mesh.map_err(|error| Failure::other("cannot draw the object at this size", error))?;
        Ok(Self {
            surface: Surface::File(mesh),
            ..self
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

/// Reads a mesh; an error names its `source`.
fn read(bytes: &[u8], unit_metres: f32, source: impl Display) -> Result<ImportedMesh, Failure> {
    read_mesh(bytes, Import::with_unit(unit_metres), LIMITS).map_err(|errors| {
        let errors: Vec<_> = errors.iter().map(ToString::to_string).collect();
        Failure::other(format!("cannot read {source}"), errors.join("; "))
    })
}

/// Colour and finish of what everyday objects are made of.
fn look(material: Material) -> ([f32; 4], Finish) {
    let ([red, green, blue], finish) = match material {
        Material::Metal => ([198, 203, 210], Finish::Metal),
        Material::Glass => ([202, 216, 222], Finish::Satin),
        Material::Plastic => ([92, 128, 168], Finish::Satin),
        Material::Rubber => ([84, 88, 94], Finish::Satin),
        Material::Wood => ([186, 148, 98], Finish::Satin),
        Material::Paper => ([226, 220, 202], Finish::Cloth),
        Material::Cloth => ([146, 168, 96], Finish::Cloth),
        Material::Leather => ([142, 86, 54], Finish::Satin),
        Material::Rough => ([168, 84, 62], Finish::Cloth),
        Material::Natural => ([214, 186, 92], Finish::Satin),
    };
    (linear_from_srgb(red, green, blue), finish)
}
