//! The rigs and skins of the hands: `thesis` and `adult`, right by construction and left by mirroring.

mod anatomy;
mod field;
mod glb;
mod polygonise;
mod remesh;
mod right_rig;
mod weights;

use glam::Vec3;
use grasp_synthesis::{
    base::pose::Pose,
    geometry::Segment,
    model::hand::{
        DigitAngles, HandPose, Handedness,
        description::RigDescription,
        joints::{HandJoints, index},
        kinematics,
        rig::Rig,
        skin::Skin,
    },
};

use self::{field::HandField, right_rig::RigKind};
use crate::AssetFile;

/// Width of the grid on which the surface is first found, in millimetres of the figures. Finer grids find smaller
/// gaps (two neighbouring fingers must be at least two cells apart) and take longer with the third power.
const GRID_MM: f32 = 1.7;

/// Edge lengths of the finished skin in millimetres of the figures: on the digits, on the palm, on the forearm.
const EDGE_MM: [f32; 3] = [3.7, 6.0, 6.5];

/// How deep the palm's collision segments lie under the skin in millimetres (thesis 4.5: "about half a centimetre").
const COLLISION_DEPTH_MM: f32 = 5.0;

/// The files of all hands.
pub(crate) fn generate() -> Vec<AssetFile> {
    let mut files = Vec::new();
    for kind in RigKind::ALL {
        let (right, skin) = right_hand(kind);
        for (rig, skin) in [(right.mirrored(), mirrored(&skin)), (right, skin)] {
            let side = match rig.handedness {
                Handedness::Left => "left",
                Handedness::Right => "right",
            };
            let name = format!("{}_{side}", rig.name);
            let mut description = serde_json::to_vec_pretty(&RigDescription::of_rig(&rig))
                .expect("a rig consists of strings and finite numbers");
            description.push(b'\n');
            files.push((format!("hands/{name}.json"), description));
            files.push((format!("hands/{name}.glb"), glb::hand_glb(&name, &skin)));
        }
    }
    files
}

/// The pose in which the skin is made: relaxed and a little spread, so that neighbouring fingers stand apart and no
/// joint is ever bent further from it than it must be.
fn bind_angles() -> [DigitAngles; 5] {
    let degrees = |yaw: f32, pitches: [f32; 3]| DigitAngles {
        base_yaw: yaw.to_radians(),
        base_pitch: pitches[0].to_radians(),
        second_pitch: pitches[1].to_radians(),
        third_pitch: pitches[2].to_radians(),
    };
    [
        degrees(25.0, [0.0, 8.0, 10.0]),
        degrees(-6.0, [15.0, 22.0, 12.0]),
        degrees(0.0, [15.0, 22.0, 12.0]),
        degrees(5.0, [15.0, 22.0, 12.0]),
        degrees(9.0, [15.0, 22.0, 12.0]),
    ]
}

/// The rig with its palm segments, and its skin.
fn right_hand(kind: RigKind) -> (Rig, Skin) {
    let mut rig = right_rig::right_rig(kind);
    let mm = kind.metres_per_mm();
    let angles = bind_angles();
    let field = HandField::new(&rig, &angles, mm);
    rig.palm_segments = palm_segments(&rig, &field, mm);
    let pose = HandPose {
        frame_from_wrist: Pose::IDENTITY,
        digits: angles,
    };
    let bind = HandJoints::of_pose(&rig, &pose);

    // Room for every digit and two centimetres of flesh around it.
    let frames = kinematics::hand_frames(&rig, &pose);
    let (mut low, mut high) = (
        Vec3::new(-50.0, -45.0, -30.0) * mm,
        Vec3::new(50.0, 0.0, 40.0) * mm,
    );
    for digit in frames.digits {
        for point in digit
            .links
            .map(|link| link.position)
            .into_iter()
            .chain([digit.tip])
        {
            low = low.min(point - 20.0 * mm);
            high = high.max(point + 20.0 * mm);
        }
    }
    let fine = polygonise::polygonise(|p| field.value(p), low, high, GRID_MM * mm);
    let mesh = remesh::remesh(&fine, &field, |p| mm * edge_mm(&bind, p, mm));
    for joint in index::FIRST_OF_DIGIT.into_iter().chain([index::WRIST]) {
        rig.joint_radii[joint] = nearest(&mesh.positions, bind.joints[joint].pose.position);
    }
    let bind = HandJoints::of_pose(&rig, &pose);
    let (joint_indices, weights) = weights::skin_weights(&rig, &bind, &mesh.positions)
        .into_iter()
        .unzip();
    let skin = Skin {
        positions: mesh.positions,
        triangles: mesh.triangles,
        joint_indices,
        weights,
        bind,
    };
    (rig, skin)
}

