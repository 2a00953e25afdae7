//! The calls: ordinary ones that find a grasp, and hard ones that exhaust their budget.

use std::{
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    },
    time::{Duration, Instant},
};

use grasp_assets::holdouts::holdouts;
use grasp_client::{ClientError, Digit, GraspClient, Outcome, RetryPolicy, built_in::request_for, v1};
use tokio::{
    runtime::{Builder, Runtime},
    task::JoinSet,
};

/// A tetrahedron with edges of 5 cm, all of whose surface is forbidden.
const UNTOUCHABLE: &str = "\
g all
v 0 0 0
v 0.05 0 0
v 0 0.05 0
v 0 0 0.05
f 1 3 2
f 1 2 4
f 1 4 3
f 2 3 4
";

const ALL_DIGITS: [Digit; 5] = [
    Digit::Thumb,
    Digit::Index,
    Digit::Middle,
    Digit::Ring,
    Digit::Little,
];

/// Calls of one cell.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Load {
    /// The deadline of each; no budget is named.
    pub(crate) deadline: Duration,
    /// How many are in flight: each answer is followed by the next call.
    pub(crate) in_flight: usize,
    /// Their number.
    pub(crate) calls: usize,
}

/// How a call ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum End {
    /// With a grasp.
    Found,
    /// Without a grasp, in time.
    Exhausted,
    /// `DEADLINE_EXCEEDED`.
    Late,
}

/// A call that has ended.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Call {
    /// Whether no grasp exists.
    pub(crate) is_hard: bool,
    /// How it ended.
    pub(crate) end: End,
    /// Its duration in the client.
    pub(crate) round_trip: Duration,
    /// How long the search took; none if the call was late.
    pub(crate) search_time: Option<Duration>,
}

/// A client with one thread, as in a game.
pub(crate) struct Client {
    runtime: Runtime,
    url: String,
    requests: Arc<Requests>,
}

/// The requests, each kind in turn.
struct Requests {
    ordinary: Vec<v1::FindGraspRequest>,
    hard: Vec<v1::FindGraspRequest>,
}

impl Client {
    /// Creates an object that cannot be taken, and makes the requests.
    ///
    /// # Panics
    /// The server does not answer.
    pub(crate) fn new(url: &str) -> Self {
        let runtime = Builder::new_current_thread()
            .enable_all()
            .build()
            .expect("a runtime can be started");
        runtime.block_on(async {
            let client = GraspClient::connect(url).await.expect("the server listens");
            let mut untouchable = v1::CreateObjectRequest::new("untouchable", UNTOUCHABLE, 0.1);
            untouchable.object_mut().regions = vec![v1::Region {
                groups: vec!["all".to_owned()],
                ..v1::Region::new("all", v1::Preference::Forbidden)
            }];
            client
                .create_object(&untouchable)
                .await
                .expect("the mesh is sound");
        });
        let ordinary: Vec<_> = holdouts().iter().map(request_for).collect();
        // No grasp with all digits is perfectly comfortable.
        let perfect = ordinary.iter().map(|request| v1::FindGraspRequest {
            requirements: Some(v1::Requirements {
                must_touch: ALL_DIGITS.map(i32::from).to_vec(),
                thesis: Some(v1::ThesisOptions {
                    max_comfort: Some(0.0),
                    ..v1::ThesisOptions::default()
                }),
                ..v1::Requirements::default()
            }),
            ..request.clone()
        });
        let hard = perfect
            .flat_map(|perfect| [perfect, v1::FindGraspRequest::new("objects/untouchable")])
            .collect();
        Self {
            runtime,
            url: url.to_owned(),
            requests: Arc::new(Requests { ordinary, hard }),
        }
    }

    /// Sends calls on a new connection, ordinary and hard in turn.
    ///
    /// # Panics
    /// A call fails other than by its deadline.
    pub(crate) fn send(&self, load: &Load) -> Vec<Call> {
        self.runtime.block_on(async {
            let client = GraspClient::builder(&self.url)
                .call_timeout(load.deadline)
                .retry(RetryPolicy::NEVER)
                .connect()
                .await
                .expect("the server listens");
            let next = Arc::new(AtomicUsize::new(0));
            let mut lanes = JoinSet::new();
            for _ in 0..load.in_flight {
                let (client, requests) = (client.clone(), Arc::clone(&self.requests));
                let (next, calls) = (Arc::clone(&next), load.calls);
                lanes.spawn(async move {
                    let mut ended = Vec::new();
                    loop {
                        let number = next.fetch_add(1, Ordering::Relaxed);
                        if number >= calls {
                            return ended;
                        }
                        ended.push(requests.send(&client, number).await);
                    }
                });
            }
            lanes.join_all().await.concat()
        })
    }
}

impl Requests {
    async fn send(&self, client: &GraspClient, number: usize) -> Call {
        let is_hard = number % 2 == 1;
        let requests = if is_hard { &self.hard } else { &self.ordinary };
        let request = &requests[number / 2 % requests.len()];
        let start = Instant::now();
        let answer = client.find_grasp(request).await;
        let round_trip = start.elapsed();
        let (end, search_time) = match answer {
            Ok(answer) if answer.outcome() == Outcome::Found => (End::Found, Some(answer.search_time())),
            Ok(answer) => (End::Exhausted, Some(answer.search_time())),
            Err(ClientError::DeadlineExceeded(_)) => (End::Late, None),
            Err(error) => panic!("{error}"),
        };
        Call {
            is_hard,
            end,
            round_trip,
            search_time,
        }
    }
}
