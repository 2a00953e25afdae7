//! Holdouts: an object held out to the receiver, the up direction, the giver's hand, and other hands and obstacles.

use std::sync::Arc;

use glam::Vec3;

use super::{
    hand::joints::{HandJoints, Skin, index},
    object::GraspObject,
};
use crate::{
    base::{pose::Pose, random::AttemptStream},
    geometry::{
        boxes::OrientedBox,
        mesh::{MeshError, TriangleMesh},
        mesh_bvh::MeshBvh,
        surface_samples::SurfaceSampler,
        tapered_capsule::TaperedCapsule,
    },
};

/// Another person's hand, posed, in the object's frame.
#[derive(Clone, Debug)]
pub enum HandShape {
    /// Its joints.
    Joints(Box<HandJoints>),
    /// Its mesh.
    Mesh(Arc<HandMesh>),
}

/// The giver's hand, posed, in the object's frame.
#[derive(Clone, Debug)]
pub struct PresentingHand {
    /// Its shape.
    pub shape: HandShape,
    /// The posed skin with search structure; `None` under `PHYSICAL` validity, which uses the hand's solids alone.
    pub skin: Option<MeshBvh>,
    /// The centre of the palm's skin, in metres.
    pub palm: Vec3,
}

/// An object held out to the receiver, in the object's frame.
#[derive(Clone, Debug)]
pub struct Holdout {
    /// The object.
    pub object: Arc<GraspObject>,
    /// The giver's hand; `None` for an object that floats freely.
    pub presenting_hand: Option<PresentingHand>,
    /// Further hands to keep clear of. `THESIS` validity ignores them.
    pub other_hands: Vec<HandShape>,
    /// Obstacles to keep clear of. `THESIS` validity ignores them.
    pub obstacles: Vec<Obstacle>,
    /// Where the receiver's arm may come from. `THESIS` validity ignores it.
    pub stance: Stance,
    /// The direction against gravity, a unit vector.
    pub up: Vec3,
}

/// Why a presenting hand was rejected.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PresentingHandError {
    /// The joints collapse every triangle of the skin.
    #[error("the joint poses fold the skin into triangles without area")]
    Collapsed,
    /// A joint is not finite, or so far away that the skin is not.
    #[error(
        "the joint poses put vertex {vertex} of the skin at infinity; they must be finite and near the object"
    )]
    NotFinite {
        /// Index of the vertex.
        vertex: usize,
    },
    /// The skin itself is invalid.
    #[error("the skin is not a mesh: {0}")]
    Skin(MeshError),
}

impl Holdout {
    /// A holdout with everything in the object's frame, without further hands or obstacles, to a receiver who faces the giver;
    /// `up` points against gravity; `None` if it is not a unit vector.
    pub fn new(object: Arc<GraspObject>, presenting_hand: Option<PresentingHand>, up: Vec3) -> Option<Self> {
        up.is_normalized().then(|| Self {
            object,
            presenting_hand,
            other_hands: Vec::new(),
            obstacles: Vec::new(),
            stance: Stance::default(),
            up,
        })
    }
}

impl HandShape {
    /// The wrist's `OpenXR` joint frame, if it is known.
    pub fn wrist(&self) -> Option<Pose> {
        match self {
            Self::Joints(joints) => Some(joints.joints[index::WRIST].pose),
            Self::Mesh(mesh) => mesh.wrist,
        }
    }

    /// The joints, if they are known.
    pub fn joints(&self) -> Option<&HandJoints> {
        match self {
            Self::Joints(joints) => Some(joints),
            Self::Mesh(_) => None,
        }
    }
}

impl PresentingHand {
    /// Poses a skin on joints. Triangles that the pose collapses are dropped.
    ///
    /// # Errors
    /// The joints collapse the whole skin or are not finite.
    pub fn in_frame(
        skin: &Skin,
        joints: &HandJoints,
        object_from_frame: Pose,
    ) -> Result<Self, PresentingHandError> {
        let joints = joints.transformed(object_from_frame);
        let mesh =
            TriangleMesh::without_degenerates(skin.posed(&joints), &skin.triangles).map_err(|error| {
                match error {
                    MeshError::Empty => PresentingHandError::Collapsed,
                    MeshError::NotFinite { vertex } => PresentingHandError::NotFinite { vertex },
                    broken @ (MeshError::IndexOutOfRange { .. } | MeshError::Degenerate { .. }) => {
                        PresentingHandError::Skin(broken)
                    }
                }
            })?;
        Ok(Self {
            palm: joints.palm_skin(),
            shape: HandShape::Joints(Box::new(joints)),
            skin: Some(MeshBvh::build_quick(mesh)),
        })
    }

