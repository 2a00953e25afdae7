//! What the rows share: runtimes, folders, the objects with their holdouts, and servers that know them.

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
    base::mechanisms::Mechanisms,
    known::key::key,
    model::{hand::Handedness, object::GraspObject},
};
use grasp_tests::{
    TestServer,
    random_holdouts::{ClientHoldout, Givers, GivingHand, PlacedGiver, giving_hands, place},
    recorded::data_folder,
};
use indicatif::{ProgressBar, ProgressFinish, ProgressStyle};
use rand::SeedableRng as _;
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;
use tokio::runtime::{Builder, Runtime};

use crate::asking::{Answer, ask, wire_duration};

/// The seed of givers and holdouts: another one, and they are all others.
const SEED: u64 = 20_180_612;

/// Threads that serve: as many as the server's binary takes here.
const SERVING_THREADS: usize = 2;

/// How often it is looked whether atlases have grown. Looking more often costs the builders time.
const LOOKS_EVERY: Duration = Duration::from_millis(100);

/// How long atlases may take: each at most two minutes, if the targets are met.
const PATIENCE: Duration = Duration::from_hours(1);

/// Everything that the rows have in common.
pub(crate) struct Setting {
    /// Only try whether all runs?
    pub(crate) quick: bool,
    /// Random holdouts an object.
    pub(crate) holdouts: usize,
    /// Givers that are placed on an object.
    pub(crate) givers: usize,
    /// The mechanisms that searches run.
    pub(crate) mechanisms: Mechanisms,
    /// Where servers run.
    pub(crate) serving: Runtime,
    /// Where clients run: one thread, as in a game.
    pub(crate) calling: Runtime,
    /// Keeps what takes long to make.
    folder: PathBuf,
    hands: Vec<GivingHand>,
}

/// An object with random holdouts.
pub(crate) struct Thing {
    /// "objects/{object}".
    pub(crate) name: String,
    /// As the server knows it too.
    pub(crate) object: Arc<GraspObject>,
    /// How it is registered; none for those that are built in.
    pub(crate) create: Option<v1::CreateObjectRequest>,
    /// Random holdouts of it.
    pub(crate) holdouts: Vec<ClientHoldout>,
}

impl Thing {
    /// Its name without the collection's.
    pub(crate) fn id(&self) -> &str {
        self.name.trim_start_matches("objects/")
    }

    /// Requests for all its holdouts.
    pub(crate) fn requests(&self) -> Vec<v1::FindGraspRequest> {
        self.holdouts
            .iter()
            .map(|holdout| holdout.request(&self.name))
            .collect()
    }
}

impl Setting {
    /// Starts the runtimes and finds the folder.
    pub(crate) fn new(quick: bool, holdouts: usize, givers: usize, mechanisms: Mechanisms) -> Self {
        let target = Path::new(env!("CARGO_TARGET_TMPDIR")).parent();
        let folder = target.expect("cargo's folder lies in another").join("figures");
        fs::create_dir_all(&folder).expect("cargo's target folder can be written");
        Self {
            quick,
            holdouts,
            givers,
            mechanisms,
            serving: Builder::new_multi_thread()
                .worker_threads(SERVING_THREADS)
                .thread_name("serving")
                .enable_all()
                .build()
                .expect("threads can be had"),
            calling: Builder::new_current_thread()
                .enable_all()
                .build()
                .expect("a runtime can be had"),
            folder,
            hands: giving_hands(),
        }
    }

    /// The folder that keeps what takes long to make.
    pub(crate) fn folder(&self) -> &Path {
        &self.folder
    }

    /// The folder of atlases, shared with tests and experiments.
    pub(crate) fn atlases() -> AtlasFolder {
        AtlasFolder::in_target()
    }

