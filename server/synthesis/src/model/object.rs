//! Objects that can be grasped.

use std::sync::{Arc, OnceLock};

use glam::Vec3;

use super::{banned_grip::BannedGrip, hand::Handedness, parts::Parts, regions::Regions, strategy::Validity};
use crate::base::{
    pose::Pose,
    stop::{Stop, Stopped, unstopped},
};
use crate::geometry::{
    handles::Handles,
    local_shape::LocalShape,
    local_thickness::LocalThickness,
    mesh::{MeshError, TriangleMesh},
    mesh_bvh::MeshBvh,
    oriented_box::OrientedBox,
    surface_samples::even_samples,
    tapered_capsule::TaperedCapsule,
};

/// Coefficient of static friction of every object in the thesis (4.5): leather on metal.
pub const THESIS_FRICTION: f32 = 0.34;

/// Default coefficient of static friction between dry skin and smooth plastic or metal, measured at 0.4 to 1.0 (S.
/// Derler and L.-C. Gerhardt, "Tribology of Skin", 2012). A higher one accepts grasps that would slip.
pub const SKIN_FRICTION: f32 = 0.6;

/// Number of nonexistent forbidden triangles that are listed one by one; the rest are counted. It bounds the size of
/// the error that a request can provoke.
pub const MAX_NAMED_TRIANGLES: usize = 10;

/// A graspable object with its search structures, in its own frame.
#[derive(Clone, Debug)]
pub struct GraspObject {
    /// Its surface with search structure, which [`Self::with_properties`] shares.
    pub surface: Arc<MeshBvh>,
    /// Its tight bounding box: B of thesis 4.3.
    pub bounding_box: OrientedBox,
    /// How thick it is where a hand may hold it.
    pub local_thickness: LocalThickness,
    /// How flat, long or round it is there.
    pub local_shape: LocalShape,
    /// Mass, in kilograms.
    pub mass: f32,
    /// Centre of mass in the object's frame, in metres.
    pub centre_of_mass: Vec3,
    /// Coefficient of static friction between skin and surface; none if unknown.
    pub friction: Option<f32>,
    /// One flag per triangle: true if it must not be touched.
    forbidden: Vec<bool>,
    /// The mesh of the forbidden triangles, if there are any: mostly small and far from the hand, hence queried
    /// first.
    forbidden_surface: Option<MeshBvh>,
    /// Which parts hands should take or leave.
    regions: Regions,
    /// The grips with which it is not to be taken.
    banned: Vec<BannedGrip>,
    /// What its parts are for, found on first use.
    parts: OnceLock<Parts>,
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
    /// Its mesh is no mesh any more.
    #[error("at this size, {0}")]
    Mesh(#[from] MeshError),
}

impl GraspObject {
    /// Builds the search structures of an object.
    ///
    /// # Errors
    /// Every violation found. Of the forbidden triangles that do not exist, the first [`MAX_NAMED_TRIANGLES`] are
    /// listed and the others counted.
    pub fn new(
        mesh: TriangleMesh,
        mass: f32,
        centre_of_mass: Vec3,
        friction: Option<f32>,
        forbidden_triangles: &[u32],
    ) -> Result<Self, Vec<ObjectError>> {
        unstopped(|stop| Self::new_until(mesh, mass, centre_of_mass, friction, forbidden_triangles, stop))
    }

    /// As [`Self::new`], unless it is stopped.
    ///
    /// # Errors
    /// [`Stopped`]; within, those of [`Self::new`].
    pub fn new_until(
        mesh: TriangleMesh,
        mass: f32,
        centre_of_mass: Vec3,
        friction: Option<f32>,
        forbidden_triangles: &[u32],
        stop: Stop<'_>,
    ) -> Result<Result<Self, Vec<ObjectError>>, Stopped> {
        let checked = CheckedProperties::new(
            mesh.triangles().len(),
            mass,
            centre_of_mass,
            friction,
            forbidden_triangles,
        );
        let checked = match checked {
            Ok(checked) => checked,
            Err(errors) => return Ok(Err(errors)),
        };
        let (measures, surface) = measures_and_surface(mesh, None, stop)?;
        Ok(Ok(Self::of_parts(measures, Arc::new(surface), checked)))
    }

