//! Hands of a picture, from requests and answers.

use grasp_assets::hands::{self, hand};
use grasp_client::{
    JOINT_COUNT,
    v1::{self, presenting_hand::Form},
};
use grasp_synthesis::{
    base::pose,
    model::hand::{
        self as synthesis, DigitAngles, HandPose,
        joints::{Joint, index, thesis_from_openxr_frame},
        rig::Rig,
    },
};

use super::CannotDraw;
use crate::{
    handover::PosedHand,
    scene::{Part, linear_from_srgb},
};

/// A hand of a scene: the skin of a built-in rig, posed by joints.
pub type SceneHand = PosedHand<'static>;

/// The rig whose skin is stretched to the bones and radii of tracked hands, as on the server.
const TRACKED_HAND_RIG: &str = "adult";

/// A client's pose as the core's; an absent one is the identity.
pub fn synthesis_pose(pose: impl Into<Option<v1::Pose>>) -> pose::Pose {
    let pose = pose.into().unwrap_or_default();
    pose::Pose {
        position: pose.position(),
        orientation: pose.orientation(),
    }
}

/// A hand has one in every sound message.
fn synthesis_handedness(handedness: v1::Handedness) -> synthesis::Handedness {
    match handedness {
        v1::Handedness::Left => synthesis::Handedness::Left,
        v1::Handedness::Right | v1::Handedness::Unspecified => synthesis::Handedness::Right,
    }
}

/// A built-in hand of a rig such as "rigs/adult".
pub(super) fn built_in(rig: &str, handedness: v1::Handedness) -> Result<&'static hands::Hand, CannotDraw> {
    hand(rig.trim_start_matches("rigs/"), synthesis_handedness(handedness))
        .map(|hand| &**hand)
        .ok_or_else(|| CannotDraw(format!(
                "rig {rig:?} is not built in; its hand cannot be drawn without the model that it was created from"
            )))
}

/// A presenting hand as it is drawn.
#[derive(Debug)]
pub enum Giver {
    /// With the skin of a built-in rig.
    Skin(Box<SceneHand>),
    /// As the client draws it.
    Mesh(Part),
}

/// The presenting hand of a request in the `OpenXR` convention, with its object here.
///
/// # Errors
/// Its rig is not built in, it has the wrong number of joints, or it is in a convention of its own.
pub fn giver(
    hand: &v1::PresentingHand,
    client_from_object: impl Into<Option<v1::Pose>>,
) -> Result<Giver, CannotDraw> {
    let skin = |hand| Giver::Skin(Box::new(hand));
    match &hand.form {
        Some(Form::Pose(pose)) => from_angles(pose, client_from_object.into()).map(skin),
        Some(Form::Joints(joints)) => from_tracked(joints).map(skin),
        Some(Form::Mesh(mesh)) => Ok(Giver::Mesh(Part::new(
            "giver_hand",
            mesh.vertices().collect(),
            mesh.faces().to_vec(),
            linear_from_srgb(206, 176, 154),
        ))),
        None => Err(CannotDraw("the presenting hand is empty".to_owned())),
    }
}

/// The receiving hand of an answer in the `OpenXR` convention.
///
/// # Errors
/// Its rig is not built in, or the answer has only its wrist.
pub fn receiver(hand: &v1::HandPose) -> Result<SceneHand, CannotDraw> {
    if hand.joints.is_empty() {
        return Err(CannotDraw(
            "the receiving hand cannot be drawn: the answer has only its wrist".to_owned(),
        ));
    }
    let built_in = built_in(&hand.rig, hand.handedness())?;
    Ok(PosedHand {
        skin: &built_in.skin,
        joints: synthesis::joints::HandJoints {
            handedness: built_in.rig.handedness,
            joints: hand.posed_joints().map(|posed| joint(posed.unwrap_or_default())),
        },
    })
}

fn from_angles(hand: &v1::HandPose, client_from_object: Option<v1::Pose>) -> Result<SceneHand, CannotDraw> {
    if !matches!(
        hand.convention(),
        v1::Convention::Unspecified | v1::Convention::Openxr
    ) {
        return Err(CannotDraw(
            "the presenting hand cannot be drawn: it is not in the openxr convention".to_owned(),
        ));
    }
    let at_object = hand
        .object_from_wrist
        .map(|wrist| client_from_object.unwrap_or_default() * wrist);
    let built_in = built_in(&hand.rig, hand.handedness())?;
    let rig = built_in.rig.scaled(hand.size());
    let wrist = synthesis_pose(hand.client_from_wrist.or(at_object));
    Ok(PosedHand {
        skin: &built_in.skin,
        joints: posed(&rig, wrist, synthesis_digits(hand)),
    })
}

/// The joints of a rig whose wrist is at an `OpenXR` joint frame.
pub(super) fn posed(rig: &Rig, wrist: pose::Pose, digits: [DigitAngles; 5]) -> synthesis::joints::HandJoints {
    let pose = HandPose {
        frame_from_wrist: thesis_from_openxr_frame(wrist),
        digits,
    };
    synthesis::joints::HandJoints::of_pose(rig, &pose)
}

