//! The heavy client's attacks. Each lasts until it is dropped.

use std::{net::SocketAddr, sync::Arc, time::Duration};

use bytes::Bytes;
use grasp_client::v1::{
    self, grasp_service_client::GraspServiceClient, hand_rig_service_client::HandRigServiceClient,
    object_service_client::ObjectServiceClient, upload_object_request::Part,
};
use grasp_tests::raw::{Connection, framed};
use tokio::{task::JoinSet, time::sleep};
use tonic::transport::Channel;

use super::{
    Resource,
    modest::{new_rig, read_all},
};
use crate::{
    Failure,
    bench::{Bench, WINDOW},
    load::{Call, HEAVY, connect_all, find_grasp, open_loop, socket, within},
    requests::{BOX_OBJ, adult_joints},
    server::ServerProcess,
};

/// Longest attack.
const ENDS_AFTER: Duration = Duration::from_mins(2);

/// Pause after a refusal, of each task that tries again.
const RETRIES_AFTER: Duration = Duration::from_millis(100);

/// Tasks that hold streams or watches open: more than servers allow.
const HOLDERS: usize = 128;

/// Budget of a stream of grasps.
const STREAM_BUDGET: Duration = Duration::from_secs(10);

/// Created tracks, all that a server allows, and those of them that get frames.
const TRACKS: usize = 200;
const PUSHED_TRACKS: usize = 20;

/// Uploads, more than a server allows; the bytes they begin with, which make them count; and the time to the next byte.
const UPLOADS: usize = 16;
const UPLOAD_BEGINS_WITH: usize = 70 << 10;
const TRICKLE: Duration = Duration::from_secs(3);

/// Connections for meshes that are not read, and meshes on each.
const UNREADING_CONNECTIONS: usize = 16;
const UNREAD_MESHES: usize = 64;

/// Clients that create rigs.
const RIG_MAKERS: usize = 8;

/// Connections without a call: more than servers accept.
const SILENT_CONNECTIONS: usize = 1200;

/// Begins an attack; calls come at `rate` per second where that matters.
pub(super) async fn attack(
    bench: &Bench,
    server: &ServerProcess,
    resource: Resource,
    rate: f64,
) -> Result<JoinSet<()>, Failure> {
    let address = server.address;
    let mut tasks = JoinSet::new();
    let channels = connect_all(address, HEAVY).await?;
    match resource {
        Resource::Searches => {
            let call = find_grasp(address, HEAVY, &bench.requests.searching).await?;
            tasks.spawn(async move { drop(open_loop(call, rate, ENDS_AFTER, 1).await) });
        }
        Resource::Streams => hold(&mut tasks, &channels, stream),
        Resource::Tracks => {
            let call = push_frames(&channels, create_tracks(&channels).await?);
            tasks.spawn(async move { drop(open_loop(call, rate, ENDS_AFTER, 1).await) });
        }
        Resource::Uploads => {
            for number in 0..UPLOADS {
                tasks.spawn(again(move || trickle(address, number)));
            }
        }
        Resource::Meshes => {
            for _ in 0..UNREADING_CONNECTIONS {
                tasks.spawn(again(move || do_not_read(address)));
            }
        }
        Resource::Watches => hold(&mut tasks, &channels, watch),
        Resource::Rigs => {
            let joints = adult_joints(&channels[0]).await?;
            for maker in 0..RIG_MAKERS {
                let (channel, joints) = (channels[maker].clone(), joints.clone());
                tasks.spawn(async move {
                    for number in 0.. {
                        let rig = new_rig(format!("kept-{maker}-{number}"), &joints);
                        if HandRigServiceClient::new(channel.clone())
                            .create_rig(rig)
                            .await
                            .is_err()
                        {
                            sleep(RETRIES_AFTER).await;
                        }
                    }
                });
            }
        }
        Resource::Connections => {
            for _ in 0..SILENT_CONNECTIONS {
                tasks.spawn(again(move || async move {
                    let socket = socket(address, HEAVY).await?;
                    // Until the server closes it.
                    Ok(socket.readable().await?)
                }));
            }
        }
    }
    Ok(tasks)
}

/// Does it again and again, with a pause.
async fn again<F: Future<Output = Result<(), Failure>>>(action: impl Fn() -> F) {
    loop {
        // The server is to refuse it and to end it.
        let _ = action().await;
        sleep(RETRIES_AFTER).await;
    }
}

