//! The motion of a character's hand to the answered grasps: the client's part of a handover.
//!
//! The open hand waits, drawn back. It reaches a grasp by way points (drawn back, open at the object, closed), at a bounded speed.
//! Near the object, it follows its motion. A changed grasp that is near is approached directly; one whose straight path is not
//! free is reached over the way points of both.

use std::collections::VecDeque;

use glam::{Quat, Vec3};
use grasp_assets::hands::Hand;
use grasp_client::v1;
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::{
        DigitAngles,
        joints::{HandJoints, Skin},
        rig::Rig,
    },
};

use crate::{
    handover::CannotDraw,
    hands::{built_in, posed, synthesis_digits, synthesis_pose},
    parts::smoothstep,
};

/// Highest speed of the wrist in metres per second: a calm reach.
const TOP_SPEED: f32 = 1.1;

/// Speed per metre to the last way point, in 1/s, and lowest speed: the hand slows down before it arrives.
const SLOWING: f32 = 9.0;
const LAST_SPEED: f32 = 0.03;

/// Metres per radian in distances, of the wrist's orientation and of a finger's joint.
const METRES_PER_TURN: f32 = 0.25;
const METRES_PER_BEND: f32 = 0.22;

/// The hand turns to the next way point at this distance, in metres: corners are rounded.
const CORNER: f32 = 0.03;

/// Distances in metres: the hand fully follows an object nearer than the first, and not at all one farther than the second.
const CARRIED: (f32, f32) = (0.15, 0.45);

/// How far the open hand is drawn back without key frames, and how much nearer to its shoulder it waits, in metres.
const DRAWN_BACK: f32 = 0.1;
const WAITING_BACK: f32 = 0.2;

/// How open the drawn back hand is: 0 as closed as the grasp, 1 stretched.
const OPENNESS: f32 = 0.75;

/// Postures closer than this are the same, in metres.
const SAME: f32 = 1e-4;

#[derive(Clone, Copy, Debug)]
struct Posture {
    /// The wrist's `OpenXR` joint frame.
    wrist: Pose,
    digits: [DigitAngles; 5],
}

/// The way to a grasp, in the object's frame: drawn back, open at the object, closed.
type WayIn = [Posture; 3];

#[derive(Debug)]
pub(crate) struct Receiver {
    pub(crate) skin: &'static Skin,
    rig: Rig,
    /// In the client's frame, as [`Receiver::posture`].
    waiting: Posture,
    posture: Posture,
    /// Postures to pass, in the object's frame. A grasp that is held stays the last; without one, the hand goes on to wait.
    way: VecDeque<Posture>,
    hold: Option<WayIn>,
    client_from_object: Pose,
}

impl Receiver {
    /// A hand that will take `grasp` and waits for it, while the object is at `client_from_object`.
    pub(crate) fn waiting_for(grasp: &v1::Grasp, client_from_object: Pose) -> Result<Self, CannotDraw> {
        let hand = grasp.hand.clone().unwrap_or_default();
        let Hand { rig, skin } = built_in(&hand.rig, hand.handedness())?;
        let rig = rig.scaled(hand.size());
        let [back, ..] = way_in(grasp, &rig);
        let wrist = synthesis_pose(hand.client_from_object()) * back.wrist;
        let forearm = wrist.transform_vector(Vec3::Z);
        let home = grasp.arm.as_ref().map_or(forearm, |arm| {
            let shoulder = Vec3::from(arm.client_shoulder.unwrap_or_default());
            (shoulder - wrist.position).normalize_or(forearm)
        });
        let position = wrist.position + WAITING_BACK * home;
        let waiting = Posture {
            wrist: Pose { position, ..wrist },
            ..back
        };
        Ok(Self {
            skin,
            rig,
            waiting,
            posture: waiting,
            way: VecDeque::new(),
            hold: None,
            client_from_object,
        })
    }

    /// Reaches for a grasp, which replaces the previous one. `straight`: the straight path from there is free.
    pub(crate) fn take(&mut self, grasp: &v1::Grasp, straight: bool) {
        let new @ [.., closed] = way_in(grasp, &self.rig);
        let to_pass = self.way.len();
        match self.hold.replace(new) {
            Some([.., old]) if old.distance(&closed) < SAME => {}
            // On the way in: skips the way points already passed.
            Some(_) if to_pass > 1 => {
                self.way.truncate(to_pass.saturating_sub(new.len()));
                self.way.extend(&new[new.len().saturating_sub(to_pass)..]);
            }
            Some(_) if straight => self.way = [closed].into(),
            Some([back, open, _]) => self.way = [open, back].into_iter().chain(new).collect(),
            None => self.way.extend(new),
        }
    }

    /// Draws back from the grasp, by `withdrawal` if there is one, and waits.
    pub(crate) fn leave(&mut self, withdrawal: Option<&v1::HandPose>) {
        if let Some(old @ [back, open, _]) = self.hold.take() {
            let to_pass = self.way.len();
            self.way.truncate(to_pass.saturating_sub(old.len()));
            match (withdrawal, to_pass) {
                (Some(hand), _) => self.way.push_back(Posture::at_object(Some(hand))),
                (None, 0..=1) => self.way.extend([open, back]),
                (None, 2..=3) => self.way.push_back(back),
                // It is still drawing back from another one.
                (None, _) => {}
            }
        }
    }

