//! A server that is killed while it saves objects, and one whose clients request meshes that they do not read.

use std::{
    fs,
    path::PathBuf,
    time::{Duration, Instant},
};

use bytes::Bytes;
use grasp_proto::v1::{self, object_service_client::ObjectServiceClient};
use http::Request;
use prost::Message as _;
use sha2::{Digest as _, Sha256};
use tokio::net::TcpStream;
use tonic::transport::Channel;

use crate::Running;

type Client = ObjectServiceClient<Channel>;

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

async fn client(server: &Running) -> Client {
    let connecting = ObjectServiceClient::connect(format!("http://{}", server.address));
    connecting.await.expect("it accepts connections")
}

/// Creates objects one after the other until the server is gone; returns those that it confirmed.
async fn create_until_gone(mut client: Client, round: u64, task: usize) -> Vec<v1::GraspObject> {
    let mut confirmed = Vec::new();
    loop {
        // A box with a mesh of its own.
        let id = format!("r{round}-{task}-{}", confirmed.len());
        let request = v1::CreateObjectRequest::new(&id, format!("{BOX}# {id}\n"), 0.1);
        match client.create_object(request).await {
            Ok(answer) => confirmed.push(answer.into_inner()),
            Err(_) => return confirmed,
        }
    }
}

/// The mesh of an object, a GLB.
async fn mesh(client: &mut Client, name: String) -> Vec<u8> {
    let answer = client.get_mesh(v1::GetMeshRequest { name }).await;
    let mut parts = answer.expect("it is served").into_inner();
    let mut bytes = Vec::new();
    while let Some(answer) = parts.message().await.expect("it arrives") {
        bytes.extend(answer.piece);
    }
    bytes
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
            let creating = create_until_gone(client(&server).await, round, task);
            tasks.push(tokio::spawn(creating));
        }
        let folder = folder.0.join("objects");
        let prefix = format!("r{round}-");
        let begun = || {
            let files = fs::read_dir(&folder).expect("it is there");
            let names = files.filter_map(|file| file.ok()?.file_name().into_string().ok());
            names.filter(|name| name.starts_with(&prefix)).count()
        };
        let start = Instant::now();
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
    assert!(confirmed.len() > 3, "it was killed before it did anything");
    let server = start(&folder);
    let mut client = client(&server).await;
    let all = v1::ListObjectsRequest {
        page_size: 1000,
        ..Default::default()
    };
    let listed = client.list_objects(all).await.expect("it lists them");
    let objects = listed.into_inner().objects.into_iter();
    let found: Vec<_> = objects.filter(|object| !object.built_in).collect();
    for object in &confirmed {
        assert!(found.contains(object), "{} is lost or changed", object.name);
    }
    for object in &found {
        let glb = mesh(&mut client, object.name.clone()).await;
        assert_eq!(content_hash(&glb), object.content_hash, "{}", object.name);
    }
    server.terminate();
}

const CONNECTIONS: usize = 20;
const CALLS: usize = 60;

/// Bytes in use at most, in kB, pages of the program included.
const MAX_KILOBYTES: usize = 200 << 10;

/// Cells along each side of the object that is requested; two triangles each.
const CELLS: usize = 100;

/// A small configuration.
const SMALL: [(&str, &str); 10] = [
    ("GRASP_LISTEN", "127.0.0.1:0"),
    // Nobody reads the log meanwhile.
    ("GRASP_LOG", "info,grasp_server::call=off"),
    ("GRASP_CACHE_BYTES", "67108864"),
    ("GRASP_MAXIMUM_UPLOADS", "1"),
    ("GRASP_MAXIMUM_UPLOAD_BYTES", "8388608"),
    ("GRASP_MAXIMUM_UNREAD_BYTES", "4194304"),
    ("GRASP_MAXIMUM_TRACKS", "4"),
    ("GRASP_MAXIMUM_SEARCHES", "4"),
    ("GRASP_WORKERS", "2"),
    ("GRASP_IO_THREADS", "2"),
];

