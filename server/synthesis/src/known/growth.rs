//! Grows atlases in rounds of proposals, half of them fresh and half perturbed from known grips. Of similar grips, only the best
//! few are kept (`spread.rs`). In every other round, a known grip plays the giver's hand, so that the atlas also serves givers who
//! leave little room.
//!
//! A round's proposals depend only on the rounds before it, and their results are admitted in order. So an atlas is the same for
//! any number of threads and any interruptions.

use std::{cmp::Reverse, sync::Arc};

use glam::Vec3;

use super::{
    atlas::{Atlas, Grips, stamp},
    entry::Entry,
    excerpt::{Wanted, excerpt, times_listed},
    seeds::Seeds,
    spread::{Admission, Cell, Occupancy, Spread},
};
use crate::{
    base::{
        random::AttemptStream,
        stop::{Stop, unstopped},
        stopwatch::Stopwatch,
    },
    model::{
        hand::{joints::HandJoints, rig::Rig},
        object::GraspObject,
        regions::suits_owner,
        score::{Term, grip_total},
        strategy::Validity,
    },
    physical::{
        barriers::Barriers,
        grip::{Gripper, clear_of_barriers},
        presented::{ObjectScene, Presented},
        shape::{HandShape, Proposal},
        solids::{PreparedHand, TrackedSolids},
    },
    propose::{
        handles::wrap_handle,
        prepared::{PreparedObject, PreparedRig},
        proposal::{ProposalContext, propose_evenly},
        surface_pairs::SurfacePairs,
    },
    rating::{
        scoring::{HELD_BY_HANDLE, grip_values},
        taxonomy::classify,
    },
};

/// Grips of a complete atlas. More offer more choice, and cost time and about 1.3 kilobytes each.
pub const ENTRIES: usize = 8192;

/// Grips and proposals after which a growth is [enough](Growth::is_enough): some four seconds of work.
const ENOUGH_GRIPS: usize = 1536;
const ENOUGH_PROPOSALS: u64 = 24_576;

/// Grips that are kept of a growth that is enough.
pub const CHOSEN: usize = 340;

/// Proposals per round.
pub const ROUND: u64 = 64;

/// Proposals after which an atlas is complete even with fewer grips, so that work on objects that cannot be held ends. With half as
/// many, atlases of thin objects are not filled.
pub const MAX_PROPOSALS: u64 = 400_000;

/// Proposals after which an atlas is stamped, so that a change of the algorithm shows after seconds instead of minutes. With fewer,
/// no round has had a giver yet.
pub const EARLY_PROPOSALS: u64 = 96 * ROUND;

/// Seed of the proposals.
const SEED: u64 = 0x4154_4c41;

/// Share of perturbed proposals once grips are known. They succeed ten times as often as fresh ones, which discover new regions.
const PERTURBED_SHARE: f32 = 0.5;

/// Share of fresh proposals that wrap a handle, if the object has one: people hold it there.
const HANDLE_SHARE: f32 = 0.5;

/// Share of fresh proposals in a place where the object's owner wants hands, and of the kept grips there.
const WANTED_SHARE: f32 = 0.5;

/// Seed of the givers.
const GIVERS_SEED: u64 = 0x4749_5645;

/// Number of grips from which on rounds have givers.
const MIN_GRIPS_FOR_GIVERS: usize = 256;

/// A giver that leaves this many grips clear needs no more, whatever the gravity.
const ENOUGH_CLEAR_GRIPS: usize = 60;

/// Largest number of redraws of a grip from a crowded cell.
const MAX_REDRAWS: usize = 8;

type Outcome = Option<(Entry, HandShape)>;

/// A known grip that plays the giver's hand.
#[derive(Debug)]
struct Giver {
    presented: Presented,
    surface: SurfacePairs,
    wanted: SurfacePairs,
    /// Known grips that are nearly clear of it, if it needs more clear grips.
    seeds: Option<Seeds>,
}

