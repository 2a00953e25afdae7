//! The 26 joints of `XR_EXT_hand_tracking`, and the skin that follows them: the only place that converts between the thesis's
//! frames and `OpenXR` ones.

use glam::{Affine3A, Quat, Vec3};

use super::{HandPose, Handedness, kinematics, rig::Rig};
use crate::base::pose::Pose;

/// Number of joints.
pub const JOINT_COUNT: usize = 26;

/// Joint indices in `OpenXR` order.
pub mod index {
    /// Centre of the middle metacarpal.
    pub const PALM: usize = 0;
    /// The wrist.
    pub const WRIST: usize = 1;
    /// First joint of each digit, thumb first. The thumb has four joints (metacarpal, proximal, distal, tip), the
    /// fingers five (metacarpal, proximal, intermediate, distal, tip).
    pub const FIRST_OF_DIGIT: [usize; 5] = [2, 6, 11, 16, 21];
    /// The tip of each digit, thumb first.
    pub const TIP_OF_DIGIT: [usize; 5] = [5, 10, 15, 20, 25];
}

/// The joint names of the `WebXR` hand input module, in `OpenXR` order; "palm" exists in `OpenXR` only.
pub const JOINT_NAMES: [&str; JOINT_COUNT] = [
    "palm",
    "wrist",
    "thumb-metacarpal",
    "thumb-phalanx-proximal",
    "thumb-phalanx-distal",
    "thumb-tip",
    "index-finger-metacarpal",
    "index-finger-phalanx-proximal",
    "index-finger-phalanx-intermediate",
    "index-finger-phalanx-distal",
    "index-finger-tip",
    "middle-finger-metacarpal",
    "middle-finger-phalanx-proximal",
    "middle-finger-phalanx-intermediate",
    "middle-finger-phalanx-distal",
    "middle-finger-tip",
    "ring-finger-metacarpal",
    "ring-finger-phalanx-proximal",
    "ring-finger-phalanx-intermediate",
    "ring-finger-phalanx-distal",
    "ring-finger-tip",
    "pinky-finger-metacarpal",
    "pinky-finger-phalanx-proximal",
    "pinky-finger-phalanx-intermediate",
    "pinky-finger-phalanx-distal",
    "pinky-finger-tip",
];

/// The rotation between the axes of an `OpenXR` joint (-Z to the tip, +Y out of the back of the hand) and the thesis's
/// frame at the same point (+y to the tip, +z out of the palm): a half turn about (0, 1, -1), its own inverse.
pub(crate) const THESIS_FROM_OPENXR: Quat = Quat::from_xyzw(
    0.0,
    std::f32::consts::FRAC_1_SQRT_2,
    -std::f32::consts::FRAC_1_SQRT_2,
    0.0,
);

/// The `OpenXR` joint frame that corresponds to a thesis frame.
pub fn openxr_from_thesis_frame(frame: Pose) -> Pose {
    Pose {
        position: frame.position,
        orientation: frame.orientation * THESIS_FROM_OPENXR,
    }
}

/// The thesis frame that corresponds to an `OpenXR` joint frame.
pub fn thesis_from_openxr_frame(joint: Pose) -> Pose {
    // The half turn is its own inverse.
    openxr_from_thesis_frame(joint)
}

/// One joint, as headsets report it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joint {
    /// The joint's `OpenXR` frame.
    pub pose: Pose,
    /// Distance from the joint to the skin, in metres.
    pub radius: f32,
}

/// All joints of a hand, in `OpenXR` order and axes. Those of a missing finger are as in [`Rig`].
#[derive(Clone, Debug, PartialEq)]
pub struct HandJoints {
    /// Which hand.
    pub handedness: Handedness,
    /// The joints.
    pub joints: [Joint; JOINT_COUNT],
}

