//! `ObjectService`.

use std::{pin::pin, sync::Arc};

use bytes::Bytes;
use futures_util::{StreamExt as _, TryStreamExt as _, stream};
use grasp_import::MeshLimits;
use grasp_proto::v1::{self, object_service_server::ObjectService};
use grasp_synthesis::{base::stop::Stop, model::hand::Handedness};
use prost::Message as _;
use tonic::{Request, Response, Status, Streaming};

use super::{Handler, Shared, checked_id, streaming::Messages};
use crate::{
    call::{CallContext, UploadPermit},
    error::ServiceError,
    executor::{run_blocking, run_stoppable},
    faults::FaultPoint,
    limits::MAX_RESPONSE,
    objects::{
        Listed,
        build::{build_object, changed},
        given::check_grips,
        name_of,
        store::Origin,
    },
    validate::{
        UpdateQuery, Violations, given_etag, object_fields, object_id_of, page_query, page_token, quoted,
        update_query,
    },
};

/// Bytes of a page that are kept for its token.
const TOKEN_ROOM: usize = 1 << 10;

/// Bytes that an element of a repeated field takes beside its own: the field's number and its length.
const ELEMENT_OVERHEAD: usize = 6;

/// Records of objects at rest that are read at a time for a page.
const READ_AT_A_TIME: usize = 16;

/// Attempts at a change without an etag while others change the same object.
const CHANGE_ATTEMPTS: usize = 8;

impl Handler {
    pub(super) fn create_blocking(
        &self,
        request: v1::CreateObjectRequest,
        limits: MeshLimits,
        call: &CallContext,
        stop: Stop<'_>,
    ) -> Result<Listed, ServiceError> {
        self.executor.faults.at(FaultPoint::Build);
        let violations = Violations::default();
        let mut fields = object_fields(request, limits.bytes, &violations);
        let mut origin = Origin {
            labels: std::mem::take(&mut fields.labels),
            request: fields.request,
            mesh: Bytes::new(),
            caller: call.caller.clone(),
        };
        if violations.is_empty() {
            call.log_object(&fields.id);
            // Checked again on insertion; checked here to avoid building the object in vain.
            if let Some(object) = self.objects.repeated(&fields.id, &origin)? {
                return Ok(object);
            }
        }
        let object = build_object(&fields, limits, violations, stop)?;
        self.objects.check_size(&object)?;
        check_grips(&object, |name, side| self.rigs.rig(name, side), stop)?;
        origin.mesh = fields.mesh.into();
        let state = self.objects.insert(object, origin)?;
        if let Some(object) = state.object() {
            self.atlases.register(object);
            self.derive_ahead(object);
        }
        Ok(state)
    }

    /// The message of an object in a list; `None` if it was deleted meanwhile.
    async fn listed_message(
        &self,
        state: &Listed,
        is_full: bool,
    ) -> Result<Option<v1::GraspObject>, ServiceError> {
        if !is_full {
            return Ok(Some(state.to_wire()));
        }
        match self.whole_message(state).await {
            Err(ServiceError::ObjectNotFound { .. }) => Ok(None),
            // Listed as far as it is known.
            Err(ServiceError::ObjectDamaged { .. }) => Ok(Some(state.to_wire())),
            message => message.map(Some),
        }
    }

    async fn try_update(
        &self,
        query: &Arc<UpdateQuery>,
        permit: UploadPermit,
        call: &CallContext,
    ) -> Result<Listed, ServiceError> {
        let objects = &self.objects;
        objects.found(&query.id).await?;
        let base = objects.changeable(&query.id, query.etag.as_deref())?;
        call.caller.check_owns(&name_of(&query.id), &base.record.owner)?;
        query.check_immutable(&base.to_wire())?;
        // Changing labels does not need the object.
        let object = if query.change.is_empty() {
            None
        } else {
            Some(self.object(&query.id, call).await?.object)
        };
        // The mesh in another size is best read from its file, if that is saved.
        let rebuilt = match (&object, query.change.unit_metres) {
            (Some(object), Some(unit)) if object.file.unit_metres != unit => {
                objects.rebuilt(&query.id, &query.change).await?
            }
            _ => None,
        };
        let (handler, query) = (self.clone(), Arc::clone(query));
        run_blocking(move || {
            let _permit = permit;
            let labels = query.labels.as_ref().unwrap_or(&base.record.labels);
            let changed = match (&object, rebuilt) {
                (Some(_), Some(rebuilt)) => Some(rebuilt),
                (Some(before), None) => changed(before, &query.change)?,
                (None, _) => None,
            };
            let Some(changed) = changed else {
                return if *labels == base.record.labels {
                    Ok(base)
                } else {
                    handler.objects.replace(&base, labels.clone(), None)
                };
            };
            if query.change.known_grips.is_some() {
                check_grips(&changed, |name, side| handler.rigs.rig(name, side), Stop::NEVER)?;
            }
            let state = handler.objects.replace(&base, labels.clone(), Some(changed))?;
            if let Some(object) = state.object() {
                handler.atlases.register(object);
                handler.derive_ahead(object);
            }
            Ok(state)
        })
        .await?
    }

