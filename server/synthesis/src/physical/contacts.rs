//! Where a closed hand meets the object: digits from all sides, and the palm.

use glam::Vec3;

use super::{
    closing::{ClosedDigit, TOUCHING},
    immobility::SoftContact,
    solids::{HandSolids, Touch, TrackedPalm, closest},
};
use crate::model::{
    grasp::Contact,
    hand::{Digit, HandPart, HandPose, Phalanx, rig::Rig},
    object::GraspObject,
};

/// Metres by which friction is multiplied to give the torsion that a fingertip bears per newton of normal force: two
/// thirds of the radius of a disk that is pressed evenly, of 5 mm here. A larger one lets two fingers hold what would
/// twist out of them.
pub(crate) const TORSION_LEVER: f32 = 0.0033;

/// Cosine of the angle up to which a contact's normal may differ from the direction to the bone: a touch, not a scrape.
const FACING_COS: f32 = 0.5;

/// Cosine of the angle up to which the way to the bone counts as the triangle's normal: places of touches are exact to some
/// hundredths of a millimetre, beside flesh that is 6 mm thick and more. A larger angle flattens edges that are blunt.
const INSIDE_COS: f32 = 0.9962;

/// Contacts of the palm are at least this far apart in metres: the solids that it is made of overlap, and several of them
/// touch with the same piece of skin. Fewer make the palm pivot, more cost time in the immobility checks.
const PALM_SPACING: f32 = 0.015;

/// How far from the palm that the joints' radii tell a contact of it may be, in metres. Flesh that stands farther off, as
/// the ball of the little finger does, gives way before it bears; and whoever draws the hand by its radii sees a contact in
/// the air there.
const PALM_SLACK: f32 = 0.0015;

/// Cosine of the angle up to which the palm's bone may lie off the way that a solid of it presses. The solids overlap: skin
/// that lies deeper in another one belongs to that one, which touches in a place of its own. A larger angle lets normals
/// leave those of the surface, a smaller one drops contacts where solids blend.
const OWN_COS: f32 = 0.985;

/// Puts the contacts of the digits that touch and of the palm into `contacts`, thumb first and the palm last. The pose is
/// that of the digits.
pub(super) fn collect_contacts(
    object: &GraspObject,
    rig: &Rig,
    pose: &HandPose,
    digits: &[ClosedDigit; 5],
    contacts: &mut Vec<Contact>,
) {
    let solids = &HandSolids::of_pose(rig, pose);
    contacts.clear();
    for (digit, closed) in Digit::ALL.into_iter().zip(digits) {
        for (phalanx, link) in Phalanx::ALL.into_iter().zip(&closed.links) {
            if !closed.touches[phalanx.index()] {
                continue;
            }
            let touch = closest(link, &object.surface, 0.0);
            contacts
                .extend(touch.and_then(|touch| contact(solids, &touch, HandPart::Phalanx(digit, phalanx))));
        }
    }
    let first_of_palm = contacts.len();
    let tracked = TrackedPalm::of_rig(rig, pose.frame_from_wrist);
    // The ball of the thumb gives way with its metacarpal, and the web is a fold of skin: neither bears anything.
    for solid in &solids.palm {
        let Some(touch) = closest(solid, &object.surface, TOUCHING) else {
            continue;
        };
        let is_new = |other: &Contact| other.position.distance(touch.point) >= PALM_SPACING;
        let is_own = || {
            let pressing = (solid.at(touch.along) - touch.point).normalize_or_zero();
            way_to_bone(solids, HandPart::Palm, touch.point).dot(pressing) >= OWN_COS
        };
        let is_tracked = || tracked.distance_of_skin(touch.point) <= PALM_SLACK;
        if contacts[first_of_palm..].iter().all(is_new) && is_own() && is_tracked() {
            contacts.extend(contact(solids, &touch, HandPart::Palm));
        }
    }
}

/// The contacts as soft fingers, for objects with a friction coefficient of `friction`.
pub(crate) fn soften<'a>(
    contacts: impl IntoIterator<Item = &'a Contact>,
    friction: f32,
    soft_contacts: &mut Vec<SoftContact>,
) {
    soft_contacts.clear();
    soft_contacts.extend(contacts.into_iter().map(|contact| SoftContact {
        position: contact.position,
        normal: contact.normal,
        digit: contact.part.digit(),
        friction,
        torsion_radius: friction * TORSION_LEVER,
    }));
}

/// True if something of the hand presses against the thumb: contacts whose normals differ by less than a right angle
/// never hold anything. It settles most hopeless grips before any force is solved for.
pub(super) fn are_opposed(contacts: &[Contact]) -> bool {
    contacts
        .iter()
        .enumerate()
        .any(|(i, a)| contacts[..i].iter().any(|b| a.normal.dot(b.normal) < 0.0))
}

/// The contact of a touch, if the surface faces the bone there.
fn contact(solids: &HandSolids, touch: &Touch, part: HandPart) -> Option<Contact> {
    let outward = way_to_bone(solids, part, touch.point);
    (outward.dot(touch.normal) >= FACING_COS).then(|| Contact {
        position: touch.point,
        normal: pressed_normal(outward, touch.normal),
        triangle: touch.triangle,
        part,
    })
}

/// The normal at a contact, of which place, part and triangle are known.
pub(crate) fn contact_normal(solids: &HandSolids, part: HandPart, point: Vec3, of_triangle: Vec3) -> Vec3 {
    pressed_normal(way_to_bone(solids, part, point), of_triangle)
}

/// Inside of a triangle, round flesh presses along its normal. At an edge or a corner it does so along one of the
/// directions between the normals that meet there: the way to the bone.
fn pressed_normal(way_to_bone: Vec3, of_triangle: Vec3) -> Vec3 {
    if way_to_bone.dot(of_triangle) > INSIDE_COS {
        of_triangle
    } else {
        way_to_bone
    }
}

/// The direction from a point of the surface to the bone of the part that touches there.
fn way_to_bone(solids: &HandSolids, part: HandPart, point: Vec3) -> Vec3 {
    let parts = match part {
        HandPart::Palm => solids.palm.as_slice(),
        HandPart::Phalanx(digit, phalanx) => {
            std::slice::from_ref(&solids.phalanges[digit.index()][phalanx.index()])
        }
    };
    let point = point.as_dvec3();
    let nearest = parts
        .iter()
        .map(|solid| (solid, solid.nearest(point)))
        .min_by(|(_, a), (_, b)| a.1.total_cmp(&b.1));
    nearest.map_or(Vec3::ZERO, |(solid, (along, _))| {
        let bone = solid.start.as_dvec3().lerp(solid.end.as_dvec3(), along);
        (bone - point).normalize_or_zero().as_vec3()
    })
}
