//! The client's calls of `HandRigService`.

use grasp_proto::v1::{self, hand_rig_service_client::HandRigServiceClient};

use crate::{
    client::GraspClient,
    error::ClientError,
    rig::{NewRig, Rig},
    wire,
};

impl GraspClient {
    /// All rigs of hands, sorted by name, from as many pages as needed.
    ///
    /// # Errors
    /// Any except those of connecting.
    pub async fn list_rigs(&self) -> Result<Vec<Rig>, ClientError> {
        let mut rigs = Vec::new();
        let mut token = None;
        loop {
            let message = v1::ListRigsRequest {
                page_size: 0,
                page_token: token.clone().unwrap_or_default(),
            };
            let page = self
                .call(
                    "ListRigs",
                    self.call_timeout,
                    &message,
                    |channel, request| async move { HandRigServiceClient::new(channel).list_rigs(request).await },
                )
                .await?;
            let (page, next) = wire::rig_page_from_wire(page)?;
            rigs.extend(page);
            match next {
                None => return Ok(rigs),
                // A repeated token would make this loop endless.
                next if next == token => {
                    return Err(ClientError::Malformed {
                        field: "next_page_token".to_owned(),
                        problem: "repeats the token of the previous page".to_owned(),
                    });
                }
                next => token = next,
            }
        }
    }

    /// One rig; `name` is "rigs/{rig}".
    ///
    /// # Errors
    /// Any except those of connecting.
    pub async fn get_rig(&self, name: impl Into<String>) -> Result<Rig, ClientError> {
        let message = v1::GetRigRequest { name: name.into() };
        let answer = self
            .call(
                "GetRig",
                self.call_timeout,
                &message,
                |channel, request| async move { HandRigServiceClient::new(channel).get_rig(request).await },
            )
            .await?;
        Ok(wire::rig_from_wire(answer.rig)?)
    }

    /// Creates a rig; retried as [`create_object`](Self::create_object) is.
    ///
    /// # Errors
    /// Any except those of connecting; [`ClientError::InvalidArgument`] lists everything wrong with the rig.
    pub async fn create_rig(&self, rig: &NewRig) -> Result<Rig, ClientError> {
        let message = wire::new_rig_to_wire(rig);
        let answer = self
            .call(
                "CreateRig",
                self.call_timeout,
                &message,
                |channel, request| async move { HandRigServiceClient::new(channel).create_rig(request).await },
            )
            .await?;
        Ok(wire::rig_from_wire(answer.rig)?)
    }

    /// Deletes a created rig; `name` is "rigs/{rig}".
    ///
    /// # Errors
    /// Any except those of connecting. If an answer was lost, the retry ends with [`ClientError::NotFound`].
    pub async fn delete_rig(&self, name: impl Into<String>) -> Result<(), ClientError> {
        let message = v1::DeleteRigRequest { name: name.into() };
        self.call(
            "DeleteRig",
            self.call_timeout,
            &message,
            |channel, request| async move { HandRigServiceClient::new(channel).delete_rig(request).await },
        )
        .await?;
        Ok(())
    }
}
