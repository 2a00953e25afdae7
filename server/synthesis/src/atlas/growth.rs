//! How an atlas grows: rounds of proposals, half of them new and half beside grips that are known, and a limit on how
//! many grips may be alike.
//!
//! A round's proposals depend on the rounds before and on nothing else, and what comes of them is taken over in their
//! order, so that an atlas is the same however many threads make it and whenever they are interrupted.

use std::{collections::HashMap, sync::Arc};

use glam::{IVec3, Quat, Vec3};

use super::{Atlas, entry::Entry};
use crate::{
    guided::proposal::{Place, propose},
    hand::rig::Rig,
    object::GraspObject,
    physical::{
        grip::Gripper,
        scene::ObjectScene,
        shape::{HandShape, Proposal},
    },
    pose::Pose,
    strategy::Validity,
    synthesis::{random::AttemptStream, stopwatch::NoStopwatch},
    taxonomy::classify,
};

/// Grips of a complete atlas. More leave more for a giver who covers nearly everything, and take more memory (about a
/// kilobyte each) and time.
pub const ENTRIES: usize = 4096;

/// Proposals of a round.
pub const ROUND: u64 = 64;

/// Proposals after which an atlas is complete even with fewer grips: an object that cannot be held must not be worked on
/// forever.
pub const MOST_PROPOSALS: u64 = 300_000;

/// The seed of all atlases.
const SEED: u64 = 0x4154_4c53;

/// Share of proposals beside known grips, once there are any: they succeed ten times as often as new ones, which find
/// what is not known yet.
const BESIDE_SHARE: f32 = 0.5;

/// How far beside a known grip a proposal's wrist lies at most, in metres and radians.
const BESIDE: [f32; 2] = [0.006, 0.12];

/// Edge in metres of the cells that palms are sorted into, and …
const CELL: f32 = 0.02;

/// … how many grips a cell may hold for each of the 24 ways that a hand can lie along axes.
const MOST_IN_CELL: usize = 3;

/// Closure from which a grip is firm, in multiples of what validity asks for: in a simulation by others, four in five
/// with more held against gravity, and two in five with less.
const FIRM_CLOSURE: f32 = 1.8;

/// What has grown so far, and all that it takes to go on.
#[derive(Clone, Debug, PartialEq)]
pub struct Grown {
    /// The grips.
    pub atlas: Arc<Atlas>,
    /// The shape that each grip was closed from.
    pub(super) shapes: Vec<HandShape>,
    /// Proposals that were tried.
    pub(super) proposed: u64,
}

impl Grown {
    /// Bytes that it takes in memory.
    pub fn bytes(&self) -> usize {
        self.atlas.bytes() + size_of_val(self.shapes.as_slice())
    }
}

/// What a proposal gave.
type Found = Option<(Entry, HandShape)>;

/// An atlas in the making.
#[derive(Debug)]
pub struct Growth<'a> {
    scene: ObjectScene<'a>,
    rig: &'a Rig,
    entries: Vec<Entry>,
    shapes: Vec<HandShape>,
    cells: HashMap<(IVec3, [u8; 2]), usize>,
    proposed: u64,
}

impl<'a> Growth<'a> {
    /// An empty atlas of an object, under its own friction, and a rig.
    pub fn new(object: &'a GraspObject, rig: &'a Rig) -> Self {
        Self {
            scene: ObjectScene::new(object, object.friction_under(Validity::Physical)),
            rig,
            entries: Vec::new(),
            shapes: Vec::new(),
            cells: HashMap::new(),
            proposed: 0,
        }
    }

    /// Goes on from what grew for the same object and rig: what comes of it is the same as without an interruption.
    pub fn resume(object: &'a GraspObject, rig: &'a Rig, grown: &Grown) -> Self {
        let mut growth = Self::new(object, rig);
        growth.proposed = grown.proposed;
        for (entry, shape) in grown.atlas.entries().iter().zip(&grown.shapes) {
            growth.take(entry.clone(), *shape);
        }
        growth
    }

    /// How many grips there are.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// True if there is no grip yet.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// How many proposals were tried.
    pub fn proposed(&self) -> u64 {
        self.proposed
    }

    /// True if there is nothing left to do.
    pub fn is_complete(&self) -> bool {
        self.entries.len() >= ENTRIES || self.proposed >= MOST_PROPOSALS
    }

    /// The atlas as it stands.
    pub fn atlas(&self) -> Atlas {
        Atlas::new(self.entries.clone(), self.is_complete())
    }

