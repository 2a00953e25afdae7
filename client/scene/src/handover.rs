//! Scenes of handovers: the object, both hands, contacts and forces.

use std::collections::HashMap;

use glam::Vec3;
use grasp_synthesis::{
    base::pose::Pose,
    geometry::mesh::TriangleMesh,
    model::hand::{
        Digit, Phalanx,
        joints::{HandJoints, index},
        skin::Skin,
    },
};
use serde_json::json;

use crate::{
    camera::Camera,
    image::{Image, side_by_side},
    primitives,
    render::{RenderOptions, render},
    scene::{Finish, Part, Scene, linear_from_srgb},
    skin_look::{Complexion, hand_parts},
    sleeve::sleeve,
    views::choose_views,
};

/// Radius of a contact's marker, and distance of its centre from the surface, in metres.
const CONTACT_RADIUS: f32 = 3.0e-3;
const CONTACT_LIFT: f32 = 0.8e-3;

/// Length of the arrow of the largest force, in metres; others in proportion.
const MAX_ARROW: f32 = 0.05;

/// Shortest arrow, in metres; keeps small forces visible.
const MIN_ARROW: f32 = 0.006;

/// Forces below this are not drawn, in newtons.
const MIN_FORCE: f32 = 1e-4;

/// Radius of an arrow's shaft in metres.
const ARROW_RADIUS: f32 = 1.3e-3;

/// sRGB colours that the caller cannot choose.
const FORBIDDEN: [u8; 3] = [176, 52, 48];
const CONTACT: [u8; 3] = [255, 196, 0];
const FORCE: [u8; 3] = [255, 120, 0];
const GIVER_SLEEVE: [u8; 3] = [70, 100, 146];
const RECEIVER_SLEEVE: [u8; 3] = [92, 134, 100];
const ARM: [u8; 3] = [150, 152, 156];

/// Radii of a drawn arm, in metres: as thick as the wrist, and a little thicker.
const FOREARM_RADIUS: f32 = 0.026;
const UPPER_ARM_RADIUS: f32 = 0.034;

/// A hand with its skin.
#[derive(Clone, Debug)]
pub struct PosedHand<'a> {
    /// The skin to pose.
    pub skin: &'a Skin,
    /// The joints, in the client's frame.
    pub joints: HandJoints,
}

/// The joints of a receiver's arm, in the client's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ArmJoints {
    /// The shoulder joint, in metres.
    pub shoulder: Vec3,
    /// The elbow, in metres.
    pub elbow: Vec3,
}

/// A contact of the receiving hand with the object.
#[derive(Clone, Debug, PartialEq)]
pub struct ContactMark {
    /// Point on the surface, in metres, in the client's frame.
    pub position: Vec3,
    /// The surface's outward unit normal, in the client's frame.
    pub normal: Vec3,
    /// The force of the hand on the object in newtons, in the client's frame.
    pub force: Vec3,
    /// The digit; none for the palm.
    pub digit: Option<Digit>,
    /// The digit's link; none for the palm.
    pub phalanx: Option<Phalanx>,
}

/// A handover to draw, in the client's frame: metres, right-handed.
#[derive(Clone, Debug)]
pub struct HandoverScene<'a> {
    /// The object, in its own frame.
    pub object: &'a TriangleMesh,
    /// Pose of the object.
    pub client_from_object: Pose,
    /// Triangles of the object that must not be touched; drawn red.
    pub forbidden: &'a [u32],
    /// Linear RGB of the object.
    pub object_colour: [f32; 4],
    /// Finish of the object.
    pub object_finish: Finish,
    /// The presenting hand.
    pub giver: Option<PosedHand<'a>>,
    /// The receiving hand.
    pub receiver: Option<PosedHand<'a>>,
    /// The receiver's other hand.
    pub other_receiver: Option<PosedHand<'a>>,
    /// The arm of the receiving hand.
    pub arm: Option<ArmJoints>,
    /// Contacts of the receiver's hands.
    pub contacts: Vec<ContactMark>,
    /// What else is there, in the client's frame, such as a giver's hand of which only the mesh is known.
    pub others: Vec<Part>,
}

