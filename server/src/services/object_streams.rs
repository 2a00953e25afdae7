//! The calls of `ObjectService` that stream: uploads, meshes and watches.

use std::{collections::BTreeSet, pin::pin, time::Duration};

use grasp_proto::v1::{self, upload_object_request::Part};
use grasp_synthesis::model::hand::Handedness;
use sha2::{Digest as _, Sha256};
use tokio_stream::StreamExt as _;
use tonic::Streaming;

use super::{
    Handler, checked_id,
    streaming::{Messages, lazy_messages, messages},
};
use crate::{
    call::{CallContext, UploadPermit},
    error::{Limit, ServiceError, Violation},
    executor::run_stoppable,
    limits::{MAX_PIECE, Place, Places, shared_upload_bytes},
    objects::{
        Listed,
        glb::glb_pieces,
        id_of, name_of,
        store::{Event, Origin, Report},
    },
    validate::{UploadQuery, object_id_of, quoted, upload_query, watch_query},
    wire::hex,
};

/// Longest time of an upload: 256 MiB at half a megabyte per second.
const MAX_UPLOAD_TIME: Duration = Duration::from_mins(10);

/// When to retry if others upload as much as the server takes at a time.
const RETRY_UPLOAD_AFTER: Duration = Duration::from_secs(2);

/// When a client should try again if there are too many watchers.
const RETRY_WATCH_AFTER: Duration = Duration::from_secs(5);

/// A place per byte of uploads in pieces.
pub(crate) fn upload_places(largest: usize) -> Places {
    Places::new(
        Limit::UploadBytes,
        shared_upload_bytes(largest),
        RETRY_UPLOAD_AFTER,
    )
}

/// A place per watcher.
pub(crate) fn watcher_places(maximum: usize) -> Places {
    Places::new(Limit::Watchers, maximum, RETRY_WATCH_AFTER)
}

impl Handler {
    pub(super) async fn upload(
        &self,
        parts: Streaming<v1::UploadObjectRequest>,
        permit: UploadPermit,
        call: &CallContext,
    ) -> Result<v1::GraspObject, ServiceError> {
        let late = Err(ServiceError::TookTooLong {
            limit: MAX_UPLOAD_TIME,
        });
        let receiving = tokio::time::timeout(MAX_UPLOAD_TIME, self.receive(parts, call)).await;
        let received = receiving.unwrap_or(late);
        let (request, room) = received.map_err(|error| permit.failure().unwrap_or(error))?;
        permit.take_turn().await?;
        let limits = self.config.mesh_limits(self.config.streams.upload_bytes);
        let (handler, context) = (self.clone(), call.clone());
        let object = run_stoppable(call.answer_due(), move |stop| {
            let _held = (permit, room);
            handler.create_blocking(request, limits, &context, stop)
        })
        .await?
        .map_err(blame_parts)?;
        self.whole_message(&object).await
    }

