//! A server that is killed while it saves objects, and one whose clients request meshes that they do not read.

use std::{
    fs,
    path::PathBuf,
    time::{Duration, Instant},
};

use grasp_proto::v1::{self, object_service_client::ObjectServiceClient};
use tokio::task::JoinSet;
use tonic::transport::{Channel, Endpoint};

use crate::Running;

type Client = ObjectServiceClient<Channel>;

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
        let id = format!("r{round}-{task}-{}", confirmed.len());
        match client.create_object(hills(&id, 2)).await {
            Ok(answer) => confirmed.push(answer.into_inner()),
            Err(_) => return confirmed,
        }
    }
}

async fn mesh(client: &mut Client, name: String) -> Vec<u8> {
    let answer = client.get_mesh(v1::GetMeshRequest { name }).await;
    let mut parts = answer.expect("it is served").into_inner();
    let mut bytes = Vec::new();
    while let Some(answer) = parts.message().await.expect("it arrives") {
        bytes.extend(answer.piece);
    }
    bytes
}

/// The vertices and triangles in a whole GLB.
fn content(glb: &[u8]) -> &[u8] {
    let number = |at: usize| u32::from_le_bytes(glb[at..at + 4].try_into().expect("they are four bytes"));
    assert_eq!(glb.len(), number(8) as usize);
    &glb[20 + number(12) as usize..]
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
    // Files that differ by a comment have the same vertices and triangles.
    let expected = mesh(&mut client, confirmed[0].name.clone()).await;
    for object in &found {
        let glb = mesh(&mut client, object.name.clone()).await;
        assert!(
            content(&glb) == content(&expected),
            "{} has another mesh",
            object.name
        );
        assert_eq!(object.content_hash, confirmed[0].content_hash);
    }
    server.terminate();
}

const CONNECTIONS: usize = 20;
const CALLS: usize = 60;

/// Bytes in use at most, in kB, pages of the program included.
const MAX_KILOBYTES: usize = 200 << 10;

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

/// A sheet of hills with so many cells along each side, of two triangles each, in a file of its own.
fn hills(id: &str, cells: usize) -> v1::CreateObjectRequest {
    let mut lines = vec![format!("# {id}")];
    for (row, column) in (0..=cells).flat_map(|row| (0..=cells).map(move |column| (row, column))) {
        let [x, y] = [row, column].map(|place| place as f32 / cells as f32);
        lines.push(format!("v {x} {y} {}", 0.1 * (9.0 * x).sin() * (7.0 * y).cos()));
    }
    for (row, column) in (0..cells).flat_map(|row| (0..cells).map(move |column| (row, column))) {
        let a = row * (cells + 1) + column + 1;
        let (b, c, d) = (a + 1, a + cells + 2, a + cells + 1);
        lines.push(format!("f {a} {b} {c}\nf {a} {c} {d}"));
    }
    let mut request = v1::CreateObjectRequest::new(id, lines.join("\n") + "\n", 0.1);
    request.object_mut().meters_per_unit = Some(0.1);
    request
}

/// Calls on a connection of their own, each answer with a window of `window` bytes. The connection ends with the calls.
async fn ask(address: &str, window: u32) -> JoinSet<()> {
    let endpoint = Endpoint::from_shared(format!("http://{address}")).expect("it is an address");
    let endpoint = endpoint.initial_stream_window_size(window);
    let channel = endpoint.initial_connection_window_size(65_535).connect().await;
    let client = ObjectServiceClient::new(channel.expect("it listens"));
    let mut calls = JoinSet::new();
    for _ in 0..CALLS {
        let mut client = client.clone();
        calls.spawn(async move {
            let name = "objects/hills".to_owned();
            let _unread = client.get_mesh(v1::GetMeshRequest { name }).await;
            std::future::pending::<()>().await;
        });
    }
    calls
}

#[tokio::test(flavor = "multi_thread")]
async fn meshes_that_nobody_reads_neither_end_nor_slow_the_server() {
    // Arenas of the allocator reserve memory that they do not use.
    let server = Running::start_command("ulimit -v 409600 && exec grasp-server", &SMALL);
    let address = server.address.clone();
    let mut bystander = client(&server).await;
    bystander
        .create_object(hills("hills", 100))
        .await
        .expect("it is a mesh");
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
    content(&mesh(&mut bystander, "objects/hills".to_owned()).await);
    drop(asking);
    server.terminate();
}
