//! Memory of a server that runs for long: objects that come and go, and a mixed load, make it grow no further than its limits say.

use std::{
    fs,
    time::{Duration, Instant},
};

use glam::{Quat, Vec3};
use grasp_cases::short_or_long;
use grasp_proto::v1::{
    self, grasp_service_client::GraspServiceClient, object_service_client::ObjectServiceClient,
    track_holdout_request::Message,
};
use rand::{RngExt as _, SeedableRng as _};
use rand_xoshiro::Xoshiro256PlusPlus as Random;
use tokio::task::JoinSet;
use tonic::{
    Code, Status,
    transport::{Channel, Endpoint},
};

use crate::{
    Running,
    stress::{hills, mesh},
};

/// Clients at the same time.
const CLIENTS: usize = 4;

/// The cache, in bytes.
const CACHE: usize = 64 << 20;

/// Memory that objects may take beside the cache.
const MAX_BESIDES: usize = 64 << 20;

/// Growth after the warm-up, in bytes.
const MAX_GROWTH: usize = 10 << 20;

/// How long a use may take before the test calls it a hang.
const HANGS_AFTER: Duration = Duration::from_mins(5);

/// Samples of memory at each end, of which the medians are compared.
const SAMPLES: usize = 10;

fn start(more: &[(&str, &str)]) -> Running {
    let limits = [
        ("GRASP_LISTEN", "127.0.0.1:0"),
        ("GRASP_LOG", "warn,grasp_server=info,grasp_server::call=off"),
        ("GRASP_CACHE_BYTES", "67108864"),
        ("GRASP_CACHE_OBJECTS", "100"),
        // All clients are one to the server, by their address.
        ("GRASP_MAXIMUM_UPLOADS", "16"),
    ];
    Running::start(&[&limits[..], more].concat())
}

pub(crate) async fn channel(address: &str) -> Channel {
    let endpoint = Endpoint::from_shared(format!("http://{address}")).expect("it is an address");
    endpoint.connect().await.expect("it listens")
}

/// Resident memory of a server, or its peak, in bytes.
pub(crate) fn memory(server: &Running, line: &str) -> usize {
    let status = fs::read_to_string(format!("/proc/{}/status", server.child.id())).expect("it runs");
    let mut lines = status.lines();
    let kilobytes = lines.find_map(|text| text.strip_prefix(line)?.trim().strip_suffix(" kB"));
    let kilobytes: usize = kilobytes.expect("it is there").parse().expect("it is a number");
    kilobytes << 10
}

pub(crate) fn mib(bytes: usize) -> f64 {
    bytes as f64 / f64::from(1 << 20)
}

#[tokio::test(flavor = "multi_thread")]
async fn objects_that_come_and_go_take_no_more_memory_than_the_cache() {
    let count = short_or_long(1000, 10_000) as usize;
    let server = start(&[]);
    let mut client = ObjectServiceClient::new(channel(&server.address).await);
    client
        .list_objects(v1::ListObjectsRequest::default())
        .await
        .expect("it serves");
    let before = memory(&server, "VmRSS:");
    let mut creating = JoinSet::new();
    for number in 0..CLIENTS {
        let mut client = client.clone();
        creating.spawn(async move {
            for object in (number..count).step_by(CLIENTS) {
                // Objects of 8 to 800 triangles.
                let request = hills(&format!("o{object}"), 2 + object % 19);
                client.create_object(request).await.expect("it is an object");
            }
        });
    }
    while let Some(done) = creating.join_next().await {
        done.expect("it did not panic");
    }
    let request = v1::ListObjectsRequest {
        page_size: 1000,
        ..Default::default()
    };
    let objects = client
        .list_objects(request)
        .await
        .expect("it lists them")
        .into_inner()
        .objects;
    let kept = objects.iter().filter(|object| !object.built_in).count();
    let (peak, after) = (memory(&server, "VmHWM:"), memory(&server, "VmRSS:"));
    println!(
        "{count} objects created, {} evicted: {:.1} MiB before, {:.1} MiB after, {:.1} MiB at most; the cache has {:.0} MiB",
        count - kept,
        mib(before),
        mib(after),
        mib(peak),
        mib(CACHE)
    );
    assert!(kept <= 100, "{kept}");
    assert!(peak - before <= CACHE + MAX_BESIDES, "{peak} bytes");
    server.terminate();
}

/// The built-in remote before a person who sways.
fn remote(sequence: u64) -> v1::FindGraspRequest {
    let time = sequence as f32 / 90.0;
    let place = Vec3::new(0.3 + 0.1 * (2.0 * time).sin(), 1.2, 0.1 * (3.0 * time).cos());
    let pose = v1::Pose::new(place, Quat::from_rotation_y(0.3 * time.sin()));
    let request = v1::FindGraspRequest::new("objects/remote").with_client_from_object(pose);
    request.with_budget(Duration::from_millis(20)).with_seed(sequence)
}

fn frame(sequence: u64) -> v1::TrackFrame {
    let holdout = v1::Holdout {
        object: String::new(),
        ..remote(sequence).holdout.expect("it has one")
    };
    v1::TrackFrame::of(sequence, holdout).captured_at(Duration::from_micros(11_111 * sequence))
}

/// True if a status says that there was too little time, or too much work.
fn is_refusal(status: &Status) -> bool {
    let is_late_track = status.code() == Code::NotFound && status.message().starts_with("tracks/");
    is_late_track || matches!(status.code(), Code::DeadlineExceeded | Code::ResourceExhausted)
}

