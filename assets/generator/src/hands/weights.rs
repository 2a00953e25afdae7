//! How much each joint moves each vertex of the skin.
//!
//! A vertex belongs at most to one digit, so that no finger pulls at its neighbour; beyond the first phalanges it
//! belongs to the palm, whose weights are spread over wrist and metacarpals.

use glam::Vec3;
use grasp_synthesis::hand::{
    joints::{HandJoints, JOINT_COUNT, index},
    rig::Rig,
};

/// Joint indices and weights of one vertex; the weights sum to one, the largest comes first.
pub(super) type VertexWeights = ([u8; 4], [f32; 4]);

/// The weights of the vertices of a skin in the bind pose `bind`.
pub(super) fn skin_weights(rig: &Rig, bind: &HandJoints, positions: &[Vec3]) -> Vec<VertexWeights> {
    positions
        .iter()
        .map(|&p| strongest_four(&weights_at(rig, bind, p)))
        .collect()
}

fn weights_at(rig: &Rig, bind: &HandJoints, p: Vec3) -> [f32; JOINT_COUNT] {
    let mut weights = palm_weights(bind, p);
    let scale = rig.reach / 0.19;
    // The two digits whose skin is nearest.
    let mut near: Vec<(f32, usize)> = (0..5)
        .map(|digit| (distance_over_skin(bind, digit, p), digit))
        .collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let [(over, digit), (next_over, _), ..] = near[..] else {
        return weights;
    };
    let joints = bent_joints(digit);
    let at = |joint: usize| bind.joints[joint].pose.position;
    // Signed distance past each bending joint, measured along the mean of the bones before and after it.
    let past = |joint: usize| {
        let along =
            (at(joint) - at(joint - 1)).normalize_or_zero() + (at(joint + 1) - at(joint)).normalize_or_zero();
        (p - at(joint)).dot(along.normalize_or(Vec3::Y))
    };
    let blend = |joint: usize, from: f32, to: f32| {
        let radius = bind.joints[joint].radius;
        smooth_step(from * radius, to * radius, past(joint))
    };
    // The root: the palm gives way to the first phalanx. Skin far from every phalanx, as in the webs, stays with the
    // palm, and so does skin midway between two fingers unless it is clearly beyond the web.
    let beyond_web = smooth_step(14.0 * scale, 22.0 * scale, 1e3 * past(joints[0]));
    let alone = smooth_step(0.0, 6.0 * scale, 1e3 * (next_over - over));
    let close = 1.0 - smooth_step(3.0 * scale, 14.0 * scale, 1e3 * over);
    let root = blend(joints[0], -0.9, 1.1) * close * (alone + (1.0 - alone) * beyond_web);
    weights.iter_mut().for_each(|weight| *weight *= 1.0 - root);
    let mut share = root;
    for (i, &joint) in joints.iter().enumerate() {
        let onward = match joints.get(i + 1) {
            Some(&next) => blend(next, -0.8, 0.8),
            None => 0.0,
        };
        weights[joint] += share * (1.0 - onward);
        share *= onward;
    }
    weights
}

/// The joints of a digit that bend outside of the palm: knuckle, PIP and DIP; the thumb's MCP and IP.
fn bent_joints(digit: usize) -> &'static [usize] {
    const JOINTS: [[usize; 3]; 5] = [[3, 4, 0], [7, 8, 9], [12, 13, 14], [17, 18, 19], [22, 23, 24]];
    if digit == 0 {
        &JOINTS[0][..2]
    } else {
        &JOINTS[digit]
    }
}

/// The distance from the skin of a digit's phalanges, in metres; negative inside.
pub(super) fn distance_over_skin(bind: &HandJoints, digit: usize, p: Vec3) -> f32 {
    bent_joints(digit)
        .iter()
        .map(|&joint| {
            let (a, b) = (&bind.joints[joint], &bind.joints[joint + 1]);
            let (t, distance) = segment_distance(p, a.pose.position, b.pose.position);
            distance - (a.radius + t * (b.radius - a.radius))
        })
        .fold(f32::INFINITY, f32::min)
}

/// The weights of wrist and metacarpals, by the inverse fourth power of the distance to their bones: a higher power
/// would let each metacarpal move its own stripe of skin.
fn palm_weights(bind: &HandJoints, p: Vec3) -> [f32; JOINT_COUNT] {
    let at = |joint: usize| bind.joints[joint].pose.position;
    let wrist = at(index::WRIST);
    let forearm = bind.joints[index::WRIST]
        .pose
        .transform_vector(Vec3::new(0.0, 0.0, 1.0));
    let carpus = wrist.lerp(at(index::FIRST_OF_DIGIT[2]), 0.35);
    let mut weights = [0.0; JOINT_COUNT];
    let closeness = |from: Vec3, to: Vec3| segment_distance(p, from, to).1.max(1e-3).powi(-4);
    weights[index::WRIST] = closeness(wrist + 0.1 * forearm, carpus);
    for joint in index::FIRST_OF_DIGIT {
        weights[joint] = closeness(at(joint), at(joint + 1));
    }
    // Behind the carpus only the wrist moves the skin.
    let behind = smooth_step(0.012, -0.012, (p - carpus).dot(-forearm));
    for joint in index::FIRST_OF_DIGIT {
        weights[joint] *= 1.0 - behind;
    }
    let sum: f32 = weights.iter().sum();
    weights.map(|weight| weight / sum)
}

/// Where on a segment the nearest point is (0 to 1), and how far away.
fn segment_distance(p: Vec3, a: Vec3, b: Vec3) -> (f32, f32) {
    let t = ((p - a).dot(b - a) / (b - a).length_squared().max(1e-12)).clamp(0.0, 1.0);
    (t, p.distance(a + t * (b - a)))
}

/// 0 up to `from`, 1 beyond `to`, smooth between; `from` may be the larger one.
fn smooth_step(from: f32, to: f32, x: f32) -> f32 {
    let t = ((x - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// The four largest weights, scaled so that they sum to one.
fn strongest_four(weights: &[f32; JOINT_COUNT]) -> VertexWeights {
    let mut order: [usize; JOINT_COUNT] = std::array::from_fn(|i| i);
    order.sort_by(|&a, &b| weights[b].total_cmp(&weights[a]).then(a.cmp(&b)));
    let sum: f32 = order[..4].iter().map(|&i| weights[i]).sum();
    let mut joints = [0; 4];
    let mut kept = [0.0; 4];
    for i in 0..4 {
        let weight = weights[order[i]] / sum;
        // Shares below a thousandth move nothing that can be seen.
        if weight > 1e-3 {
            joints[i] = order[i] as u8;
            kept[i] = weight;
        }
    }
    let sum: f32 = kept.iter().sum();
    (joints, kept.map(|weight| weight / sum))
}
