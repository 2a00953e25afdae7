//! Moving handovers as binary glTF 2.0 files with an animation.

use glam::{Mat4, Quat, Vec3};
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::joints::{HandJoints, JOINT_COUNT, JOINT_NAMES, Skin, SkinJoint, index},
};
use serde_json::{Value, json};

use super::{Binding, NO_TARGET, Writer};
use crate::{people::Person, scene::Part};

/// Scales that differ by less count as equal.
const SAME_SCALE: f32 = 1e-5;

/// A hand at every moment of a moving handover.
#[derive(Clone, Debug)]
pub struct MovingHand<'a> {
    /// Start of the names of its parts, such as `giver`; each hand has its own.
    pub name: String,
    /// Whose it is.
    pub person: Person,
    /// The skin to pose.
    pub skin: &'a Skin,
    /// The joints at each moment, in the client's frame; `None` when the hand is not there.
    pub joints: Vec<Option<HandJoints>>,
}

/// A handover that moves, in the client's frame: metres, right-handed.
#[derive(Clone, Debug)]
pub struct MovingHandover<'a> {
    /// The object, in its own frame.
    pub object: Part,
    /// The times of the moments, in seconds, rising.
    pub times: Vec<f32>,
    /// Pose of the object at each moment.
    pub client_from_object: Vec<Pose>,
    /// The hands.
    pub hands: Vec<MovingHand<'a>>,
}

/// A moving handover as a GLB file with an animation `handover`: a key frame per moment.
///
/// The object is a node that moves. Each hand is a node of its name with 26 joints below it, named after the hand and the
/// joint in `WebXR` (`giver_wrist`), which move its skinned mesh, such as `giver_hand`; the sleeve is below the wrist. A hand
/// that is not there has no size.
///
/// # Panics
/// The file exceeds 4 GiB, or there is not one pose of the object and of each hand per moment.
pub fn to_moving_glb(handover: &MovingHandover<'_>) -> Vec<u8> {
    assert_eq!(handover.client_from_object.len(), handover.times.len());
    let mut writer = Writer::default();
    if handover.times.is_empty() {
        return writer.finish();
    }
    let object = writer.add_part(&handover.object);
    let times: Vec<[f32; 1]> = handover.times.iter().map(|&time| [time]).collect();
    let mut animation = Animation {
        times: writer.floats(&times, "SCALAR", NO_TARGET),
        samplers: Vec::new(),
        channels: Vec::new(),
    };
    writer.add_bounds(animation.times, &times);
    animation.add_poses(&mut writer, object, &handover.client_from_object);
    for hand in &handover.hands {
        assert_eq!(hand.joints.len(), handover.times.len());
        writer.add_moving_hand(hand, &mut animation);
    }
    writer.animations.push(json!({
        "name": "handover", "samplers": animation.samplers, "channels": animation.channels,
    }));
    writer.finish()
}

/// How nodes move.
struct Animation {
    /// The accessor of the times.
    times: usize,
    samplers: Vec<Value>,
    channels: Vec<Value>,
}

impl Animation {
    fn add(&mut self, node: usize, path: &str, interpolation: &str, output: usize) {
        self.channels.push(json!({
            "sampler": self.samplers.len(), "target": {"node": node, "path": path},
        }));
        self.samplers.push(json!({
            "input": self.times, "output": output, "interpolation": interpolation,
        }));
    }

    /// Poses of a node at all times. Viewers that do not play animations show the first one.
    fn add_poses(&mut self, writer: &mut Writer, node: usize, poses: &[Pose]) {
        let positions: Vec<[f32; 3]> = poses.iter().map(|pose| pose.position.to_array()).collect();
        let translations = writer.floats(&positions, "VEC3", NO_TARGET);
        self.add(node, "translation", "LINEAR", translations);
        let mut orientations: Vec<Quat> = poses.iter().map(|pose| pose.orientation.normalize()).collect();
        // Of a quaternion and its opposite, the one near that before: some viewers do not take the short way.
        for i in 1..orientations.len() {
            if orientations[i].dot(orientations[i - 1]) < 0.0 {
                orientations[i] = -orientations[i];
            }
        }
        let orientations: Vec<[f32; 4]> = orientations.iter().map(Quat::to_array).collect();
        writer.nodes[node]["translation"] = json!(positions.first());
        writer.nodes[node]["rotation"] = json!(orientations.first());
        let rotations = writer.floats(&orientations, "VEC4", NO_TARGET);
        self.add(node, "rotation", "LINEAR", rotations);
    }
}

