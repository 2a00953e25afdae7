//! The engines' conventions: the only place that converts poses, points, directions and joint orders of messages to
//! `OpenXR` and back.
//!
//! `OpenXR` is right-handed, +Y up, in metres. Unity mirrors z, Unreal permutes the axes and uses centimetres: both are
//! changes of basis that apply to every frame. Godot keeps the basis, but its `XRHandTracker` rotates each hand joint
//! by a half turn, so joint frames convert differently from other poses. Some importers of Unity and Unreal have other axes for
//! meshes than the engines have for the poses of headsets: frames of objects then differ by a turn, and nothing else does.
//!
//! Functions come in pairs: `*_to_openxr` converts from the client's convention, `*_from_openxr` to it.

use glam::{Quat, Vec3};
use grasp_proto::v1;
use grasp_synthesis::{base::pose::Pose, model::hand::joints::JOINT_COUNT};

const CENTIMETRES_PER_METRE: f32 = 100.0;

/// The half turn about (0, -1, 1) between an `OpenXR` joint's axes and those of Godot's `XRHandTracker`. It is its own
/// inverse, up to the quaternion's sign.
const GODOT_JOINT_TURN: Quat = Quat::from_xyzw(
    0.0,
    -std::f32::consts::FRAC_1_SQRT_2,
    std::f32::consts::FRAC_1_SQRT_2,
    0.0,
);

/// Turns (x, y, -z) into (-x, y, z), in Unity's axes.
const HALF_TURN_ABOUT_Y: Quat = Quat::from_xyzw(0.0, 1.0, 0.0, 0.0);

/// Turns (-z, x, y) into (x, z, y), in Unreal's axes.
const QUARTER_TURN_ABOUT_Z: Quat = Quat::from_xyzw(
    0.0,
    0.0,
    -std::f32::consts::FRAC_1_SQRT_2,
    std::f32::consts::FRAC_1_SQRT_2,
);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Convention {
    /// Right-handed, +Y up, metres; also Bevy and `WebXR`.
    OpenXr,
    /// Left-handed, +Y up, +Z forward, metres.
    Unity,
    /// Left-handed, +Z up, +X forward, centimetres.
    Unreal,
    /// Like `OpenXr`, except for the axes of hand joints.
    Godot,
    /// Like `Unity`, with frames of objects as importers make them that flip x.
    UnityFlipX,
    /// Like `Unreal`, with frames of objects as its own importers make them: (x, z, y).
    UnrealXzy,
}

impl Convention {
    /// The convention of a request; unspecified means `OpenXR`.
    pub(crate) fn from_wire(convention: v1::Convention) -> Self {
        match convention {
            v1::Convention::Unspecified | v1::Convention::Openxr => Self::OpenXr,
            v1::Convention::Unity => Self::Unity,
            v1::Convention::UnityFlipX => Self::UnityFlipX,
            v1::Convention::Unreal => Self::Unreal,
            v1::Convention::UnrealXzy => Self::UnrealXzy,
            v1::Convention::Godot => Self::Godot,
        }
    }

    pub(crate) fn to_wire(self) -> v1::Convention {
        match self {
            Self::OpenXr => v1::Convention::Openxr,
            Self::Unity => v1::Convention::Unity,
            Self::UnityFlipX => v1::Convention::UnityFlipX,
            Self::Unreal => v1::Convention::Unreal,
            Self::UnrealXzy => v1::Convention::UnrealXzy,
            Self::Godot => v1::Convention::Godot,
        }
    }

    fn is_unity(self) -> bool {
        matches!(self, Self::Unity | Self::UnityFlipX)
    }

    fn is_unreal(self) -> bool {
        matches!(self, Self::Unreal | Self::UnrealXzy)
    }

    fn units_per_metre(self) -> f32 {
        if self.is_unreal() {
            CENTIMETRES_PER_METRE
        } else {
            1.0
        }
    }

    pub(crate) fn length_to_openxr(self, length: f32) -> f32 {
        length / self.units_per_metre()
    }

    pub(crate) fn length_from_openxr(self, metres: f32) -> f32 {
        metres * self.units_per_metre()
    }

    /// Converts a direction, or a force in newtons: the axes change, the length does not.
    pub(crate) fn direction_to_openxr(self, v: Vec3) -> Vec3 {
        if self.is_unity() {
            Vec3::new(v.x, v.y, -v.z)
        } else if self.is_unreal() {
            Vec3::new(v.y, v.z, -v.x)
        } else {
            v
        }
    }

