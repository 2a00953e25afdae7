//! Graspable objects and the functions of their parts.

use std::{
    ops::Deref,
    sync::{Arc, OnceLock},
};

use glam::Vec3;

use super::plain_object::{BannedGrip, ObjectError, PlainObject, ResizeError};
use crate::{
    base::{
        pose::Pose,
        random::AttemptStream,
        stop::{Stop, Stopped, unstopped},
    },
    geometry::{
        handles::Handles,
        local_shape::LocalShape,
        mesh::TriangleMesh,
        mesh_bvh::MeshBvh,
        sharp::SharpFeatures,
        surface_samples::{LocalThickness, SurfaceSampler, even_samples},
        tapered_capsule::TaperedCapsule,
    },
};

/// A graspable object with its search structures, in its own frame.
#[derive(Clone, Debug)]
pub struct GraspObject {
    plain: PlainObject,
    /// Its surface with search structure, which [`Self::with_plain`] shares.
    pub surface: Arc<MeshBvh>,
    /// Local thickness of the surface that may be touched.
    pub local_thickness: LocalThickness,
    /// Local shape of the surface that may be touched.
    pub local_shape: LocalShape,
    /// The mesh of the forbidden triangles, if there are any: mostly small and far from the hand, hence queried first.
    forbidden_surface: Option<MeshBvh>,
    /// The functions of its parts, found on first use.
    parts: OnceLock<Parts>,
}

impl GraspObject {
    /// Builds the search structures of an object.
    ///
    /// # Errors
    /// Every violation found. Of the forbidden triangles that do not exist, the first
    /// [`MAX_NAMED_TRIANGLES`](super::plain_object::MAX_NAMED_TRIANGLES) are listed and the others counted.
    pub fn new(
        mesh: impl Into<Arc<TriangleMesh>>,
        mass: f32,
        centre_of_mass: Vec3,
        friction: Option<f32>,
        forbidden_triangles: &[u32],
    ) -> Result<Self, Vec<ObjectError>> {
        let plain = unstopped(|stop| {
            PlainObject::new_until(mesh, mass, centre_of_mass, friction, forbidden_triangles, stop)
        })?;
        Ok(unstopped(|stop| Self::of_until(plain, stop)))
    }

    /// Builds the search structures of an object, unless it is stopped.
    ///
    /// # Errors
    /// [`Stopped`].
    pub fn of_until(plain: PlainObject, stop: Stop<'_>) -> Result<Self, Stopped> {
        let surface = MeshBvh::build_until(Arc::clone(&plain.mesh), stop)?;
        let samples = even_samples(&plain.mesh);
        Ok(Self {
            forbidden_surface: forbidden_surface(&plain),
            plain,
            surface: Arc::new(surface),
            local_thickness: LocalThickness::of(&samples),
            local_shape: LocalShape::of(&samples),
            parts: OnceLock::new(),
        })
    }

    /// An object for `plain`, which has the same mesh, with the search structure and measurements of this one.
    #[must_use]
    pub fn with_plain(&self, plain: PlainObject) -> Self {
        Self {
            forbidden_surface: forbidden_surface(&plain),
            plain,
            surface: Arc::clone(&self.surface),
            local_thickness: self.local_thickness.clone(),
            local_shape: self.local_shape.clone(),
            parts: OnceLock::new(),
        }
    }

    /// The same object, `scale` times as large about the origin of its frame, with the given mass in kilograms. Its bounding
    /// box is scaled; surface and measurements relative to a hand's size are prepared again, unless the scale is 1.
    ///
    /// # Errors
    /// [`Stopped`]; within, why the size is impossible.
    pub fn resized_until(
        &self,
        scale: f32,
        mass: f32,
        stop: Stop<'_>,
    ) -> Result<Result<Self, ResizeError>, Stopped> {
        let plain = match self.plain.scaled(scale, mass) {
            Ok(plain) => plain,
            Err(error) => return Ok(Err(error)),
        };
        if scale == 1.0 {
            return Ok(Ok(self.with_plain(plain)));
        }
        Ok(Ok(Self::of_until(
            plain.with_banned(self.banned_at(scale)),
            stop,
        )?))
    }

    /// The object without derived data.
    pub fn plain(&self) -> &PlainObject {
        &self.plain
    }