    /// A folder of atlases that holds what [`Setting::atlases`] holds now, and nothing of an earlier run.
    pub(crate) fn copied_atlases(&self) -> PathBuf {
        let copy = self.folder.join("copied-atlases");
        if copy.exists() {
            fs::remove_dir_all(&copy).expect("the copy is this bench's own");
        }
        fs::create_dir_all(&copy).expect("cargo's target folder can be written");
        for file in fs::read_dir(Self::atlases().path()).into_iter().flatten() {
            let file = file.expect("the folder can be read");
            fs::copy(file.path(), copy.join(file.file_name())).expect("an atlas can be copied");
        }
        copy
    }

    /// Requests for the built-in holdouts, again and again until there are as many as random ones of an object.
    pub(crate) fn built_in_requests(&self) -> Vec<v1::FindGraspRequest> {
        let once: Vec<_> = built_in_holdouts()
            .iter()
            .map(|(object, holdout)| holdout.request(&format!("objects/{object}")))
            .collect();
        let rounds = self.holdouts.div_ceil(once.len());
        once.iter().cycle().take(rounds * once.len()).cloned().collect()
    }

    /// The built-in objects with random holdouts.
    pub(crate) fn built_in_things(&self) -> Vec<Thing> {
        objects()
            .iter()
            .map(|built_in| self.thing(built_in.name, Arc::clone(&built_in.object), None))
            .collect()
    }

    /// An object with random holdouts.
    pub(crate) fn thing(
        &self,
        id: &str,
        object: Arc<GraspObject>,
        create: Option<v1::CreateObjectRequest>,
    ) -> Thing {
        let givers = self.givers(id, &object);
        let mut random = Xoshiro256PlusPlus::seed_from_u64(SEED);
        Thing {
            name: format!("objects/{id}"),
            holdouts: (0..self.holdouts).map(|_| givers.draw(&mut random)).collect(),
            object,
            create,
        }
    }

    /// The givers of an object, from a file where they were placed before.
    fn givers(&self, id: &str, object: &GraspObject) -> Givers {
        let rig = &default_hand(Handedness::Right).rig;
        let made_of = key(object, rig);
        let (made_of, _) = made_of.split_first_chunk().expect("a key has as many bytes");
        let made_of = u128::from_be_bytes(*made_of);
        let hands = if data_folder().is_some() {
            "recorded"
        } else {
            "built-in"
        };
        // Named after how they are placed too: others are there from before.
        let file = format!("givers-by-skin-{hands}-{made_of:032x}-{SEED}.json");
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
        Givers::new(&self.hands, &placed).expect("the hands are those that were placed")
    }

    /// A server as the binary's defaults make it, but for what `adapt` changes.
    pub(crate) fn server(&self, adapt: impl FnOnce(&mut grasp_server::Config)) -> TestServer {
        self.serving.block_on(TestServer::start_with(|config| {
            config.mechanisms = self.mechanisms;
            adapt(config);
        }))
    }

    /// A server that knows `things` and has complete atlases of them for both hands, so that nothing grows any more; in a
    /// quick run, atlases that are of some use.
    pub(crate) fn server_with_atlases(&self, things: &[&Thing]) -> TestServer {
        let server = self.server(|config| {
            config.builder_threads = thread::available_parallelism().map_or(1, usize::from);
            config.atlas_directory = Some(Self::atlases().path().to_owned());
        });
        self.calling.block_on(async {
            register(&server, things).await;
            self.wait_for_atlases(&server, things).await;
        });
        server
    }

    async fn wait_for_atlases(&self, server: &TestServer, things: &[&Thing]) {
        let start = Instant::now();
        let bar = bar(things.len(), "building atlases, once".to_owned());
        let mut waiting: Vec<&Thing> = things.to_vec();
        while !waiting.is_empty() {
            let mut left = Vec::new();
            for thing in waiting {
                let ready = if self.quick {
                    atlas_state(server, &thing.name).await.entries > 0
                } else {
                    is_complete(server, &thing.name, v1::Handedness::Right).await
                        && is_complete(server, &thing.name, v1::Handedness::Left).await
                };
                if ready {
                    bar.inc(1);
                } else {
                    left.push(thing);
                }
            }
            waiting = left;
            assert!(start.elapsed() < PATIENCE, "atlases do not become complete");
            if !waiting.is_empty() {
                tokio::time::sleep(LOOKS_EVERY).await;
            }
        }
    }

