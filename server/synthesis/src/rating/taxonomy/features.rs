//! What a posed hand and its contacts tell about the type of a grasp: numbers without unit that are the same for a left
//! and a right hand, for hands of any size and wherever the hand is.

use glam::Vec3;

use super::membership::{falling, rising};
use crate::{
    base::pose::Pose,
    model::{
        grasp::Contact,
        hand::{
            DigitAngles, HandPart, HandPose, Handedness,
            kinematics::{DigitFrames, digit_frames},
            rig::Rig,
        },
    },
};

/// Length of a vector below which it has no direction: of unit vectors that cancel each other, and of distances in hand
/// lengths, where it is a fifth of a millimetre. A larger one leaves more grasps without.
const SHORTEST: f32 = 1e-3;

/// Sines of the angle off a link's pad between which a touch begins and ceases to be one of its side: about 35° and 55°.
/// Smaller ones take more pads for sides.
const SIDE: [f32; 2] = [0.57, 0.82];

/// Shares of a push along the link, as [`Touch::local`] has it, between which a pad's touch becomes one of the tip: pushes
/// about 30° and 50° off the pad's own direction. Smaller ones take more pads for tips.
const TIP: [f32; 2] = [0.26, 0.43];

/// Negative cosines between two presses from which they begin to count as opposed, and from which they do in full: 90° and
/// 120° apart, as around a rod that three digits hold. Larger ones ask for presses more nearly straight against each other.
const OPPOSED: [f32; 2] = [0.0, 0.5];

/// Negative cosine between two pushes from which the distance of their touches tells a thickness: 75° apart. Larger ones
/// leave more grasps without one.
const APART: f32 = -0.25;

/// How much a finger holds with more than its tip if its second link touches without and with the third: the second one
/// often lies on what the tip holds. Larger ones make more grasps powerful.
const SECOND_ALONE: f32 = 0.7;
const SECOND_BESIDE_THIRD: f32 = 0.35;

/// What a link or the palm touches with. Positions and lengths in hand lengths (the rig's reach), in the wrist frame of a
/// right hand: +x to the thumb's side, +y along the fingers, +z out of the palm.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Touch {
    /// Where.
    pub(super) position: Vec3,
    /// Into the object, a unit vector.
    pub(super) push: Vec3,
    /// Halfway between the push and the way from the bone to the touch, a unit vector: on a thin rod, where the surface
    /// faces every way, it tells better than the push which side of the link touches.
    pub(super) press: Vec3,
    /// The press in the link's own axes: x to the thumb's side, y along the link, z out of the pad.
    pub(super) local: Vec3,
}

/// What a finger does.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Finger {
    /// True if it touches.
    pub(super) touches: bool,
    /// How much it holds with more than its last link, 0 to 1.
    pub(super) inner: f32,
    /// Where it touches, nearest to the tip.
    pub(super) position: Vec3,
    /// Sum of the pushes of its links, a unit vector.
    pub(super) push: Vec3,
    /// Sum of their presses, a unit vector.
    pub(super) press: Vec3,
    /// How surely a pad touches, 0 to 1.
    pub(super) pad: f32,
    /// How surely the side to the thumb touches, 0 to 1.
    pub(super) thumbward: f32,
    /// How surely the side to the little finger touches, 0 to 1.
    pub(super) littleward: f32,
    /// How surely the last link touches with its very tip, 0 to 1.
    pub(super) tip: f32,
    /// Bend of the first joint, in radians.
    pub(super) knuckle: f32,
    /// Bend of the second and third joint together, in radians.
    pub(super) curl: f32,
}

/// What the thumb does.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Thumb {
    /// True if one of its two phalanges touches: its metacarpal is part of the palm.
    pub(super) touches: bool,
    /// True if more than its last link touches.
    pub(super) is_inner: bool,
    /// Sum of the presses of its phalanges, a unit vector.
    pub(super) press: Vec3,
    /// How surely the last link touches with its very tip, 0 to 1.
    pub(super) tip: f32,
    /// How far its tip is lifted off the palm's plane, in hand lengths.
    pub(super) height: f32,
    /// Along its last link, a unit vector.
    pub(super) along: Vec3,
}

/// Everything that the types are told apart by.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Features {
    /// The thumb.
    pub(super) thumb: Thumb,
    /// Index, middle, ring and little finger.
    pub(super) fingers: [Finger; 4],
    /// One bit for each finger that touches, the index finger's the lowest.
    pub(super) touching: u8,
    /// True if the palm touches.
    pub(super) palm_touches: bool,
    /// How surely palm or roots of the fingers bear the object, 0 to 1.
    pub(super) palm_support: f32,
    /// Distance between the touches that oppose each other best, along their pushes, in hand lengths; 0 if none do.
    pub(super) thickness: f32,
    /// How much the pushes of the first and the last finger converge: 0 on a prism, the chord over the radius on a
    /// ball. Negative if they part.
    pub(super) convergence: f32,
    /// How much the digits push back toward the palm, -1 to 1: 0 around the rim of a disk that the palm faces.
    pub(super) pull: f32,
}