/// An atlas being grown.
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

    /// Resumes an incomplete growth of the same object and rig. The result is the same as without interruption.
    pub fn resume(object: &'a PreparedObject, rig: &'a PreparedRig, grown: &Grown) -> Self {
        let mut growth = Self::new(object, rig);
        growth.proposed = grown.proposed;
        growth.early_stamp = grown.early_stamp;
        for (entry, shape) in grown.atlas.entries().iter().zip(&grown.shapes) {
            growth.push(entry.clone(), *shape);
        }
        growth
    }

    /// The number of grips.
    pub fn len(&self) -> usize {
        self.grips.entries().len()
    }

    /// True if there are no grips yet.
    pub fn is_empty(&self) -> bool {
        self.grips.entries().is_empty()
    }

    /// The number of proposals tried.
    pub fn proposed(&self) -> u64 {
        self.proposed
    }

    /// True if the growth has ended.
    pub fn is_complete(&self) -> bool {
        self.len() >= ENTRIES || self.proposed >= MAX_PROPOSALS
    }

    /// True if more grips would serve few more givers, or if many more are unlikely.
    pub fn is_enough(&self) -> bool {
        self.len() >= ENOUGH_GRIPS || self.proposed >= ENOUGH_PROPOSALS || self.is_complete()
    }

    /// The growth that a server keeps: if [enough](Self::is_enough), up to [`CHOSEN`] grips that together serve givers best, as a
    /// complete atlas that does not grow; until then all grips, from which growth resumes.
    pub fn kept(&self) -> Grown {
        if !self.is_enough() {
            return self.grown();
        }
        let (grips, shapes) = self.by_score();
        let occupancy = Occupancy::of(self.scene.object, self.rig, grips.entries());
        let places = excerpt(grips.entries(), &occupancy, CHOSEN, self.wanted(grips.entries()));
        let entries = places.iter().map(|&place| grips.entries()[place].clone());
        let shapes = places.iter().map(|&place| shapes[place]).collect();
        self.with(Grips::new(self.rig, entries.collect()), shapes, true)
    }

    /// The grips to keep because they hold the object where its owner wants hands or, without such wishes, by its handle.
    fn wanted(&self, entries: &[Entry]) -> Wanted {
        let regions = self.scene.object.regions();
        let is_wanted = |entry: &Entry| {
            if regions.require_contacts() {
                suits_owner(&regions.values(&entry.contacts))
            } else {
                self.prepared.parts().is_handled
                    && entry.grip_values[Term::OnHandle as usize] >= HELD_BY_HANDLE
            }
        };
        let places = (0..entries.len() as u16).filter(|&place| is_wanted(&entries[usize::from(place)]));
        Wanted {
            places: places.collect(),
            count: (WANTED_SHARE * CHOSEN as f32) as usize,
        }
    }

    /// The atlas grown so far.
    pub fn atlas(&self) -> Atlas {
        Arc::unwrap_or_clone(self.grown().atlas)
    }

    /// The state of the growth. Once complete, grips with high scores come first, so that those tried first are adjacent in memory
    /// for any gravity.
    pub fn grown(&self) -> Grown {
        let is_complete = self.is_complete();
        let (grips, shapes) = if is_complete {
            self.by_score()
        } else {
            (self.grips.clone(), self.shapes.clone())
        };
        self.with(grips, shapes, is_complete)
    }

    fn with(&self, grips: Grips, shapes: Vec<HandShape>, is_complete: bool) -> Grown {
        Grown {
            atlas: Arc::new(Atlas::new(grips, is_complete)),
            shapes,
            proposed: self.proposed,
            early_stamp: self.early_stamp,
            original: None,
        }
    }

    /// Grips and shapes by falling sum of scores over all directions of gravity; ties keep the order found.
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

    /// Runs one round, which takes some milliseconds.
    pub fn round(&mut self, gripper: &mut Gripper) {
        let giver = self.draw_giver();
        let found: Vec<Outcome> = (self.proposed..self.proposed + ROUND)
            .map(|index| self.try_proposal(index, giver.as_ref(), gripper))
            .collect();
        self.proposed += ROUND;
        let needs_grips = giver.as_ref().is_some_and(|giver| giver.seeds.is_some());
        for (entry, shape) in found.into_iter().flatten() {
            self.admit(entry, shape, needs_grips);
        }
        if self.proposed == EARLY_PROPOSALS {
            self.early_stamp = stamp(self.grips.entries());
        }
    }

    fn draw_giver(&self) -> Option<Giver> {
        let round = self.proposed / ROUND;
        if self.len() < MIN_GRIPS_FOR_GIVERS || round.is_multiple_of(2) {
            return None;
        }
        let mut stream = AttemptStream::new(GIVERS_SEED, round);
        let pose = &self.grips.entries()[self.draw_grip(&mut stream)].grip.pose;
        let hand = PreparedHand::new(&TrackedSolids::of_joints(&HandJoints::of_pose(self.rig, pose)));
        let barriers = Barriers::of_giver(&hand);
        let is_clear = |&entry: &usize| {
            let solids = self.grips.screen(entry, self.rig, barriers);
            solids.is_some_and(|solids| clear_of_barriers(&solids, barriers).is_some())
        };
        let clear = (0..self.len()).filter(is_clear).take(ENOUGH_CLEAR_GRIPS);
        let all = 0..self.len() as u16;
        let seeds = (clear.count() < ENOUGH_CLEAR_GRIPS)
            .then(|| unstopped(|stop| Seeds::of(&self.grips, self.rig, all, barriers, stop)));
        Some(Giver {
            surface: self.prepared.surface_pairs.free_of(barriers),
            wanted: self.prepared.wanted_pairs.free_of(barriers),
            presented: Presented {
                hands: vec![hand],
                ..Presented::alone(Vec3::Y)
            },
            seeds,
        })
    }

    fn try_proposal(&self, index: u64, giver: Option<&Giver>, gripper: &mut Gripper) -> Outcome {
        let mut stream = AttemptStream::new(SEED, index);
        let proposal = self.propose(giver, &mut stream)?;
        let presented = giver.map(|giver| &giver.presented);
        let (grip, solids) = gripper
            .grip(
                &self.scene,
                self.rig,
                &proposal,
                presented,
                &mut Stopwatch::off(),
                Stop::NEVER,
            )
            .ok()?;
        // Evaluating the entry takes longest: drop it first if its cell is full.
        let needs_grips = giver.is_some_and(|giver| giver.seeds.is_some());
        let contacts = &gripper.contacts;
        let classification = classify(self.rig, &grip.pose, contacts, &self.scene.object.local_shape);
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
        if !needs_grips && self.spread.admission(cell, grip_total(&values)) == Admission::Reject {
            return None;
        }
        let entry = Entry::new(&self.scene, self.rig, grip, &solids, gripper);
        Some((entry, proposal.shape))
    }

    fn propose(&self, giver: Option<&Giver>, stream: &mut AttemptStream) -> Option<Proposal> {
        let is_perturbed = !self.is_empty() && stream.unit() < PERTURBED_SHARE;
        let wanted = giver.map_or(&self.prepared.wanted_pairs, |giver| &giver.wanted);
        let is_wanted = !wanted.pairs.is_empty() && stream.unit() < WANTED_SHARE;
        let anywhere = giver.map_or(&self.prepared.surface_pairs, |giver| &giver.surface);
        let place = ProposalContext {
            object: self.scene.object,
            surface: if is_wanted { wanted } else { anywhere },
            barriers: giver.map_or(Barriers::NONE, |giver| giver.presented.barriers()),
            chooses: None,
            rig: self.rig,
            placements: None,
        };
        match giver.map(|giver| &giver.seeds) {
            Some(Some(seeds)) if is_perturbed => seeds.propose(self.grips.entries(), true, &place, stream),
            None if is_perturbed => Some(self.perturbed_known(stream)),
            // Perturbing known grips is wasted on a giver with enough clear ones: most of them collide.
            _ if self.prepared.parts().is_handled && stream.unit() < HANDLE_SHARE => {
                wrap_handle(&place, stream)
            }
            _ => propose_evenly(&place, stream, Stop::NEVER),
        }
    }

    fn draw_grip(&self, stream: &mut AttemptStream) -> usize {
        let mut index = stream.below(self.len());
        for _ in 0..MAX_REDRAWS {
            let entry = &self.grips.entries()[index];
            let cell = Cell::of(self.rig, &entry.grip.pose, &entry.contacts);
            if stream.unit() * (self.spread.count_in(cell) as f32) < 1.0 {
                break;
            }
            index = stream.below(self.len());
        }
        index
    }

    fn perturbed_known(&self, stream: &mut AttemptStream) -> Proposal {
        let index = self.draw_grip(stream);
        let known = Proposal {
            object_from_wrist: self.grips.entries()[index].grip.pose.frame_from_wrist,
            shape: self.shapes[index],
            advance: 0.0,
        };
        known.perturbed(stream)
    }

    /// Admits a grip if its cell has room for it or if it is required.
    fn admit(&mut self, entry: Entry, shape: HandShape, is_required: bool) {
        let cell = Cell::of(self.rig, &entry.grip.pose, &entry.contacts);
        match self.spread.admission(cell, grip_total(&entry.grip_values)) {
            Admission::Replace(index) if !is_required => {
                self.spread.record(cell, index, grip_total(&entry.grip_values));
                self.grips.replace(self.rig, index, entry);
                self.shapes[index] = shape;
            }
            Admission::Reject if !is_required => {}
            _ if self.len() < ENTRIES => self.push(entry, shape),
            _ => {}
        }
    }

    fn push(&mut self, entry: Entry, shape: HandShape) {
        let cell = Cell::of(self.rig, &entry.grip.pose, &entry.contacts);
        self.spread
            .record(cell, self.len(), grip_total(&entry.grip_values));
        self.grips.push(self.rig, entry);
        self.shapes.push(shape);
    }
}

