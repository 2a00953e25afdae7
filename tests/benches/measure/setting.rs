//! Shared by all measurements: runtimes, the ways to start a server and to send calls, and test objects with their holdouts.

use std::{
    sync::{Arc, OnceLock},
    thread,
    time::{Duration, Instant},
};

use grasp_assets::{
    holdouts::holdouts,
    objects::{BuiltInObject, Manifest, objects},
};
use grasp_proto::v1;
use grasp_synthesis::model::object::GraspObject;
use grasp_tests::{
    TestServer,
    progress::bar,
    random_holdouts::{ClientHoldout, Givers, GivingHand, PlacedGiver, giving_hands, place},
};
use rand::SeedableRng as _;
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;
use tokio::runtime::{Builder, Runtime};

use crate::calls::{Answer, send};

/// Seed of givers and holdouts.
const SEED: u64 = 20_180_612;

/// Threads of the server, as many as its binary starts here.
const SERVING_THREADS: usize = 2;

/// Interval between checks for atlas growth. Shorter ones cost the builders time.
const POLL_INTERVAL: Duration = Duration::from_millis(100);

/// Longest wait for all atlases.
const ATLAS_TIMEOUT: Duration = Duration::from_hours(1);

/// What all measurements share.
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
    /// The same object as the server's.
    pub(crate) object: Arc<GraspObject>,
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

    /// Requests for the built-in holdouts, repeated until there are as many as random ones per object.
    pub(crate) fn built_in_requests(&self) -> Vec<v1::FindGraspRequest> {
        let once: Vec<_> = built_in_holdouts()
            .iter()
            .map(|(object, holdout)| holdout.request(&format!("objects/{object}")))
            .collect();
        let rounds = self.holdouts.div_ceil(once.len());
        once.iter().cycle().take(rounds * once.len()).cloned().collect()
    }

    /// The built-in objects with random holdouts.
    pub(crate) fn test_objects(&self) -> &[TestObject] {
        let test_object = |built_in: &BuiltInObject| self.test_object(built_in.name, &built_in.object);
        self.built_in
            .get_or_init(|| objects().iter().map(test_object).collect())
    }

    /// An object with random holdouts.
    pub(crate) fn test_object(&self, id: &str, object: &Arc<GraspObject>) -> TestObject {
        let placed = self.placed_givers(object, self.givers);
        let givers = Givers::new(&self.hands, &placed).expect("the placements match the hands");
        let mut random = Xoshiro256PlusPlus::seed_from_u64(SEED);
        TestObject {
            id: id.to_owned(),
            object: Arc::clone(object),
            holdouts: (0..self.holdouts).map(|_| givers.draw(&mut random)).collect(),
        }
    }

    /// So many givers of an object.
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

    /// A server with the binary's defaults, but without builders and with objects in memory, except for what `adapt` changes.
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

/// The built-in holdouts, each with the name of its object.
pub(crate) fn built_in_holdouts() -> Vec<(&'static str, ClientHoldout)> {
    holdouts()
        .iter()
        .map(|holdout| (holdout.object.as_str(), ClientHoldout::of_built_in(holdout)))
        .collect()
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

/// Asks for the built-in objects until their atlases for both hands are in use.
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
