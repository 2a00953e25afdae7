//! Shared by all rows: runtimes, folders, test objects with their holdouts, and servers that know them.

use std::{
    fs,
    path::{Path, PathBuf},
    sync::Arc,
    thread,
    time::{Duration, Instant},
};

use grasp_assets::{
    atlas_folder::AtlasFolder,
    holdouts::holdouts,
    objects::{BuiltInObject, Manifest, objects},
};
use grasp_proto::v1;
use grasp_synthesis::{
    known::key::key,
    model::{hand::Handedness, object::GraspObject},
};
use grasp_tests::{
    TestServer,
    progress::bar,
    random_holdouts::{ClientHoldout, Givers, GivingHand, PlacedGiver, giving_hands, place},
    recorded::data_folder,
};

use rand::SeedableRng as _;
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;
use tokio::runtime::{Builder, Runtime};

use crate::figures::requests::{Answer, send};

/// Seed of givers and holdouts.
const SEED: u64 = 20_180_612;

/// Threads of the server, as many as its binary starts here.
const SERVING_THREADS: usize = 2;

/// Interval between checks for atlas growth. Shorter ones cost the builders time.
const POLL_INTERVAL: Duration = Duration::from_millis(100);

/// Longest wait for all atlases. The target is two minutes for each.
const ATLAS_TIMEOUT: Duration = Duration::from_hours(1);

/// What all rows share.
pub(crate) struct Setting {
    /// Whether to only check that everything runs.
    pub(crate) quick: bool,
    /// Random holdouts per object.
    pub(crate) holdouts: usize,
    /// Givers placed per object.
    pub(crate) givers: usize,
    /// Runtime of the servers.
    pub(crate) serving: Runtime,
    /// Runtime of the clients: one thread, as in a game.
    pub(crate) calling: Runtime,
    /// Folder for slow preparations.
    folder: PathBuf,
    hands: Vec<GivingHand>,
}

/// An object with random holdouts.
pub(crate) struct TestObject {
    /// "objects/{object}".
    pub(crate) name: String,
    /// The same object as the server's.
    pub(crate) object: Arc<GraspObject>,
    /// The request that registers it; `None` for built-in objects.
    pub(crate) create: Option<v1::CreateObjectRequest>,
    /// Its random holdouts.
    pub(crate) holdouts: Vec<ClientHoldout>,
}

impl TestObject {
    /// Its name without the collection.
    pub(crate) fn id(&self) -> &str {
        self.name.trim_start_matches("objects/")
    }

    /// A request for each of its holdouts.
    pub(crate) fn requests(&self) -> Vec<v1::FindGraspRequest> {
        self.holdouts
            .iter()
            .map(|holdout| holdout.request(&self.name))
            .collect()
    }
}

impl Setting {
    /// Starts the runtimes and finds the folder.
    pub(crate) fn new(quick: bool, holdouts: usize, givers: usize) -> Self {
        let target = Path::new(env!("CARGO_TARGET_TMPDIR")).parent();
        let folder = target
            .expect("cargo's temporary folder has a parent")
            .join("figures");
        fs::create_dir_all(&folder).expect("cargo's target folder can be written");
        Self {
            quick,
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
            folder,
            hands: giving_hands(),
        }
    }

    /// The folder of atlases, shared with tests and experiments.
    pub(crate) fn atlases() -> AtlasFolder {
        AtlasFolder::in_target()
    }

