//! `ObjectService`.

use std::sync::Arc;

use grasp_proto::v1::{self, object_service_server::ObjectService};
use tonic::{Request, Response, Status};

use super::Shared;
use crate::{
    call::{CallContext, UploadPermit},
    error::ServiceError,
    executor::run_blocking,
    objects::{StoredObject, build::build_object, name_of},
    validate::{Field, Violations, object_fields, object_id_of, page_query, page_token},
};

/// Implements `ObjectService`.
#[derive(Clone, Debug)]
pub(crate) struct ObjectHandler {
    shared: Arc<Shared>,
}

impl ObjectHandler {
    /// A handler with the shared state.
    pub(crate) fn new(shared: Arc<Shared>) -> Self {
        Self { shared }
    }

    async fn create(
        &self,
        request: v1::CreateObjectRequest,
        permit: Option<UploadPermit>,
        call: &CallContext,
    ) -> Result<v1::CreateObjectResponse, ServiceError> {
        let limits = self.shared.obj_limits;
        let mut violations = Violations::default();
        let fields = object_fields(request, limits.bytes, &mut violations);
        if violations.is_empty() {
            call.log_object(&fields.id);
            // Checked again on insertion; checked here to avoid building the object in vain.
            if self.shared.objects.contains(&fields.id) {
                return Err(ServiceError::ObjectExists {
                    name: name_of(&fields.id),
                });
            }
        }
        let shared = Arc::clone(&self.shared);
        let object = run_blocking(move || {
            let _permit = permit;
            let object = build_object(fields, limits, violations)?;
            object.prepare(&shared.default_rig);
            Ok::<_, ServiceError>(object)
        })
        .await??;
        let object = self.shared.objects.insert(object)?;
        self.shared.atlases.register(&object);
        Ok(v1::CreateObjectResponse {
            object: Some(self.message(&object)),
        })
    }

    fn get(&self, name: &str, call: &CallContext) -> Result<v1::GetObjectResponse, ServiceError> {
        let mut violations = Violations::default();
        let Some(id) = object_id_of(Field::root("name"), name, &mut violations) else {
            return Err(violations.into_error());
        };
        call.log_object(&id);
        Ok(v1::GetObjectResponse {
            object: Some(self.message(&*self.shared.objects.get(&id)?)),
        })
    }

    fn list(&self, request: &v1::ListObjectsRequest) -> Result<v1::ListObjectsResponse, ServiceError> {
        let query = page_query(request)?;
        let (objects, more) = self.shared.objects.page(query.after.as_deref(), query.size);
        let last = objects.last().filter(|_| more);
        Ok(v1::ListObjectsResponse {
            next_page_token: last.map(|last| page_token(&last.id)).unwrap_or_default(),
            objects: objects.iter().map(|object| self.message(object)).collect(),
        })
    }

    fn message(&self, object: &StoredObject) -> v1::Object {
        object.to_wire(self.shared.atlases.state(object))
    }
}

#[tonic::async_trait]
impl ObjectService for ObjectHandler {
    async fn create_object(
        &self,
        mut request: Request<v1::CreateObjectRequest>,
    ) -> Result<Response<v1::CreateObjectResponse>, Status> {
        let call = CallContext::of(&request);
        let permit = request.extensions_mut().remove::<UploadPermit>();
        Ok(Response::new(
            self.create(request.into_inner(), permit, &call).await?,
        ))
    }

    async fn get_object(
        &self,
        request: Request<v1::GetObjectRequest>,
    ) -> Result<Response<v1::GetObjectResponse>, Status> {
        let call = CallContext::of(&request);
        Ok(Response::new(self.get(&request.get_ref().name, &call)?))
    }

    async fn list_objects(
        &self,
        request: Request<v1::ListObjectsRequest>,
    ) -> Result<Response<v1::ListObjectsResponse>, Status> {
        Ok(Response::new(self.list(request.get_ref())?))
    }
}
