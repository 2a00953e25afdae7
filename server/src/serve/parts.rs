//! Parts of a server: its services, the layer around calls, the built-in hands, and how it drains.

use std::{convert::Infallible, path::Path, sync::Arc, thread, time::Duration};

use grasp_assets::hands::{self, RIG_NAMES};
use grasp_proto::v1::{
    grasp_service_server::GraspServiceServer, hand_rig_service_server::HandRigServiceServer,
    object_service_server::ObjectServiceServer,
};
use grasp_synthesis::model::hand::Handedness;
use http::{Request, Response};
use tokio::sync::Semaphore;
use tokio_util::sync::CancellationToken;
use tonic::{Status, body::Body, codec::CompressionEncoding::Gzip, server::NamedService};
use tonic_health::pb::health_server::{Health, HealthServer};
use tower::{Service, service_fn, steer::Steer, util::BoxCloneSyncService};

use crate::{
    access::Door,
    call::{BySize, Calls},
    config::Config,
    limits::{BYTES_BESIDES_MESH, MAX_FIND_REQUEST, MAX_RESPONSE, Places},
    objects::directory::PinnedObject,
    services::Handler,
    traces::Traces,
};

type Grasps = GraspServiceServer<Handler>;
type Objects = ObjectServiceServer<Handler>;
type Rigs = HandRigServiceServer<Handler>;

/// Time limit of a call beyond the largest budget: enough to read and build a large mesh.
const CALL_TIME_BEYOND_BUDGET: Duration = Duration::from_secs(20);

/// Delay between the last response and closing its connection: time to send it, and for the client to close first.
const LINGER: Duration = Duration::from_millis(200);

/// Any service.
type AnyService = BoxCloneSyncService<Request<Body>, Response<Body>, Infallible>;

fn named<S>(service: S) -> (&'static str, AnyService)
where
    S: Service<Request<Body>, Response = Response<Body>, Error = Infallible, Future: Send>
        + NamedService
        + Clone
        + Send
        + Sync
        + 'static,
{
    (S::NAME, BoxCloneSyncService::new(service))
}

/// All services, by the names in paths. Calls of others are answered with `UNIMPLEMENTED`.
pub(super) fn routes(
    handler: &Handler,
    health: HealthServer<impl Health>,
) -> Result<
    impl Service<Request<Body>, Response = Response<Body>, Error = Infallible, Future: Send>
    + Clone
    + Send
    + 'static,
    tonic_reflection::server::Error,
> {
    let (grasps, objects, rigs) = services(handler);
    let (names, mut services): (Vec<_>, Vec<_>) = [
        named(grasps),
        named(objects),
        named(rigs),
        named(health),
        named(reflection().build_v1()?),
        named(reflection().build_v1alpha()?),
    ]
    .into_iter()
    .unzip();
    let none = service_fn(async |_| Ok(Status::unimplemented("").into_http()));
    services.push(BoxCloneSyncService::new(none));
    let names: Arc<[&str]> = names.into();
    let pick = move |request: &Request<Body>, _: &[AnyService]| {
        let called = request.uri().path().split('/').nth(1);
        let place = names.iter().position(|name| called == Some(name));
        place.unwrap_or(names.len())
    };
    Ok(Steer::new(services, pick))
}

/// The services of the contract, each with the limits of its messages.
fn services(handler: &Handler) -> (Grasps, BySize<Objects>, BySize<Rigs>) {
    let largest_upload = largest_upload(&handler.config);
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
    (grasps, objects, rigs)
}

/// Lets running calls end, and then ends the others, too.
pub(super) async fn drain(handler: &Handler, drained: &CancellationToken) {
    let config = &handler.config;
    tracing::info!(calls = handler.calls.receiver_count(), "draining");
    drop(handler.atlases.stopper());
    tokio::time::sleep(config.drain_delay).await;
    handler.shutdown.cancel();
    let ended = tokio::time::timeout(config.drain, handler.calls.closed()).await;
    if ended.is_err() {
        let calls = handler.calls.receiver_count();
        tracing::warn!(calls, "the drain time has passed; cutting off running calls");
    }
    drained.cancel();
    tokio::time::sleep(LINGER).await;
}

pub(super) fn logged(path: &Path, objects: Vec<PinnedObject>) -> Vec<PinnedObject> {
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
pub(super) fn prepare_hands() {
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
pub(super) fn largest_upload(config: &Config) -> usize {
    config.maximum_object_bytes.get() + BYTES_BESIDES_MESH
}

pub(super) fn calls(
    handler: &Handler,
    door: &Arc<Door>,
    builds: Places,
    packers: &Arc<Semaphore>,
    traces: &Traces,
    drained: &CancellationToken,
) -> Calls {
    let config = &handler.config;
    Calls {
        door: Arc::clone(door),
        metrics: Arc::clone(&handler.metrics),
        traces: traces.clone(),
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
        shutdown: handler.shutdown.clone(),
        drained: drained.clone(),
    }
}
