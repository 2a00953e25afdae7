//! How a character's hand moves to the grasps that it is answered: the client's part of a handover.
//!
//! The open hand waits where it was drawn back to. With a grasp it goes there by way points (drawn back, open at the object,
//! closed), at a bounded speed. Near the object it moves along with it, so that it holds still in the object's frame. A near grasp
//! is blended into; one whose straight way is not free is reached over the way points of both.

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

use super::{
    CannotDraw,
    hands::{built_in, posed, synthesis_digits, synthesis_pose},
};
use crate::scene::smoothstep;

/// Highest speed of the wrist in metres per second: a calm reach.
const TOP_SPEED: f32 = 1.1;

/// Speed per metre to the last way point, in 1/s, and lowest speed: the hand slows down before it arrives.
const SLOWING: f32 = 9.0;
const LAST_SPEED: f32 = 0.03;

/// Metres that a radian counts as, of the wrist's orientation and of a joint of the fingers.
const METRES_PER_TURN: f32 = 0.25;
const METRES_PER_BEND: f32 = 0.22;

/// Way points are left for the next one at this distance, in metres: corners are rounded.
const CORNER: f32 = 0.03;

/// The hand moves along with an object that is nearer than the first, and not at all with one farther than the second, in metres.
const CARRIED: (f32, f32) = (0.15, 0.45);

/// How far the open hand is drawn back without key frames, and how much nearer to its shoulder it waits, in metres.
const DRAWN_BACK: f32 = 0.1;
const WAITING_BACK: f32 = 0.2;

/// How open the drawn back hand is: 0 as closed as the grasp, 1 stretched.
const OPENNESS: f32 = 0.75;

/// Postures closer than this are the same, in metres.
const SAME: f32 = 1e-4;

/// A hand in some frame.
#[derive(Clone, Copy, Debug)]
struct Posture {
    /// The wrist's `OpenXR` joint frame.
    wrist: Pose,
    digits: [DigitAngles; 5],
}

/// A posture on the hand's way.
#[derive(Clone, Copy, Debug)]
enum WayPoint {
    /// In the object's frame.
    AtObject(Posture),
    /// In the client's frame.
    Away(Posture),
}

/// A grasp in the object's frame, and how to get there.
#[derive(Clone, Copy, Debug)]
struct Hold {
    drawn_back: Posture,
    open: Posture,
    closed: Posture,
}

/// A receiving hand that moves.
#[derive(Debug)]
pub(super) struct Receiver {
    pub(super) skin: &'static Skin,
    rig: Rig,
    /// In the client's frame, as [`Receiver::posture`].
    waiting: Posture,
    posture: Posture,
    way: VecDeque<WayPoint>,
    hold: Option<Hold>,
    client_from_object: Pose,
}

impl Receiver {
    /// A hand that will take `grasp` and waits for it, while the object is at `client_from_object`.
    pub(super) fn waiting_for(grasp: &v1::Grasp, client_from_object: Pose) -> Result<Self, CannotDraw> {
        let hand = grasp.hand.clone().unwrap_or_default();
        let Hand { rig, skin } = built_in(&hand.rig, hand.handedness())?;
        let rig = rig.scaled(hand.size());
        let back = Hold::of(grasp, &rig).drawn_back;
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

    /// Goes for a grasp, which replaces the one before. `straight`: the straight way from there is free.
    pub(super) fn take(&mut self, grasp: &v1::Grasp, straight: bool) {
        let new = Hold::of(grasp, &self.rig);
        let closing: [_; Hold::WAY] = [new.drawn_back, new.open, new.closed].map(WayPoint::AtObject);
        // What has been passed need not be passed again.
        let to_pass = self.way.len();
        let is_on_the_way_in = to_pass > 1;
        match self.hold.replace(new) {
            Some(old) if same(old.closed, new.closed) => {}
            Some(_) if straight && !is_on_the_way_in => self.way = [WayPoint::AtObject(new.closed)].into(),
            Some(old) if !is_on_the_way_in => {
                let leaving = [old.open, old.drawn_back].map(WayPoint::AtObject);
                self.way = leaving.into_iter().chain(closing).collect();
            }
            Some(_) => {
                self.way.truncate(to_pass.saturating_sub(Hold::WAY));
                let passed = Hold::WAY.saturating_sub(to_pass);
                self.way.extend(&closing[passed..]);
            }
            None => {
                // A hand that is drawing back does so first.
                self.way.retain(|point| matches!(point, WayPoint::AtObject(_)));
                self.way.extend(closing);
            }
        }
    }

    /// Draws back from the grasp, by `withdrawal` if there is one, and waits.
    pub(super) fn leave(&mut self, withdrawal: Option<&v1::HandPose>) {
        if let Some(old) = self.hold.take() {
            let leaving = match (withdrawal, self.way.len()) {
                (Some(hand), _) => vec![Posture::at_object(Some(hand))],
                (None, 0..=1) => vec![old.open, old.drawn_back],
                (None, to_pass) if to_pass <= Hold::WAY => vec![old.drawn_back],
                // It is still drawing back from another one.
                (None, _) => Vec::new(),
            };
            self.way.truncate(self.way.len().saturating_sub(Hold::WAY));
            self.way.extend(leaving.into_iter().map(WayPoint::AtObject));
            self.way.push_back(WayPoint::Away(self.waiting));
        }
    }

    /// Moves on, in `seconds` in which the object has got to `client_from_object`.
    pub(super) fn advance(&mut self, seconds: f32, client_from_object: Pose) {
        self.follow(client_from_object);
        while let Some(next) = self.way.front().map(|next| next.in_client(client_from_object)) {
            let distance = self.posture.distance(&next);
            if self.way.len() > 1 && distance < CORNER {
                self.way.pop_front();
                continue;
            }
            let slow = if self.way.len() > 1 {
                TOP_SPEED
            } else {
                (SLOWING * distance).max(LAST_SPEED)
            };
            let step = TOP_SPEED.min(slow) * seconds;
            self.posture = if distance <= step {
                next
            } else {
                self.posture.blended(&next, step / distance)
            };
            break;
        }
    }

    /// True while it has no grasp and is where it waits for one.
    pub(super) fn is_waiting(&self) -> bool {
        self.hold.is_none() && self.posture.distance(&self.waiting) < SAME
    }

    /// The joints, in the client's frame.
    pub(super) fn joints(&self) -> HandJoints {
        posed(&self.rig, self.posture.wrist, self.posture.digits)
    }

    /// Takes part in the motion of an object that the hand is near.
    fn follow(&mut self, client_from_object: Pose) {
        let moved = client_from_object * self.client_from_object.inverse();
        if let Some(WayPoint::AtObject(next)) = self.way.front() {
            let there = self.client_from_object.transform_point(next.wrist.position);
            let distance = self.posture.wrist.position.distance(there);
            let carried = Posture {
                wrist: moved * self.posture.wrist,
                ..self.posture
            };
            let share = 1.0 - smoothstep(CARRIED.0, CARRIED.1, distance);
            self.posture = self.posture.blended(&carried, share);
        }
        self.client_from_object = client_from_object;
    }
}

impl WayPoint {
    fn in_client(&self, client_from_object: Pose) -> Posture {
        match *self {
            Self::AtObject(posture) => Posture {
                wrist: client_from_object * posture.wrist,
                ..posture
            },
            Self::Away(posture) => posture,
        }
    }
}

impl Hold {
    /// Way points to a grasp.
    const WAY: usize = 3;