    /// A fresh folder with a copy of the atlases in [`Setting::atlases`].
    pub(crate) fn copied_atlases(&self) -> PathBuf {
        let copy = self.folder.join("copied-atlases");
        if copy.exists() {
            fs::remove_dir_all(&copy).expect("the old copy can be removed");
        }
        fs::create_dir_all(&copy).expect("cargo's target folder can be written");
        for file in fs::read_dir(Self::atlases().path()).into_iter().flatten() {
            let file = file.expect("the folder can be read");
            fs::copy(file.path(), copy.join(file.file_name())).expect("an atlas can be copied");
        }
        copy
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
    pub(crate) fn built_in_test_objects(&self) -> Vec<TestObject> {
        objects()
            .iter()
            .map(|built_in| self.test_object(built_in.name, Arc::clone(&built_in.object), None))
            .collect()
    }

    /// An object with random holdouts.
    pub(crate) fn test_object(
        &self,
        id: &str,
        object: Arc<GraspObject>,
        create: Option<v1::CreateObjectRequest>,
    ) -> TestObject {
        let givers = self.givers(id, &object);
        let mut random = Xoshiro256PlusPlus::seed_from_u64(SEED);
        TestObject {
            name: format!("objects/{id}"),
            holdouts: (0..self.holdouts).map(|_| givers.draw(&mut random)).collect(),
            object,
            create,
        }
    }

    /// The givers of an object, loaded from a file if they were placed before.
    fn givers(&self, id: &str, object: &GraspObject) -> Givers {
        let rig = &default_hand(Handedness::Right).rig;
        let digest = key(object, rig);
        let (digest, _) = digest.split_first_chunk().expect("a key has at least 16 bytes");
        let digest = u128::from_be_bytes(*digest);
        let hands = if data_folder().is_some() {
            "recorded"
        } else {
            "built-in"
        };
        // The name includes the placement method, to ignore files of older ones.
        let file = format!("givers-by-skin-{hands}-{digest:032x}-{SEED}.json");
        let file = self.folder.join(file);
        let kept = fs::read(&file)
            .ok()
            .and_then(|text| serde_json::from_slice(&text).ok());
        let mut placed: Vec<PlacedGiver> = kept.unwrap_or_default();
        if Givers::new(&self.hands, &placed).is_none() {
            placed.clear();
        }
        if placed.len() < self.givers {
            let bar = bar(self.givers - placed.len(), format!("placing givers on {id}"));
            let more: Vec<_> = (placed.len()..self.givers)
                .into_par_iter()
                .map(|number| {
                    let giver = place(object, &self.hands, SEED + number as u64);
                    bar.inc(1);
                    giver
                })
                .collect();
            placed.extend(more);
            let text = serde_json::to_vec(&placed).expect("a placement is plain data");
            fs::write(&file, text).expect("cargo's target folder can be written");
        }
        placed.truncate(self.givers);
        Givers::new(&self.hands, &placed).expect("the placements match the hands")
    }

    /// A server with the binary's defaults, except for what `adapt` changes.
    pub(crate) fn server(&self, adapt: impl FnOnce(&mut grasp_server::Config)) -> TestServer {
        self.serving.block_on(TestServer::start_with(adapt))
    }

    /// A server that knows the test objects and has complete atlases of them for both hands, so that nothing grows
    /// any more. In a quick run, some entries suffice.
    pub(crate) fn server_with_atlases(&self, test_objects: &[&TestObject]) -> TestServer {
        let server = self.server(|config| {
            config.builder_threads = thread::available_parallelism().map_or(1, usize::from);
            config.atlas_directory = Some(Self::atlases().path().to_owned());
        });
        self.calling.block_on(async {
            register(&server, test_objects).await;
            self.wait_for_atlases(&server, test_objects).await;
        });
        server
    }

    async fn wait_for_atlases(&self, server: &TestServer, test_objects: &[&TestObject]) {
        let start = Instant::now();
        let bar = bar(test_objects.len(), "building atlases, once".to_owned());
        let mut waiting: Vec<&TestObject> = test_objects.to_vec();
        while !waiting.is_empty() {
            let mut left = Vec::new();
            for test_object in waiting {
                let ready = if self.quick {
                    atlas_state(server, &test_object.name).await.entry_count > 0
                } else {
                    knows_all(server, &test_object.name, default_receiver(v1::Handedness::Right)).await
                        && knows_all(server, &test_object.name, default_receiver(v1::Handedness::Left)).await
                };
                if ready {
                    bar.inc(1);
                } else {
                    left.push(test_object);
                }
            }
            waiting = left;
            assert!(
                start.elapsed() < ATLAS_TIMEOUT,
                "atlases were not complete in time"
            );
            if !waiting.is_empty() {
                tokio::time::sleep(POLL_INTERVAL).await;
            }
        }
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
}

/// The built-in holdouts, each with the name of its object.
pub(crate) fn built_in_holdouts() -> Vec<(&'static str, ClientHoldout)> {
    holdouts()
        .iter()
        .map(|holdout| (holdout.object.as_str(), ClientHoldout::of_built_in(holdout)))
        .collect()
}

/// The hand of requests that name none.
pub(crate) fn default_hand(handedness: Handedness) -> &'static grasp_assets::hands::Hand {
    grasp_assets::hands::hand("adult", handedness).expect("the adult rig is built in")
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

/// Registers the test objects that are not built in.
pub(crate) async fn register(server: &TestServer, test_objects: &[&TestObject]) {
    let mut client = server.objects().await;
    for create in test_objects
        .iter()
        .filter_map(|test_object| test_object.create.clone())
    {
        client.create_object(create).await.expect("the mesh is sound");
    }
}

/// The state of an object's atlas for the default right hand.
pub(crate) async fn atlas_state(server: &TestServer, name: &str) -> v1::Atlas {
    let request = v1::GetAtlasRequest {
        name: format!("{name}/atlases/right"),
    };
    let answer = server.objects().await.get_atlas(request).await;
    answer.expect("it is registered").into_inner()
}

/// Whether an atlas grows no more.
pub(crate) fn is_complete(atlas: &v1::Atlas) -> bool {
    matches!(
        atlas.growth(),
        v1::AtlasGrowth::Complete | v1::AtlasGrowth::NothingFound
    )
}

fn default_receiver(handedness: v1::Handedness) -> v1::Receiver {
    v1::Receiver {
        handedness: handedness.into(),
        ..v1::Receiver::default()
    }
}

/// Whether the atlas of a receiver's hand is complete and not empty: only complete ones answer reproducible requests.
pub(crate) async fn knows_all(server: &TestServer, name: &str, receiver: v1::Receiver) -> bool {
    let request = v1::FindGraspRequest {
        receiver: Some(receiver),
        search: Some(v1::SearchOptions {
            choice: v1::GraspChoice::Reproducible.into(),
            max_attempts: Some(1),
            ..v1::SearchOptions::default()
        }),
        ..v1::FindGraspRequest::new(name).with_budget(Duration::from_millis(1))
    };
    let answer = server.grasps().await.find_grasp(request).await;
    let origin = answer.expect("the request is valid").into_inner().origin;
    origin.is_some_and(|origin| origin.atlases.iter().any(|atlas| atlas.entry_count > 0))
}