/// Holds many calls open.
fn hold<F>(tasks: &mut JoinSet<()>, channels: &Arc<[Channel]>, call: fn(Channel) -> F)
where
    F: Future<Output = Result<(), Failure>> + Send + 'static,
{
    for number in 0..HOLDERS {
        let channel = channels[number % channels.len()].clone();
        tasks.spawn(again(move || call(channel.clone())));
    }
}

async fn stream(channel: Channel) -> Result<(), Failure> {
    let hopeless = v1::FindGraspRequest::new("objects/untouchable").with_budget(STREAM_BUDGET);
    let request = v1::StreamGraspsRequest::from(hopeless);
    let answers = GraspServiceClient::new(channel).stream_grasps(request).await?;
    Ok(read_all(answers.into_inner()).await?)
}

async fn watch(channel: Channel) -> Result<(), Failure> {
    let all = v1::WatchObjectsRequest::default();
    let changes = ObjectServiceClient::new(channel).watch_objects(all).await?;
    Ok(read_all(changes.into_inner()).await?)
}

/// Names of as many tracks as the server gives, up to [`TRACKS`].
async fn create_tracks(channels: &Arc<[Channel]>) -> Result<Vec<String>, Failure> {
    let mut names = Vec::new();
    for number in 0..TRACKS {
        let mut client = GraspServiceClient::new(channels[number % channels.len()].clone());
        match client.create_track(v1::Track::new("objects/untouchable")).await {
            Ok(track) => names.push(track.into_inner().name),
            Err(_) if !names.is_empty() => break,
            Err(status) => return Err(status.into()),
        }
    }
    Ok(names)
}

/// Frames of some tracks in turn; the others are forgotten.
fn push_frames(channels: &Arc<[Channel]>, names: Vec<String>) -> Call {
    let channels = Arc::clone(channels);
    let pushed = names.len().min(PUSHED_TRACKS);
    Arc::new(move |number, left| {
        let mut client = GraspServiceClient::new(channels[number % channels.len()].clone());
        let track = names[number % pushed].clone();
        Box::pin(async move {
            let frame = v1::TrackFrame {
                track,
                sequence: number as u64 + 1,
                ..Default::default()
            };
            client.push_frame(within(left, frame)).await.map(|_| true)
        })
    })
}

/// An upload that goes on by a byte every few seconds.
async fn trickle(address: SocketAddr, number: usize) -> Result<(), Failure> {
    let mut connection = Connection::over(socket(address, HEAVY).await?, WINDOW).await?;
    let call = connection.call("grasp.v1.ObjectService/UploadObject", &[]).await;
    let (answer, mut request) = call.ok_or("the connection is closed")?;
    let create = v1::CreateObjectRequest {
        mesh: Vec::new(),
        ..v1::CreateObjectRequest::new(format!("slow-{number}"), BOX_OBJ, 0.1)
    };
    let part = |part| v1::UploadObjectRequest {
        part: Some(part),
        total_bytes: 1 << 20,
    };
    request.send_data(framed(&part(Part::Create(create))).into(), false)?;
    let mut piece: Bytes = framed(&part(Part::Piece(vec![b' '; 2 * UPLOAD_BEGINS_WITH]))).into();
    request.send_data(piece.split_to(UPLOAD_BEGINS_WITH), false)?;
    let trickling = async {
        loop {
            sleep(TRICKLE).await;
            request.send_data(piece.split_to(1), false)?;
        }
    };
    tokio::select! {
        answer = answer => answer.map(drop).map_err(Into::into),
        failure = trickling => failure,
    }
}

/// Requests meshes on a connection and reads none.
async fn do_not_read(address: SocketAddr) -> Result<(), Failure> {
    let mut connection = Connection::over(socket(address, HEAVY).await?, 0).await?;
    let mut calls = Vec::new();
    let named = v1::GetMeshRequest {
        name: "objects/scissors".to_owned(),
    };
    for _ in 0..UNREAD_MESHES {
        let call = connection.call("grasp.v1.ObjectService/GetMesh", &[]).await;
        let (answer, mut request) = call.ok_or("the connection is closed")?;
        request.send_data(framed(&named).into(), true)?;
        calls.push(answer);
    }
    // Until the server closes it.
    Ok(connection.task.await??)
}
