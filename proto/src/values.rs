//! Values of messages: numbers, poses, hands and parts of space; and the names of codes.
//!
//! Methods named after a field return its meaning: an absent position is the origin, for instance.

use std::{ops::Mul, time::Duration};

use glam::{Quat, Vec3};
use tonic::Code;

use crate::v1::{self, presenting_hand::Form, shape::Kind};

/// The name of a code as the gRPC specification writes it, such as `INVALID_ARGUMENT`.
#[must_use]
pub fn code_name(code: Code) -> &'static str {
    match code {
        Code::Ok => "OK",
        Code::Cancelled => "CANCELLED",
        Code::Unknown => "UNKNOWN",
        Code::InvalidArgument => "INVALID_ARGUMENT",
        Code::DeadlineExceeded => "DEADLINE_EXCEEDED",
        Code::NotFound => "NOT_FOUND",
        Code::AlreadyExists => "ALREADY_EXISTS",
        Code::PermissionDenied => "PERMISSION_DENIED",
        Code::ResourceExhausted => "RESOURCE_EXHAUSTED",
        Code::FailedPrecondition => "FAILED_PRECONDITION",
        Code::Aborted => "ABORTED",
        Code::OutOfRange => "OUT_OF_RANGE",
        Code::Unimplemented => "UNIMPLEMENTED",
        Code::Internal => "INTERNAL",
        Code::Unavailable => "UNAVAILABLE",
        Code::DataLoss => "DATA_LOSS",
        Code::Unauthenticated => "UNAUTHENTICATED",
    }
}

/// A duration of a message. Negative ones, which no sound message has, are 0.
#[must_use]
pub fn std_duration(duration: prost_types::Duration) -> Duration {
    // The conversion of prost's overflows for the least number of seconds.
    match (u64::try_from(duration.seconds), u32::try_from(duration.nanos)) {
        (Ok(seconds), Ok(nanos)) => Duration::new(seconds, nanos),
        _ => Duration::ZERO,
    }
}

/// A duration for a message. Saturates far beyond any budget or deadline.
#[must_use]
pub fn wire_duration(duration: Duration) -> prost_types::Duration {
    prost_types::Duration {
        seconds: i64::try_from(duration.as_secs()).unwrap_or(i64::MAX),
        nanos: duration.subsec_nanos().cast_signed(),
    }
}

impl From<Vec3> for v1::Vector3 {
    fn from(Vec3 { x, y, z }: Vec3) -> Self {
        Self { x, y, z }
    }
}

impl From<v1::Vector3> for Vec3 {
    fn from(v1::Vector3 { x, y, z }: v1::Vector3) -> Self {
        Self::new(x, y, z)
    }
}

impl From<Quat> for v1::Quaternion {
    fn from(quaternion: Quat) -> Self {
        let [x, y, z, w] = quaternion.to_array();
        Self { x, y, z, w }
    }
}

impl From<v1::Quaternion> for Quat {
    fn from(v1::Quaternion { x, y, z, w }: v1::Quaternion) -> Self {
        Self::from_xyzw(x, y, z, w)
    }
}

/// A vector; an absent one is 0.
pub(crate) fn vector(vector: Option<v1::Vector3>) -> Vec3 {
    vector.map_or(Vec3::ZERO, Vec3::from)
}

impl v1::Pose {
    /// A pose at this position, with this orientation.
    #[must_use]
    pub fn new(position: Vec3, orientation: Quat) -> Self {
        Self {
            position: Some(position.into()),
            orientation: Some(orientation.into()),
        }
    }

    /// Where its origin is.
    #[must_use]
    pub fn position(&self) -> Vec3 {
        vector(self.position)
    }

    /// How it is turned.
    #[must_use]
    pub fn orientation(&self) -> Quat {
        self.orientation.map_or(Quat::IDENTITY, Quat::from)
    }

    /// `b_from_a` of `a_from_b`.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let orientation = self.orientation().conjugate();
        Self::new(-(orientation * self.position()), orientation)
    }

    /// Maps a point of frame b to frame a.
    #[must_use]
    pub fn transform_point(&self, point: Vec3) -> Vec3 {
        self.orientation() * point + self.position()
    }
}

impl Mul for v1::Pose {
    type Output = Self;

    /// `a_from_b * b_from_c = a_from_c`.
    fn mul(self, b_from_c: Self) -> Self {
        Self::new(
            self.transform_point(b_from_c.position()),
            self.orientation() * b_from_c.orientation(),
        )
    }
}

/// Number of joints in `XR_EXT_hand_tracking`.
pub const JOINT_COUNT: usize = 26;

impl v1::HandPose {
    /// A hand of a rig, such as "rigs/adult", without a place and with no digit posed.
    pub fn new(rig: impl Into<String>, handedness: v1::Handedness) -> Self {
        Self {
            rig: rig.into(),
            handedness: handedness.into(),
            ..Self::default()
        }
    }

    /// The same hand with its wrist's joint here in the client's frame.
    #[must_use]
    pub fn with_client_from_wrist(self, client_from_wrist: v1::Pose) -> Self {
        Self {
            client_from_wrist: Some(client_from_wrist),
            ..self
        }
    }

    /// The same hand with its wrist's joint here in the object's frame.
    #[must_use]
    pub fn with_object_from_wrist(self, object_from_wrist: v1::Pose) -> Self {
        Self {
            object_from_wrist: Some(object_from_wrist),
            ..self
        }
    }

