//! The features of a posed hand and its contacts that determine the grasp type: dimensionless, and invariant to handedness, hand
//! size and pose.

use glam::Vec3;

use super::held_part::{HeldPart, falling, rising};
use crate::{
    base::pose::Pose,
    geometry::local_shape::LocalShape,
    model::{
        grasp::Contact,
        hand::{
            DigitAngles, HandPart, HandPose, Handedness,
            kinematics::{DigitFrames, digit_frames},
            rig::Rig,
        },
    },
};

/// Length below which a vector has no direction.
const MIN_LENGTH: f32 = 1e-3;

/// Sine of the angle off a link's pad over which a contact turns from pad to side: about 30° to 60°.
const SIDE: [f32; 2] = [0.5, 0.87];

/// Component of [`Touch::local`] along the link over which a contact turns from pad to tip: pushes about 30° to 50° off the pad's
/// normal. Smaller values count more pad contacts as tip contacts.
const TIP: [f32; 2] = [0.26, 0.43];

/// Negative cosine between two presses over which they become opposed: 90° to 120° apart; 120° as around a rod held by three
/// digits. Larger values require more exactly opposite presses.
const OPPOSED: [f32; 2] = [0.0, 0.5];

/// Minimum negative cosine between two pushes for their distance to count as a thickness: 105° apart.
const THICKNESS_OPPOSITION: f32 = 0.25;

/// Power with which such pairs count more, the more opposed they are.
const THICKNESS_POWER: i32 = 2;

/// Weight of the diameter of the held part itself, which decides where no contacts are opposed: a fifth of that of an exactly
/// opposed pair.
const PART_WEIGHT: f32 = 0.1;

/// [`Finger::inner`] if the second link touches but the third does not. A larger one classifies more grasps as power grasps.
const SECOND_LINK_ALONE: f32 = 0.7;

/// [`Finger::inner`] if the second and third link touch: the second often merely rests on an object that the tip holds.
const SECOND_AND_THIRD_LINK: f32 = 0.35;

/// A contact of a link or the palm.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Touch {
    pub(super) position: Vec3,
    /// Direction into the object, a unit vector.
    pub(super) push: Vec3,
    /// Bisector of the push and the direction from the bone to the contact, a unit vector.
    pub(super) press: Vec3,
    /// The press in the link's own axes: x to the thumb's side, y along the link, z out of the pad.
    pub(super) local: Vec3,
}

/// The features of a finger. Degrees of membership are from 0 to 1.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Finger {
    pub(super) touches: bool,
    /// Degree to which it holds with more than its last link, 0 to 1.
    pub(super) inner: f32,
    pub(super) position: Vec3,
    /// Mean direction of its links' pushes, a unit vector or zero.
    pub(super) push: Vec3,
    /// Mean direction of its links' presses, a unit vector or zero.
    pub(super) press: Vec3,
    /// Degree to which a pad touches.
    pub(super) pad: f32,
    /// Degree to which its radial side (toward the thumb) touches.
    pub(super) radial: f32,
    /// Degree to which its ulnar side (toward the little finger) touches.
    pub(super) ulnar: f32,
    /// Degree to which the last link touches with its very tip.
    pub(super) tip: f32,
    /// Flexion of the first joint, in radians.
    pub(super) knuckle: f32,
    /// Flexion of the second and third joints together, in radians.
    pub(super) curl: f32,
}

/// The features of the thumb.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Thumb {
    /// True if one of its two phalanges touches. Its metacarpal counts as palm.
    pub(super) touches: bool,
    pub(super) is_inner: bool,
    /// Mean direction of its phalanges' presses, a unit vector or zero.
    pub(super) press: Vec3,
    /// Degree to which the last link touches with its very tip, 0 to 1.
    pub(super) tip: f32,
    pub(super) height: f32,
    /// Direction of its last link, a unit vector.
    pub(super) along: Vec3,
}

