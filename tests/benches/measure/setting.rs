//! Shared by all measurements: runtimes, the ways to start a server and to send calls, and test objects with their holdouts.

use std::{
    borrow::Cow,
    sync::OnceLock,
    thread,
    time::{Duration, Instant},
};

use grasp_assets::{
    holdouts::{BuiltInHoldout, holdouts},
    objects::{BuiltInObject, Manifest, objects},
};
use grasp_proto::v1::{self, grasp_service_client::GraspServiceClient};
use grasp_synthesis::model::object::GraspObject;
use grasp_tests::{
    TestServer,
    random_holdouts::{ClientHoldout, Givers, GivingHand, PlacedGiver, giving_hands, place},
};
use indicatif::{ProgressBar, ProgressFinish, ProgressStyle};
use prost::Message as _;
use rand::SeedableRng as _;
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;
use tokio::runtime::{Builder, Runtime};
use tonic::{Status, transport::Channel};

use crate::table::Spread;

/// Seed of givers and holdouts.
const SEED: u64 = 20_180_612;

/// Threads of the server, as many as its binary starts here.
const SERVING_THREADS: usize = 2;

/// Interval between checks for atlas growth. Shorter ones cost the builders time.
const POLL_INTERVAL: Duration = Duration::from_millis(100);

/// Longest wait for all atlases.
const ATLAS_TIMEOUT: Duration = Duration::from_hours(1);

/// Settings and runtimes of all measurements.
pub(crate) struct Setting {
    /// Whether to only check that everything runs.
    pub(crate) is_brief: bool,
    /// Random holdouts per object.
    pub(crate) holdouts: usize,
    /// Givers placed per object.
    givers: u64,
    /// Runtime of the servers.
    pub(crate) serving: Runtime,
    /// Runtime of the clients: one thread, as in a game.
    pub(crate) calling: Runtime,
    /// The hands of givers.
    pub(crate) hands: Vec<GivingHand>,
    built_in: OnceLock<Vec<TestObject>>,
}

/// An object with random holdouts.
pub(crate) struct TestObject {
    /// Its name without the collection.
    pub(crate) id: String,
    /// Its random holdouts.
    pub(crate) holdouts: Vec<ClientHoldout>,
}

impl TestObject {
    /// "objects/{object}".
    pub(crate) fn name(&self) -> String {
        format!("objects/{}", self.id)
    }

    /// A request for each of its holdouts.
    pub(crate) fn requests(&self) -> Vec<v1::FindGraspRequest> {
        let holdouts = self.holdouts.iter();
        holdouts.map(|holdout| holdout.request(&self.name())).collect()
    }
}

impl Setting {
    /// Starts the runtimes.
    pub(crate) fn new(is_brief: bool, holdouts: usize, givers: u64) -> Self {
        Self {
            is_brief,
            holdouts,
            givers,
            serving: Builder::new_multi_thread()
                .worker_threads(SERVING_THREADS)
                .thread_name("serving")
                .enable_all()
                .build()
                .expect("threads can be started"),
            calling: Builder::new_current_thread()
                .enable_all()
                .build()
                .expect("a runtime can be started"),
            hands: giving_hands(),
            built_in: OnceLock::new(),
        }
    }

    /// Requests for the built-in holdouts, repeated to the number of random ones per object.
    pub(crate) fn built_in_requests(&self) -> Vec<v1::FindGraspRequest> {
        let request = |holdout: &BuiltInHoldout| {
            ClientHoldout::of_built_in(holdout).request(&format!("objects/{}", holdout.object))
        };
        let once: Vec<_> = holdouts().iter().map(request).collect();
        let rounds = self.holdouts.div_ceil(once.len());
        once.iter().cycle().take(rounds * once.len()).cloned().collect()
    }

