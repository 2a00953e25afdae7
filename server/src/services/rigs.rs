//! `HandRigService`.

use std::sync::Arc;

use grasp_proto::v1::{self, hand_rig_service_server::HandRigService};
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::{
        Digit, HandPose,
        joints::{HandJoints, JOINT_COUNT, JOINT_NAMES, thesis_from_openxr_frame},
        rig::{DigitLimits, Rig},
    },
};
use tonic::{Request, Response, Status};

use super::{
    Handler, Shared, checked_id,
    rig_builder::{build_rig, prepare_rig, try_rig},
};
use crate::{
    answer::wire_joint,
    call::UploadPermit,
    convention::Convention,
    executor::run_blocking,
    rigs::{RigHand, StoredRig},
    validate::{Violations, rig_fields, rig_id_of, rig_page_query, rig_page_token},
    wire::{wire_digit, wire_handedness},
};

#[tonic::async_trait]
impl HandRigService for Handler {
    async fn list_rigs(
        &self,
        request: Request<v1::ListRigsRequest>,
    ) -> Result<Response<v1::ListRigsResponse>, Status> {
        let query = rig_page_query(request.get_ref())?;
        let (rigs, more) = self.rigs.page(query.after.as_deref(), query.size);
        let last = rigs.last().filter(|_| more);
        Ok(Response::new(v1::ListRigsResponse {
            next_page_token: last.map(|last| rig_page_token(&last.id)).unwrap_or_default(),
            rigs: rigs.iter().map(|rig| rig_message(rig)).collect(),
        }))
    }

    async fn get_rig(&self, request: Request<v1::GetRigRequest>) -> Result<Response<v1::HandRig>, Status> {
        let rig = self.rigs.get(&checked_id(&request.get_ref().name, rig_id_of)?)?;
        Ok(Response::new(rig_message(&rig)))
    }

    async fn create_rig(
        &self,
        mut request: Request<v1::CreateRigRequest>,
    ) -> Result<Response<v1::HandRig>, Status> {
        let permit = UploadPermit::of(&mut request);
        permit.take_place()?;
        let (shared, request) = (Arc::clone(&self.0), request.into_inner());
        let rig = run_blocking(move || {
            let _permit = permit;
            let limits = shared.config.mesh_limits(shared.config.maximum_object_bytes);
            let violations = Violations::default();
            let record = shared.rigs.record(&request);
            let fields = rig_fields(request, limits.bytes, &violations);
            if violations.is_empty() {
                shared.rigs.check_room(&fields.id)?;
            }
            let mut rig = build_rig(fields, limits, violations)?;
            prepare_rig(&rig);
            try_rig(&mut rig)?;
            shared.rigs.insert(rig, record)
        });
        let rig = rig.await??;
        Ok(Response::new(rig_message(&rig)))
    }

    async fn delete_rig(&self, request: Request<v1::DeleteRigRequest>) -> Result<Response<()>, Status> {
        let id = checked_id(&request.get_ref().name, rig_id_of)?;
        let delete = move |shared: &Shared| shared.rigs.delete(&id);
        Ok(Response::new(self.delete_in_turn(delete).await?))
    }
}

/// The message that describes a rig.
fn rig_message(rig: &StoredRig) -> v1::HandRig {
    v1::HandRig {
        name: rig.name(),
        built_in: rig.built_in,
        hands: rig
            .hands
            .iter()
            .zip(rig.mirrored)
            .map(|(hand, mirrored)| wire_hand(hand, mirrored))
            .collect(),
        warnings: rig.warnings.clone(),
    }
}

fn wire_hand(hand: &RigHand, mirrored: bool) -> v1::RigHand {
    let rig: &Rig = &hand.hand.rig;
    let stretched = HandPose {
        frame_from_wrist: thesis_from_openxr_frame(Pose::IDENTITY),
        digits: rig.stretched(),
    };
    let stretched = HandJoints::of_pose(rig, &stretched);
    let handedness = wire_handedness(rig.handedness).into();
    let joints = hand.binding.iter().flat_map(|binding| binding.joints());
    v1::RigHand {
        handedness,
        stretched_joints: (0..JOINT_COUNT)
            .map(|joint| wire_joint(&stretched, joint, Convention::OpenXr))
            .collect(),
        limits: Digit::ALL
            .into_iter()
            .filter(|&digit| rig.has(digit))
            .map(|digit| wire_limits(digit, &rig.digit(digit).limits))
            .collect(),
        mirrored,
        nodes: joints
            .map(|(node, joint)| v1::RigNode {
                node: node.to_owned(),
                joint: joint.map_or("", |joint| JOINT_NAMES[joint]).to_owned(),
                handedness,
            })
            .collect(),
    }
}

fn wire_limits(digit: Digit, limits: &DigitLimits) -> v1::DigitLimits {
    let ranges = [
        limits.base_yaw,
        limits.base_pitch,
        limits.second_pitch,
        limits.third_pitch,
    ];
    v1::DigitLimits {
        digit: wire_digit(digit).into(),
        min: Some(v1::DigitAngles::new(ranges.map(|range| range.min))),
        max: Some(v1::DigitAngles::new(ranges.map(|range| range.max))),
    }
}
