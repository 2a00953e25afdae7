//! The client on a bad network: connections that are slow, or cut at any byte of a request or an answer. It recovers by itself, and
//! nothing is done twice.

use std::{
    net::SocketAddr,
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    },
    time::{Duration, Instant},
};

use grasp_client::GraspClient;
use grasp_proto::v1;
use grasp_tests::TestServer;
use tokio::{
    io::{AsyncReadExt as _, AsyncWriteExt as _},
    net::{
        TcpListener, TcpStream,
        tcp::{OwnedReadHalf, OwnedWriteHalf},
    },
    task::JoinSet,
};
use tonic::Code;

use crate::fixtures::{bounded, box_request, floating_remote};

/// What a proxy does to the bytes of one direction.
#[derive(Clone, Copy, Debug)]
enum Fault {
    None,
    /// Passes each piece on later.
    Delay(Duration),
    /// Passes on so many bytes, then closes the connection.
    CutAfter(usize),
    /// Passes one byte on at a time.
    Trickle(Duration),
}

/// The faults of a connection's two directions.
#[derive(Clone, Copy, Debug)]
struct Faults {
    requests: Fault,
    answers: Fault,
}

/// A proxy in front of a server. Its first connection has the faults, later ones have none unless `always`.
struct Proxy {
    address: SocketAddr,
    connections: Arc<AtomicUsize>,
    /// Ends it when dropped.
    _tasks: JoinSet<()>,
}

impl Proxy {
    async fn start(server: SocketAddr, faults: Faults, always: bool) -> Self {
        let listener = TcpListener::bind("[::1]:0").await.unwrap();
        let address = listener.local_addr().unwrap();
        let connections = Arc::new(AtomicUsize::new(0));
        let count = Arc::clone(&connections);
        let mut tasks = JoinSet::new();
        tasks.spawn(async move {
            let mut open = JoinSet::new();
            while let Ok((client, _)) = listener.accept().await {
                let number = count.fetch_add(1, Ordering::Relaxed);
                let faults = if number == 0 || always {
                    faults
                } else {
                    Faults {
                        requests: Fault::None,
                        answers: Fault::None,
                    }
                };
                open.spawn(pass(client, server, faults));
            }
        });
        Self {
            address,
            connections,
            _tasks: tasks,
        }
    }

    fn client(&self) -> GraspClient {
        let endpoint = format!("http://{}", self.address);
        GraspClient::builder(endpoint).connect_lazy().unwrap()
    }
}

/// Passes bytes in both directions until either one ends.
async fn pass(client: TcpStream, server: SocketAddr, faults: Faults) {
    let server = TcpStream::connect(server).await.unwrap();
    for stream in [&client, &server] {
        stream.set_nodelay(true).unwrap();
    }
    let ((from_client, to_client), (from_server, to_server)) = (client.into_split(), server.into_split());
    tokio::select! {
        () = copy(from_client, to_server, faults.requests) => {}
        () = copy(from_server, to_client, faults.answers) => {}
    }
}

async fn copy(mut from: OwnedReadHalf, mut to: OwnedWriteHalf, fault: Fault) {
    let mut piece = vec![0; 16 << 10];
    let mut passed = 0;
    while let Ok(read @ 1..) = from.read(&mut piece).await {
        let mut bytes = &piece[..read];
        match fault {
            Fault::None => {}
            Fault::Delay(time) => tokio::time::sleep(time).await,
            Fault::CutAfter(most) => bytes = &bytes[..read.min(most - passed)],
            Fault::Trickle(pause) => {
                for byte in bytes {
                    tokio::time::sleep(pause).await;
                    if to.write_all(&[*byte]).await.is_err() {
                        return;
                    }
                }
                continue;
            }
        }
        passed += bytes.len();
        if to.write_all(bytes).await.is_err() || bytes.len() < read {
            return;
        }
        if matches!(fault, Fault::CutAfter(most) if most == passed) {
            return;
        }
    }
}

/// Creates an object over a connection that is cut; true if it was. Created twice, it would exist the second time.
async fn create_through(server: SocketAddr, id: String, faults: Faults) -> bool {
    let proxy = Proxy::start(server, faults, false).await;
    let client = proxy.client();
    let created = bounded("an object", client.create_object(&box_request(&id))).await;
    created.unwrap_or_else(|error| panic!("{faults:?}: {error}"));
    let found = bounded("a grasp", client.find_grasp(&floating_remote())).await;
    found.unwrap_or_else(|error| panic!("{faults:?}: {error}"));
    let mesh = bounded("a mesh", client.get_mesh("objects/remote")).await;
    mesh.unwrap_or_else(|error| panic!("{faults:?}: {error}"));
    proxy.connections.load(Ordering::Relaxed) > 1
}

#[tokio::test(flavor = "multi_thread")]
async fn connections_that_are_cut_anywhere_fail_no_call_and_repeat_none() {
    let server = TestServer::start().await;
    let before = server
        .client()
        .await
        .list_objects(&v1::ListObjectsRequest::default())
        .await;
    let before = before.unwrap().len();
    let mut running = JoinSet::new();
    let (mut creations, mut cuts) = (0, 0);
    let requests = (0..1400).step_by(23).map(|bytes| Faults {
        requests: Fault::CutAfter(bytes),
        answers: Fault::None,
    });
    // The last ones are of the mesh.
    let answers = (0..1400)
        .step_by(23)
        .chain((2000..20_000).step_by(3000))
        .map(|bytes| Faults {
            requests: Fault::None,
            answers: Fault::CutAfter(bytes),
        });
    for faults in requests.chain(answers) {
        running.spawn(create_through(
            server.address(),
            format!("box-{creations}"),
            faults,
        ));
        creations += 1;
        // As many at a time as the server takes uploads.
        if running.len() >= 3 {
            cuts += usize::from(running.join_next().await.unwrap().unwrap());
        }
    }
    while let Some(cut) = running.join_next().await {
        cuts += usize::from(cut.unwrap());
    }
    let after = server
        .client()
        .await
        .list_objects(&v1::ListObjectsRequest::default())
        .await;
    println!("{cuts} of {creations} connections were cut; no call failed");
    assert!(cuts > creations / 2, "{cuts} of {creations}");
    assert_eq!(after.unwrap().len() - before, creations);
}

#[tokio::test(flavor = "multi_thread")]
async fn calls_on_a_slow_network_are_answered_or_end_at_their_deadline() {
    let server = TestServer::start().await;
    let both = |fault| Faults {
        requests: fault,
        answers: fault,
    };
    let far = Proxy::start(
        server.address(),
        both(Fault::Delay(Duration::from_millis(40))),
        true,
    )
    .await;
    let start = Instant::now();
    let found = bounded("a grasp", far.client().find_grasp(&floating_remote())).await;
    println!(
        "a grasp over a network of 80 ms both ways took {:?}",
        start.elapsed()
    );
    assert!(found.unwrap().grasp().is_some());
    let slow = Proxy::start(
        server.address(),
        both(Fault::Trickle(Duration::from_millis(50))),
        true,
    )
    .await;
    let limit = Duration::from_millis(1500);
    let client = GraspClient::builder(format!("http://{}", slow.address)).call_timeout(limit);
    let client = client.connect_lazy().unwrap();
    let start = Instant::now();
    let error = bounded("an error", client.get_object("objects/remote"))
        .await
        .unwrap_err();
    println!(
        "a call over a network of 20 bytes a second ended after {:?}",
        start.elapsed()
    );
    assert_eq!(error.code(), Some(Code::DeadlineExceeded), "{error}");
    assert!(start.elapsed() >= limit);
}
