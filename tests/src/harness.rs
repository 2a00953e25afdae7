//! A server inside the test, on its own port, and values of the core as its messages.

use std::net::{IpAddr, Ipv6Addr, SocketAddr};

use grasp_client::GraspClient;
use grasp_proto::v1::{
    self, grasp_service_client::GraspServiceClient, hand_rig_service_client::HandRigServiceClient,
    object_service_client::ObjectServiceClient,
};
use grasp_server::{Config, FaultPoint, Gauges, Reloader, ServeError, Server, config::StorePlace};
use grasp_synthesis::base::pose::Pose;
use tokio::{
    io::{AsyncReadExt as _, AsyncWriteExt as _},
    net::{TcpListener, TcpStream},
    task::JoinHandle,
};
use tokio_util::sync::{CancellationToken, DropGuard};
use tonic::transport::{Channel, Endpoint};

/// Workers of a test's server: enough to race, few enough for tests that run in parallel.
const WORKERS: usize = 2;

/// A running server. Dropping it begins the shutdown; [`TestServer::stop`] waits for its end.
#[derive(Debug)]
pub struct TestServer {
    address: SocketAddr,
    scheme: &'static str,
    monitor: SocketAddr,
    gauges: Gauges,
    reloader: Reloader,
    stop: DropGuard,
    serving: JoinHandle<Result<(), ServeError>>,
}

impl TestServer {
    /// Starts a server with the default configuration, but two workers, no atlases, and objects in memory only.
    pub async fn start() -> Self {
        Self::start_with(|_| {}).await
    }

    /// Starts a server whose configuration `adapt` changes.
    pub async fn start_with(adapt: impl FnOnce(&mut Config)) -> Self {
        Self::start_on(Ipv6Addr::LOCALHOST.into(), adapt).await
    }

    /// Starts a server on another address of this machine.
    pub async fn start_on(address: IpAddr, adapt: impl FnOnce(&mut Config)) -> Self {
        Self::start_faulty_on(address, adapt, |_| {}).await
    }

    /// The same as [`Self::start_with`], with a hook that injects faults.
    pub async fn start_faulty(
        adapt: impl FnOnce(&mut Config),
        hook: impl Fn(FaultPoint) + Send + Sync + 'static,
    ) -> Self {
        Self::start_faulty_on(Ipv6Addr::LOCALHOST.into(), adapt, hook).await
    }

    async fn start_faulty_on(
        address: IpAddr,
        adapt: impl FnOnce(&mut Config),
        hook: impl Fn(FaultPoint) + Send + Sync + 'static,
    ) -> Self {
        let mut config = Config {
            workers: WORKERS.try_into().expect("there are workers"),
            builder_threads: 0,
            place: StorePlace::Memory,
            ..Config::default()
        };
        adapt(&mut config);
        let scheme = if config.tls.is_some() { "https" } else { "http" };
        let (listener, address) = listen(address).await;
        let (monitor_listener, monitor) = listen(Ipv6Addr::LOCALHOST.into()).await;
        let server = Server::new(config).expect("the server starts");
        server.inject_faults(hook);
        let server = server.monitored_on(monitor_listener.into());
        let (gauges, reloader) = (server.gauges(), server.reloader());
        let stop = CancellationToken::new();
        let serving = tokio::spawn(server.serve([listener.into()], stop.clone().cancelled_owned()));
        Self {
            address,
            scheme,
            monitor,
            gauges,
            reloader,
            stop: stop.drop_guard(),
            serving,
        }
    }

    /// The address it listens on.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// The status and the text with which the port for operators answers to a path.
    pub async fn monitor(&self, path: &str) -> (u16, String) {
        monitor(self.monitor, path)
            .await
            .expect("the port for operators answers")
    }

    /// The address as a client's endpoint.
    pub fn endpoint(&self) -> String {
        format!("{}://{}", self.scheme, self.address)
    }

    /// Its gauges.
    pub fn gauges(&self) -> &Gauges {
        &self.gauges
    }