/// All the features that distinguish the types.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Features {
    pub(super) thumb: Thumb,
    pub(super) fingers: [Finger; 4],
    /// One bit per touching finger, the index finger's the lowest.
    pub(super) touching: u8,
    pub(super) palm_touches: bool,
    /// Degree to which the palm or the roots of the fingers support the object, 0 to 1.
    pub(super) palm_support: f32,
    /// Distance between opposed contacts, along their pushes, in hand lengths; the held part's diameter if none are opposed.
    pub(super) thickness: f32,
    /// Convergence of the pushes of the outermost touching fingers: 0 on a prism, chord over radius on a sphere, negative if they
    /// diverge.
    pub(super) convergence: f32,
    /// How much the digits push toward the palm, -1 to 1: 0 around the rim of a disk that the palm faces.
    pub(super) pull: f32,
    pub(super) part: HeldPart,
}

impl Features {
    /// Measures a posed hand. Contacts, pose and the object's shape are in the same frame, in metres.
    pub(super) fn of(rig: &Rig, pose: &HandPose, contacts: &[Contact], shape: &LocalShape) -> Self {
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
                    // Grasps have at most one contact per link; of several, the last would count.
                    touches[digit.index()][phalanx.index()] = Some(touch);
                }
                HandPart::Palm => palm = Some(hand.palm_touch(contact)),
            }
        }
        let [thumb_touches, finger_touches @ ..] = &touches;
        let thumb = thumb(thumb_touches, &hand, &frames[0]);
        let fingers = std::array::from_fn(|i| finger(&finger_touches[i], &pose.digits[i + 1]));
        let palm = palm.or(thumb_touches[0]);
        let part = HeldPart::of(rig, pose, contacts, shape);
        let touching = (0..4).filter(|&i| fingers[i].touches).map(|i| 1 << i).sum();
        Self {
            thumb,
            fingers,
            touching,
            palm_touches: palm.is_some(),
            palm_support: palm_support(palm.is_some(), finger_touches),
            thickness: thickness(palm, &touches, &part),
            convergence: convergence(&fingers),
            pull: pull(palm, hand.position(rig.palm), &touches),
            part,
        }
    }

    pub(super) fn touching_fingers(&self) -> impl Iterator<Item = &Finger> {
        self.fingers.iter().filter(|finger| finger.touches)
    }

    /// Mean of a feature over the fingers that touch; 0 if none does.
    pub(super) fn mean(&self, feature: impl Fn(&Finger) -> f32) -> f32 {
        let count = self.touching.count_ones().max(1) as f32;
        self.touching_fingers().map(feature).sum::<f32>() / count
    }

    /// Mean direction of the touching fingers' presses, each weighted; a unit vector or zero.
    pub(super) fn mean_press(&self, weight: impl Fn(&Finger) -> f32) -> Vec3 {
        let sum: Vec3 = self
            .touching_fingers()
            .map(|finger| finger.press * weight(finger))
            .sum();
        direction(sum)
    }
}

/// Degree to which two unit vectors are opposed, 0 to 1.
pub(super) fn opposed(a: Vec3, b: Vec3) -> f32 {
    rising(-a.dot(b), OPPOSED)
}

