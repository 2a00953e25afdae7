//! Pairs of valid grasps of one holdout: one that people would plausibly choose, and one that they would not.
//!
//! The score decides which valid grasp is answered, by weights that are the project's choice. Pairs check them: rules of their own,
//! which read joints, contacts and the named parts of objects but no term of the score, say which of two grasps is implausible and why,
//! and the plausible one should score higher.

mod rules;

use std::sync::Arc;

use glam::{DVec3, Vec3};
use grasp_assets::{hands::hand, holdouts::holdouts};
use grasp_everyday::everyday_objects;
use grasp_import::{Import, MeshLimits, read_mesh};
use grasp_synthesis::{
    base::{random::AttemptStream, stop::Stop, stopwatch::Stopwatch},
    model::{
        grasp::Grasp,
        hand::{Handedness, joints::HandJoints},
        holdout::Holdout,
        object::GraspObject,
        receiver::Stance,
        requirements::Requirements,
        score::{Score, Term},
        strategy::Validity,
    },
    physical::scene::{ObjectScene, Presented},
    propose::{
        handles::wrap_handle,
        hooks::HangingPlaces,
        prepared::{PreparedObject, PreparedRig},
        proposal::{ProposalContext, propose_evenly},
    },
    rating::assessment::GraspContext,
    search::physical_attempt::PhysicalAttempt,
};
use rand::{RngExt as _, SeedableRng as _};
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;

use crate::random_holdouts::ClientHoldout;
use rules::{REASONS, Reason, Rules, Verdicts};

/// The objects of which pairs are made, few enough for a test: their names, the groups of their meshes that are handles, and
/// those that cut.
const OBJECTS: [(&str, &[&str], &[&str]); 8] = [
    ("hammer", &["handle"], &[]),
    ("pan", &["handle"], &[]),
    ("kettle", &["handle"], &[]),
    ("kitchen-knife", &["handle"], &["blade"]),
    ("large-bottle", &[], &[]),
    ("ruler", &[], &[]),
    ("remote", &[], &[]),
    ("scalpel", &[], &["blade_edge"]),
];

/// What a triangle of an object belongs to.
#[derive(Clone, Copy, PartialEq)]
enum Label {
    Plain,
    /// Where people hold it.
    Handle,
    /// What cuts.
    Blade,
}

/// An object with labelled parts. None of them is forbidden, so that grasps of all of them are valid.
struct LabelledObject {
    name: &'static str,
    object: Arc<GraspObject>,
    prepared: PreparedObject,
    /// The direction against gravity of the object as it usually lies or stands, in its own frame.
    usual_up: Vec3,
    /// One label for each triangle.
    labels: Vec<Label>,
}

impl LabelledObject {
    /// A built-in or everyday object, with labels for these groups of its mesh.
    fn new(name: &'static str, handles: &[&str], blades: &[&str]) -> Self {
        let (obj, mass, centre, friction, usual_up) = match grasp_assets::objects::object(name) {
            // They lie flat: +Z points out of a flat side.
            Some(built_in) => {
                let about = &built_in.object;
                let centre = Some(about.centre_of_mass);
                (built_in.obj.to_vec(), about.mass, centre, about.friction, Vec3::Z)
            }
            None => {
                let everyday = everyday_objects().into_iter().find(|object| object.name == name);
                let everyday = everyday.unwrap_or_else(|| panic!("there is no {name}"));
                let centre = everyday.centre_of_mass().map(DVec3::as_vec3);
                let friction = Some(everyday.surface.friction() as f32);
                (
                    everyday.obj(),
                    everyday.mass_kg() as f32,
                    centre,
                    friction,
                    Vec3::Y,
                )
            }
        };
        let limits = MeshLimits {
            bytes: 1 << 24,
            vertices: 1 << 20,
            triangles: 1 << 20,
        };
        let read = read_mesh(&obj, Import::METRES, limits).expect("the project's meshes are sound");
        let mut labels = vec![Label::Plain; read.mesh.triangles().len()];
        for (groups, label) in [(handles, Label::Handle), (blades, Label::Blade)] {
            for &group in groups {
                let found = read.groups.iter().find(|(name, _)| name == group);
                let (_, triangles) = found.unwrap_or_else(|| panic!("{name} has no group {group}"));
                for &triangle in triangles {
                    labels[triangle as usize] = label;
                }
            }
        }
        let centre = centre
            .or_else(|| read.mesh.volume_centroid())
            .expect("it has a volume");
        let object = Arc::new(GraspObject::new(read.mesh, mass, centre, friction, &[]).expect("it is sound"));
        Self {
            name,
            prepared: PreparedObject::new(Arc::clone(&object)),
            object,
            usual_up,
            labels,
        }
    }

    /// The corners of the triangles that belong to a part.
    fn triangles_of(&self, part: Label) -> impl Iterator<Item = [Vec3; 3]> {
        let labels = self.labels.iter().enumerate();
        labels
            .filter(move |(_, label)| **label == part)
            .map(|(triangle, _)| self.object.surface.mesh().corners(triangle))
    }

    fn has(&self, part: Label) -> bool {
        self.labels.contains(&part)
    }
}

/// Every how many attempts one hooks the fingers.
const HOOK_EVERY: u64 = 8;

/// Attempts of a search: enough for most objects that a giver holds.
const ATTEMPTS: u64 = 400;

/// Searches for each grasp wanted, after which a holdout has no more.
const SEARCHES_PER_GRASP: u64 = 3;

/// Wrists nearer than this, in metres, with fingers in the same directions are of one grasp.
const SAME_GRASP: f32 = 0.005;

