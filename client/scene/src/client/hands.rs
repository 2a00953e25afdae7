//! Hands of a picture, from requests and answers.

use grasp_assets::hands::{self, hand};
use grasp_client::{
    Grasp, HandAngles, HandJoints, Handedness, JOINT_COUNT, JointPose, JointSet, Pose, PresentingHand,
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

/// A client's pose as the core's.
pub fn synthesis_pose(pose: Pose) -> pose::Pose {
    pose::Pose {
        position: pose.position,
        orientation: pose.orientation,
    }
}

fn synthesis_handedness(handedness: Handedness) -> synthesis::Handedness {
    match handedness {
        Handedness::Left => synthesis::Handedness::Left,
        Handedness::Right => synthesis::Handedness::Right,
    }
}

/// A built-in hand.
pub(super) fn built_in(rig: &str, handedness: Handedness) -> Result<&'static hands::Hand, CannotDraw> {
    hand(rig, synthesis_handedness(handedness))
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

/// The presenting hand of a request in the `OpenXR` convention.
///
/// # Errors
/// Its rig is not built in, or it has the wrong number of joints.
pub fn giver(hand: &PresentingHand) -> Result<Giver, CannotDraw> {
    let skin = |hand| Giver::Skin(Box::new(hand));
    match hand {
        PresentingHand::Angles(angles) => from_angles(angles).map(skin),
        PresentingHand::Joints(joints) => from_tracked(joints).map(skin),
        PresentingHand::Mesh(mesh) => Ok(Giver::Mesh(Part::new(
            "giver_hand",
            mesh.positions.clone(),
            mesh.triangles.clone(),
            linear_from_srgb(206, 176, 154),
        ))),
    }
}

/// The receiving hand of an answer in the `OpenXR` convention.
///
/// # Errors
/// Its rig is not built in.
pub fn receiver(grasp: &Grasp) -> Result<SceneHand, CannotDraw> {
    let built_in = built_in(&grasp.rig, grasp.handedness)?;
    Ok(PosedHand {
        skin: &built_in.skin,
        joints: synthesis::joints::HandJoints {
            handedness: built_in.rig.handedness,
            joints: grasp.joints.map(joint),
        },
    })
}

fn from_angles(angles: &HandAngles) -> Result<SceneHand, CannotDraw> {
    let built_in = built_in(&angles.rig, angles.handedness)?;
    let rig = built_in.rig.scaled(angles.hand_scale.unwrap_or(1.0));
    let wrist = synthesis_pose(angles.client_from_wrist);
    Ok(PosedHand {
        skin: &built_in.skin,
        joints: posed(&rig, wrist, angles.digits.map(synthesis_angles)),
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

/// A client's angles as the core's.
pub(super) fn synthesis_angles(digit: grasp_client::DigitAngles) -> DigitAngles {
    let coupled = DigitAngles::coupled(digit.base_yaw, digit.base_pitch, digit.second_pitch);
    DigitAngles {
        third_pitch: digit.third_pitch.unwrap_or(coupled.third_pitch),
        ..coupled
    }
}

fn from_tracked(hand: &HandJoints) -> Result<SceneHand, CannotDraw> {
    let joints: Vec<Joint> = hand.joints.iter().copied().map(joint).collect();
    let joints = match hand.joint_set {
        JointSet::OpenXr26 => joints,
        JointSet::WebXr25 => with_palm(joints),
    };
    let joints: [Joint; JOINT_COUNT] = joints.try_into().map_err(|_| {
        CannotDraw("the presenting hand cannot be drawn: it has the wrong number of joints".to_owned())
    })?;
    let handedness = synthesis_handedness(hand.handedness);
    Ok(PosedHand {
        skin: &built_in(TRACKED_HAND_RIG, hand.handedness)?.skin,
        joints: synthesis::joints::HandJoints { handedness, joints },
    })
}

/// Adds the palm, which `WebXR` lacks: the middle of the middle finger's metacarpal, with its orientation.
fn with_palm(mut joints: Vec<Joint>) -> Vec<Joint> {
    let middle = index::FIRST_OF_DIGIT[2];
    // Without the palm, every index is one less.
    let (Some(&metacarpal), Some(&proximal)) = (joints.get(middle - 1), joints.get(middle)) else {
        return joints;
    };
    let palm = Joint {
        pose: pose::Pose {
            position: (metacarpal.pose.position + proximal.pose.position) * 0.5,
            orientation: metacarpal.pose.orientation,
        },
        radius: metacarpal.radius,
    };
    joints.insert(index::PALM, palm);
    joints
}

fn joint(joint: JointPose) -> Joint {
    Joint {
        pose: synthesis_pose(joint.client_from_joint),
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
            let Giver::Skin(drawn) = giver(&request.presenting_hand.unwrap()).unwrap() else {
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
    fn adds_palm_between_middle_joints() {
        let rig = &hand("adult", synthesis::Handedness::Left).unwrap().rig;
        let pose = HandPose {
            frame_from_wrist: pose::Pose::from_position(Vec3::new(0.1, 0.2, 0.3)),
            digits: rig.stretched(),
        };
        let whole = synthesis::joints::HandJoints::of_pose(rig, &pose);
        let again = with_palm(whole.joints[1..].to_vec());
        assert_eq!(again.len(), JOINT_COUNT);
        assert!(
            again[index::PALM]
                .pose
                .position
                .distance(whole.joints[index::PALM].pose.position)
                < 1e-6
        );
        assert_eq!(again[1..], whole.joints[1..]);
    }
}
