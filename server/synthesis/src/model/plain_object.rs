//! Objects and their banned grips, without data derived for searching.

use std::sync::Arc;

use glam::Vec3;

use super::{hand::Handedness, regions::Regions, strategy::Validity};
use crate::{
    base::{
        pose::Pose,
        stop::{Stop, Stopped},
    },
    geometry::{
        boxes::OrientedBox,
        mesh::{MeshError, TriangleMesh},
    },
};

/// Coefficient of static friction of every object in the thesis (4.5): leather on metal.
pub const THESIS_FRICTION: f32 = 0.34;

/// Default coefficient of static friction between dry skin and smooth plastic or metal, measured at 0.4 to 1.0 (S.
/// Derler and L.-C. Gerhardt, "Tribology of Skin", 2012). A higher one accepts grasps that would slip.
pub const SKIN_FRICTION: f32 = 0.6;

/// Number of nonexistent forbidden triangles that are listed one by one; the rest are counted. It bounds the size of
/// the error that a request can provoke.
pub const MAX_NAMED_TRIANGLES: usize = 10;

/// An object as stored: the given properties and its box. Clones share the mesh.
#[derive(Clone, Debug)]
pub struct PlainObject {
    /// Its surface.
    pub mesh: Arc<TriangleMesh>,
    /// Its tight bounding box: B of thesis 4.3.
    pub bounding_box: OrientedBox,
    /// Mass, in kilograms.
    pub mass: f32,
    /// Centre of mass in the object's frame, in metres.
    pub centre_of_mass: Vec3,
    /// Coefficient of static friction between skin and surface; `None` if unknown.
    pub friction: Option<f32>,
    /// One flag per triangle: true if it must not be touched.
    forbidden: Arc<[bool]>,
    /// The parts that hands should take or leave.
    regions: Arc<Regions>,
    /// The banned grips.
    banned: Arc<[BannedGrip]>,
}

/// Why an object was rejected.
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
        /// The given index.
        triangle: u32,
        /// Number of triangles.
        triangles: usize,
    },
    /// More than [`MAX_NAMED_TRIANGLES`] forbidden triangles do not exist.
    #[error("{count} more forbidden triangles do not exist; the mesh has {triangles}")]
    MoreForbiddenTriangles {
        /// How many are not listed.
        count: usize,
        /// Number of triangles.
        triangles: usize,
    },
}

/// Why an object cannot have another size.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ResizeError {
    /// Its mass is not a positive number.
    #[error("the mass would be {0} kg; it must be finite and more than 0")]
    Mass(f32),
    /// Its mesh is invalid at that size.
    #[error("at this size, {0}")]
    Mesh(#[from] MeshError),
}

impl PlainObject {
    /// Checks the properties of an object and finds its bounding box, unless it is stopped.
    ///
    /// # Errors
    /// [`Stopped`]; within, every violation found. Of the forbidden triangles that do not exist, the first
    /// [`MAX_NAMED_TRIANGLES`] are listed and the others counted.
    pub fn new_until(
        mesh: impl Into<Arc<TriangleMesh>>,
        mass: f32,
        centre_of_mass: Vec3,
        friction: Option<f32>,
        forbidden_triangles: &[u32],
        stop: Stop<'_>,
    ) -> Result<Result<Self, Vec<ObjectError>>, Stopped> {
        let mesh = mesh.into();
        let checked = checked(
            mesh.triangles().len(),
            mass,
            centre_of_mass,
            friction,
            forbidden_triangles,
        );
        let forbidden = match checked {
            Ok(forbidden) => forbidden,
            Err(errors) => return Ok(Err(errors)),
        };
        Ok(Ok(Self {
            bounding_box: OrientedBox::around_until(&mesh, stop)?,
            mesh,
            mass,
            centre_of_mass,
            friction,
            forbidden: forbidden.into(),
            regions: Arc::default(),
            banned: Arc::default(),
        }))
    }

    /// The same shape with other physical properties, but the same regions and banned grips. Shares the mesh.
    ///
    /// # Errors
    /// Every violation found, as for [`Self::new_until`].
    pub fn with_properties(
        &self,
        mass: f32,
        centre_of_mass: Vec3,
        friction: Option<f32>,
        forbidden_triangles: &[u32],
    ) -> Result<Self, Vec<ObjectError>> {
        let triangles = self.forbidden.len();
        let forbidden = checked(triangles, mass, centre_of_mass, friction, forbidden_triangles)?;
        Ok(Self {
            mass,
            centre_of_mass,
            friction,
            forbidden: forbidden.into(),
            ..self.clone()
        })
    }

