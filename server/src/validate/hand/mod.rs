//! Checks hands: joint angles of a rig, tracked joints, and meshes.

mod axes;
mod digits;
#[cfg(test)]
pub(crate) mod fixtures;
mod meshed;
mod posed;
mod proportions;
mod reference;
#[cfg(test)]
mod tests;
mod tracked;

use std::sync::Arc;

use glam::Vec3;
use grasp_assets::hands::RIG_NAMES;
use grasp_proto::v1::{self, presenting_hand::Form};
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::joints::{HandJoints, Skin},
};

use super::{Field, check_within, direction, frames::Frames, quoted};
use crate::{
    convention::Convention,
    rigs::{StoredRig, name_of, store::RigStore},
};
pub(super) use digits::{AngleBounds, checked_digits};
pub(crate) use meshed::MeshedHand;
pub(super) use meshed::check_meshes_together;
use meshed::meshed_hand;
use posed::angled_hand;
pub(super) use posed::{Place, PosedHand, convention_of, posed_hand, wrist_at_object};
pub(super) use tracked::{AllowedGaps, tracked_hand};

/// Allowed sizes of a hand relative to its rig: from a toddler's to a giant's.
const HAND_SCALES: std::ops::RangeInclusive<f32> = 0.5..=2.0;

/// The giver's hand, in the client's frame and `OpenXR` axes.
#[derive(Clone, Debug)]
pub(crate) enum GiverHand {
    /// Of known joints.
    Jointed(Box<JointedHand>),
    /// Of a known surface.
    Meshed(MeshedHand),
}

/// A hand whose joints are known, in the client's frame and `OpenXR` axes.
#[derive(Clone, Debug)]
pub(crate) struct JointedHand {
    pub joints: HandJoints,
    /// The skin to pose on them.
    pub skin: Arc<Skin>,
    /// The field that gave the joints, for the error if they fold the skin.
    pub field: &'static str,
    /// What was repaired, for the report.
    pub warnings: Vec<String>,
}

impl GiverHand {
    fn jointed(hand: JointedHand) -> Self {
        Self::Jointed(Box::new(hand))
    }

    /// What was repaired, for the report.
    pub(crate) fn warnings(&self) -> &[String] {
        match self {
            Self::Jointed(hand) => &hand.warnings,
            Self::Meshed(_) => &[],
        }
    }

    /// Forgets what was repaired.
    pub(crate) fn forget_warnings(&mut self) {
        if let Self::Jointed(hand) = self {
            hand.warnings.clear();
        }
    }

    /// Moves it.
    pub(crate) fn move_by(&mut self, by: Pose) {
        match self {
            Self::Jointed(hand) => hand.joints = hand.joints.transformed(by),
            Self::Meshed(hand) => {
                for position in &mut hand.positions {
                    *position = by.transform_point(*position);
                }
                if let Some(wrist) = &mut hand.client_from_wrist {
                    *wrist = by * *wrist;
                }
            }
        }
    }
}

/// The giver's hand or another one to keep clear of; `None` if it is wrong.
pub(super) fn presenting_hand(
    field: Field<'_>,
    hand: v1::PresentingHand,
    frames: &Frames<'_>,
) -> Option<GiverHand> {
    let convention = frames.convention;
    match hand.form {
        None => field.reject("is empty; it must have a pose, joints or a mesh, or be absent"),
        Some(Form::Pose(pose)) => angled_hand(field.child("pose"), &pose, frames).map(GiverHand::jointed),
        Some(Form::Joints(joints)) => {
            tracked_hand(field.child("joints"), &joints, convention, AllowedGaps::Nothing)
                .map(GiverHand::jointed)
        }
        Some(Form::Mesh(mesh)) => meshed_hand(field.child("mesh"), &mesh, convention).map(GiverHand::Meshed),
    }
}

/// Further hands, at most so many, without those that are wrong.
pub(super) fn presenting_hands(
    field: Field<'_>,
    sent: Vec<v1::PresentingHand>,
    most: usize,
    frames: &Frames<'_>,
) -> Vec<GiverHand> {
    let sent = sent.into_iter().take(most).enumerate();
    sent.filter_map(|(place, sent)| presenting_hand(field.at(place), sent, frames))
        .collect()
}

/// The size of a hand relative to its rig; 1 if it is wrong.
pub(super) fn hand_scale(field: Field<'_>, scale: Option<f32>) -> f32 {
    let scale = scale.unwrap_or(1.0);
    if check_within(field, scale, HAND_SCALES) {
        scale
    } else {
        1.0
    }
}

/// The rig with a name like `rigs/adult`.
pub(super) fn rig_named(field: Field<'_>, name: &str, rigs: &RigStore) -> Option<Arc<StoredRig>> {
    let rig = rigs.named(name);
    if rig.is_none() && rigs.is_damaged(name) {
        field.add_damaged_rig(name);
    } else if rig.is_none() {
        field.add(format_args!(
            "is {}; the built-in rigs are {}, and no such rig was created",
            quoted(name),
            RIG_NAMES.map(name_of).join(" and ")
        ));
    }
    rig
}

/// The joints of a hand at rest, without radii where fingers are missing; `None` if they are wrong.
pub(super) fn joints_at_rest(
    field: Field<'_>,
    hand: &v1::HandJoints,
    warnings: &mut Vec<String>,
) -> Option<HandJoints> {
    let hand = tracked_hand(field, hand, Convention::OpenXr, AllowedGaps::Fingers)?;
    warnings.extend(hand.warnings);
    Some(hand.joints)
}

/// The direction against gravity, in `OpenXR` axes: a unit vector.
pub(super) fn up(field: Field<'_>, up: Option<v1::Vector3>, convention: Convention) -> Vec3 {
    up.and_then(|up| direction(field, up, convention))
        .unwrap_or_else(|| convention.up_in_openxr())
}
