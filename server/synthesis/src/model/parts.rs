//! What the parts of an object are for, as far as its mesh shows: handles, what cuts or pricks, and the long axis.

use glam::Vec3;

use super::object::GraspObject;
use crate::{
    base::{
        random::AttemptStream,
        stop::{Stop, Stopped},
    },
    geometry::{handles::Handles, sharp::SharpFeatures, surface_samples::SurfaceSampler},
};

/// Points of the surface that are counted, and the seed by which they are drawn.
const SAMPLES: u64 = 512;
const SEED: u64 = 0x5041_5254;

/// Share of the surface that handles may take up for them to be what the object is held by: less is an ornament, more is the
/// whole object, such as a stick.
const HANDLE_SHARES: [f32; 2] = [0.03, 0.8];

/// Places found on handles from which they are no accident of the samples.
const MIN_PLACES: usize = 4;

/// Mean radius in metres from which a slender part is sized for a hand: stems and wires are thinner.
const MIN_RADIUS: f32 = 0.0045;

/// Mass in kilograms below which an object is held by its handle no more than elsewhere: a pen is not a tool's handle.
const HANDLED_MASS: f32 = 0.03;

/// Ratio of the longest to the next side of the box from which an object counts as long, and up to which it does not.
const LONG: [f32; 2] = [1.3, 1.6];

/// What an object's parts are for.
#[derive(Clone, Debug)]
pub struct Parts {
    /// Slender parts that can be wrapped.
    pub handles: Handles,
    /// True if handles are what sets a part of the object apart, so that people hold it there.
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
    ///
    /// # Errors
    /// [`Stopped`].
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

/// The share of the surface that may be touched which is on main handles.
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
