//! Starts, runs and shuts down the server.

use std::{
    future::Future,
    num::NonZeroUsize,
    path::{Path, PathBuf},
    pin::Pin,
    sync::Arc,
    thread,
    time::{Duration, Instant},
};

use grasp_assets::hands::{self, RIG_NAMES};
use grasp_import::MeshLimits;
use grasp_proto::v1::{
    grasp_service_server::GraspServiceServer, hand_rig_service_server::HandRigServiceServer,
    object_service_server::ObjectServiceServer,
};
use grasp_synthesis::{base::stop::unstopped, model::hand::Handedness};
use tokio::{net::TcpListener, sync::Semaphore};
use tokio_util::sync::CancellationToken;
use tonic::{codec::CompressionEncoding::Gzip, server::NamedService, transport};
use tonic_health::{ServingStatus, server::HealthReporter};
use tonic_web::GrpcWebLayer;
use tower::util::option_layer;

use crate::{
    atlases::{Atlases, files::AtlasFiles},
    budget::DeadlineReserve,
    call::{BySize, Calls, CallsInFlight},
    config::{Config, StorePlace},
    executor::SearchExecutor,
    limits::{BYTES_BESIDES_MESH, MAX_FIND_REQUEST, MAX_RESPONSE},
    middleware::Around,
    net::{AcceptLimits, Admission, UnreadAnswers, UnreadCount, accept},
    objects::{
        derived::Resizer,
        directory::{self, DirectoryError, PinnedObject},
        saved::SavedObjects,
        store::ObjectStore,
    },
    rigs::store::{RigStore, saved_rigs},
    saved::{SavedFiles, StoreError},
    services::{
        Ahead, GraspHandler, HandRigHandler, ObjectHandler, Packing, Shared, Uploads, load_saved_rigs,
    },
    track::OpenTracks,
    web::{WebOrigins, cors, refuse_origins, refuse_protocols},
};

/// Largest number of open streams per connection.
const STREAMS_PER_CONNECTION: u32 = 100;

/// Largest number of concurrent calls per connection; more are rejected.
const CALLS_PER_CONNECTION: usize = 64;

/// Largest headers of a request, in bytes.
const MAX_HEADERS: u32 = 16 << 10;

/// Largest number of streams that a client may open and reset before its connection is closed as an attack.
const PENDING_RESETS: usize = 20;

/// Flow-control window of a stream, in bytes.
const STREAM_WINDOW: u32 = 256 << 10;

/// Flow-control window of a connection, in bytes.
const CONNECTION_WINDOW: u32 = 1 << 20;

/// Largest HTTP/2 frame, in bytes.
const MAX_FRAME: u32 = 16 << 10;

/// Interval of pings on a silent connection.
const KEEPALIVE_EVERY: Duration = Duration::from_secs(30);

/// Time limit for the answer to a ping.
const KEEPALIVE_TIMEOUT: Duration = Duration::from_secs(10);

/// Time limit for a client's HTTP/2 preface.
const PREFACE_TIME: Duration = Duration::from_secs(10);

/// Time limit of a call beyond the largest budget: enough to read and build a large mesh.
const CALL_TIME_BEYOND_BUDGET: Duration = Duration::from_secs(20);

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
    /// The transport failed.
    #[error("the transport failed: {0}")]
    Transport(#[from] transport::Error),
}

/// A server that is ready to listen.
#[derive(Debug)]
pub struct Server {
    shared: Arc<Shared>,
    calls: CallsInFlight,
    /// Permits to build objects, as many as `maximum_uploads`.
    builds: Arc<Semaphore>,
    maximum_uploads: NonZeroUsize,
    upload_grace: Duration,
    maximum_connections: NonZeroUsize,
    unread: Arc<UnreadAnswers>,
    web_origins: Arc<WebOrigins>,
    /// Threads that pack answers: as many as handle them.
    packers: usize,
    drain: Duration,
    place: StorePlace,
}

/// The server's activity, for tests and monitoring.
#[derive(Clone, Debug)]
pub struct Gauges {
    shared: Arc<Shared>,
    calls: CallsInFlight,
    unread: Arc<UnreadAnswers>,
}

impl Gauges {
    /// Number of running and waiting searches.
    pub fn searches(&self) -> usize {
        self.shared.executor.jobs()
    }

    /// Number of calls in flight.
    pub fn calls(&self) -> usize {
        self.calls.count()
    }

    /// Number of created objects that searches need not prepare.
    pub fn prepared_objects(&self) -> usize {
        self.shared.objects.prepared()
    }

    /// Number of tracks of moving givers.
    pub fn tracks(&self) -> usize {
        self.shared.tracks.count()
    }