    /// Maps a wrist that holds the object to the object at `scale` times its size: the wrist keeps its offset from the nearest
    /// place of the surface.
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
        self.plain.banned().iter().map(moved).collect()
    }

    /// The owner's preference for the surface next to a point, from 0 to 1; 1 if no surface is within `distance` metres.
    pub(crate) fn wish_near(&self, point: Vec3, distance: f32) -> f32 {
        if self.regions().is_empty() {
            return 1.0;
        }
        let nearest = self.surface.closest_point_within(point, distance);
        nearest.map_or(1.0, |nearest| {
            self.regions().wish_at(nearest.triangle, nearest.position)
        })
    }

    /// The functions of its parts, by its mesh. The first call takes some milliseconds.
    pub fn parts(&self) -> &Parts {
        unstopped(|stop| self.parts_until(stop))
    }

    /// [`Self::parts`], unless it is stopped.
    pub(crate) fn parts_until(&self, stop: Stop<'_>) -> Result<&Parts, Stopped> {
        if let Some(parts) = self.parts.get() {
            return Ok(parts);
        }
        let parts = Parts::of(self, stop)?;
        Ok(self.parts.get_or_init(|| parts))
    }

    /// Its handles. The first call takes as long as that of [`Self::parts`].
    pub fn handles(&self) -> &Handles {
        &self.parts().handles
    }

    /// The surface that must not be touched; `None` if there is no forbidden triangle.
    pub(crate) fn forbidden_surface(&self) -> Option<&MeshBvh> {
        self.forbidden_surface.as_ref()
    }

    /// True if a forbidden surface comes closer than `distance` metres to a capsule's skin.
    pub fn is_forbidden_within(&self, capsule: &TaperedCapsule, distance: f32) -> bool {
        let surface = self.forbidden_surface.as_ref();
        surface.is_some_and(|surface| surface.comes_within(capsule, distance))
    }

    /// Memory use in bytes of derived data, without the plain object.
    pub fn derived_bytes(&self) -> usize {
        let of_forbidden = self.forbidden_surface.as_ref().map_or(0, |surface| {
            let mesh = surface.mesh();
            size_of_val(mesh.positions()) + size_of_val(mesh.triangles()) + surface.bytes()
        });
        self.surface.bytes()
            + of_forbidden
            + self.local_thickness.bytes()
            + self.local_shape.bytes()
            + self.parts.get().map_or(0, Parts::bytes)
    }
}

fn forbidden_surface(plain: &PlainObject) -> Option<MeshBvh> {
    let forbidden = plain.mesh.submesh(|triangle| plain.is_forbidden(triangle as u32));
    forbidden.map(MeshBvh::build_quick)
}

impl Deref for GraspObject {
    type Target = PlainObject;

    fn deref(&self) -> &PlainObject {
        &self.plain
    }
}

/// Number of surface samples that are counted, and their seed.
const SAMPLES: u64 = 512;
const SEED: u64 = 0x5041_5254;

/// Range of the surface share of handles by which an object is held: less is an ornament, more the whole object.
const HANDLE_SHARES: [f32; 2] = [0.03, 0.8];

/// Fewest places found on handles for these not to be sampling noise.
const MIN_PLACES: usize = 4;

/// Least mean radius in metres of a slender part sized for a hand: stems and wires are thinner.
const MIN_RADIUS: f32 = 0.0045;

/// Mass in kilograms below which a handle is not preferred: a pen is not a tool's handle.
const HANDLED_MASS: f32 = 0.03;

/// Ratios of the longest to the next side of the box up to which an object is not long, and from which it is fully long.
const LONG: [f32; 2] = [1.3, 1.6];

/// The functions of an object's parts.
#[derive(Clone, Debug)]
pub struct Parts {
    /// Slender parts that can be wrapped.
    pub handles: Handles,
    /// True if the handles are distinct from the rest of the object, so that people hold it there.
    pub is_handled: bool,
    /// Sharp edges and points.
    pub sharp: SharpFeatures,
    /// The axis along which the object is longest, a unit vector.
    pub long_axis: Vec3,
    /// Degree to which it is long, 0 to 1.
    pub is_long: f32,
    /// The middle of its box, in metres.
    pub middle: Vec3,
    /// Half its length along that axis, in metres.
    pub half_length: f32,
    /// Its smallest dimension in metres.
    pub smallest: f32,
}

impl Parts {
    /// Finds the parts; takes some milliseconds.
    pub(super) fn of(object: &GraspObject, stop: Stop<'_>) -> Result<Self, Stopped> {
        let is_forbidden = |triangle: u32| object.is_forbidden(triangle);
        let handles = Handles::of(&object.surface, stop, is_forbidden)?;
        let share = share_on(&handles, object);
        let [least, most] = HANDLE_SHARES;
        let half = object.bounding_box.half_extents;
        let longest = half.max_position();
        let mut sides = half.to_array();
        sides.sort_by(f32::total_cmp);
        let ratio = sides[2] / sides[1].max(f32::MIN_POSITIVE);
        let axis = object
            .bounding_box
            .object_from_box
            .transform_vector(Vec3::AXES[longest]);
        let main = handles.main().count();
        let radii: f32 = handles.main().map(|handle| handle.radius).sum();
        Ok(Self {
            is_handled: object.mass >= HANDLED_MASS
                && (least..=most).contains(&share)
                && main >= MIN_PLACES
                && radii >= MIN_RADIUS * main as f32,
            sharp: SharpFeatures::of(&object.surface, stop)?,
            handles,
            long_axis: axis.normalize_or(Vec3::Y),
            is_long: ((ratio - LONG[0]) / (LONG[1] - LONG[0])).clamp(0.0, 1.0),
            middle: object.bounding_box.object_from_box.position,
            half_length: sides[2],
            smallest: 2.0 * sides[0],
        })
    }

    /// Memory use in bytes.
    pub fn bytes(&self) -> usize {
        self.handles.bytes() + self.sharp.bytes()
    }
}

/// The share of the touchable surface that is on main handles.
fn share_on(handles: &Handles, object: &GraspObject) -> f32 {
    if handles.places().is_empty() {
        return 0.0;
    }
    let mesh = object.surface.mesh();
    let sampler = SurfaceSampler::new(mesh, |triangle| !object.is_forbidden(triangle));
    let on_handle = |sample: &u64| {
        let mut stream = AttemptStream::new(SEED, *sample);
        let sampled = sampler.sample(*sample, SAMPLES, &mut stream);
        sampled.is_some_and(|(_, point)| handles.contain(point))
    };
    (0..SAMPLES).filter(on_handle).count() as f32 / SAMPLES as f32
}
