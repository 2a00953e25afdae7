//! How hands and arms look: the giver is fair and wears blue, the receiver is brown and wears green.

use glam::{Quat, Vec2, Vec3};
use grasp_synthesis::{
    base::pose::Pose,
    geometry::tapered_capsule::TaperedCapsule,
    model::hand::joints::{HandJoints, Skin, index},
};

use crate::{
    hands::PosedHand,
    parts::{Finish, Part, capsule, lathe, linear_from_srgb, smoothstep},
};

/// Length of the sleeve of an unknown arm, in metres; long enough to leave the picture.
const LENGTH: f32 = 0.17;

/// Distance of the cuff's edge from the wrist joint, away from the hand, in metres.
const CUFF_START: f32 = 0.006;

/// Gap between wrist and cuff, in metres.
const CLEARANCE: f32 = 0.003;

/// Width of the cuff along the arm, and its thickness over the sleeve, in metres.
const CUFF_WIDTH: f32 = 0.020;
const CUFF_THICKNESS: f32 = 0.0022;

/// Widths of the sleeve relative to the cuff's: at the end of an unknown arm's sleeve, at the elbow and at the shoulder.
const WIDENING: f32 = 1.28;
const ELBOW_WIDENING: f32 = 1.4;
const SHOULDER_WIDENING: f32 = 1.7;

/// Skin within this distance of the joint along the arm belongs to the wrist, in metres.
const WRIST_BAND: f32 = 0.012;

/// Skin farther from the joint than this belongs to a curled finger, not to the wrist, in metres.
const MAX_WRIST_DISTANCE: f32 = 0.055;

/// Whose hand it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Person {
    /// Holds the object out: fair, blue sleeves.
    Giver,
    /// Takes it: brown, green sleeves.
    Receiver,
}

/// The joints of a receiver's arm, in the client's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ArmJoints {
    /// The shoulder joint, in metres.
    pub(crate) shoulder: Vec3,
    /// The elbow, in metres.
    pub(crate) elbow: Vec3,
}

impl Person {
    /// Linear RGB of the back of the hand, of the palm and the pads, and of knuckles and fingertips.
    fn complexion(self) -> [Vec3; 3] {
        let colours = match self {
            Self::Giver => [[224, 178, 152], [230, 180, 158], [214, 146, 124]],
            Self::Receiver => [[138, 92, 68], [186, 136, 108], [122, 74, 54]],
        };
        colours.map(|[red, green, blue]| linear_from_srgb(red, green, blue))
    }

    fn sleeve_colour(self) -> Vec3 {
        match self {
            Self::Giver => linear_from_srgb(70, 100, 146),
            Self::Receiver => linear_from_srgb(92, 134, 100),
        }
    }

    /// The skin of a hand whose vertices are at `posed`.
    pub(crate) fn hand(self, name: &str, skin: &Skin, posed: Vec<Vec3>) -> Part {
        let complexion = self.complexion();
        let of_bind = smooth_skin(String::new(), skin.positions.clone(), skin);
        let mut colours = vec![complexion[0]; posed.len()];
        for (triangle, normals) in skin.triangles.iter().zip(of_bind.corner_normals()) {
            for (&vertex, normal) in triangle.iter().zip(normals) {
                colours[vertex as usize] = colour_at(skin, vertex as usize, normal, &complexion);
            }
        }
        Part {
            colour: complexion[0],
            vertex_colours: colours,
            ..smooth_skin(name.to_owned(), posed, skin)
        }
    }

    /// A sleeve along the forearm of a hand whose skin is at `posed`, with a cuff at the wrist.
    pub(crate) fn sleeve(self, name: &str, joints: &HandJoints, posed: &[Vec3]) -> Part {
        let frame = joints.joints[index::WRIST].pose;
        let section = WristSection::of(joints, posed);
        self.forearm(name, frame, &section, LENGTH, WIDENING)
    }

    /// The sleeves of an arm: of its forearm, from the wrist of a hand whose skin is at `posed`, and of its upper arm.
    pub(crate) fn arm_sleeves(
        self,
        who: &str,
        arm: &ArmJoints,
        joints: &HandJoints,
        posed: &[Vec3],
    ) -> [Part; 2] {
        let wrist = joints.joints[index::WRIST].pose;
        let frame = Pose {
            orientation: arm.bend(wrist) * wrist.orientation,
            ..wrist
        };
        let section = WristSection::of(joints, posed);
        let length = arm.elbow.distance(wrist.position);
        let [elbow, shoulder] =
            [ELBOW_WIDENING, SHOULDER_WIDENING].map(|widening| widening * section.sleeve_radius());
        let upper_arm = TaperedCapsule::new(arm.elbow, arm.shoulder, elbow, shoulder);
        [
            self.forearm(&format!("{who}_forearm"), frame, &section, length, ELBOW_WIDENING),
            capsule(&format!("{who}_upper_arm"), &upper_arm, self.sleeve_colour()).with_finish(Finish::Cloth),
        ]
    }

