//! Starts, runs and shuts down the server.

mod parts;

use std::{
    future::Future,
    path::PathBuf,
    sync::{Arc, atomic::AtomicU64},
    time::{Duration, Instant},
};

use futures_util::future::BoxFuture;
use grasp_synthesis::base::stop::unstopped;
use tokio::{
    net::TcpListener,
    sync::{Semaphore, watch},
};
use tokio_util::sync::CancellationToken;
use tonic_web::GrpcWebLayer;
use tower::{ServiceBuilder, util::option_layer};

use self::parts::{calls, drain, largest_upload, logged, prepare_hands, routes};
use crate::{
    access::Door,
    atlases::{Atlases, files::AtlasFiles},
    budget::DeadlineReserve,
    config::{Config, StorePlace},
    connect::{Connect, Transcoder},
    error::Limit,
    executor::SearchExecutor,
    faults::FaultPoint,
    limits::{ClientPermits, Places},
    listen::Listener,
    middleware::Around,
    monitor::{Monitor, Phase, Vitals, set_health},
    net::{ConnectionServer, Connections, Lifetime, UnreadCount, accept},
    objects::{
        derived::Resizer,
        directory::{self, DirectoryError},
        saved::SavedObjects,
        store::ObjectStore,
    },
    reload::{Reloader, WatchedFiles, keep_current},
    rigs::store::{RigStore, saved_rigs},
    saved::{SavedFiles, StoreError},
    services::{Handler, Shared, load_saved_rigs, upload_places, watcher_places},
    tls::Tls,
    traces::Traces,
    track::OpenTracks,
    viewer::viewer,
    web::{WebOrigins, cors, refuse_origins, refuse_protocols},
};

/// When a client whose upload was rejected should retry: after about the time of an upload.
const RETRY_UPLOAD_AFTER: Duration = Duration::from_millis(250);

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
    /// Files of certificates or tokens cannot be used.
    #[error("{}", .0.join("\n"))]
    Secrets(Vec<String>),
    /// The builder threads cannot be started.
    #[error("cannot start the atlas builders: {0}")]
    Builders(std::io::Error),
    /// The descriptors of the contract are broken.
    #[error("cannot offer reflection: {0}")]
    Reflection(#[from] tonic_reflection::server::Error),
    /// Traces cannot be sent.
    #[error("{0}")]
    Traces(String),
}

/// A server that is ready to listen.
#[derive(Debug)]
pub struct Server {
    handler: Handler,
    /// `None` if nothing is saved.
    files: Option<Arc<SavedFiles>>,
    builds: Places,
    tls: Option<Arc<Tls>>,
    door: Arc<Door>,
    /// Certificates and tokens.
    watched: Vec<WatchedFiles>,
    reloader: Reloader,
    monitor: Option<Listener>,
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
        let tls = config.tls.clone().map(Tls::open).transpose();
        let takes_certificates = config.tls.as_ref().is_some_and(|tls| tls.client_ca.is_some());
        let door = Door::open(config.tokens_file.clone(), takes_certificates);
        let (tls, door) = match (tls, door) {
            (Ok(tls), Ok(door)) => (tls.map(Arc::new), Arc::new(door)),
            (tls, door) => {
                let problems = [tls.err(), door.err()];
                return Err(ServeError::Secrets(
                    problems.into_iter().flatten().flatten().collect(),
                ));
            }
        };
        let mut watched = vec![WatchedFiles::new(Arc::clone(&door) as Arc<_>)];
        watched.extend(tls.clone().map(|tls| WatchedFiles::new(tls)));
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
            metrics: Arc::default(),
            reserve: Arc::new(DeadlineReserve::new(
                config.budgets.minimum_reserve,
                Instant::now(),
            )),
            deletions: Arc::new(Semaphore::new(1)),
            deriving: Arc::new(Semaphore::new(config.derivations())),
            heavy: Arc::new(ClientPermits::new(config.heavy_work())),
            examining: ClientPermits::new(config.workers.get()),
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
            tls,
            door,
            watched,
            reloader: Reloader::default(),
            monitor: None,
        })
    }

    /// The same, with metrics and answers to probes on a listener of their own.
    #[must_use]
    pub fn monitored_on(self, listener: Listener) -> Self {
        Self {
            monitor: Some(listener),
            ..self
        }
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

    /// Makes the server read its certificates and tokens again.
    pub fn reloader(&self) -> Reloader {
        self.reloader.clone()
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

    /// The signs of life, which are served until `close` if there is a listener for that.
    fn monitored(&mut self, close: &CancellationToken) -> Arc<Vitals> {
        let vitals = Arc::new(Vitals::default());
        let monitor = Monitor::new(self.handler.clone(), self.builds.clone(), Arc::clone(&vitals));
        if let Some(listener) = self.monitor.take() {
            tokio::spawn(close.clone().run_until_cancelled_owned(monitor.serve(listener)));
        }
        vitals
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
        mut self,
        listeners: Vec<Listener>,
        shutdown: impl Future<Output = ()>,
    ) -> Result<(), ServeError> {
        let close = CancellationToken::new();
        let _close_at_the_end = close.clone().drop_guard();
        let vitals = self.monitored(&close);
        let traces = Traces::start(self.handler.config.otlp_endpoint.as_deref());
        let traces = traces.map_err(ServeError::Traces)?;
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
            tls,
            door,
            watched,
            reloader,
            ..
        } = self;
        let config = &handler.config;
        let largest_upload = largest_upload(config);
        let (health, health_service) = tonic_health::server::health_reporter();
        set_health(&health, true, true).await;
        let watch = Arc::clone(&vitals).watch(handler.executor.clone(), files.clone(), health.clone());
        tokio::spawn(close.clone().run_until_cancelled_owned(watch));
        vitals.enter(Phase::Serving);

        let stop = handler.shutdown.clone();
        let drained = CancellationToken::new();
        let origins = Arc::new(config.web_origins.clone());
        let is_web = *origins != WebOrigins::NONE;
        let packers = Arc::new(Semaphore::new(config.io_threads.get()));
        let routes = routes(&handler, health_service)?;
        let service = ServiceBuilder::new()
            .layer(Around(UnreadCount))
            .layer(refuse_origins(&origins))
            .layer(cors(&origins))
            .layer(option_layer(config.viewer.then(viewer)))
            .layer(refuse_protocols(is_web))
            .layer(Around(Connect))
            .layer(option_layer(is_web.then(GrpcWebLayer::new)))
            .layer(Around(calls(
                &handler, &door, builds, &packers, &traces, &drained,
            )))
            .layer(Around(Transcoder {
                largest_upload,
                places: packers,
            }))
            .service(routes);
        let server = ConnectionServer {
            service,
            tls,
            lifetime: Lifetime {
                idle: config.connection_idle,
                age: config.connection_age,
                stop: stop.clone(),
                close: close.clone(),
            },
        };
        let serving = accept(listeners, Arc::clone(&handler.connections), server, stop.clone());

        // Stops all tasks, however this function ends.
        let _builders_end = handler.atlases.stopper();
        let _stop_at_the_end = stop.clone().drop_guard();
        let shutting_down = async {
            shutdown.await;
            vitals.enter(Phase::Draining);
            set_health(&health, false, false).await;
            drain(&handler, &drained).await;
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
            () = keep_current(watched, reloader) => {}
            lost = lost => return Err(lost.into()),
            () = shutting_down => {}
        }
        if let Some(files) = &files {
            files.give_back().await;
        }
        // The last calls end with their connections.
        let _ = tokio::task::spawn_blocking(move || traces.finish()).await;
        tracing::info!("stopped");
        Ok(())
    }
}
