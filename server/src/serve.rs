//! Starts, runs and shuts down the server.

use std::{
    future::Future,
    path::{Path, PathBuf},
    sync::{Arc, atomic::AtomicU64},
    thread,
    time::{Duration, Instant},
};

use futures_util::future::BoxFuture;
use grasp_assets::hands::{self, RIG_NAMES};
use grasp_proto::v1::{
    grasp_service_server::GraspServiceServer, hand_rig_service_server::HandRigServiceServer,
    object_service_server::ObjectServiceServer,
};
use grasp_synthesis::{base::stop::unstopped, model::hand::Handedness};
use tokio::{
    net::TcpListener,
    sync::{Semaphore, watch},
};
use tokio_util::sync::CancellationToken;
use tonic::{codec::CompressionEncoding::Gzip, server::NamedService, service::Routes};
use tonic_health::{ServingStatus, server::HealthReporter};
use tonic_web::GrpcWebLayer;
use tower::{ServiceBuilder, util::option_layer};

use crate::{
    atlases::{Atlases, files::AtlasFiles},
    budget::DeadlineReserve,
    call::{BySize, Calls},
    config::{Config, StorePlace},
    connect::{Connect, Transcoding},
    error::Limit,
    executor::SearchExecutor,
    faults::FaultPoint,
    limits::{BYTES_BESIDES_MESH, ClientPermits, MAX_FIND_REQUEST, MAX_RESPONSE, Places},
    listen::Listener,
    middleware::Around,
    net::{Connections, Lifetime, Serving, UnreadCount, accept},
    objects::{
        derived::Resizer,
        directory::{self, DirectoryError, PinnedObject},
        saved::SavedObjects,
        store::ObjectStore,
    },
    rigs::store::{RigStore, saved_rigs},
    saved::{SavedFiles, StoreError},
    services::{Handler, Shared, load_saved_rigs, upload_places, watcher_places},
    track::OpenTracks,
    viewer::viewer,
    web::{WebOrigins, cors, refuse_origins, refuse_protocols},
};

/// Time limit of a call beyond the largest budget: enough to read and build a large mesh.
const CALL_TIME_BEYOND_BUDGET: Duration = Duration::from_secs(20);

/// When a client whose upload was rejected should retry: after about the time of an upload.
const RETRY_UPLOAD_AFTER: Duration = Duration::from_millis(250);

/// Delay between the last response and closing its connection: time to send it, and for the client to close first.
const LINGER: Duration = Duration::from_millis(200);

