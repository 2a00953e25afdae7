//! Objects and givers that move: whether grasps are kept while they are valid, and found where there are any.

use std::{collections::BTreeMap, fmt, time::Duration};

use grasp_proto::v1::{self, CurrentGraspStatus};
use grasp_synthesis::model::hand::joints::HandJoints;
use grasp_tests::{
    TestServer,
    progress::bar,
    random_holdouts::{ClientHoldout, Givers, GivingHand, giving_hands, place},
};
use rand::{RngExt as _, SeedableRng as _};
use rand_xoshiro::Xoshiro256PlusPlus;
use serde::Serialize;

use crate::tracks::{
    RATE,
    nearest::Nearness,
    objects::{HeldObject, real_objects, serve_objects},
    play::{Moving, Tracked, frame, moved},
};

/// Motions per object: each kind with several givers.
const MOTIONS: u64 = 20;

/// Length of a motion, in frames.
const FRAMES: u64 = 900;

/// Time of the search that decides whether there is a grasp for a frame without one.
const EXHAUSTIVE: Duration = Duration::from_secs(2);

/// Frames without a grasp for which that is found out, per motion: the next ones of a motion are alike.
const ASKED_PER_MOTION: usize = 8;

/// What becomes of grasps.
#[derive(Debug, Default, Serialize)]
pub(crate) struct Motions {
    played: usize,
    frames: usize,
    /// Answers by status.
    statuses: BTreeMap<&'static str, usize>,
    /// Grasps that were replaced though they were valid.
    replaced_though_valid: usize,
    /// How near re-plans are.
    nearness: Nearness,
    /// Frames without an answer for which a long search was made, and how often it found a grasp.
    asked: usize,
    missed: usize,
    /// Frames without an answer that are like those, by motion.
    missed_frames: f64,
}

/// Plays all motions with all objects, as fast as answers come.
pub(crate) async fn measure(quick: bool) -> Motions {
    let real = if quick { Vec::new() } else { real_objects() };
    let (server, objects) = serve_objects(&real).await;
    let hands = giving_hands();
    let (count, frames) = if quick { (1, 20) } else { (MOTIONS, FRAMES) };
    let bar = bar(objects.len() * count as usize, "motions".to_owned());
    let mut motions = Motions::default();
    for object in &objects {
        for number in 0..count {
            let mut random = Xoshiro256PlusPlus::seed_from_u64(number);
            let placed = place(&object.object, &hands, number);
            let holdout = Givers::new(&hands, std::slice::from_ref(&placed))
                .expect("there is a giver")
                .draw(&mut random);
            let other = other_pose(&hands, &holdout, &mut random);
            let moving = Moving::ALL[number as usize % Moving::ALL.len()];
            motions
                .play(&server, object, frames, |time| {
                    moved(moving, &holdout, &other, time)
                })
                .await;
            bar.inc(1);
        }
    }
    server.stop().await;
    motions
}

/// Another recorded pose of a giver's hand, with the same wrist.
fn other_pose(hands: &[GivingHand], holdout: &ClientHoldout, random: &mut Xoshiro256PlusPlus) -> HandJoints {
    let same: Vec<&GivingHand> = hands
        .iter()
        .filter(|hand| hand.joints.handedness == holdout.giver.handedness)
        .collect();
    let wrist = |hand: &HandJoints| hand.joints[grasp_synthesis::model::hand::joints::index::WRIST].pose;
    let other = &same[random.random_range(0..same.len())].joints;
    other.transformed(wrist(&holdout.giver) * wrist(other).inverse())
}

impl Motions {
    async fn play(
        &mut self,
        server: &TestServer,
        object: &HeldObject,
        frames: u64,
        at: impl Fn(f32) -> ClientHoldout,
    ) {
        let mut client = server.grasps().await;
        let mut track = Tracked::start(client.clone(), &object.name).await;
        let mut held: Option<v1::Grasp> = None;
        let (mut asked, mut missed, mut without) = (0, 0, 0);
        for sequence in 0..frames {
            let holdout = at((sequence as f64 / RATE) as f32);
            let answer = track.ask(frame(sequence, &holdout)).await;
            let status = answer.status();
            *self.statuses.entry(status.as_str_name()).or_default() += 1;
            if status == CurrentGraspStatus::Replanned
                && let (Some(before), Some(after)) = (&held, &answer.grasp)
            {
                let was_valid = is_valid(&mut client, holdout.request(&object.name), before).await;
                if was_valid {
                    self.replaced_though_valid += 1;
                    let name = &object.name;
                    eprintln!(
                        "{name}, frame {sequence}: replaced though valid, for {:?}",
                        answer.current.and_then(|current| current.failed_check)
                    );
                }
                self.nearness.add(object, &holdout, before, after);
            }
            if status == CurrentGraspStatus::None {
                without += 1;
                if asked < ASKED_PER_MOTION && without % (FRAMES as usize / ASKED_PER_MOTION) == 1 {
                    asked += 1;
                    let request = holdout.request(&object.name).with_budget(EXHAUSTIVE);
                    let found = client.find_grasp(request).await.expect("the request is right");
                    missed += usize::from(found.into_inner().grasp().is_some());
                }
            }
            held = answer.grasp.or(held);
        }
        self.played += 1;
        self.frames += frames as usize;
        self.asked += asked;
        self.missed += missed;
        if asked > 0 {
            self.missed_frames += without as f64 * missed as f64 / asked as f64;
        }
    }
}

/// Whether a grasp is valid, by every check of its own.
async fn is_valid(
    client: &mut v1::grasp_service_client::GraspServiceClient<tonic::transport::Channel>,
    holdout: v1::FindGraspRequest,
    grasp: &v1::Grasp,
) -> bool {
    let hand = grasp.hand.clone().expect("it is set");
    let request = v1::ValidateGraspRequest::from(holdout).with_pose(hand);
    let validated = client
        .validate_grasp(request)
        .await
        .expect("the request is right");
    validated.into_inner().valid
}

impl fmt::Display for Motions {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let statuses: Vec<String> = self
            .statuses
            .iter()
            .map(|(status, count)| {
                format!(
                    "{} {count}",
                    status.trim_start_matches("CURRENT_GRASP_STATUS_").to_lowercase()
                )
            })
            .collect();
        write!(
            f,
            "{} motions, {} frames: {}; {} replaced though valid; {:?}; of {} frames without a grasp, a search of 2 s found one for {}: \
             {:.2} % of all frames with a grasp had an answer",
            self.played,
            self.frames,
            statuses.join(", "),
            self.replaced_though_valid,
            self.nearness,
            self.asked,
            self.missed,
            {
                let answered: usize = [
                    "CURRENT_GRASP_STATUS_KEPT",
                    "CURRENT_GRASP_STATUS_ADJUSTED",
                    "CURRENT_GRASP_STATUS_REPLANNED",
                ]
                .iter()
                .filter_map(|status| self.statuses.get(status))
                .sum();
                100.0 * answered as f64 / (answered as f64 + self.missed_frames)
            }
        )
    }
}
