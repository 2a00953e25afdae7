//! A tiny service whose behaviour is scripted, call by call.

use std::{
    collections::VecDeque,
    sync::{Arc, Mutex},
};

use grasp_client::v1::{
    self,
    grasp_service_server::{GraspService, GraspServiceServer},
    object_service_server::{ObjectService, ObjectServiceServer},
    upload_object_request::Part,
};
use tokio_stream::{Iter, Pending, wrappers::TcpListenerStream};
use tonic::{Request, Response, Status, Streaming, transport::Server};

/// Response to one call.
pub(crate) enum Act {
    Fail(Status),
    Answer,
    Hang,
}

/// Follows a script and records the deadlines of calls.
#[derive(Clone, Default)]
pub(crate) struct Scripted {
    script: Arc<Mutex<VecDeque<Act>>>,
    pub(crate) grpc_timeouts: Arc<Mutex<Vec<String>>>,
    /// The ids of requests to create objects.
    pub(crate) request_ids: Arc<Mutex<Vec<String>>>,
    /// Whether the second page of objects repeats its own token.
    pub(crate) repeats_page_token: bool,
    /// The mesh of every object.
    pub(crate) mesh: Vec<u8>,
    /// The mesh that was uploaded.
    pub(crate) uploaded: Arc<Mutex<Vec<u8>>>,
}

impl Scripted {
    pub(crate) fn new(script: impl IntoIterator<Item = Act>) -> Self {
        Self {
            script: Arc::new(Mutex::new(script.into_iter().collect())),
            ..Self::default()
        }
    }

    async fn act<T>(&self, request: &Request<T>) -> Result<(), Status> {
        if let Some(timeout) = request.metadata().get("grpc-timeout") {
            let timeout = timeout.to_str().unwrap().to_owned();
            self.grpc_timeouts.lock().unwrap().push(timeout);
        }
        let act = self.script.lock().unwrap().pop_front();
        match act.expect("the script covers every call") {
            Act::Fail(status) => Err(status),
            Act::Answer => Ok(()),
            Act::Hang => std::future::pending().await,
        }
    }

    pub(crate) fn calls(&self) -> usize {
        self.grpc_timeouts.lock().unwrap().len()
    }

    /// Serves on a free port until the test's runtime ends; returns the URL.
    pub(crate) async fn serve(&self) -> String {
        let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = listener.local_addr().unwrap();
        let (_, health_service) = tonic_health::server::health_reporter();
        let router = Server::builder()
            .add_service(health_service)
            .add_service(GraspServiceServer::new(self.clone()))
            .add_service(ObjectServiceServer::new(self.clone()));
        tokio::spawn(router.serve_with_incoming(TcpListenerStream::new(listener)));
        format!("http://{address}")
    }
}

#[tonic::async_trait]
impl GraspService for Scripted {
    async fn find_grasp(
        &self,
        request: Request<v1::FindGraspRequest>,
    ) -> Result<Response<v1::FindGraspResponse>, Status> {
        self.act(&request).await?;
        Ok(Response::new(v1::FindGraspResponse {
            outcome: v1::Outcome::BudgetExhausted.into(),
            report: Some(v1::SearchReport {
                attempts: 5,
                limits: vec![v1::Verdict {
                    check: v1::Check::Mass.into(),
                    value: Some(80.0),
                    bound: Some(70.0),
                    description: "mass: 80 kg".to_owned(),
                    ..v1::Verdict::default()
                }],
                search_time: Some(prost_types::Duration::default()),
                ..v1::SearchReport::default()
            }),
            ..v1::FindGraspResponse::default()
        }))
    }

    type StreamGraspsStream = Pending<Result<v1::FindGraspResponse, Status>>;

    async fn stream_grasps(
        &self,
        _: Request<v1::StreamGraspsRequest>,
    ) -> Result<Response<Self::StreamGraspsStream>, Status> {
        Err(Status::unimplemented("not scripted"))
    }

    type TrackHoldoutStream = Pending<Result<v1::TrackAnswer, Status>>;

    async fn track_holdout(
        &self,
        _: Request<Streaming<v1::TrackHoldoutRequest>>,
    ) -> Result<Response<Self::TrackHoldoutStream>, Status> {
        Err(Status::unimplemented("not scripted"))
    }

    async fn create_track(&self, _: Request<v1::Track>) -> Result<Response<v1::Track>, Status> {
        Err(Status::unimplemented("not scripted"))
    }

    async fn push_frame(&self, _: Request<v1::TrackFrame>) -> Result<Response<v1::TrackAnswer>, Status> {
        Err(Status::unimplemented("not scripted"))
    }

    async fn delete_track(&self, _: Request<v1::DeleteTrackRequest>) -> Result<Response<()>, Status> {
        Err(Status::unimplemented("not scripted"))
    }