/// Transforms from the contacts' frame and the rig's wrist frame to the wrist frame of a right hand of length 1.
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

    /// Normalizes a point of the wrist frame.
    fn position(&self, point: Vec3) -> Vec3 {
        point * self.flip * self.per_metre
    }

    /// Normalizes a direction of the wrist frame.
    fn direction(&self, vector: Vec3) -> Vec3 {
        vector * self.flip
    }

    /// A contact of the link with the frame `wrist_from_link`.
    fn touch(&self, contact: &Contact, wrist_from_link: Pose) -> Touch {
        let position = self.wrist_from_object.transform_point(contact.position);
        let inward = -self.wrist_from_object.transform_vector(contact.normal);
        let link_from_wrist = wrist_from_link.inverse();
        let in_link = link_from_wrist.transform_point(position);
        let from_bone = (in_link * Vec3::new(1.0, 0.0, 1.0)).normalize_or_zero();
        let mut local = link_from_wrist.transform_vector(inward);
        // The thesis' touch segments may hit a surface from inside. Hands cannot pull, so the push is flipped outward.
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
        [_, true, false] => SECOND_LINK_ALONE,
        [_, true, true] => SECOND_AND_THIRD_LINK,
        [_, false, _] => 0.0,
    };
    for touch in touches.iter().flatten() {
        finger.touches = true;
        finger.position = touch.position;
        finger.push += touch.push;
        finger.press += touch.press;
        let radial = rising(touch.local.x, SIDE);
        let ulnar = rising(-touch.local.x, SIDE);
        finger.radial = finger.radial.max(radial);
        finger.ulnar = finger.ulnar.max(ulnar);
        finger.pad = finger.pad.max(1.0 - radial.max(ulnar));
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

/// Degree to which a last link touches with its very tip, pushing along itself rather than out of its pad.
fn tip(third: Option<Touch>) -> f32 {
    third.map_or(0.0, |touch| rising(touch.local.y, TIP))
}

/// The palm supports an object that it touches or that rests on the roots of two fingers.
fn palm_support(palm_touches: bool, fingers: &[[Option<Touch>; 3]]) -> f32 {
    let roots = fingers.iter().filter(|finger| finger[0].is_some()).count();
    match roots {
        _ if palm_touches => 1.0,
        0 => 0.0,
        1 => 0.2,
        _ => 0.8,
    }
}

/// Mean over all pairs of contacts, weighted by how far they are opposed, and the held part's own diameter.
fn thickness(palm: Option<Touch>, touches: &[[Option<Touch>; 3]; 5], part: &HeldPart) -> f32 {
    let all = || touches.as_flattened().iter().flatten().chain(palm.as_ref());
    let (mut sum, mut weights) = (PART_WEIGHT * part.diameter(), PART_WEIGHT);
    for (i, a) in all().enumerate() {
        for b in all().skip(i + 1) {
            let against = -a.push.dot(b.push) - THICKNESS_OPPOSITION;
            if against > 0.0 {
                let weight = against.powi(THICKNESS_POWER);
                // On a sphere or cylinder, two contacts differ by the radius times the difference of their pushes; on a plate, by
                // its thickness.
                let apart = b.push - a.push;
                let width = 2.0 * (a.position - b.position).dot(apart) / apart.length_squared();
                // Contacts that push away from each other hold nothing between them.
                if width > 0.0 {
                    sum += weight * width;
                    weights += weight;
                }
            }
        }
    }
    sum / weights
}

/// How much the digits push against the palm's push or, if it does not touch, against the direction from the palm to the digits'
/// contacts.
fn pull(palm: Option<Touch>, palm_centre: Vec3, touches: &[[Option<Touch>; 3]; 5]) -> f32 {
    let outermost = || {
        touches
            .iter()
            .filter_map(|digit| digit[1..].iter().flatten().last())
    };
    let count = outermost().count().max(1) as f32;
    let away = palm.map_or_else(
        || direction(outermost().map(|touch| touch.position).sum::<Vec3>() / count - palm_centre),
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

/// Degree to which an angle in radians is large, over a range in degrees.
pub(super) fn bent(angle: f32, degrees: [f32; 2]) -> f32 {
    rising(angle, degrees.map(f32::to_radians))
}

pub(super) fn straight(angle: f32, degrees: [f32; 2]) -> f32 {
    falling(angle, degrees.map(f32::to_radians))
}

fn direction(vector: Vec3) -> Vec3 {
    if vector.length() < MIN_LENGTH {
        Vec3::ZERO
    } else {
        vector.normalize_or_zero()
    }
}
