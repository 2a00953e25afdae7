//! Generators of load. The open loop calls at random moments that do not depend on answers, and counts from when a call was due: a server
//! that stalls delays no call that its clients would have made meanwhile. The closed loop finds how much a server can do.

use std::{
    io,
    net::{IpAddr, Ipv4Addr, SocketAddr},
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    },
    thread,
    time::{Duration, Instant},
};

use futures_util::future::{BoxFuture, try_join_all};
use grasp_client::v1::{self, grasp_service_client::GraspServiceClient};
use rand::{RngExt as _, SeedableRng as _};
use rand_xoshiro::Xoshiro256PlusPlus;
use tokio::{
    net::{TcpSocket, TcpStream},
    runtime::Handle,
    sync::mpsc,
    task::JoinSet,
};
use tonic::{
    Code, Request, Status,
    transport::{self, Channel, Endpoint},
};

use crate::report::quantile;

/// The client that keeps to its share. The server tells clients apart by address.
pub(crate) const LIGHT: IpAddr = IpAddr::V4(Ipv4Addr::LOCALHOST);

/// The client that takes all it can get.
pub(crate) const HEAVY: IpAddr = IpAddr::V4(Ipv4Addr::new(127, 0, 0, 2));

/// From when a call is due to its deadline.
pub(crate) const DEADLINE: Duration = Duration::from_millis(100);

/// Connections of a load. Each may have 64 unanswered calls.
const CONNECTIONS: usize = 32;

/// Pause of a client of the closed loop after a refusal.
const AFTER_REFUSAL: Duration = Duration::from_millis(5);

/// Seed of the moments when calls are due.
const SEED: u64 = 0x4c4f_4144;

/// Longest wait for a connection.
const CONNECTS_WITHIN: Duration = Duration::from_secs(5);

/// How a call ended for its client.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum End {
    /// With a grasp, or with whatever the call is for, in time.
    Served,
    /// With an answer in time, but without a grasp.
    Unfound,
    /// Neither answered nor refused before its deadline.
    Late,
    /// Never sent, because this process came to it only after its deadline.
    Unsent,
    /// Refused because the server is busy.
    Refused,
    /// With another error.
    Failed,
}

/// A call that has ended.
#[derive(Clone, Debug)]
pub(crate) struct Ended {
    /// How.
    pub(crate) end: End,
    /// When it was due, since the start of the load.
    pub(crate) due: Duration,
    /// From when it was due to its end, in milliseconds.
    pub(crate) latency_ms: f64,
    /// From when it was due until it was sent, in milliseconds: the generator's own fault.
    pub(crate) lag_ms: f64,
    /// The error of one that failed.
    failure: Option<Status>,
}

/// Calls of a client under load.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tally {
    /// The calls in the order of their ends.
    pub(crate) calls: Vec<Ended>,
    /// For how long calls were due, in seconds.
    pub(crate) seconds: f64,
}

impl Tally {
    /// How many calls ended like this.
    pub(crate) fn count(&self, is: impl Fn(End) -> bool) -> usize {
        self.calls.iter().filter(|call| is(call.end)).count()
    }

    /// Calls served in time, per second.
    pub(crate) fn goodput(&self) -> f64 {
        self.count(|end| end == End::Served) as f64 / self.seconds
    }

    /// A quantile of the latency of calls that ended like this, in milliseconds.
    pub(crate) fn latency_ms(&self, share: f64, is: impl Fn(End) -> bool) -> f64 {
        let calls = self.calls.iter().filter(|call| is(call.end));
        quantile(&calls.map(|call| call.latency_ms).collect::<Vec<_>>(), share)
    }

    /// How calls ended, in a line.
    pub(crate) fn summary(&self) -> String {
        let per_second = |end: End| self.count(|other| other == end) as f64 / self.seconds;
        let lags: Vec<f64> = self.calls.iter().map(|call| call.lag_ms).collect();
        let mut text = format!(
            "{:.0}/s due: {:.0} found, {:.0} unfound, {:.0} late, {:.0} refused; sent p99 {:.1} ms late",
            self.calls.len() as f64 / self.seconds,
            per_second(End::Served),
            per_second(End::Unfound),
            per_second(End::Late),
            per_second(End::Refused),
            quantile(&lags, 0.99),
        );
        if let Some(first) = self.calls.iter().find_map(|call| call.failure.as_ref()) {
            let failed = self.count(|end| end == End::Failed);
            text = format!("{text}; {failed} failed, the first with {first}");
        }
        text
    }
}

/// One call: its number, and the time until its deadline. True if it was served.
pub(crate) type Call = Arc<dyn Fn(usize, Duration) -> BoxFuture<'static, Result<bool, Status>> + Send + Sync>;

