//! Meshes that clients ask for and do not read.

use std::{
    fs,
    time::{Duration, Instant},
};

use bytes::Bytes;
use grasp_proto::v1::{self, object_service_client::ObjectServiceClient};
use http::Request;
use prost::Message as _;
use tokio::net::TcpStream;
use tonic::transport::Channel;

use crate::process::Running;

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

fn get_hills() -> v1::GetMeshRequest {
    v1::GetMeshRequest {
        name: "objects/hills".to_owned(),
    }
}

/// A connection with as many calls as it may have, on which the client lets the server send so much of each answer. Without the
/// connection, they end.
async fn ask(address: &str, window: u32) -> impl Sized {
    let stream = TcpStream::connect(address).await.expect("it listens");
    let mut builder = h2::client::Builder::new();
    let connecting = builder.initial_window_size(window).handshake::<_, Bytes>(stream);
    let (mut sender, connection) = connecting.await.expect("it speaks HTTP/2");
    tokio::spawn(connection);
    let message = get_hills().encode_to_vec();
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

async fn client(server: &Running) -> ObjectServiceClient<Channel> {
    let connecting = ObjectServiceClient::connect(format!("http://{}", server.address()));
    connecting.await.expect("it accepts connections")
}

#[tokio::test(flavor = "multi_thread")]
async fn meshes_that_nobody_reads_neither_end_nor_slow_the_server() {
    // Arenas of the allocator reserve memory that they do not use.
    let server = Running::start_command("ulimit -v 409600 && exec grasp-server", &SMALL);
    let address = server.address().to_owned();
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
        let threads = fs::read_dir(format!("/proc/{}/task", server.process())).expect("it runs");
        most_threads = most_threads.max(threads.count());
    }
    waited.sort();
    let [median, slowest] = [waited.len() / 2, waited.len() - 1].map(|place| waited[place]);
    println!("calls of another client: {median:?}, the slowest {slowest:?}; {most_threads} threads");
    assert!(median < Duration::from_millis(500), "{waited:?}");
    assert!(most_threads < 40, "{most_threads}");
    let status = fs::read_to_string(format!("/proc/{}/status", server.process())).expect("it runs");
    let peak = status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:")?.trim().strip_suffix(" kB"));
    let peak: usize = peak.expect("it has a peak").parse().expect("it is a number");
    println!("at most {peak} kB in use");
    assert!(peak < MAX_KILOBYTES, "{peak}");
    let mut parts = bystander
        .get_mesh(get_hills())
        .await
        .expect("it is served")
        .into_inner();
    let mut received = Vec::new();
    while let Some(answer) = parts.message().await.expect("it arrives") {
        received.extend(answer.piece);
    }
    // The header of a GLB has its length.
    let announced = received[8..12].try_into().expect("it has a header");
    assert_eq!(received.len(), u32::from_le_bytes(announced) as usize);
    drop(asking);
    server.terminate();
}