    /// The built-in objects with random holdouts.
    pub(crate) fn test_objects(&self) -> &[TestObject] {
        let test_object = |built_in: &BuiltInObject| {
            let placed = self.placed_givers(&built_in.object, self.givers);
            let givers = Givers::new(&self.hands, &placed).expect("the placements match the hands");
            let mut random = Xoshiro256PlusPlus::seed_from_u64(SEED);
            TestObject {
                id: built_in.name.to_owned(),
                holdouts: (0..self.holdouts).map(|_| givers.draw(&mut random)).collect(),
            }
        };
        self.built_in
            .get_or_init(|| objects().iter().map(test_object).collect())
    }

    /// `count` givers of an object.
    pub(crate) fn placed_givers(&self, object: &GraspObject, count: u64) -> Vec<PlacedGiver> {
        let bar = bar(count as usize, "placing givers");
        let numbers = (0..count).into_par_iter();
        let placed = numbers.map(|number| {
            let giver = place(object, &self.hands, SEED + number);
            bar.inc(1);
            giver
        });
        placed.collect()
    }

    /// A server with the binary's defaults, but without builders and with objects in memory; `adapt` changes it.
    pub(crate) fn server(&self, adapt: impl FnOnce(&mut grasp_server::Config)) -> TestServer {
        self.serving.block_on(TestServer::start_with(adapt))
    }

    /// A server that has read the built-in objects' complete atlases for both hands.
    pub(crate) fn server_with_atlases(&self) -> TestServer {
        let server = self.server(|config| {
            config.builder_threads = thread::available_parallelism().map_or(1, usize::from);
        });
        self.calling.block_on(wait_for_atlases(&server));
        server
    }

    /// Sends requests one after the other.
    ///
    /// # Panics
    /// A request fails. An answer without a grasp is not a failure.
    pub(crate) fn send_all(
        &self,
        server: &TestServer,
        message: &str,
        requests: impl IntoIterator<Item = v1::FindGraspRequest>,
    ) -> Vec<Answer> {
        let requests: Vec<_> = requests.into_iter().collect();
        let bar = bar(requests.len(), message.to_owned());
        self.calling.block_on(async {
            let mut client = server.grasps().await;
            let mut answers = Vec::with_capacity(requests.len());
            for request in requests {
                answers.push(send(&mut client, request).await);
                bar.inc(1);
            }
            answers
        })
    }

    /// Stops a server.
    pub(crate) fn stop(&self, server: TestServer) {
        self.serving.block_on(server.stop());
    }
}

/// The request that registers a built-in object under another name.
pub(crate) fn copy_of(built_in: &BuiltInObject, id: &str) -> v1::CreateObjectRequest {
    let about = Manifest::parse(built_in.manifest).expect("the built-in manifests are sound");
    let mut request = v1::CreateObjectRequest::new(id, built_in.obj, about.mass_kg);
    request.object_mut().center_of_mass = Some(about.centre_of_mass_m.into());
    request.object_mut().regions = forbidden(about.forbidden_groups);
    request
}

/// The groups of a mesh that hands keep off as a region, if there are any.
pub(crate) fn forbidden(groups: Vec<String>) -> Vec<v1::Region> {
    let region = v1::Region {
        groups,
        ..v1::Region::new("forbidden", v1::Preference::Forbidden)
    };
    [region]
        .into_iter()
        .filter(|region| !region.groups.is_empty())
        .collect()
}

/// Requests the built-in objects until their atlases for both hands are in use.
async fn wait_for_atlases(server: &TestServer) {
    let start = Instant::now();
    let mut client = server.grasps().await;
    for built_in in objects() {
        for handedness in [v1::Handedness::Right, v1::Handedness::Left] {
            let name = format!("objects/{}", built_in.name);
            let mut request = v1::FindGraspRequest::new(name).receiving(handedness);
            // Only complete atlases answer these.
            request.search_mut().choice = v1::GraspChoice::Reproducible.into();
            request.search_mut().max_attempts = Some(1);
            loop {
                let answer = client.find_grasp(request.clone()).await;
                let origin = answer.expect("the request is valid").into_inner().origin;
                if origin.is_some_and(|origin| origin.atlases.iter().any(|atlas| atlas.entry_count > 0)) {
                    break;
                }
                assert!(start.elapsed() < ATLAS_TIMEOUT, "atlases were not read in time");
                tokio::time::sleep(POLL_INTERVAL).await;
            }
        }
    }
}