    /// The same object, `scale` times as large about the origin of its frame, with the given mass in kilograms. The mesh is shared
    /// if the scale is 1. Banned grips stay where they are.
    ///
    /// # Errors
    /// Why it cannot have this size.
    pub fn scaled(&self, scale: f32, mass: f32) -> Result<Self, ResizeError> {
        if !(mass.is_finite() && mass > 0.0) {
            return Err(ResizeError::Mass(mass));
        }
        let mut scaled = self.clone();
        scaled.mass = mass;
        if scale != 1.0 {
            scaled.mesh = Arc::new(self.mesh.scaled(scale)?);
            scaled.centre_of_mass *= scale;
            scaled.bounding_box = self.bounding_box.scaled(scale);
            scaled.regions = Arc::new(self.regions.scaled(scale));
        }
        Ok(scaled)
    }

    /// The same object with these regions, in its frame.
    #[must_use]
    pub fn with_regions(self, regions: Regions) -> Self {
        Self {
            regions: Arc::new(regions),
            ..self
        }
    }

    /// The same object with these banned grips, in its frame.
    #[must_use]
    pub fn with_banned(self, banned: Vec<BannedGrip>) -> Self {
        Self {
            banned: banned.into(),
            ..self
        }
    }

    /// The coefficient of friction to judge grasps by: the object's own, or the default of the kind of validity.
    pub fn friction_under(&self, validity: Validity) -> f32 {
        self.friction.unwrap_or(match validity {
            Validity::Thesis => THESIS_FRICTION,
            Validity::Physical => SKIN_FRICTION,
        })
    }

    /// True if the triangle must not be touched (Algorithm 7); O(1).
    pub fn is_forbidden(&self, triangle: u32) -> bool {
        self.forbidden[triangle as usize]
    }

    /// Number of triangles that must not be touched.
    pub fn forbidden_count(&self) -> usize {
        self.forbidden
            .iter()
            .filter(|is_forbidden| **is_forbidden)
            .count()
    }

    /// The parts that hands should take or leave.
    pub fn regions(&self) -> &Regions {
        &self.regions
    }

    /// The banned grips.
    pub(super) fn banned(&self) -> &[BannedGrip] {
        &self.banned
    }

    /// True if the wrist is not near a banned grip.
    pub fn admits_wrist(&self, handedness: Handedness, object_from_wrist: Pose) -> bool {
        let mut banned = self.banned.iter();
        !banned.any(|grip| grip.covers(handedness, object_from_wrist))
    }

    /// Memory use in bytes, the mesh included.
    pub fn bytes(&self) -> usize {
        size_of_val(self.mesh.positions())
            + size_of_val(self.mesh.triangles())
            + self.forbidden.len()
            + self.regions.bytes()
            + size_of_val(&*self.banned)
    }
}

/// One flag per triangle, true if it is forbidden, or all violations of an object's properties.
fn checked(
    triangles: usize,
    mass: f32,
    centre_of_mass: Vec3,
    friction: Option<f32>,
    forbidden_triangles: &[u32],
) -> Result<Vec<bool>, Vec<ObjectError>> {
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
    if errors.is_empty() {
        Ok(forbidden)
    } else {
        Err(errors)
    }
}

/// A banned wrist pose and its surroundings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BannedGrip {
    /// The banned hand; the other hand is allowed.
    pub handedness: Handedness,
    /// The wrist in the object's frame.
    pub object_from_wrist: Pose,
    /// Distance in metres within which a wrist is near, …
    pub distance: f32,
    /// … if it is turned by less than this, in radians.
    pub angle: f32,
}

impl BannedGrip {
    /// True if a hand's wrist is near the banned one.
    pub fn covers(&self, handedness: Handedness, object_from_wrist: Pose) -> bool {
        let Pose {
            position,
            orientation,
        } = self.object_from_wrist;
        handedness == self.handedness
            && position.distance(object_from_wrist.position) < self.distance
            && orientation.angle_between(object_from_wrist.orientation) < self.angle
    }
}
