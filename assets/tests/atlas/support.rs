//! Atlases that several tests use.

use std::{sync::Arc, time::Duration};

use glam::Vec3;
use grasp_assets::{atlases, hands, objects};
use grasp_synthesis::{
    base::clock::Clock,
    known::{
        atlas::Atlas,
        codec::decode,
        grips::Grips,
        growth::{Grown, Growth},
        recent_grips::RecentGrips,
        seed_source::SeedSource,
    },
    base::mechanisms::Mechanisms,
    model::{
        bend_ratios::BendRatioChoice,
        constraints::Constraints,
        hand::{Handedness, joints::HandJoints, rig::Rig},
        holdout::{Holdout, PresentingHand},
        object::GraspObject,
        strategy::{Choice, Strategy, Validity},
    },
    physical::{
        grip::{GIVER_CLEARANCE, Gripper},
        scene::Presented,
        solids::{HandSolids, TrackedSolids},
    },
    search::settings::SearchSettings,
};

/// Where the grips of the built-in scissors are asked about as if they were givers'.
pub(crate) const UP: Vec3 = Vec3::Y;

/// What comes with the server for the built-in scissors.
pub(crate) fn known() -> Arc<Atlas> {
    let rig = adult(Handedness::Right);
    let bytes = atlases::atlas("scissors", rig).expect("it is shipped");
    decode(bytes, object("scissors"), rig)
        .expect("it is today's")
        .atlas
}

/// Some of the known grips. Of all, nearly every known grip that is a giver leaves some whole.
pub(crate) fn few_of(known: &Atlas) -> Arc<Atlas> {
    let few = known.entries().iter().step_by(90).cloned().collect();
    let rig = adult(Handedness::Right);
    Arc::new(Atlas::new(object("scissors"), rig, Grips::new(rig, few), true))
}

/// The scissors in the hand of a known grip.
pub(crate) fn held_out(known: &Atlas, grip: usize) -> Holdout {
    let pose = &known.entries()[grip].grip.pose;
    let giver = HandJoints::of_pose(adult(Handedness::Right), pose);
    scissors(Some(PresentingHand::of_joints(giver)))
}

/// The scissors, in a hand or afloat.
pub(crate) fn scissors(giver: Option<PresentingHand>) -> Holdout {
    let scissors = Arc::clone(&objects::object("scissors").expect("they are built in").object);
    Holdout::new(scissors, giver, UP).expect("up is a unit vector")
}

/// Known grips that are givers of whom at most `most` keep clear.
pub(crate) fn tight_givers(known: &Atlas, most: usize) -> Vec<usize> {
    let free_of = |grip: usize| {
        let giver = Presented::of(&held_out(known, grip)).giver.expect("there is one");
        let entries = known.entries().iter();
        entries
            .filter(|entry| {
                let (rig, pose) = (adult(Handedness::Right), &entry.grip.pose);
                let solids = HandSolids::of_pose(rig, pose);
                let told = TrackedSolids::of_rig(rig, pose.frame_from_wrist, &solids);
                giver.clearance(&told, GIVER_CLEARANCE).is_some()
            })
            .take(most + 1)
            .count()
    };
    (0..known.entries().len())
        .step_by(40)
        .filter(|&grip| free_of(grip) <= most)
        .collect()
}

/// Searches without a deadline ask for no time.
pub(crate) struct NoClock;

impl Clock for NoClock {
    fn now(&self) -> Duration {
        Duration::ZERO
    }
}

/// A search that comes to the same whenever it is run, of one worker, without known grips and without attempts.
pub(crate) fn reproducible(holdout: &Holdout) -> SearchSettings {
    SearchSettings {
        seed: 5,
        strategy: Strategy::Guided,
        validity: Validity::Physical,
        bend_ratios: BendRatioChoice::OneRandom,
        friction: holdout.object.friction_under(Validity::Physical),
        constraints: Constraints::default(),
        choice: Choice::FirstValid,
        atlas: None,
        starts: SeedSource::Nothing,
        recent: RecentGrips::default(),
        known_tried: 0,
        reproducible: true,
        first_attempt: 0,
        max_attempts: 0,
        deadline: None,
        workers: 1,
        record_step_times: false,
        mechanisms: Mechanisms::ALL,
    }
}

pub(crate) fn object(name: &str) -> &'static GraspObject {
    &objects::object(name).expect("it is built in").object
}

pub(crate) fn adult(handedness: Handedness) -> &'static Rig {
    &hands::hand("adult", handedness).expect("it is built in").rig
}

/// What grows in some rounds.
pub(crate) fn grown(mut growth: Growth<'_>, rounds: usize) -> Grown {
    let mut gripper = Gripper::default();
    for _ in 0..rounds {
        growth.round(&mut gripper);
    }
    growth.grown()
}
