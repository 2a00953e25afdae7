//! A server whose clients request meshes that they do not read.

use std::{
    fs,
    time::{Duration, Instant},
};

use grasp_proto::v1::{self, object_service_client::ObjectServiceClient};
use tokio::task::JoinSet;
use tonic::transport::{Channel, Endpoint};

use crate::Running;

pub(crate) type Client = ObjectServiceClient<Channel>;

pub(crate) async fn client(server: &Running) -> Client {
    let connecting = ObjectServiceClient::connect(format!("http://{}", server.address));
    connecting.await.expect("it accepts connections")
}

pub(crate) async fn mesh(client: &mut Client, name: String) -> Vec<u8> {
    let answer = client.get_mesh(v1::GetMeshRequest { name }).await;
    let mut parts = answer.expect("it is served").into_inner();
    let mut bytes = Vec::new();
    while let Some(answer) = parts.message().await.expect("it arrives") {
        bytes.extend(answer.piece);
    }
    bytes
}

/// The vertices and triangles in a whole GLB.
pub(crate) fn content(glb: &[u8]) -> &[u8] {
    let number = |at: usize| u32::from_le_bytes(glb[at..at + 4].try_into().expect("they are four bytes"));
    assert_eq!(glb.len(), number(8) as usize);
    &glb[20 + number(12) as usize..]
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
pub(crate) fn hills(id: &str, cells: usize) -> v1::CreateObjectRequest {
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