    /// The message that describes an object, whole.
    pub(super) async fn whole_message(&self, state: &Listed) -> Result<v1::GraspObject, ServiceError> {
        let (regions, known_grips) = if let Some(object) = state.object() {
            (object.given.regions_to_wire(), object.given.grips_to_wire())
        } else {
            let given = self.objects.saved_given(state.id()).await?;
            (given.regions, given.known_grips)
        };
        Ok(v1::GraspObject {
            regions,
            known_grips,
            ..state.to_wire()
        })
    }
}

/// The first objects of a list whose messages fit into the room; at least one.
#[derive(Debug)]
struct Page {
    objects: Vec<v1::GraspObject>,
    /// Number of objects of the list so far, deleted ones included.
    listed: usize,
    room: usize,
}

impl Page {
    /// Adds the next object, unless it was deleted (`None`). False if there is no room for it.
    fn add(&mut self, object: Option<v1::GraspObject>) -> bool {
        if let Some(object) = object {
            let bytes = object.encoded_len() + ELEMENT_OVERHEAD;
            if bytes > self.room && !self.objects.is_empty() {
                return false;
            }
            self.room = self.room.saturating_sub(bytes);
            self.objects.push(object);
        }
        self.listed += 1;
        true
    }
}

/// The object's id and the hand in the name of an atlas; the request has no other field to check.
fn atlas_named(name: &str) -> Result<(String, Handedness), ServiceError> {
    let parts = name.rsplit_once("/atlases/").and_then(|(object, side)| {
        let handedness = match side {
            "left" => Handedness::Left,
            "right" => Handedness::Right,
            _ => return None,
        };
        Some((checked_id(object, object_id_of).ok()?, handedness))
    });
    parts.ok_or_else(|| {
        ServiceError::invalid(
            "name",
            format!(
                "is {}; it must be objects/, the object's id, and /atlases/left or /atlases/right",
                quoted(name)
            ),
        )
    })
}

#[tonic::async_trait]
impl ObjectService for Handler {
    async fn create_object(
        &self,
        mut request: Request<v1::CreateObjectRequest>,
    ) -> Result<Response<v1::GraspObject>, Status> {
        let call = CallContext::of(&request);
        let permit = UploadPermit::of(&mut request);
        permit.take_turn().await?;
        let (handler, context, request) = (self.clone(), call.clone(), request.into_inner());
        let object = run_stoppable(call.answer_due(), move |stop| {
            let _permit = permit;
            let limits = handler.config.mesh_limits(handler.config.maximum_object_bytes);
            handler.create_blocking(request, limits, &context, stop)
        });
        let object = object.await??;
        Ok(Response::new(self.whole_message(&object).await?))
    }

    async fn get_object(
        &self,
        request: Request<v1::GetObjectRequest>,
    ) -> Result<Response<v1::GraspObject>, Status> {
        let id = checked_id(&request.get_ref().name, object_id_of)?;
        CallContext::of(&request).log_object(&id);
        let object = self.objects.found(&id).await?;
        Ok(Response::new(self.whole_message(&object).await?))
    }

    async fn list_objects(
        &self,
        request: Request<v1::ListObjectsRequest>,
    ) -> Result<Response<v1::ListObjectsResponse>, Status> {
        let query = page_query(request.get_ref())?;
        let (states, more) = self.objects.page(&query);
        let messages = stream::iter(0..states.len())
            .map(|place| self.listed_message(&states[place], query.is_full))
            .buffered(READ_AT_A_TIME);
        let mut messages = pin!(messages);
        let mut page = Page {
            objects: Vec::new(),
            listed: 0,
            room: MAX_RESPONSE - TOKEN_ROOM,
        };
        while let Some(message) = messages.try_next().await? {
            if !page.add(message) {
                break;
            }
        }
        let last = page.listed.checked_sub(1);
        let last = last.filter(|_| more || page.listed < states.len());
        let token = last.map(|last| page_token(&query, &states[last].place()));
        Ok(Response::new(v1::ListObjectsResponse {
            next_page_token: token.unwrap_or_default(),
            objects: page.objects,
        }))
    }

