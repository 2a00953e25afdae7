//! Grips moved to other surfaces: a hand posed on an object of another size, whose wrist follows the surface while the digits
//! adapt, and mirror images on symmetric objects. Contacts of an image are recomputed, as sharp edges may decide otherwise; an
//! image that does not hold closes its digits again, or is left out.

use std::sync::Arc;

use glam::Vec3;

use super::{
    atlas::{Atlas, Grips},
    entry::{DIRECTIONS, Entry, direction},
    growth::Grown,
};
use crate::{
    base::{pose::Pose, stop::Stop, stopwatch::Stopwatch},
    model::{
        grasp::Contact,
        hand::{HandPart, HandPose, rig::Rig},
        object::GraspObject,
        strategy::Validity,
    },
    physical::{
        grip::{Grip, Gripper, PosedDigits},
        presented::{ObjectScene, Presented},
        shape::{HandShape, Proposal},
    },
    propose::both_hands::Mirror,
    rating::scoring::middle,
};

/// How far the hand may be from its place on the moved surface, in steps of metres: along the palm's normal, and toward the
/// fingertips. Whatever grows between thumb and fingers pushes the palm back.
const STEP: f32 = 0.001;
const STEPS_OFF_PALM: i32 = 14;
const STEPS_ALONG_FINGERS: i32 = 12;

/// Interval, in steps, at which hands are tried along the fingers.
const STRIDE_ALONG_FINGERS: usize = 4;

/// The hand that holds a resized object, `scale` times as large, like `pose` holds it at its own size: with as many of the same
/// digits as possible, and as near the same place. If none holds, the hand whose wrist follows the surface.
pub fn on_resized([own, resized]: [&ObjectScene<'_>; 2], scale: f32, rig: &Rig, pose: &HandPose) -> HandPose {
    let alone = Presented::alone(Vec3::Y);
    let mut gripper = Gripper::default();
    let mut hold = |digits| gripper.hold_posed(own, rig, pose, &alone, digits).ok();
    let held = hold(PosedDigits::Settled).or_else(|| hold(PosedDigits::Still));
    let Some((grip, _)) = held else {
        return HandPose {
            frame_from_wrist: own.object.wrist_at(scale, pose.frame_from_wrist),
            ..*pose
        };
    };
    let way = way_with_contacts(&gripper.contacts, scale);
    let following = HandPose {
        frame_from_wrist: way * grip.pose.frame_from_wrist,
        ..grip.pose
    };
    let shape = HandShape::of_grip(rig, &grip);
    let mut nearly: Option<HandPose> = None;
    for wrist in wrists_near(following.frame_from_wrist) {
        let posed = HandPose {
            frame_from_wrist: wrist,
            ..following
        };
        let proposal = Proposal {
            object_from_wrist: wrist,
            shape,
            advance: 0.0,
        };
        let settled = gripper.hold_posed(resized, rig, &posed, &alone, PosedDigits::Settled);
        let found = settled.or_else(|_| {
            gripper.grip(
                resized,
                rig,
                &proposal,
                Some(&alone),
                &mut Stopwatch::off(),
                Stop::NEVER,
            )
        });
        let Ok((found, _)) = found else { continue };
        if holds_with_digits_of(&grip, &found) {
            return found.pose;
        }
        nearly.get_or_insert(found.pose);
    }
    nearly.unwrap_or(following)
}

/// The displacement of the hand with its contacts: those of the palm or, without any, of all digits.
pub(super) fn way_with_contacts(contacts: &[Contact], scale: f32) -> Pose {
    let mut of_palm = contacts
        .iter()
        .filter(|contact| contact.part == HandPart::Palm)
        .peekable();
    let carried = if of_palm.peek().is_some() {
        middle(of_palm)
    } else {
        middle(contacts.iter())
    };
    Pose::from_position(carried * (scale - 1.0))
}

fn holds_with_digits_of(one: &Grip, other: &Grip) -> bool {
    let mut pairs = one.holding_digits().into_iter().zip(other.holding_digits());
    pairs.all(|(held, holds)| holds || !held)
}

fn wrists_near(wrist: Pose) -> Vec<Pose> {
    let along = (-STEPS_ALONG_FINGERS..=STEPS_ALONG_FINGERS).step_by(STRIDE_ALONG_FINGERS);
    let mut steps: Vec<(i32, i32)> = along
        .flat_map(|along| (-STEPS_OFF_PALM..=STEPS_OFF_PALM).map(move |off| (along, off)))
        .collect();
    steps.sort_by_key(|&(along, off)| along * along + off * off);
    let moved = |(along, off): (i32, i32)| {
        let offset = Vec3::new(0.0, along as f32, off as f32) * STEP;
        Pose::new(wrist.transform_point(offset), wrist.orientation)
    };
    steps.into_iter().map(moved).collect()
}

impl Grown {
    /// The same grips of the other hand, `rig`, in a plane about which the object is symmetric.
    #[must_use]
    pub fn mirrored(self, mirror: Mirror, object: &GraspObject, rig: &Rig) -> Self {
        let scene = ObjectScene::new(object, object.friction_under(Validity::Physical));
        let mut gripper = Gripper::default();
        let originals = self.atlas.entries().iter().zip(&self.shapes);
        let (entries, shapes) = originals
            .filter_map(|(original, &shape)| {
                Some((image(original, mirror, &scene, rig, &mut gripper)?, shape))
            })
            .unzip();
        let complete = self.atlas.is_complete();
        let mut atlas = Atlas::new(Grips::new(rig, entries), complete);
        atlas.mirror = Some(mirror);
        Self {
            atlas: Arc::new(atlas),
            shapes,
            proposed: self.proposed,
            early_stamp: self.early_stamp,
            original: (!complete).then(|| Arc::new(self)),
        }
    }
}

/// The mirror image of a grip; `None` if it does not hold under the gravity that suits the original best.
fn image(
    original: &Entry,
    mirror: Mirror,
    scene: &ObjectScene<'_>,
    rig: &Rig,
    gripper: &mut Gripper,
) -> Option<Entry> {
    let best = (0..DIRECTIONS).max_by_key(|&index| original.scores[index]);
    let alone = Presented::alone(mirror.direction(direction(best.unwrap_or_default())));
    let pose = HandPose {
        frame_from_wrist: mirror.wrist(original.grip.pose.frame_from_wrist),
        ..original.grip.pose
    };
    let mut hold = |digits| gripper.hold_posed(scene, rig, &pose, &alone, digits).ok();
    let (grip, solids) = hold(PosedDigits::Still).or_else(|| hold(PosedDigits::Settled))?;
    let mut image = Entry::of_held(scene, rig, grip, &solids, gripper);
    image.scores = original.scores;
    image.friction_uses = original.friction_uses;
    if image.contacts.len() == original.contacts.len() {
        image.finger_subsets = original.finger_subsets;
    }
    Some(image)
}