impl Features {
    /// Looks at a posed hand. Contacts and pose are in the same frame, in metres.
    pub(super) fn of(rig: &Rig, pose: &HandPose, contacts: &[Contact]) -> Self {
        let hand = Frame::new(rig, pose);
        let mut touches = [[None; 3]; 5];
        let mut palm: Option<Touch> = None;
        let frames: [DigitFrames; 5] =
            std::array::from_fn(|i| digit_frames(&rig.digits[i], Pose::IDENTITY, pose.digits[i]));
        for contact in contacts {
            match contact.part {
                HandPart::Phalanx(digit, phalanx) => {
                    let frames = &frames[digit.index()];
                    let touch = hand.touch(contact, frames.links[phalanx.index()]);
                    // The last one of a link counts: grasps have one each.
                    touches[digit.index()][phalanx.index()] = Some(touch);
                }
                HandPart::Palm => palm = Some(hand.palm_touch(contact)),
            }
        }
        let [of_thumb, of_fingers @ ..] = &touches;
        let thumb = thumb(of_thumb, &hand, &frames[0]);
        let fingers = std::array::from_fn(|i| finger(&of_fingers[i], &pose.digits[i + 1]));
        let palm = palm.or(of_thumb[0]);
        let touching = (0..4).filter(|&i| fingers[i].touches).map(|i| 1 << i).sum();
        Self {
            thumb,
            fingers,
            touching,
            palm_touches: palm.is_some(),
            palm_support: palm_support(palm.is_some(), of_fingers),
            thickness: thickness(palm, &touches),
            convergence: convergence(&fingers),
            pull: pull(palm, hand.position(rig.palm), &touches),
        }
    }

    /// The fingers that touch.
    pub(super) fn touching_fingers(&self) -> impl Iterator<Item = &Finger> {
        self.fingers.iter().filter(|finger| finger.touches)
    }

    /// The mean of a figure over the fingers that touch; 0 if none does.
    pub(super) fn mean(&self, figure: impl Fn(&Finger) -> f32) -> f32 {
        let count = self.touching.count_ones().max(1) as f32;
        self.touching_fingers().map(figure).sum::<f32>() / count
    }

    /// Sum of the presses of the touching fingers' pads, a unit vector or zero.
    pub(super) fn pads_press(&self) -> Vec3 {
        let sum: Vec3 = self
            .touching_fingers()
            .map(|finger| finger.press * finger.pad)
            .sum();
        direction(sum)
    }
}

/// How surely two pushes are opposed, 0 to 1.
pub(super) fn opposed(a: Vec3, b: Vec3) -> f32 {
    rising(-a.dot(b), OPPOSED)
}

/// From the frame of contacts, and from the rig's wrist frame, to that of a right hand of length one.
struct Frame {
    wrist_from_object: Pose,
    flip: Vec3,
    per_metre: f32,
}

impl Frame {
    fn new(rig: &Rig, pose: &HandPose) -> Self {
        let flip = match rig.handedness {
            Handedness::Right => Vec3::ONE,
            Handedness::Left => Vec3::new(-1.0, 1.0, 1.0),
        };
        Self {
            wrist_from_object: pose.frame_from_wrist.inverse(),
            flip,
            per_metre: 1.0 / rig.reach.max(f32::MIN_POSITIVE),
        }
    }

    /// A point of the wrist frame.
    fn position(&self, point: Vec3) -> Vec3 {
        point * self.flip * self.per_metre
    }

    /// A direction of the wrist frame.
    fn direction(&self, vector: Vec3) -> Vec3 {
        vector * self.flip
    }

    /// A contact of the link whose frame is `wrist_from_link`.
    fn touch(&self, contact: &Contact, wrist_from_link: Pose) -> Touch {
        let position = self.wrist_from_object.transform_point(contact.position);
        let inward = -self.wrist_from_object.transform_vector(contact.normal);
        let link_from_wrist = wrist_from_link.inverse();
        let in_link = link_from_wrist.transform_point(position);
        let from_bone = (in_link * Vec3::new(1.0, 0.0, 1.0)).normalize_or_zero();
        let mut local = link_from_wrist.transform_vector(inward);
        // The thesis' lines on the finger fronts may meet a surface from inside: no hand pulls, so the push is outward.
        if local.dot(from_bone) < 0.0 {
            local = -local;
        }
        let press = direction(local + from_bone);
        Touch {
            position: self.position(position),
            push: self.direction(wrist_from_link.transform_vector(local)),
            press: self.direction(wrist_from_link.transform_vector(press)),
            local: press * self.flip,
        }
    }

