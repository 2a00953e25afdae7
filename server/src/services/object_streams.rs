//! The calls of `ObjectService` that stream: uploads, meshes and watches.

use std::sync::Arc;

use grasp_import::MeshLimits;
use grasp_proto::v1::{self, get_mesh_response::Part};
use tonic::Streaming;

use super::{
    object_service::{ObjectHandler, checked_id},
    streaming::{LazyMessages, Messages, endless_messages, lazy_messages},
    upload::blame_parts,
};
use crate::{
    call::{CallContext, UploadPermit},
    error::ServiceError,
    executor::{run_blocking, run_stoppable},
    objects::{
        changes::{Event, Report},
        glb::{GlbPieces, GlbSummary},
        hex, name_of,
    },
    validate::watch_query,
};

impl ObjectHandler {
    /// Receives an object in pieces, and creates it.
    pub(super) async fn upload(
        &self,
        parts: Streaming<v1::UploadObjectRequest>,
        permit: Option<UploadPermit>,
        call: &CallContext,
    ) -> Result<v1::UploadObjectResponse, ServiceError> {
        let uploads = &self.shared.uploads;
        let received = uploads
            .receive(parts, |query| {
                let request = &query.request;
                call.log_object(&request.object_id);
                // A repeated request is recognised by its mesh, too.
                if request.request_id.is_empty() {
                    self.shared.objects.repeated(&request.object_id, None)?;
                }
                Ok(())
            })
            .await
            .map_err(|error| permit.as_ref().and_then(UploadPermit::failure).unwrap_or(error))?;
        permit.as_ref().map_or(Ok(()), UploadPermit::take_place)?;
        let limits = MeshLimits {
            bytes: uploads.maximum_bytes(),
            ..self.shared.obj_limits
        };
        let (handler, context) = (self.clone(), call.clone());
        let object = run_stoppable(call.answer_due(), move |stop| {
            let _permit = permit;
            let (request, _room) = received.into_parts();
            handler.create_blocking(request, limits, &context, stop)
        })
        .await?
        .map_err(blame_parts)?;
        Ok(v1::UploadObjectResponse {
            object: Some(self.whole_message(&object).await?),
        })
    }

    /// Sends an object's mesh as a file. Its pieces are made from the object in memory, one when the transport takes it; only the
    /// first call for an object makes all of them, for their hash.
    pub(super) async fn mesh(
        &self,
        name: &str,
        call: &CallContext,
    ) -> Result<LazyMessages<v1::GetMeshResponse>, ServiceError> {
        let id = checked_id(name)?;
        call.log_object(&id);
        let revision = self.shared.object(&id, call).await?;
        let object = Arc::clone(&revision.object);
        let summary = object
            .glb
            .get_or_try_init(|| async {
                let place = Arc::clone(&self.shared.hashing).acquire_owned().await;
                let place = place.map_err(|_| ServiceError::ShuttingDown)?;
                let object = Arc::clone(&object);
                run_blocking(move || {
                    let _place = place;
                    GlbSummary::of(&object)
                })
                .await
            })
            .await?
            .clone();
        let header = v1::MeshHeader {
            total_bytes: summary.bytes as u64,
            sha256: hex(&summary.sha256),
            object: Some(self.message(&revision.into())),
        };
        let pieces = GlbPieces::new(object, summary).map(Part::Piece);
        let parts = std::iter::once(Part::Header(header)).chain(pieces);
        Ok(lazy_messages(
            parts.map(|part| v1::GetMeshResponse { part: Some(part) }),
        ))
    }

    /// Reports what happens to objects.
    pub(super) fn watch(
        &self,
        request: &v1::WatchObjectsRequest,
    ) -> Result<Messages<v1::WatchObjectsResponse>, ServiceError> {
        let query = watch_query(request)?;
        let shared = &self.shared;
        let watcher = shared.objects.watch(query, shared.maximum_watchers)?;
        let handler = self.clone();
        Ok(endless_messages(shared.shutdown.clone(), |sender| async move {
            loop {
                match handler.shared.objects.next_report(&watcher)? {
                    Some(report) => sender.send(handler.report(report)).await?,
                    None => watcher.news().await,
                }
            }
        }))
    }

    /// The message that reports on an object.
    fn report(&self, report: Report) -> v1::WatchObjectsResponse {
        match report {
            Report::PresentEnd => v1::WatchObjectsResponse {
                changes: vec![v1::ObjectChange::PresentEnd.into()],
                object: None,
            },
            Report::Object { id, events, state } => v1::WatchObjectsResponse {
                changes: events.into_iter().map(|event| change(event).into()).collect(),
                object: Some(match state {
                    Some(state) => self.message(&state),
                    None => v1::Object {
                        name: name_of(&id),
                        ..Default::default()
                    },
                }),
            },
        }
    }
}

fn change(event: Event) -> v1::ObjectChange {
    match event {
        Event::Present => v1::ObjectChange::Present,
        Event::Deleted => v1::ObjectChange::Deleted,
        Event::Evicted => v1::ObjectChange::Evicted,
        Event::Created => v1::ObjectChange::Created,
        Event::Updated => v1::ObjectChange::Updated,
        Event::AtlasUseful => v1::ObjectChange::AtlasUseful,
        Event::AtlasComplete => v1::ObjectChange::AtlasComplete,
        Event::LeftAtlasComplete => v1::ObjectChange::LeftAtlasComplete,
    }
}