    pub(crate) fn direction_from_openxr(self, v: Vec3) -> Vec3 {
        if self.is_unreal() {
            Vec3::new(-v.z, v.x, v.y)
        } else {
            self.direction_to_openxr(v)
        }
    }

    pub(crate) fn point_to_openxr(self, point: Vec3) -> Vec3 {
        self.direction_to_openxr(point).map(|x| self.length_to_openxr(x))
    }

    pub(crate) fn point_from_openxr(self, point: Vec3) -> Vec3 {
        self.direction_from_openxr(point)
            .map(|x| self.length_from_openxr(x))
    }

    /// A turn whose axis was converted by a change of basis that mirrors, unless it is `OpenXR`'s.
    fn turn(self, axis: Vec3, w: f32) -> Quat {
        let (axis, w) = if self.is_unity() {
            (-axis, w)
        } else if self.is_unreal() {
            (axis, -w)
        } else {
            (axis, w)
        };
        Quat::from_xyzw(axis.x, axis.y, axis.z, w)
    }

    /// Converts the pose of anything but a hand joint.
    pub(crate) fn pose_to_openxr(self, pose: Pose) -> Pose {
        let q = pose.orientation;
        Pose {
            position: self.point_to_openxr(pose.position),
            orientation: self.turn(self.direction_to_openxr(q.xyz()), q.w),
        }
    }

    pub(crate) fn pose_from_openxr(self, pose: Pose) -> Pose {
        let q = pose.orientation;
        Pose {
            position: self.point_from_openxr(pose.position),
            orientation: self.turn(self.direction_from_openxr(q.xyz()), q.w),
        }
    }

    /// Converts the pose of a hand joint or wrist.
    pub(crate) fn joint_to_openxr(self, joint: Pose) -> Pose {
        self.joint_turned(self.pose_to_openxr(joint))
    }

    pub(crate) fn joint_from_openxr(self, joint: Pose) -> Pose {
        self.pose_from_openxr(self.joint_turned(joint))
    }

    /// A joint with Godot's half turn added or removed.
    fn joint_turned(self, mut joint: Pose) -> Pose {
        if self == Self::Godot {
            joint.orientation *= GODOT_JOINT_TURN;
        }
        joint
    }

    /// The rotation of an object's frame from the engine's own axes to those of its importer.
    fn importer_turn(self) -> Quat {
        match self {
            Self::OpenXr | Self::Unity | Self::Unreal | Self::Godot => Quat::IDENTITY,
            Self::UnityFlipX => HALF_TURN_ABOUT_Y,
            Self::UnrealXzy => QUARTER_TURN_ABOUT_Z,
        }
    }

    /// Converts the pose of an object, or of a model's node.
    pub(crate) fn object_to_openxr(self, object: Pose) -> Pose {
        self.pose_to_openxr(Pose {
            orientation: object.orientation * self.importer_turn(),
            ..object
        })
    }

    pub(crate) fn object_from_openxr(self, object: Pose) -> Pose {
        let pose = self.pose_from_openxr(object);
        Pose {
            orientation: pose.orientation * self.importer_turn().conjugate(),
            ..pose
        }
    }

    pub(crate) fn joint_at_object_to_openxr(self, joint: Pose) -> Pose {
        self.joint_to_openxr(turned_as_whole(self.importer_turn().conjugate(), joint))
    }

    pub(crate) fn joint_at_object_from_openxr(self, joint: Pose) -> Pose {
        turned_as_whole(self.importer_turn(), self.joint_from_openxr(joint))
    }

    pub(crate) fn point_at_object_from_openxr(self, point: Vec3) -> Vec3 {
        self.importer_turn() * self.point_from_openxr(point)
    }

    pub(crate) fn direction_at_object_from_openxr(self, v: Vec3) -> Vec3 {
        self.importer_turn() * self.direction_from_openxr(v)
    }

    /// The `OpenXR` index of the joint at `place` in the convention's list of 26. It is its own inverse: Unity swaps
    /// palm and wrist.
    pub(crate) fn joint_at(self, place: usize) -> usize {
        debug_assert!(place < JOINT_COUNT);
        match place {
            0 | 1 if self.is_unity() => 1 - place,
            other => other,
        }
    }
}

