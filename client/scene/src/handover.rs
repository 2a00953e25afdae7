//! Scenes of handovers: the object, both hands, contacts and forces.

use std::collections::HashMap;

use glam::Vec3;
use grasp_synthesis::{
    base::pose::Pose,
    geometry::mesh::TriangleMesh,
    model::hand::{Digit, Phalanx, joints::HandJoints, skin::Skin},
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
const LONGEST_ARROW: f32 = 0.05;

/// Shortest arrow, in metres; keeps small forces visible.
const SHORTEST_ARROW: f32 = 0.006;

/// Forces below this are not drawn, in newtons.
const SMALLEST_FORCE: f32 = 1e-4;

/// Radius of an arrow's shaft in metres.
const ARROW_RADIUS: f32 = 1.3e-3;

/// sRGB colours that the caller cannot choose.
const FORBIDDEN: [u8; 3] = [176, 52, 48];
const CONTACT: [u8; 3] = [255, 196, 0];
const FORCE: [u8; 3] = [255, 120, 0];
const GIVER_SLEEVE: [u8; 3] = [70, 100, 146];
const RECEIVER_SLEEVE: [u8; 3] = [92, 134, 100];

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
    /// Contacts of the receiver's hands.
    pub contacts: Vec<ContactMark>,
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
            contacts: Vec::new(),
        }
    }

    /// The scene: parts `object`; `_hand`, `_nails` and `_sleeve` of `giver`, `receiver` and `other_receiver`; for each
    /// contact, `contact_thumb_third` and `force_thumb_third` or the like, with the force in newtons as extras.
    pub fn to_scene(&self) -> Scene {
        let mut parts = vec![self.object_part()];
        let hands = [
            ("giver", &self.giver, Complexion::FAIR, GIVER_SLEEVE),
            ("receiver", &self.receiver, Complexion::BROWN, RECEIVER_SLEEVE),
            (
                "other_receiver",
                &self.other_receiver,
                Complexion::BROWN,
                RECEIVER_SLEEVE,
            ),
        ];
        for (who, hand, complexion, sleeve_colour) in hands {
            if let Some(PosedHand { skin, joints }) = hand {
                let posed = skin.posed(joints);
                let colour = srgb(sleeve_colour);
                let cover = sleeve(&format!("{who}_sleeve"), joints, &posed, colour);
                parts.extend(hand_parts(who, skin, posed, complexion));
                parts.push(cover);
            }
        }
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
        choose_views(scene, importance, options.up, aspect)
    }

    fn object_part(&self) -> Part {
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
            .fold(SMALLEST_FORCE, f32::max);
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
            if newtons >= SMALLEST_FORCE {
                let length = (LONGEST_ARROW * newtons / largest).max(SHORTEST_ARROW);
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

/// Weight of a part's visibility in the choice of views: the object, often hidden by hands, and all contacts together
/// count more than the hands, which are always visible in part.
fn importance(part: &Part, contacts: usize) -> f32 {
    match part.name.as_str() {
        "object" => 2.0,
        "receiver_hand" | "other_receiver_hand" => 1.0,
        "giver_hand" => 0.6,
        name if name.starts_with("contact_") => 2.0 / contacts.max(1) as f32,
        _ => 0.0,
    }
}

fn srgb([r, g, b]: [u8; 3]) -> [f32; 4] {
    linear_from_srgb(r, g, b)
}

#[cfg(test)]
mod tests {
    use glam::Quat;
    use grasp_assets::hands::hand;
    use grasp_synthesis::model::hand::{HandPose, Handedness, joints::index};

    use super::*;
    use crate::primitives::capsule;

    fn rod() -> TriangleMesh {
        let rod = capsule(
            "rod",
            Vec3::new(-0.1, 0.0, 0.0),
            Vec3::new(0.1, 0.0, 0.0),
            0.012,
            [1.0; 4],
        );
        TriangleMesh::new(rod.positions, rod.triangles).expect("a valid mesh")
    }

    fn posed(handedness: Handedness, frame_from_wrist: Pose) -> PosedHand<'static> {
        let hand = hand("adult", handedness).expect("a built-in hand");
        let pose = HandPose {
            frame_from_wrist,
            digits: hand.rig.stretched(),
        };
        PosedHand {
            skin: &hand.skin,
            joints: HandJoints::of_pose(&hand.rig, &pose),
        }
    }

    fn handover(object: &TriangleMesh) -> HandoverScene<'_> {
        let turned = Quat::from_rotation_z(3.0) * Quat::from_rotation_x(0.4);
        let mark = |position: Vec3, force: Vec3, digit| ContactMark {
            position,
            normal: position.normalize_or(Vec3::Y),
            force,
            digit,
            phalanx: digit.map(|_| Phalanx::Third),
        };
        HandoverScene {
            forbidden: &[0, 5, 9, 100_000],
            giver: Some(posed(
                Handedness::Left,
                Pose::from_position(Vec3::new(0.05, -0.1, -0.03)),
            )),
            receiver: Some(posed(
                Handedness::Right,
                Pose::new(Vec3::new(-0.05, 0.1, 0.03), turned),
            )),
            contacts: vec![
                mark(
                    Vec3::new(0.0, 0.012, 0.0),
                    Vec3::new(0.0, -4.0, 1.0),
                    Some(Digit::Thumb),
                ),
                mark(
                    Vec3::new(0.0, -0.012, 0.0),
                    Vec3::new(0.0, 2.0, 0.0),
                    Some(Digit::Index),
                ),
                mark(Vec3::new(0.01, -0.012, 0.0), Vec3::ZERO, Some(Digit::Index)),
                mark(Vec3::new(0.02, 0.012, 0.0), Vec3::NEG_Y, None),
            ],
            ..HandoverScene::new(object, Pose::from_position(Vec3::new(0.0, 0.0, 0.01)))
        }
    }

    fn part<'a>(scene: &'a Scene, name: &str) -> &'a Part {
        let found = scene.parts.iter().find(|part| part.name == name);
        found.unwrap_or_else(|| panic!("no part is named {name}"))
    }

    #[test]
    fn names_parts_by_content() {
        let object = rod();
        let scene = handover(&object).to_scene();
        let names: Vec<&str> = scene.parts.iter().map(|part| part.name.as_str()).collect();
        assert_eq!(
            names,
            [
                "object",
                "giver_hand",
                "giver_nails",
                "giver_sleeve",
                "receiver_hand",
                "receiver_nails",
                "receiver_sleeve",
                "contact_thumb_third",
                "force_thumb_third",
                "contact_index_third",
                "force_index_third",
                "contact_index_third_2",
                "contact_palm",
                "force_palm",
            ]
        );
        let extras = part(&scene, "force_thumb_third").extras.as_ref().expect("extras");
        assert_eq!(extras["digit"], "thumb");
        assert_eq!(extras["phalanx"], "third");
        let newtons = extras["force_n"].as_f64().expect("a number");
        assert!((newtons - 17.0_f64.sqrt()).abs() < 1e-6);
    }

    #[test]
    fn places_object_and_colours_forbidden_triangles_red() {
        let object = rod();
        let scene = handover(&object).to_scene();
        let drawn = part(&scene, "object");
        for (index, triangle) in drawn.triangles.iter().enumerate() {
            let corners = triangle.map(|v| drawn.positions[v as usize]);
            assert_eq!(
                corners,
                object.corners(index).map(|p| p + Vec3::new(0.0, 0.0, 0.01))
            );
            let is_red = triangle.map(|v| {
                let colour = drawn.vertex_colour(v);
                colour.x > 3.0 * colour.y
            });
            assert_eq!(is_red, [[0, 5, 9].contains(&index); 3], "triangle {index}");
        }
    }

    #[test]
    fn arrows_end_at_the_contact_and_point_along_the_force() {
        let object = rod();
        let handover = handover(&object);
        let scene = handover.to_scene();
        for (contact, name, share) in [
            (0, "force_thumb_third", 1.0),
            (1, "force_index_third", 2.0 / 17.0_f32.sqrt()),
        ] {
            let contact = &handover.contacts[contact];
            let along = contact.force.normalize_or_zero();
            let arrow = part(&scene, name);
            let reach = arrow.positions.iter().map(|&p| (p - contact.position).dot(along));
            let (low, high) = reach.fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), r| {
                (l.min(r), h.max(r))
            });
            assert!(high.abs() < 1e-6, "{name} ends {high} m after the contact");
            assert!(
                (low + LONGEST_ARROW * share).abs() < 1e-5,
                "{name} begins at {low} m"
            );
        }
    }

    #[test]
    fn sleeves_start_at_wrist_and_point_away_from_fingers() {
        let object = rod();
        let handover = handover(&object);
        let scene = handover.to_scene();
        for (name, hand) in [
            ("giver_sleeve", &handover.giver),
            ("receiver_sleeve", &handover.receiver),
        ] {
            let joints = &hand.as_ref().expect("a hand").joints.joints;
            let wrist = joints[index::WRIST].pose.position;
            let to_fingers = joints[index::TIP_OF_DIGIT[2]].pose.position - wrist;
            let reach = part(&scene, name)
                .positions
                .iter()
                .map(|&p| (p - wrist).dot(to_fingers.normalize_or_zero()));
            let (low, high) = reach.fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), r| {
                (l.min(r), h.max(r))
            });
            assert!(
                (-0.02..0.02).contains(&high) && low < -0.1,
                "{name} reaches from {low} to {high}"
            );
        }
    }

    #[test]
    fn every_digit_has_a_nail_on_its_skin() {
        let object = rod();
        let handover = handover(&object);
        let scene = handover.to_scene();
        let (skin, nails) = (part(&scene, "receiver_hand"), part(&scene, "receiver_nails"));
        let joints = &handover.receiver.as_ref().expect("a hand").joints.joints;
        for tip in index::TIP_OF_DIGIT {
            let joint = joints[tip];
            let near = |p: &&Vec3| p.distance(joint.pose.position) < 2.5 * joint.radius;
            let of_tip: Vec<_> = nails.positions.iter().filter(near).collect();
            assert!(
                of_tip.len() > 50,
                "joint {tip} has {} vertices of a nail",
                of_tip.len()
            );
            let centre = of_tip.iter().copied().sum::<Vec3>() / of_tip.len() as f32;
            // Out of the back of the finger, not out of its pad.
            let local = joint.pose.inverse().transform_point(centre);
            assert!(
                local.y > 0.3 * joint.radius,
                "the nail of joint {tip} is at {local}"
            );
            let closest = skin
                .positions
                .iter()
                .map(|p| p.distance(centre))
                .fold(f32::INFINITY, f32::min);
            assert!(
                closest < 4e-3,
                "the nail of joint {tip} floats {closest} m off the skin"
            );
        }
    }

    #[test]
    fn picture_shows_two_views() {
        let object = rod();
        let options = RenderOptions {
            width: 150,
            height: 120,
            supersampling: 2,
            ..RenderOptions::default()
        };
        let image = handover(&object).render(options);
        assert!(image.width() > 300 && image.height() == 120);
        let left: Vec<_> = (0..150).map(|x| image.pixel(x, 60)).collect();
        let right: Vec<_> = (0..150)
            .map(|x| image.pixel(image.width() - 150 + x, 60))
            .collect();
        assert_ne!(left, right);
    }
}
