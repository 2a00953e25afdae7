//! Objects and rigs saved in a bucket outlast the server, which has the bucket to itself.
//!
//! tests/s3/run starts an S3 server and sets the variables: `GRASP_TEST_STORE` is an empty `s3://BUCKET/PREFIX`, and `AWS_*` say where
//! it is.

use std::{
    net::{Ipv6Addr, SocketAddr},
    time::{Duration, Instant},
};

use grasp_proto::v1::{
    self, grasp_service_client::GraspServiceClient, hand_rig_service_client::HandRigServiceClient,
    object_service_client::ObjectServiceClient,
};
use grasp_server::{Config, ServeError, Server, config::RawConfig};
use tokio::{net::TcpListener, task::JoinHandle};
use tokio_util::sync::CancellationToken;
use tonic::{
    Code,
    transport::{Channel, Endpoint},
};

/// How long a bucket is kept for a server that is gone.
const TERM: Duration = Duration::from_secs(15);

const BOX_OBJ: &str = "v -.02 -.015 -.01\nv .02 -.015 -.01\nv .02 .015 -.01\nv -.02 .015 -.01\n\
                       v -.02 -.015 .01\nv .02 -.015 .01\nv .02 .015 .01\nv -.02 .015 .01\n\
                       f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

fn config() -> Config {
    let store = std::env::var("GRASP_TEST_STORE").expect("tests/s3/run sets GRASP_TEST_STORE");
    let mut raw = RawConfig {
        store: Some(store),
        builder_threads: Some(0),
        ..RawConfig::default()
    };
    raw.complete(RawConfig::default()).expect("the place is valid")
}

struct Running {
    address: SocketAddr,
    stop: CancellationToken,
    serving: JoinHandle<Result<(), ServeError>>,
}

impl Running {
    async fn start() -> Self {
        let listener = TcpListener::bind((Ipv6Addr::LOCALHOST, 0)).await.unwrap();
        let address = listener.local_addr().unwrap();
        let server = Server::new(config()).unwrap();
        let stop = CancellationToken::new();
        let serving = tokio::spawn(server.serve([listener.into()], stop.clone().cancelled_owned()));
        Self {
            address,
            stop,
            serving,
        }
    }

    async fn channel(&self) -> Channel {
        let endpoint = Endpoint::from_shared(format!("http://{}", self.address)).unwrap();
        endpoint.connect().await.unwrap()
    }

    async fn stop(self) {
        self.stop.cancel();
        self.serving.await.unwrap().unwrap();
    }
}

async fn objects(channel: &Channel) -> Vec<v1::GraspObject> {
    let request = v1::ListObjectsRequest::default();
    let page = ObjectServiceClient::new(channel.clone())
        .list_objects(request)
        .await;
    let mut objects = page.unwrap().into_inner().objects;
    objects.retain(|object| !object.built_in);
    objects
}

async fn rigs(channel: &Channel) -> Vec<v1::HandRig> {
    let request = v1::ListRigsRequest::default();
    let page = HandRigServiceClient::new(channel.clone())
        .list_rigs(request)
        .await;
    let mut rigs = page.unwrap().into_inner().rigs;
    rigs.retain(|rig| !rig.built_in);
    rigs
}

/// A rig of the shape that a built-in one describes.
async fn create_rig(channel: &Channel) {
    let mut client = HandRigServiceClient::new(channel.clone());
    let name = "rigs/adult".to_owned();
    let adult = client
        .get_rig(v1::GetRigRequest { name })
        .await
        .unwrap()
        .into_inner();
    let hands = adult.hands.into_iter().map(|hand| v1::HandJoints {
        handedness: hand.handedness,
        joints: hand.stretched_joints,
    });
    let request = v1::CreateRigRequest {
        rig_id: "mine".to_owned(),
        joints: hands.collect(),
        ..Default::default()
    };
    client.create_rig(request).await.unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn objects_and_rigs_in_a_bucket_outlast_the_server() {
    let server = Running::start().await;
    let channel = server.channel().await;
    let mut client = ObjectServiceClient::new(channel.clone());
    for id in ["crate", "gone"] {
        let mut request = v1::CreateObjectRequest::new(id, BOX_OBJ, 0.2);
        request.object_mut().labels = [("level".to_owned(), "hall".to_owned())].into();
        client.create_object(request).await.unwrap();
    }
    let heavier = v1::GraspObject {
        name: "objects/crate".to_owned(),
        mass_kg: 0.3,
        ..Default::default()
    };
    let update = v1::UpdateObjectRequest::new(heavier, []);
    client.update_object(update).await.unwrap();
    let delete = v1::DeleteObjectRequest {
        name: "objects/gone".to_owned(),
        ..Default::default()
    };
    client.delete_object(delete).await.unwrap();
    create_rig(&channel).await;
    // Another server is kept away.
    let listener = TcpListener::bind((Ipv6Addr::LOCALHOST, 0)).await.unwrap();
    let second = Server::new(config())
        .unwrap()
        .serve([listener.into()], std::future::pending());
    let Err(ServeError::Store(error)) = second.await else {
        panic!("two servers would overwrite each other's objects");
    };
    let owner = format!("another server uses it (process {} on host ", std::process::id());
    assert!(error.to_string().contains(&owner), "{error}");
    let before = (objects(&channel).await, rigs(&channel).await);
    assert_eq!((before.0.len(), before.1.len()), (1, 1));
    server.stop().await;

    // It gave the bucket back. The next one is killed, and keeps it for its term.
    let begun = Instant::now();
    let server = Running::start().await;
    let channel = server.channel().await;
    assert_eq!((objects(&channel).await, rigs(&channel).await), before);
    let after_an_end = begun.elapsed();
    server.serving.abort();
    let begun = Instant::now();
    let server = Running::start().await;
    let channel = server.channel().await;
    assert_eq!((objects(&channel).await, rigs(&channel).await), before);
    let after_a_kill = begun.elapsed();
    println!("ready {after_an_end:?} after an end, {after_a_kill:?} after a kill");
    assert!(after_an_end < TERM && after_a_kill >= TERM);
    // The mesh, which two objects shared, is still there.
    let request = v1::FindGraspRequest::new("objects/crate");
    let answer = GraspServiceClient::new(channel.clone()).find_grasp(request).await;
    assert!(answer.unwrap().into_inner().grasp().is_some());
    let again = v1::CreateObjectRequest::new("crate", BOX_OBJ, 0.2);
    let mut client = ObjectServiceClient::new(channel.clone());
    let status = client.create_object(again).await.unwrap_err();
    assert_eq!(status.code(), Code::AlreadyExists);
    server.stop().await;
}
