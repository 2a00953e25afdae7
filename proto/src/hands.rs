//! Hands.

use glam::{Quat, Vec3};

use crate::v1::{self, presenting_hand::Form};

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
    /// A joint at this pose, so far from the skin.
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