/// Grips that are shipped with an object or a primitive, at about 230 bytes each.
const SHIPPED: usize = 320;

/// The state of a growth, with everything needed to resume it.
#[derive(Clone, Debug, PartialEq)]
pub struct Grown {
    /// The grips.
    pub atlas: Arc<Atlas>,
    pub(super) shapes: Vec<HandShape>,
    /// Proposals tried; 0 if these are the listed grips of another atlas.
    pub proposed: u64,
    /// The atlas' stamp after the first [`EARLY_PROPOSALS`]; 0 before.
    pub early_stamp: u64,
    /// If growth goes on and these grips are mirror images, the growth of the other hand.
    pub(super) original: Option<Arc<Self>>,
}

impl Grown {
    /// The growth that goes on: this one, or the original of its mirror images.
    pub fn original(&self) -> &Self {
        self.original.as_deref().unwrap_or(self)
    }

    /// The grips on any shortlist, as an incomplete atlas: nearly every giver leaves some of these few free. Resuming from it
    /// does not continue the growth of the atlas, but starts over.
    #[must_use]
    pub fn listed(&self, object: &GraspObject, rig: &Rig) -> Self {
        let listed = self.times_listed(object, rig).into_iter();
        self.only(rig, listed.map(|(entry, _)| entry))
    }