/// Why the server ended or did not start.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The search threads cannot be started.
    #[error("cannot start the search workers: {0}")]
    Workers(#[from] rayon::ThreadPoolBuildError),
    /// The objects directory cannot be used.
    #[error(transparent)]
    Objects(#[from] DirectoryError),
    /// The place where objects are saved cannot be used.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The atlas directory cannot be used.
    #[error("atlas_directory is {}; it must be a folder or the name of a new one: {source}", path.display())]
    AtlasDirectory {
        /// The folder.
        path: PathBuf,
        /// The cause.
        source: std::io::Error,
    },
    /// The builder threads cannot be started.
    #[error("cannot start the atlas builders: {0}")]
    Builders(std::io::Error),
    /// The descriptors of the contract are broken.
    #[error("cannot offer reflection: {0}")]
    Reflection(#[from] tonic_reflection::server::Error),
}

/// A server that is ready to listen.
#[derive(Debug)]
pub struct Server {
    handler: Handler,
    /// `None` if nothing is saved.
    files: Option<Arc<SavedFiles>>,
    builds: Places,
}

/// The server's activity, for tests and monitoring.
#[derive(Clone, Debug)]
pub struct Gauges(Handler);

impl Gauges {
    /// Number of running and waiting searches.
    pub fn searches(&self) -> usize {
        self.0.executor.places.taken()
    }

    /// Number of calls in flight.
    pub fn calls(&self) -> usize {
        self.0.calls.receiver_count()
    }

    /// Number of created objects that are prepared for searches.
    pub fn prepared_objects(&self) -> usize {
        self.0.objects.prepared()
    }

    /// Number of tracks of moving givers.
    pub fn tracks(&self) -> usize {
        self.0.tracks.places.taken()
    }

    /// Bytes of answers that wait for clients to read them.
    pub fn unread_bytes(&self) -> usize {
        self.0.connections.unread_bytes()
    }

    /// Number of open connections.
    pub fn connections(&self) -> usize {
        self.0.connections.count()
    }
}

/// Serves on a listener until `shutdown` completes. Then health becomes `NOT_SERVING`, no more connections are
/// accepted, running calls have the drain time to end, and every connection is closed.
///
/// # Errors
/// See [`ServeError`].
pub async fn run(
    listener: TcpListener,
    config: Config,
    shutdown: impl Future<Output = ()> + Send,
) -> Result<(), ServeError> {
    Server::new(config)?.serve([listener.into()], shutdown).await
}

impl Server {
    /// Loads the built-in objects and hands and the objects directory, and starts the search and builder threads.
    ///
    /// # Errors
    /// See [`ServeError`].
    pub fn new(config: Config) -> Result<Self, ServeError> {
        prepare_hands();
        let directory = match &config.objects_directory {
            Some(path) => {
                let limits = config.mesh_limits(config.maximum_object_bytes);
                logged(path, directory::load(path, limits, config.store)?)
            }
            None => Vec::new(),
        };
        let files = SavedFiles::open(&config.place)?.map(Arc::new);
        let saved = files.clone().map(|files| {
            SavedObjects::new(
                files,
                config.maximum_saved_objects,
                config.mesh_limits(config.largest_mesh()),
                config.maximum_uploads.get(),
            )
        });
        let objects = Arc::new(ObjectStore::new(config.store, directory, saved));
        for object in objects.pinned() {
            unstopped(|stop| object.derived_until(stop)?.prepare(&config.default_rig, stop));
        }
        let executor = SearchExecutor::new(config.workers.get(), config.maximum_searches.get())?;
        let atlas_files = match config.kept_atlases() {
            Some(path) => {
                let opened = AtlasFiles::open(path.clone());
                Some(opened.map_err(|source| ServeError::AtlasDirectory { path, source })?)
            }
            None => None,
        };
        let models = config.maximum_object_bytes.get();
        let rig_records = files.clone().map(|files| saved_rigs(files, models));
        let builds = Places::new(Limit::Uploads, config.maximum_uploads.get(), RETRY_UPLOAD_AFTER);
        let shared = Shared {
            atlases: Atlases::start(
                config.builder_threads,
                &objects,
                executor.clone(),
                atlas_files,
                config.default_rig.clone(),
            )
            .map_err(ServeError::Builders)?,
            objects,
            rigs: Arc::new(RigStore::new(config.maximum_rigs.get(), rig_records)),
            resizer: Resizer(Arc::new(Semaphore::new(config.derivations()))),
            executor,
            reserve: Arc::new(DeadlineReserve::new(
                config.budgets.minimum_reserve,
                Instant::now(),
            )),
            deletions: Arc::new(Semaphore::new(1)),
            deriving: Arc::new(Semaphore::new(config.derivations())),
            heavy: Arc::new(ClientPermits::new(config.heavy_work())),
            ahead: Semaphore::new(1),
            created: AtomicU64::new(0),
            upload_bytes: upload_places(config.streams.upload_bytes.get()),
            watchers: watcher_places(config.streams.watchers.get()),
            tracks: Arc::new(OpenTracks::new(config.streams.tracks.get())),
            calls: watch::Sender::new(()),
            connections: Connections::new(
                config.maximum_connections.get(),
                config.maximum_unread_bytes.get(),
            ),
            shutdown: CancellationToken::new(),
            config,
        };
        Ok(Self {
            handler: Handler(Arc::new(shared)),
            files,
            builds,
        })
    }

    async fn read_saved(&self) -> Result<(), StoreError> {
        let start = Instant::now();
        let Shared {
            objects,
            rigs,
            config,
            ..
        } = &*self.handler;
        if let Some(files) = &self.files {
            files.own().await?;
        }
        let objects = objects.read_saved().await?;
        let rigs = load_saved_rigs(rigs, config.mesh_limits(config.maximum_object_bytes)).await?;
        let (store, milliseconds) = (&config.place, start.elapsed().as_millis());
        if *store == StorePlace::Memory {
            tracing::info!("created objects and rigs end with the server: store is memory");
        } else {
            tracing::info!(%store, objects, rigs, milliseconds, "created objects and rigs are saved");
        }
        Ok(())
    }

    /// Calls a closure at the points where tests inject faults.
    #[doc(hidden)]
    pub fn inject_faults(&self, hook: impl Fn(FaultPoint) + Send + Sync + 'static) {
        self.handler.executor.faults.set(Box::new(hook));
    }

    /// The server's activity.
    pub fn gauges(&self) -> Gauges {
        Gauges(self.handler.clone())
    }

    /// Serves on one or more listeners, which share all limits; see [`run`].
    ///
    /// # Errors
    /// See [`ServeError`].
    ///
    /// # Panics
    /// There is no listener.
    pub async fn serve(
        self,
        listeners: impl IntoIterator<Item = Listener> + Send,
        shutdown: impl Future<Output = ()> + Send,
    ) -> Result<(), ServeError> {
        let listeners: Vec<Listener> = listeners.into_iter().collect();
        assert!(!listeners.is_empty(), "there is a listener");
        self.serve_boxed(listeners, Box::pin(shutdown)).await
    }

    /// Serves. Boxed and without type parameters, so that handlers and transport are compiled with this crate and not once more
    /// with every program that starts a server.
    fn serve_boxed(
        self,
        listeners: Vec<Listener>,
        shutdown: BoxFuture<'_, ()>,
    ) -> BoxFuture<'_, Result<(), ServeError>> {
        Box::pin(self.serve_until(listeners, shutdown))
    }

    async fn serve_until(
        self,
        listeners: Vec<Listener>,
        shutdown: impl Future<Output = ()>,
    ) -> Result<(), ServeError> {
        if let Err(error) = self.read_saved().await {
            if let Some(files) = &self.files {
                files.give_back().await;
            }
            return Err(error.into());
        }
        let Self {
            handler,
            files,
            builds,
        } = self;
        let config = &handler.config;
        let largest_upload = largest_upload(config);
        let grasps = GraspServiceServer::new(handler.clone())
            .accept_compressed(Gzip)
            .max_decoding_message_size(MAX_FIND_REQUEST)
            .max_encoding_message_size(MAX_RESPONSE);
        let objects = ObjectServiceServer::new(handler.clone())
            .accept_compressed(Gzip)
            .max_encoding_message_size(MAX_RESPONSE);
        let objects = BySize {
            small: objects.clone().max_decoding_message_size(MAX_FIND_REQUEST),
            large: objects.max_decoding_message_size(largest_upload),
        };
        let rigs = HandRigServiceServer::new(handler.clone())
            .accept_compressed(Gzip)
            .max_encoding_message_size(MAX_RESPONSE);
        let rigs = BySize {
            small: rigs.clone().max_decoding_message_size(MAX_FIND_REQUEST),
            large: rigs.max_decoding_message_size(largest_upload),
        };
        let (health, health_service) = tonic_health::server::health_reporter();
        set_health(&health, ServingStatus::Serving).await;

        let stop = handler.shutdown.clone();
        let close = CancellationToken::new();
        let origins = Arc::new(config.web_origins.clone());
        let is_web = *origins != WebOrigins::NONE;
        let packers = Arc::new(Semaphore::new(config.io_threads.get()));
        let routes = Routes::new(grasps)
            .add_service(objects)
            .add_service(rigs)
            .add_service(health_service)
            .add_service(reflection().build_v1()?)
            .add_service(reflection().build_v1alpha()?);
        let service = ServiceBuilder::new()
            .layer(Around(UnreadCount))
            .layer(refuse_origins(&origins))
            .layer(cors(&origins))
            .layer(option_layer(config.viewer.then(viewer)))
            .layer(refuse_protocols(is_web))
            .layer(Around(Connect))
            .layer(option_layer(is_web.then(GrpcWebLayer::new)))
            .layer(Around(calls(&handler, builds, &packers)))
            .layer(Around(Transcoding {
                largest_upload,
                places: packers,
            }))
            .service(routes.prepare());
        let serving = Serving {
            service,
            lifetime: Lifetime {
                idle: config.connection_idle,
                age: config.connection_age,
                stop: stop.clone(),
                close: close.clone(),
            },
        };
        let serving = accept(listeners, Arc::clone(&handler.connections), serving, stop.clone());

        // Stops all tasks, however this function ends.
        let _builders_end = handler.atlases.stopper();
        let _close_at_the_end = close.clone().drop_guard();
        let _stop_at_the_end = stop.clone().drop_guard();
        let shutting_down = async {
            shutdown.await;
            tracing::info!(calls = handler.calls.receiver_count(), "draining");
            drop(handler.atlases.stopper());
            set_health(&health, ServingStatus::NotServing).await;
            stop.cancel();
            let drained = tokio::time::timeout(config.drain, handler.calls.closed()).await;
            if drained.is_err() {
                let calls = handler.calls.receiver_count();
                tracing::warn!(calls, "the drain time has passed; cutting off running calls");
            }
            tokio::time::sleep(LINGER).await;
            // The transport would wait for idle connections and open streams forever.
            close.cancel();
            std::future::pending::<()>().await;
        };
        let lost = async {
            match &files {
                Some(files) => files.lost().await,
                None => std::future::pending().await,
            }
        };
        tokio::select! {
            () = serving => {}
            () = handler.connections.close_stalled() => {}
            lost = lost => return Err(lost.into()),
            () = shutting_down => {}
        }
        if let Some(files) = &files {
            files.give_back().await;
        }
        tracing::info!("stopped");
        Ok(())
    }
}

fn logged(path: &Path, objects: Vec<PinnedObject>) -> Vec<PinnedObject> {
    for PinnedObject { object, .. } in &objects {
        for warning in &object.warnings {
            tracing::warn!(
                object = object.name(),
                warning,
                "an object of the objects directory has a warning"
            );
        }
    }
    tracing::info!(directory = %path.display(), objects = objects.len(), "read the objects directory");
    objects
}

/// Loads the built-in hands and prepares them for searches. The first call with each hand would otherwise do so,
/// outside its budget: it takes tenths of a second.
fn prepare_hands() {
    thread::scope(|scope| {
        for rig in RIG_NAMES {
            for handedness in [Handedness::Left, Handedness::Right] {
                scope.spawn(move || hands::hand(rig, handedness).map(|hand| hand.rig.oppositions()));
            }
        }
    });
}

fn reflection() -> tonic_reflection::server::Builder<'static> {
    tonic_reflection::server::Builder::configure()
        .register_encoded_file_descriptor_set(grasp_proto::FILE_DESCRIPTOR_SET)
        .register_encoded_file_descriptor_set(tonic_health::pb::FILE_DESCRIPTOR_SET)
}

/// Largest message of an upload, in bytes.
fn largest_upload(config: &Config) -> usize {
    config.maximum_object_bytes.get() + BYTES_BESIDES_MESH
}

fn calls(handler: &Handler, builds: Places, packers: &Arc<Semaphore>) -> Calls {
    let config = &handler.config;
    Calls {
        in_flight: handler.calls.clone(),
        executor: handler.executor.clone(),
        longest_search: config.budgets.maximum,
        uploads: builds,
        heavy: Arc::clone(&handler.heavy),
        reads: Arc::default(),
        upload_grace: 2 * config.streams.upload_idle,
        packers: Arc::clone(packers),
        largest_upload: largest_upload(config),
        reserve: Arc::clone(&handler.reserve),
        longest_call: config.budgets.maximum + CALL_TIME_BEYOND_BUDGET,
    }
}

async fn set_health(health: &HealthReporter, status: ServingStatus) {
    for service in [
        "",
        GraspServiceServer::<Handler>::NAME,
        ObjectServiceServer::<Handler>::NAME,
        HandRigServiceServer::<Handler>::NAME,
    ] {
        health.set_service_status(service, status).await;
    }
}
