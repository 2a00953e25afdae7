//! A server that is killed while it saves objects.

use std::{fs, path::PathBuf, time::Duration};

use grasp_proto::v1::{self, object_service_client::ObjectServiceClient};
use sha2::{Digest as _, Sha256};
use tonic::{Status, transport::Channel};

use crate::process::Running;

const BOX: &str = "\
v -0.02 -0.015 -0.01
v 0.02 -0.015 -0.01
v 0.02 0.015 -0.01
v -0.02 0.015 -0.01
v -0.02 -0.015 0.01
v 0.02 -0.015 0.01
v 0.02 0.015 0.01
v -0.02 0.015 0.01
f 1 4 3 2
f 5 6 7 8
f 1 2 6 5
f 2 3 7 6
f 3 4 8 7
f 4 1 5 8
";

/// Of the box.
const VERTICES: usize = 8;
const TRIANGLES: usize = 12;

/// How long a client may take to notice that its server is gone.
const HANGS_AFTER: Duration = Duration::from_secs(30);

/// A folder that is removed at the end.
struct Folder(PathBuf);

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

fn start(folder: &Folder) -> Running {
    let folder = folder.0.to_str().expect("the path is text");
    Running::start(&[
        ("GRASP_LISTEN", "127.0.0.1:0"),
        ("GRASP_STORE", folder),
        ("GRASP_BUILDER_THREADS", "0"),
    ])
}

async fn client(server: &Running) -> ObjectServiceClient<Channel> {
    ObjectServiceClient::connect(format!("http://{}", server.address()))
        .await
        .expect("the server accepts connections")
}

/// A box with a mesh of its own.
fn numbered(round: u64, task: usize, number: usize) -> v1::CreateObjectRequest {
    let id = format!("r{round}-{task}-{number}");
    v1::CreateObjectRequest::new(&id, format!("{BOX}# {id}\n"), 0.1)
}

/// Creates objects one after the other until the server is gone; returns those that it confirmed.
async fn create_until_gone(
    mut client: ObjectServiceClient<Channel>,
    round: u64,
    task: usize,
) -> Vec<v1::GraspObject> {
    let mut confirmed = Vec::new();
    while let Ok(answer) = client.create_object(numbered(round, task, confirmed.len())).await {
        confirmed.push(answer.into_inner());
    }
    confirmed
}

/// The mesh of an object, a GLB.
async fn mesh(client: &mut ObjectServiceClient<Channel>, name: String) -> Result<Vec<u8>, Status> {
    let mut parts = client.get_mesh(v1::GetMeshRequest { name }).await?.into_inner();
    let mut bytes = Vec::new();
    while let Some(answer) = parts.message().await? {
        bytes.extend(answer.piece);
    }
    Ok(bytes)
}

/// The hash of the content of a box whose mesh is this GLB.
fn content_hash(glb: &[u8]) -> String {
    let number = |at: usize| u32::from_le_bytes(glb[at..at + 4].try_into().expect("they are four bytes"));
    assert_eq!(glb.len(), number(8) as usize);
    let binary = &glb[20 + number(12) as usize + 8..];
    let mut hash = Sha256::new();
    for count in [VERTICES, TRIANGLES] {
        hash.update((count as u64).to_le_bytes());
    }
    hash.update(binary);
    // None of the triangles is forbidden.
    hash.update([0; TRIANGLES]);
    let digits = hash.finalize().into_iter().map(|byte| format!("{byte:02x}"));
    digits.collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn killing_the_server_leaves_every_object_whole_or_absent() {
    let folder = Folder(std::env::temp_dir().join(format!("grasp-killed-{}", std::process::id())));
    let mut confirmed: Vec<v1::GraspObject> = Vec::new();
    for round in 0..3 {
        let server = start(&folder);
        let mut tasks = Vec::new();
        for task in 0..3 {
            tasks.push(tokio::spawn(create_until_gone(
                client(&server).await,
                round,
                task,
            )));
        }
        let folder = folder.0.join("objects");
        let prefix = format!("r{round}-");
        let begun = || {
            let files = fs::read_dir(&folder).expect("it is there");
            let names = files.filter_map(|file| file.ok()?.file_name().into_string().ok());
            names.filter(|name| name.starts_with(&prefix)).count()
        };
        let start = std::time::Instant::now();
        while begun() < 3 && start.elapsed() < HANGS_AFTER {
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
        tokio::time::sleep(Duration::from_millis(137 * round)).await;
        // SIGKILL: the process has no time for anything.
        drop(server);
        for task in tasks {
            let ended = tokio::time::timeout(HANGS_AFTER, task).await;
            confirmed.extend(ended.expect("the client noticed").expect("it did not panic"));
        }
    }
    assert!(
        confirmed.len() > 3,
        "the server was killed before it did anything"
    );
    let server = start(&folder);
    let mut client = client(&server).await;
    let all = v1::ListObjectsRequest {
        page_size: 1000,
        ..Default::default()
    };
    let listed = client
        .list_objects(all)
        .await
        .expect("it lists them")
        .into_inner();
    let found: Vec<v1::GraspObject> = listed
        .objects
        .into_iter()
        .filter(|object| !object.built_in)
        .collect();
    for object in &confirmed {
        assert!(found.contains(object), "{} is lost or changed", object.name);
    }
    for object in &found {
        let glb = mesh(&mut client, object.name.clone()).await.expect("it is whole");
        assert_eq!(content_hash(&glb), object.content_hash, "{}", object.name);
    }
    server.terminate();
}