    async fn validate_grasp(
        &self,
        _: Request<v1::ValidateGraspRequest>,
    ) -> Result<Response<v1::ValidateGraspResponse>, Status> {
        Err(Status::unimplemented("not scripted"))
    }

    async fn evaluate_holdout(
        &self,
        _: Request<v1::EvaluateHoldoutRequest>,
    ) -> Result<Response<v1::EvaluateHoldoutResponse>, Status> {
        Err(Status::unimplemented("not scripted"))
    }
}

fn wire_object(name: &str) -> v1::GraspObject {
    v1::GraspObject {
        name: name.to_owned(),
        center_of_mass: Some(v1::Vector3::default()),
        bounding_box: Some(v1::BoxShape::default()),
        create_time: Some(prost_types::Timestamp::default()),
        update_time: Some(prost_types::Timestamp::default()),
        ..v1::GraspObject::default()
    }
}

/// The object that a request would create.
fn created(request: v1::CreateObjectRequest) -> Response<v1::GraspObject> {
    Response::new(wire_object(&request.object.unwrap_or_default().name))
}

#[tonic::async_trait]
impl ObjectService for Scripted {
    async fn create_object(
        &self,
        request: Request<v1::CreateObjectRequest>,
    ) -> Result<Response<v1::GraspObject>, Status> {
        let id = request.get_ref().request_id.clone();
        self.request_ids.lock().unwrap().push(id);
        self.act(&request).await?;
        Ok(created(request.into_inner()))
    }

    async fn get_object(
        &self,
        request: Request<v1::GetObjectRequest>,
    ) -> Result<Response<v1::GraspObject>, Status> {
        self.act(&request).await?;
        Ok(Response::new(wire_object(&request.into_inner().name)))
    }

    /// Three pages of one object each, named after the page token.
    async fn list_objects(
        &self,
        request: Request<v1::ListObjectsRequest>,
    ) -> Result<Response<v1::ListObjectsResponse>, Status> {
        self.act(&request).await?;
        let token = request.into_inner().page_token;
        let next = match token.as_str() {
            "" => "b",
            "b" if self.repeats_page_token => "b",
            "b" => "c",
            "c" => "",
            other => panic!("token {other:?} was never given"),
        };
        Ok(Response::new(v1::ListObjectsResponse {
            objects: vec![wire_object(&format!("objects/{token}"))],
            next_page_token: next.to_owned(),
        }))
    }

    async fn update_object(
        &self,
        _: Request<v1::UpdateObjectRequest>,
    ) -> Result<Response<v1::GraspObject>, Status> {
        Err(Status::unimplemented("not scripted"))
    }

    async fn delete_object(&self, _: Request<v1::DeleteObjectRequest>) -> Result<Response<()>, Status> {
        Err(Status::unimplemented("not scripted"))
    }

    async fn upload_object(
        &self,
        request: Request<Streaming<v1::UploadObjectRequest>>,
    ) -> Result<Response<v1::GraspObject>, Status> {
        self.act(&request).await?;
        let mut parts = request.into_inner();
        let mut object = v1::CreateObjectRequest::default();
        while let Some(part) = parts.message().await? {
            match part.part {
                Some(Part::Create(create)) => {
                    self.request_ids.lock().unwrap().push(create.request_id.clone());
                    object = create;
                }
                Some(Part::Piece(piece)) => self.uploaded.lock().unwrap().extend(piece),
                Some(Part::Sha256(_)) | None => {}
            }
        }
        Ok(created(object))
    }

    type GetMeshStream = Iter<std::vec::IntoIter<Result<v1::GetMeshResponse, Status>>>;

    async fn get_mesh(
        &self,
        request: Request<v1::GetMeshRequest>,
    ) -> Result<Response<Self::GetMeshStream>, Status> {
        self.act(&request).await?;
        let pieces = self.mesh.chunks(128 << 10).enumerate();
        let parts = pieces.map(|(place, piece)| {
            Ok(v1::GetMeshResponse {
                piece: piece.to_vec(),
                etag: if place == 0 { "1".to_owned() } else { String::new() },
            })
        });
        Ok(Response::new(tokio_stream::iter(parts.collect::<Vec<_>>())))
    }

    type WatchObjectsStream = Pending<Result<v1::WatchObjectsResponse, Status>>;

    async fn watch_objects(
        &self,
        _: Request<v1::WatchObjectsRequest>,
    ) -> Result<Response<Self::WatchObjectsStream>, Status> {
        Err(Status::unimplemented("not scripted"))
    }

    async fn get_atlas(&self, request: Request<v1::GetAtlasRequest>) -> Result<Response<v1::Atlas>, Status> {
        self.act(&request).await?;
        let name = request.into_inner().name;
        Ok(Response::new(v1::Atlas {
            name,
            ..v1::Atlas::default()
        }))
    }
}
