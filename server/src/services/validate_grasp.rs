//! `GraspService.ValidateGrasp`.

use grasp_proto::v1;

use super::GraspHandler;
use crate::call::CallContext;
use tonic::Status;

impl GraspHandler {
    pub(super) async fn validate(
        &self,
        _request: v1::ValidateGraspRequest,
        _call: &CallContext,
    ) -> Result<v1::ValidateGraspResponse, Status> {
        Err(Status::unimplemented("ValidateGrasp"))
    }
}
