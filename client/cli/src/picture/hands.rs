//! The hands of a picture, from requests and answers.

use grasp_assets::hands::{self, hand};
use grasp_client::{
    Grasp, HandAngles, HandJoints, Handedness, JOINT_COUNT, JointPose, JointSet, Pose, PresentingHand,
};
use grasp_scene::PosedHand;
use grasp_synthesis::{
    base::pose,
    model::hand::{
        self as synthesis, DigitAngles, HandPose,
        joints::{Joint, index, thesis_from_openxr_frame},
    },
};

use super::SceneHand;
use crate::failure::Failure;

/// The rig whose skin a tracked hand wears, as on the server: it is stretched to the tracked hand's bones and radii.
const TRACKED_HAND_RIG: &str = "adult";

pub(super) fn synthesis_pose(pose: Pose) -> pose::Pose {
    pose::Pose {
        position: pose.position,
        orientation: pose.orientation,
    }
}

pub(crate) fn synthesis_handedness(handedness: Handedness) -> synthesis::Handedness {
    match handedness {
        Handedness::Left => synthesis::Handedness::Left,
        Handedness::Right => synthesis::Handedness::Right,
    }
}

fn built_in(rig: &str, handedness: Handedness) -> Result<&'static hands::Hand, Failure> {
    hand(rig, synthesis_handedness(handedness)).ok_or_else(|| {
        Failure::Usage(format!(
            "rig {rig:?} is not built in, so its hand cannot be drawn"
        ))
    })
}

/// The presenting hand as it was sent.
pub(super) fn giver(hand: &PresentingHand) -> Result<SceneHand, Failure> {
    match hand {
        PresentingHand::Angles(angles) => from_angles(angles),
        PresentingHand::Joints(joints) => from_tracked(joints),
    }
}

/// The receiving hand as it was answered.
pub(super) fn receiver(grasp: &Grasp) -> Result<SceneHand, Failure> {
    let built_in = built_in(&grasp.rig, grasp.handedness)?;
    Ok(PosedHand {
        skin: &built_in.skin,
        joints: synthesis::joints::HandJoints {
            handedness: built_in.rig.handedness,
            joints: grasp.joints.map(joint),
        },
    })
}

fn from_angles(angles: &HandAngles) -> Result<SceneHand, Failure> {
    let built_in = built_in(&angles.rig, angles.handedness)?;
    let pose = HandPose {
        frame_from_wrist: thesis_from_openxr_frame(synthesis_pose(angles.client_from_wrist)),
        digits: angles.digits.map(|digit| {
            let coupled = DigitAngles::coupled(digit.base_yaw, digit.base_pitch, digit.second_pitch);
            DigitAngles {
                third_pitch: digit.third_pitch.unwrap_or(coupled.third_pitch),
                ..coupled
            }
        }),
    };
    Ok(PosedHand {
        skin: &built_in.skin,
        joints: synthesis::joints::HandJoints::of_pose(&built_in.rig, &pose),
    })
}

fn from_tracked(hand: &HandJoints) -> Result<SceneHand, Failure> {
    let joints: Vec<Joint> = hand.joints.iter().copied().map(joint).collect();
    let joints = match hand.joint_set {
        JointSet::OpenXr26 => joints,
        JointSet::WebXr25 => with_palm(joints),
    };
    let joints: [Joint; JOINT_COUNT] = joints.try_into().map_err(|_| {
        Failure::Usage("the presenting hand has too few or too many joints to be drawn".to_owned())
    })?;
    let handedness = synthesis_handedness(hand.handedness);
    Ok(PosedHand {
        skin: &built_in(TRACKED_HAND_RIG, hand.handedness)?.skin,
        joints: synthesis::joints::HandJoints { handedness, joints },
    })
}

/// `WebXR` lists no palm: it is the middle of the middle finger's metacarpal, turned like it.
fn with_palm(mut joints: Vec<Joint>) -> Vec<Joint> {
    let middle = index::FIRST_OF_DIGIT[2];
    // Without the palm, every joint comes one place earlier.
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
    fn a_built_in_giver_is_drawn_where_its_holdout_has_it() {
        for holdout in holdouts() {
            let request = grasp_client::built_in::request_for(holdout);
            let drawn = giver(&request.presenting_hand.unwrap()).unwrap();
            let rig = &hand(&holdout.giver_rig, holdout.giver_handedness).unwrap().rig;
            let expected = synthesis::joints::HandJoints::of_pose(rig, &holdout.giver_pose());
            for (drawn, expected) in drawn.joints.joints.iter().zip(&expected.joints) {
                let distance = drawn.pose.position.distance(expected.pose.position);
                assert!(distance < 1e-5, "{}: {distance} m", holdout.name);
            }
        }
    }

    #[test]
    fn a_hand_without_a_palm_gets_one_between_its_middle_joints() {
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
