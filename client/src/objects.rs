//! The client's calls of `ObjectService`.

use grasp_proto::v1::{self, object_service_client::ObjectServiceClient};

use crate::{
    client::GraspClient,
    error::ClientError,
    object::{NewObject, Object, ObjectPage, ObjectQuery, ObjectUpdate},
    wire,
};

impl GraspClient {
    /// One page of the objects. With `page_size` 0 the server chooses the size; the first page has no `page_token`.
    ///
    /// # Errors
    /// Any except those of connecting.
    pub async fn list_objects_page(
        &self,
        query: &ObjectQuery,
        page_size: u16,
        page_token: Option<String>,
    ) -> Result<ObjectPage, ClientError> {
        let message = v1::ListObjectsRequest {
            page_size: page_size.into(),
            page_token: page_token.unwrap_or_default(),
            filter: query.filter.clone(),
            order_by: query.order_by.clone(),
        };
        let page = self
            .call(
                "ListObjects",
                self.call_timeout,
                &message,
                |channel, request| async move { ObjectServiceClient::new(channel).list_objects(request).await },
            )
            .await?;
        Ok(wire::object_page_from_wire(page)?)
    }

    /// All objects of a query, from as many pages as needed.
    ///
    /// # Errors
    /// Any except those of connecting.
    pub async fn list_objects(&self, query: &ObjectQuery) -> Result<Vec<Object>, ClientError> {
        let mut objects = Vec::new();
        let mut token = None;
        loop {
            let page = self.list_objects_page(query, 0, token.clone()).await?;
            objects.extend(page.objects);
            match page.next_page_token {
                None => return Ok(objects),
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

    /// One object; `name` is "objects/{object}".
    ///
    /// # Errors
    /// Any except those of connecting; [`ClientError::NotFound`] if the object does not exist.
    pub async fn get_object(&self, name: impl Into<String>) -> Result<Object, ClientError> {
        let message = v1::GetObjectRequest { name: name.into() };
        let answer = self
            .call(
                "GetObject",
                self.call_timeout,
                &message,
                |channel, request| async move { ObjectServiceClient::new(channel).get_object(request).await },
            )
            .await?;
        Ok(wire::object_from_wire(answer.object)?)
    }

    /// Creates an object. The call is retried like any other: the server recognises a retry by its request id, and answers
    /// with the object that the lost answer was about.
    ///
    /// # Errors
    /// Any except those of connecting; [`ClientError::InvalidArgument`] lists everything wrong with the object,
    /// [`ClientError::AlreadyExists`] means that another call created an object with this id.
    pub async fn create_object(&self, object: &NewObject) -> Result<Object, ClientError> {
        let message = wire::new_object_to_wire(object);
        let answer = self
            .call(
                "CreateObject",
                self.call_timeout,
                &message,
                |channel, request| async move { ObjectServiceClient::new(channel).create_object(request).await },
            )
            .await?;
        Ok(wire::object_from_wire(answer.object)?)
    }

    /// Changes an object; `name` is "objects/{object}". A retry after a lost answer changes nothing further; with an etag,
    /// it fails with [`ClientError::Aborted`].
    ///
    /// # Errors
    /// Any except those of connecting; [`ClientError::Aborted`] if the object has another etag,
    /// [`ClientError::FailedPrecondition`] if the server started with it.
    pub async fn update_object(
        &self,
        name: impl Into<String>,
        update: &ObjectUpdate,
    ) -> Result<Object, ClientError> {
        let message = wire::update_to_wire(name.into(), update);
        let answer = self
            .call(
                "UpdateObject",
                self.call_timeout,
                &message,
                |channel, request| async move { ObjectServiceClient::new(channel).update_object(request).await },
            )
            .await?;
        Ok(wire::object_from_wire(answer.object)?)
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
        self.call(
            "DeleteObject",
            self.call_timeout,
            &message,
            |channel, request| async move { ObjectServiceClient::new(channel).delete_object(request).await },
        )
        .await?;
        Ok(())
    }
}
