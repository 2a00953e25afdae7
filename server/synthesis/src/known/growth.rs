//! How an atlas grows: rounds of proposals, half of them new and half beside grips that are known, and a limit on how
//! many grips may be alike (`spread.rs`), of which the better ones stay.
//!
//! Every other round has a giver: one of the known grips is taken for the hand that holds the object out, and grips are
//! looked for that keep clear of it. So the atlas comes to answer where a giver leaves little room.
//!
//! A round's proposals depend on the rounds before and on nothing else, and what comes of them is taken over in their
//! order, so that an atlas is the same however many threads make it and whenever they are interrupted.

use std::{cmp::Reverse, sync::Arc};

use glam::Vec3;

use super::{
    atlas::{Atlas, stamp},
    entry::Entry,
    grips::Grips,
    seeds::Seeds,
    spread::{Cell, Room, Spread, worth},
};
use crate::{
    base::mechanisms::Mechanisms,
    base::{random::AttemptStream, stopwatch::NoStopwatch},
    model::{
        hand::{joints::HandJoints, rig::Rig},
        object::GraspObject,
        score::Score,
        strategy::Validity,
    },
    physical::{
        grip::{Gripper, clear_of_giver},
        scene::{ObjectScene, Presented},
        shape::{HandShape, Proposal},
        solids::{PreparedHand, TrackedSolids},
    },
    propose::{
        prepared::{PreparedObject, PreparedRig},
        proposal::{ProposalContext, propose_evenly},
        surface_pairs::SurfacePairs,
    },
    rating::{scoring::grip_values, taxonomy::classify},
};

/// Grips of a complete atlas. More leave more to choose from, and take more memory (some 1.2 kilobytes each) and time.
pub const ENTRIES: usize = 8192;

/// Proposals of a round.
pub const ROUND: u64 = 64;

/// Proposals after which an atlas is complete even with fewer grips: an object that cannot be held must not be worked on
/// forever. With half as many, atlases of thin objects are not filled.
pub const MOST_PROPOSALS: u64 = 400_000;

/// Proposals after which an atlas is stamped: what grows otherwise now shows there, after two seconds instead of minutes. With
/// fewer, no round has had a giver yet.
pub const EARLY_PROPOSALS: u64 = 96 * ROUND;

/// The seed of all atlases.
const SEED: u64 = 0x4154_4c41;

/// Share of proposals beside known grips, once there are any: they succeed ten times as often as new ones, which find
/// what is not known yet.
const PERTURBED_SHARE: f32 = 0.5;

/// The seed of the choice of givers.
const GIVERS_SEED: u64 = 0x4749_5645;

/// Grips from which on some are taken for givers.
const ENOUGH_FOR_GIVERS: usize = 256;

/// A giver that this many grips keep clear of leaves enough, whatever gravity does to them; for one that leaves fewer,
/// grips are kept even where others are like them.
const ENOUGH_FREE: usize = 60;

/// How often a grip of a crowded cell is drawn again at most.
const REDRAWS: usize = 8;

/// What has grown so far, and all that it takes to go on.
#[derive(Clone, Debug, PartialEq)]
pub struct Grown {
    /// The grips.
    pub atlas: Arc<Atlas>,
    /// The shape that each grip was closed from.
    pub(super) shapes: Vec<HandShape>,
    /// Proposals that were tried.
    pub(super) proposed: u64,
    /// The atlas' stamp after the first [`EARLY_PROPOSALS`]; 0 before.
    pub(super) early_stamp: u64,
}

impl Grown {
    /// The atlas' stamp after the first [`EARLY_PROPOSALS`]; 0 before. Growth that differs has another.
    pub fn early_stamp(&self) -> u64 {
        self.early_stamp
    }

    /// How many proposals were tried; 0 if these are the listed grips of another atlas.
    pub fn proposed(&self) -> u64 {
        self.proposed
    }

    /// The grips of its shortlists alone, as an incomplete atlas: nearly every giver leaves some of these few free. The
    /// atlas itself cannot be grown from them: growth would start over at its first proposal.
    #[must_use]
    pub fn listed(&self, object: &GraspObject, rig: &Rig) -> Self {
        let places: Vec<usize> = self.atlas.listed().map(usize::from).collect();
        let entries = places.iter().map(|&place| self.atlas.entries()[place].clone());
        let grips = Grips::new(rig, entries.collect());
        Self {
            atlas: Arc::new(Atlas::new(object, rig, grips, false)),
            shapes: places.iter().map(|&place| self.shapes[place]).collect(),
            proposed: 0,
            early_stamp: self.early_stamp,
        }
    }

    /// Bytes that it takes in memory.
    pub fn bytes(&self) -> usize {
        self.atlas.bytes() + size_of_val(self.shapes.as_slice())
    }
}

/// What a proposal gave.
type Found = Option<(Entry, HandShape)>;

/// A grip that is taken for the giver's.
#[derive(Debug)]
struct Giver {
    presented: Presented,
    surface: SurfacePairs,
    /// Known grips that it is nearly clear of, if there is need of more that keep clear of it.
    seeds: Option<Seeds>,
}

