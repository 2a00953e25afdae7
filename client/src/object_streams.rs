//! The client's calls of `ObjectService` that stream: uploads, meshes and watches.

use std::{sync::Arc, time::Duration};

use grasp_proto::v1::{self, object_service_client::ObjectServiceClient, upload_object_request::Part};
use sha2::{Digest as _, Sha256};
use tonic::{Request, Status, Streaming};

use crate::{client::GraspClient, error::ClientError};

/// Bytes of a mesh in one part of an upload; the server takes up to 1 MiB.
const PIECE_BYTES: usize = 256 << 10;

/// Bytes of a mesh per second that an upload is given in addition to the call timeout.
const SLOWEST_UPLOAD: usize = 1 << 20;

/// Bytes of a GLB file until its length has been read, and what they begin with.
const GLB_HEADER: usize = 12;
const GLB_MAGIC: [u8; 4] = *b"glTF";

/// An object's mesh as searches use it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ObjectMesh {
    /// A GLB file in the object's frame, in metres and +Y up. Triangles that may be touched have the material `surface`, the
    /// others `forbidden`.
    pub glb: Vec<u8>,
    /// The state of the object that it belongs to.
    pub etag: String,
}

/// News of objects, as they happen. Dropping it ends the watch.
#[derive(Debug)]
pub struct ObjectWatch(Streaming<v1::WatchObjectsResponse>);

impl ObjectWatch {
    /// Waits for the next news; `None` if the server ended the watch without an error. Cancelling the wait loses nothing.
    ///
    /// # Errors
    /// Any except those of connecting; [`ClientError::Unavailable`] when the server shuts down,
    /// [`ClientError::ResourceExhausted`] if this client reads too slowly. Watch again then, with the present objects.
    pub async fn next(&mut self) -> Result<Option<v1::WatchObjectsResponse>, ClientError> {
        let news = self.0.message().await;
        news.map_err(|status| ClientError::from_status(&status, 1))
    }
}

impl GraspClient {
    /// Creates an object that is described without its mesh, which is sent in pieces.
    pub(crate) async fn upload_object(
        &self,
        described: v1::CreateObjectRequest,
        mesh: &[u8],
    ) -> Result<v1::GraspObject, ClientError> {
        let seconds = mesh.len().div_ceil(SLOWEST_UPLOAD) as u64;
        let timeout = self.call_timeout.saturating_add(Duration::from_secs(seconds));
        let upload = Upload {
            described,
            sha256: hex(&Sha256::digest(mesh)),
            mesh: mesh.into(),
        };
        self.call("UploadObject", timeout, &upload, |channel, request| async move {
            let (metadata, extensions, upload) = request.into_parts();
            let request = Request::from_parts(metadata, extensions, tokio_stream::iter(upload.parts()));
            ObjectServiceClient::new(channel).upload_object(request).await
        })
        .await
    }

    /// An object's mesh as searches use it; `name` is "objects/{object}". The call timeout applies to each part.
    ///
    /// # Errors
    /// Any except those of connecting; [`ClientError::NotFound`] if the object does not exist.
    pub async fn get_mesh(&self, name: impl Into<String>) -> Result<ObjectMesh, ClientError> {
        let message = v1::GetMeshRequest { name: name.into() };
        let mut parts = self
            .short_call("GetMesh", &message, |channel, request| async move {
                ObjectServiceClient::new(channel).get_mesh(request).await
            })
            .await?;
        let mut mesh = ObjectMesh {
            glb: Vec::new(),
            etag: String::new(),
        };
        while let Some(part) = self.next_part(&mut parts).await? {
            if mesh.glb.is_empty() {
                mesh.etag = part.etag;
            }
            mesh.glb.extend(part.piece);
            if length(&mesh.glb)?.is_some_and(|length| mesh.glb.len() > length) {
                return Err(ClientError::malformed("piece", "exceeds the file's length"));
            }
        }
        if length(&mesh.glb)? == Some(mesh.glb.len()) {
            Ok(mesh)
        } else {
            Err(ClientError::malformed("piece", "is missing: the file is cut off"))
        }
    }

    /// Watches the objects that match a filter, as [`filter`](v1::ListObjectsRequest::filter) of lists; all if it is empty. With
    /// `include_present`, news of the present objects come first. The call timeout applies to the server's first answer only.
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
        let news = self
            .call(
                "WatchObjects",
                self.call_timeout,
                &message,
                |channel, mut request| async move {
                    // A deadline would end the watch.
                    request.metadata_mut().remove("grpc-timeout");
                    ObjectServiceClient::new(channel).watch_objects(request).await
                },
            )
            .await?;
        Ok(ObjectWatch(news))
    }

    /// The next part of a mesh; `None` at the end.
    async fn next_part(
        &self,
        parts: &mut Streaming<v1::GetMeshResponse>,
    ) -> Result<Option<v1::GetMeshResponse>, ClientError> {
        let limit = self.call_timeout;
        let late = |_| Status::deadline_exceeded(format!("no part of the mesh came within {limit:?}"));
        let part = tokio::time::timeout(limit, parts.message()).await;
        part.map_err(late)
            .flatten()
            .map_err(|status| ClientError::from_status(&status, 1))
    }
}

/// The length in bytes that the header of a GLB file states; `None` before the header is complete.
fn length(glb: &[u8]) -> Result<Option<usize>, ClientError> {
    let Some(header) = glb.first_chunk::<GLB_HEADER>() else {
        return Ok(None);
    };
    let [m, a, g, i, _, _, _, _, length @ ..] = *header;
    if [m, a, g, i] == GLB_MAGIC {
        Ok(Some(u32::from_le_bytes(length) as usize))
    } else {
        Err(ClientError::malformed("piece", "does not begin a GLB file"))
    }
}

/// An object to upload; its clones share the mesh.
#[derive(Clone)]
struct Upload {
    described: v1::CreateObjectRequest,
    mesh: Arc<[u8]>,
    sha256: String,
}

impl Upload {
    /// The parts, each made when it is sent.
    fn parts(self) -> impl Iterator<Item = v1::UploadObjectRequest> {
        let Self {
            described,
            mesh,
            sha256,
        } = self;
        let first = v1::UploadObjectRequest {
            part: Some(Part::Create(described)),
            total_bytes: mesh.len() as u64,
        };
        let starts = (0..mesh.len()).step_by(PIECE_BYTES);
        let pieces = starts.map(move |start| {
            let end = mesh.len().min(start + PIECE_BYTES);
            Part::Piece(mesh[start..end].to_vec())
        });
        let later = pieces.chain(std::iter::once(Part::Sha256(sha256)));
        std::iter::once(first).chain(later.map(|part| v1::UploadObjectRequest {
            part: Some(part),
            total_bytes: 0,
        }))
    }
}

fn hex(bytes: &[u8]) -> String {
    use std::fmt::Write as _;
    bytes.iter().fold(String::new(), |mut text, byte| {
        // Writing to a string cannot fail.
        let _ = write!(text, "{byte:02x}");
        text
    })
}