/// A pose turned with its position. Not as a product of poses, which would round: contacts at the edge of touching depend on it.
fn turned_as_whole(turn: Quat, pose: Pose) -> Pose {
    Pose {
        position: turn * pose.position,
        orientation: turn * pose.orientation,
    }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::FRAC_1_SQRT_2;

    use glam::Mat3;

    use super::*;
    use crate::validate::fixtures::CONVENTIONS;

    /// The documented change of basis, written independently: the columns are the `OpenXR` axes in the engine's.
    fn engine_from_openxr(convention: Convention) -> Mat3 {
        match convention {
            Convention::OpenXr | Convention::Godot => Mat3::IDENTITY,
            Convention::Unity | Convention::UnityFlipX => Mat3::from_cols(Vec3::X, Vec3::Y, -Vec3::Z),
            Convention::Unreal | Convention::UnrealXzy => Mat3::from_cols(Vec3::Y, Vec3::Z, -Vec3::X),
        }
    }

    fn samples() -> Vec<Pose> {
        let pose = |i| {
            let t = i as f32;
            let axis = Vec3::new((t * 1.3).sin(), (t * 0.7).cos(), (t * 2.1).sin() + 0.1);
            Pose::new(
                Vec3::new((t * 0.9).sin(), (t * 1.7).cos() * 2.0, t * 0.1 - 2.0),
                Quat::from_axis_angle(axis.normalize_or(Vec3::X), t * 0.37 - 5.0),
            )
        };
        (0..40).map(pose).collect()
    }

    #[test]
    fn axes_that_only_change_signs_or_places_round_nothing() {
        let joint = Pose::new(
            Vec3::new(0.047_363_63, 0.089_985_74, -0.088_077_92),
            Quat::from_xyzw(0.043_911_28, -0.257_695_65, -0.329_200_7, 0.907_354_3),
        );
        for convention in [Convention::OpenXr, Convention::Unity, Convention::UnityFlipX] {
            let at_object = convention.joint_at_object_from_openxr(joint);
            assert_eq!(convention.joint_at_object_to_openxr(at_object), joint);
            let object = convention.object_from_openxr(joint);
            assert_eq!(convention.object_to_openxr(object), joint);
        }
    }

    #[test]
    fn conversions_there_and_back_are_the_identity() {
        for convention in CONVENTIONS {
            assert_eq!(Convention::from_wire(convention.to_wire()), convention);
            for pose in samples() {
                for back in [
                    convention.pose_to_openxr(convention.pose_from_openxr(pose)),
                    convention.joint_to_openxr(convention.joint_from_openxr(pose)),
                    convention.pose_from_openxr(convention.pose_to_openxr(pose)),
                    convention.joint_from_openxr(convention.joint_to_openxr(pose)),
                ] {
                    let is_near = back.position.distance(pose.position) < 1e-5;
                    let is_same = back.orientation.dot(pose.orientation).abs() > 1.0 - 1e-6;
                    assert!(is_near && is_same, "{convention:?} {pose:?} {back:?}");
                }
            }
        }
    }

    #[test]
    fn poses_commute_with_the_change_of_basis() {
        for convention in CONVENTIONS {
            let m = engine_from_openxr(convention);
            let unit = convention.length_from_openxr(1.0);
            for pose in samples() {
                let engine = convention.pose_from_openxr(pose);
                for point in [Vec3::X, Vec3::new(0.3, -2.0, 1.1)] {
                    let expected = m * pose.transform_point(point) * unit;
                    let actual = engine.transform_point(m * point * unit);
                    assert!((expected - actual).length() < 1e-4 * unit, "{convention:?}");
                }
            }
        }
    }

    #[test]
    fn godots_joints_are_turned_and_unity_lists_the_wrist_before_the_palm() {
        // The half turn about (0, -1, 1), multiplied by hand for the joint at the identity.
        let joint = Convention::Godot.joint_from_openxr(Pose::IDENTITY);
        let expected = [0.0, -FRAC_1_SQRT_2, FRAC_1_SQRT_2, 0.0];
        assert_eq!(joint.orientation.to_array(), expected);
        for convention in CONVENTIONS {
            let listed: Vec<usize> = (0..JOINT_COUNT).map(|place| convention.joint_at(place)).collect();
            let mut expected: Vec<usize> = (0..JOINT_COUNT).collect();
            if matches!(convention, Convention::Unity | Convention::UnityFlipX) {
                expected.swap(0, 1);
            }
            assert_eq!(listed, expected, "{convention:?}");
        }
    }
}
