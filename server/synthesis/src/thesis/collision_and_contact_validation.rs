//! Step 3, Collision Validation: Algorithm 6 (`COLLIDESWITHMESH`) for the object and for the presenting hand. Step 4, Contact
//! Validation: Algorithm 7 (`COLLIDESWITHFORBIDDENSURFACE`).
//!
//! The 25 collision segments are the rig's ten palm segments and the fifteen bones of the digits. A segment collides if
//! it crosses the mesh or lies inside it. As in Table 5.2, palm and finger collisions are separate rejections; the palm is
//! tested first.

use glam::Vec3;

use super::{finger_posing::PosedDigit, wrist_placement::WristFrame};
use crate::{
    base::rejection::Rejection,
    geometry::{Segment, mesh_bvh::MeshBvh},
    model::{
        grasp::Contact,
        hand::{Digit, HandPart, Phalanx, rig::Rig},
        holdout::Holdout,
        object::GraspObject,
    },
};

/// Tests the posed hand against the object and the presenting hand.
///
/// # Panics
/// If the presenting hand has no surface; `THESIS` validity requires one.
pub fn collision(
    holdout: &Holdout,
    rig: &Rig,
    wrist: &WristFrame,
    digits: &[PosedDigit; 5],
) -> Option<Rejection> {
    let object = &holdout.object.surface;
    let giver = holdout.presenting_hand.as_ref().map(|hand| {
        hand.surface()
            .expect("THESIS validity needs a mesh of the giver's hand")
    });
    let palm = rig.palm_segments.map(|segment| {
        Segment::new(
            wrist.transform_point(segment.start),
            wrist.transform_point(segment.end),
        )
    });
    let palm_collides = |mesh: &MeshBvh| palm_collides_with_mesh(&palm, mesh);
    if palm_collides(object) || giver.is_some_and(palm_collides) {
        return Some(Rejection::PalmCollision);
    }
    let fingers_collide = |mesh: &MeshBvh| {
        digits
            .iter()
            .any(|digit| digit_collides_with_mesh(&digit.joints, mesh))
    };
    (fingers_collide(object) || giver.is_some_and(fingers_collide)).then_some(Rejection::FingerCollision)
}

/// True if a segment crosses the mesh or lies inside it. A segment that does not cross is inside if its start is.
fn palm_collides_with_mesh(segments: &[Segment], mesh: &MeshBvh) -> bool {
    segments.iter().any(|&segment| mesh.is_crossed_by(segment))
        || segments.iter().any(|segment| mesh.contains(segment.start))
}

/// The same for the bones of a digit. They form a chain: if none crosses the mesh, all are inside if its base is.
fn digit_collides_with_mesh(joints: &[Vec3; 4], mesh: &MeshBvh) -> bool {
    joints
        .windows(2)
        .any(|bone| mesh.is_crossed_by(Segment::new(bone[0], bone[1])))
        || mesh.contains(joints[0])
}

/// Replaces `contacts` with those of the posed digits, thumb first, from the proximal to the distal phalanx.
pub(crate) fn collect_contacts(object: &GraspObject, digits: &[PosedDigit; 5], contacts: &mut Vec<Contact>) {
    contacts.clear();
    for (digit, posed) in Digit::ALL.into_iter().zip(digits) {
        for (phalanx, hit) in Phalanx::ALL.into_iter().zip(posed.hits) {
            contacts.extend(hit.map(|hit| Contact {
                position: hit.position,
                normal: object.surface.mesh().normal(hit.triangle as usize),
                triangle: hit.triangle,
                part: HandPart::Phalanx(digit, phalanx),
            }));
        }
    }
}

/// `COLLIDESWITHFORBIDDENSURFACE`: true if a contact lies on a forbidden triangle of the object.
pub(crate) fn touches_forbidden_surface(object: &GraspObject, contacts: &[Contact]) -> bool {
    contacts
        .iter()
        .any(|contact| object.is_forbidden(contact.triangle))
}
