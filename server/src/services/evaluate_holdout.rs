//! `GraspService.EvaluateHoldout`.

use grasp_proto::v1;

use super::GraspHandler;
use crate::call::CallContext;
use tonic::Status;

impl GraspHandler {
    pub(super) async fn evaluate(
        &self,
        _request: v1::EvaluateHoldoutRequest,
        _call: &CallContext,
    ) -> Result<v1::EvaluateHoldoutResponse, Status> {
        Err(Status::unimplemented("EvaluateHoldout"))
    }
}