impl Writer {
    fn add_moving_hand(&mut self, hand: &MovingHand<'_>, animation: &mut Animation) {
        let Some(postures) = filled(&hand.joints) else {
            return;
        };
        let moved: Vec<[SkinJoint; JOINT_COUNT]> = postures
            .iter()
            .map(|joints| hand.skin.joints_at(joints))
            .collect();
        let joints: Vec<usize> = (0..JOINT_COUNT)
            .map(|joint| {
                let node = self.add_node(json!({"name": format!("{}_{}", hand.name, JOINT_NAMES[joint])}));
                let poses: Vec<Pose> = moved.iter().map(|joints| joints[joint].pose).collect();
                animation.add_poses(self, node, &poses);
                let scales: Vec<Vec3> = moved.iter().map(|joints| joints[joint].scale).collect();
                self.nodes[node]["scale"] = json!(scales[0].to_array());
                let is_same = |scale: &Vec3| scale.abs_diff_eq(scales[0], SAME_SCALE);
                if !scales.iter().all(is_same) {
                    self.add_scales(animation, node, "LINEAR", scales.iter());
                }
                node
            })
            .collect();
        let sleeve = self.add_sleeve(hand);
        self.nodes[joints[index::WRIST]]["children"] = json!([sleeve]);
        let root = self.add_root(json!({"name": hand.name, "children": joints}));
        if hand.joints.iter().any(Option::is_none) {
            let size = |joints: &Option<HandJoints>| if joints.is_some() { &Vec3::ONE } else { &Vec3::ZERO };
            self.add_scales(animation, root, "STEP", hand.joints.iter().map(size));
        }
        self.add_skin(hand, root, &joints);
    }

    fn add_scales<'a>(
        &mut self,
        animation: &mut Animation,
        node: usize,
        interpolation: &str,
        scales: impl Iterator<Item = &'a Vec3>,
    ) {
        let scales: Vec<[f32; 3]> = scales.map(Vec3::to_array).collect();
        let output = self.floats(&scales, "VEC3", NO_TARGET);
        animation.add(node, "scale", interpolation, output);
    }

    fn add_skin(&mut self, hand: &MovingHand<'_>, root: usize, joints: &[usize]) {
        // The inverse as a pose: that of a matrix is inexact in its last row.
        let inverse_bind = hand.skin.bind_frames().map(|frame| {
            let inverse = frame.inverse();
            Mat4::from_rotation_translation(inverse.orientation, inverse.position).to_cols_array()
        });
        let matrices = self.floats(&inverse_bind, "MAT4", NO_TARGET);
        let skin = self.skins.len();
        self.skins.push(json!({
            "name": hand.name, "joints": joints, "skeleton": root, "inverseBindMatrices": matrices,
        }));
        let name = format!("{}_hand", hand.name);
        let part = hand.person.hand(&name, hand.skin, hand.skin.positions.clone());
        let binding = Binding {
            joints: &hand.skin.joint_indices,
            weights: &hand.skin.weights,
        };
        let mesh = self.add_mesh(&part, Some(binding));
        // At the root: its node's own transform does not move a skinned mesh.
        self.add_root(json!({"name": name, "mesh": mesh, "skin": skin}));
    }

    /// The sleeve in the frame of the wrist.
    fn add_sleeve(&mut self, hand: &MovingHand<'_>) -> usize {
        let name = format!("{}_sleeve", hand.name);
        let mut part = hand.person.sleeve(&name, &hand.skin.bind, &hand.skin.positions);
        let wrist_from_bind = hand.skin.bind_frames()[index::WRIST].inverse();
        for position in &mut part.positions {
            *position = wrist_from_bind.transform_point(*position);
        }
        let mesh = self.add_mesh(&part, None);
        self.add_node(json!({"name": name, "mesh": mesh}))
    }
}

/// The joints at every moment: those before or else after, where the hand is not there. `None` if it never is.
fn filled(joints: &[Option<HandJoints>]) -> Option<Vec<&HandJoints>> {
    let mut last = joints.iter().flatten().next()?;
    let at_every_moment = joints.iter().map(|joints| {
        last = joints.as_ref().unwrap_or(last);
        last
    });
    Some(at_every_moment.collect())
}

#[cfg(test)]
mod tests;