    /// The same shape with other physical properties. Shares the mesh and its search structure, and repeats none of its
    /// measurements.
    ///
    /// # Errors
    /// As for [`Self::new`].
    pub fn with_properties(
        &self,
        mass: f32,
        centre_of_mass: Vec3,
        friction: Option<f32>,
        forbidden_triangles: &[u32],
    ) -> Result<Self, Vec<ObjectError>> {
        let checked = CheckedProperties::new(
            self.forbidden.len(),
            mass,
            centre_of_mass,
            friction,
            forbidden_triangles,
        )?;
        Ok(self.with_checked_properties(checked))
    }

    fn with_checked_properties(&self, checked: CheckedProperties) -> Self {
        let measures = Measures {
            bounding_box: self.bounding_box,
            local_thickness: self.local_thickness.clone(),
            local_shape: self.local_shape.clone(),
        };
        Self::of_parts(measures, Arc::clone(&self.surface), checked)
            .with_regions(self.regions.clone())
            .with_banned(self.banned.clone())
    }

    /// The same object with these regions, in its frame.
    #[must_use]
    pub fn with_regions(self, regions: Regions) -> Self {
        Self { regions, ..self }
    }

    /// The same object, not to be taken with these grips, in its frame.
    #[must_use]
    pub fn with_banned(self, banned: Vec<BannedGrip>) -> Self {
        Self { banned, ..self }
    }

    /// The same object, `scale` times as large about the origin of its frame, with the given mass in kilograms. Its bounding
    /// box is scaled; its surface and what is measured in terms of a hand's size are prepared again, unless the scale is 1.
    ///
    /// # Errors
    /// [`Stopped`]; within, why it cannot have this size.
    pub fn resized_until(
        &self,
        scale: f32,
        mass: f32,
        stop: Stop<'_>,
    ) -> Result<Result<Self, ResizeError>, Stopped> {
        if !(mass.is_finite() && mass > 0.0) {
            return Ok(Err(ResizeError::Mass(mass)));
        }
        let properties = CheckedProperties {
            mass,
            centre_of_mass: self.centre_of_mass * scale,
            friction: self.friction,
            forbidden: self.forbidden.clone(),
        };
        if scale == 1.0 {
            return Ok(Ok(self.with_checked_properties(properties)));
        }
        let mesh = match self.surface.mesh().scaled(scale) {
            Ok(mesh) => mesh,
            Err(error) => return Ok(Err(error.into())),
        };
        let bounding_box = self.bounding_box.scaled(scale);
        let (measures, surface) = measures_and_surface(mesh, Some(bounding_box), stop)?;
        let resized = Self::of_parts(measures, Arc::new(surface), properties);
        Ok(Ok(resized
            .with_regions(self.regions.scaled(scale))
            .with_banned(self.banned_at(scale))))
    }