    /// The grips on most shortlists, as many as ship; also an incomplete atlas.
    #[must_use]
    pub fn most_listed(&self, object: &GraspObject, rig: &Rig) -> Self {
        let mut by_count = self.times_listed(object, rig);
        by_count.sort_by_key(|&(entry, times)| (Reverse(times), entry));
        let most = by_count.into_iter().take(SHIPPED);
        let mut most: Vec<u16> = most.map(|(entry, _)| entry).collect();
        most.sort_unstable();
        self.only(rig, most.into_iter())
    }

    /// The listed grips, ascending, each with the number of shortlists that it is on.
    fn times_listed(&self, object: &GraspObject, rig: &Rig) -> Vec<(u16, usize)> {
        let entries = self.atlas.entries();
        times_listed(entries, &Occupancy::of(object, rig, entries))
    }

    /// The same grips as a complete atlas.
    #[must_use]
    pub fn completed(self) -> Self {
        let mut atlas = Arc::unwrap_or_clone(self.atlas);
        atlas.complete = true;
        Self {
            atlas: Arc::new(atlas),
            ..self
        }
    }

    fn only(&self, rig: &Rig, places: impl Iterator<Item = u16>) -> Self {
        let places = places.map(usize::from);
        let (entries, shapes) = places
            .map(|place| (self.atlas.entries()[place].clone(), self.shapes[place]))
            .unzip();
        Self {
            atlas: Arc::new(Atlas::new(Grips::new(rig, entries), false)),
            shapes,
            proposed: 0,
            early_stamp: self.early_stamp,
            original: None,
        }
    }

    /// Memory use in bytes.
    pub fn bytes(&self) -> usize {
        let of_original = self.original.as_ref().map_or(0, |original| original.bytes());
        self.atlas.bytes() + size_of_val(self.shapes.as_slice()) + of_original
    }
}
