//! Refuses preferred grips that no search could ever answer: at the object's own size, without anything in the way, the hand is
//! inside the object or hardly touches it. Mostly, the wrist is in another convention or frame.

use grasp_proto::v1;
use grasp_synthesis::{
    base::stop::Stop,
    model::{
        hand::{HandPose, Handedness, rig::Rig},
        object::GraspObject,
        strategy::Validity,
    },
    physical::{
        grip::{FEWEST_CONTACTS, Gripper, MAX_PENETRATION, Misfit},
        presented::ObjectScene,
    },
};

use super::StoredObject;
use crate::{
    convention::Convention,
    error::ServiceError,
    validate::{GripKind, Violations},
};

/// What a wrist may be given in.
const CONVENTIONS: [v1::Convention; 6] = [
    v1::Convention::Openxr,
    v1::Convention::Unity,
    v1::Convention::UnityFlipX,
    v1::Convention::Unreal,
    v1::Convention::UnrealXzy,
    v1::Convention::Godot,
];

/// Checks the preferred grips of an object of whose rigs `rig` knows the hand.
///
/// # Errors
/// [`ServiceError::Invalid`] with each grip that cannot be right, [`ServiceError::Cancelled`] if it was stopped.
pub(crate) fn check_grips(
    stored: &StoredObject,
    rig: impl Fn(&str, Handedness) -> Option<Rig>,
    stop: Stop<'_>,
) -> Result<(), ServiceError> {
    let grips = &stored.given.grips;
    let is_preferred = |kind: Option<GripKind>| matches!(kind, Some(GripKind::Preferred(_)));
    if !grips.iter().any(|grip| is_preferred(grip.kind)) {
        return Ok(());
    }
    let object = GraspObject::of_until(stored.object.clone(), stop)?;
    let scene = ObjectScene::new(&object, object.friction_under(Validity::Physical));
    let mut gripper = Gripper::default();
    let violations = Violations::default();
    let rigs = stored.given.rigs(rig);
    for (place, (grip, rig)) in grips.iter().zip(&rigs).enumerate() {
        stop.check()?;
        let (Some(GripKind::Preferred(preferred)), Some(rig)) = (grip.kind, rig) else {
            continue;
        };
        let pose = preferred.pose(rig);
        let Some(misfit) = gripper.misfit(&scene, rig, &pose) else {
            continue;
        };
        let fits = |convention: &v1::Convention| {
            let elsewhere = HandPose {
                frame_from_wrist: grip.wrist_in(Convention::from_wire(*convention)),
                ..pose
            };
            gripper.misfit(&scene, rig, &elsewhere).is_none()
        };
        let object_field = violations.field("object");
        let grip_field = object_field.child("known_grips").at(place);
        let field = grip_field.child("hand");
        let meant = CONVENTIONS.into_iter().find(fits);
        match meant {
            Some(convention) => violations.add(
                field.child("convention"),
                format_args!(
                    "of {:?} does not suit the wrist: the hand {}; in {} it would not",
                    grip.given.name,
                    in_words(misfit),
                    convention.as_str_name()
                ),
            ),
            None => violations.add(
                field.child("object_from_wrist"),
                format_args!(
                    "of {:?} cannot be right: the hand {}; give the wrist of an answer for the object at its own size, and its convention",
                    grip.given.name,
                    in_words(misfit)
                ),
            ),
        }
    }
    violations.finish(())
}

/// What is wrong with a hand.
fn in_words(misfit: Misfit) -> String {
    let most = 1e3 * MAX_PENETRATION;
    match misfit {
        Misfit::Palm(depth) => {
            let depth = 1e3 * depth;
            format!("has palm or forearm {depth:.1} mm deep in the object, at most {most} mm is flesh")
        }
        Misfit::Digits => {
            format!("has digits more than {most} mm deep in the object or itself, however they bend")
        }
        Misfit::Contacts(count) => {
            format!("touches the object with {count} of its parts, a grip takes {FEWEST_CONTACTS}")
        }
    }
}