/// Makes calls at random moments, `rate` per second in the mean, for some time, and waits for the end of the last. A refused one is sent
/// again at once, up to `tries` times in all, with the same deadline.
pub(crate) async fn open_loop(call: Call, rate: f64, length: Duration, tries: usize) -> Tally {
    let (ended, mut calls) = mpsc::unbounded_channel();
    let runtime = Handle::current();
    // A thread of its own: the timers of the runtime have a resolution of a millisecond.
    thread::spawn(move || {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(SEED);
        let start = Instant::now();
        let mut due = Duration::ZERO;
        for number in 0.. {
            // Gaps of a Poisson process.
            due += Duration::from_secs_f64(-(1.0 - random.random::<f64>()).ln() / rate);
            // Without a receiver, nobody waits for the load any more.
            if due > length || ended.is_closed() {
                break;
            }
            thread::sleep((start + due).saturating_duration_since(Instant::now()));
            let (call, ended) = (Arc::clone(&call), ended.clone());
            runtime.spawn(async move {
                let _ = ended.send(one_call(&call, number, start, due, tries).await);
            });
        }
    });
    let mut tally = Tally {
        calls: Vec::new(),
        seconds: length.as_secs_f64(),
    };
    while let Some(call) = calls.recv().await {
        tally.calls.push(call);
    }
    tally
}

/// Makes calls for some time, `at_a_time` at any moment.
pub(crate) async fn closed_loop(call: Call, at_a_time: usize, length: Duration) -> Tally {
    let start = Instant::now();
    let next = Arc::new(AtomicUsize::new(0));
    let mut loops = JoinSet::new();
    for _ in 0..at_a_time {
        let (call, next) = (Arc::clone(&call), Arc::clone(&next));
        loops.spawn(async move {
            let mut calls = Vec::new();
            while start.elapsed() < length {
                let number = next.fetch_add(1, Ordering::Relaxed);
                let ended = one_call(&call, number, start, start.elapsed(), 1).await;
                if ended.end == End::Refused {
                    tokio::time::sleep(AFTER_REFUSAL).await;
                }
                calls.push(ended);
            }
            calls
        });
    }
    Tally {
        calls: loops.join_all().await.concat(),
        seconds: length.as_secs_f64(),
    }
}

async fn one_call(call: &Call, number: usize, start: Instant, due: Duration, tries: usize) -> Ended {
    let since_due = || start.elapsed().saturating_sub(due);
    let lag_ms = milliseconds(since_due());
    let (mut end, mut failure) = (End::Unsent, None);
    for _ in 0..tries {
        let Some(left) = DEADLINE.checked_sub(since_due()) else {
            break;
        };
        end = match call(number, left).await {
            _ if since_due() > DEADLINE => End::Late,
            Ok(true) => End::Served,
            Ok(false) => End::Unfound,
            Err(status) => match status.code() {
                Code::ResourceExhausted => End::Refused,
                Code::DeadlineExceeded | Code::Cancelled => End::Late,
                _ => {
                    failure = Some(status);
                    End::Failed
                }
            },
        };
        if end != End::Refused {
            break;
        }
    }
    let latency_ms = milliseconds(since_due());
    Ended {
        end,
        due,
        latency_ms,
        lag_ms,
        failure,
    }
}

/// A connection from an address of this machine.
pub(crate) async fn connect(server: SocketAddr, from: IpAddr) -> Result<Channel, transport::Error> {
    let endpoint = Endpoint::from_shared(format!("http://{server}"))?;
    endpoint
        .connect_timeout(CONNECTS_WITHIN)
        .local_address(Some(from))
        .connect()
        .await
}

/// As many connections as a load needs.
pub(crate) async fn connect_all(
    server: SocketAddr,
    from: IpAddr,
) -> Result<Arc<[Channel]>, transport::Error> {
    try_join_all((0..CONNECTIONS).map(|_| connect(server, from)))
        .await
        .map(Into::into)
}

/// Opens a socket from an address of this machine.
pub(crate) async fn socket(server: SocketAddr, from: IpAddr) -> io::Result<TcpStream> {
    let socket = TcpSocket::new_v4()?;
    socket.bind(SocketAddr::new(from, 0))?;
    let stream = socket.connect(server).await?;
    stream.set_nodelay(true)?;
    Ok(stream)
}

/// Calls of `FindGrasp` with these requests in turn. Served means found.
pub(crate) async fn find_grasp(
    server: SocketAddr,
    from: IpAddr,
    requests: &Arc<[v1::FindGraspRequest]>,
) -> Result<Call, transport::Error> {
    let (channels, requests) = (connect_all(server, from).await?, Arc::clone(requests));
    Ok(Arc::new(move |number, left| {
        let mut client = GraspServiceClient::new(channels[number % channels.len()].clone());
        let request = requests[number % requests.len()].clone();
        Box::pin(async move {
            let answer = client.find_grasp(within(left, request)).await?;
            Ok(answer.get_ref().outcome() == v1::Outcome::Found)
        })
    }))
}

/// A request with a deadline.
pub(crate) fn within<T>(left: Duration, message: T) -> Request<T> {
    let mut request = Request::new(message);
    request.set_timeout(left);
    request
}

/// A duration in milliseconds.
pub(crate) fn milliseconds(duration: Duration) -> f64 {
    1e3 * duration.as_secs_f64()
}