/// A sheet of hills.
fn hills() -> v1::CreateObjectRequest {
    let vertices = (0..=CELLS).flat_map(|row| {
        (0..=CELLS).map(move |column| {
            let [x, y] = [row, column].map(|place| place as f32 / CELLS as f32);
            format!("v {x} {y} {}\n", 0.1 * (9.0 * x).sin() * (7.0 * y).cos())
        })
    });
    let faces = (0..CELLS).flat_map(|row| {
        (0..CELLS).map(move |column| {
            let corner = |row, column| row * (CELLS + 1) + column + 1;
            let [a, b, c, d] = [(0, 0), (0, 1), (1, 1), (1, 0)].map(|(r, k)| corner(row + r, column + k));
            format!("f {a} {b} {c}\nf {a} {c} {d}\n")
        })
    });
    let mesh = vertices.chain(faces).collect::<String>();
    let mut request = v1::CreateObjectRequest::new("hills", mesh, 0.1);
    request.object_mut().meters_per_unit = Some(0.1);
    request
}

/// A connection with as many calls as it may have, on which the client lets the server send so much of each answer. Without the
/// connection, they end.
async fn ask(address: &str, window: u32) -> impl Sized {
    let stream = TcpStream::connect(address).await.expect("it listens");
    let mut builder = h2::client::Builder::new();
    let connecting = builder.initial_window_size(window).handshake::<_, Bytes>(stream);
    let (mut sender, connection) = connecting.await.expect("it speaks HTTP/2");
    tokio::spawn(connection);
    let name = "objects/hills".to_owned();
    let message = v1::GetMeshRequest { name }.encode_to_vec();
    let length = u32::try_from(message.len()).expect("it is short").to_be_bytes();
    let frame = Bytes::from([&[0], &length[..], &message].concat());
    let mut calls = Vec::new();
    for _ in 0..CALLS {
        let Ok(ready) = sender.clone().ready().await else {
            break;
        };
        sender = ready;
        let request = Request::post(format!("http://{address}/grasp.v1.ObjectService/GetMesh"))
            .header("content-type", "application/grpc")
            .header("te", "trailers");
        let request = request.body(()).expect("it is a request");
        let Ok((answer, mut body)) = sender.send_request(request, false) else {
            break;
        };
        let _ = body.send_data(frame.clone(), true);
        calls.push(answer);
    }
    (calls, sender)
}

#[tokio::test(flavor = "multi_thread")]
async fn meshes_that_nobody_reads_neither_end_nor_slow_the_server() {
    // Arenas of the allocator reserve memory that they do not use.
    let server = Running::start_command("ulimit -v 409600 && exec grasp-server", &SMALL);
    let address = server.address.clone();
    let mut bystander = client(&server).await;
    bystander.create_object(hills()).await.expect("it is a mesh");
    let mut asking = Vec::new();
    let (mut waited, mut most_threads) = (Vec::new(), 0);
    for number in 0..CONNECTIONS {
        // Some take nothing, others a part.
        asking.push(ask(&address, [0, 20_000][number % 2]).await);
        let start = Instant::now();
        let listed = bystander.list_objects(v1::ListObjectsRequest::default()).await;
        if let Err(status) = listed {
            panic!("others are not served: {status}; {:?}", server.terminate());
        }
        waited.push(start.elapsed());
        let threads = fs::read_dir(format!("/proc/{}/task", server.child.id())).expect("it runs");
        most_threads = most_threads.max(threads.count());
    }
    waited.sort();
    let [median, slowest] = [waited.len() / 2, waited.len() - 1].map(|place| waited[place]);
    println!("calls of another client: {median:?}, the slowest {slowest:?}; {most_threads} threads");
    assert!(median < Duration::from_millis(500), "{waited:?}");
    assert!(most_threads < 40, "{most_threads}");
    let status = fs::read_to_string(format!("/proc/{}/status", server.child.id())).expect("it runs");
    let peak = status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:")?.trim().strip_suffix(" kB"));
    let peak: usize = peak.expect("it has a peak").parse().expect("it is a number");
    println!("at most {peak} kB in use");
    assert!(peak < MAX_KILOBYTES, "{peak}");
    let received = mesh(&mut bystander, "objects/hills".to_owned()).await;
    // The header of a GLB has its length.
    let announced = received[8..12].try_into().expect("it has a header");
    assert_eq!(received.len(), u32::from_le_bytes(announced) as usize);
    drop(asking);
    server.terminate();
}