    fn of_parts(measures: Measures, surface: Arc<MeshBvh>, properties: CheckedProperties) -> Self {
        let Measures {
            bounding_box,
            local_thickness,
            local_shape,
        } = measures;
        let CheckedProperties {
            mass,
            centre_of_mass,
            friction,
            forbidden,
        } = properties;
        Self {
            bounding_box,
            local_thickness,
            local_shape,
            mass,
            centre_of_mass,
            friction,
            forbidden_surface: surface
                .mesh()
                .submesh(|triangle| forbidden[triangle])
                .map(MeshBvh::build_quick),
            surface,
            forbidden,
            regions: Regions::default(),
            banned: Vec::new(),
            parts: OnceLock::new(),
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

    /// Which parts hands should take or leave.
    pub fn regions(&self) -> &Regions {
        &self.regions
    }

    /// True if the object is to be taken with a wrist there.
    pub fn admits_wrist(&self, handedness: Handedness, object_from_wrist: Pose) -> bool {
        let mut banned = self.banned.iter();
        !banned.any(|grip| grip.covers(handedness, object_from_wrist))
    }

    /// Where a wrist is that holds the object at `scale` times its size as one at its own size does: it keeps its offset from the
    /// nearest place of the surface.
    pub fn wrist_at(&self, scale: f32, object_from_wrist: Pose) -> Pose {
        let Pose {
            position,
            orientation,
        } = object_from_wrist;
        let nearest = self.surface.closest_point_within(position, f32::MAX);
        let way = nearest.map_or(Vec3::ZERO, |nearest| nearest.position * (scale - 1.0));
        Pose::new(position + way, orientation)
    }

    fn banned_at(&self, scale: f32) -> Vec<BannedGrip> {
        let moved = |grip: &BannedGrip| BannedGrip {
            object_from_wrist: self.wrist_at(scale, grip.object_from_wrist),
            ..*grip
        };
        self.banned.iter().map(moved).collect()
    }

    /// How much the place of the surface next to a point is wanted, from 0 to 1; 1 if there is none within `distance` metres.
    pub fn wish_near(&self, point: Vec3, distance: f32) -> f32 {
        if self.regions.is_empty() {
            return 1.0;
        }
        let nearest = self.surface.closest_point_within(point, distance);
        nearest.map_or(1.0, |nearest| {
            self.regions.wish_at(nearest.triangle, nearest.position)
        })
    }

    /// What its parts are for, as the mesh shows. The first call takes some milliseconds.
    pub fn parts(&self) -> &Parts {
        unstopped(|stop| self.parts_until(stop))
    }

    /// As [`Self::parts`], unless it is stopped.
    ///
    /// # Errors
    /// [`Stopped`].
    pub fn parts_until(&self, stop: Stop<'_>) -> Result<&Parts, Stopped> {
        if let Some(parts) = self.parts.get() {
            return Ok(parts);
        }
        let parts = Parts::of(self, stop)?;
        Ok(self.parts.get_or_init(|| parts))
    }

    /// Where it can be wrapped. The first call takes as long as that of [`Self::parts`].
    pub fn handles(&self) -> &Handles {
        &self.parts().handles
    }

    /// Number of triangles that must not be touched.
    pub fn forbidden_count(&self) -> usize {
        let surface = self.forbidden_surface.as_ref();
        surface.map_or(0, |surface| surface.mesh().triangles().len())
    }

    /// The surface that must not be touched; none if there is no forbidden triangle.
    pub fn forbidden_surface(&self) -> Option<&MeshBvh> {
        self.forbidden_surface.as_ref()
    }

    /// True if a forbidden surface comes closer than `distance` metres to a capsule's skin.
    pub fn is_forbidden_within(&self, capsule: &TaperedCapsule, distance: f32) -> bool {
        let surface = self.forbidden_surface.as_ref();
        surface.is_some_and(|surface| surface.comes_within(capsule, distance))
    }
}

/// What does not follow from an object's mesh.
struct CheckedProperties {
    mass: f32,
    centre_of_mass: Vec3,
    friction: Option<f32>,
    /// One flag per triangle.
    forbidden: Vec<bool>,
}

impl CheckedProperties {
    /// The properties of an object of so many triangles, or everything that is wrong with them.
    fn new(
        triangles: usize,
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
        Ok(Self {
            mass,
            centre_of_mass,
            friction,
            forbidden,
        })
    }
}

/// What is measured of an object's mesh, apart from its search structure.
struct Measures {
    bounding_box: OrientedBox,
    local_thickness: LocalThickness,
    local_shape: LocalShape,
}

impl Measures {
    fn of(mesh: &TriangleMesh, bounding_box: Option<OrientedBox>, stop: Stop<'_>) -> Result<Self, Stopped> {
        let samples = even_samples(mesh);
        Ok(Self {
            bounding_box: match bounding_box {
                Some(known) => known,
                None => OrientedBox::around_until(mesh, stop)?,
            },
            local_thickness: LocalThickness::of(&samples, stop)?,
            local_shape: LocalShape::of(&samples),
        })
    }
}

/// Measures a mesh and builds its search structure in parallel, or in sequence if no thread can be spawned. The former
/// takes a fifth of the work, less if the bounding box is known.
fn measures_and_surface(
    mesh: TriangleMesh,
    bounding_box: Option<OrientedBox>,
    stop: Stop<'_>,
) -> Result<(Measures, MeshBvh), Stopped> {
    let measure = |mesh: &TriangleMesh| Measures::of(mesh, bounding_box, stop);
    let copy = mesh.clone();
    std::thread::scope(|scope| {
        let parallel = std::thread::Builder::new().spawn_scoped(scope, || measure(&copy));
        let surface = MeshBvh::build_until(mesh, stop);
        let of_copy = parallel.ok().and_then(|thread| thread.join().ok());
        Ok((of_copy.unwrap_or_else(|| measure(&copy))?, surface?))
    })
}
