//! How much each joint moves each vertex of the skin.
//!
//! A vertex belongs to one digit, so that no finger pulls at its neighbour; only the fold of a web follows both of
//! its fingers. Toward the wrist the digits give way to the palm, whose weights are spread over wrist and metacarpals.

use glam::Vec3;
use grasp_synthesis::model::hand::{
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
    // Metres per millimetre of the adult hand.
    let scale = 1e-3 * rig.reach / 0.19;
    // The two digits whose skin is nearest.
    let mut near: Vec<(f32, usize)> = (0..5)
        .map(|digit| (distance_over_skin(bind, digit, p), digit))
        .collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let [(over, digit), (next_over, next_digit), ..] = near[..] else {
        return weights;
    };
    // Where two fingers are about equally near there is their web; beyond it the nearest finger stands alone.
    let web = if digit > 0 && next_digit > 0 {
        0.5 * smooth_step(6.0 * scale, 0.0, next_over - over)
    } else {
        0.0
    };
    let share = web * before_web_end(bind, digit, p).min(before_web_end(bind, next_digit, p));
    let digit_share = (1.0 - share) * root_share(bind, digit, over, scale, p);
    let next_share = share * root_share(bind, next_digit, next_over, scale, p);
    for weight in &mut weights {
        *weight *= 1.0 - digit_share - next_share;
    }
    add_digit(&mut weights, bind, digit, digit_share, p);
    add_digit(&mut weights, bind, next_digit, next_share, p);
    weights
}

/// 1 up to a third of a digit's first phalanx, where its webs are, 0 beyond its middle.
fn before_web_end(bind: &HandJoints, digit: usize, p: Vec3) -> f32 {
    let [first, second] = [0, 1].map(|i| bind.joints[bent_joints(digit)[i]].pose.position);
    smooth_step(
        0.56,
        0.36,
        past_joint(bind, bent_joints(digit)[0], p) / first.distance(second),
    )
}

/// To what share a point belongs to a digit rather than to the palm: a blend across the digit's root. Skin far from the
/// phalanges, as in the web of the thumb, stays with the palm.
fn root_share(bind: &HandJoints, digit: usize, over: f32, scale: f32, p: Vec3) -> f32 {
    let close = smooth_step(14.0 * scale, 3.0 * scale, over);
    close * blend(bind, bent_joints(digit)[0], [-0.9, 1.1], p)
}

/// Spreads the `share` of a digit over its joints.
fn add_digit(weights: &mut [f32; JOINT_COUNT], bind: &HandJoints, digit: usize, mut share: f32, p: Vec3) {
    let joints = bent_joints(digit);
    for (i, &joint) in joints.iter().enumerate() {
        let onward = match joints.get(i + 1) {
            Some(&next) => blend(bind, next, [-0.8, 0.8], p),
            None => 0.0,
        };
        weights[joint] += share * (1.0 - onward);
        share *= onward;
    }
}

/// The signed distance past a bending joint in metres, along the mean of the bones before and after it.
fn past_joint(bind: &HandJoints, joint: usize, p: Vec3) -> f32 {
    let at = |joint: usize| bind.joints[joint].pose.position;
    let along =
        (at(joint) - at(joint - 1)).normalize_or_zero() + (at(joint + 1) - at(joint)).normalize_or_zero();
    (p - at(joint)).dot(along.normalize_or(Vec3::Y))
}

/// The blend across a joint, 0 before and 1 after it; its ends in radii of the joint.
fn blend(bind: &HandJoints, joint: usize, ends: [f32; 2], p: Vec3) -> f32 {
    let [from, to] = ends.map(|end| end * bind.joints[joint].radius);
    smooth_step(from, to, past_joint(bind, joint, p))
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
