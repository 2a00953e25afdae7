//! Hands of the `adult` rig around simple shapes, posed by hand.

use grasp_synthesis::{
    geometry::local_shape::LocalShape, model::grasp_type::Classification, rating::taxonomy::classify,
};

use crate::prelude::*;

/// A held shape in millimetres, in the wrist frame of a right hand: +x to the thumb, +y along the fingers, +z out of
/// the palm.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Shape {
    /// Centre and radius.
    Ball(Vec3, f32),
    /// A point of the axis, the axis' direction, and the radius: 24 cm long.
    Rod(Vec3, Vec3, f32),
    /// The middle, the axis' direction, and the radius: 2 cm thick.
    Disk(Vec3, Vec3, f32),
    /// The middle, the thin direction, and half the thickness: 8 cm wide.
    Plate(Vec3, Vec3, f32),
}

impl Shape {
    /// The point of the axis or middle plane nearest to a point, and its distance from the surface.
    fn foot(self, point: Vec3) -> (Vec3, f32) {
        match self {
            Self::Ball(centre, radius) => (centre, radius),
            Self::Rod(start, axis, radius) | Self::Disk(start, axis, radius) => {
                (start + (point - start).project_onto(axis), radius)
            }
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
    fn fitted(mut self, bones: &[Vec3]) -> Self {
        let room = bones
            .iter()
            .map(|&bone| (bone - self.foot(bone).0).length() - FLESH);
        let most = room.fold(f32::INFINITY, f32::min).max(0.5);
        let (Self::Ball(_, size) | Self::Rod(_, _, size) | Self::Disk(_, _, size) | Self::Plate(_, _, size)) =
            &mut self;
        *size = size.min(most);
        self
    }

    fn mesh(self) -> TriangleMesh {
        let placed = |mesh: &TriangleMesh, axis: Vec3, middle: Vec3| {
            let turn = Quat::from_rotation_arc(Vec3::Y, axis.normalize_or(Vec3::Y));
            moved(mesh, turn, middle * 1e-3)
        };
        match self {
            Self::Ball(centre, size) => {
                let ball = Parts::default().sphere(centre * 1e-3, size * 1e-3, 12, true);
                ball.mesh()
            }
            Self::Rod(middle, axis, size) => placed(&cylinder_mesh(size * 1e-3, 0.12, 24, 12), axis, middle),
            Self::Disk(middle, axis, size) => placed(&cylinder_mesh(size * 1e-3, 0.01, 24, 2), axis, middle),
            Self::Plate(middle, thin, size) => {
                placed(&cuboid(Vec3::new(0.04, size * 1e-3, 0.04), 2), thin, middle)
            }
        }
    }
}

/// From a finger's bone to its skin, in millimetres.
const FLESH: f32 = 7.0;

pub(crate) const TIP: f32 = 1.0;
pub(crate) const MIDDLE: f32 = 0.5;

/// A touching link, and the share of its bone where it touches.
pub(crate) type Touching = (Digit, Phalanx, f32);

#[derive(Clone, Debug)]
pub(crate) struct Held {
    pub(crate) rig: Rig,
    pub(crate) pose: HandPose,
    pub(crate) contacts: Vec<Contact>,
    object: TriangleMesh,
}

/// Yaw and three pitches of a digit in degrees.
pub(crate) type Degrees = [i16; 4];

/// A hand, thumb first, that holds a shape with the touching links.
pub(crate) fn held(degrees: [Degrees; 5], shape: Shape, touching: &[Touching]) -> Held {
    let digits = degrees.map(|digit| angles(digit.map(|angle| f32::from(angle).to_radians())));
    let mut held = Held {
        rig: Rig::clone(right()),
        pose: hand_pose(Pose::IDENTITY, digits),
        contacts: Vec::new(),
        object: shape.mesh(),
    };
    held.object = held.touch(shape, touching).mesh();
    held
}

impl Held {
    pub(crate) fn classify(&self) -> Classification {
        let shape = LocalShape::of(&even_samples(&self.object));
        classify(&self.rig, &self.pose, &self.contacts, &shape)
    }

    /// The mirror image, by the other hand, scaled and moved.
    pub(crate) fn image(&self, scale: f32, a_from_b: Pose) -> Self {
        let mut wrist = self.pose.frame_from_wrist.mirrored_x();
        wrist.position *= scale;
        let point = |point: Vec3| a_from_b.transform_point(point * Vec3::new(-scale, scale, scale));
        let contacts = self.contacts.iter().map(|contact| {
            let position = point(contact.position);
            let normal = (point(contact.position + contact.normal) - position).normalize_or(Vec3::Z);
            Contact {
                position,
                normal,
                ..*contact
            }
        });
        let positions = self.object.positions().iter().copied().map(point);
        let triangles = self.object.triangles().iter().map(|&[a, b, c]| [a, c, b]);
        let object = TriangleMesh::new(positions.collect(), triangles.collect());
        Self {
            rig: self.rig.mirrored().scaled(scale),
            pose: hand_pose(a_from_b * wrist, self.pose.digits),
            contacts: contacts.collect(),
            object: object.expect("the mesh stays sound"),
        }
    }

    pub(crate) fn on_palm(mut self) -> Self {
        let below = Shape::Plate(Vec3::new(0.0, 80.0, 30.0), Vec3::Z, 16.0);
        let palm = touch(below, self.rig.palm * 1e3, HandPart::Palm);
        self.contacts.push(palm);
        self
    }

    pub(crate) fn also(mut self, shape: Shape, touching: &[Touching]) -> Self {
        self.touch(shape, touching);
        self
    }

    /// Adds the contacts of a shape, thinned to fit between the links.
    fn touch(&mut self, shape: Shape, touching: &[Touching]) -> Shape {
        let frames = hand_frames(&self.rig, &self.pose);
        let bones: Vec<_> = touching
            .iter()
            .map(|&(digit, phalanx, along)| {
                let link = frames.digits[digit.index()].links[phalanx.index()];
                link.transform_point(Vec3::Y * along * self.rig.digit(digit).lengths[phalanx.index()]) * 1e3
            })
            .collect();
        let fitted = shape.fitted(&bones);
        for (&(digit, phalanx, _), &bone) in touching.iter().zip(&bones) {
            let part = HandPart::Phalanx(digit, phalanx);
            self.contacts.push(touch(fitted, bone, part));
        }
        fitted
    }
}

/// The contact of a shape with the flesh around a point.
fn touch(shape: Shape, bone: Vec3, part: HandPart) -> Contact {
    let (position, normal) = shape.nearest(bone);
    contact(position * 1e-3, normal, part)
}
