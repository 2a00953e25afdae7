//! The best grasps that differ: of each class of grasps the best, and of those the best.

use std::cmp::Ordering;

use glam::Vec3;

use super::report::FoundGrasp;
use crate::{
    geometry::boxes::Aabb,
    model::{
        grasp::{Contact, Grasp},
        grasp_type::GraspType,
        hand::Handedness,
        object::GraspObject,
    },
};

/// What grasps differ by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Differences {
    /// The side of the object that the hand comes from, and the hand.
    pub approach: bool,
    /// The grasp type.
    pub grasp_type: bool,
    /// The part of the object that is held.
    pub region: bool,
}

/// What all grasps of a class have in common, as far as it counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Class {
    /// The side that the hand comes from, and the hand.
    pub approach: Option<(Side, Handedness)>,
    /// The type; the inner none for a grasp without a type.
    pub grasp_type: Option<Option<GraspType>>,
    /// The part that is held.
    pub region: Option<Part>,
}

/// A direction of the object's axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Side {
    /// Which axis: 0 to 2.
    pub axis: u8,
    /// True for the direction against it.
    pub is_negative: bool,
}

/// A part of an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The region with most contacts, by its place; none off all regions.
    Region(Option<usize>),
    /// Without regions: an eighth of the bounding box. A bit per axis is 1 in its upper half.
    Octant(u8),
}

impl Class {
    /// The class of a grasp on an object.
    pub fn of(grasp: &Grasp, handedness: Handedness, object: &GraspObject, by: Differences) -> Self {
        Self {
            approach: by.approach.then(|| (side_of(grasp), handedness)),
            grasp_type: by.grasp_type.then_some(grasp.classification.grasp_type),
            region: by.region.then(|| part_of(&grasp.contacts, object)),
        }
    }
}

/// The direction that the palm faces away from most. Of several, the first axis.
fn side_of(grasp: &Grasp) -> Side {
    let away = grasp.pose.frame_from_wrist.transform_vector(Vec3::NEG_Z);
    let sizes = away.abs().to_array();
    let mut axis = 0;
    for other in 1..3 {
        if sizes[other] > sizes[axis] {
            axis = other;
        }
    }
    Side {
        axis: axis as u8,
        is_negative: away[axis] < 0.0,
    }
}

fn part_of(contacts: &[Contact], object: &GraspObject) -> Part {
    let regions = object.regions();
    if !regions.is_empty() {
        return Part::Region(regions.with_most(contacts));
    }
    let Aabb { min, max } = object.mesh.aabb();
    let sum: Vec3 = contacts.iter().map(|contact| contact.position).sum();
    let middle = sum / contacts.len().max(1) as f32;
    let upper = middle.cmpgt(0.5 * (min + max));
    Part::Octant(upper.bitmask() as u8)
}

/// The best grasps of different classes so far. Which they are in the end does not depend on the order in which grasps are
/// offered.
#[derive(Clone, Debug)]
pub struct Alternatives {
    most: usize,
    /// The best of each class, best first.
    best: Vec<Alternative>,
}

/// The best grasp of its class.
#[derive(Clone, Debug)]
pub struct Alternative {
    /// The class.
    pub class: Class,
    /// The hand.
    pub handedness: Handedness,
    /// The grasp.
    pub found: FoundGrasp,
}

impl Alternative {
    /// Orders the better one first; equally good ones of both hands, the right hand's.
    fn order(&self, other: &Self) -> Ordering {
        let hand = |of: &Self| of.handedness == Handedness::Left;
        let by_quality = other.found.quality(&self.found);
        by_quality.then(hand(self).cmp(&hand(other)))
    }
}

impl Alternatives {
    /// None so far, of at most so many.
    pub fn new(most: usize) -> Self {
        Self {
            most,
            best: Vec::with_capacity(most + 1),
        }
    }

    /// The quality that any further grasp has to reach; `None` as long as there are less than there may be.
    pub fn least(&self) -> Option<f32> {
        let is_full = self.best.len() >= self.most;
        self.best
            .last()
            .filter(|_| is_full)
            .map(|worst| worst.found.value)
    }

    /// Offers a grasp. A class that has made room for better ones comes back with a better grasp: the best of any class among the
    /// best in the end is better than the worst that is kept when it is offered.
    pub fn offer(&mut self, new: Alternative) {
        match self.best.iter().position(|kept| kept.class == new.class) {
            Some(place) if new.order(&self.best[place]).is_lt() => {
                self.best.remove(place);
            }
            Some(_) => return,
            None => {}
        }
        let place = self.best.partition_point(|kept| kept.order(&new).is_lt());
        self.best.insert(place, new);
        self.best.truncate(self.most);
    }

    /// The grasps, best first.
    pub fn into_best(self) -> Vec<Alternative> {
        self.best
    }
}