    async fn update_object(
        &self,
        mut request: Request<v1::UpdateObjectRequest>,
    ) -> Result<Response<v1::GraspObject>, Status> {
        let call = CallContext::of(&request);
        let permit = UploadPermit::of(&mut request);
        permit.take_turn().await?;
        let query = Arc::new(update_query(request.into_inner())?);
        call.log_object(&query.id);
        let mut attempts = 0;
        let object = loop {
            attempts += 1;
            match self.try_update(&query, permit.clone(), &call).await {
                // Without an etag, the change applies to the latest version of the object.
                Err(ServiceError::ObjectChanged { .. })
                    if query.etag.is_none() && attempts < CHANGE_ATTEMPTS => {}
                result => break result?,
            }
        };
        Ok(Response::new(self.whole_message(&object).await?))
    }

    async fn delete_object(&self, request: Request<v1::DeleteObjectRequest>) -> Result<Response<()>, Status> {
        let call = CallContext::of(&request);
        let request = request.into_inner();
        let id = checked_id(&request.name, object_id_of)?;
        call.log_object(&id);
        let etag = given_etag(request.etag);
        let remove = move |shared: &Shared| shared.objects.remove(&id, etag.as_deref(), &call.caller);
        match self.delete_in_turn(remove).await {
            Err(ServiceError::ObjectNotFound { .. }) if request.allow_missing => {}
            result => result?,
        }
        Ok(Response::new(()))
    }

    async fn get_atlas(&self, request: Request<v1::GetAtlasRequest>) -> Result<Response<v1::Atlas>, Status> {
        let (id, handedness) = atlas_named(&request.get_ref().name)?;
        CallContext::of(&request).log_object(&id);
        let state = self.objects.found(&id).await?;
        let object = state.object().map(AsRef::as_ref);
        Ok(Response::new(self.atlases.state(&id, object, handedness)))
    }

    async fn upload_object(
        &self,
        mut request: Request<Streaming<v1::UploadObjectRequest>>,
    ) -> Result<Response<v1::GraspObject>, Status> {
        let call = CallContext::of(&request);
        let permit = UploadPermit::of(&mut request);
        let object = self.upload(request.into_inner(), permit, &call).await?;
        Ok(Response::new(object))
    }

    type GetMeshStream = Messages<v1::GetMeshResponse>;

    async fn get_mesh(
        &self,
        request: Request<v1::GetMeshRequest>,
    ) -> Result<Response<Self::GetMeshStream>, Status> {
        let call = CallContext::of(&request);
        Ok(Response::new(self.mesh(&request.get_ref().name, &call).await?))
    }

    type WatchObjectsStream = Messages<v1::WatchObjectsResponse>;

    async fn watch_objects(
        &self,
        request: Request<v1::WatchObjectsRequest>,
    ) -> Result<Response<Self::WatchObjectsStream>, Status> {
        let call = CallContext::of(&request);
        Ok(Response::new(self.watch(request.get_ref(), &call)?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_ends_before_it_is_too_large() {
        let object = |length: usize| v1::GraspObject {
            name: "n".repeat(length),
            ..Default::default()
        };
        // A deleted object (length 0) takes no room, but a place.
        for (lengths, listed) in [
            (&[300, 300, 300][..], 3),
            (&[600, 300, 300], 2),
            (&[0, 300, 0, 600, 300], 4),
            (&[9000, 1], 1),
            (&[], 0),
        ] {
            let mut page = Page {
                objects: Vec::new(),
                listed: 0,
                room: 1000,
            };
            let mut objects = lengths.iter().map(|&length| (length > 0).then(|| object(length)));
            let _ = objects.all(|object| page.add(object));
            assert_eq!(page.listed, listed, "{lengths:?}");
            let response = v1::ListObjectsResponse {
                objects: page.objects,
                next_page_token: String::new(),
            };
            assert!(response.encoded_len() <= 1000 || listed == 1);
        }
    }

    #[test]
    fn atlases_are_named_by_object_and_hand() {
        let named = |name| atlas_named(name).ok();
        let left = Some(("mug".to_owned(), Handedness::Left));
        assert_eq!(named("objects/mug/atlases/left"), left);
        for name in [
            "",
            "objects/mug",
            "objects/mug/atlases/both",
            "mug/atlases/left",
            "objects/mug/atlases/left/",
        ] {
            assert_eq!(named(name), None, "{name}");
        }
    }
}