    /// A sleeve along +Z of a frame at the wrist, round at its end.
    fn forearm(self, name: &str, frame: Pose, section: &WristSection, length: f32, widening: f32) -> Part {
        let mean = section.sleeve_radius();
        let cuff = mean + CUFF_THICKNESS;
        let inner = mean - CLEARANCE * 0.5;
        let end = mean * widening;
        // From inside the cuff around its hem, over the cuff's border, down to the end.
        let profile = [
            Vec2::new(0.0, CUFF_START + 0.010),
            Vec2::new(inner, CUFF_START + 0.010),
            Vec2::new(inner, CUFF_START + 0.001),
            Vec2::new(mean, CUFF_START),
            Vec2::new(cuff, CUFF_START + 0.001),
            Vec2::new(cuff * 1.01, CUFF_START + CUFF_WIDTH),
            Vec2::new(mean * 1.015, CUFF_START + CUFF_WIDTH + 0.0012),
            Vec2::new(end, length),
            Vec2::new(end - 0.0015, length + 0.003),
            Vec2::new(end - 0.005, length + 0.004),
            Vec2::new(0.0, length + 0.004),
        ];
        let mut part = lathe(name, Vec3::ZERO, Vec3::Z, &profile, self.sleeve_colour());
        for position in &mut part.positions {
            let to_wrist = 1.0 - (position.z / length).clamp(0.0, 1.0);
            let stretch = Vec2::ONE.lerp(section.outer / mean, to_wrist);
            let across = position.truncate() * stretch + section.centre * to_wrist;
            *position = frame.transform_point(across.extend(position.z));
        }
        part.with_finish(Finish::Cloth)
    }
}

impl PosedHand {
    /// The hand, and its arm or else a sleeve.
    pub(crate) fn parts(&self, who: &str, person: Person, arm: Option<&ArmJoints>) -> Vec<Part> {
        let mut posed = self.skin.posed(&self.joints);
        let mut sleeves = Vec::new();
        if let Some(arm) = arm {
            sleeves.extend(person.arm_sleeves(who, arm, &self.joints, &posed));
            arm.bend_skin(&self.joints, &mut posed);
        } else {
            sleeves.push(person.sleeve(&format!("{who}_sleeve"), &self.joints, &posed));
        }
        let mut parts = vec![person.hand(&format!("{who}_hand"), self.skin, posed)];
        parts.extend(sleeves);
        parts
    }
}

impl ArmJoints {
    /// Bends the skin behind the wrist of a hand to the forearm.
    pub(crate) fn bend_skin(&self, joints: &HandJoints, posed: &mut [Vec3]) {
        let wrist = joints.joints[index::WRIST].pose;
        let (wrist_from_world, bend) = (wrist.inverse(), self.bend(wrist));
        for position in posed {
            let behind = wrist_from_world.transform_point(*position).z;
            let share = smoothstep(-WRIST_BAND, WRIST_BAND, behind);
            if share > 0.0 {
                let bend = Quat::IDENTITY.slerp(bend, share);
                *position = wrist.position + bend * (*position - wrist.position);
            }
        }
    }

    /// The rotation at the wrist from the hand's own forearm to this one.
    fn bend(&self, wrist: Pose) -> Quat {
        let own = wrist.transform_vector(Vec3::Z);
        Quat::from_rotation_arc(own, (self.elbow - wrist.position).normalize_or(own))
    }
}

fn smooth_skin(name: String, positions: Vec<Vec3>, skin: &Skin) -> Part {
    Part {
        is_smooth: true,
        finish: Finish::Skin,
        ..Part::new(name, positions, skin.triangles.clone(), Vec3::ONE)
    }
}

/// The skin's colour at a vertex of the bind pose.
fn colour_at(skin: &Skin, vertex: usize, normal: Vec3, [back, palm, flush]: &[Vec3; 3]) -> Vec3 {
    let mut palmar = 0.0;
    for (&joint, &weight) in skin.joint_indices[vertex].iter().zip(&skin.weights[vertex]) {
        let pose = skin.bind.joints[usize::from(joint)].pose;
        // +Y points out of the back of the hand.
        palmar -= weight * normal.dot(pose.transform_vector(Vec3::Y));
    }
    let mut flushed = 0.0_f32;
    for digit in 0..5 {
        let tip = index::TIP_OF_DIGIT[digit];
        // The joints that bend: from the base of the first phalanx to that of the last.
        for joint in index::FIRST_OF_DIGIT[digit] + 1..=tip {
            let at = skin.bind.joints[joint];
            let distance = skin.positions[vertex].distance(at.pose.position);
            let near = 1.0 - smoothstep(0.5, 1.45, distance / at.radius.max(1e-3));
            let share = if joint == tip {
                0.45
            } else {
                0.55 * smoothstep(0.1, 0.8, -palmar)
            };
            flushed = flushed.max(near * share);
        }
    }
    back.lerp(*palm, smoothstep(-0.15, 0.55, palmar))
        .lerp(*flush, flushed)
}

/// The wrist's cross-section in the wrist joint's x and y, in metres.
struct WristSection {
    centre: Vec2,
    /// Half widths of a sleeve around it.
    outer: Vec2,
}

impl WristSection {
    fn of(joints: &HandJoints, posed: &[Vec3]) -> Self {
        let joint_from_world = joints.joints[index::WRIST].pose.inverse();
        let mut low = Vec2::INFINITY;
        let mut high = Vec2::NEG_INFINITY;
        for &position in posed {
            let local = joint_from_world.transform_point(position);
            if local.z.abs() < WRIST_BAND && local.truncate().length() < MAX_WRIST_DISTANCE {
                low = low.min(local.truncate());
                high = high.max(local.truncate());
            }
        }
        Self {
            centre: (high + low) * 0.5,
            outer: (high - low) * 0.5 + CLEARANCE,
        }
    }

    fn sleeve_radius(&self) -> f32 {
        0.5 * self.outer.element_sum()
    }
}
