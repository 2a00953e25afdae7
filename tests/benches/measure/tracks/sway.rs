//! Givers whose hands sway at the object, as those of people do: how often the grasp changes, and whether frames have one.

use std::{fmt, time::Duration};

use glam::Vec3;
use grasp_proto::v1::CurrentGraspStatus;
use grasp_synthesis::base::pose::Pose;
use grasp_tests::{
    progress::bar,
    random_holdouts::{ClientHoldout, Givers, giving_hands, place},
};
use rand::{RngExt as _, SeedableRng as _};
use rand_xoshiro::Xoshiro256PlusPlus;
use serde::Serialize;

use crate::tracks::{
    RATE,
    objects::serve_objects,
    play::{Tracked, frame},
};

/// What is held out.
const OBJECTS: [&str; 3] = ["objects/remote", "objects/scissors", "objects/osim-mug"];

/// Recorded hands that hold each of them.
const GIVERS: u64 = 10;

/// Length of a motion, in frames.
const FRAMES: u64 = 720;

/// How far the hand sways in each direction, and how far off it is tracked, in metres.
const SWAY: f32 = 0.008;
const NOISE: f32 = 0.0005;

/// How often per second it sways along each axis.
const PER_SECOND: [f32; 3] = [5.0, 3.9, 3.0];

/// Time of the search that decides whether there is a grasp for a frame without one.
const EXHAUSTIVE: Duration = Duration::from_secs(2);

/// Every how many frames without a grasp that is found out.
const EVERY: usize = 10;

/// What becomes of the grasps of an object.
#[derive(Debug, Serialize)]
pub(crate) struct Sway {
    object: &'static str,
    /// Re-plans after the first grasp, for each giver that leaves one.
    replans: Vec<usize>,
    /// Those of them to the other hand.
    to_other_hand: usize,
    frames: usize,
    without: usize,
    /// Of those, for how many the same hand, or either, has a grasp.
    missed: usize,
    missed_by_either: usize,
    /// Frames whose grasp was kept by its grace.
    in_grace: usize,
}

/// Plays all motions.
pub(crate) async fn measure(quick: bool) -> Vec<Sway> {
    let real: &[&str] = if quick { &[] } else { &["osim_mug"] };
    let (server, objects) = serve_objects(real).await;
    let hands = giving_hands();
    let (givers, frames) = if quick { (1, 20) } else { (GIVERS, FRAMES) };
    let names: Vec<&'static str> = OBJECTS
        .into_iter()
        .filter(|name| objects.iter().any(|object| object.name == *name))
        .collect();
    let bar = bar(names.len() * givers as usize, "swaying givers".to_owned());
    let mut swayed = Vec::new();
    for name in names {
        let object = objects.iter().find(|object| object.name == name);
        let object = &object.expect("it is served").object;
        let mut sway = Sway {
            object: name,
            replans: Vec::new(),
            to_other_hand: 0,
            frames: 0,
            without: 0,
            missed: 0,
            missed_by_either: 0,
            in_grace: 0,
        };
        for number in 0..givers {
            let mut random = Xoshiro256PlusPlus::seed_from_u64(number);
            let placed = place(object, &hands, number);
            let holdout = Givers::new(&hands, std::slice::from_ref(&placed))
                .expect("there is a giver")
                .draw(&mut random);
            sway.play(&server, &holdout, frames, &mut random).await;
            bar.inc(1);
        }
        swayed.push(sway);
    }
    server.stop().await;
    swayed
}

/// A holdout whose giver has swayed to where it is at a time.
fn swayed(holdout: &ClientHoldout, sequence: u64, random: &mut Xoshiro256PlusPlus) -> ClientHoldout {
    let time = (sequence as f64 / RATE) as f32;
    let axis = |place: usize| (std::f32::consts::TAU * (PER_SECOND[place] * time + 0.2 * place as f32)).sin();
    let mut noise = || NOISE * 3_f32.sqrt() * random.random_range(-1.0..1.0_f32);
    let noise = Vec3::new(noise(), noise(), noise());
    let way = SWAY * Vec3::new(axis(0), axis(1), axis(2)) + noise;
    ClientHoldout {
        giver: holdout.giver.transformed(Pose::from_position(way)),
        ..holdout.clone()
    }
}

impl Sway {
    async fn play(
        &mut self,
        server: &grasp_tests::TestServer,
        holdout: &ClientHoldout,
        frames: u64,
        random: &mut Xoshiro256PlusPlus,
    ) {
        let mut client = server.grasps().await;
        let mut track = Tracked::start(client.clone(), self.object).await;
        let (mut hand, mut replans, mut without) = (None, 0, 0);
        for sequence in 0..frames {
            let holdout = swayed(holdout, sequence, random);
            let answer = track.ask(frame(sequence, &holdout)).await;
            let current = answer.current.expect("it is set");
            match current.status() {
                CurrentGraspStatus::Replanned if hand.is_some() => replans += 1,
                CurrentGraspStatus::Kept => self.in_grace += usize::from(current.failed_check.is_some()),
                CurrentGraspStatus::None => {
                    without += 1;
                    if without % EVERY == 1 {
                        let request = holdout.request(self.object).with_budget(EXHAUSTIVE);
                        let found = client.find_grasp(request.clone()).await;
                        let found = found.expect("the request is right").into_inner();
                        self.missed_by_either += EVERY * usize::from(found.grasp().is_some());
                        let request = request.receiving(hand.unwrap_or_default());
                        let found = client.find_grasp(request).await;
                        let found = found.expect("the request is right").into_inner();
                        self.missed += EVERY * usize::from(found.grasp().is_some());
                    }
                }
                _ => {}
            }
            if let Some(grasp) = answer.grasp {
                let posed = grasp.hand.expect("it is set").handedness();
                self.to_other_hand += usize::from(hand.is_some_and(|hand| hand != posed));
                hand = Some(posed);
            }
        }
        self.frames += frames as usize;
        self.without += without;
        if hand.is_some() {
            self.replans.push(replans);
        }
    }
}

impl fmt::Display for Sway {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            object,
            replans,
            to_other_hand,
            frames,
            without,
            missed,
            missed_by_either,
            in_grace,
        } = self;
        write!(
            f,
            "{object}, a hand that sways by {:.0} mm for {:.0} s: re-plans {replans:?}, {to_other_hand} to the other hand; of {frames} frames, \
             {in_grace} kept a grasp by its grace and {without} had none, of which the same hand had one in about {missed}, either in \
             {missed_by_either}",
            1e3 * SWAY,
            FRAMES as f64 / RATE,
        )
    }
}
