//! Grips of boxes that an object is like, laid on the object.

use std::{cmp::Reverse, sync::Arc};

use glam::{Mat3, Quat, Vec3};

use super::{
    closure_screen::ClosureScreen, entry::Entry, grips::Grips, primitives::HeldPrimitive, seeds::nanometres,
};
use crate::{
    base::pose::Pose,
    geometry::oriented_box::OrientedBox,
    model::{constraints::Constraints, grasp::Contact, hand::rig::Rig, object::GraspObject},
    physical::{grip::GIVER_CLEARANCE, solids::PreparedHand},
};

/// Grips that an object borrows at most, those that fit best. With twice as many, two scalpels of a hundred fewer are answered in
/// 33 ms: each takes fifty nanoseconds to choose from, and two microseconds to look at once.
const MOST: usize = 1024;

/// Boxes that it borrows from at most, those that are most like it. More find grips for parts that are not like the whole, as
/// a knife's blade; of twice as many, most that seem to fit do not hold, and a remote is answered after twice the time. Of
/// scissors held out by 48 recorded givers, two workers answer 98.0 % in 33 ms with five, 97.2 with ten, 93.1 with three.
const BOXES: usize = 5;

/// How far from the surface thumb and finger may come to be, in metres. Of those scissors, 97.2 % are answered in 33 ms with 4 mm,
/// and 82.6 % without borrowed grips. With 1 mm, an eighth as many grips fit: as many are answered, but one scalpel of twenty
/// takes 25 ms or more instead of 16.
const WITHIN: f32 = 0.002;

/// Borrowed grips that are looked at more closely for a giver: those of which the balls inside are farthest from its hand. With
/// half as many, a scalpel and a scissors of a hundred fewer are answered in 33 ms; with more than twice as many, as many are,
/// and a tenth later at the median.
const NEAREST: usize = 96;

/// Grips that are compared with the giver by balls between two looks at the clock, …
const BOUNDED_AT_ONCE: usize = 128;

/// … and grips that are laid on the object.
const MOVED_AT_ONCE: usize = 32;

/// What is thinner than this is compared as if it were this, in metres: logarithms have no zero.
const LEAST_SIZE: f32 = 0.001;

/// The turns that leave a box as it is: none, and half a turn about each axis.
const TURNS: [Quat; 4] = [
    Quat::IDENTITY,
    Quat::from_xyzw(1.0, 0.0, 0.0, 0.0),
    Quat::from_xyzw(0.0, 1.0, 0.0, 0.0),
    Quat::from_xyzw(0.0, 0.0, 1.0, 0.0),
];

/// A grip of a box that is laid on the object. Where it is follows, so that it takes few bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Transferred {
    /// Which of the boxes it is of, …
    primitive: u8,
    /// … by which of the turns, …
    turn: u8,
    /// … and which of its grips.
    grip: u16,
    /// Where it touches, it may hold the object.
    passes_screen: bool,
}

/// Which of the grips that an object borrows are asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Among {
    /// All that fit.
    All,
    /// Those that may hold the object where they touch it, as far as that shows; all, if none does.
    Passing,
}

/// Grips of boxes that fit an object, as far as that shows before a hand is closed. They hold the boxes, not the object:
/// searches start from them.
#[derive(Clone, Debug)]
pub struct TransferredGrips {
    known: Arc<[HeldPrimitive]>,
    around: SortedBox,
    /// By how well they fit.
    transferred: Vec<Transferred>,
}

impl TransferredGrips {
    /// Bytes that one takes at most, beside what all share.
    pub const MOST_BYTES: usize = MOST * size_of::<Transferred>();

    /// What an object borrows of the boxes that a hand knows, at most 256: some milliseconds of work.
    pub fn of(object: &GraspObject, known: &Arc<[HeldPrimitive]>) -> Self {
        let around = SortedBox::of(&object.bounding_box);
        let mut likest: Vec<(usize, &HeldPrimitive)> = known.iter().enumerate().collect();
        likest.sort_by(|(_, a), (_, b)| around.unlikeness(a).total_cmp(&around.unlikeness(b)));
        let mut fitting: Vec<(f32, Transferred)> = Vec::new();
        for (primitive, held) in likest.into_iter().take(BOXES) {
            for turn in 0..TURNS.len() {
                for (grip, entry) in held.grips.entries().iter().enumerate() {
                    let transferred = Transferred {
                        primitive: primitive as u8,
                        turn: turn as u8,
                        grip: grip as u16,
                        passes_screen: false,
                    };
                    let object_from_primitive = around.lay(held, transferred);
                    if let Some(off) = farther_digit(&entry.contacts, object, object_from_primitive) {
                        fitting.push((off, transferred));
                    }
                }
            }
        }
        fitting.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        fitting.truncate(MOST);
        let mut promise = ClosureScreen::new(object);
        let looked_at = |(_, transferred): (f32, Transferred)| {
            let held = &known[usize::from(transferred.primitive)];
            let contacts = &held.grips.entries()[usize::from(transferred.grip)].contacts;
            Transferred {
                passes_screen: promise.passes(contacts, around.lay(held, transferred)),
                ..transferred
            }
        };
        Self {
            known: Arc::clone(known),
            around,
            transferred: fitting.into_iter().map(looked_at).collect(),
        }
    }

