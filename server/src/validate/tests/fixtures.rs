//! Hands and helpers of tests.

use glam::{Quat, Vec3};
use grasp_assets::hands;
use grasp_proto::v1;
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::{
        DigitAngles, HandPose, Handedness,
        joints::{HandJoints, JOINT_COUNT},
    },
};

use crate::{
    answer::wire_joint,
    convention::Convention,
    error::ServiceError,
    validate::{Field, Violations},
    wire::wire_handedness,
};

/// A bent hand in a client's frame, as `OpenXR` joints.
pub(crate) fn joints_of_a_rig(handedness: Handedness) -> HandJoints {
    let hand = hands::hand("adult", handedness).expect("the rig is built in");
    let mut digits = hand.rig.stretched();
    for digit in &mut digits[1..] {
        *digit = DigitAngles::coupled(0.05, 0.4, 0.6);
    }
    let pose = HandPose {
        frame_from_wrist: Pose::new(Vec3::new(0.4, 1.1, -0.3), Quat::from_rotation_y(0.7)),
        digits,
    };
    HandJoints::of_pose(&hand.rig, &pose)
}

/// An adult's hand with every digit stretched, without a wrist.
pub(crate) fn stretched_hand(handedness: v1::Handedness) -> v1::HandPose {
    v1::HandPose::new("rigs/adult", handedness).with_digits([Some(v1::DigitAngles::default()); 5])
}

/// Which joints a client sends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum JointSet {
    /// `OpenXR`'s 26.
    OpenXr,
    /// `WebXR`'s 25, without the palm.
    WebXr,
}

/// The joints as a client with the convention sends them.
pub(crate) fn sent(joints: &HandJoints, convention: Convention, set: JointSet) -> v1::HandJoints {
    let joint_of = |place| match set {
        JointSet::OpenXr => convention.joint_at(place),
        JointSet::WebXr => place + 1,
    };
    let count = match set {
        JointSet::OpenXr => JOINT_COUNT,
        JointSet::WebXr => JOINT_COUNT - 1,
    };
    v1::HandJoints {
        handedness: wire_handedness(joints.handedness).into(),
        joints: (0..count)
            .map(|place| wire_joint(joints, joint_of(place), convention))
            .collect(),
    }
}

/// A table: a field, its violation, perhaps numbers, and the change that makes it wrong.
macro_rules! table {
    ($($field:expr, $text:expr => $change:expr;)*) => {
        &[$(($field, $text, $change)),*]
    };
    ($($field:expr, $text:expr, $numbers:expr => $change:expr;)*) => {
        &[$(($field, $text, &$numbers, $change)),*]
    };
}
pub(crate) use table;

/// A field, the text of its violation, and the change that makes it wrong.
pub(crate) type Change<M> = (&'static str, &'static str, fn(&mut M));

/// A field, the text of its violation, invalid numbers, and the setter of a number.
pub(crate) type SetNumber<M> = (&'static str, &'static str, &'static [f32], fn(&mut M, f32));

/// Fails unless each change of a right message has one violation, that of its row.
pub(crate) fn assert_blamed<M: Clone>(
    right: &M,
    numbers: &[SetNumber<M>],
    changes: &[Change<M>],
    violations: impl Fn(M) -> Vec<(String, String)>,
) {
    let assert_row = |field: &str, text: &str, change: &dyn Fn(&mut M)| {
        let mut wrong = right.clone();
        change(&mut wrong);
        let blamed = violations(wrong);
        let is_named = matches!(&blamed[..], [(of, said)] if of == field && said.contains(text));
        assert!(is_named, "{field} {text}: {blamed:?}");
    };
    for (field, text, numbers, set) in numbers {
        for &number in *numbers {
            assert_row(field, text, &|message| set(message, number));
        }
    }
    for (field, text, change) in changes {
        assert_row(field, text, change);
    }
}

pub(crate) const CONVENTIONS: [Convention; 6] = [
    Convention::OpenXr,
    Convention::Unity,
    Convention::UnityFlipX,
    Convention::Unreal,
    Convention::UnrealXzy,
    Convention::Godot,
];

/// The fields that an answer blames, with its texts; empty if it is right.
pub(crate) fn violations_of<T>(answer: Result<T, ServiceError>) -> Vec<(String, String)> {
    match answer {
        Ok(_) => Vec::new(),
        Err(ServiceError::Invalid(violations)) => violations
            .into_iter()
            .map(|violation| (violation.field, violation.description))
            .collect(),
        Err(other) => panic!("{other}"),
    }
}

/// The fields that an answer blames; empty if it is right.
pub(crate) fn blamed<T>(answer: Result<T, ServiceError>) -> Vec<String> {
    violations_of(answer)
        .into_iter()
        .map(|(field, _)| field)
        .collect()
}

/// The value read of a field of this name, and the fields that are blamed.
pub(crate) fn read_at<T>(name: &str, read: impl FnOnce(Field<'_>) -> T) -> (T, Vec<String>) {
    let violations = Violations::default();
    let value = read(violations.field(name));
    (value, blamed(violations.finish(())))
}