    /// What has grown so far.
    pub fn grown(&self) -> Grown {
        Grown {
            atlas: Arc::new(self.atlas()),
            shapes: self.shapes.clone(),
            proposed: self.proposed,
        }
    }

    /// One round: some milliseconds. `run` is given the proposals' indices and a function that tries one, which may be
    /// called on any thread; it returns what that returned, in the order of the indices.
    pub fn round(&mut self, gripper: &mut Gripper) {
        let found: Vec<Found> = (self.proposed..self.proposed + ROUND)
            .map(|index| self.try_proposal(index, gripper))
            .collect();
        self.proposed += ROUND;
        for (entry, shape) in found.into_iter().flatten() {
            self.take(entry, shape);
        }
    }

    fn try_proposal(&self, index: u64, gripper: &mut Gripper) -> Found {
        let mut stream = AttemptStream::new(SEED, index);
        let proposal = self.propose(&mut stream)?;
        let (grip, solids) = gripper
            .grip(&self.scene, self.rig, &proposal, None, &mut NoStopwatch, &|| {
                false
            })
            .ok()?;
        // Grips without a type look unnatural, and those of little closure turn in the hand: they are better than nothing,
        // and one of them is enough.
        let is_natural = classify(self.rig, &grip.pose, &gripper.contacts)
            .grasp_type
            .is_some();
        if self.is_crowded(grip.pose.frame_from_wrist, is_natural) {
            return None;
        }
        let epsilon = gripper.closure(&self.scene)?;
        if self.is_crowded(grip.pose.frame_from_wrist, is_natural && self.is_firm(epsilon)) {
            return None;
        }
        let entry = Entry::new(&self.scene, self.rig, grip, &solids, epsilon, gripper);
        Some((entry, proposal.shape))
    }

    fn propose(&self, stream: &mut AttemptStream) -> Option<Proposal> {
        if self.entries.is_empty() || stream.unit() >= BESIDE_SHARE {
            let place = Place {
                object: self.scene.object,
                surface: &self.scene.object.surface_pairs,
                giver: None,
                rig: self.rig,
            };
            return propose(&place, stream);
        }
        let place = stream.below(self.entries.len());
        let known = self.entries[place].grip.pose.frame_from_wrist;
        let axis = stream.in_cube().normalize_or(Vec3::X);
        let turn = Quat::from_axis_angle(axis, stream.between(-BESIDE[1], BESIDE[1]));
        let shape = self.shapes[place];
        Some(Proposal {
            object_from_wrist: Pose::new(
                known.position + stream.in_cube() * BESIDE[0],
                (turn * known.orientation).normalize(),
            ),
            shape: HandShape {
                thumb_yaw: (shape.thumb_yaw + stream.between(-0.1, 0.1)).clamp(0.0, 1.0),
                spread: (shape.spread + stream.between(-0.1, 0.1)).clamp(0.0, 1.0),
                ..shape
            },
            advance: 0.0,
        })
    }

    fn take(&mut self, entry: Entry, shape: HandShape) {
        let wrist = entry.grip.pose.frame_from_wrist;
        let is_good = entry.classification.grasp_type.is_some() && self.is_firm(entry.epsilon);
        if self.entries.len() < ENTRIES && !self.is_crowded(wrist, is_good) {
            *self.cells.entry(self.cell(wrist)).or_default() += 1;
            self.entries.push(entry);
            self.shapes.push(shape);
        }
    }

    fn is_firm(&self, epsilon: f32) -> bool {
        epsilon >= FIRM_CLOSURE * self.scene.least_epsilon
    }

    fn is_crowded(&self, wrist: Pose, is_good: bool) -> bool {
        let most = if is_good { MOST_IN_CELL } else { 1 };
        self.cells
            .get(&self.cell(wrist))
            .is_some_and(|&count| count >= most)
    }

    /// Where a palm is, which way it faces and which way its fingers go.
    fn cell(&self, wrist: Pose) -> (IVec3, [u8; 2]) {
        let palm = wrist.transform_point(self.rig.palm);
        let mut fingers = wrist.transform_vector(Vec3::Y);
        let facing = nearest_axis(wrist.transform_vector(Vec3::Z));
        fingers[usize::from(facing / 2)] = 0.0;
        ((palm / CELL).floor().as_ivec3(), [facing, nearest_axis(fingers)])
    }
}

/// The axis that a direction is nearest to, from 0 to 5: x, -x, y, -y, z, -z.
fn nearest_axis(direction: Vec3) -> u8 {
    let axis = direction.abs().max_position();
    2 * axis as u8 + u8::from(direction[axis] < 0.0)
}