    /// A hand without skin, for `PHYSICAL` validity, which takes a thousandth of the time. The joints must be finite and in the
    /// object's frame.
    pub fn of_joints(joints: HandJoints) -> Self {
        Self {
            palm: joints.palm_skin(),
            shape: HandShape::Joints(Box::new(joints)),
            skin: None,
        }
    }

    /// A hand known by its mesh alone, for either validity.
    pub fn of_mesh(mesh: Arc<HandMesh>) -> Self {
        Self {
            palm: mesh.palm(),
            shape: HandShape::Mesh(mesh),
            skin: None,
        }
    }

    /// Its surface with search structure, which `THESIS` validity requires.
    pub fn surface(&self) -> Option<&MeshBvh> {
        match &self.shape {
            HandShape::Joints(_) => self.skin.as_ref(),
            HandShape::Mesh(mesh) => Some(&mesh.surface),
        }
    }
}

/// A solid that the receiving hand and forearm keep clear of. It may touch the object or contain it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Obstacle {
    /// A capsule.
    Capsule(TaperedCapsule),
    /// A box, in the frame of its `object_from_box`.
    Box(OrientedBox),
}

impl Obstacle {
    /// The same obstacle in another frame.
    #[must_use]
    pub fn transformed(&self, a_from_b: Pose) -> Self {
        match self {
            Self::Capsule(capsule) => Self::Capsule(capsule.transformed(a_from_b)),
            Self::Box(solid) => Self::Box(OrientedBox {
                object_from_box: a_from_b * solid.object_from_box,
                ..*solid
            }),
        }
    }
}

/// Length of an adult's upper arm, from the shoulder joint to the elbow, in metres (means of women and men in ANSUR II,
/// shoulder to elbow, less the flesh above the joint).
pub const UPPER_ARM_LENGTH: f32 = 0.30;

/// Length of an adult's forearm, from the elbow to the wrist, in metres (ANSUR II, radiale to stylion).
pub const FOREARM_LENGTH: f32 = 0.26;

/// Where the arm of the receiving hand may come from.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Stance {
    /// From anywhere.
    Any,
    /// Preferably from a receiver who faces the giver; without a giver, preferably not from beneath.
    #[default]
    Facing,
    /// From this shoulder only.
    At(Arm),
}

/// An arm of two bones: the shoulder, in the object's frame, and the lengths in metres, each more than 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arm {
    /// The shoulder joint.
    pub shoulder: Vec3,
    /// From the shoulder to the elbow.
    pub upper_arm: f32,
    /// From the elbow to the wrist.
    pub forearm: f32,
}

/// A posed arm, in the frame of its hand's pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ArmPose {
    /// The shoulder joint, in metres.
    pub shoulder: Vec3,
    /// The elbow, in metres.
    pub elbow: Vec3,
    /// Flexion of the wrist toward the palm, in radians; negative for extension.
    pub flexion: f32,
    /// Deviation of the wrist toward the little finger, in radians; negative toward the thumb.
    pub deviation: f32,
    /// True if the shoulder was assumed, for a receiver who faces the giver, not given by the client.
    pub is_assumed: bool,
}

impl Stance {
    /// The same stance, expressed in frame b.
    #[must_use]
    pub fn transformed(self, b_from_a: Pose) -> Self {
        match self {
            Self::At(arm) => Self::At(Arm {
                shoulder: b_from_a.transform_point(arm.shoulder),
                ..arm
            }),
            Self::Any | Self::Facing => self,
        }
    }
}

/// Number of balls that approximate the hand from inside: as many as a hand of joints has solids.
const BALLS: usize = 48;