impl HandJoints {
    /// The joints of a posed rig, in the pose's frame.
    pub fn of_pose(rig: &Rig, pose: &HandPose) -> Self {
        let frames = kinematics::hand_frames(rig, pose);
        let wrist = frames.wrist;
        let mut thesis_frames = [wrist; JOINT_COUNT];
        for (digit, digit_frames) in frames.digits.iter().enumerate() {
            let mut next = index::FIRST_OF_DIGIT[digit];
            if digit > 0 {
                let start = wrist.transform_point(rig.finger_metacarpals[digit - 1]);
                let along = digit_frames.links[0].position - start;
                thesis_frames[next] = Pose {
                    position: start,
                    orientation: aim_y(wrist.orientation, along),
                };
                next += 1;
            }
            for link in digit_frames.links {
                thesis_frames[next] = link;
                next += 1;
            }
            thesis_frames[next] = Pose {
                position: digit_frames.tip,
                orientation: digit_frames.links[2].orientation,
            };
        }
        let metacarpal = thesis_frames[index::FIRST_OF_DIGIT[2]];
        let knuckle = thesis_frames[index::FIRST_OF_DIGIT[2] + 1];
        thesis_frames[index::PALM] = Pose {
            position: (metacarpal.position + knuckle.position) * 0.5,
            orientation: metacarpal.orientation,
        };
        let mut joints = [Joint {
            pose: wrist,
            radius: 0.0,
        }; JOINT_COUNT];
        for (joint, (frame, radius)) in joints
            .iter_mut()
            .zip(thesis_frames.into_iter().zip(rig.joint_radii))
        {
            *joint = Joint {
                pose: openxr_from_thesis_frame(frame),
                radius,
            };
        }
        Self {
            handedness: rig.handedness,
            joints,
        }
    }

    /// True if the hand has a joint, by `OpenXR` index: all but those of missing fingers, whose tips have no radius.
    pub fn has(&self, joint: usize) -> bool {
        let mut digits = index::FIRST_OF_DIGIT.into_iter().zip(index::TIP_OF_DIGIT);
        let tip = digits.find_map(|(first, tip)| (first..=tip).contains(&joint).then_some(tip));
        tip.is_none_or(|tip| self.joints[tip].radius > 0.0)
    }

    /// The same joints in another frame.
    #[must_use]
    pub fn transformed(&self, a_from_b: Pose) -> Self {
        let mut transformed = self.clone();
        // A loop, because `array::map` would not be inlined.
        for joint in &mut transformed.joints {
            joint.pose = a_from_b * joint.pose;
        }
        transformed
    }

    /// The centre of the palm's skin, in metres: one radius from the palm joint, on the palmar side.
    pub fn palm_skin(&self) -> Vec3 {
        let palm = self.joints[index::PALM];
        palm.pose.transform_point(Vec3::new(0.0, -palm.radius, 0.0))
    }
}

/// `orientation` after the smallest rotation that aligns its +y axis with `direction`.
fn aim_y(orientation: Quat, direction: Vec3) -> Quat {
    let y = orientation * Vec3::Y;
    Quat::from_rotation_arc(y, direction.normalize_or(y)) * orientation
}

/// A closed triangle mesh bound to the 26 joints.
#[derive(Clone, Debug)]
pub struct Skin {
    /// Vertex positions in the bind pose, in the frame of `bind`, in metres.
    pub positions: Vec<Vec3>,
    /// Triangles, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// The joints that move each vertex, as `OpenXR` indices.
    pub joint_indices: Vec<[u8; 4]>,
    /// The weights of these joints; each row sums to one.
    pub weights: Vec<[f32; 4]>,
    /// The joints in the bind pose.
    pub bind: HandJoints,
}

/// Largest factor by which a digit's thickness may change relative to the hand's size.
const MAX_THICKNESS_CHANGE: f32 = 1.35;

/// Shorter lengths count as zero, in metres.
const MIN_LENGTH: f32 = 1e-4;

/// The transform of a joint's skin: a point p of the joint's frame in [`Skin::bind_frames`] goes to `pose * (scale * p)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkinJoint {
    /// The joint's frame, with -Z along its bone.
    pub pose: Pose,
    /// Size of the bone relative to the bind pose along the frame's axes; 0 for a missing finger.
    pub scale: Vec3,
}

