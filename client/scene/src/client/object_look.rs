//! The object of a picture. The server does not return how objects look.

use std::sync::Arc;

use glam::Vec3;
use grasp_assets::objects::object;
use grasp_synthesis::{base::pose::Pose, geometry::mesh::TriangleMesh};

use super::CannotDraw;
use crate::{
    handover::HandoverScene,
    scene::{Finish, linear_from_srgb},
};

/// An object's mesh, its forbidden triangles, and how it looks.
#[derive(Clone, Debug)]
pub struct ObjectLook {
    mesh: Arc<TriangleMesh>,
    forbidden: Vec<u32>,
    colour: Vec3,
    finish: Finish,
}

impl ObjectLook {
    /// An object with a mesh in metres, the triangles of it that must not be touched, and its linear RGB and finish.
    pub fn new(mesh: TriangleMesh, forbidden: Vec<u32>, colour: Vec3, finish: Finish) -> Self {
        Self {
            mesh: Arc::new(mesh),
            forbidden,
            colour,
            finish,
        }
    }

    /// A built-in object, by its name with or without the collection; `None` if it is not built in.
    pub fn built_in(name: &str) -> Option<Self> {
        let built_in = object(name.strip_prefix("objects/").unwrap_or(name))?;
        let object = &built_in.object;
        let mesh = Arc::clone(object.surface.mesh());
        let (colour, finish) = match built_in.name {
            "remote" => (linear_from_srgb(70, 74, 82), Finish::Satin),
            _ => (linear_from_srgb(198, 203, 210), Finish::Metal),
        };
        Some(Self {
            forbidden: (0..mesh.triangles().len() as u32)
                .filter(|&triangle| object.is_forbidden(triangle))
                .collect(),
            mesh,
            colour,
            finish,
        })
    }

    /// The object at another size. The server rounds sizes to hundredths.
    ///
    /// # Errors
    /// The mesh would be too small or too large.
    pub fn scaled(self, scale: f32) -> Result<Self, CannotDraw> {
        let scale = (100.0 * scale).round() / 100.0;
        if scale == 1.0 {
            return Ok(self);
        }
        let mesh = self.mesh.scaled(scale);
        let mesh =
            mesh.map_err(|error| CannotDraw(format!("cannot draw the object at this size: {error}")))?;
        Ok(Self {
            mesh: Arc::new(mesh),
            ..self
        })
    }

    /// The object alone, as a scene to add hands to.
    pub fn scene(&self, client_from_object: Pose) -> HandoverScene<'_> {
        HandoverScene {
            forbidden: &self.forbidden,
            object_colour: self.colour,
            object_finish: self.finish,
            ..HandoverScene::new(&self.mesh, client_from_object)
        }
    }
}