    /// Bytes of answers that wait for clients to read them.
    pub fn unread_bytes(&self) -> usize {
        self.unread.bytes()
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
    Server::new(config)?.serve(listener, shutdown).await
}

impl Server {
    /// Loads the built-in objects and hands and the objects directory, and starts the search and builder threads.
    ///
    /// # Errors
    /// [`ServeError::Workers`], [`ServeError::Objects`], [`ServeError::Store`], [`ServeError::AtlasDirectory`],
    /// [`ServeError::Builders`].
    pub fn new(config: Config) -> Result<Self, ServeError> {
        prepare_hands();
        let triangles = config.maximum_object_triangles.get();
        let obj_limits = MeshLimits {
            bytes: config.maximum_object_bytes.get(),
            vertices: triangles,
            triangles,
        };
        let directory = match &config.objects_directory {
            Some(path) => logged(path, directory::load(path, obj_limits, config.store)?),
            None => Vec::new(),
        };
        let loading_limits = MeshLimits {
            bytes: config.largest_mesh(),
            ..obj_limits
        };
        let files = SavedFiles::open(&config.place)?.map(Arc::new);
        let saved = files.clone().map(|files| {
            SavedObjects::new(
                files,
                config.maximum_saved_objects,
                loading_limits,
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
                let opened = AtlasFiles::open(path.clone(), config.atlas_directory.is_none());
                Some(opened.map_err(|source| ServeError::AtlasDirectory { path, source })?)
            }
            None => None,
        };
        let builds = Arc::new(Semaphore::new(config.maximum_uploads.get()));
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
            rigs: Arc::new(RigStore::new(config.maximum_rigs.get(), files.map(saved_rigs))),
            resizer: Resizer::new(Arc::clone(&builds)),
            executor,
            reserve: Arc::new(DeadlineReserve::new(
                config.budgets.minimum_reserve,
                Instant::now(),
            )),
            budgets: config.budgets,
            refinement: config.refinement,
            learned_grips: config.learned_grips,
            obj_limits,
            deletions: Arc::new(Semaphore::new(1)),
            deriving: Arc::new(Semaphore::new(config.derivations())),
            ahead: Ahead::default(),
            uploads: Uploads::new(config.streams.upload_bytes.get(), config.streams.upload_idle),
            maximum_watchers: config.streams.watchers.get(),
            tracks: Arc::new(OpenTracks::new(config.streams.tracks.get())),
            track_idle: config.streams.track_idle,
            shutdown: CancellationToken::new(),
            default_rig: config.default_rig,
        };
        Ok(Self {
            shared: Arc::new(shared),
            calls: CallsInFlight::default(),
            builds,
            maximum_uploads: config.maximum_uploads,
            upload_grace: 2 * config.streams.upload_idle,
            maximum_connections: config.maximum_connections,
            unread: UnreadAnswers::new(config.maximum_unread_bytes.get()),
            web_origins: Arc::new(config.web_origins),
            packers: config.io_threads.get(),
            drain: config.drain,
            place: config.place,
        })
    }

    /// Reads what was saved, and logs where that is.
    async fn read_saved(&self) -> Result<(), StoreError> {
        let start = Instant::now();
        let objects = self.shared.objects.read_saved().await?;
        let rigs = load_saved_rigs(&self.shared.rigs, self.shared.obj_limits).await?;
        let (store, milliseconds) = (&self.place, start.elapsed().as_millis());
        if *store == StorePlace::Memory {
            tracing::info!("created objects and rigs end with the server: store is memory");
        } else {
            tracing::info!(%store, objects, rigs, milliseconds, "created objects and rigs are saved");
        }
        Ok(())
    }

    /// The server's activity.
    pub fn gauges(&self) -> Gauges {
        Gauges {
            shared: Arc::clone(&self.shared),
            calls: self.calls.clone(),
            unread: Arc::clone(&self.unread),
        }
    }

    /// Serves; see [`run`].
    ///
    /// # Errors
    /// See [`ServeError`].
    pub async fn serve(
        self,
        listener: TcpListener,
        shutdown: impl Future<Output = ()> + Send,
    ) -> Result<(), ServeError> {
        self.serve_boxed(listener, Box::pin(shutdown)).await
    }

