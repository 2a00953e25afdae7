//! A known grip without the fingers that a giver is in the way of.
//!
//! Mostly not the whole hand is in a giver's way, but a finger or two; and often the others hold without them. Then those
//! fingers rest where there is room, and nothing else of the hand moves.

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

/// A grip that is known.
#[derive(Clone, Copy, Debug)]
pub struct WholeGrip<'a> {
    /// The grip.
    pub grip: &'a Grip,
    /// Where it touches.
    pub contacts: &'a [Contact],
    /// Its hand.
    pub solids: &'a HandSolids,
}

impl Gripper {
    /// The grip with only some of the digits that hold, `kept`, thumb first; the others that hold, and those that the giver is
    /// in the way of, rest anew. What it touches is in `contacts` afterwards.
    ///
    /// # Errors
    /// The first check that fails.
    pub fn spare(
        &mut self,
        scene: &ObjectScene<'_>,
        rig: &Rig,
        known: &WholeGrip<'_>,
        kept: [bool; 5],
        giver: &PreparedHand,
    ) -> Result<(Grip, HandSolids), NoGrip> {
        let WholeGrip {
            grip,
            contacts,
            solids,
        } = known;
        let of_kept = contacts.iter().filter(|contact| contact.part.is_palm_or_in(kept));
        self.contacts.clear();
        self.contacts.extend(of_kept.copied());

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
        let as_known = Digit::ALL.map(|digit| ClosedDigit {
            angles: grip.pose.digits[digit.index()],
            links: solids.phalanges[digit.index()],
            touches: Phalanx::ALL.map(|phalanx| {
                let part = HandPart::Phalanx(digit, phalanx);
                self.contacts.iter().any(|contact| contact.part == part)
            }),
        });
        let holding = grip.holding_digits();
        let mut digits = as_known;
        for finger in Digit::ALL.into_iter().skip(1) {
            let place = finger.index();
            let stays = kept[place] || !holding[place] && closer.is_clear_of_giver(&as_known[place]);
            if !stays {
                let flexion = closer.shape.resting_flexion(&as_known, place);
                let rested = closer.rest_clear(finger, &self.obstacles, flexion);
                digits[place] = rested.ok_or(NoGrip::Rejected(Rejection::FingerCollision))?;
            }
        }
        let posed = self.validate(&closer, &digits, &mut NoStopwatch)?;

        // Step 5, Immobility Validation: last, since sets of fingers are known to hold before they are asked to.
        soften(&self.contacts, scene.friction, &mut self.soft_contacts);
        let epsilon = self.closure(scene);
        let epsilon = epsilon.ok_or(NoGrip::Rejected(Rejection::NotImmobilizing))?;
        Ok(posed.with_closure(epsilon))
    }
}
