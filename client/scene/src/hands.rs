//! Hands of requests and answers, with the skins that they are drawn with.

use grasp_assets::hands::{self, hand};
use grasp_client::{
    JOINT_COUNT,
    v1::{self, presenting_hand::Form},
};
use grasp_import::{MeshLimits, ModelPose, PosedNode, posed_skin};
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::{
        DigitAngles, HandPose, Handedness,
        joints::{HandJoints, Joint, Skin, index, thesis_from_openxr_frame},
        rig::Rig,
    },
};

use crate::{
    handover::CannotDraw,
    parts::{Part, linear_from_srgb},
};

/// The rig whose skin is stretched to the bones and radii of tracked hands, as on the server.
const TRACKED_HAND_RIG: &str = "adult";

/// Limits of a model: ample for whole characters.
const MODEL_LIMITS: MeshLimits = MeshLimits {
    bytes: 256 << 20,
    vertices: 3_000_000,
    triangles: 3_000_000,
};

/// A hand with the skin of a built-in rig.
#[derive(Clone, Debug)]
pub(crate) struct PosedHand {
    pub(crate) skin: &'static Skin,
    pub(crate) joints: HandJoints,
}

/// A client's pose as the core's; an absent one is the identity.
pub(crate) fn synthesis_pose(pose: impl Into<Option<v1::Pose>>) -> Pose {
    let pose = pose.into().unwrap_or_default();
    Pose {
        position: pose.position(),
        orientation: pose.orientation(),
    }
}

/// A built-in hand of a rig such as "rigs/adult".
pub(crate) fn built_in(rig: &str, handedness: v1::Handedness) -> Result<&'static hands::Hand, CannotDraw> {
    let side = match handedness {
        v1::Handedness::Left => Handedness::Left,
        v1::Handedness::Right | v1::Handedness::Unspecified => Handedness::Right,
    };
    let hand = hand(rig.trim_start_matches("rigs/"), side);
    let missing = || {
        CannotDraw(format!(
            "rig {rig:?} is not built in; its hand cannot be drawn without the model that it was created from"
        ))
    };
    hand.map(|hand| &**hand).ok_or_else(missing)
}

/// The presenting hand of a request, with its object here.
///
/// # Errors
/// Its rig is not built in, it has the wrong number of joints, it is in a convention of its own, or it is a mesh.
pub(crate) fn giver(
    hand: &v1::PresentingHand,
    client_from_object: v1::Pose,
) -> Result<PosedHand, CannotDraw> {
    match &hand.form {
        Some(Form::Pose(pose)) => from_angles(pose, client_from_object),
        Some(Form::Joints(joints)) => from_tracked(joints),
        Some(Form::Mesh(_)) => Err(CannotDraw(
            "a hand given as a mesh has no joints to move: give angles or joints to draw a motion".to_owned(),
        )),
        None => Err(CannotDraw("the presenting hand is empty".to_owned())),
    }
}

/// The receiving hand of an answer.
///
/// # Errors
/// Its rig is not built in, or the answer has only its wrist.
pub(crate) fn receiver(hand: &v1::HandPose) -> Result<PosedHand, CannotDraw> {
    if hand.joints.is_empty() {
        return Err(CannotDraw(
            "the receiving hand cannot be drawn: the answer has only its wrist".to_owned(),
        ));
    }
    let joints = hand.posed_joints().map(|posed| joint(posed.unwrap_or_default()));
    with_joints(&hand.rig, hand.handedness(), &joints)
}

/// The receiving hand of an answer with the skin of the model that its rig was created from.
///
/// # Errors
/// The rig was not created from a model, or the model is of another rig.
pub(crate) fn skin_of_model(model: &[u8], hand: &v1::HandPose, name: String) -> Result<Part, CannotDraw> {
    let Some((root, nodes)) = hand.model.split_first() else {
        return Err(CannotDraw(format!(
            "rig {:?} was not created from a model, so its hand has no skin",
            hand.rig
        )));
    };
    let nodes = nodes.iter().map(|v1::NodePose { node, pose }| {
        let pose = pose.unwrap_or_default();
        PosedNode {
            name: node,
            rotation: pose.orientation(),
            translation: pose.position.map(Into::into),
        }
    });
    let pose = ModelPose {
        root: &root.node,
        frame_from_root: synthesis_pose(root.pose),
        scale: hand.size(),
        nodes: nodes.collect(),
    };
    let skin = posed_skin(model, &pose, MODEL_LIMITS).map_err(|errors| {
        let errors: Vec<String> = errors.iter().map(ToString::to_string).collect();
        CannotDraw(format!("the model cannot be drawn: {}", errors.join("; ")))
    })?;
    let colour = linear_from_srgb(150, 104, 78);
    Ok(Part::new(name, skin.positions, skin.triangles, colour))
}

fn with_joints(
    rig: &str,
    side: v1::Handedness,
    joints: &[Joint; JOINT_COUNT],
) -> Result<PosedHand, CannotDraw> {
    let hands::Hand { rig, skin } = built_in(rig, side)?;
    let handedness = rig.handedness;
    Ok(PosedHand {
        skin,
        joints: HandJoints {
            handedness,
            joints: *joints,
        },
    })
}