impl Giver {
    /// Is there need of grips that keep clear of it?
    fn is_needy(&self) -> bool {
        self.seeds.is_some()
    }
}

/// An atlas in the making.
#[derive(Debug)]
pub struct Growth<'a> {
    scene: ObjectScene<'a>,
    prepared: &'a PreparedObject,
    rig: &'a PreparedRig,
    grips: Grips,
    shapes: Vec<HandShape>,
    spread: Spread,
    proposed: u64,
    early_stamp: u64,
}

impl<'a> Growth<'a> {
    /// An empty atlas of an object, under its own friction, and a rig.
    pub fn new(object: &'a PreparedObject, rig: &'a PreparedRig) -> Self {
        Self {
            scene: ObjectScene::new(object.object(), object.friction_under(Validity::Physical)),
            prepared: object,
            rig,
            grips: Grips::default(),
            shapes: Vec::new(),
            spread: Spread::default(),
            proposed: 0,
            early_stamp: 0,
        }
    }

    /// Goes on from what grew for the same object and rig, if it is not complete: what comes of it is the same as without an
    /// interruption.
    pub fn resume(object: &'a PreparedObject, rig: &'a PreparedRig, grown: &Grown) -> Self {
        let mut growth = Self::new(object, rig);
        growth.proposed = grown.proposed;
        growth.early_stamp = grown.early_stamp;
        for (entry, shape) in grown.atlas.entries().iter().zip(&grown.shapes) {
            growth.push(entry.clone(), *shape);
        }
        growth
    }

    /// How many grips there are.
    pub fn len(&self) -> usize {
        self.grips.entries().len()
    }

    /// True if there is no grip yet.
    pub fn is_empty(&self) -> bool {
        self.grips.entries().is_empty()
    }

    /// How many proposals were tried.
    pub fn proposed(&self) -> u64 {
        self.proposed
    }

    /// True if there is nothing left to do.
    pub fn is_complete(&self) -> bool {
        self.len() >= ENTRIES || self.proposed >= MOST_PROPOSALS
    }

    /// The atlas as it stands.
    pub fn atlas(&self) -> Atlas {
        Arc::unwrap_or_clone(self.grown().atlas)
    }

    /// What has grown so far. When nothing more is going to, grips that score most come first: then those that are tried
    /// first, whatever gravity's direction, lie side by side in memory.
    pub fn grown(&self) -> Grown {
        let is_complete = self.is_complete();
        let (grips, shapes) = if is_complete {
            self.by_score()
        } else {
            (self.grips.clone(), self.shapes.clone())
        };
        Grown {
            atlas: Arc::new(Atlas::new(self.scene.object, self.rig, grips, is_complete)),
            shapes,
            proposed: self.proposed,
            early_stamp: self.early_stamp,
        }
    }

    /// Grips and shapes by falling sum of the grips' scores under all directions of gravity; of equal ones, what was found
    /// first.
    fn by_score(&self) -> (Grips, Vec<HandShape>) {
        let entries = self.grips.entries();
        let mut order: Vec<usize> = (0..entries.len()).collect();
        order.sort_by_key(|&index| {
            let scores = entries[index].scores.iter();
            Reverse(scores.map(|&score| u32::from(score)).sum::<u32>())
        });
        let entries = order.iter().map(|&index| entries[index].clone()).collect();
        let shapes = order.iter().map(|&index| self.shapes[index]).collect();
        (Grips::new(self.rig, entries), shapes)
    }

    /// One round: some milliseconds.
    pub fn round(&mut self, gripper: &mut Gripper) {
        let giver = self.giver();
        let found: Vec<Found> = (self.proposed..self.proposed + ROUND)
            .map(|index| self.try_proposal(index, giver.as_ref(), gripper))
            .collect();
        self.proposed += ROUND;
        let is_needy = giver.as_ref().is_some_and(Giver::is_needy);
        for (entry, shape) in found.into_iter().flatten() {
            self.take(entry, shape, is_needy);
        }
        if self.proposed == EARLY_PROPOSALS {
            self.early_stamp = stamp(self.grips.entries());
        }
    }

    /// The giver of this round, if it has one.
    fn giver(&self) -> Option<Giver> {
        let round = self.proposed / ROUND;
        if self.len() < ENOUGH_FOR_GIVERS || round.is_multiple_of(2) {
            return None;
        }
        let mut stream = AttemptStream::new(GIVERS_SEED, round);
        let pose = &self.grips.entries()[self.draw(&mut stream)].grip.pose;
        let hand = PreparedHand::new(&TrackedSolids::of_joints(&HandJoints::of_pose(self.rig, pose)));
        let all = 0..self.len() as u16;
        let seeds = if self.count_free(&hand) < ENOUGH_FREE {
            Seeds::of(&self.grips, self.rig, all, Some(&hand), || false)
        } else {
            None
        };
        Some(Giver {
            surface: self.prepared.surface_pairs().free_of(&hand),
            presented: Presented {
                giver: Some(hand),
                giver_palm: None,
                up: Vec3::Y,
            },
            seeds,
        })
    }

