//! Pictures and GLB scenes of answers. They show the data of request and answer: hands are posed by the joints sent over
//! the wire.

mod model;
mod object;

use std::sync::Arc;

use glam::Vec3;
use grasp_client::{Convention, v1};
use grasp_scene::{
    ArmJoints, ContactMark, HandoverScene, Image, RenderOptions,
    client::{CannotDraw, Giver, ObjectLook, giver, receiver, synthesis_pose},
    to_glb,
};
use grasp_synthesis::model::hand;

use crate::{Failure, values::ViewSize};
use model::skin_of_model;
pub(crate) use object::object_look;

/// A holdout and, if found, its grasp.
#[derive(Clone, Debug)]
pub(crate) struct Picture {
    object: ObjectLook,
    holdout: v1::Holdout,
    grasps: Vec<v1::Grasp>,
    /// The file that the receiving hand's rig was created from.
    model: Option<Arc<[u8]>>,
}

impl Picture {
    /// The holdout alone. The request must use `OpenXR` conventions, like scenes.
    pub(crate) fn new(object: ObjectLook, request: &v1::FindGraspRequest) -> Result<Self, Failure> {
        let convention = request.output.as_ref().map(v1::OutputOptions::convention);
        if !matches!(
            convention.unwrap_or_default(),
            Convention::Unspecified | Convention::Openxr
        ) {
            return Err(Failure::usage(
                "pictures require a request in the openxr convention",
            ));
        }
        Ok(Self {
            object,
            holdout: request.holdout.clone().unwrap_or_default(),
            grasps: Vec::new(),
            model: None,
        })
    }

    /// Draws receiving hands with the skin of the model that their rig was created from.
    pub(crate) fn with_model(self, model: Option<Vec<u8>>) -> Self {
        Self {
            model: model.map(Into::into),
            ..self
        }
    }

    /// Adds the hand or hands of an answer.
    pub(crate) fn with_grasps(self, grasps: Vec<v1::Grasp>) -> Self {
        Self { grasps, ..self }
    }

    /// The most informative view.
    pub(crate) fn draw(&self, size: ViewSize) -> Result<Image, Failure> {
        let options = RenderOptions {
            up: self.holdout.up.map_or(Vec3::Y, Vec3::from).normalize_or(Vec3::Y),
            ..size.into()
        };
        Ok(self.scene()?.render_best_view(options))
    }

    /// The scene as a binary glTF file.
    pub(crate) fn to_glb(&self) -> Result<Vec<u8>, Failure> {
        Ok(to_glb(&self.scene()?.to_scene()))
    }

    fn scene(&self) -> Result<HandoverScene<'_>, Failure> {
        let client_from_object = self.holdout.client_from_object;
        let presenting_hand = self.holdout.presenting_hand.as_ref();
        let giver = presenting_hand.map(|hand| giver(hand, client_from_object));
        let (giver, mut others) = match giver.transpose()? {
            None => (None, Vec::new()),
            Some(Giver::Skin(hand)) => (Some(*hand), Vec::new()),
            Some(Giver::Mesh(part)) => (None, vec![part]),
        };
        let contacts = self.grasps.iter().flat_map(v1::Grasp::client_contacts);
        let arm = self.grasps.first().and_then(|grasp| grasp.arm.as_ref());
        let mut hands = self.grasps.iter().filter_map(|grasp| grasp.hand.as_ref());
        let mut next_hand = |name: &str| {
            let Some(hand) = hands.next() else {
                return Ok(None);
            };
            let Some(model) = &self.model else {
                return receiver(hand).map(Some);
            };
            others.push(skin_of_model(model, hand, name)?);
            Ok(None)
        };
        let receiver = next_hand("receiver_hand")?;
        let other_receiver = next_hand("other_receiver_hand")?;
        Ok(HandoverScene {
            giver,
            receiver,
            other_receiver,
            arm: arm.map(|arm| ArmJoints {
                shoulder: arm.client_shoulder.unwrap_or_default().into(),
                elbow: arm.client_elbow.unwrap_or_default().into(),
            }),
            contacts: contacts.map(|contact| mark(&contact)).collect(),
            others,
            ..self.object.scene(synthesis_pose(client_from_object))
        })
    }
}

impl From<CannotDraw> for Failure {
    fn from(CannotDraw(why): CannotDraw) -> Self {
        Self::Usage(why)
    }
}

fn mark(contact: &v1::Contact) -> ContactMark {
    // Counted from 1; 0 is the palm, or no link.
    let place = |number: i64| usize::try_from(number - 1).ok();
    let digit = place(contact.digit.into()).and_then(|place| hand::Digit::ALL.get(place));
    let phalanx = place(contact.phalanx.into()).and_then(|place| hand::Phalanx::ALL.get(place));
    ContactMark {
        position: contact.position(),
        normal: contact.normal(),
        force: contact.force(),
        digit: digit.copied(),
        phalanx: phalanx.copied(),
    }
}