/// One use of the server, of any kind, on a connection of its own now and then.
async fn use_once(
    address: &str,
    channel: &mut Channel,
    client: usize,
    random: &mut Random,
) -> Result<(), Status> {
    if random.random_ratio(1, 20) {
        *channel = self::channel(address).await;
    }
    let mut grasps = GraspServiceClient::new(channel.clone());
    let mut objects = ObjectServiceClient::new(channel.clone());
    let name = format!("objects/c{client}-{}", random.random_range(0..4));
    let seed = random.random_range(0..1000);
    match random.random_range(0..9) {
        0 => _ = grasps.find_grasp(remote(seed)).await?,
        1 => {
            let mut search = remote(seed);
            search.search_mut().ignore_atlas = true;
            _ = grasps.find_grasp(search).await?;
        }
        2 => {
            let find = remote(seed);
            let request = v1::StreamGraspsRequest {
                holdout: find.holdout,
                search: find.search,
                ..Default::default()
            };
            let mut found = grasps.stream_grasps(request).await?.into_inner();
            while found.message().await?.is_some() {}
        }
        3 => {
            let track = v1::Track::new("objects/remote");
            let frames = (1..20).map(|sequence| Message::Frame(frame(sequence)));
            let messages = [Message::Track(track)].into_iter().chain(frames);
            let messages = messages.map(|message| v1::TrackHoldoutRequest {
                message: Some(message),
            });
            let requests = tokio_stream::iter(messages.collect::<Vec<_>>());
            let mut answers = grasps.track_holdout(requests).await?.into_inner();
            while answers.message().await?.is_some() {}
        }
        4 => {
            let track = grasps
                .create_track(v1::Track::new("objects/remote"))
                .await?
                .into_inner();
            for sequence in 1..10 {
                let pushed = v1::TrackFrame {
                    track: track.name.clone(),
                    ..frame(sequence)
                };
                grasps.push_frame(pushed).await?;
            }
            grasps
                .delete_track(v1::DeleteTrackRequest { name: track.name })
                .await?;
        }
        5 => {
            let deletion = v1::DeleteObjectRequest {
                name: name.clone(),
                allow_missing: true,
                ..Default::default()
            };
            objects.delete_object(deletion.clone()).await?;
            let cells = random.random_range(2..20);
            objects
                .create_object(hills(&name["objects/".len()..], cells))
                .await?;
            _ = mesh(&mut objects, name.clone()).await;
            let heavier = v1::GraspObject {
                name: name.clone(),
                mass_kg: random.random_range(0.1..1.0),
                ..Default::default()
            };
            objects
                .update_object(v1::UpdateObjectRequest::new(heavier, []))
                .await?;
            let find = v1::FindGraspRequest::new(name).with_budget(Duration::from_millis(20));
            grasps.find_grasp(find).await?;
            objects.delete_object(deletion).await?;
        }
        6 => {
            // Given up.
            let search = grasps.find_grasp(remote(seed).with_budget(Duration::from_secs(5)));
            let _ = tokio::time::timeout(Duration::from_millis(random.random_range(0..10)), search).await;
        }
        7 => {
            let request = v1::WatchObjectsRequest {
                include_present: true,
                ..Default::default()
            };
            let mut reports = objects.watch_objects(request).await?.into_inner();
            // Three objects, and that these were all.
            for _ in 0..4 {
                reports.message().await?;
            }
        }
        // Wrong in many ways.
        _ => {
            let wrong = grasps
                .find_grasp(v1::FindGraspRequest::new("objects/nothing"))
                .await;
            assert!(wrong.is_err());
        }
    }
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_mixed_load_makes_the_server_grow_no_further_once_it_is_warm() {
    let time = Duration::from_secs(short_or_long(60, 3600).into());
    let warm = time / 3;
    let server = start(&[("GRASP_WORKERS", "2"), ("GRASP_BUILDER_THREADS", "0")]);
    let begun = Instant::now();
    let mut using = JoinSet::new();
    for client in 0..CLIENTS {
        let address = server.address.clone();
        using.spawn(async move {
            let (mut random, mut channel) = (Random::seed_from_u64(client as u64), channel(&address).await);
            let mut uses = 0;
            while begun.elapsed() < time {
                let used = use_once(&address, &mut channel, client, &mut random);
                let used = tokio::time::timeout(HANGS_AFTER, used).await;
                match used.expect("it hangs") {
                    Ok(()) => uses += 1,
                    // A busy machine may not be in time.
                    Err(status) => assert!(is_refusal(&status), "{status:?}"),
                }
                // Leaves the machine to others most of the time.
                tokio::time::sleep(Duration::from_millis(40)).await;
            }
            uses
        });
    }
    let mut samples: Vec<(Duration, usize)> = Vec::new();
    while begun.elapsed() < time {
        tokio::time::sleep(time / 300).await;
        samples.push((begun.elapsed(), memory(&server, "VmRSS:")));
    }
    let uses: u64 = using.join_all().await.into_iter().sum();
    let median = |samples: &[(Duration, usize)]| {
        let mut bytes: Vec<usize> = samples.iter().map(|&(_, bytes)| bytes).collect();
        bytes.sort_unstable();
        bytes[bytes.len() / 2]
    };
    let first = samples
        .iter()
        .position(|&(at, _)| at >= warm)
        .expect("it lasts longer");
    let at_first = median(&samples[first..first + SAMPLES]);
    let at_last = median(&samples[samples.len() - SAMPLES..]);
    println!(
        "{uses} uses in {time:?}: {:.1} MiB at first, {:.1} MiB after {warm:?}, {:.1} MiB at the end",
        mib(samples[0].1),
        mib(at_first),
        mib(at_last)
    );
    assert!(at_last <= at_first + MAX_GROWTH, "{samples:?}");
    server.terminate();
}