    /// How many grips keep clear of a giver's hand, up to enough.
    fn count_free(&self, giver: &PreparedHand) -> usize {
        let is_free = |&entry: &usize| {
            let solids = self.grips.unless_met(entry, self.rig, giver);
            solids.is_some_and(|solids| clear_of_giver(&solids, Some(giver)).is_some())
        };
        (0..self.len()).filter(is_free).take(ENOUGH_FREE).count()
    }

    fn try_proposal(&self, index: u64, giver: Option<&Giver>, gripper: &mut Gripper) -> Found {
        let mut stream = AttemptStream::new(SEED, index);
        let proposal = self.propose(giver, &mut stream)?;
        let presented = giver.map(|giver| &giver.presented);
        let (grip, solids) = gripper
            .grip(
                &self.scene,
                self.rig,
                &proposal,
                presented,
                &mut NoStopwatch,
                &|| false,
            )
            .ok()?;
        // What comes next takes longest: what is crowded out anyhow is dropped before.
        let is_needy = giver.is_some_and(Giver::is_needy);
        let contacts = &gripper.contacts;
        let classification = classify(self.rig, &grip.pose, contacts);
        let values = grip_values(
            &self.scene,
            self.rig,
            &grip.pose,
            contacts,
            classification,
            grip.epsilon,
            &solids,
        );
        let cell = Cell::of(self.rig, &grip.pose, contacts);
        if !is_needy && self.spread.room(cell, Score { values }.grip_total()) == Room::Crowded {
            return None;
        }
        let entry = Entry::new(&self.scene, self.rig, grip, &solids, gripper);
        Some((entry, proposal.shape))
    }

    fn propose(&self, giver: Option<&Giver>, stream: &mut AttemptStream) -> Option<Proposal> {
        let is_beside = !self.is_empty() && stream.unit() < PERTURBED_SHARE;
        let place = ProposalContext {
            object: self.scene.object,
            surface: giver.map_or(self.prepared.surface_pairs(), |giver| &giver.surface),
            giver: giver.and_then(|giver| giver.presented.giver.as_ref()),
            rig: self.rig,
            placements: None,
            mechanisms: Mechanisms::ALL,
        };
        match giver.map(|giver| &giver.seeds) {
            Some(Some(seeds)) if is_beside => seeds.propose_evenly(self.grips.entries(), &place, stream),
            None if is_beside => Some(self.perturbed_known(stream)),
            // Beside a giver who leaves enough, most known grips are of no use.
            _ => propose_evenly(&place, stream, &|| false),
        }
    }

    /// One of the grips, those of crowded cells no more likely than others: givers and hands like what is known in plenty
    /// find nothing new. Of 1,600 holdouts of the built-in scalpel with 400 recorded givers, atlases that were grown so
    /// left 4.3 to 5.6 % without an answer in 50 ms (five), and 4.7 to 7.4 % with half the proposals (nine, of three to eight
    /// grips a cell); without, 5.6 to 6.4 % with three a cell (four), and 6.8 to 8.1 % with eight (three).
    fn draw(&self, stream: &mut AttemptStream) -> usize {
        let mut index = stream.below(self.len());
        for _ in 0..REDRAWS {
            let entry = &self.grips.entries()[index];
            let cell = Cell::of(self.rig, &entry.grip.pose, &entry.contacts);
            if stream.unit() * (self.spread.alike(cell) as f32) < 1.0 {
                break;
            }
            index = stream.below(self.len());
        }
        index
    }

    /// A hand beside a known grip.
    fn perturbed_known(&self, stream: &mut AttemptStream) -> Proposal {
        let index = self.draw(stream);
        let known = Proposal {
            object_from_wrist: self.grips.entries()[index].grip.pose.frame_from_wrist,
            shape: self.shapes[index],
            advance: 0.0,
        };
        known.perturbed(stream)
    }

    /// Takes a grip over, if there is room for it or it is needed.
    fn take(&mut self, entry: Entry, shape: HandShape, is_needed: bool) {
        let cell = Cell::of(self.rig, &entry.grip.pose, &entry.contacts);
        match self.spread.room(cell, worth(&entry)) {
            Room::InsteadOf(index) if !is_needed => {
                self.spread.note(cell, index, worth(&entry));
                self.grips.replace(self.rig, index, entry);
                self.shapes[index] = shape;
            }
            Room::Crowded if !is_needed => {}
            _ if self.len() < ENTRIES => self.push(entry, shape),
            _ => {}
        }
    }

    fn push(&mut self, entry: Entry, shape: HandShape) {
        let cell = Cell::of(self.rig, &entry.grip.pose, &entry.contacts);
        self.spread.note(cell, self.len(), worth(&entry));
        self.grips.push(self.rig, entry);
        self.shapes.push(shape);
    }
}