    /// What makes it read its certificates again.
    pub fn reloader(&self) -> &Reloader {
        &self.reloader
    }

    /// A new connection.
    pub async fn channel(&self) -> Channel {
        Endpoint::from_shared(self.endpoint())
            .expect("an address makes an endpoint")
            .connect()
            .await
            .expect("the server accepts connections")
    }

    /// A connection from another address of this machine, which counts for another client.
    pub async fn channel_from(&self, address: IpAddr) -> Channel {
        let endpoint = Endpoint::from_shared(self.endpoint());
        let endpoint = endpoint.expect("an address is a valid endpoint");
        let endpoint = endpoint.local_address(Some(address));
        endpoint.connect().await.expect("the server accepts connections")
    }

    /// The project's own client, on a new connection.
    pub async fn client(&self) -> GraspClient {
        GraspClient::connect(&self.endpoint())
            .await
            .expect("the server accepts connections")
    }

    /// The generated client of `GraspService`, on a new connection.
    pub async fn grasps(&self) -> GraspServiceClient<Channel> {
        GraspServiceClient::new(self.channel().await)
    }

    /// The generated client of `ObjectService`, on a new connection.
    pub async fn objects(&self) -> ObjectServiceClient<Channel> {
        ObjectServiceClient::new(self.channel().await)
    }

    /// The generated client of `HandRigService`, on a new connection.
    pub async fn rigs(&self) -> HandRigServiceClient<Channel> {
        HandRigServiceClient::new(self.channel().await)
    }

    /// The generated client of `ObjectService`, which connects on its first call.
    pub fn objects_lazily(&self) -> ObjectServiceClient<Channel> {
        let endpoint = Endpoint::from_shared(self.endpoint()).expect("an address makes an endpoint");
        ObjectServiceClient::new(endpoint.connect_lazy())
    }

    /// Begins the shutdown without waiting for it.
    pub fn begin_stop(self) -> StoppingServer {
        drop(self.stop);
        StoppingServer {
            monitor: self.monitor,
            gauges: self.gauges,
            serving: self.serving,
        }
    }

    /// Shuts the server down and waits for its end.
    pub async fn stop(self) {
        self.begin_stop().stopped().await;
    }
}

/// A server that is shutting down.
#[derive(Debug)]
pub struct StoppingServer {
    monitor: SocketAddr,
    gauges: Gauges,
    serving: JoinHandle<Result<(), ServeError>>,
}

impl StoppingServer {
    /// Its gauges.
    pub fn gauges(&self) -> &Gauges {
        &self.gauges
    }

    /// As [`TestServer::monitor`]; `None` once the server has ended.
    pub async fn monitor(&self, path: &str) -> Option<(u16, String)> {
        monitor(self.monitor, path).await
    }

    /// Waits for the end of the shutdown.
    pub async fn stopped(self) {
        self.serving
            .await
            .expect("the server does not panic")
            .expect("the server stops without an error");
    }
}

async fn listen(interface: IpAddr) -> (TcpListener, SocketAddr) {
    let listener = TcpListener::bind((interface, 0)).await;
    let listener = listener.expect("a free port of this machine");
    let address = listener.local_addr().expect("a bound socket has an address");
    (listener, address)
}

/// Gets a path over HTTP/1.1: the status and the text of the answer.
async fn monitor(address: SocketAddr, path: &str) -> Option<(u16, String)> {
    let mut stream = TcpStream::connect(address).await.ok()?;
    let request = format!("GET {path} HTTP/1.1\r\nhost: test\r\n\r\n");
    stream.write_all(request.as_bytes()).await.ok()?;
    let mut answer = String::new();
    stream.read_to_string(&mut answer).await.ok()?;
    let (head, text) = answer.split_once("\r\n\r\n")?;
    let status = head.split(' ').nth(1)?.parse().ok()?;
    Some((status, text.to_owned()))
}

/// A pose of the core as a message.
pub fn wire_pose(pose: Pose) -> v1::Pose {
    v1::Pose::new(pose.position, pose.orientation)
}
