//! Which hand's grips an atlas grows from.

use std::sync::Arc;

use grasp_assets::hands::{Hand, hand};
use grasp_synthesis::{
    known::growth::Grown,
    model::hand::Handedness,
    propose::{both_hands::Mirror, prepared::PreparedObject},
};

/// The hand whose growth is an atlas, or becomes one as its mirror image.
///
/// On a symmetric object, what one hand can do, the other can. The left hand's grips are therefore the mirror images of the right
/// hand's: mirrored holdouts have mirrored answers, and both hands share a file.
#[derive(Debug)]
pub(super) struct Plan {
    /// The hand that grows.
    pub(super) grows: Arc<Hand>,
    mirror: Option<Mirror>,
}

impl Plan {
    /// The plan for a hand's atlas of an object.
    pub(super) fn of(object: &PreparedObject, of: &Arc<Hand>) -> Self {
        let right = right_of(of);
        let mirror = right.and_then(|_| Mirror::of_symmetric(object));
        Self {
            grows: Arc::clone(right.filter(|_| mirror.is_some()).unwrap_or(of)),
            mirror,
        }
    }

    /// What has grown as an atlas of the hand.
    pub(super) fn placed(&self, grown: Grown, object: &PreparedObject, of: &Hand) -> Grown {
        match self.mirror {
            Some(mirror) => grown.mirrored(mirror, object.object(), &of.rig),
            None => grown,
        }
    }
}

/// The right hand of which a left one is the mirror image, if both are built in.
fn right_of(left: &Hand) -> Option<&'static Arc<Hand>> {
    let right = hand(&left.rig.name, Handedness::Right)?;
    let is_image = left.rig.handedness == Handedness::Left && right.rig.mirrored() == *left.rig;
    is_image.then_some(right)
}
