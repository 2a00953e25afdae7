//! A studio with hundreds of objects: how long until most calls are answered from atlases, how much memory that takes, and how
//! quick answers are meanwhile. The server has its defaults and saves objects in a folder.
//!
//! The objects are the built-in ones, each stretched by factors of its own; they are requested by a Zipf law, at a steady pace.

use std::{
    fmt::Write as _,
    path::PathBuf,
    time::{Duration, Instant},
};

use glam::Vec3;
use grasp_assets::objects::{BuiltInObject, objects};
use grasp_proto::v1;
use grasp_server::config::StorePlace;
use grasp_synthesis::base::pose::Pose;
use grasp_tests::{
    TestServer,
    random_holdouts::{Givers, PlacedGiver},
};
use rand::{RngExt as _, SeedableRng as _, seq::SliceRandom as _};
use rand_xoshiro::Xoshiro256PlusPlus;
use tokio::task::JoinSet;

use crate::{
    setting::{Answer, Setting, bar, search_times, share, try_send},
    table::{Line, Unit},
};

/// Share of the calls that are to be answered from atlases.
const ANSWERED_FROM_ATLASES: f64 = 0.9;

/// Givers per shape.
const GIVERS: u64 = 12;
const BRIEF_GIVERS: u64 = 1;

/// Lines of the table.
const INTERVALS: u32 = 20;

/// Smallest and largest factor by which an object is stretched along an axis. Givers are placed on the unstretched shape, and
/// with more their hands would sink in or come off.
const STRETCH: [f32; 2] = [0.94, 1.06];

/// Seed of shapes and calls.
const SEED: u64 = 0x5354_5544;

/// Objects, and how often each is requested.
struct Studio<'a> {
    setting: &'a Setting,
    /// The givers of each built-in object.
    givers: Vec<Vec<PlacedGiver>>,
    /// The number of the built-in object, and how it is stretched.
    objects: Vec<(usize, Vec3)>,
    /// The chances of the objects, summed up.
    cumulative: Vec<f64>,
}

/// Measurements of a span of time: its start, the calls, how many were refused, and resident memory at its end.
struct Interval {
    from: Duration,
    answers: Vec<Answer>,
    refused: usize,
    megabytes: f64,
}

/// Creates objects and requests them for some seconds, `rate` times per second.
pub(crate) fn measure(setting: &Setting, count: u32, seconds: u32, rate: u32) -> Vec<Line> {
    let studio = Studio::new(setting, count as usize);
    let folder = Folder(std::env::temp_dir().join(format!("grasp-studio-{}", std::process::id())));
    let server = setting.server(|config| {
        config.builder_threads = 1;
        config.place = StorePlace::Folder(folder.0.clone());
    });
    let before = resident_megabytes();
    let length = Duration::from_secs(seconds.into()) / INTERVALS;
    let (created, with_objects, intervals) = setting.serving.block_on(async {
        let created = studio.create(&server).await;
        let with_objects = resident_megabytes();
        let pace = Duration::from_secs(1) / rate;
        (created, with_objects, studio.ask(&server, pace, length).await)
    });
    setting.stop(server);
    let found = |interval: &Interval| interval.answers.iter().any(|answer| answer.found);
    assert!(intervals.iter().any(found), "no call was answered with a grasp");

    let from_atlases = |interval: &Interval| share(&interval.answers, |answer| answer.from_atlas);
    let later = intervals.iter().rev();
    let answered = later.take_while(|&interval| from_atlases(interval) >= ANSWERED_FROM_ATLASES);
    let answered = match answered.last() {
        Some(first) => format!("from atlases after {:.0} s", first.from.as_secs_f64()),
        None => "not from atlases at the end".to_owned(),
    };
    let creation = Line::of_times("studio, creating an object", created).remark(format!(
        "{count} objects, {rate} calls per second; memory {before:.0} MB before and {with_objects:.0} MB with all objects; nine in \
         ten calls are answered {answered}"
    ));
    let intervals = intervals.iter().map(|interval| {
        let what = format!("studio, from {:.0} s", interval.from.as_secs_f64());
        Line::new(what, Unit::Seconds, search_times(&interval.answers)).remark(format!(
            "{:.1} % from atlases, {:.1} % in 50 ms, {} refused, {:.0} MB",
            100.0 * from_atlases(interval),
            100.0 * share(&interval.answers, Answer::is_in_time),
            interval.refused,
            interval.megabytes
        ))
    });
    [creation].into_iter().chain(intervals).collect()
}