    /// A contact of the palm, which can only push outward.
    fn palm_touch(&self, contact: &Contact) -> Touch {
        let inward = -self.wrist_from_object.transform_vector(contact.normal);
        let outward = if inward.z < 0.0 { -inward } else { inward };
        Touch {
            position: self.position(self.wrist_from_object.transform_point(contact.position)),
            push: self.direction(outward),
            press: self.direction(outward),
            local: self.direction(outward),
        }
    }
}

fn finger(touches: &[Option<Touch>; 3], angles: &DigitAngles) -> Finger {
    let mut finger = Finger {
        knuckle: angles.base_pitch,
        curl: angles.second_pitch + angles.third_pitch,
        ..Finger::default()
    };
    finger.inner = match touches.each_ref().map(Option::is_some) {
        [true, ..] => 1.0,
        [_, true, false] => SECOND_ALONE,
        [_, true, true] => SECOND_BESIDE_THIRD,
        [_, false, _] => 0.0,
    };
    for touch in touches.iter().flatten() {
        finger.touches = true;
        finger.position = touch.position;
        finger.push += touch.push;
        finger.press += touch.press;
        let thumbward = rising(touch.local.x, SIDE);
        let littleward = rising(-touch.local.x, SIDE);
        finger.thumbward = finger.thumbward.max(thumbward);
        finger.littleward = finger.littleward.max(littleward);
        finger.pad = finger.pad.max(1.0 - thumbward.max(littleward));
    }
    finger.push = direction(finger.push);
    finger.press = direction(finger.press);
    finger.tip = tip(touches[2]);
    finger
}

fn thumb(touches: &[Option<Touch>; 3], hand: &Frame, frames: &DigitFrames) -> Thumb {
    let [_, second, third] = touches;
    let press = [second, third]
        .into_iter()
        .flatten()
        .map(|touch| touch.press)
        .sum();
    Thumb {
        touches: second.is_some() || third.is_some(),
        is_inner: second.is_some(),
        press: direction(press),
        tip: tip(*third),
        height: hand.position(frames.tip).z,
        along: hand.direction(frames.links[2].transform_vector(Vec3::Y)),
    }
}

/// How surely a last link touches with its very tip: it pushes along itself rather than out of its pad.
fn tip(third: Option<Touch>) -> f32 {
    third.map_or(0.0, |touch| rising(touch.local.y, TIP))
}

/// The palm bears what it touches, and what lies at the roots of two fingers lies at the palm.
fn palm_support(palm_touches: bool, fingers: &[[Option<Touch>; 3]]) -> f32 {
    let roots = fingers.iter().filter(|finger| finger[0].is_some()).count();
    match roots {
        _ if palm_touches => 1.0,
        0 => 0.0,
        1 => 0.2,
        _ => 0.8,
    }
}

fn thickness(palm: Option<Touch>, touches: &[[Option<Touch>; 3]; 5]) -> f32 {
    let all = || touches.as_flattened().iter().flatten().chain(palm.as_ref());
    let mut best = APART;
    let mut thickness = 0.0;
    for (i, a) in all().enumerate() {
        for b in all().skip(i + 1) {
            let against = -a.push.dot(b.push);
            if against > best {
                best = against;
                // On a ball or a cylinder two touches are apart by their pushes' difference times the radius, on a plate
                // by its thickness.
                let apart = b.push - a.push;
                thickness = 2.0 * (a.position - b.position).dot(apart) / apart.length_squared();
            }
        }
    }
    thickness.max(0.0)
}

/// How much the digits push against the palm's own push or, where it does not touch, away from what is in front of it.
fn pull(palm: Option<Touch>, middle_of_palm: Vec3, touches: &[[Option<Touch>; 3]; 5]) -> f32 {
    let outermost = || {
        touches
            .iter()
            .filter_map(|digit| digit[1..].iter().flatten().last())
    };
    let count = outermost().count().max(1) as f32;
    let away = palm.map_or_else(
        || direction(outermost().map(|touch| touch.position).sum::<Vec3>() / count - middle_of_palm),
        |palm| palm.push,
    );
    -outermost().map(|touch| touch.push.dot(away)).sum::<f32>() / count
}

fn convergence(fingers: &[Finger; 4]) -> f32 {
    let mut touching = fingers.iter().filter(|finger| finger.touches);
    let (Some(first), Some(last)) = (touching.next(), touching.next_back()) else {
        return 0.0;
    };
    let across = direction(last.position - first.position);
    (first.push - last.push).dot(across)
}

/// How surely a bend in radians, given in degrees here, is small or large.
pub(super) fn bent(angle: f32, degrees: [f32; 2]) -> f32 {
    rising(angle, degrees.map(f32::to_radians))
}

/// The opposite of [`bent`].
pub(super) fn straight(angle: f32, degrees: [f32; 2]) -> f32 {
    falling(angle, degrees.map(f32::to_radians))
}

/// The unit vector along another, zero if there is none.
fn direction(vector: Vec3) -> Vec3 {
    if vector.length() < SHORTEST {
        Vec3::ZERO
    } else {
        vector.normalize_or_zero()
    }
}
