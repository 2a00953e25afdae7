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

use futures_util::future::BoxFuture;
use grasp_client::v1::{self, grasp_service_client::GraspServiceClient};
use rand::{RngExt as _, SeedableRng as _};
use rand_xoshiro::Xoshiro256PlusPlus;
use tokio::{
    net::{TcpSocket, TcpStream},
    runtime::Handle,
    sync::mpsc,
};
use tonic::{
    Code, Request, Status,
    transport::{Channel, Endpoint},
};

use crate::report::quantile;

/// The client that keeps to its share. The server tells clients apart by address.
pub(crate) const LIGHT: IpAddr = IpAddr::V4(Ipv4Addr::LOCALHOST);

/// The client that takes all it can get.
pub(crate) const HEAVY: IpAddr = IpAddr::V4(Ipv4Addr::new(127, 0, 0, 2));

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

    /// The calls of both, as if of one load.
    pub(crate) fn merge(&mut self, other: Self) {
        self.calls.extend(other.calls);
        self.seconds += other.seconds;
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
            text += &format!(
                "; {} failed, the first with {first}",
                self.count(|end| end == End::Failed)
            );
        }
        text
    }
}

/// One call: its number, and the time until its deadline. True if it was served.
pub(crate) type Call = Arc<dyn Fn(usize, Duration) -> BoxFuture<'static, Result<bool, Status>> + Send + Sync>;

/// Calls that are due at random moments.
#[derive(Clone)]
pub(crate) struct OpenLoop {
    /// Mean number per second.
    pub(crate) rate: f64,
    /// For how long calls are due.
    pub(crate) length: Duration,
    /// From when a call is due to its deadline.
    pub(crate) deadline: Duration,
    /// How often a call is sent, as long as it is refused. Later tries have the same deadline and follow at once.
    pub(crate) tries: usize,
    /// The moments follow from it.
    pub(crate) seed: u64,
}

impl OpenLoop {
    /// Makes the calls and waits for the end of the last.
    pub(crate) async fn run(&self, call: Call) -> Tally {
        let (ended, mut calls) = mpsc::unbounded_channel();
        let plan = self.clone();
        let runtime = Handle::current();
        // A thread of its own: the timers of the runtime have a resolution of a millisecond.
        thread::spawn(move || plan.pace(&runtime, &call, &ended));
        let mut tally = Tally {
            calls: Vec::new(),
            seconds: self.length.as_secs_f64(),
        };
        while let Some(call) = calls.recv().await {
            tally.calls.push(call);
        }
        tally
    }

    fn pace(&self, runtime: &Handle, call: &Call, ended: &mpsc::UnboundedSender<Ended>) {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(self.seed);
        let start = Instant::now();
        let mut due = Duration::ZERO;
        for number in 0.. {
            // Gaps of a Poisson process.
            due += Duration::from_secs_f64(-(1.0 - random.random::<f64>()).ln() / self.rate);
            // Without a receiver, nobody waits for the load any more.
            if due > self.length || ended.is_closed() {
                break;
            }
            thread::sleep((start + due).saturating_duration_since(Instant::now()));
            let (call, ended) = (Arc::clone(call), ended.clone());
            let (deadline, tries) = (self.deadline, self.tries);
            runtime.spawn(async move {
                let _ = ended.send(one_call(&call, number, due, start + due, deadline, tries).await);
            });
        }
    }
}

async fn one_call(
    call: &Call,
    number: usize,
    due: Duration,
    due_at: Instant,
    deadline: Duration,
    tries: usize,
) -> Ended {
    let lag_ms = milliseconds(due_at.elapsed());
    let (mut end, mut failure) = (End::Unsent, None);
    for _ in 0..tries {
        let Some(left) = deadline.checked_sub(due_at.elapsed()) else {
            break;
        };
        end = match call(number, left).await {
            _ if due_at.elapsed() > deadline => End::Late,
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
    let latency_ms = milliseconds(due_at.elapsed());
    Ended {
        end,
        due,
        latency_ms,
        lag_ms,
        failure,
    }
}

/// Makes calls for some time, `at_a_time` at any moment, each with this deadline.
pub(crate) async fn closed_loop(call: Call, at_a_time: usize, length: Duration, deadline: Duration) -> Tally {
    let start = Instant::now();
    let next = Arc::new(AtomicUsize::new(0));
    let loops = (0..at_a_time).map(|_| {
        let (call, next) = (Arc::clone(&call), Arc::clone(&next));
        tokio::spawn(async move {
            let mut calls = Vec::new();
            while start.elapsed() < length {
                let number = next.fetch_add(1, Ordering::Relaxed);
                calls.push(one_call(&call, number, start.elapsed(), Instant::now(), deadline, 1).await);
            }
            calls
        })
    });
    let loops: Vec<_> = loops.collect();
    let mut tally = Tally {
        calls: Vec::new(),
        seconds: length.as_secs_f64(),
    };
    for calls in loops {
        tally.calls.extend(calls.await.expect("a client does not panic"));
    }
    tally
}

/// Connections from an address of this machine.
pub(crate) async fn connect(
    server: SocketAddr,
    from: IpAddr,
    count: usize,
) -> Result<Arc<[Channel]>, tonic::transport::Error> {
    let endpoint = Endpoint::from_shared(format!("http://{server}"))?
        .connect_timeout(CONNECTS_WITHIN)
        .local_address(Some(from));
    let mut channels = Vec::new();
    for _ in 0..count {
        channels.push(endpoint.connect().await?);
    }
    Ok(channels.into())
}

/// Opens a socket from an address of this machine.
pub(crate) async fn socket(server: SocketAddr, from: IpAddr) -> io::Result<TcpStream> {
    let socket = TcpSocket::new_v4()?;
    socket.bind(SocketAddr::new(from, 0))?;
    let stream = socket.connect(server).await?;
    stream.set_nodelay(true)?;
    Ok(stream)
}

/// Calls of `FindGrasp` with these requests in turn, over these connections in turn. Served means found.
pub(crate) fn find_grasp(channels: &Arc<[Channel]>, requests: &Arc<[v1::FindGraspRequest]>) -> Call {
    let (channels, requests) = (Arc::clone(channels), Arc::clone(requests));
    Arc::new(move |number, left| {
        let mut client = GraspServiceClient::new(channels[number % channels.len()].clone());
        let request = requests[number % requests.len()].clone();
        Box::pin(async move {
            let answer = client.find_grasp(within(left, request)).await?;
            Ok(answer.get_ref().outcome() == v1::Outcome::Found)
        })
    })
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