impl<'a> Studio<'a> {
    fn new(setting: &'a Setting, count: usize) -> Self {
        let per_shape = if setting.is_brief { BRIEF_GIVERS } else { GIVERS };
        let givers = |built_in: &BuiltInObject| setting.placed_givers(&built_in.object, per_shape);
        let mut random = Xoshiro256PlusPlus::seed_from_u64(SEED);
        let mut factor = || random.random_range(STRETCH[0]..STRETCH[1]);
        let mut stretched: Vec<(usize, Vec3)> = (0..count)
            .map(|number| (number % objects().len(), Vec3::new(factor(), factor(), factor())))
            .collect();
        stretched.shuffle(&mut random);
        let chances = (1..=count).scan(0.0, |sum, place| {
            *sum += 1.0 / place as f64;
            Some(*sum)
        });
        Self {
            setting,
            givers: objects().iter().map(givers).collect(),
            objects: stretched,
            cumulative: chances.collect(),
        }
    }

    /// Creates all objects; returns how long each took.
    async fn create(&self, server: &TestServer) -> Vec<Duration> {
        let mut client = server.objects().await;
        let bar = bar(self.objects.len(), "creating objects".to_owned());
        let mut took = Vec::new();
        for (place, &(shape, stretch)) in self.objects.iter().enumerate() {
            let object = &objects()[shape].object;
            let mut mesh = String::new();
            for position in object.surface.mesh().positions() {
                let Vec3 { x, y, z } = position * stretch;
                // Writing to a string cannot fail.
                let _ = writeln!(mesh, "v {x} {y} {z}");
            }
            for [a, b, c] in object.surface.mesh().triangles() {
                let _ = writeln!(mesh, "f {} {} {}", a + 1, b + 1, c + 1);
            }
            let mut request = v1::CreateObjectRequest::new(id(place), mesh, object.mass);
            request.object_mut().friction = object.friction;
            let start = Instant::now();
            let created = client.create_object(request).await;
            created.expect("the meshes are sound");
            took.push(start.elapsed());
            bar.inc(1);
        }
        took
    }

    /// Requests the objects at a steady pace, even if answers are late.
    async fn ask(&self, server: &TestServer, pace: Duration, length: Duration) -> Vec<Interval> {
        let client = server.grasps().await;
        let mut random = Xoshiro256PlusPlus::seed_from_u64(SEED);
        let mut ticks = tokio::time::interval(pace);
        let mut calls = JoinSet::new();
        let mut intervals: Vec<Interval> = Vec::new();
        let start = Instant::now();
        let bar = bar(INTERVALS as usize, "asking".to_owned());
        for number in 0..INTERVALS {
            while start.elapsed() < length * (number + 1) {
                ticks.tick().await;
                let request = self.draw(&mut random);
                let mut client = client.clone();
                calls.spawn(async move { (number as usize, try_send(&mut client, request).await) });
            }
            intervals.push(Interval {
                from: length * number,
                answers: Vec::new(),
                refused: 0,
                megabytes: resident_megabytes(),
            });
            bar.inc(1);
        }
        for (number, answer) in calls.join_all().await {
            match answer {
                Ok(answer) => intervals[number].answers.push(answer),
                Err(_) => intervals[number].refused += 1,
            }
        }
        intervals
    }

    /// A request for an object that is drawn by how often each is requested, in the hands of a random giver.
    fn draw(&self, random: &mut Xoshiro256PlusPlus) -> v1::FindGraspRequest {
        let sum = self.cumulative.last().copied().unwrap_or_default();
        let drawn = random.random_range(0.0..sum);
        let place = self.cumulative.partition_point(|&end| end <= drawn);
        let (shape, stretch) = self.objects[place];
        let placed = &self.givers[shape];
        let giver = &placed[random.random_range(0..placed.len())];
        let wrist = giver.object_from_wrist;
        let stretched = PlacedGiver {
            object_from_wrist: Pose::new(wrist.position * stretch, wrist.orientation),
            ..giver.clone()
        };
        let givers = Givers::new(&self.setting.hands, &[stretched]).expect("the hand is one of them");
        givers.draw(random).request(&format!("objects/{}", id(place)))
    }
}

fn id(place: usize) -> String {
    format!("studio-{place}")
}

/// A folder, removed at the end.
struct Folder(PathBuf);

impl Drop for Folder {
    fn drop(&mut self) {
        // A folder left in the temporary directory does no harm.
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Resident memory of this process, client included; 0 where the system does not tell.
fn resident_megabytes() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
    let kibibytes: Option<f64> = line.and_then(|line| line.split_whitespace().next()?.parse().ok());
    kibibytes.unwrap_or(0.0) * 1024.0 / 1e6
}