    /// Serves. Boxed and without type parameters, so that handlers and transport are compiled with this crate and not once more
    /// with every program that starts a server.
    fn serve_boxed<'a>(
        self,
        listener: TcpListener,
        shutdown: Pin<Box<dyn Future<Output = ()> + Send + 'a>>,
    ) -> Pin<Box<dyn Future<Output = Result<(), ServeError>> + Send + 'a>> {
        Box::pin(self.serve_until(listener, shutdown))
    }

    /// Serves until `shutdown` completes and what runs has ended.
    async fn serve_until(
        self,
        listener: TcpListener,
        shutdown: impl Future<Output = ()>,
    ) -> Result<(), ServeError> {
        self.read_saved().await?;
        let largest_upload = self.shared.obj_limits.bytes + BYTES_BESIDES_MESH;
        let grasps = GraspServiceServer::new(GraspHandler::new(Arc::clone(&self.shared)))
            .accept_compressed(Gzip)
            .max_decoding_message_size(MAX_FIND_REQUEST)
            .max_encoding_message_size(MAX_RESPONSE);
        let objects = ObjectServiceServer::new(ObjectHandler::new(Arc::clone(&self.shared)))
            .accept_compressed(Gzip)
            .max_encoding_message_size(MAX_RESPONSE);
        let objects = BySize {
            small: objects.clone().max_decoding_message_size(MAX_FIND_REQUEST),
            large: objects.max_decoding_message_size(largest_upload),
        };
        let rigs = HandRigServiceServer::new(HandRigHandler::new(Arc::clone(&self.shared)))
            .accept_compressed(Gzip)
            .max_encoding_message_size(MAX_RESPONSE);
        let rigs = BySize {
            small: rigs.clone().max_decoding_message_size(MAX_FIND_REQUEST),
            large: rigs.max_decoding_message_size(largest_upload),
        };
        let (health, health_service) = tonic_health::server::health_reporter();
        set_health(&health, ServingStatus::Serving).await;

        let stop = self.shared.shutdown.clone();
        let close = CancellationToken::new();
        let limits = AcceptLimits {
            connections: self.maximum_connections.get(),
            preface: PREFACE_TIME,
            headers: MAX_HEADERS as usize,
            calls: CALLS_PER_CONNECTION,
        };
        let unread = Arc::clone(&self.unread);
        let incoming = accept(listener, limits, unread, stop.clone(), close.clone());
        let is_web = *self.web_origins != WebOrigins::NONE;
        let serving = transport::Server::builder()
            // Also where it is not served, to say so.
            .accept_http1(true)
            .max_concurrent_streams(STREAMS_PER_CONNECTION)
            .http2_max_header_list_size(MAX_HEADERS)
            .http2_max_pending_accept_reset_streams(Some(PENDING_RESETS))
            .initial_stream_window_size(STREAM_WINDOW)
            .initial_connection_window_size(CONNECTION_WINDOW)
            .max_frame_size(MAX_FRAME)
            .http2_keepalive_interval(Some(KEEPALIVE_EVERY))
            .http2_keepalive_timeout(Some(KEEPALIVE_TIMEOUT))
            .layer(Around(UnreadCount))
            .layer(refuse_origins(&self.web_origins))
            .layer(cors(&self.web_origins))
            .layer(refuse_protocols(is_web))
            .layer(option_layer(is_web.then(GrpcWebLayer::new)))
            .layer(Around(Calls {
                in_flight: self.calls.clone(),
                uploads: self.builds,
                maximum_uploads: self.maximum_uploads.get(),
                upload_grace: self.upload_grace,
                largest_upload,
                reserve: Arc::clone(&self.shared.reserve),
                longest_call: self.shared.budgets.maximum + CALL_TIME_BEYOND_BUDGET,
            }))
            .layer(Around(Packing::new(self.packers)))
            .layer(Around(Admission))
            .add_service(grasps)
            .add_service(objects)
            .add_service(rigs)
            .add_service(health_service)
            .add_service(reflection().build_v1()?)
            .add_service(reflection().build_v1alpha()?)
            .serve_with_incoming_shutdown(incoming, stop.clone().cancelled_owned());

        // Stops everything that still runs, however this function ends.
        let _builders_end = self.shared.atlases.stopper();
        let _close_at_the_end = close.clone().drop_guard();
        let _stop_at_the_end = stop.clone().drop_guard();
        let shutting_down = async {
            shutdown.await;
            tracing::info!(calls = self.calls.count(), "draining");
            drop(self.shared.atlases.stopper());
            set_health(&health, ServingStatus::NotServing).await;
            stop.cancel();
            let drained = tokio::time::timeout(self.drain, self.calls.none()).await;
            if drained.is_err() {
                tracing::warn!(
                    calls = self.calls.count(),
                    "the drain time has passed; cutting off running calls"
                );
            }
            tokio::time::sleep(LINGER).await;
            // The transport would wait for idle connections and open streams forever.
            close.cancel();
            std::future::pending::<()>().await;
        };
        tokio::select! {
            served = serving => served?,
            () = self.unread.close_stalled() => {}
            () = shutting_down => {}
        }
        tracing::info!("stopped");
        Ok(())
    }
}

/// Logs the objects of a folder and their warnings.
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

/// Reflection for the contract and the health service.
fn reflection() -> tonic_reflection::server::Builder<'static> {
    tonic_reflection::server::Builder::configure()
        .register_encoded_file_descriptor_set(grasp_proto::FILE_DESCRIPTOR_SET)
        .register_encoded_file_descriptor_set(tonic_health::pb::FILE_DESCRIPTOR_SET)
}

/// Sets the health of every service and of the server as a whole.
async fn set_health(health: &HealthReporter, status: ServingStatus) {
    for service in [
        "",
        GraspServiceServer::<GraspHandler>::NAME,
        ObjectServiceServer::<ObjectHandler>::NAME,
        HandRigServiceServer::<HandRigHandler>::NAME,
    ] {
        health.set_service_status(service, status).await;
    }
}
