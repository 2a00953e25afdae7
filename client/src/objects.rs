//! The client's calls of `ObjectService`.

use grasp_proto::v1::{self, object_service_client::ObjectServiceClient};
use uuid::Uuid;

use crate::{client::GraspClient, error::ClientError};

/// Largest mesh in bytes that is sent in one message, which is what servers take by default; larger ones are uploaded in
/// pieces.
const MAX_MESSAGE: usize = 8 << 20;

impl GraspClient {
    /// All objects from the page on that the request names, from as many pages as needed.
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
                .short_call("ListObjects", &request, |channel, request| async move {
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
    /// Any except those of connecting; [`ClientError::NotFound`] if the object does not exist.
    pub async fn get_object(&self, name: impl Into<String>) -> Result<v1::GraspObject, ClientError> {
        let message = v1::GetObjectRequest { name: name.into() };
        self.short_call("GetObject", &message, |channel, request| async move {
            ObjectServiceClient::new(channel).get_object(request).await
        })
        .await
    }

    /// The state of an object's atlas for one hand; `name` is "objects/{object}/atlases/left" or ".../right".
    ///
    /// # Errors
    /// Any except those of connecting; [`ClientError::NotFound`] if the object does not exist.
    pub async fn get_atlas(&self, name: impl Into<String>) -> Result<v1::Atlas, ClientError> {
        let message = v1::GetAtlasRequest { name: name.into() };
        self.short_call("GetAtlas", &message, |channel, request| async move {
            ObjectServiceClient::new(channel).get_atlas(request).await
        })
        .await
    }

    /// Creates an object. A mesh of more than 8 MiB is sent in pieces. The call is retried like any other: the server
    /// recognises a retry by its request id, which is drawn if the request has none, and answers with the object that the lost
    /// answer was about. Takes at most the call timeout and, in pieces, a second per MiB.
    ///
    /// # Errors
    /// Any except those of connecting; [`ClientError::InvalidArgument`] lists everything wrong with the object,
    /// [`ClientError::AlreadyExists`] means that another call created an object with this name.
    pub async fn create_object(
        &self,
        request: &v1::CreateObjectRequest,
    ) -> Result<v1::GraspObject, ClientError> {
        let v1::CreateObjectRequest {
            object,
            mesh,
            request_id,
        } = request;
        let described = v1::CreateObjectRequest {
            object: object.clone(),
            mesh: Vec::new(),
            request_id: if request_id.is_empty() {
                Uuid::new_v4().to_string()
            } else {
                request_id.clone()
            },
        };
        if mesh.len() > MAX_MESSAGE {
            return self.upload_object(described, mesh).await;
        }
        let message = v1::CreateObjectRequest {
            mesh: mesh.clone(),
            ..described
        };
        self.short_call("CreateObject", &message, |channel, request| async move {
            ObjectServiceClient::new(channel).create_object(request).await
        })
        .await
    }

    /// Changes an object. A retry after a lost answer changes nothing further; with an etag, it fails with
    /// [`ClientError::Aborted`].
    ///
    /// # Errors
    /// Any except those of connecting; [`ClientError::Aborted`] if the object has another etag,
    /// [`ClientError::FailedPrecondition`] if the server started with it.
    pub async fn update_object(
        &self,
        request: &v1::UpdateObjectRequest,
    ) -> Result<v1::GraspObject, ClientError> {
        self.short_call("UpdateObject", request, |channel, request| async move {
            ObjectServiceClient::new(channel).update_object(request).await
        })
        .await
    }

    /// Deletes an object that exists; `name` is "objects/{object}". With an etag, only if the object still has it.
    ///
    /// # Errors
    /// Any except those of connecting; [`ClientError::Aborted`] if the object has another etag,
    /// [`ClientError::FailedPrecondition`] if the server started with it. After a retry, [`ClientError::NotFound`] may mean
    /// that the lost answer was about its deletion.
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
        self.short_call("DeleteObject", &message, |channel, request| async move {
            ObjectServiceClient::new(channel).delete_object(request).await
        })
        .await
    }
}

/// The token of the page after the one that `token` named; `None` after the last one.
pub(crate) fn next_token(token: &str, next: String) -> Result<Option<String>, ClientError> {
    if next.is_empty() {
        Ok(None)
    } else if next == token {
        // Following it would never end.
        Err(ClientError::malformed(
            "next_page_token",
            "repeats the token of the previous page",
        ))
    } else {
        Ok(Some(next))
    }
}
