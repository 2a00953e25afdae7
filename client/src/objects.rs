//! The client's calls of `ObjectService` and `HandRigService`.

use std::{sync::Arc, time::Duration};

use grasp_proto::v1::{
    self, hand_rig_service_client::HandRigServiceClient, object_service_client::ObjectServiceClient,
    upload_object_request::Part,
};
use sha2::{Digest as _, Sha256};
use tonic::{Request, Status, Streaming};
use uuid::Uuid;

use crate::{
    client::{GraspClient, of_transport},
    error::ClientError,
    streams::{MessageStream, ObjectWatch},
};

/// Largest mesh in bytes that is sent in one message, the default limit of servers; larger ones are uploaded in pieces.
const MAX_MESSAGE: usize = 8 << 20;

/// Bytes of a mesh in one part of an upload; the server takes up to 1 MiB.
const PIECE_BYTES: usize = 256 << 10;

/// Slowest upload in bytes per second; extends the call timeout.
const SLOWEST_UPLOAD: usize = 1 << 20;

/// An object's mesh as searches use it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ObjectMesh {
    /// A GLB file in the object's frame, in metres and +Y up. Triangles that may be touched have the material `surface`, the
    /// others `forbidden`.
    pub glb: Vec<u8>,
    /// The etag of the object with this mesh.
    pub etag: String,
}

impl GraspClient {
    /// All objects from the request's page on, over as many pages as needed.
    ///
    /// # Errors
    /// Any except those of connecting.
    pub async fn list_objects(
        &self,
        request: &v1::ListObjectsRequest,
    ) -> Result<Vec<v1::GraspObject>, ClientError> {
        let mut objects = Vec::new();
        let mut request = request.clone();
        loop {
            let page = self
                .call("ListObjects", None, &request, |channel, request| async move {
                    ObjectServiceClient::new(channel).list_objects(request).await
                })
                .await?;
            objects.extend(page.objects);
            match next_token(&request.page_token, page.next_page_token)? {
                None => return Ok(objects),
                Some(next) => request.page_token = next,
            }
        }
    }

    /// One object; `name` is "objects/{object}".
    ///
    /// # Errors
    /// Any except those of connecting; `NotFound` if the object does not exist.
    pub async fn get_object(&self, name: impl Into<String>) -> Result<v1::GraspObject, ClientError> {
        let message = v1::GetObjectRequest { name: name.into() };
        self.call("GetObject", None, &message, |channel, request| async move {
            ObjectServiceClient::new(channel).get_object(request).await
        })
        .await
    }

    /// The state of an object's atlas for one hand; `name` is "objects/{object}/atlases/left" or ".../right".
    ///
    /// # Errors
    /// Any except those of connecting; `NotFound` if the object does not exist.
    pub async fn get_atlas(&self, name: impl Into<String>) -> Result<v1::Atlas, ClientError> {
        let message = v1::GetAtlasRequest { name: name.into() };
        self.call("GetAtlas", None, &message, |channel, request| async move {
            ObjectServiceClient::new(channel).get_atlas(request).await
        })
        .await
    }

    /// Creates an object. A mesh of more than 8 MiB is sent in pieces. The call is retried like any other: the server
    /// recognises a retry by its request id, which is drawn if the request has none, and answers with the object of the lost
    /// answer. Takes at most the call timeout and, in pieces, a second per MiB.
    ///
    /// # Errors
    /// Any except those of connecting; the violations of `InvalidArgument` list everything wrong with the object,
    /// `AlreadyExists` means that another call created an object with this name.
    pub async fn create_object(
        &self,
        request: &v1::CreateObjectRequest,
    ) -> Result<v1::GraspObject, ClientError> {
        let mut request = request.clone();
        if request.request_id.is_empty() {
            request.request_id = Uuid::new_v4().to_string();
        }
        if request.mesh.len() > MAX_MESSAGE {
            let mesh = std::mem::take(&mut request.mesh);
            return self.upload_object(request, mesh).await;
        }
        self.call("CreateObject", None, &request, |channel, request| async move {
            ObjectServiceClient::new(channel).create_object(request).await
        })
        .await
    }