    /// The digits, thumb first.
    #[must_use]
    pub fn digits(&self) -> [Option<&v1::DigitAngles>; 5] {
        [&self.thumb, &self.index, &self.middle, &self.ring, &self.little].map(Option::as_ref)
    }

    /// The same hand with these digits, thumb first.
    #[must_use]
    pub fn with_digits(self, digits: [Option<v1::DigitAngles>; 5]) -> Self {
        let [thumb, index, middle, ring, little] = digits;
        Self {
            thumb,
            index,
            middle,
            ring,
            little,
            ..self
        }
    }

    /// How many times as large as its rig it is.
    #[must_use]
    pub fn size(&self) -> f32 {
        self.scale.unwrap_or(1.0)
    }

    /// The joints of an answer; `None` for those that the hand does not have.
    #[must_use]
    pub fn posed_joints(&self) -> [Option<v1::JointPose>; JOINT_COUNT] {
        std::array::from_fn(|i| self.joints.get(i).filter(|joint| joint.pose.is_some()).copied())
    }

    /// Where the object is, if the hand has both wrists, as those of answers have.
    #[must_use]
    pub fn client_from_object(&self) -> Option<v1::Pose> {
        Some(self.client_from_wrist? * self.object_from_wrist?.inverse())
    }
}

impl v1::DigitAngles {
    /// These angles: yaw and pitch of the base joint, pitch of the second and of the third.
    #[must_use]
    pub const fn new([base_yaw, base_pitch, second_pitch, third_pitch]: [f32; 4]) -> Self {
        Self {
            base_yaw,
            base_pitch,
            second_pitch,
            third_pitch: Some(third_pitch),
        }
    }
}

impl v1::JointPose {
    /// A joint at this pose, at this distance from the skin.
    #[must_use]
    pub fn new(pose: v1::Pose, radius: f32) -> Self {
        Self {
            pose: Some(pose),
            radius,
        }
    }

    /// Where it is.
    #[must_use]
    pub fn position(&self) -> Vec3 {
        self.pose.unwrap_or_default().position()
    }

    /// How it is turned.
    #[must_use]
    pub fn orientation(&self) -> Quat {
        self.pose.unwrap_or_default().orientation()
    }
}

impl v1::HandJoints {
    /// A tracked hand.
    pub fn new(handedness: v1::Handedness, joints: impl Into<Vec<v1::JointPose>>) -> Self {
        Self {
            handedness: handedness.into(),
            joints: joints.into(),
        }
    }
}

impl v1::HandMesh {
    /// A mesh of these vertices, in the client's frame, and triangles.
    pub fn new(
        vertices: impl IntoIterator<Item = Vec3>,
        triangles: impl IntoIterator<Item = [u32; 3]>,
    ) -> Self {
        Self {
            client_coordinates: vertices
                .into_iter()
                .flat_map(|vertex| vertex.to_array())
                .collect(),
            triangles: triangles.into_iter().flatten().collect(),
            client_from_wrist: None,
        }
    }

    /// The vertices, in the client's frame.
    pub fn vertices(&self) -> impl Iterator<Item = Vec3> {
        let (vertices, _) = self.client_coordinates.as_chunks();
        vertices.iter().copied().map(Vec3::from_array)
    }

    /// The vertices of each triangle.
    #[must_use]
    pub fn faces(&self) -> &[[u32; 3]] {
        self.triangles.as_chunks().0
    }
}

impl From<v1::HandPose> for v1::PresentingHand {
    fn from(pose: v1::HandPose) -> Self {
        Self {
            form: Some(Form::Pose(pose)),
        }
    }
}

impl From<v1::HandJoints> for v1::PresentingHand {
    fn from(joints: v1::HandJoints) -> Self {
        Self {
            form: Some(Form::Joints(joints)),
        }
    }
}

impl From<v1::HandMesh> for v1::PresentingHand {
    fn from(mesh: v1::HandMesh) -> Self {
        Self {
            form: Some(Form::Mesh(mesh)),
        }
    }
}

impl v1::Shape {
    /// A ball.
    #[must_use]
    pub fn ball(center: Vec3, radius: f32) -> Self {
        Self::tube([center], radius)
    }

    /// All points within a radius of a segment.
    #[must_use]
    pub fn capsule(start: Vec3, end: Vec3, radius: f32) -> Self {
        Self::tube([start, end], radius)
    }

    /// All points within a radius of a line through points.
    pub fn tube(points: impl IntoIterator<Item = Vec3>, radius: f32) -> Self {
        Self {
            kind: Some(Kind::Tube(v1::TubeShape {
                points: points.into_iter().map(Into::into).collect(),
                radii: vec![radius],
            })),
        }
    }

    /// A box by its frame and half its edges. A floor is a wide one whose upper face is the ground.
    #[must_use]
    pub fn solid_box(pose: v1::Pose, half_extents: Vec3) -> Self {
        Self {
            kind: Some(Kind::Box(v1::BoxShape {
                pose: Some(pose),
                half_extents: Some(half_extents.into()),
            })),
        }
    }

    /// The side of a plane through a point that a direction points to.
    #[must_use]
    pub fn half_space(point: Vec3, normal: Vec3) -> Self {
        Self {
            kind: Some(Kind::HalfSpace(v1::HalfSpaceShape {
                point: Some(point.into()),
                normal: Some(normal.into()),
            })),
        }
    }
}

impl v1::BoxShape {
    /// Half its edges.
    #[must_use]
    pub fn half_extents(&self) -> Vec3 {
        vector(self.half_extents)
    }
}