    /// Moves on by `seconds`, in which the object has moved to `client_from_object`.
    pub(crate) fn advance(&mut self, seconds: f32, client_from_object: Pose) {
        self.follow(client_from_object);
        loop {
            let next = self.way.front();
            let next = next.map_or(self.waiting, |next| next.moved(client_from_object));
            let distance = self.posture.distance(&next);
            let is_last = self.way.len() <= usize::from(self.hold.is_some());
            if is_last || distance >= CORNER {
                let slow = (SLOWING * distance).max(LAST_SPEED);
                let speed = if is_last { TOP_SPEED.min(slow) } else { TOP_SPEED };
                let share = speed * seconds / distance;
                self.posture = if share < 1.0 {
                    self.posture.blended(&next, share)
                } else {
                    next
                };
                return;
            }
            self.way.pop_front();
        }
    }

    /// True while it has no grasp and is where it waits for one.
    pub(crate) fn is_waiting(&self) -> bool {
        self.hold.is_none() && self.posture.distance(&self.waiting) < SAME
    }

    pub(crate) fn joints(&self) -> HandJoints {
        posed(&self.rig, self.posture.wrist, self.posture.digits)
    }

    /// Follows the motion of a near object.
    fn follow(&mut self, client_from_object: Pose) {
        if let Some(next) = self.way.front() {
            let there = self.client_from_object.transform_point(next.wrist.position);
            let distance = self.posture.wrist.position.distance(there);
            let carried = self
                .posture
                .moved(client_from_object * self.client_from_object.inverse());
            let share = 1.0 - smoothstep(CARRIED.0, CARRIED.1, distance);
            self.posture = self.posture.blended(&carried, share);
        }
        self.client_from_object = client_from_object;
    }
}

fn way_in(grasp: &v1::Grasp, rig: &Rig) -> WayIn {
    let closed = Posture::at_object(grasp.hand.as_ref());
    let planned = |kind| {
        let mut frames = grasp.key_frames.iter();
        let frame = frames.find(|frame| frame.kind() == kind)?;
        Some(Posture::at_object(frame.hand.as_ref()))
    };
    let opened = Posture {
        digits: opened(closed.digits, rig),
        ..closed
    };
    let open = planned(v1::KeyFrameKind::PreGrasp).unwrap_or(opened);
    let drawn_back = planned(v1::KeyFrameKind::Approach).unwrap_or_else(|| {
        let mut back = opened;
        back.wrist.position += DRAWN_BACK * away_from_contacts(grasp, closed.wrist);
        back
    });
    [drawn_back, open, closed]
}

/// The direction from a grasp's contacts to its wrist, in the object's frame.
fn away_from_contacts(grasp: &v1::Grasp, object_from_wrist: Pose) -> Vec3 {
    let count = grasp.contacts.len().max(1) as f32;
    let sum: Vec3 = grasp.contacts.iter().map(v1::Contact::position).sum();
    let forearm = object_from_wrist.transform_vector(Vec3::Z);
    (object_from_wrist.position - sum / count).normalize_or(forearm)
}

impl Posture {
    /// The posture of a hand in the object's frame.
    fn at_object(hand: Option<&v1::HandPose>) -> Self {
        Self {
            wrist: synthesis_pose(hand.and_then(|hand| hand.object_from_wrist)),
            digits: hand.map(synthesis_digits).unwrap_or_default(),
        }
    }

    /// The same posture, moved rigidly.
    fn moved(&self, by: Pose) -> Self {
        Self {
            wrist: by * self.wrist,
            ..*self
        }
    }

    /// Distance in metres: the largest of the wrist's path and of turns and bends, converted to metres.
    fn distance(&self, other: &Self) -> f32 {
        let way = self.wrist.position.distance(other.wrist.position);
        let turn = angle_between(self.wrist.orientation, other.wrist.orientation);
        let bends = self.digits.iter().zip(&other.digits).flat_map(|(a, b)| {
            let (a, b) = (a.to_array(), b.to_array());
            [0, 1, 2, 3].map(|i| (a[i] - b[i]).abs())
        });
        let bend = bends.fold(0.0, f32::max);
        way.max(METRES_PER_TURN * turn).max(METRES_PER_BEND * bend)
    }

    /// The posture a share of the way to another one.
    fn blended(&self, other: &Self, share: f32) -> Self {
        let (from, to) = (self.wrist, other.wrist);
        Self {
            wrist: Pose {
                position: from.position.lerp(to.position, share),
                orientation: from.orientation.slerp(to.orientation, share),
            },
            digits: std::array::from_fn(|i| self.digits[i].toward(&other.digits[i], share)),
        }
    }
}

/// The angle of the rotation between two orientations, exact for small angles; 0 for a quaternion and its opposite.
fn angle_between(a: Quat, b: Quat) -> f32 {
    let chord = (a - b).length().min((a + b).length());
    4.0 * (0.5 * chord).min(1.0).asin()
}

/// Partly stretched fingers; the thumb turns no farther out of the palm.
fn opened(closed: [DigitAngles; 5], rig: &Rig) -> [DigitAngles; 5] {
    let mut stretched = rig.stretched();
    for (stretched, closed) in stretched.iter_mut().zip(&closed) {
        stretched.base_yaw = closed.base_yaw;
        *stretched = closed.toward(stretched, OPENNESS);
    }
    stretched
}

#[cfg(test)]
mod tests;
