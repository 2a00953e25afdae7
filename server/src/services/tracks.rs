//! `GraspService.TrackHoldout`, `OpenTrack` and `PushFrame`.

use grasp_proto::v1;

use super::GraspHandler;
use crate::call::CallContext;
use tonic::{Status, Streaming};

/// The answers of a track.
pub(super) type TrackAnswers<T> = super::streaming::Messages<T>;

impl GraspHandler {
    pub(super) async fn track(
        &self,
        _frames: Streaming<v1::TrackHoldoutRequest>,
        _call: &CallContext,
    ) -> Result<TrackAnswers<v1::TrackHoldoutResponse>, Status> {
        Err(Status::unimplemented("TrackHoldout"))
    }

    pub(super) async fn open(
        &self,
        _request: v1::OpenTrackRequest,
        _call: &CallContext,
    ) -> Result<TrackAnswers<v1::OpenTrackResponse>, Status> {
        Err(Status::unimplemented("OpenTrack"))
    }

    pub(super) fn push(&self, _request: v1::PushFrameRequest) -> Result<v1::PushFrameResponse, Status> {
        Err(Status::unimplemented("PushFrame"))
    }
}
