//! Two hands that hold an object together: closure and balance by the contacts of both.

use glam::Vec3;

use super::{
    contacts::soften,
    grip::Grip,
    immobility::{Balance, Buffers, MAX_CONTACTS, SoftContact, balance, epsilon},
    scene::ObjectScene,
    solids::{HandSolids, PreparedHand, TrackedSolids},
};
use crate::{
    base::{
        rejection::Rejection,
        stopwatch::{Step, Stopwatch},
    },
    model::{grasp::Contact, hand::rig::Rig},
};

/// Clearance between a person's two hands and forearms, in metres. Larger values find fewer holds of small objects.
const HANDS_CLEARANCE: f32 = 0.001;

/// One of two hands that hold together.
#[derive(Clone, Debug)]
pub(crate) struct HalfGrip {
    /// The closed hand; its epsilon is 0.
    pub grip: Grip,
    /// Its solids.
    pub solids: HandSolids,
    /// Its contacts, in the order of [`crate::model::grasp::Grasp::contacts`].
    pub contacts: Vec<Contact>,
}

/// How two hands hold an object.
#[derive(Clone, Debug)]
pub(crate) struct SharedHold {
    /// Ferrari-Canny epsilon of all contacts.
    pub epsilon: f32,
    /// The same as a multiple of the required one.
    pub relative_closure: f32,
    /// Each hand's part of the forces that balance gravity, one entry per contact.
    pub balances: [Balance; 2],
}

impl HalfGrip {
    /// The hand and its forearm as another hand meets them.
    pub(crate) fn tracked(&self, rig: &Rig) -> TrackedSolids {
        TrackedSolids::of_rig(rig, self.grip.pose.frame_from_wrist, &self.solids)
    }
}

/// True if a hand and its forearm are clear of the same person's other ones.
pub(crate) fn are_clear(hand: &PreparedHand, other: &TrackedSolids) -> bool {
    !hand.comes_within(other.iter(), HANDS_CLEARANCE)
}

/// Closure, and forces that balance gravity, by all contacts of two hands. `up` is a unit vector against gravity, in the
/// object's frame.
///
/// # Errors
/// `NotImmobilizing` if the contacts have no closure or cannot bear the weight.
pub(crate) fn hold_together(
    scene: &ObjectScene<'_>,
    up: Vec3,
    halves: [&HalfGrip; 2],
    buffers: &mut Buffers,
    stopwatch: &mut Stopwatch<'_>,
) -> Result<SharedHold, Rejection> {
    let bearing = bearing_contacts(halves.map(|half| half.contacts.as_slice()));
    let of_both = || bearing.iter().map(|&(hand, place)| &halves[hand].contacts[place]);
    let mut soft: Vec<SoftContact> = Vec::with_capacity(bearing.len());
    soften(of_both(), scene.friction, &mut soft);
    let load = scene.load(&soft, up);
    let required = scene.required_epsilon(&load.torque_scale);
    let epsilon = epsilon(&soft, &load, required, buffers);
    let is_closed = epsilon > 0.0 && epsilon >= required;
    let balance = is_closed.then(|| balance(&soft, &load, buffers)).flatten();
    stopwatch.lap(Step::ImmobilityValidation);
    let balance = balance.ok_or(Rejection::NotImmobilizing)?;
    let balances = [0, 1].map(|hand| {
        let count = halves[hand].contacts.len();
        let mut part = Balance {
            forces: vec![Vec3::ZERO; count],
            torsions: vec![0.0; count],
            ..balance
        };
        for (k, &(of_hand, place)) in bearing.iter().enumerate() {
            if of_hand == hand {
                part.forces[place] = balance.forces[k];
                part.torsions[place] = balance.torsions[k];
            }
        }
        part
    });
    Ok(SharedHold {
        epsilon,
        relative_closure: epsilon / required,
        balances,
    })
}

/// Hand and place of the contacts that bear load: all, or the [`MAX_CONTACTS`] that are left without those closest to
/// another one of their hand, which add least.
fn bearing_contacts(contacts: [&[Contact]; 2]) -> Vec<(usize, usize)> {
    let mut bearing: Vec<(usize, usize)> = (0..2)
        .flat_map(|hand| (0..contacts[hand].len()).map(move |place| (hand, place)))
        .collect();
    while bearing.len() > MAX_CONTACTS {
        let position = |(hand, place): (usize, usize)| contacts[hand][place].position;
        let room = |&of: &(usize, usize)| {
            let others = bearing.iter().filter(|&&other| other != of && other.0 == of.0);
            others.fold(f32::INFINITY, |least, &other| {
                least.min(position(of).distance_squared(position(other)))
            })
        };
        let crowded = (0..bearing.len()).min_by(|&a, &b| room(&bearing[a]).total_cmp(&room(&bearing[b])));
        let Some(crowded) = crowded else { break };
        bearing.remove(crowded);
    }
    bearing
}
