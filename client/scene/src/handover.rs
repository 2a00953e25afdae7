//! Handovers: the object, hands, contacts and forces, as scenes and as pictures.

use std::{collections::HashMap, fmt, sync::Arc};

use glam::Vec3;
use grasp_client::v1::{self, presenting_hand::Form};
use serde_json::json;

use crate::{
    camera::best_view,
    glb::to_glb,
    hands::{giver, receiver, skin_of_model, synthesis_pose},
    image::Image,
    parts::{Finish, Part, arrow, linear_from_srgb, sphere},
    people::{ArmJoints, Person},
    render::{Stage, ViewSize, render},
    track::numbered,
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

/// Why something cannot be drawn, in words.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CannotDraw(pub String);

impl fmt::Display for CannotDraw {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for CannotDraw {}

/// A holdout and its grasps, to be drawn. Both are in the `OpenXR` convention.
#[derive(Clone, Debug)]
pub struct Handover {
    /// The object, in its own frame.
    pub object: Part,
    /// The poses of the object and of the giver's hand.
    pub holdout: v1::Holdout,
    /// The grasp of one hand of the receiver, or of both.
    pub grasps: Vec<v1::Grasp>,
    /// The file of the model that the receiver's rig was created from; `None` for a built-in rig.
    pub model: Option<Arc<[u8]>>,
}

impl Handover {
    /// The scene as a binary glTF file (GLB).
    ///
    /// # Errors
    /// A hand cannot be drawn: its rig is not built in and there is no model, or its joints are missing.
    pub fn to_glb(&self) -> Result<Vec<u8>, CannotDraw> {
        Ok(to_glb(&self.parts()?))
    }

    /// The most informative view.
    ///
    /// # Errors
    /// As of [`Self::to_glb`].
    pub fn draw(&self, size: ViewSize) -> Result<Image, CannotDraw> {
        let parts = self.parts()?;
        let stage = Stage::new(&parts);
        let contacts = self.grasps.iter().map(|grasp| grasp.contacts.len()).sum();
        let up = self.holdout.up.map_or(Vec3::Y, Vec3::from).normalize_or(Vec3::Y);
        let importance = |part: &Part| importance(part, contacts);
        let camera = best_view(&parts, &stage, importance, up, size.aspect());
        Ok(render(&stage, &camera, size, up))
    }

    /// The parts `object`; `_hand` and `_sleeve` of `giver`, `receiver` and `other_receiver`; `receiver_forearm` and
    /// `receiver_upper_arm` in place of the receiver's sleeve if its arm is known; for each contact, `contact_thumb_third` and
    /// `force_thumb_third` or the like, with the force in newtons as extras. Hands drawn by a mesh or a model have no sleeve.
    pub(crate) fn parts(&self) -> Result<Vec<Part>, CannotDraw> {
        let client_from_object = self.holdout.client_from_object();
        let mut parts = vec![self.object.clone().moved(synthesis_pose(client_from_object))];
        let mut skins = Vec::new();
        if let Some(hand) = &self.holdout.presenting_hand {
            if let Some(Form::Mesh(mesh)) = &hand.form {
                let (vertices, faces) = (mesh.vertices().collect(), mesh.faces().to_vec());
                let colour = linear_from_srgb(206, 176, 154);
                skins.push(Part::new("giver_hand", vertices, faces, colour));
            } else {
                let hand = giver(hand, client_from_object)?;
                parts.extend(hand.parts("giver", Person::Giver, None));
            }
        }
        let mut arm = self.grasps.first().and_then(|grasp| grasp.arm.as_ref());
        for (who, grasp) in ["receiver", "other_receiver"].iter().zip(&self.grasps) {
            let Some(hand) = &grasp.hand else { continue };
            if let Some(model) = &self.model {
                skins.push(skin_of_model(model, hand, format!("{who}_hand"))?);
                continue;
            }
            let arm = arm.take().map(|arm| ArmJoints {
                shoulder: arm.client_shoulder.unwrap_or_default().into(),
                elbow: arm.client_elbow.unwrap_or_default().into(),
            });
            parts.extend(receiver(hand)?.parts(who, Person::Receiver, arm.as_ref()));
        }
        parts.extend(skins);
        let contacts = self.grasps.iter().flat_map(v1::Grasp::client_contacts);
        parts.extend(contact_parts(&contacts.collect::<Vec<_>>()));
        Ok(parts)
    }
}

fn contact_parts(contacts: &[v1::Contact]) -> Vec<Part> {
    let forces = contacts.iter().map(|contact| contact.force().length());
    let largest = forces.fold(MIN_FORCE, f32::max);
    let mut times_used: HashMap<String, usize> = HashMap::new();
    let mut parts = Vec::new();
    for contact in contacts {
        let (position, force) = (contact.position(), contact.force());
        let digit = contact.digit().as_str_name().trim_start_matches("DIGIT_");
        let digit = Some(digit.to_lowercase()).filter(|_| contact.digit() != v1::Digit::Unspecified);
        // Counted from 1.
        let phalanx = match contact.phalanx {
            1 => Some("first"),
            2 => Some("second"),
            3 => Some("third"),
            _ => None,
        };
        let mut label = match (&digit, phalanx) {
            (None, _) => "palm".to_owned(),
            (Some(digit), None) => digit.clone(),
            (Some(digit), Some(phalanx)) => format!("{digit}_{phalanx}"),
        };
        let before = times_used.entry(label.clone()).or_default();
        label = numbered(&label, *before);
        *before += 1;
        let newtons = force.length();
        let extras = json!({
            "digit": digit,
            "phalanx": phalanx,
            "force_n": newtons,
            "force_vector_n": force.to_array(),
        });
        let marker = |part: Part| Part {
            finish: Finish::Marker,
            extras: Some(extras.clone()),
            ..part
        };
        let centre = position + contact.normal() * CONTACT_LIFT;
        let (name, yellow) = (format!("contact_{label}"), linear_from_srgb(255, 196, 0));
        parts.push(marker(sphere(&name, centre, CONTACT_RADIUS, yellow)));
        if newtons >= MIN_FORCE {
            let tail = position - force / newtons * (MAX_ARROW * newtons / largest).max(MIN_ARROW);
            let (name, orange) = (format!("force_{label}"), linear_from_srgb(255, 120, 0));
            parts.push(marker(arrow(&name, tail, position, ARROW_RADIUS, orange)));
        }
    }
    parts
}

/// Weight of a part's visibility in the choice of a view: the object and all contacts together, often hidden by hands, count
/// more than the hands, which are always visible in part.
fn importance(part: &Part, contacts: usize) -> f32 {
    match part.name.as_str() {
        "object" => 2.0,
        "receiver_hand" | "other_receiver_hand" => 1.0,
        "giver_hand" => 0.6,
        name if name.starts_with("contact_") => 2.0 / contacts.max(1) as f32,
        // A camera near it would see little else.
        "receiver_upper_arm" => -1.0,
        _ => 0.0,
    }
}

#[cfg(test)]
mod tests;
