//! Objects that can be grasped.

use glam::Vec3;

use super::strategy::Validity;
use crate::geometry::{
    mesh::TriangleMesh, mesh_bvh::MeshBvh, oriented_box::OrientedBox, tapered_capsule::TaperedCapsule,
};

/// Coefficient of static friction of every object in the thesis (4.5): leather on metal.
pub const THESIS_FRICTION: f32 = 0.34;

/// Coefficient of static friction between dry skin and smooth plastic or metal where nobody knows better: measured ones
/// lie between 0.4 and 1.0 (S. Derler and L.-C. Gerhardt, "Tribology of Skin", 2012). A higher one lets grasps hold that
/// would slip.
pub const SKIN_FRICTION: f32 = 0.6;

/// How many forbidden triangles that do not exist are named one by one. More would help nobody and let a client ask
/// for an answer as long as its request.
pub const MAX_NAMED_TRIANGLES: usize = 10;

/// An object with everything that the synthesis asks of it, in the object's own frame.
#[derive(Clone, Debug)]
pub struct GraspObject {
    /// Its surface and search structure.
    pub surface: MeshBvh,
    /// B of thesis 4.3.
    pub bounding_box: OrientedBox,
    /// In kilograms.
    pub mass: f32,
    /// In metres, in the object's frame.
    pub centre_of_mass: Vec3,
    /// Coefficient of static friction between skin and the surface; none if nobody said.
    pub friction: Option<f32>,
    /// One flag a triangle: may it not be touched?
    forbidden: Vec<bool>,
    /// What these triangles make, if there are any. Much smaller than the whole in most cases, and far from most hands: it
    /// is asked first.
    forbidden_surface: Option<MeshBvh>,
}

/// Why an object was refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ObjectError {
    /// Mass is not a positive number.
    #[error("mass is {0} kg; it must be finite and more than 0")]
    Mass(f32),
    /// Friction is not a positive number.
    #[error("friction is {0}; it must be finite and more than 0")]
    Friction(f32),
    /// The centre of mass is not finite.
    #[error("centre of mass {0} is not finite")]
    CentreOfMass(Vec3),
    /// A forbidden triangle does not exist.
    #[error("forbidden triangle {triangle} does not exist; the mesh has {triangles}")]
    ForbiddenTriangle {
        /// The index that was given.
        triangle: u32,
        /// How many triangles there are.
        triangles: usize,
    },
    /// Many forbidden triangles do not exist; the first are named one by one.
    #[error("{count} more forbidden triangles do not exist; the mesh has {triangles}")]
    MoreForbiddenTriangles {
        /// How many are not named.
        count: usize,
        /// How many triangles there are.
        triangles: usize,
    },
}

impl GraspObject {
    /// Builds the search structures of an object.
    ///
    /// # Errors
    /// Every violation found, except that of forbidden triangles that do not exist only the first
    /// [`MAX_NAMED_TRIANGLES`] are named and the others counted.
    pub fn new(
        mesh: TriangleMesh,
        mass: f32,
        centre_of_mass: Vec3,
        friction: Option<f32>,
        forbidden_triangles: &[u32],
    ) -> Result<Self, Vec<ObjectError>> {
        let mut errors = Vec::new();
        if !(mass.is_finite() && mass > 0.0) {
            errors.push(ObjectError::Mass(mass));
        }
        if let Some(friction) = friction.filter(|friction| !(friction.is_finite() && *friction > 0.0)) {
            errors.push(ObjectError::Friction(friction));
        }
        if !centre_of_mass.is_finite() {
            errors.push(ObjectError::CentreOfMass(centre_of_mass));
        }
        let triangles = mesh.triangles().len();
        let mut forbidden = vec![false; triangles];
        let mut unknown = Vec::new();
        for &triangle in forbidden_triangles {
            match forbidden.get_mut(triangle as usize) {
                Some(flag) => *flag = true,
                None => unknown.push(triangle),
            }
        }
        errors.extend(
            unknown
                .iter()
                .take(MAX_NAMED_TRIANGLES)
                .map(|&triangle| ObjectError::ForbiddenTriangle { triangle, triangles }),
        );
        if unknown.len() > MAX_NAMED_TRIANGLES {
            errors.push(ObjectError::MoreForbiddenTriangles {
                count: unknown.len() - MAX_NAMED_TRIANGLES,
                triangles,
            });
        }
        if !errors.is_empty() {
            return Err(errors);
        }
        let (bounding_box, surface) = box_and_surface(mesh);
        Ok(Self {
            bounding_box,
            mass,
            centre_of_mass,
            friction,
            forbidden_surface: surface
                .mesh()
                .submesh(|triangle| forbidden[triangle])
                .map(MeshBvh::build_quick),
            surface,
            forbidden,
        })
    }

    /// The coefficient of friction that grasps are judged by: the object's own, or what the notion of valid assumes.
    pub fn friction_under(&self, validity: Validity) -> f32 {
        self.friction.unwrap_or(match validity {
            Validity::Thesis => THESIS_FRICTION,
            Validity::Physical => SKIN_FRICTION,
        })
    }

    /// True if the triangle may not be touched (Algorithm 7); O(1).
    pub fn is_forbidden(&self, triangle: u32) -> bool {
        self.forbidden[triangle as usize]
    }

    /// How many triangles may not be touched.
    pub fn forbidden_count(&self) -> usize {
        let surface = self.forbidden_surface.as_ref();
        surface.map_or(0, |surface| surface.mesh().triangles().len())
    }

    /// What may not be touched, if there is such.
    pub fn forbidden_surface(&self) -> Option<&MeshBvh> {
        self.forbidden_surface.as_ref()
    }

    /// True if what may not be touched is less than `distance` metres off a capsule's skin.
    pub fn is_forbidden_within(&self, capsule: &TaperedCapsule, distance: f32) -> bool {
        let surface = self.forbidden_surface.as_ref();
        surface.is_some_and(|surface| surface.comes_within(capsule, distance))
    }
}

/// The box around a mesh and its search structure, built at the same time: the box takes an eighth of the whole. Where the
/// system has no thread for it, one after the other.
fn box_and_surface(mesh: TriangleMesh) -> (OrientedBox, MeshBvh) {
    let copy = mesh.clone();
    std::thread::scope(|scope| {
        let parallel = std::thread::Builder::new().spawn_scoped(scope, || OrientedBox::around(&copy));
        let surface = MeshBvh::build(mesh);
        let bounding_box = parallel.ok().and_then(|thread| thread.join().ok());
        let bounding_box = bounding_box.unwrap_or_else(|| OrientedBox::around(&copy));
        (bounding_box, surface)
    })
}
