//! Makes rigs of hands from models (GLB, glTF or VRM with a skinned hand or a whole character) and from joints at rest.
//!
//! [`hand_nodes`] finds the joints among the model's nodes, [`rest`] places a reference hand's axes and limits on them,
//! [`radii`] measures the skin, [`fit`] fits links and fingertips to it, [`check`] compares the bones with the skin that they move, and
//! [`binding`] later poses the model's nodes like the rig. Right hands are made; the joints of left ones are mirrored first.

mod binding;
mod check;
mod digits;
mod fit;
mod hand_nodes;
mod model;
mod names;
mod palm;
mod radii;
mod rest;

use glam::{DMat4, DVec4, Vec3};
use grasp_synthesis::{
    base::{pose::Pose, stop::Stop},
    model::hand::{
        HandPose, Handedness,
        joints::{HandJoints, JOINT_COUNT, index},
        rig::{DigitLimits, Rig},
    },
    physical::solids::rest_overlaps,
};

pub use binding::{Binding, PosedNode};
pub use model::{ModelPose, PosedSkin, posed_skin};

use crate::{
    MeshLimits,
    error::{ImportError, Violations, check_count},
    format::Format,
    gltf::{self, Scene},
    parts::quoted,
};
use hand_nodes::{HandNodes, check_digits, hand_name, hand_nodes, joints_of};
use model::{BindPose, Model};
use radii::{SkinVertex, Widths};
use rest::Skeleton;

/// Most nodes of a model: characters have some hundreds.
const MAX_NODES: usize = 10_000;

/// Largest number in a node's transform and its inverse: a micrometre as seen from a thousand kilometres.
const MAX_ENTRY: f64 = 1e12;

/// Largest difference of a hand's scale along its axes, as a share.
const UNEVEN_SCALE: f64 = 0.02;

/// A node of a model that is a joint.
#[derive(Clone, Debug)]
pub struct MappedJoint {
    /// The node's name.
    pub node: String,
    /// The hand; if absent, that of [`RigSource::side`] or of the node's name.
    pub side: Option<Handedness>,
    /// The joint's name in `WebXR`.
    pub joint: String,
}

/// Inputs of a rig beside the file or joints.
#[derive(Clone, Copy, Debug)]
pub struct RigSource<'a> {
    /// The rig's name.
    pub name: &'a str,
    /// The right hand whose axes, limits and, where nothing else is known, proportions it takes.
    pub reference: &'a Rig,
    /// The hand that a model shows if its names do not say.
    pub side: Option<Handedness>,
    /// Nodes whose joints are given, which go before names.
    pub joint_map: &'a [MappedJoint],
    /// The limits of the joints, thumb first.
    pub limits: [DigitLimits; 5],
    /// Factor of the measured widths.
    pub width_scale: f32,
    /// Radii that go before measured ones, by `OpenXR` index, in metres.
    pub radii: [Option<f32>; JOINT_COUNT],
    /// True if another file shows the other hand: nodes of that hand are nodes of that file.
    pub is_of_pair: bool,
}

/// A hand of a rig.
#[derive(Clone, Debug)]
pub struct ImportedHand {
    /// Its bones, limits and widths.
    pub rig: Rig,
    /// The nodes of the model; `None` for a hand that is the other one's mirror image or was not made from a model.
    pub binding: Option<Binding>,
    /// True if it is the other hand's mirror image.
    pub is_mirrored: bool,
}

/// Both hands.
#[derive(Clone, Debug)]
pub struct ImportedRig {
    /// The left hand.
    pub left: ImportedHand,
    /// The right hand.
    pub right: ImportedHand,
    /// Values taken from the reference because the model lacks them, and oddities of bones and skin.
    pub warnings: Vec<String>,
}

impl ImportedRig {
    /// One rig of the hands of two models, each of which shows the other hand.
    ///
    /// # Errors
    /// They do not show one hand each.
    pub fn joined(self, other: Self) -> Result<Self, ImportError> {
        let shown = |rig: &Self| (!rig.left.is_mirrored, !rig.right.is_mirrored);
        let wrong = |what: &str| Err(ImportError::at("the models", what));
        let (left, right) = match (shown(&self), shown(&other)) {
            ((true, false), (false, true)) => (self.left, other.right),
            ((false, true), (true, false)) => (other.left, self.right),
            ((true, true), _) | (_, (true, true)) => {
                return wrong("show both hands in one file; leave the other out");
            }
            _ => {
                return wrong(
                    "show the same hand; one must be the left and the other the right one, and handedness says which hand the first \
                     shows if the names of its nodes do not",
                );
            }
        };
        let warnings = [self.warnings, other.warnings].concat();
        Ok(Self {
            left,
            right,
            warnings,
        })
    }
}