/// Distance from a joint inside the hand to the skin in metres, in tenths of a millimetre.
fn nearest(skin: &[Vec3], joint: Vec3) -> f32 {
    let distance = skin
        .iter()
        .map(|p| p.distance(joint))
        .fold(f32::INFINITY, f32::min);
    (1e4 * distance).round() / 1e4
}

/// The target edge length at a point: short on the digits, longer on the palm, longest on the forearm.
fn edge_mm(bind: &HandJoints, p: Vec3, mm: f32) -> f32 {
    let digits = (0..5)
        .map(|digit| weights::distance_over_skin(bind, digit, p))
        .fold(f32::INFINITY, f32::min);
    let away = (digits / (20.0 * mm)).clamp(0.0, 1.0);
    let behind = (-p.y / (40.0 * mm)).clamp(0.0, 1.0);
    EDGE_MM[0] + away * (EDGE_MM[1] - EDGE_MM[0]) + behind * (EDGE_MM[2] - EDGE_MM[1])
}

/// The ten segments of Figure 4.4: five lines from carpus to knuckles (ball of the thumb, four metacarpals), each
/// once under the palm's skin and once under that of the back.
fn palm_segments(rig: &Rig, field: &HandField, mm: f32) -> [Segment; 10] {
    let knuckle = |digit: usize| rig.digits[digit].wrist_from_base.position;
    let thumb_base = knuckle(0);
    let mut lines = [(Vec3::ZERO, Vec3::ZERO); 5];
    lines[0] = (
        thumb_base - Vec3::new(4.0, 2.0, 3.0) * mm,
        thumb_base.lerp(knuckle(1), 0.5) + Vec3::new(5.0, 0.0, 4.0) * mm,
    );
    for finger in 0..4 {
        let start = rig.finger_metacarpals[finger];
        let end = knuckle(finger + 1);
        // From the carpus' near row, 20 mm behind the metacarpals.
        lines[finger + 1] = (start - (end - start).normalize_or(Vec3::Y) * 20.0 * mm, end);
    }
    let depth = COLLISION_DEPTH_MM * mm;
    std::array::from_fn(|i| {
        let direction = if i < 5 { Vec3::Z } else { Vec3::NEG_Z };
        let over = |point: Vec3| field.distance_to_skin(point, direction) - depth;
        let (mut start, end) = lines[i % 5];
        if i == 1 {
            // The ball of the thumb covers the palmar side of the index finger's metacarpal up to here.
            start = rig.finger_metacarpals[0].lerp(end, 0.45);
        }
        let (start, end) = (start + direction * over(start), end + direction * over(end));
        // A straight line under a round skin lies too deep in the middle: half of that error, up to 2 mm, is taken off
        // its whole length.
        let lift = (0.5 * over(start.midpoint(end))).clamp(0.0, 2.0 * mm);
        Segment::new(start + direction * lift, end + direction * lift)
    })
}

/// The skin of the other hand: the mirror image in the plane x = 0, turned inside out so that it faces outward.
fn mirrored(skin: &Skin) -> Skin {
    let mut joints = skin.bind.clone();
    joints.handedness = joints.handedness.other();
    for joint in &mut joints.joints {
        joint.pose = joint.pose.mirrored_x();
    }
    Skin {
        positions: skin
            .positions
            .iter()
            .map(|p| *p * Vec3::new(-1.0, 1.0, 1.0))
            .collect(),
        triangles: skin.triangles.iter().map(|&[a, b, c]| [a, c, b]).collect(),
        joint_indices: skin.joint_indices.clone(),
        weights: skin.weights.clone(),
        bind: joints,
    }
}