    /// Changes an object. A retry after a lost answer changes nothing further; with an etag, it fails with
    /// `Aborted`.
    ///
    /// # Errors
    /// Any except those of connecting; `Aborted` if the object has another etag,
    /// `FailedPrecondition` if the server started with it.
    pub async fn update_object(
        &self,
        request: &v1::UpdateObjectRequest,
    ) -> Result<v1::GraspObject, ClientError> {
        self.call("UpdateObject", None, request, |channel, request| async move {
            ObjectServiceClient::new(channel).update_object(request).await
        })
        .await
    }

    /// Deletes an object that exists; `name` is "objects/{object}". With an etag, only if the object still has it.
    ///
    /// # Errors
    /// Any except those of connecting; `Aborted` if the object has another etag,
    /// `FailedPrecondition` if the server started with it. After a retry, `NotFound` may mean
    /// that the lost answer confirmed the deletion.
    pub async fn delete_object(
        &self,
        name: impl Into<String>,
        etag: Option<String>,
    ) -> Result<(), ClientError> {
        let message = v1::DeleteObjectRequest {
            name: name.into(),
            etag: etag.unwrap_or_default(),
            allow_missing: false,
        };
        self.call("DeleteObject", None, &message, |channel, request| async move {
            ObjectServiceClient::new(channel).delete_object(request).await
        })
        .await
    }

    /// Creates an object whose mesh is sent in pieces.
    async fn upload_object(
        &self,
        described: v1::CreateObjectRequest,
        mesh: Vec<u8>,
    ) -> Result<v1::GraspObject, ClientError> {
        let time = Duration::from_secs(mesh.len().div_ceil(SLOWEST_UPLOAD) as u64);
        let upload = Upload {
            described,
            mesh: mesh.into(),
        };
        self.call(
            "UploadObject",
            Some(time),
            &upload,
            |channel, request| async move {
                let (metadata, extensions, upload) = request.into_parts();
                let request = Request::from_parts(metadata, extensions, tokio_stream::iter(upload.parts()));
                ObjectServiceClient::new(channel).upload_object(request).await
            },
        )
        .await
    }

    /// An object's mesh as searches use it; `name` is "objects/{object}". The call timeout applies to each part; if the connection is
    /// lost, all parts are requested again.
    ///
    /// # Errors
    /// Any except those of connecting; `NotFound` if the object does not exist.
    pub async fn get_mesh(&self, name: impl Into<String>) -> Result<ObjectMesh, ClientError> {
        let message = v1::GetMeshRequest { name: name.into() };
        let mut attempts = 0;
        loop {
            attempts += 1;
            let parts = self
                .call("GetMesh", None, &message, |channel, request| async move {
                    ObjectServiceClient::new(channel).get_mesh(request).await
                })
                .await?;
            let status = match mesh_of(parts, self.call_timeout).await {
                Ok(mesh) => return Ok(mesh),
                Err(status) => of_transport(status),
            };
            match self.retry.wait_after(attempts, &status) {
                Some(wait) => tokio::time::sleep(wait).await,
                None => return Err(ClientError::from_status(&status, attempts)),
            }
        }
    }

    /// Watches the objects that match a filter, as [`filter`](v1::ListObjectsRequest::filter) of lists; all if it is empty. With
    /// `include_present`, the present objects come first. The call timeout applies to the server's first answer only.
    ///
    /// # Errors
    /// Any except those of connecting.
    pub async fn watch_objects(
        &self,
        filter: impl Into<String>,
        include_present: bool,
    ) -> Result<ObjectWatch, ClientError> {
        let message = v1::WatchObjectsRequest {
            filter: filter.into(),
            include_present,
        };
        let watch = |channel, mut request: Request<_>| async move {
            // A deadline would end the watch.
            request.metadata_mut().remove("grpc-timeout");
            ObjectServiceClient::new(channel).watch_objects(request).await
        };
        let news = self.call("WatchObjects", None, &message, watch).await?;
        Ok(MessageStream(news))
    }