/// A hand's angles as the core's.
pub(super) fn synthesis_digits(hand: &v1::HandPose) -> [DigitAngles; 5] {
    hand.digits().map(|digit| {
        let digit = digit.copied().unwrap_or_default();
        let coupled = DigitAngles::coupled(digit.base_yaw, digit.base_pitch, digit.second_pitch);
        DigitAngles {
            third_pitch: digit.third_pitch.unwrap_or(coupled.third_pitch),
            ..coupled
        }
    })
}

fn from_tracked(hand: &v1::HandJoints) -> Result<SceneHand, CannotDraw> {
    let mut joints: Vec<Joint> = hand.joints.iter().copied().map(joint).collect();
    if joints.len() == JOINT_COUNT - 1 {
        // WebXR lacks the palm: the middle of the middle finger's metacarpal. Without it, every index is one less.
        let metacarpal = joints[index::FIRST_OF_DIGIT[2] - 1];
        let knuckle = joints[index::FIRST_OF_DIGIT[2]].pose.position;
        let mut palm = metacarpal;
        palm.pose.position = metacarpal.pose.position.midpoint(knuckle);
        joints.insert(index::PALM, palm);
    }
    let joints: [Joint; JOINT_COUNT] = joints.try_into().map_err(|_| {
        CannotDraw("the presenting hand cannot be drawn: it has the wrong number of joints".to_owned())
    })?;
    let built_in = built_in(TRACKED_HAND_RIG, hand.handedness())?;
    Ok(PosedHand {
        skin: &built_in.skin,
        joints: synthesis::joints::HandJoints {
            handedness: built_in.rig.handedness,
            joints,
        },
    })
}

fn joint(joint: v1::JointPose) -> Joint {
    Joint {
        pose: synthesis_pose(joint.pose),
        radius: joint.radius,
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use grasp_assets::holdouts::holdouts;

    use super::*;

    #[test]
    fn draws_built_in_giver_at_its_holdout() {
        for holdout in holdouts() {
            let request = grasp_client::built_in::request_for(holdout);
            let asked = request.holdout.unwrap();
            let Giver::Skin(drawn) = giver(&asked.presenting_hand.unwrap(), None).unwrap() else {
                panic!("{}: it has a skin", holdout.name);
            };
            let rig = &hand(&holdout.giver_rig, holdout.giver_handedness).unwrap().rig;
            let expected = synthesis::joints::HandJoints::of_pose(rig, &holdout.giver_pose());
            for (drawn, expected) in drawn.joints.joints.iter().zip(&expected.joints) {
                let distance = drawn.pose.position.distance(expected.pose.position);
                assert!(distance < 1e-5, "{}: {distance} m", holdout.name);
            }
        }
    }

    #[test]
    fn givers_may_be_placed_at_the_object() {
        let hand = v1::HandPose::new("rigs/adult", v1::Handedness::Left);
        let object = v1::Pose::new(Vec3::new(0.1, 1.0, 0.2), glam::Quat::from_rotation_y(0.5));
        let wrist = v1::Pose::new(Vec3::new(0.0, 0.05, 0.1), glam::Quat::from_rotation_x(0.3));
        let wrist_of = |hand: v1::HandPose| {
            let Giver::Skin(drawn) = giver(&hand.into(), object).unwrap() else {
                panic!("it has a skin");
            };
            drawn.joints.joints[index::WRIST].pose
        };
        let at_object = wrist_of(hand.clone().with_object_from_wrist(wrist));
        let at_client = wrist_of(hand.clone().with_client_from_wrist(object * wrist));
        assert!(at_object.position.distance(at_client.position) < 1e-6);
        let foreign = v1::HandPose {
            convention: v1::Convention::Unreal.into(),
            ..hand
        };
        let refused = giver(&foreign.into(), object).unwrap_err();
        assert!(refused.to_string().contains("openxr"), "{refused}");
    }

    #[test]
    fn tracked_joints_may_lack_the_palm() {
        let rig = &hand("adult", synthesis::Handedness::Left).unwrap().rig;
        let pose = HandPose {
            frame_from_wrist: pose::Pose::from_position(Vec3::new(0.1, 0.2, 0.3)),
            digits: rig.stretched(),
        };
        let whole = synthesis::joints::HandJoints::of_pose(rig, &pose);
        let sent = |joint: &Joint| v1::JointPose {
            pose: Some(v1::Pose::new(joint.pose.position, joint.pose.orientation)),
            radius: joint.radius,
        };
        let hand = v1::HandJoints {
            handedness: v1::Handedness::Left.into(),
            joints: whole.joints[1..].iter().map(sent).collect(),
        };
        let drawn = from_tracked(&hand).unwrap().joints;
        let palm = drawn.joints[index::PALM].pose.position;
        assert!(palm.distance(whole.joints[index::PALM].pose.position) < 1e-6);
        assert_eq!(drawn.joints[1..], whole.joints[1..]);
    }
}