    /// Asks one request after the other.
    ///
    /// # Panics
    /// One is not answered; that there is no grasp is an answer.
    pub(crate) fn ask_all(
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
                answers.push(ask(&mut client, request).await);
                bar.inc(1);
            }
            answers
        })
    }
}

/// The built-in holdouts, each with its object.
pub(crate) fn built_in_holdouts() -> Vec<(&'static str, ClientHoldout)> {
    holdouts()
        .iter()
        .map(|holdout| (holdout.object.as_str(), ClientHoldout::of_built_in(holdout)))
        .collect()
}

/// The hand that requests get that name none.
pub(crate) fn default_hand(handedness: Handedness) -> &'static grasp_assets::hands::Hand {
    grasp_assets::hands::hand("adult", handedness).expect("the adult rig is built in")
}

/// How a built-in object is registered under another name.
pub(crate) fn copy_of(built_in: &BuiltInObject, id: &str) -> v1::CreateObjectRequest {
    let about = Manifest::parse(built_in.manifest).expect("the built-in manifests are sound");
    let [x, y, z] = about.centre_of_mass_m.to_array();
    v1::CreateObjectRequest {
        object_id: id.to_owned(),
        obj: built_in.obj.as_bytes().to_vec(),
        mass_kg: about.mass_kg,
        centre_of_mass: Some(v1::Vector3 { x, y, z }),
        forbidden: Some(v1::ForbiddenSurfaces {
            groups: about.forbidden_groups,
            triangles: Vec::new(),
        }),
        ..Default::default()
    }
}

/// Registers those that are not built in.
pub(crate) async fn register(server: &TestServer, things: &[&Thing]) {
    let mut client = server.objects().await;
    for create in things.iter().filter_map(|thing| thing.create.clone()) {
        client.create_object(create).await.expect("the mesh is sound");
    }
}

/// What a server tells of an object's atlas.
pub(crate) async fn atlas_state(server: &TestServer, name: &str) -> v1::AtlasState {
    let request = v1::GetObjectRequest {
        name: name.to_owned(),
    };
    let answer = server.objects().await.get_object(request).await;
    let object = answer.expect("it is registered").into_inner().object;
    object
        .and_then(|object| object.atlas)
        .expect("the server keeps atlases")
}

/// Is a hand's atlas complete, and not empty? Only complete ones answer reproducible requests.
async fn is_complete(server: &TestServer, name: &str, handedness: v1::Handedness) -> bool {
    let request = v1::FindGraspRequest {
        object: name.to_owned(),
        receiving_hand: Some(v1::ReceivingHand {
            rig: String::new(),
            handedness: handedness.into(),
        }),
        reproducible: true,
        max_attempts: Some(1),
        budget: wire_duration(Duration::from_millis(1)),
        ..Default::default()
    };
    let answer = server.grasps().await.find_grasp(request).await;
    let report = answer.expect("the request is valid").into_inner().report;
    report.is_some_and(|report| report.atlas_entries > 0)
}

/// A progress bar; hidden where standard error is no terminal, gone when it is dropped.
pub(crate) fn bar(steps: usize, message: String) -> ProgressBar {
    let style = ProgressStyle::with_template("{bar:32} {pos:>5}/{len} {elapsed:>4} {msg}")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    let bar = ProgressBar::new(steps as u64)
        .with_style(style)
        .with_message(message)
        .with_finish(ProgressFinish::AndClear);
    bar.enable_steady_tick(Duration::from_millis(100));
    bar
}