fn from_angles(hand: &v1::HandPose, client_from_object: v1::Pose) -> Result<PosedHand, CannotDraw> {
    if !matches!(
        hand.convention(),
        v1::Convention::Unspecified | v1::Convention::Openxr
    ) {
        return Err(CannotDraw(
            "the presenting hand cannot be drawn: it is not in the openxr convention".to_owned(),
        ));
    }
    let at_object = hand.object_from_wrist.map(|wrist| client_from_object * wrist);
    let wrist = synthesis_pose(hand.client_from_wrist.or(at_object));
    let hands::Hand { rig, skin } = built_in(&hand.rig, hand.handedness())?;
    let joints = posed(&rig.scaled(hand.size()), wrist, synthesis_digits(hand));
    Ok(PosedHand { skin, joints })
}

/// The joints of a rig whose wrist is at an `OpenXR` joint frame.
pub(crate) fn posed(rig: &Rig, wrist: Pose, digits: [DigitAngles; 5]) -> HandJoints {
    let pose = HandPose {
        frame_from_wrist: thesis_from_openxr_frame(wrist),
        digits,
    };
    HandJoints::of_pose(rig, &pose)
}

pub(crate) fn synthesis_digits(hand: &v1::HandPose) -> [DigitAngles; 5] {
    hand.digits().map(|digit| {
        let digit = digit.copied().unwrap_or_default();
        let coupled = DigitAngles::coupled(digit.base_yaw, digit.base_pitch, digit.second_pitch);
        DigitAngles {
            third_pitch: digit.third_pitch.unwrap_or(coupled.third_pitch),
            ..coupled
        }
    })
}

fn from_tracked(hand: &v1::HandJoints) -> Result<PosedHand, CannotDraw> {
    let mut joints: Vec<Joint> = hand.joints.iter().copied().map(joint).collect();
    if joints.len() == JOINT_COUNT - 1 {
        // WebXR lacks the palm: the middle of the middle finger's metacarpal. Without it, every index is one less.
        let mut palm = joints[index::FIRST_OF_DIGIT[2] - 1];
        let knuckle = joints[index::FIRST_OF_DIGIT[2]].pose.position;
        palm.pose.position = palm.pose.position.midpoint(knuckle);
        joints.insert(index::PALM, palm);
    }
    let joints: [Joint; JOINT_COUNT] = joints.try_into().map_err(|_| {
        CannotDraw("the presenting hand cannot be drawn: it has the wrong number of joints".to_owned())
    })?;
    with_joints(TRACKED_HAND_RIG, hand.handedness(), &joints)
}

fn joint(joint: v1::JointPose) -> Joint {
    Joint {
        pose: synthesis_pose(joint.pose),
        radius: joint.radius,
    }
}

#[cfg(test)]
mod tests {
    use glam::{Quat, Vec3};
    use grasp_assets::holdouts::holdouts;

    use super::*;

    #[test]
    fn draws_built_in_giver_at_its_holdout() {
        for holdout in holdouts() {
            let request = grasp_client::built_in::request_for(holdout);
            let given = request.holdout.unwrap().presenting_hand.unwrap();
            let drawn = giver(&given, v1::Pose::default()).unwrap();
            let rig = &hand(&holdout.giver_rig, holdout.giver_handedness).unwrap().rig;
            let expected = HandJoints::of_pose(rig, &holdout.giver_pose());
            for (drawn, expected) in drawn.joints.joints.iter().zip(&expected.joints) {
                let distance = drawn.pose.position.distance(expected.pose.position);
                assert!(distance < 1e-5, "{}: {distance} m", holdout.name);
            }
        }
    }

    #[test]
    fn givers_may_be_placed_at_the_object() {
        let hand = v1::HandPose::new("rigs/adult", v1::Handedness::Left);
        let object = v1::Pose::new(Vec3::new(0.1, 1.0, 0.2), Quat::from_rotation_y(0.5));
        let wrist = v1::Pose::new(Vec3::new(0.0, 0.05, 0.1), Quat::from_rotation_x(0.3));
        let wrist_of = |hand: v1::HandPose| {
            let drawn = giver(&hand.into(), object).unwrap();
            drawn.joints.joints[index::WRIST].pose.position
        };
        let at_object = wrist_of(hand.clone().with_object_from_wrist(wrist));
        let at_client = wrist_of(hand.clone().with_client_from_wrist(object * wrist));
        assert!(at_object.distance(at_client) < 1e-6);
        let foreign = v1::HandPose {
            convention: v1::Convention::Unreal.into(),
            ..hand
        };
        let refused = giver(&foreign.into(), object).unwrap_err();
        assert!(refused.to_string().contains("openxr"), "{refused}");
    }

    #[test]
    fn tracked_joints_may_lack_the_palm() {
        let rig = &hand("adult", Handedness::Left).unwrap().rig;
        let wrist = Pose::from_position(Vec3::new(0.1, 0.2, 0.3));
        let whole = posed(rig, wrist, rig.stretched());
        let sent = |joint: &Joint| {
            let pose = v1::Pose::new(joint.pose.position, joint.pose.orientation);
            v1::JointPose::new(pose, joint.radius)
        };
        let joints: Vec<_> = whole.joints[1..].iter().map(sent).collect();
        let drawn = from_tracked(&v1::HandJoints::new(v1::Handedness::Left, joints)).unwrap();
        let palm = drawn.joints.joints[index::PALM].pose.position;
        assert!(palm.distance(whole.joints[index::PALM].pose.position) < 1e-6);
        assert_eq!(drawn.joints.joints[1..], whole.joints[1..]);
    }
}