/// A valid grasp with its score for a receiver who faces the giver, and what the rules say of it.
struct Candidate {
    grasp: Grasp,
    score: Score,
    verdicts: Verdicts,
}

/// The hand of all grasps: the right one of an adult.
fn receiving_rig() -> &'static PreparedRig {
    &hand("adult", Handedness::Right)
        .expect("the adult rig is built in")
        .rig
}

/// Up to `count` different valid grasps of a holdout, each the first of a search of its own from anywhere, with what the rules
/// say of them. Equal for equal arguments.
fn gather(object: &LabelledObject, holdout: &Holdout, count: usize, seed: u64) -> Vec<Candidate> {
    let rig = receiving_rig();
    let from_anywhere = Holdout {
        stance: Stance::Any,
        ..holdout.clone()
    };
    let finder = Finder::new(object, Presented::of(&from_anywhere));
    let receiver = Presented::of(holdout).receiver;
    let giver = holdout
        .presenting_hand
        .as_ref()
        .and_then(|hand| hand.shape.joints());
    let rules = Rules::new(object, giver, holdout.up);
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

/// Most pairs of one reason and object, so that no object dominates.
const MAX_PER_REASON: usize = 6;

/// The grasps gathered of a holdout.
struct Gathered {
    object: usize,
    candidates: Vec<Candidate>,
}

/// A plausible and an implausible grasp of one holdout.
#[derive(Clone, Copy)]
struct Pair<'a> {
    object: usize,
    plausible: &'a Candidate,
    implausible: &'a Candidate,
    reason: Reason,
}

impl Pair<'_> {
    /// How much higher the plausible grasp scores.
    fn margin(&self) -> f32 {
        self.plausible.score.total() - self.implausible.score.total()
    }
}

/// Pairs of all holdouts, at most [`MAX_PER_REASON`] of one reason and object, in the order of reasons and objects. Equal for
/// equal arguments.
fn pairs(all: &[Gathered], seed: u64) -> Vec<Pair<'_>> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let objects = all.iter().map(|gathered| gathered.object + 1).max().unwrap_or(0);
    let mut drawn = Vec::new();
    for reason in REASONS {
        for object in 0..objects {
            let own = all.iter().filter(|gathered| gathered.object == object);
            let mut possible: Vec<Pair<'_>> = own.flat_map(|gathered| possible(gathered, reason)).collect();
            for _ in 0..MAX_PER_REASON.min(possible.len()) {
                drawn.push(possible.swap_remove(random.random_range(0..possible.len())));
            }
        }
    }
    drawn
}

/// All pairs of a holdout and a reason.
fn possible(gathered: &Gathered, reason: Reason) -> Vec<Pair<'_>> {
    let of = |is: &dyn Fn(&Verdicts) -> bool| -> Vec<&Candidate> {
        gathered
            .candidates
            .iter()
            .filter(|candidate| is(&candidate.verdicts))
            .collect()
    };
    let plausible = of(&Verdicts::are_plausible);
    let implausible = of(&|verdicts| verdicts.only_reason() == Some(reason));
    let pair = |implausible, plausible| Pair {
        object: gathered.object,
        plausible,
        implausible,
        reason,
    };
    let pairs = implausible
        .into_iter()
        .flat_map(|one| plausible.iter().map(move |other| pair(one, other)));
    pairs.collect()
}

/// Grasps of each object.
const GRASPS: usize = 16;

/// Least share of the pairs that the weights have to rank right.
const MIN_SHARE_RIGHT: f32 = 0.75;

#[test]
fn weights_rank_most_pairs_right() {
    let objects = OBJECTS.map(|(name, handles, blades)| LabelledObject::new(name, handles, blades));
    let mut offers: Vec<(usize, Holdout)> = Vec::new();
    for (number, object) in objects.iter().enumerate() {
        let free = Holdout::new(Arc::clone(&object.object), None, object.usual_up);
        offers.push((number, free.expect("up is a unit vector")));
        let held = holdouts()
            .iter()
            .filter(|holdout| holdout.object == object.name)
            .take(2);
        offers.extend(held.map(|holdout| {
            let holdout = ClientHoldout::of_built_in(holdout);
            (number, holdout.holdout(Arc::clone(&object.object)))
        }));
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
    let all: Vec<Gathered> = pool.install(|| {
        let gathered = offers.par_iter().map(|(object, holdout)| Gathered {
            object: *object,
            candidates: gather(&objects[*object], holdout, GRASPS, 1),
        });
        gathered.collect()
    });
    let drawn = pairs(&all, 1);
    let dump: String = drawn
        .iter()
        .map(|pair| {
            let terms =
                |candidate: &Candidate| candidate.score.values.map(|value| value.to_string()).join(",");
            format!(
                "{},{:?},{},{}\n",
                objects[pair.object].name,
                pair.reason,
                terms(pair.plausible),
                terms(pair.implausible)
            )
        })
        .collect();
    std::fs::write("/tmp/tstv/pairs.csv", dump).unwrap();
    assert!(drawn.len() >= 40, "{} pairs", drawn.len());
    let wrong = drawn.iter().filter(|pair| pair.margin() <= 0.0);
    let wrong: Vec<String> = wrong
        .map(|pair| {
            format!(
                "{}, {:?}: {:.3}",
                objects[pair.object].name,
                pair.reason,
                pair.margin()
            )
        })
        .collect();
    let right = 1.0 - wrong.len() as f32 / drawn.len() as f32;
    assert!(
        right >= MIN_SHARE_RIGHT,
        "{right} of {} pairs are right; wrong are:\n{}",
        drawn.len(),
        wrong.join("\n")
    );
}
