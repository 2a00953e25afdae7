//! Holdouts of labelled objects, and valid grasps of them that no score has chosen.

use std::sync::Arc;

use grasp_assets::{hands::hand, holdouts::holdouts};
use grasp_synthesis::{
    base::{random::AttemptStream, stop::Stop, stopwatch::Stopwatch},
    model::{
        grasp::Grasp,
        hand::{Handedness, joints::HandJoints},
        holdout::Holdout,
        receiver::Stance,
        requirements::Requirements,
        score::{Score, Term},
        strategy::Validity,
    },
    physical::scene::{ObjectScene, Presented},
    propose::{
        handles::{HangingPlaces, wrap_handle},
        prepared::PreparedRig,
        proposal::{ProposalContext, propose_evenly},
    },
    rating::assessment::GraspContext,
    search::attempt::PhysicalAttempt,
};

use super::{
    catalogue::LabelledObject,
    reasons::{Rules, Verdicts},
};
use crate::random_holdouts::ClientHoldout;

/// Every how many attempts one hooks the fingers.
const HOOK_EVERY: u64 = 8;

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
pub fn gather(offer: &Offer, count: usize, seed: u64) -> Vec<Candidate> {
    let rig = receiving_rig();
    let from_anywhere = Holdout {
        stance: Stance::Any,
        ..offer.holdout.clone()
    };
    let finder = Finder::new(&offer.object, Presented::of(&from_anywhere));
    let receiver = Presented::of(&offer.holdout).receiver;
    let rules = Rules::new(&offer.object, offer.giver_joints(), offer.holdout.up);
    let mut found: Vec<Candidate> = Vec::new();
    for number in 0..count as u64 * SEARCHES_PER_GRASP {
        if found.len() >= count {
            break;
        }
        let found_grasp = finder.find(seed + number, number % 2 == 0);
        let Some(grasp) = found_grasp else { continue };
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

/// Finds grasps of an object: any valid ones, from proposals that no prior chooses.
struct Finder<'a> {
    object: &'a LabelledObject,
    presented: Presented,
    hanging_places: HangingPlaces,
    requirements: Requirements,
}

impl<'a> Finder<'a> {
    fn new(object: &'a LabelledObject, presented: Presented) -> Self {
        let pairs = object.prepared.surface_pairs();
        let places = HangingPlaces::of(&object.object, pairs, presented.up, Stop::NEVER);
        Self {
            object,
            hanging_places: places.expect("nothing stops it"),
            presented,
            requirements: Requirements::default(),
        }
    }

    /// The grasp of the first attempt that is valid. Some wrap handles, if they may.
    fn find(&self, seed: u64, wraps_handles: bool) -> Option<Grasp> {
        let rig = receiving_rig();
        let prepared = &self.object.prepared;
        let place = ProposalContext {
            object: prepared.object(),
            surface: prepared.surface_pairs(),
            barriers: self.presented.barriers(),
            chooses: Some(&self.presented),
            rig,
            placements: None,
        };
        let around = GraspContext {
            object: ObjectScene::new(prepared.object(), prepared.friction_under(Validity::Physical)),
            presented: &self.presented,
            rig,
            requirements: &self.requirements,
        };
        let mut attempt = PhysicalAttempt::default();
        (0..ATTEMPTS).find_map(|index| {
            let mut stream = AttemptStream::new(seed, index);
            let special = if index % HOOK_EVERY == HOOK_EVERY - 1 {
                let fits = |wrist| place.palm_fits(wrist);
                self.hanging_places
                    .propose(rig, place.barriers, fits, &mut stream.clone())
            } else if wraps_handles && index % 2 == 0 {
                wrap_handle(&place, &mut stream.clone())
            } else {
                None
            };
            let proposal = special.or_else(|| propose_evenly(&place, &mut stream, Stop::NEVER))?;
            let held = attempt.hold_or_refine(
                &around,
                &proposal,
                &mut stream,
                &mut Stopwatch::off(),
                Stop::NEVER,
            );
            held.ok().map(|grasp| *grasp)
        })
    }
}

fn is_same(a: &Grasp, b: &Grasp) -> bool {
    let [a, b] = [a, b].map(|grasp| grasp.pose.frame_from_wrist);
    a.position.distance(b.position) < SAME_GRASP
        && a.orientation.dot(b.orientation).abs() > (0.5 * 10.0_f32.to_radians()).cos()
}
