//! Pictures and GLB scenes of answers. They show the data of request and answer: hands are posed by the joints sent over
//! the wire.

mod model;
mod object;

use std::{path::Path, sync::Arc};

use glam::Vec3;
use grasp_client::{Contact, Convention, Digit, FindAnswer, FindRequest, Grasp, Phalanx};
use grasp_scene::{
    ArmJoints, ContactMark, HandoverScene, Image, RenderOptions,
    client::{CannotDraw, Giver, ObjectLook, giver, receiver, synthesis_pose},
    to_glb,
};
use grasp_synthesis::model::hand;

use crate::{failure::Failure, values::ViewSize};
use model::skin_of_model;
pub(crate) use object::{everyday_look, object_look};

/// A holdout and, if found, its grasp.
#[derive(Clone, Debug)]
pub(crate) struct Picture {
    object: ObjectLook,
    request: FindRequest,
    grasp: Option<Grasp>,
    other_grasp: Option<Grasp>,
    /// The file that the receiving hand's rig was created from.
    model: Option<Arc<[u8]>>,
}

impl Picture {
    /// The holdout alone. The request must use `OpenXR` conventions, like scenes.
    pub(crate) fn new(object: ObjectLook, request: FindRequest) -> Result<Self, Failure> {
        if request.convention != Convention::OpenXr {
            return Err(Failure::Usage(
                "pictures require a request in the openxr convention".to_owned(),
            ));
        }
        Ok(Self {
            object,
            request,
            grasp: None,
            other_grasp: None,
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
    pub(crate) fn with_hands(self, answer: &FindAnswer) -> Self {
        Self {
            grasp: answer.grasp.clone(),
            other_grasp: answer.other_grasp.clone(),
            ..self
        }
    }

    /// Adds a hand.
    pub(crate) fn with_grasp(self, grasp: Grasp) -> Self {
        Self {
            grasp: Some(grasp),
            ..self
        }
    }

    /// Two views side by side, each of this size.
    pub(crate) fn draw(&self, size: ViewSize) -> Result<Image, Failure> {
        Ok(self.scene()?.render(self.options(size)))
    }

    /// The most informative view, in this size.
    pub(crate) fn draw_best_view(&self, size: ViewSize) -> Result<Image, Failure> {
        Ok(self.scene()?.render_best_view(self.options(size)))
    }

    /// The scene as a binary glTF file.
    pub(crate) fn to_glb(&self) -> Result<Vec<u8>, Failure> {
        Ok(to_glb(&self.scene()?.to_scene()))
    }

    fn options(&self, ViewSize { width, height }: ViewSize) -> RenderOptions {
        RenderOptions {
            width,
            height,
            up: self.request.up.unwrap_or(Vec3::Y).normalize_or(Vec3::Y),
            ..RenderOptions::default()
        }
    }

    fn scene(&self) -> Result<HandoverScene<'_>, Failure> {
        let presenting_hand = self.request.presenting_hand.as_ref();
        let (giver, mut others) = match presenting_hand.map(giver).transpose()? {
            None => (None, Vec::new()),
            Some(Giver::Skin(hand)) => (Some(*hand), Vec::new()),
            Some(Giver::Mesh(part)) => (None, vec![part]),
        };
        let hands = self.grasp.iter().chain(&self.other_grasp);
        let contacts = hands.flat_map(|grasp| &grasp.contacts);
        let arm = self.grasp.as_ref().and_then(|grasp| grasp.arm.as_ref());
        let mut hand = |grasp: &Option<Grasp>, name: &str| {
            let (Some(grasp), Some(model)) = (grasp, &self.model) else {
                return grasp.as_ref().map(receiver).transpose();
            };
            others.push(skin_of_model(model, grasp, name)?);
            Ok(None)
        };
        let receiver = hand(&self.grasp, "receiver_hand")?;
        let other_receiver = hand(&self.other_grasp, "other_receiver_hand")?;
        Ok(HandoverScene {
            giver,
            receiver,
            other_receiver,
            arm: arm.map(|arm| ArmJoints {
                shoulder: arm.client_shoulder,
                elbow: arm.client_elbow,
            }),
            contacts: contacts.map(mark).collect(),
            others,
            ..self.object.scene(synthesis_pose(self.request.client_from_object))
        })
    }
}

impl From<CannotDraw> for Failure {
    fn from(CannotDraw(why): CannotDraw) -> Self {
        Self::Usage(why)
    }
}

fn mark(contact: &Contact) -> ContactMark {
    ContactMark {
        position: contact.client_position,
        normal: contact.client_normal,
        force: contact.client_force,
        digit: contact.digit.map(|digit| match digit {
            Digit::Thumb => hand::Digit::Thumb,
            Digit::Index => hand::Digit::Index,
            Digit::Middle => hand::Digit::Middle,
            Digit::Ring => hand::Digit::Ring,
            Digit::Little => hand::Digit::Little,
        }),
        phalanx: contact.phalanx.map(|phalanx| match phalanx {
            Phalanx::First => hand::Phalanx::First,
            Phalanx::Second => hand::Phalanx::Second,
            Phalanx::Third => hand::Phalanx::Third,
        }),
    }
}

/// Writes a file, creating its folder if necessary.
pub(crate) fn write_file(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty());
    parent
        .map_or(Ok(()), std::fs::create_dir_all)
        .and_then(|()| std::fs::write(path, bytes))
        .map_err(|error| Failure::other(format!("cannot write {}", path.display()), error))
}