    /// How many grips there are.
    pub fn len(&self) -> usize {
        self.transferred.len()
    }

    /// True if no box has a grip that fits.
    pub fn is_empty(&self) -> bool {
        self.transferred.is_empty()
    }

    /// How many of them are promising.
    pub fn passing(&self) -> usize {
        self.transferred
            .iter()
            .filter(|transferred| transferred.passes_screen)
            .count()
    }

    /// Those of the grips that are what is demanded and seem least in a giver's way, on the object; of those that are as little,
    /// the ones that fit best. `rig` is the hand that knows the boxes. None if interrupted.
    pub fn for_giver(
        &self,
        among: Among,
        rig: &Rig,
        giver: Option<&PreparedHand>,
        constraints: &Constraints,
        interrupted: &impl Fn() -> bool,
    ) -> Option<Grips> {
        // What is unlike all that was tried promises nothing, and may do all the same.
        let only_promising = among == Among::Passing && self.passing() > 0;
        let mut by_clearance: Vec<(Reverse<i32>, usize)> = Vec::with_capacity(self.transferred.len());
        for (place, &transferred) in self.transferred.iter().enumerate() {
            if place.is_multiple_of(BOUNDED_AT_ONCE) && interrupted() {
                return None;
            }
            if only_promising && !transferred.passes_screen {
                continue;
            }
            let clearance = giver.map_or(GIVER_CLEARANCE, |giver| {
                self.clearance_upper_bound(transferred, giver)
            });
            by_clearance.push((Reverse(nanometres(clearance.min(GIVER_CLEARANCE))), place));
        }
        by_clearance.sort_unstable();
        let mut entries = Vec::with_capacity(NEAREST);
        for (count, (_, place)) in by_clearance.into_iter().enumerate() {
            if entries.len() == NEAREST {
                break;
            }
            if count.is_multiple_of(MOVED_AT_ONCE) && interrupted() {
                return None;
            }
            let entry = self.entry(self.transferred[place]);
            if entry.is_wanted(constraints) {
                entries.push(entry);
            }
        }
        Some(Grips::new(rig, entries))
    }

    fn clearance_upper_bound(&self, transferred: Transferred, giver: &PreparedHand) -> f32 {
        let held = self.held(transferred);
        held.grips.moved_clearance_upper_bound(
            usize::from(transferred.grip),
            self.around.lay(held, transferred),
            giver,
        )
    }

    /// A grip where it is laid.
    fn entry(&self, transferred: Transferred) -> Entry {
        let held = self.held(transferred);
        held.grips.entries()[usize::from(transferred.grip)].moved(self.around.lay(held, transferred))
    }

    fn held(&self, transferred: Transferred) -> &HeldPrimitive {
        &self.known[usize::from(transferred.primitive)]
    }
}

/// An object's box with its longest edges first, as those of primitives are.
#[derive(Clone, Copy, Debug)]
struct SortedBox {
    object_from_box: Pose,
    half_extents: Vec3,
}

impl SortedBox {
    fn of(around: &OrientedBox) -> Self {
        let mut axes = [0, 1, 2].map(|axis| (around.half_extents[axis], Vec3::AXES[axis]));
        axes.sort_by(|(a, _), (b, _)| b.total_cmp(a));
        let [x, y, _] = axes.map(|(_, axis)| axis);
        let turn = Quat::from_mat3(&Mat3::from_cols(x, y, x.cross(y))).normalize();
        Self {
            object_from_box: around.object_from_box * Pose::new(Vec3::ZERO, turn),
            half_extents: Vec3::from(axes.map(|(half, _)| half.max(LEAST_SIZE))),
        }
    }

    /// How much the sizes differ from those of a primitive: the sum of squared logarithms of their ratios.
    fn unlikeness(&self, other: &HeldPrimitive) -> f32 {
        let ratios = self.half_extents / other.primitive.half_extents;
        ratios.to_array().map(|ratio| ratio.ln().powi(2)).iter().sum()
    }

    /// Where the frame of a primitive is laid for one of its grips: so that the middle of what touches comes to be where it was
    /// by the boxes' sizes.
    fn lay(&self, held: &HeldPrimitive, transferred: Transferred) -> Pose {
        let contacts = &held.grips.entries()[usize::from(transferred.grip)].contacts;
        let sum: Vec3 = contacts.iter().map(|contact| contact.position).sum();
        let middle = sum / contacts.len().max(1) as f32;
        let scaled = middle * self.half_extents / held.primitive.half_extents;
        let turn = TURNS[usize::from(transferred.turn)];
        self.object_from_box * Pose::new(turn * (scaled - middle), turn)
    }
}

/// How far from the object's surface thumb or nearest finger come to be, whichever is farther; none if that is more than
/// [`WITHIN`].
fn farther_digit(contacts: &[Contact], object: &GraspObject, object_from_primitive: Pose) -> Option<f32> {
    let nearest = |is_thumb: bool| {
        let of_part = contacts
            .iter()
            .filter(|contact| contact.part.is_thumb() == Some(is_thumb));
        let distances = of_part.filter_map(|contact| {
            let place = object_from_primitive.transform_point(contact.position);
            let closest = object.surface.closest_point_within(place, WITHIN)?;
            Some(closest.distance)
        });
        distances.min_by(f32::total_cmp)
    };
    Some(nearest(true)?.max(nearest(false)?))
}
