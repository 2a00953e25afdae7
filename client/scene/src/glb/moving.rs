//! Moving handovers as binary glTF 2.0 files with an animation.

use glam::{Mat4, Quat, Vec3};
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::{
        joints::{HandJoints, JOINT_COUNT, JOINT_NAMES, index},
        skin::SkinJoint,
    },
};
use serde_json::{Value, json};

use super::SceneWriter;
use crate::{
    handover::HandoverScene,
    moving::{MovingHand, MovingHandover},
    scene::Part,
    skin_look::bound_hand_parts,
    sleeve::sleeve,
};

/// Scales that differ by less count as equal.
const SAME_SCALE: f32 = 1e-5;

/// A moving handover as a GLB file with an animation `handover`: a key frame per moment.
///
/// The object is a node that moves. Each hand is a node of its name with 26 joints below it, named after the hand and the
/// joint in `WebXR` (`giver_wrist`), which move its skinned meshes, such as `giver_hand` and `giver_nails`; the sleeve is below
/// the wrist. A hand that is not there has no size.
///
/// # Panics
/// The file exceeds 4 GiB, or there is not one pose of the object and of each hand per moment.
pub fn to_moving_glb(handover: &MovingHandover<'_>) -> Vec<u8> {
    assert_eq!(handover.client_from_object.len(), handover.times.len());
    let mut writer = SceneWriter::default();
    if handover.times.is_empty() {
        return writer.finish();
    }
    let still = HandoverScene {
        client_from_object: Pose::IDENTITY,
        ..handover.object.clone()
    };
    let object = writer.add_part(&still.object_part());
    let mut animation = Animation {
        times: writer.file.times(&handover.times),
        samplers: Vec::new(),
        channels: Vec::new(),
    };
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
    fn add_poses(&mut self, writer: &mut SceneWriter, node: usize, poses: &[Pose]) {
        let positions: Vec<Vec3> = poses.iter().map(|pose| pose.position).collect();
        let translations = writer.file.vector_keys(&positions);
        self.add(node, "translation", "LINEAR", translations);
        let mut orientations: Vec<Quat> = poses.iter().map(|pose| pose.orientation.normalize()).collect();
        // Of a quaternion and its opposite, the one near that before: some viewers do not take the short way.
        for i in 1..orientations.len() {
            if orientations[i].dot(orientations[i - 1]) < 0.0 {
                orientations[i] = -orientations[i];
            }
        }
        writer.nodes[node]["translation"] = json!(positions.first());
        writer.nodes[node]["rotation"] = json!(orientations.first());
        let rotations = writer.file.rotation_keys(&orientations);
        self.add(node, "rotation", "LINEAR", rotations);
    }
}

impl SceneWriter {
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
                if scales
                    .iter()
                    .any(|scale| !scale.abs_diff_eq(scales[0], SAME_SCALE))
                {
                    let output = self.file.vector_keys(&scales);
                    animation.add(node, "scale", "LINEAR", output);
                }
                node
            })
            .collect();
        let sleeve = self.add_sleeve(hand);
        self.nodes[joints[index::WRIST]]["children"] = json!([sleeve]);
        let root = self.add_root(json!({"name": hand.name, "children": joints}));
        if hand.joints.iter().any(Option::is_none) {
            let sizes: Vec<Vec3> = hand
                .joints
                .iter()
                .map(|joints| Vec3::splat(f32::from(u8::from(joints.is_some()))))
                .collect();
            let output = self.file.vector_keys(&sizes);
            animation.add(root, "scale", "STEP", output);
        }
        self.add_skin(hand, root, &joints);
    }

    fn add_skin(&mut self, hand: &MovingHand<'_>, root: usize, joints: &[usize]) {
        // The inverse as a pose: that of a matrix is inexact in its last row.
        let inverse_bind = hand.skin.bind_frames().map(|frame| {
            let inverse = frame.inverse();
            Mat4::from_rotation_translation(inverse.orientation, inverse.position)
        });
        let skin = self.skins.len();
        let matrices = self.file.matrices(&inverse_bind);
        self.skins.push(json!({
            "name": hand.name, "joints": joints, "skeleton": root, "inverseBindMatrices": matrices,
        }));
        for (part, binding) in bound_hand_parts(&hand.name, hand.skin, hand.person.complexion()) {
            let mesh = self.add_mesh(&part, Some(&binding));
            // At the root: its node's own transform does not move a skinned mesh.
            self.add_root(json!({"name": part.name, "mesh": mesh, "skin": skin}));
        }
    }

    /// The sleeve in the frame of the wrist.
    fn add_sleeve(&mut self, hand: &MovingHand<'_>) -> usize {
        let skin = hand.skin;
        let name = format!("{}_sleeve", hand.name);
        let at_rest = sleeve(&name, &skin.bind, &skin.positions, hand.person.sleeve_colour());
        let wrist_from_bind = skin.bind_frames()[index::WRIST].inverse();
        let positions = at_rest
            .positions
            .iter()
            .map(|&p| wrist_from_bind.transform_point(p));
        let part = Part {
            positions: positions.collect(),
            ..at_rest
        };
        let mesh = self.add_mesh(&part, None);
        self.add_node(json!({"name": name, "mesh": mesh}))
    }
}

/// The joints at every moment: those before or else after, where the hand is not there. None if it never is.
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
