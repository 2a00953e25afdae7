//! Grips of the left hand as mirror images of the right hand's, on objects that are symmetric.
//!
//! At a sharp edge, which of two faces a digit touches is a matter of rounding, and a mirror image may decide otherwise. So contacts are
//! found anew; an image that does not hold closes its digits again, or is left out.

use std::sync::Arc;

use glam::Vec3;

use super::{
    atlas::Atlas,
    entry::Entry,
    gravity::{DIRECTIONS, direction},
    grips::Grips,
    growth::Grown,
};
use crate::{
    model::{
        hand::{HandPose, rig::Rig},
        object::GraspObject,
        strategy::Validity,
    },
    physical::{
        grip::{Grip, Gripper, PosedDigits},
        presented::{ObjectScene, Presented},
        solids::HandSolids,
    },
    propose::mirror::Mirror,
};

/// Makes mirror images of grips.
struct Images<'a> {
    mirror: Mirror,
    scene: ObjectScene<'a>,
    rig: &'a Rig,
    gripper: Gripper,
}

impl Grown {
    /// The same grips of the other hand, `rig`, in a plane about which the object is symmetric.
    #[must_use]
    pub fn mirrored(self, mirror: Mirror, object: &GraspObject, rig: &Rig) -> Self {
        let mut images = Images {
            mirror,
            scene: ObjectScene::new(object, object.friction_under(Validity::Physical)),
            rig,
            gripper: Gripper::default(),
        };
        let originals = self.atlas.entries().iter().zip(&self.shapes);
        let (entries, shapes) = originals
            .filter_map(|(original, &shape)| Some((images.image(original)?, shape)))
            .unzip();
        let complete = self.atlas.is_complete();
        Self {
            atlas: Arc::new(Atlas::of_mirrored(Grips::new(rig, entries), complete, mirror)),
            shapes,
            proposed: self.proposed,
            early_stamp: self.early_stamp,
            original: (!complete).then(|| Arc::new(self)),
        }
    }
}

impl Images<'_> {
    /// The mirror image of a grip; `None` if it does not hold under the gravity that suits the original best. Scores and friction uses stay
    /// as they were, under the mirror images of the directions of gravity.
    fn image(&mut self, original: &Entry) -> Option<Entry> {
        let best = (0..DIRECTIONS).max_by_key(|&index| original.scores[index]);
        let up = self.mirror.direction(direction(best.unwrap_or_default()));
        let pose = HandPose {
            frame_from_wrist: self.mirror.wrist(original.grip.pose.frame_from_wrist),
            ..original.grip.pose
        };
        let held = self.hold(&pose, up, PosedDigits::Still);
        let (grip, solids) = held.or_else(|| self.hold(&pose, up, PosedDigits::Settled))?;
        let image = Entry::of_held(&self.scene, self.rig, grip, &solids, &self.gripper);
        let is_alike = image.contacts.len() == original.contacts.len();
        Some(Entry {
            scores: original.scores,
            friction_uses: original.friction_uses,
            finger_subsets: if is_alike {
                original.finger_subsets
            } else {
                image.finger_subsets
            },
            ..image
        })
    }

    fn hold(&mut self, pose: &HandPose, up: Vec3, digits: PosedDigits) -> Option<(Grip, HandSolids)> {
        let alone = Presented::alone(up);
        let held = self
            .gripper
            .hold_posed(&self.scene, self.rig, pose, &alone, digits);
        held.ok()
    }
}