    /// Receives the parts of an upload: a request with its mesh, and the room for its memory.
    async fn receive(
        &self,
        parts: Streaming<v1::UploadObjectRequest>,
        call: &CallContext,
    ) -> Result<(v1::CreateObjectRequest, Place), ServiceError> {
        let mut parts = pin!(parts);
        let idle = self.config.streams.upload_idle;
        // The next part, with the total that it states; `None` at the end.
        let mut next = async || match tokio::time::timeout(idle, parts.next()).await {
            Err(_) => Err(ServiceError::UploadStalled { limit: idle }),
            Ok(None) => Ok(None),
            // Not a message of the contract, or too long.
            Ok(Some(Err(status))) => Err(ServiceError::Malformed(status.message().to_owned())),
            Ok(Some(Ok(request))) => match request.part {
                Some(part) => Ok(Some((part, request.total_bytes))),
                None => Err(invalid("part", "is missing; it must be a piece or sha256")),
            },
        };
        let Some((Part::Create(request), total_bytes)) = next().await? else {
            return Err(invalid("create", "is missing; it must be the first part"));
        };
        let most = self.config.streams.upload_bytes.get();
        let UploadQuery { mut request, bytes } = upload_query(request, total_bytes, most)?;
        let id = request.object.as_ref().map_or("", |object| id_of(&object.name));
        call.log_object(id);
        // A repeated request is recognised by its mesh, too.
        if request.request_id.is_empty() {
            let origin = Origin {
                caller: call.caller.clone(),
                ..Origin::default()
            };
            self.objects.repeated(id, &origin)?;
        }
        let room = self.upload_bytes.take_many(&call.client, bytes)?;
        let mut mesh: Vec<u8> = Vec::new();
        // Untouched memory costs nothing; growing in steps would copy, and take up to twice as much.
        mesh.try_reserve_exact(bytes)
            .map_err(|_| ServiceError::Overloaded {
                limit: Limit::UploadBytes,
                maximum: bytes,
                retry_after: RETRY_UPLOAD_AFTER,
            })?;
        let mut hash = Sha256::new();
        let expected = loop {
            let received = mesh.len();
            match next().await?.map(|(part, _)| part) {
                None => {
                    let wrong = format!("is missing; the stream ended after {received} of {bytes} bytes");
                    return Err(invalid("sha256", wrong));
                }
                Some(Part::Create(_)) => {
                    return Err(invalid("create", "comes again; it must be the first part only"));
                }
                Some(Part::Piece(piece)) => {
                    let length = piece.len();
                    if !(1..=MAX_PIECE).contains(&length) {
                        let wrong = format!("has {length} bytes; it must have 1 to {MAX_PIECE}");
                        return Err(invalid("piece", wrong));
                    }
                    if length > bytes - received {
                        let wrong = format!("makes {} bytes; total_bytes is {bytes}", received + length);
                        return Err(invalid("piece", wrong));
                    }
                    hash.update(&piece);
                    mesh.extend_from_slice(&piece);
                }
                Some(Part::Sha256(_)) if received < bytes => {
                    let wrong = format!("comes after {received} bytes; total_bytes is {bytes}");
                    return Err(invalid("sha256", wrong));
                }
                Some(Part::Sha256(expected)) => break expected,
            }
        };
        let found = hex(&hash.finalize());
        if !expected.eq_ignore_ascii_case(&found) {
            let wrong = format!("is {}; the received bytes have {found}", quoted(&expected));
            return Err(invalid("sha256", wrong));
        }
        request.mesh = mesh;
        Ok((request, room))
    }

    /// Sends an object's mesh as a file, in pieces made when the transport takes them.
    pub(super) async fn mesh(
        &self,
        name: &str,
        call: &CallContext,
    ) -> Result<Messages<v1::GetMeshResponse>, ServiceError> {
        let id = checked_id(name, object_id_of)?;
        call.log_object(&id);
        let revision = self.object(&id, call).await?;
        let pieces = glb_pieces(&revision.object);
        let mut etag = Some(revision.record.etag.clone());
        Ok(lazy_messages(pieces.map(move |piece| v1::GetMeshResponse {
            piece,
            etag: etag.take().unwrap_or_default(),
        })))
    }

    pub(super) fn watch(
        &self,
        request: &v1::WatchObjectsRequest,
        call: &CallContext,
    ) -> Result<Messages<v1::WatchObjectsResponse>, ServiceError> {
        let query = watch_query(request)?;
        let place = self.watchers.take(&call.client)?;
        let watcher = self.objects.watch(query);
        let handler = self.clone();
        Ok(messages(self, |sender| async move {
            let _place = place;
            loop {
                match handler.objects.next_report(&watcher)? {
                    Some(report) => sender.send(handler.report(report)).await?,
                    None => watcher.news.notified().await,
                }
            }
        }))
    }

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
                let atlas = |hand| self.atlases.state(&id, object.map(AsRef::as_ref), hand);
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

fn invalid(field: &str, wrong: impl Into<String>) -> ServiceError {
    ServiceError::invalid(field, wrong)
}

/// The errors of an object's fields as those of the parts that have them.
fn blame_parts(error: ServiceError) -> ServiceError {
    let ServiceError::Invalid(violations) = error else {
        return error;
    };
    let of_parts = violations.into_iter().map(|violation| Violation {
        field: match violation.field.as_str() {
            "mesh" => "piece".to_owned(),
            field => format!("create.{field}"),
        },
        ..violation
    });
    ServiceError::Invalid(of_parts.collect())
}
