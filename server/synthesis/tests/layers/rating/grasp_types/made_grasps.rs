//! Hands of the `adult` rig around simple shapes, posed by hand.

use glam::Vec3;
use grasp_synthesis::{
    base::pose::Pose,
    model::{
        grasp::Contact,
        grasp_type::Classification,
        hand::{Digit, DigitAngles, HandPart, HandPose, Phalanx, kinematics::hand_frames, rig::Rig},
    },
    rating::taxonomy::classify,
};

use crate::fixtures::hands::right;

/// A held shape in millimetres, in the wrist frame of a right hand: +x to the thumb, +y along the fingers, +z out of
/// the palm.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Shape {
    /// Centre and radius.
    Ball(Vec3, f32),
    /// A point of the axis, the axis' direction, and the radius.
    Rod(Vec3, Vec3, f32),
    /// The middle, the thin direction, and half the thickness.
    Plate(Vec3, Vec3, f32),
}

impl Shape {
    /// The point of the axis or middle plane nearest to a point, and its distance from the surface.
    fn foot(self, point: Vec3) -> (Vec3, f32) {
        match self {
            Self::Ball(centre, radius) => (centre, radius),
            Self::Rod(start, axis, radius) => (start + (point - start).project_onto(axis), radius),
            Self::Plate(middle, thin, half) => (point - (point - middle).project_onto(thin), half),
        }
    }

    /// The point of the surface nearest to a point outside, and the outward normal there.
    fn nearest(self, point: Vec3) -> (Vec3, Vec3) {
        let (foot, distance) = self.foot(point);
        let normal = (point - foot).normalize_or(Vec3::Z);
        (foot + normal * distance, normal)
    }

    /// The shape, thinned to leave room for flesh around the bones.
    fn fitted(self, bones: &[Vec3]) -> Self {
        let room = bones
            .iter()
            .map(|&bone| (bone - self.foot(bone).0).length() - FLESH);
        let most = room.fold(f32::INFINITY, f32::min).max(0.5);
        match self {
            Self::Ball(centre, radius) => Self::Ball(centre, radius.min(most)),
            Self::Rod(start, axis, radius) => Self::Rod(start, axis, radius.min(most)),
            Self::Plate(middle, thin, half) => Self::Plate(middle, thin, half.min(most)),
        }
    }
}

/// From a finger's bone to its skin, in millimetres.
const FLESH: f32 = 7.0;

/// The far end of a link.
pub(crate) const TIP: f32 = 1.0;
/// Halfway along a link.
pub(crate) const MIDDLE: f32 = 0.5;

/// A touching link, and the share of its bone where it touches.
pub(crate) type Touching = (Digit, Phalanx, f32);

/// A grasp posed by hand.
#[derive(Clone, Debug)]
pub(crate) struct Held {
    pub(crate) rig: Rig,
    pub(crate) pose: HandPose,
    pub(crate) contacts: Vec<Contact>,
}

/// A hand with angles in degrees (yaw and three pitches, thumb first) that holds a shape with the touching links, and
/// another with its palm, if given.
pub(crate) fn held(degrees: [[f32; 4]; 5], shape: Shape, touching: &[Touching], palm: Option<Shape>) -> Held {
    let rig = Rig::clone(right());
    let pose = HandPose {
        frame_from_wrist: Pose::IDENTITY,
        digits: degrees.map(|[yaw, first, second, third]| DigitAngles {
            base_yaw: yaw.to_radians(),
            base_pitch: first.to_radians(),
            second_pitch: second.to_radians(),
            third_pitch: third.to_radians(),
        }),
    };
    let bare = Held {
        rig,
        pose,
        contacts: Vec::new(),
    };
    let mut held = bare.also(shape, touching);
    held.contacts
        .extend(palm.map(|shape| contact(shape, held.rig.palm * 1e3, HandPart::Palm)));
    held
}

impl Held {
    pub(crate) fn classify(&self) -> Classification {
        classify(&self.rig, &self.pose, &self.contacts)
    }

    /// The mirror image, by the other hand.
    pub(crate) fn mirrored(&self) -> Self {
        let mirror = Vec3::new(-1.0, 1.0, 1.0);
        let frame_from_wrist = self.pose.frame_from_wrist.mirrored_x();
        Self {
            rig: self.rig.mirrored(),
            pose: HandPose {
                frame_from_wrist,
                ..self.pose
            },
            contacts: self.with_contacts(|position| position * mirror, |normal| normal * mirror),
        }
    }

    /// Hand and object, scaled.
    pub(crate) fn scaled(&self, factor: f32) -> Self {
        let mut rig = self.rig.clone();
        rig.reach *= factor;
        rig.palm *= factor;
        for digit in &mut rig.digits {
            digit.wrist_from_base.position *= factor;
            digit.lengths = digit.lengths.map(|length| length * factor);
        }
        let mut pose = self.pose;
        pose.frame_from_wrist.position *= factor;
        Self {
            rig,
            pose,
            contacts: self.with_contacts(|position| position * factor, |normal| normal),
        }
    }

    /// The grasp in another frame.
    pub(crate) fn moved(&self, a_from_b: Pose) -> Self {
        Self {
            rig: self.rig.clone(),
            pose: HandPose {
                frame_from_wrist: a_from_b * self.pose.frame_from_wrist,
                ..self.pose
            },
            contacts: self.with_contacts(
                |position| a_from_b.transform_point(position),
                |normal| a_from_b.transform_vector(normal),
            ),
        }
    }

    fn with_contacts(&self, position: impl Fn(Vec3) -> Vec3, normal: impl Fn(Vec3) -> Vec3) -> Vec<Contact> {
        let change = |contact: &Contact| Contact {
            position: position(contact.position),
            normal: normal(contact.normal),
            ..*contact
        };
        self.contacts.iter().map(change).collect()
    }

    /// Adds another shape at some links.
    pub(crate) fn also(mut self, shape: Shape, touching: &[Touching]) -> Self {
        let frames = hand_frames(&self.rig, &self.pose);
        let bones: Vec<_> = touching
            .iter()
            .map(|&(digit, phalanx, along)| {
                let link = frames.digits[digit.index()].links[phalanx.index()];
                link.transform_point(Vec3::Y * along * self.rig.length(digit, phalanx)) * 1e3
            })
            .collect();
        let fitted = shape.fitted(&bones);
        for (&(digit, phalanx, _), &bone) in touching.iter().zip(&bones) {
            self.contacts
                .push(contact(fitted, bone, HandPart::Phalanx(digit, phalanx)));
        }
        self
    }
}

/// The contact of a shape with the flesh around a point.
fn contact(shape: Shape, bone: Vec3, part: HandPart) -> Contact {
    let (position, normal) = shape.nearest(bone);
    Contact {
        position: position * 1e-3,
        normal,
        triangle: 0,
        part,
    }
}
