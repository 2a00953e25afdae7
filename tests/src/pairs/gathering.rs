//! Holdouts of labelled objects, and valid grasps of them that no score has chosen.

use std::{
    sync::{Arc, atomic::AtomicBool},
    time::Duration,
};

use grasp_assets::{hands::hand, holdouts::holdouts};
use grasp_synthesis::{
    base::mechanisms::{Mechanism, Mechanisms},
    model::{
        grasp::Grasp,
        hand::{Handedness, joints::HandJoints},
        holdout::Holdout,
        receiver::Stance,
        score::{Score, Term},
    },
    physical::scene::Presented,
    propose::prepared::PreparedRig,
    search::{
        find_grasp,
        scene::Task,
        settings::{Query, Run, SearchSettings},
    },
};

use super::{
    catalogue::LabelledObject,
    reasons::{Rules, Verdicts},
};
use crate::{random_holdouts::ClientHoldout, searches::MonotonicClock};

/// Attempts of a search: enough for most objects that a giver holds.
const ATTEMPTS: u64 = 400;

/// Searches for each grasp wanted, after which a holdout has no more.
const SEARCHES_PER_GRASP: u64 = 3;

/// Wrists nearer than this, in metres, with fingers in the same directions are of one grasp.
const SAME_GRASP: f32 = 0.005;

/// A labelled object, held out or free.
#[derive(Clone, Debug)]
pub struct Offer {
    /// The object.
    pub object: Arc<LabelledObject>,
    /// The holdout in the object's frame, to a receiver who faces the giver.
    pub holdout: Holdout,
}

impl Offer {
    /// The object as it usually lies or stands, held by nobody.
    pub fn free(object: &Arc<LabelledObject>) -> Self {
        let up = object.usual_up;
        Self {
            holdout: Holdout::new(Arc::clone(&object.object), None, up).expect("up is a unit vector"),
            object: Arc::clone(object),
        }
    }

    /// The built-in holdouts of the object.
    pub fn built_in(object: &Arc<LabelledObject>) -> Vec<Self> {
        let own = holdouts().iter().filter(|holdout| holdout.object == object.name);
        own.map(|holdout| Self::of_client(object, &ClientHoldout::of_built_in(holdout)))
            .collect()
    }

    fn of_client(object: &Arc<LabelledObject>, held: &ClientHoldout) -> Self {
        Self {
            holdout: held.holdout(Arc::clone(&object.object)),
            object: Arc::clone(object),
        }
    }

    /// The giver's joints in the object's frame.
    pub fn giver_joints(&self) -> Option<&HandJoints> {
        self.holdout.presenting_hand.as_ref()?.shape.joints()
    }
}

/// A valid grasp with its score and what the rules say of it.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// The grasp.
    pub grasp: Grasp,
    /// Its score for a receiver who faces the giver.
    pub score: Score,
    /// What the rules say.
    pub verdicts: Verdicts,
}

/// The hand of all grasps: the right one of an adult.
pub fn receiving_rig() -> &'static PreparedRig {
    &hand("adult", Handedness::Right)
        .expect("the adult rig is built in")
        .rig
}

/// Up to `count` different valid grasps of an offer, each the first of a search of its own from anywhere, with what the rules
/// say of them. Equal for equal arguments.
pub fn gather(pool: &rayon::ThreadPool, offer: &Offer, count: usize, seed: u64) -> Vec<Candidate> {
    let rig = receiving_rig();
    let from_anywhere = Holdout {
        stance: Stance::Any,
        ..offer.holdout.clone()
    };
    let task = Task {
        holdout: &from_anywhere,
        object: &offer.object.prepared,
        rig,
    };
    let receiver = Presented::of(&offer.holdout).receiver;
    let rules = Rules::new(&offer.object, offer.giver_joints(), offer.holdout.up);
    let mut found: Vec<Candidate> = Vec::new();
    for number in 0..count as u64 * SEARCHES_PER_GRASP {
        if found.len() >= count {
            break;
        }
        let settings = settings(seed + number, number % 2 == 0);
        let clock = MonotonicClock::default();
        let outcome = find_grasp(pool, task, &settings, &clock, &AtomicBool::new(false));
        let Some(grasp) = outcome.grasp else { continue };
        let is_new = |other: &Candidate| !is_same(&grasp, &other.grasp);
        if !found.iter().all(is_new) {
            continue;
        }
        let Some(mut score) = grasp.score else { continue };
        score.values[Term::Stance as usize] = receiver.suits(rig, grasp.pose.frame_from_wrist);
        let joints = HandJoints::of_pose(rig, &grasp.pose);
        found.push(Candidate {
            verdicts: rules.verdicts(&joints, &grasp.contacts),
            score,
            grasp,
        });
    }
    found
}

/// A search for any valid grasp. Proposals neither follow a prior nor are the same for every seed; handles may be wrapped.
fn settings(seed: u64, wraps_handles: bool) -> SearchSettings {
    let mut mechanisms = Mechanisms::ALL
        .without(Mechanism::PlacementCache)
        .without(Mechanism::SuccessPrior);
    if !wraps_handles {
        mechanisms = mechanisms.without(Mechanism::Handles);
    }
    SearchSettings {
        query: Query {
            refinement: Duration::ZERO,
            ..Query::default()
        },
        run: Run {
            seed,
            max_attempts: ATTEMPTS,
            mechanisms,
            ..Run::default()
        },
        ..SearchSettings::default()
    }
}

fn is_same(a: &Grasp, b: &Grasp) -> bool {
    let [a, b] = [a, b].map(|grasp| grasp.pose.frame_from_wrist);
    a.position.distance(b.position) < SAME_GRASP
        && a.orientation.dot(b.orientation).abs() > (0.5 * 10.0_f32.to_radians()).cos()
}
