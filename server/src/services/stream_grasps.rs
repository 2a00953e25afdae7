//! `GraspService.StreamGrasps`.

use grasp_proto::v1;

use super::GraspHandler;
use super::streaming::Messages;
use crate::call::CallContext;
use tonic::Status;

impl GraspHandler {
    pub(super) async fn stream(
        &self,
        _request: v1::StreamGraspsRequest,
        _call: &CallContext,
    ) -> Result<Messages<v1::StreamGraspsResponse>, Status> {
        Err(Status::unimplemented("StreamGrasps"))
    }
}
