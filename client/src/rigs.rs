//! The client's calls of `HandRigService`.

use grasp_proto::v1::{self, hand_rig_service_client::HandRigServiceClient};

use crate::{client::GraspClient, error::ClientError, objects::next_token};

impl GraspClient {
    /// All rigs of hands, sorted by name, from as many pages as needed.
    ///
    /// # Errors
    /// Any except those of connecting.
    pub async fn list_rigs(&self) -> Result<Vec<v1::HandRig>, ClientError> {
        let mut rigs = Vec::new();
        let mut message = v1::ListRigsRequest::default();
        loop {
            let page = self
                .short_call("ListRigs", &message, |channel, request| async move {
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
    /// Any except those of connecting; [`ClientError::NotFound`] if the rig does not exist.
    pub async fn get_rig(&self, name: impl Into<String>) -> Result<v1::HandRig, ClientError> {
        let message = v1::GetRigRequest { name: name.into() };
        self.short_call("GetRig", &message, |channel, request| async move {
            HandRigServiceClient::new(channel).get_rig(request).await
        })
        .await
    }

    /// Creates a rig; retried as [`create_object`](Self::create_object) is.
    ///
    /// # Errors
    /// Any except those of connecting; [`ClientError::InvalidArgument`] lists everything wrong with the rig.
    pub async fn create_rig(&self, request: &v1::CreateRigRequest) -> Result<v1::HandRig, ClientError> {
        self.short_call("CreateRig", request, |channel, request| async move {
            HandRigServiceClient::new(channel).create_rig(request).await
        })
        .await
    }

    /// Deletes a created rig; `name` is "rigs/{rig}".
    ///
    /// # Errors
    /// Any except those of connecting. If an answer was lost, the retry ends with [`ClientError::NotFound`].
    pub async fn delete_rig(&self, name: impl Into<String>) -> Result<(), ClientError> {
        let message = v1::DeleteRigRequest { name: name.into() };
        self.short_call("DeleteRig", &message, |channel, request| async move {
            HandRigServiceClient::new(channel).delete_rig(request).await
        })
        .await
    }
}