impl Skin {
    /// The vertex positions for joints at `joints`, in their frame and in metres. Where bones are longer or thicker
    /// than in the bind pose, the skin stretches along and across each bone. A missing finger's skin shrinks to its knuckle.
    pub fn posed(&self, joints: &HandJoints) -> Vec<Vec3> {
        let (skin_joints, bind_frames) = (self.joints_at(joints), self.bind_frames());
        let matrices: [Affine3A; JOINT_COUNT] = std::array::from_fn(|joint| {
            skin_joints[joint].pose.to_affine()
                * Affine3A::from_scale(skin_joints[joint].scale)
                * bind_frames[joint].to_affine().inverse()
        });
        self.positions
            .iter()
            .zip(self.joint_indices.iter().zip(&self.weights))
            .map(|(&position, (joint_indices, weights))| {
                let mut posed = Vec3::ZERO;
                for (&joint, &weight) in joint_indices.iter().zip(weights) {
                    if weight > 0.0 {
                        posed += weight * matrices[usize::from(joint)].transform_point3(position);
                    }
                }
                posed
            })
            .collect()
    }

    /// The bone transforms for joints at `joints`, in their frame. Linear blend skinning with these gives [`Skin::posed`].
    pub fn joints_at(&self, joints: &HandJoints) -> [SkinJoint; JOINT_COUNT] {
        let size = ratio(hand_length(joints), hand_length(&self.bind));
        std::array::from_fn(|joint| SkinJoint {
            pose: bone_frame(joints, joint),
            scale: joint_scale(&self.bind, joints, joint, size),
        })
    }

    /// The joints' frames in the bind pose, in the frame of [`Skin::bind`], with -Z along the bones.
    pub fn bind_frames(&self) -> [Pose; JOINT_COUNT] {
        std::array::from_fn(|joint| bone_frame(&self.bind, joint))
    }
}

/// The scale of a joint's skin across (x, y) and along (z) its bone; `size` is the ratio of the hands' lengths.
fn joint_scale(bind: &HandJoints, target: &HandJoints, joint: usize, size: f32) -> Vec3 {
    let along = ratio(bone(target, joint).length(), bone(bind, joint).length());
    if joint == index::WRIST || joint == index::PALM {
        return Vec3::splat(size);
    }
    if !target.has(joint) && !index::FIRST_OF_DIGIT.contains(&joint) {
        return Vec3::ZERO;
    }
    if index::FIRST_OF_DIGIT.contains(&joint) {
        // The palm is one piece: it scales with the hand, not with the tracked radius of one joint.
        return Vec3::new(size, size, along);
    }
    let across = ratio(target.joints[joint].radius, bind.joints[joint].radius);
    let across = across.clamp(size / MAX_THICKNESS_CHANGE, size * MAX_THICKNESS_CHANGE);
    Vec3::new(across, across, along)
}

/// A joint's frame with its -Z axis aligned with its bone: trackers report metacarpals up to 15° off.
fn bone_frame(hand: &HandJoints, joint: usize) -> Pose {
    let Pose {
        position,
        orientation,
    } = hand.joints[joint].pose;
    let bone = bone(hand, joint);
    let keeps_own = joint == index::WRIST || joint == index::PALM || index::TIP_OF_DIGIT.contains(&joint);
    let turn = if keeps_own || bone.length() < MIN_LENGTH {
        None
    } else {
        let forward = orientation * Vec3::NEG_Z;
        Some(Quat::from_rotation_arc(forward, bone.normalize_or(forward)))
    };
    Pose {
        position,
        orientation: turn.map_or(orientation, |turn| turn * orientation),
    }
}

/// Distance from the wrist to the knuckle of the middle finger, in metres.
fn hand_length(hand: &HandJoints) -> f32 {
    bone(hand, index::WRIST).length()
}

/// The bone of a joint, in metres. Tips share the distal bone; wrist and palm use the line from wrist to middle knuckle.
fn bone(hand: &HandJoints, joint: usize) -> Vec3 {
    let (from, to) = match joint {
        index::PALM | index::WRIST => (index::WRIST, index::FIRST_OF_DIGIT[2] + 1),
        tip if index::TIP_OF_DIGIT.contains(&tip) => (tip - 1, tip),
        other => (other, other + 1),
    };
    hand.joints[to].pose.position - hand.joints[from].pose.position
}

/// `target` divided by `bind`; 1 if either counts as zero.
fn ratio(target: f32, bind: f32) -> f32 {
    if bind > MIN_LENGTH && target > MIN_LENGTH {
        target / bind
    } else {
        1.0
    }
}