/// Reads the hands of a model. The other hand of a model with one is its mirror image.
///
/// # Errors
/// Every violation; see [`ImportError`]. Beyond 16 they are only counted.
pub fn read_rig(
    bytes: &[u8],
    source: RigSource<'_>,
    limits: MeshLimits,
) -> Result<ImportedRig, Vec<ImportError>> {
    check_count("the file", "bytes", bytes.len() as u64, limits.bytes)?;
    if Format::of(bytes) != Format::Gltf {
        let what = "is no glTF; a hand is required as GLB, glTF or VRM";
        return Err(ImportError::at("the model", what).into());
    }
    let opened = gltf::open(bytes, limits.unwelded(), Stop::NEVER)?;
    let nodes = opened.document.nodes().len() as u64;
    check_count("the mesh", "nodes", nodes, MAX_NODES)?;
    let model = Model::of(&opened, Scene::of(&opened.document))?;
    let mut violations = Violations::default();
    let mut warnings = Vec::new();
    let vrm = names::vrm_hands(&opened.json, &model).unwrap_or_else(|error| {
        warnings.push(format!(
            "the VRM extension cannot be read, so joints are recognised by names: {error}"
        ));
        None
    });
    let hands = hand_nodes(&model, vrm, &source, &mut violations);
    violations.into_result()?;
    let mut violations = Violations::default();
    let mut read = Vec::new();
    for hand in &hands {
        read.extend(read_hand(&model, hand, &source, &mut warnings, &mut violations));
    }
    violations.into_result()?;
    Ok(both(&read, warnings))
}

/// Makes a rig of the joints of one or both hands, flat and at rest, in any frame and in metres. Fingers whose tips have no radius
/// are missing.
///
/// # Errors
/// Every violation; see [`ImportError`].
pub fn rig_at_rest(hands: &[HandJoints], source: RigSource<'_>) -> Result<ImportedRig, Vec<ImportError>> {
    let mut violations = Violations::default();
    let made = hands
        .iter()
        .filter_map(|hand| hand_at_rest(hand, &source, &mut violations));
    let made: Vec<ImportedHand> = made.collect();
    violations.into_result()?;
    Ok(both(&made, Vec::new()))
}

fn hand_at_rest(
    hand: &HandJoints,
    source: &RigSource<'_>,
    violations: &mut Violations,
) -> Option<ImportedHand> {
    let side = hand.handedness;
    let has = index::TIP_OF_DIGIT.map(|tip| hand.joints[tip].radius > 0.0);
    let mut positions = hand.joints.map(|joint| Some(as_right(side, joint.pose.position)));
    for digit in (0..5).filter(|&digit| !has[digit]) {
        positions[joints_of(digit)].fill(None);
    }
    let before = violations.len();
    check_digits(side, has, violations);
    if violations.len() > before {
        return None;
    }
    let skeleton = Skeleton::new(side, &positions, source.reference, violations)?;
    let widths = Widths::given(hand.joints.map(|joint| joint.radius)).changed(source);
    let rig = skeleton.rig(&widths, source);
    Some(ImportedHand {
        rig: of_side(side, with_overlaps(rig)),
        binding: None,
        is_mirrored: false,
    })
}

/// A rig whose parts may overlap as much as they do at rest: that is flesh that neighbours share.
fn with_overlaps(mut rig: Rig) -> Rig {
    let stretched = HandPose {
        frame_from_wrist: Pose::IDENTITY,
        digits: rig.stretched(),
    };
    rig.rest_overlaps = rest_overlaps(&rig, &[stretched]);
    rig
}

/// A position of a hand as of a right hand.
fn as_right(side: Handedness, position: Vec3) -> Vec3 {
    match side {
        Handedness::Left => position * Vec3::new(-1.0, 1.0, 1.0),
        Handedness::Right => position,
    }
}

/// A right hand's rig as one of a side.
fn of_side(side: Handedness, rig: Rig) -> Rig {
    match side {
        Handedness::Left => rig.mirrored(),
        Handedness::Right => rig,
    }
}

/// Both hands of a rig, of which at least one was made.
fn both(hands: &[ImportedHand], warnings: Vec<String>) -> ImportedRig {
    let of = |side: Handedness| {
        let own = hands.iter().find(|hand| hand.rig.handedness == side);
        own.cloned().unwrap_or_else(|| ImportedHand {
            rig: hands[0].rig.mirrored(),
            binding: None,
            is_mirrored: true,
        })
    };
    ImportedRig {
        left: of(Handedness::Left),
        right: of(Handedness::Right),
        warnings,
    }
}

