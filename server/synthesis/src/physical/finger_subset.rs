//! A known grip without the fingers that collide with the giver.
//!
//! Usually only a finger or two collide, and the others often hold without them. The colliding fingers come to rest
//! where there is room; the rest of the hand stays as it is.

use super::{
    closer::Closer,
    closing::ClosedDigit,
    contacts::soften,
    grip::{Grip, Gripper, NoGrip},
    obstacle::Obstacle,
    scene::ObjectScene,
    shape::HandShape,
    solids::{HandSolids, PreparedHand},
};
use crate::{
    base::{rejection::Rejection, stopwatch::NoStopwatch},
    model::{
        grasp::Contact,
        hand::{Digit, HandPart, Phalanx, rig::Rig},
    },
};

/// A grip that is already known.
#[derive(Clone, Copy, Debug)]
pub struct KnownGrip<'a> {
    /// The grip.
    pub grip: &'a Grip,
    /// Its contacts.
    pub contacts: &'a [Contact],
    /// The solids of its hand.
    pub solids: &'a HandSolids,
}

impl Gripper {
    /// The grip with only the holding digits in `kept`, thumb first. The other holding digits, and idle ones that
    /// collide with the giver, move to rest. The grip's contacts are in `contacts` afterwards.
    ///
    /// # Errors
    /// The first check that fails.
    pub fn keep_fingers(
        &mut self,
        scene: &ObjectScene<'_>,
        rig: &Rig,
        known: &KnownGrip<'_>,
        kept: [bool; 5],
        giver: &PreparedHand,
    ) -> Result<(Grip, HandSolids), NoGrip> {
        let KnownGrip {
            grip,
            contacts,
            solids,
        } = known;
        let kept_contacts = contacts.iter().filter(|contact| contact.part.is_palm_or_in(kept));
        self.contacts.clear();
        self.contacts.extend(kept_contacts.copied());

        // Step 2, Finger Posing, for the fingers that hold nothing.
        self.obstacles.clear();
        self.obstacles.extend(Obstacle::of_palm(solids));
        self.obstacles.extend(Obstacle::of_thumb(solids));
        let closer = Closer {
            scene,
            giver: Some(giver),
            rig,
            shape: &HandShape::of_grip(rig, grip),
            object_from_wrist: grip.pose.frame_from_wrist,
        };
        let current = Digit::ALL.map(|digit| ClosedDigit {
            angles: grip.pose.digits[digit.index()],
            links: solids.phalanges[digit.index()],
            touches: Phalanx::ALL.map(|phalanx| {
                let part = HandPart::Phalanx(digit, phalanx);
                self.contacts.iter().any(|contact| contact.part == part)
            }),
        });
        let holding = grip.holding_digits();
        let mut digits = current;
        for finger in Digit::ALL.into_iter().skip(1) {
            let place = finger.index();
            let stays = kept[place] || !holding[place] && closer.is_clear_of_giver(&current[place]);
            if !stays {
                let flexion = closer.shape.resting_flexion(&current, place);
                let rested = closer.rest_clear(finger, &self.obstacles, flexion);
                digits[place] = rested.ok_or(NoGrip::Rejected(Rejection::FingerCollision))?;
            }
        }
        let posed = self.validate(&closer, &digits, &mut NoStopwatch)?;

        // Step 5, Immobility Validation. Last, because callers only pass subsets that are known to hold.
        soften(&self.contacts, scene.friction, &mut self.soft_contacts);
        // Step 5, Immobility Validation. Last, because callers only pass subsets that are known to hold.
        let epsilon = self.closure(scene);
        let epsilon = epsilon.ok_or(NoGrip::Rejected(Rejection::NotImmobilizing))?;
        Ok(posed.with_closure(epsilon))
    }
}
