//! The receiver's body and arm.

use grasp_proto::v1;

use super::{
    Malformed,
    geometry_codec::{pose_to_wire, vector_from_wire, vector_to_wire},
    required,
};
use crate::receiver::{Arm, Receiver, ReceiverBody, ReceiverStance};

pub(super) fn receiver_to_wire(receiver: Receiver) -> v1::Receiver {
    use v1::receiver::Body;
    v1::Receiver {
        body: Some(match receiver.body {
            ReceiverBody::Shoulder(shoulder) => Body::ClientShoulder(vector_to_wire(shoulder)),
            ReceiverBody::Standing(standing) => Body::Standing(v1::StandingBody {
                client_from_root: Some(pose_to_wire(standing.client_from_root)),
                height: standing.height,
            }),
        }),
        upper_arm_length: receiver.upper_arm_length,
        forearm_length: receiver.forearm_length,
    }
}

pub(super) fn stance_to_wire(stance: Option<ReceiverStance>) -> v1::ReceiverStance {
    match stance {
        None => v1::ReceiverStance::Unspecified,
        Some(ReceiverStance::FacingGiver) => v1::ReceiverStance::FacingGiver,
        Some(ReceiverStance::Any) => v1::ReceiverStance::Any,
    }
}

pub(super) fn arm_from_wire(arm: v1::Arm) -> Result<Arm, Malformed> {
    let vector = |field: &str, value: Option<v1::Vector3>| required(field, value).map(vector_from_wire);
    Ok(Arm {
        client_shoulder: vector("client_shoulder", arm.client_shoulder)?,
        client_elbow: vector("client_elbow", arm.client_elbow)?,
        wrist_flexion: arm.wrist_flexion,
        wrist_deviation: arm.wrist_deviation,
        assumed: arm.assumed,
    })
}

#[cfg(test)]
mod tests {
    use glam::{Quat, Vec3};

    use super::*;
    use crate::pose::Pose;

    #[test]
    fn converts_both_forms_of_body() {
        use v1::receiver::Body;
        let shoulder = Vec3::new(1.0, 2.0, 3.0);
        let sent = receiver_to_wire(Receiver {
            upper_arm_length: Some(0.3),
            forearm_length: Some(0.2),
            ..Receiver::with_shoulder(shoulder)
        });
        assert_eq!(sent.body, Some(Body::ClientShoulder(vector_to_wire(shoulder))));
        assert_eq!(
            (sent.upper_arm_length, sent.forearm_length),
            (Some(0.3), Some(0.2))
        );
        let root = Pose::new(shoulder, Quat::from_rotation_y(1.0));
        let sent = receiver_to_wire(Receiver::standing(root, 1.6));
        let standing = v1::StandingBody {
            client_from_root: Some(pose_to_wire(root)),
            height: 1.6,
        };
        assert_eq!(sent.body, Some(Body::Standing(standing)));
        assert_eq!((sent.upper_arm_length, sent.forearm_length), (None, None));
    }

    #[test]
    fn an_arm_needs_its_joints() {
        let arm = v1::Arm {
            client_shoulder: Some(vector_to_wire(Vec3::X)),
            ..v1::Arm::default()
        };
        assert_eq!(
            arm_from_wire(arm).unwrap_err(),
            Malformed::missing("client_elbow")
        );
    }
}
