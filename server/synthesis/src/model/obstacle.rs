//! Obstacles near the object: solids that the receiving hand keeps clear of.

use crate::{
    base::pose::Pose,
    geometry::{oriented_box::OrientedBox, tapered_capsule::TaperedCapsule},
};

/// A solid that the receiving hand and forearm keep clear of. It may touch the object or contain it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Obstacle {
    /// A capsule.
    Capsule(TaperedCapsule),
    /// A box, in the frame of its `object_from_box`.
    Box(OrientedBox),
}

impl Obstacle {
    /// The same obstacle in another frame.
    #[must_use]
    pub fn transformed(&self, a_from_b: Pose) -> Self {
        match self {
            Self::Capsule(capsule) => Self::Capsule(capsule.transformed(a_from_b)),
            Self::Box(solid) => Self::Box(OrientedBox {
                object_from_box: a_from_b * solid.object_from_box,
                ..*solid
            }),
        }
    }
}