    /// All rigs of hands, sorted by name, from as many pages as needed.
    ///
    /// # Errors
    /// Any except those of connecting.
    pub async fn list_rigs(&self) -> Result<Vec<v1::HandRig>, ClientError> {
        let mut rigs = Vec::new();
        let mut message = v1::ListRigsRequest::default();
        loop {
            let page = self
                .call("ListRigs", None, &message, |channel, request| async move {
                    HandRigServiceClient::new(channel).list_rigs(request).await
                })
                .await?;
            rigs.extend(page.rigs);
            match next_token(&message.page_token, page.next_page_token)? {
                None => return Ok(rigs),
                Some(next) => message.page_token = next,
            }
        }
    }

    /// One rig; `name` is "rigs/{rig}".
    ///
    /// # Errors
    /// Any except those of connecting; `NotFound` if the rig does not exist.
    pub async fn get_rig(&self, name: impl Into<String>) -> Result<v1::HandRig, ClientError> {
        let message = v1::GetRigRequest { name: name.into() };
        self.call("GetRig", None, &message, |channel, request| async move {
            HandRigServiceClient::new(channel).get_rig(request).await
        })
        .await
    }

    /// Creates a rig; retried as [`create_object`](Self::create_object) is.
    ///
    /// # Errors
    /// Any except those of connecting; the violations of `InvalidArgument` list everything wrong with the rig.
    pub async fn create_rig(&self, request: &v1::CreateRigRequest) -> Result<v1::HandRig, ClientError> {
        self.call("CreateRig", None, request, |channel, request| async move {
            HandRigServiceClient::new(channel).create_rig(request).await
        })
        .await
    }

    /// Deletes a created rig; `name` is "rigs/{rig}".
    ///
    /// # Errors
    /// Any except those of connecting. If an answer was lost, the retry ends with `NotFound`.
    pub async fn delete_rig(&self, name: impl Into<String>) -> Result<(), ClientError> {
        let message = v1::DeleteRigRequest { name: name.into() };
        self.call("DeleteRig", None, &message, |channel, request| async move {
            HandRigServiceClient::new(channel).delete_rig(request).await
        })
        .await
    }
}

/// The mesh of its parts, each of which comes within a time limit.
async fn mesh_of(mut parts: Streaming<v1::GetMeshResponse>, limit: Duration) -> Result<ObjectMesh, Status> {
    let late = |_| Status::deadline_exceeded(format!("no part of the mesh came within {limit:?}"));
    let mut mesh = ObjectMesh {
        glb: Vec::new(),
        etag: String::new(),
    };
    while let Some(part) = tokio::time::timeout(limit, parts.message())
        .await
        .map_err(late)
        .flatten()?
    {
        mesh.glb.extend(part.piece);
        // Only the first part has an etag.
        mesh.etag += &part.etag;
    }
    Ok(mesh)
}

/// The token of the page after that of `token`; `None` after the last page.
fn next_token(token: &str, next: String) -> Result<Option<String>, ClientError> {
    if !next.is_empty() && next == token {
        // Following it would never end.
        return Err(ClientError::Malformed(
            "next_page_token repeats that of the previous page",
        ));
    }
    Ok(Some(next).filter(|next| !next.is_empty()))
}

/// An object to upload; its clones share the mesh.
#[derive(Clone)]
struct Upload {
    described: v1::CreateObjectRequest,
    mesh: Arc<[u8]>,
}

impl Upload {
    /// The parts, each made when it is sent.
    fn parts(self) -> impl Iterator<Item = v1::UploadObjectRequest> {
        let Self { described, mesh } = self;
        let total_bytes = mesh.len() as u64;
        let digest = Sha256::digest(&mesh);
        let hex = digest.iter().map(|byte| format!("{byte:02x}"));
        let sha256 = hex.collect::<Vec<_>>().concat();
        let pieces = (0..mesh.len()).step_by(PIECE_BYTES).map(move |start| {
            let end = mesh.len().min(start + PIECE_BYTES);
            Part::Piece(mesh[start..end].to_vec())
        });
        let parts = std::iter::once(Part::Create(described)).chain(pieces);
        parts
            .chain([Part::Sha256(sha256)])
            .map(move |part| v1::UploadObjectRequest {
                total_bytes: match part {
                    Part::Create(_) => total_bytes,
                    _ => 0,
                },
                part: Some(part),
            })
    }
}