/// A progress bar; hidden unless standard error is a terminal, cleared when dropped.
pub(crate) fn bar(steps: usize, message: impl Into<Cow<'static, str>>) -> ProgressBar {
    let style = ProgressStyle::with_template("{bar:32} {pos:>5}/{len} {elapsed:>4} {msg}")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    let bar = ProgressBar::new(steps as u64)
        .with_style(style)
        .with_message(message)
        .with_finish(ProgressFinish::AndClear);
    bar.enable_steady_tick(Duration::from_millis(100));
    bar
}

/// Time within which a request counts as answered: two or three frames, hidden by the start of a handover.
pub(crate) const ANSWERED_WITHIN: Duration = Duration::from_millis(50);

/// The measurements of one answer.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Answer {
    /// Whether a grasp was found.
    pub(crate) found: bool,
    /// Whether it came from the atlas.
    pub(crate) from_atlas: bool,
    /// Whether it came from the grips that earlier requests' searches found.
    pub(crate) from_learned: bool,
    /// Duration of the search as the server reports it: without reading the request, planning key frames and writing
    /// the answer.
    pub(crate) search_time: Duration,
    /// Duration of the call in the client, encoding and decoding included.
    pub(crate) round_trip: Duration,
    /// Size of the request message in bytes.
    pub(crate) sent_bytes: usize,
    /// Size of the answer message in bytes.
    pub(crate) received_bytes: usize,
}

impl Answer {
    /// Whether a grasp was found within 50 ms.
    pub(crate) fn is_in_time(&self) -> bool {
        self.found && self.search_time <= ANSWERED_WITHIN
    }
}

/// Sends one request; an error if the server refuses it.
pub(crate) async fn try_send(
    client: &mut GraspServiceClient<Channel>,
    request: v1::FindGraspRequest,
) -> Result<Answer, Status> {
    let sent_bytes = request.encoded_len();
    let start = Instant::now();
    let answer = client.find_grasp(request).await?;
    let round_trip = start.elapsed();
    let answer = answer.into_inner();
    Ok(Answer {
        found: answer.outcome() == v1::Outcome::Found,
        from_atlas: answer.source() == v1::GraspSource::Atlas,
        from_learned: answer.source() == v1::GraspSource::Learned,
        search_time: answer.search_time(),
        round_trip,
        sent_bytes,
        received_bytes: answer.encoded_len(),
    })
}

/// Sends one request that the server accepts.
pub(crate) async fn send(client: &mut GraspServiceClient<Channel>, request: v1::FindGraspRequest) -> Answer {
    try_send(client, request).await.expect("the request is valid")
}

/// The same request with a budget of [`ANSWERED_WITHIN`].
pub(crate) fn within_50_ms(request: v1::FindGraspRequest) -> v1::FindGraspRequest {
    request.with_budget(ANSWERED_WITHIN)
}

/// The same request, to be answered without an atlas.
pub(crate) fn without_atlas(mut request: v1::FindGraspRequest) -> v1::FindGraspRequest {
    request.search_mut().ignore_atlas = true;
    request
}

/// Spread of the search times.
pub(crate) fn search_times(answers: &[Answer]) -> Spread {
    Spread::of_times(answers.iter().map(|answer| answer.search_time))
}

/// Spread of the round trips.
pub(crate) fn round_trips(answers: &[Answer]) -> Spread {
    Spread::of_times(answers.iter().map(|answer| answer.round_trip))
}

/// Share of the answers for which a predicate holds.
pub(crate) fn share(answers: &[Answer], is: impl Fn(&Answer) -> bool) -> f64 {
    answers.iter().filter(|answer| is(answer)).count() as f64 / answers.len().max(1) as f64
}

/// Asserts that grasps were measured.
///
/// # Panics
/// No answer has a grasp.
pub(crate) fn assert_some_found(answers: &[Answer]) {
    assert!(
        answers.iter().any(|answer| answer.found),
        "none of {} answers has a grasp",
        answers.len()
    );
}
