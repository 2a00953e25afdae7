//! Receives the mesh of an object in pieces.

use std::{sync::Arc, time::Duration};

use grasp_proto::v1::{self, upload_object_request::Part};
use sha2::{Digest as _, Sha256};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio_stream::{Stream, StreamExt as _};
use tonic::Status;

use crate::{
    error::{Limit, ServiceError, Violation},
    limits::MAX_PIECE,
    validate::{UploadQuery, quoted, upload_query},
    wire::hex,
};

/// Bytes per permit of the pool that uploads share.
const BYTES_PER_PERMIT: usize = 1 << 10;

/// Longest time of an upload: 256 MiB at half a megabyte per second.
const MAX_UPLOAD_TIME: Duration = Duration::from_mins(10);

/// When to retry if others upload as much as the server takes at a time.
const RETRY_AFTER: Duration = Duration::from_secs(2);

/// Bounds uploads in pieces.
#[derive(Clone, Debug)]
pub(crate) struct Uploads {
    /// Permits for the bytes of all uploads together.
    pool: Arc<Semaphore>,
    /// Largest number of bytes of all uploads together, and thus of one.
    maximum_bytes: usize,
    /// Longest wait for the next message.
    idle: Duration,
}

/// A request with its mesh, which takes its part of the pool until it is dropped.
#[derive(Debug)]
pub(super) struct ReceivedUpload {
    pub(super) request: v1::CreateObjectRequest,
    /// To hold as long as the mesh is needed.
    pub(super) room: OwnedSemaphorePermit,
}

impl Uploads {
    /// No uploads yet.
    pub(crate) fn new(maximum_bytes: usize, idle: Duration) -> Self {
        Self {
            pool: Arc::new(Semaphore::new(maximum_bytes.div_ceil(BYTES_PER_PERMIT))),
            maximum_bytes,
            idle,
        }
    }

    /// Largest number of bytes of a mesh.
    pub(super) fn maximum_bytes(&self) -> usize {
        self.maximum_bytes
    }

    /// Receives a mesh. `admit` checks whether the object may be created, once its first part is there.
    pub(super) async fn receive(
        &self,
        parts: impl Stream<Item = Result<v1::UploadObjectRequest, Status>>,
        admit: impl FnOnce(&UploadQuery) -> Result<(), ServiceError>,
    ) -> Result<ReceivedUpload, ServiceError> {
        let mut parts = Parts {
            stream: std::pin::pin!(parts),
            idle: self.idle,
        };
        let receiving = async {
            let first = parts.next().await?;
            let Some((Part::Create(request), total_bytes)) = first else {
                return Err(ServiceError::invalid(
                    "create",
                    "is missing; it must be the first part",
                ));
            };
            let query = upload_query(request, total_bytes, self.maximum_bytes)?;
            admit(&query)?;
            let room = self.room(query.bytes)?;
            let mut request = query.request;
            request.mesh = received_mesh(&mut parts, query.bytes).await?;
            Ok(ReceivedUpload { request, room })
        };
        tokio::time::timeout(MAX_UPLOAD_TIME, receiving)
            .await
            .unwrap_or(Err(ServiceError::TookTooLong {
                limit: MAX_UPLOAD_TIME,
            }))
    }

    /// Room for so many bytes.
    fn room(&self, bytes: usize) -> Result<OwnedSemaphorePermit, ServiceError> {
        let permits = u32::try_from(bytes.div_ceil(BYTES_PER_PERMIT)).unwrap_or(u32::MAX);
        let room = Arc::clone(&self.pool).try_acquire_many_owned(permits);
        room.map_err(|_| ServiceError::Overloaded {
            limit: Limit::UploadBytes,
            maximum: self.maximum_bytes,
            retry_after: RETRY_AFTER,
        })
    }
}

/// The parts of an upload.
struct Parts<'a, S> {
    stream: std::pin::Pin<&'a mut S>,
    idle: Duration,
}

impl<S: Stream<Item = Result<v1::UploadObjectRequest, Status>>> Parts<'_, S> {
    /// The next part, with the total that it names; `None` at the end.
    async fn next(&mut self) -> Result<Option<(Part, u64)>, ServiceError> {
        match tokio::time::timeout(self.idle, self.stream.next()).await {
            Err(_) => Err(ServiceError::UploadStalled { limit: self.idle }),
            Ok(None) => Ok(None),
            // What is no message of the contract, or too long for one.
            Ok(Some(Err(status))) => Err(ServiceError::Malformed(status.message().to_owned())),
            Ok(Some(Ok(request))) => match request.part {
                Some(part) => Ok(Some((part, request.total_bytes))),
                None => Err(ServiceError::invalid(
                    "part",
                    "is missing; it must be a piece or sha256",
                )),
            },
        }
    }
}

/// The pieces of a mesh of so many bytes, checked against the hash that follows them.
async fn received_mesh<S>(parts: &mut Parts<'_, S>, bytes: usize) -> Result<Vec<u8>, ServiceError>
where
    S: Stream<Item = Result<v1::UploadObjectRequest, Status>>,
{
    let mut mesh: Vec<u8> = Vec::new();
    // Untouched memory costs nothing; growing in steps would copy, and take up to twice as much.
    if mesh.try_reserve_exact(bytes).is_err() {
        return Err(ServiceError::Overloaded {
            limit: Limit::UploadBytes,
            maximum: bytes,
            retry_after: RETRY_AFTER,
        });
    }
    let mut hash = Sha256::new();
    let expected = loop {
        let received = mesh.len();
        match parts.next().await?.map(|(part, _)| part) {
            None => {
                return Err(ServiceError::invalid(
                    "sha256",
                    format!("is missing; the stream ended after {received} of {bytes} bytes"),
                ));
            }
            Some(Part::Create(_)) => {
                return Err(ServiceError::invalid(
                    "create",
                    "comes again; it must be the first part only",
                ));
            }
            Some(Part::Piece(piece)) => {
                let length = piece.len();
                if !(1..=MAX_PIECE).contains(&length) {
                    return Err(ServiceError::invalid(
                        "piece",
                        format!("has {length} bytes; it must have 1 to {MAX_PIECE}"),
                    ));
                }
                if length > bytes - received {
                    return Err(ServiceError::invalid(
                        "piece",
                        format!("makes {} bytes; total_bytes is {bytes}", received + length),
                    ));
                }
                hash.update(&piece);
                mesh.extend_from_slice(&piece);
            }
            Some(Part::Sha256(_)) if received < bytes => {
                return Err(ServiceError::invalid(
                    "sha256",
                    format!("comes after {received} bytes; total_bytes is {bytes}"),
                ));
            }
            Some(Part::Sha256(expected)) => break expected,
        }
    };
    let found = hex(&hash.finalize());
    if expected.eq_ignore_ascii_case(&found) {
        Ok(mesh)
    } else {
        let expected = quoted(&expected);
        Err(ServiceError::invalid(
            "sha256",
            format!("is {expected}; the received bytes have {found}"),
        ))
    }
}

/// The errors of an object's fields as those of the parts that have them.
pub(super) fn blame_parts(error: ServiceError) -> ServiceError {
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
