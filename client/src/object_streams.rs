//! The client's calls of `ObjectService` that stream: uploads, meshes and watches.

use std::{sync::Arc, time::Duration};

use grasp_proto::v1::{
    self, get_mesh_response, object_service_client::ObjectServiceClient, upload_object_request,
};
use sha2::{Digest as _, Sha256};
use tonic::{Request, Status, Streaming};

use crate::{
    client::GraspClient,
    error::ClientError,
    object::{NewObject, Object, ObjectMesh, ObjectNews},
    wire,
};

/// Bytes of a mesh in one part of an upload; the server takes up to 1 MiB.
const PIECE_BYTES: usize = 256 << 10;

/// Bytes of a mesh per second that an upload is given in addition to the call timeout.
const SLOWEST_UPLOAD: usize = 1 << 20;

/// News of objects, as they happen. Dropping it ends the watch.
#[derive(Debug)]
pub struct ObjectWatch(Streaming<v1::WatchObjectsResponse>);

impl ObjectWatch {
    /// Waits for the next news; none if the server ended the watch without an error. Cancelling the wait loses nothing.
    ///
    /// # Errors
    /// Any except those of connecting; [`ClientError::Unavailable`] when the server shuts down,
    /// [`ClientError::ResourceExhausted`] if this client reads too slowly. Watch again then, with the present objects.
    pub async fn next(&mut self) -> Result<Option<ObjectNews>, ClientError> {
        let news = self
            .0
            .message()
            .await
            .map_err(|status| ClientError::from_status(&status, 1))?;
        Ok(news.map(wire::news_from_wire).transpose()?)
    }
}

impl GraspClient {
    /// Creates an object like [`GraspClient::create_object`], but sends its mesh in pieces: for files that are too large for
    /// one message. Takes at most the call timeout and a second per MiB.
    ///
    /// # Errors
    /// Those of [`GraspClient::create_object`].
    pub async fn upload_object(&self, object: &NewObject) -> Result<Object, ClientError> {
        let seconds = object.mesh.len().div_ceil(SLOWEST_UPLOAD) as u64;
        let timeout = self.call_timeout.saturating_add(Duration::from_secs(seconds));
        let upload = Upload {
            header: v1::UploadHeader {
                object: Some(wire::described_object_to_wire(object)),
                total_bytes: object.mesh.len() as u64,
            },
            sha256: hex(&Sha256::digest(&object.mesh)),
            mesh: object.mesh.as_slice().into(),
        };
        let answer = self
            .call("UploadObject", timeout, &upload, |channel, request| async move {
                let (metadata, extensions, upload) = request.into_parts();
                let request = Request::from_parts(metadata, extensions, tokio_stream::iter(upload.parts()));
                ObjectServiceClient::new(channel).upload_object(request).await
            })
            .await?;
        Ok(wire::object_from_wire(answer.object)?)
    }

    /// An object's mesh as searches use it; `name` is "objects/{object}". The call timeout applies to each part.
    ///
    /// # Errors
    /// Any except those of connecting; [`ClientError::NotFound`] if the object does not exist.
    pub async fn get_mesh(&self, name: impl Into<String>) -> Result<ObjectMesh, ClientError> {
        let message = v1::GetMeshRequest { name: name.into() };
        let mut parts = self
            .call(
                "GetMesh",
                self.call_timeout,
                &message,
                |channel, request| async move { ObjectServiceClient::new(channel).get_mesh(request).await },
            )
            .await?;
        let Some(get_mesh_response::Part::Header(header)) = self.next_part(&mut parts).await? else {
            return Err(malformed("header", "is missing"));
        };
        let object = wire::object_from_wire(header.object)?;
        let mut glb = Vec::new();
        while let Some(part) = self.next_part(&mut parts).await? {
            let get_mesh_response::Part::Piece(piece) = part else {
                return Err(malformed("header", "comes again"));
            };
            glb.extend(piece);
            if glb.len() as u64 > header.total_bytes {
                return Err(malformed("piece", "exceeds header.total_bytes"));
            }
        }
        if hex(&Sha256::digest(&glb)) == header.sha256 {
            Ok(ObjectMesh { glb, object })
        } else {
            Err(malformed("header.sha256", "is not that of the pieces"))
        }
    }

    /// Watches objects with certain labels, as in [`ObjectQuery::filter`](crate::ObjectQuery::filter); all if it is empty. With
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

    /// The next part of a mesh; none at the end.
    async fn next_part(
        &self,
        parts: &mut Streaming<v1::GetMeshResponse>,
    ) -> Result<Option<get_mesh_response::Part>, ClientError> {
        let limit = self.call_timeout;
        let late = || Status::deadline_exceeded(format!("no part of the mesh came within {limit:?}"));
        let response = match tokio::time::timeout(limit, parts.message()).await {
            Ok(Ok(response)) => response,
            Ok(Err(status)) => return Err(ClientError::from_status(&status, 1)),
            Err(_) => return Err(ClientError::from_status(&late(), 1)),
        };
        response
            .map(|response| response.part.ok_or_else(|| malformed("part", "is missing")))
            .transpose()
    }
}

/// An object to upload; its clones share the mesh.
#[derive(Clone)]
struct Upload {
    header: v1::UploadHeader,
    mesh: Arc<[u8]>,
    sha256: String,
}

impl Upload {
    /// The parts, each made when it is sent.
    fn parts(self) -> impl Iterator<Item = v1::UploadObjectRequest> {
        use upload_object_request::Part;
        let Self { header, mesh, sha256 } = self;
        let starts = (0..mesh.len()).step_by(PIECE_BYTES);
        let pieces = starts.map(move |start| {
            let end = mesh.len().min(start + PIECE_BYTES);
            Part::Piece(mesh[start..end].to_vec())
        });
        std::iter::once(Part::Header(header))
            .chain(pieces)
            .chain(std::iter::once(Part::Sha256(sha256)))
            .map(|part| v1::UploadObjectRequest { part: Some(part) })
    }
}

fn malformed(field: &str, problem: &str) -> ClientError {
    ClientError::Malformed {
        field: field.to_owned(),
        problem: problem.to_owned(),
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