impl<'a> HandoverScene<'a> {
    /// An object alone, light grey.
    pub fn new(object: &'a TriangleMesh, client_from_object: Pose) -> Self {
        Self {
            object,
            client_from_object,
            forbidden: &[],
            object_colour: linear_from_srgb(198, 203, 210),
            object_finish: Finish::Satin,
            giver: None,
            receiver: None,
            other_receiver: None,
            arm: None,
            contacts: Vec::new(),
            others: Vec::new(),
        }
    }

    /// The scene: parts `object`; `_hand`, `_nails` and `_sleeve` of `giver`, `receiver` and `other_receiver`;
    /// `receiver_forearm` and `receiver_upper_arm` in place of the receiver's sleeve if its arm is known; for each contact, `contact_thumb_third` and `force_thumb_third` or the like, with the force in newtons as extras;
    /// and `others`.
    pub fn to_scene(&self) -> Scene {
        let mut parts = vec![self.object_part()];
        let hands = [
            ("giver", &self.giver, Person::Giver),
            ("receiver", &self.receiver, Person::Receiver),
            ("other_receiver", &self.other_receiver, Person::Receiver),
        ];
        for (who, hand, person) in hands {
            if let Some(hand) = hand {
                let arm = self.arm.filter(|_| who == "receiver");
                parts.extend(hand.parts(who, person, arm));
            }
        }
        parts.extend(self.others.iter().cloned());
        parts.extend(self.contact_parts());
        Scene { parts }
    }

    /// The two most informative views side by side, each drawn with `options`.
    pub fn render(&self, options: RenderOptions) -> Image {
        let scene = self.to_scene();
        let [first, second] = self.views(&scene, options);
        side_by_side(
            &render(&scene, &first, options),
            &render(&scene, &second, options),
        )
    }

    /// The most informative view.
    pub fn render_best_view(&self, options: RenderOptions) -> Image {
        let scene = self.to_scene();
        let [best, _] = self.views(&scene, options);
        render(&scene, &best, options)
    }

    fn views(&self, scene: &Scene, options: RenderOptions) -> [Camera; 2] {
        let aspect = options.width.max(1) as f32 / options.height.max(1) as f32;
        let importance = |part: &Part| importance(part, self.contacts.len());
        choose_views(std::slice::from_ref(scene), importance, options.up, aspect)
    }

    pub(crate) fn object_part(&self) -> Part {
        let [r, g, b, _] = self.object_colour;
        let mut positions: Vec<Vec3> = self
            .object
            .positions()
            .iter()
            .map(|&p| self.client_from_object.transform_point(p))
            .collect();
        let mut triangles = self.object.triangles().to_vec();
        let mut vertex_colours = Vec::new();
        if !self.forbidden.is_empty() {
            // Separate vertices give the colour of forbidden triangles a sharp border.
            vertex_colours = vec![Vec3::new(r, g, b); positions.len()];
            let [r, g, b, _] = srgb(FORBIDDEN);
            let mut copies = HashMap::new();
            for &triangle in self.forbidden {
                let Some(corners) = triangles.get_mut(triangle as usize) else {
                    continue;
                };
                for vertex in corners {
                    *vertex = *copies.entry(*vertex).or_insert_with(|| {
                        positions.push(positions[*vertex as usize]);
                        vertex_colours.push(Vec3::new(r, g, b));
                        positions.len() as u32 - 1
                    });
                }
            }
        }
        Part {
            vertex_colours,
            finish: self.object_finish,
            ..Part::new("object", positions, triangles, self.object_colour)
        }
    }