fn read_hand(
    model: &Model,
    hand: &HandNodes,
    source: &RigSource<'_>,
    warnings: &mut Vec<String>,
    violations: &mut Violations,
) -> Option<ImportedHand> {
    let side = hand.side;
    let wrist = hand.joints[index::WRIST]?;
    // The joint that each node belongs to: its own, or that of the nearest node above it, up to the wrist.
    let nodes = 0..model.names.len();
    let joints: Vec<Option<usize>> = nodes.map(|node| hand.nearest_joint(model, node)).collect();
    let bind = BindPose::new(model, &hand.joints, wrist, |node| joints[node].is_some());
    let before = violations.len();
    for node in binding::needed_nodes(model, hand) {
        if !is_usable(bind.scene_from_node(node)) {
            let place = format!("node {}", quoted(&model.names[node]));
            violations.add(place, "has a scale that is zero, not finite or extreme");
        }
    }
    if violations.len() > before {
        return None;
    }
    if let Some(wrong) = wrong_scale(bind.scene_from_node(wrist)) {
        violations.add(hand_name(side), wrong);
        return None;
    }
    let positions = hand.joints.map(|node| {
        let bound = bind.scene_from_node(node?).w_axis.truncate();
        Some(as_right(side, bound.as_vec3()))
    });
    let skeleton = Skeleton::new(side, &positions, source.reference, violations)?;
    let wrist_from_scene = skeleton.frame_from_wrist.inverse();
    let placed = joints.iter().enumerate();
    let placed = placed.map(|(node, joint)| Some(((*joint)?, bind.scene_from_node(node))));
    let placed: Vec<Option<(usize, DMat4)>> = placed.collect();
    let skin = model.vertices.iter().filter_map(|vertex| {
        let (joint, scene_from_node) = placed[vertex.node]?;
        let position = scene_from_node.transform_point3(vertex.position).as_vec3();
        let position = wrist_from_scene.transform_point(as_right(side, position));
        position.is_finite().then_some(SkinVertex { joint, position })
    });
    let skin: Vec<SkinVertex> = skin.collect();
    let measured = Widths::of(&skin, &skeleton, source.reference);
    check::HandCheck {
        side,
        has: hand.joints.map(|node| node.is_some()),
        skeleton: &skeleton,
        widths: &measured,
        skin: &skin,
        source,
    }
    .check(warnings, violations)?;
    let widths = measured.changed(source);
    let mut rig = skeleton.rig(&widths, source);
    let at_rest = skeleton.joints_with_tips(&widths);
    // The stumps of missing fingers are no flesh of the palm.
    if skeleton.has.iter().all(|&has| has) {
        rig.palm_flesh = palm::flesh(&rig, skeleton.size, &at_rest, &skin);
    }
    let rig = of_side(side, with_overlaps(rig));
    let at_rest = at_rest.map(|joint| as_right(side, joint));
    let scene_from_wrist = match side {
        Handedness::Left => skeleton.frame_from_wrist.mirrored_x(),
        Handedness::Right => skeleton.frame_from_wrist,
    };
    let binding = Binding::new(model, hand, &bind, &rig, (scene_from_wrist, &at_rest));
    Some(ImportedHand {
        rig,
        binding: Some(binding),
        is_mirrored: false,
    })
}

/// Whether a node's transform has a rotation and an inverse, such that its joint's place in any other is finite in single precision.
fn is_usable(transform: DMat4) -> bool {
    [transform, transform.inverse()].iter().all(|matrix| {
        let entries = matrix.to_cols_array();
        entries.iter().all(|entry| entry.abs() <= MAX_ENTRY)
    })
}

/// Why a hand cannot be scaled as its wrist is: its bones would not turn as rigid ones.
fn wrong_scale(bound: DMat4) -> Option<String> {
    let lengths = [bound.x_axis, bound.y_axis, bound.z_axis].map(DVec4::length);
    let most = lengths.into_iter().fold(0.0, f64::max);
    let least = lengths.into_iter().fold(f64::INFINITY, f64::min);
    if most > least * (1.0 + UNEVEN_SCALE) {
        Some(format!(
            "is scaled by {least:.4} to {most:.4} along its axes; the scale must be the same along all"
        ))
    } else if bound.determinant() < 0.0 {
        Some("is mirrored by a negative scale; apply the scale in the program that made the model".to_owned())
    } else {
        None
    }
}
