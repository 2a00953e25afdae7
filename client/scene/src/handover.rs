//! Handovers: the object, hands, contacts and forces, as scenes and as pictures.

use std::collections::HashMap;

use glam::Vec3;
use grasp_synthesis::{
    base::pose::Pose,
    geometry::mesh::TriangleMesh,
    model::hand::{
        Digit, Phalanx,
        joints::{HandJoints, Skin},
    },
};
use serde_json::json;

use crate::{
    image::Image,
    people::{ArmJoints, Person},
    primitives,
    render::{RenderOptions, render},
    scene::{Finish, Part, Scene, linear_from_srgb},
    views::best_view,
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

/// A hand with its skin.
#[derive(Clone, Debug)]
pub struct PosedHand<'a> {
    /// The skin to pose.
    pub skin: &'a Skin,
    /// The joints, in the client's frame.
    pub joints: HandJoints,
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
    /// The digit; `None` for the palm.
    pub digit: Option<Digit>,
    /// The digit's link; `None` for the palm.
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
    pub object_colour: Vec3,
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

    /// The scene: parts `object`; `_hand` and `_sleeve` of `giver`, `receiver` and `other_receiver`; `receiver_forearm` and
    /// `receiver_upper_arm` in place of the receiver's sleeve if its arm is known; for each contact, `contact_thumb_third` and
    /// `force_thumb_third` or the like, with the force in newtons as extras; and `others`.
    pub fn to_scene(&self) -> Scene {
        let mut parts = vec![self.object_part()];
        let hands = [
            ("giver", &self.giver, Person::Giver),
            ("receiver", &self.receiver, Person::Receiver),
            ("other_receiver", &self.other_receiver, Person::Receiver),
        ];
        for (who, hand, person) in hands {
            if let Some(hand) = hand {
                let arm = self.arm.as_ref().filter(|_| who == "receiver");
                parts.extend(hand.parts(who, person, arm));
            }
        }
        parts.extend(self.others.iter().cloned());
        parts.extend(self.contact_parts());
        Scene { parts }
    }

    /// The most informative view.
    pub fn render_best_view(&self, options: RenderOptions) -> Image {
        let scene = self.to_scene();
        let importance = |part: &Part| importance(part, self.contacts.len());
        let camera = best_view(&scene, importance, options.up, options.aspect());
        render(&scene, &camera, options)
    }

    /// The object where it is, with forbidden triangles in red.
    pub(crate) fn object_part(&self) -> Part {
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
            vertex_colours = vec![self.object_colour; positions.len()];
            let mut copies = HashMap::new();
            for &triangle in self.forbidden {
                let Some(corners) = triangles.get_mut(triangle as usize) else {
                    continue;
                };
                for vertex in corners {
                    *vertex = *copies.entry(*vertex).or_insert_with(|| {
                        positions.push(positions[*vertex as usize]);
                        vertex_colours.push(linear_from_srgb(176, 52, 48));
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
        let forces = self.contacts.iter().map(|contact| contact.force.length());
        let largest = forces.fold(MIN_FORCE, f32::max);
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
            let marker = |part: Part| Part {
                finish: Finish::Marker,
                extras: Some(extras.clone()),
                ..part
            };
            let centre = contact.position + contact.normal * CONTACT_LIFT;
            let (name, yellow) = (format!("contact_{label}"), linear_from_srgb(255, 196, 0));
            parts.push(marker(primitives::sphere(&name, centre, CONTACT_RADIUS, yellow)));
            if newtons >= MIN_FORCE {
                let length = (MAX_ARROW * newtons / largest).max(MIN_ARROW);
                let (tail, tip) = (
                    contact.position - contact.force / newtons * length,
                    contact.position,
                );
                let (name, orange) = (format!("force_{label}"), linear_from_srgb(255, 120, 0));
                parts.push(marker(primitives::arrow(&name, tail, tip, ARROW_RADIUS, orange)));
            }
        }
        parts
    }
}

impl PosedHand<'_> {
    /// The hand, and its arm or else a sleeve.
    pub(crate) fn parts(&self, who: &str, person: Person, arm: Option<&ArmJoints>) -> Vec<Part> {
        let mut posed = self.skin.posed(&self.joints);
        let mut parts = match arm {
            Some(arm) => person.arm_sleeves(who, arm, &self.joints, &posed).to_vec(),
            None => vec![person.sleeve(&format!("{who}_sleeve"), &self.joints, &posed)],
        };
        if let Some(arm) = arm {
            arm.bend_skin(&self.joints, &mut posed);
        }
        parts.insert(0, person.hand(&format!("{who}_hand"), self.skin, posed));
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

/// Weight of a part's visibility in the choice of a view: the object, often hidden by hands, and all contacts together
/// count more than the hands, which are always visible in part.
fn importance(part: &Part, contacts: usize) -> f32 {
    match part.name.as_str() {
        "object" => 2.0,
        "receiver_hand" | "other_receiver_hand" => 1.0,
        "giver_hand" => 0.6,
        name if name.starts_with("contact_") => 2.0 / contacts.max(1) as f32,
        // It would fill a picture that it is nearest in.
        "receiver_upper_arm" => -1.0,
        _ => 0.0,
    }
}

#[cfg(test)]
mod tests;