/// Distance of the palm's middle from the wrist in metres, for an adult.
const WRIST_TO_PALM: f32 = 0.08;

/// A person's hand as a mesh, which may include more of the body.
#[derive(Clone, Debug)]
pub struct HandMesh {
    /// The mesh with search structure. Where it is open, as at the wrist, the winding number decides what is inside.
    pub surface: MeshBvh,
    /// The wrist's `OpenXR` joint frame, if it is known.
    pub wrist: Option<Pose>,
    /// Balls inside its volume, the largest first; `None` if it has no volume.
    pub balls: Vec<Ball>,
}

impl HandMesh {
    /// Prepares a mesh, in a millisecond or two for 5,000 triangles. Mesh and wrist are in the same frame.
    pub fn new(mesh: TriangleMesh, wrist: Option<Pose>) -> Self {
        let surface = MeshBvh::build_quick(mesh);
        Self {
            balls: inner_balls(&surface, BALLS),
            surface,
            wrist,
        }
    }

    /// The middle of the palm, in metres: an adult's distance in front of the wrist, or the box's centre if the wrist is unknown.
    pub fn palm(&self) -> Vec3 {
        match self.wrist {
            Some(wrist) => wrist.transform_point(Vec3::NEG_Z * WRIST_TO_PALM),
            None => self.surface.aabb().centre(),
        }
    }
}

/// Points of the surface at which balls are grown. Twice as many fill a hand hardly better.
const SAMPLES: u64 = 192;

/// Seed of the points.
const SEED: u64 = 1;

/// Largest radius in metres: more than half the thickness of a forearm.
const LARGEST: f32 = 0.06;

/// Steps in which a ball shrinks. Most are done after four.
const STEPS: usize = 8;

/// Share of a radius by which the last step may change it.
const SETTLED: f32 = 0.01;

/// Bound on the rounding error of a radius, in metres.
const ROUNDING: f32 = 2e-6;

/// A ball.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    /// Its centre.
    pub centre: Vec3,
    /// Its radius in metres.
    pub radius: f32,
}

/// Up to `count` balls inside a mesh's volume, largest first, none centred in an earlier one (Ma, Bae and Choi, "3D medial axis
/// point approximation using nearest neighbors and the normal field", 2012). `None` if the mesh has no volume.
pub fn inner_balls(surface: &MeshBvh, count: usize) -> Vec<Ball> {
    let outward = surface.mesh().signed_volume().signum() as f32;
    let sampler = SurfaceSampler::new(surface.mesh(), |_| true);
    let mut grown: Vec<Ball> = (0..SAMPLES)
        .filter_map(|sample| {
            let (triangle, point) = sampler.sample(sample, SAMPLES, &mut AttemptStream::new(SEED, sample))?;
            ball_at(surface, point, surface.mesh().normal(triangle) * outward)
        })
        .collect();
    grown.sort_by(|a, b| b.radius.total_cmp(&a.radius));
    let mut chosen: Vec<Ball> = Vec::with_capacity(count);
    for ball in grown {
        if chosen.len() == count {
            break;
        }
        let is_covered = |earlier: &Ball| earlier.centre.distance(ball.centre) < earlier.radius;
        if !chosen.iter().any(is_covered) {
            chosen.push(ball);
        }
    }
    chosen
}

/// The ball inside the volume that touches the surface at a point with an outward normal; `None` if there is no room.
fn ball_at(surface: &MeshBvh, point: Vec3, normal: Vec3) -> Option<Ball> {
    let mut radius = LARGEST;
    for _ in 0..STEPS {
        let centre = point - normal * radius;
        let Some(nearest) = surface.closest_point_within(centre, radius) else {
            break;
        };
        let offset = point - nearest.position;
        let along = offset.dot(normal);
        if along <= 0.0 || nearest.distance >= radius * (1.0 - SETTLED) {
            break;
        }
        radius = radius.min(offset.length_squared() / (2.0 * along));
    }
    let centre = point - normal * radius;
    let nearest = surface.closest_point_within(centre, LARGEST)?;
    let radius = nearest.distance - ROUNDING;
    (radius > 0.0 && surface.contains(centre)).then_some(Ball { centre, radius })
}
