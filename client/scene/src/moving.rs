//! Handovers that move: the object and hands at successive moments.

use grasp_synthesis::{
    base::pose::Pose,
    model::hand::{
        joints::{HandJoints, index},
        skin::Skin,
    },
};

use crate::{
    handover::{HandoverScene, Person, PosedHand, importance},
    image::{Image, contact_sheet},
    render::{RenderOptions, render},
    scene::Scene,
    views::choose_views,
};

/// An object this far from every hand is out of the picture, in metres: one that falls would make everything else small.
const MAX_OBJECT_DISTANCE: f32 = 0.6;

/// A hand at every moment of a moving handover.
#[derive(Clone, Debug)]
pub struct MovingHand<'a> {
    /// Start of the names of its parts, such as `giver`; each hand has its own.
    pub name: String,
    /// Whose it is.
    pub person: Person,
    /// The skin to pose.
    pub skin: &'a Skin,
    /// The joints at each moment, in the client's frame; none when the hand is not there.
    pub joints: Vec<Option<HandJoints>>,
}

/// A handover that moves, in the client's frame: metres, right-handed.
#[derive(Clone, Debug)]
pub struct MovingHandover<'a> {
    /// The object and how it looks; its pose, hands and contacts are not used.
    pub object: HandoverScene<'a>,
    /// The times of the moments, in seconds, rising.
    pub times: Vec<f32>,
    /// Pose of the object at each moment.
    pub client_from_object: Vec<Pose>,
    /// The hands.
    pub hands: Vec<MovingHand<'a>>,
}

impl MovingHandover<'_> {
    /// The scene at a moment: parts as in [`HandoverScene::to_scene`], named after the hands.
    ///
    /// # Panics
    /// There is no such moment.
    pub fn scene_at(&self, moment: usize) -> Scene {
        let object = HandoverScene {
            client_from_object: self.client_from_object[moment],
            ..self.object.clone()
        };
        let mut parts = vec![object.object_part()];
        for hand in &self.hands {
            if let Some(joints) = hand.joints[moment].clone() {
                let posed = PosedHand {
                    skin: hand.skin,
                    joints,
                };
                parts.extend(posed.parts(&hand.name, hand.person, None));
            }
        }
        Scene { parts }
    }

    /// Moments with captions side by side, in rows of `columns`, all seen by the camera that shows them best. None without
    /// moments.
    ///
    /// # Panics
    /// There is no such moment.
    pub fn strip(
        &self,
        moments: &[(usize, String)],
        columns: usize,
        options: RenderOptions,
    ) -> Option<Image> {
        let scenes: Vec<Scene> = moments.iter().map(|&(moment, _)| self.scene_at(moment)).collect();
        let mut framed = scenes.clone();
        for (scene, &(moment, _)) in framed.iter_mut().zip(moments) {
            if !self.is_object_near_hands(moment) {
                scene.parts.retain(|part| part.name != "object");
            }
        }
        let aspect = options.width.max(1) as f32 / options.height.max(1) as f32;
        let [camera, _] = choose_views(&framed, |part| importance(part, 0), options.up, aspect);
        let pictures: Vec<_> = scenes
            .iter()
            .zip(moments)
            .map(|(scene, (_, caption))| (render(scene, &camera, options), caption.clone()))
            .collect();
        contact_sheet(&pictures, columns)
    }

    /// True if a hand is near the object, or no hand is there.
    fn is_object_near_hands(&self, moment: usize) -> bool {
        let object = self.client_from_object[moment].position;
        let mut distances = self
            .hands
            .iter()
            .filter_map(|hand| hand.joints[moment].as_ref())
            .map(|joints| joints.joints[index::PALM].pose.position.distance(object))
            .peekable();
        distances.peek().is_none() || distances.any(|distance| distance < MAX_OBJECT_DISTANCE)
    }
}