    fn of(grasp: &v1::Grasp, rig: &Rig) -> Self {
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
            let back = away_from_contacts(grasp, closed.wrist);
            let position = opened.wrist.position + DRAWN_BACK * back;
            Posture {
                wrist: Pose {
                    position,
                    ..opened.wrist
                },
                ..opened
            }
        });
        Self {
            drawn_back,
            open,
            closed,
        }
    }
}

/// The direction from a grasp's contacts to its wrist, in the object's frame.
fn away_from_contacts(grasp: &v1::Grasp, object_from_wrist: Pose) -> Vec3 {
    let count = grasp.contacts.len().max(1) as f32;
    let sum: Vec3 = grasp.contacts.iter().map(v1::Contact::position).sum();
    let forearm = object_from_wrist.transform_vector(Vec3::Z);
    (object_from_wrist.position - sum / count).normalize_or(forearm)
}

impl Posture {
    /// That of a hand in the object's frame.
    fn at_object(hand: Option<&v1::HandPose>) -> Self {
        Self {
            wrist: synthesis_pose(hand.and_then(|hand| hand.object_from_wrist)),
            digits: hand.map(synthesis_digits).unwrap_or_default(),
        }
    }

    /// How far the hand has to go, in metres: the way of the wrist, or turns and bends that take as long.
    fn distance(&self, other: &Self) -> f32 {
        let way = self.wrist.position.distance(other.wrist.position);
        let turn = angle_between(self.wrist.orientation, other.wrist.orientation);
        let bends = self.digits.iter().zip(&other.digits).flat_map(|(a, b)| {
            let (a, b) = (angles(a), angles(b));
            [0, 1, 2, 3].map(|i| (a[i] - b[i]).abs())
        });
        let bend = bends.fold(0.0, f32::max);
        way.max(METRES_PER_TURN * turn).max(METRES_PER_BEND * bend)
    }

    /// The posture a share of the way to another one.
    fn blended(&self, other: &Self, share: f32) -> Self {
        let mut digits = self.digits;
        for (digit, other) in digits.iter_mut().zip(&other.digits) {
            *digit = mixed(digit, other, share);
        }
        Self {
            wrist: Pose {
                position: self.wrist.position.lerp(other.wrist.position, share),
                orientation: self.wrist.orientation.slerp(other.wrist.orientation, share),
            },
            digits,
        }
    }
}

fn angles(digit: &DigitAngles) -> [f32; 4] {
    [
        digit.base_yaw,
        digit.base_pitch,
        digit.second_pitch,
        digit.third_pitch,
    ]
}

fn mixed(from: &DigitAngles, to: &DigitAngles, share: f32) -> DigitAngles {
    let mix = |from: f32, to: f32| from + share * (to - from);
    DigitAngles {
        base_yaw: mix(from.base_yaw, to.base_yaw),
        base_pitch: mix(from.base_pitch, to.base_pitch),
        second_pitch: mix(from.second_pitch, to.second_pitch),
        third_pitch: mix(from.third_pitch, to.third_pitch),
    }
}

/// The angle of the rotation from one orientation to another, exact for small ones; that of a quaternion and its opposite is 0.
fn angle_between(a: Quat, b: Quat) -> f32 {
    let chord = (a - b).length().min((a + b).length());
    4.0 * (0.5 * chord).min(1.0).asin()
}

/// Fingers on the way to stretched ones; the thumb turns no farther out of the palm than it is.
fn opened(closed: [DigitAngles; 5], rig: &Rig) -> [DigitAngles; 5] {
    let mut digits = closed;
    for (digit, stretched) in digits.iter_mut().zip(&rig.stretched()) {
        let stretched = DigitAngles {
            base_yaw: digit.base_yaw,
            ..*stretched
        };
        *digit = mixed(digit, &stretched, OPENNESS);
    }
    digits
}

/// True if a hand need not move to get from one posture to the other.
fn same(a: Posture, b: Posture) -> bool {
    a.distance(&b) < SAME
}

#[cfg(test)]
mod tests;