    fn contact_parts(&self) -> Vec<Part> {
        let largest = self
            .contacts
            .iter()
            .map(|c| c.force.length())
            .fold(MIN_FORCE, f32::max);
        let mut times_used: HashMap<String, u32> = HashMap::new();
        let mut parts = Vec::new();
        for contact in &self.contacts {
            let mut label = contact.label();
            let times = times_used.entry(label.clone()).or_default();
            *times += 1;
            if *times > 1 {
                label = format!("{label}_{times}");
            }
            let newtons = contact.force.length();
            let extras = json!({
                "digit": contact.digit,
                "phalanx": contact.phalanx,
                "force_n": newtons,
                "force_vector_n": contact.force.to_array(),
            });
            let centre = contact.position + contact.normal * CONTACT_LIFT;
            let mut ball =
                primitives::sphere(&format!("contact_{label}"), centre, CONTACT_RADIUS, srgb(CONTACT))
                    .with_finish(Finish::Marker);
            ball.extras = Some(extras.clone());
            parts.push(ball);
            if newtons >= MIN_FORCE {
                let length = (MAX_ARROW * newtons / largest).max(MIN_ARROW);
                let tail = contact.position - contact.force / newtons * length;
                let name = format!("force_{label}");
                let mut arrow = primitives::arrow(&name, tail, contact.position, ARROW_RADIUS, srgb(FORCE))
                    .with_finish(Finish::Marker);
                arrow.extras = Some(extras);
                parts.push(arrow);
            }
        }
        parts
    }
}

/// Whose hand it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Person {
    /// Holds the object out: fair, blue sleeves.
    Giver,
    /// Takes it: brown, green sleeves.
    Receiver,
}

impl Person {
    pub(crate) fn complexion(self) -> Complexion {
        match self {
            Self::Giver => Complexion::FAIR,
            Self::Receiver => Complexion::BROWN,
        }
    }

    pub(crate) fn sleeve_colour(self) -> [f32; 4] {
        match self {
            Self::Giver => srgb(GIVER_SLEEVE),
            Self::Receiver => srgb(RECEIVER_SLEEVE),
        }
    }
}

impl PosedHand<'_> {
    /// The hand, its nails, and its arm or else a sleeve.
    pub(crate) fn parts(&self, who: &str, person: Person, arm: Option<ArmJoints>) -> Vec<Part> {
        let posed = self.skin.posed(&self.joints);
        let covers = match arm {
            Some(arm) => arm_parts(arm, &self.joints).to_vec(),
            None => vec![sleeve(
                &format!("{who}_sleeve"),
                &self.joints,
                &posed,
                person.sleeve_colour(),
            )],
        };
        let mut parts = hand_parts(who, self.skin, posed, person.complexion());
        parts.extend(covers);
        parts
    }
}

impl ContactMark {
    /// `thumb_third`, `palm` or the like.
    fn label(&self) -> String {
        let digit = match self.digit {
            Some(Digit::Thumb) => "thumb",
            Some(Digit::Index) => "index",
            Some(Digit::Middle) => "middle",
            Some(Digit::Ring) => "ring",
            Some(Digit::Little) => "little",
            None => return "palm".into(),
        };
        match self.phalanx {
            Some(Phalanx::First) => format!("{digit}_first"),
            Some(Phalanx::Second) => format!("{digit}_second"),
            Some(Phalanx::Third) => format!("{digit}_third"),
            None => digit.into(),
        }
    }
}

/// The receiver's forearm, from the wrist of its hand, and upper arm.
fn arm_parts(arm: ArmJoints, hand: &HandJoints) -> [Part; 2] {
    let wrist = hand.joints[index::WRIST].pose.position;
    let bone = |name: &str, start: Vec3, end: Vec3, radius: f32| {
        primitives::capsule(name, start, end, radius, srgb(ARM)).with_finish(Finish::Cloth)
    };
    [
        bone("receiver_forearm", wrist, arm.elbow, FOREARM_RADIUS),
        bone("receiver_upper_arm", arm.elbow, arm.shoulder, UPPER_ARM_RADIUS),
    ]
}

/// Weight of a part's visibility in the choice of views: the object, often hidden by hands, and all contacts together
/// count more than the hands, which are always visible in part.
pub(crate) fn importance(part: &Part, contacts: usize) -> f32 {
    match part.name.as_str() {
        "object" => 2.0,
        "receiver_hand" | "other_receiver_hand" => 1.0,
        "giver_hand" | "other_giver_hand" => 0.6,
        name if name.starts_with("contact_") => 2.0 / contacts.max(1) as f32,
        _ => 0.0,
    }
}

fn srgb([r, g, b]: [u8; 3]) -> [f32; 4] {
    linear_from_srgb(r, g, b)
}

#[cfg(test)]
mod tests;
