//! The calls of `ObjectService` that stream: uploads, meshes and watches.

use std::{collections::BTreeSet, sync::Arc};

use grasp_import::MeshLimits;
use grasp_proto::v1;
use grasp_synthesis::model::hand::Handedness;
use tonic::Streaming;

use super::{
    object_service::{ObjectHandler, checked_id},
    streaming::{LazyMessages, Messages, lazy_messages, messages},
    upload::{ReceivedUpload, blame_parts},
};
use crate::{
    call::{CallContext, UploadPermit},
    error::ServiceError,
    executor::run_stoppable,
    objects::{
        Listed,
        glb::GlbPieces,
        id_of, name_of,
        store::{Event, Report},
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
    ) -> Result<v1::GraspObject, ServiceError> {
        let uploads = &self.shared.uploads;
        let received = uploads
            .receive(parts, |query| {
                let request = &query.request;
                let id = request.object.as_ref().map_or("", |object| id_of(&object.name));
                call.log_object(id);
                // A repeated request is recognised by its mesh, too.
                if request.request_id.is_empty() {
                    self.shared.objects.repeated(id, None)?;
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
            let ReceivedUpload { request, room: _room } = received;
            handler.create_blocking(request, limits, &context, stop)
        })
        .await?
        .map_err(blame_parts)?;
        self.whole_message(&object).await
    }

    /// Sends an object's mesh as a file. Its pieces are made from the object in memory, one when the transport takes it.
    pub(super) async fn mesh(
        &self,
        name: &str,
        call: &CallContext,
    ) -> Result<LazyMessages<v1::GetMeshResponse>, ServiceError> {
        let id = checked_id(name)?;
        call.log_object(&id);
        let revision = self.shared.object(&id, call).await?;
        let pieces = GlbPieces::new(Arc::clone(&revision.object));
        let mut etag = Some(revision.record.etag.clone());
        Ok(lazy_messages(pieces.map(move |piece| v1::GetMeshResponse {
            piece,
            etag: etag.take().unwrap_or_default(),
        })))
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
        Ok(messages(shared.shutdown.clone(), |sender| async move {
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
                ..Default::default()
            },
            Report::Object { id, events, state } => {
                let mut changes: Vec<i32> = events.iter().map(|&event| change(event).into()).collect();
                // Either hand's atlas may have changed.
                changes.dedup();
                let hands: BTreeSet<Handedness> = events.into_iter().filter_map(hand_of).collect();
                let object = state.as_ref().and_then(Listed::object);
                let atlas = |hand| self.shared.atlases.state(&id, object.map(AsRef::as_ref), hand);
                v1::WatchObjectsResponse {
                    changes,
                    atlases: hands.into_iter().map(atlas).collect(),
                    object: Some(state.as_ref().map_or_else(
                        || v1::GraspObject {
                            name: name_of(&id),
                            ..Default::default()
                        },
                        Listed::to_wire,
                    )),
                }
            }
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
        Event::AtlasUseful(_) => v1::ObjectChange::AtlasUseful,
        Event::AtlasComplete(_) => v1::ObjectChange::AtlasComplete,
    }
}

/// The hand whose atlas an event is about.
fn hand_of(event: Event) -> Option<Handedness> {
    match event {
        Event::AtlasUseful(hand) | Event::AtlasComplete(hand) => Some(hand),
        _ => None,
    }
}
