//! Grips with which an object is not to be taken.

use super::hand::Handedness;
use crate::base::pose::Pose;

/// A wrist pose around which an object is not to be taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BannedGrip {
    /// The hand; the other one may take the object so.
    pub handedness: Handedness,
    /// The wrist in the object's frame.
    pub object_from_wrist: Pose,
    /// Wrists closer than this are near, in metres, …
    pub distance: f32,
    /// … if they are turned by less than this, in radians.
    pub angle: f32,
}

impl BannedGrip {
    /// True if a hand's wrist is near the banned one.
    pub fn covers(&self, handedness: Handedness, object_from_wrist: Pose) -> bool {
        let Pose {
            position,
            orientation,
        } = self.object_from_wrist;
        handedness == self.handedness
            && position.distance(object_from_wrist.position) < self.distance
            && orientation.angle_between(object_from_wrist.orientation) < self.angle
    }
}
