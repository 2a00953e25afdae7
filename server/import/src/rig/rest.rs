//! A rig from the joints of a hand at rest: bones and widths are the hand's own, axes and limits those of a reference hand
//! that is placed on its knuckles.

use glam::{Mat3, Quat, Vec3};
use grasp_synthesis::{
    base::pose::Pose,
    geometry::Segment,
    model::hand::{
        Digit, DigitAngles, Handedness,
        joints::{JOINT_COUNT, JOINT_NAMES, index},
        kinematics::digit_frames,
        rig::{DigitLimits, DigitRig, Rig},
    },
};

use super::{
    RigSource,
    hand_nodes::{hand_name, joint_name, joints_of},
    radii::Widths,
};
use crate::error::Violations;

/// Smallest and largest length of a bone, in metres: from a doll's to a giant's.
const BONE_RANGE: [f32; 2] = [0.002, 0.25];

/// Least shares of the palm's breadth that the thumb's first two joints are on the index finger's side; hands have 0.4 and 0.8.
const THUMB_BESIDE: [f32; 2] = [-0.1, 0.2];

/// Diameter of the thumb's first link relative to its second joint's, as in the built-in rigs.
const THUMB_BASE: f32 = 1.24 / 1.1;

/// Mean bend of the fingers, in radians, beyond which they are bent backward.
const BENT_BACK: f32 = -0.15;

/// The parts of a hand's skeleton in its wrist's frame.
#[derive(Clone, Debug)]
pub(super) struct Skeleton {
    /// The wrist's frame: +y along the fingers, +z out of the palm.
    pub(super) frame_from_wrist: Pose,
    /// Size relative to the reference: of the distance from the wrist to the knuckles.
    pub(super) size: f32,
    /// Breadth of the knuckles relative to the reference.
    pub(super) breadth: f32,
    /// The joints in the wrist's frame, without the palm; tips are where the file has them or as long as the reference's. All
    /// of a missing finger's but the metacarpal are at the knuckle that it would have.
    pub(super) joints: [Vec3; JOINT_COUNT],
    /// Which digits the hand has, thumb first.
    pub(super) has: [bool; 5],
}

/// Two fingers, counted from the index finger, and a share of the way from the first to the second.
struct Neighbours {
    before: usize,
    after: usize,
    share: f32,
}

/// The fingers between which one is or would be: the neighbours of a missing one or, where it has only one, that one.
fn neighbours(has: [bool; 4], finger: usize) -> Option<Neighbours> {
    let before = (0..=finger).rev().find(|&other| has[other]);
    let after = (finger..4).find(|&other| has[other]);
    let (before, after) = (before.or(after)?, after.or(before)?);
    let share = if before == after {
        0.0
    } else {
        (finger - before) as f32 / (after - before) as f32
    };
    Some(Neighbours { before, after, share })
}

/// Bones' ends as `OpenXR` indices.
fn bones() -> impl Iterator<Item = (usize, usize)> {
    (0..5).map(base_of).flat_map(|base| {
        let links = (base..base + 3).map(|joint| (joint, joint + 1));
        std::iter::once((index::WRIST, base)).chain(links)
    })
}

/// The first of the three links of a digit, as an `OpenXR` index.
pub(super) fn base_of(digit: usize) -> usize {
    index::TIP_OF_DIGIT[digit] - 3
}

/// The palm of a right hand.
struct PalmFrame {
    /// Across the knuckles, from the wrist to them, and out of the palm.
    axes: Mat3,
    /// The distance to the knuckles.
    length: f32,
    /// That of the outer knuckles.
    breadth: f32,
}

impl PalmFrame {
    fn new(wrist: Vec3, knuckles: [Vec3; 4]) -> Self {
        let middle = knuckles.iter().sum::<Vec3>() / 4.0;
        let y = (middle - wrist).normalize_or_zero();
        let across = knuckles[0] - knuckles[3];
        let x = across.reject_from(y.normalize_or(Vec3::Y)).normalize_or_zero();
        Self {
            axes: Mat3::from_cols(x, y, x.cross(y)),
            length: middle.distance(wrist),
            breadth: across.length(),
        }
    }
}

impl Skeleton {
    /// Places the wrist's frame and completes the joints; adds a violation for every joint that cannot be that of a hand.
    /// `positions` are the joints at rest by `OpenXR` index, as of a right hand in any frame, in metres; tips, the fingers'
    /// metacarpals, the palm and all joints of missing fingers may be absent. `side` is for messages.
    pub(super) fn new(
        side: Handedness,
        positions: &[Option<Vec3>; JOINT_COUNT],
        reference: &Rig,
        violations: &mut Violations,
    ) -> Option<Self> {
        let before = violations.len();
        for (joint, position) in positions.iter().enumerate() {
            if position.is_some_and(|position| !position.is_finite()) {
                violations.add(joint_name(side, joint), "is not at a finite place");
            }
        }
        let at = |joint: usize| positions[joint].filter(|position| position.is_finite());
        for (start, end) in bones() {
            // The thumb's metacarpal may start at the wrist.
            let may_coincide = (start, end) == (index::WRIST, base_of(0));
            if let (Some(from), Some(to)) = (at(start), at(end)) {
                let length = from.distance(to);
                let [least, most] = BONE_RANGE;
                if length > most || length < least && !may_coincide {
                    let what = format!(
                        "is {length:.4} m from {}; a bone of a hand must be {least} to {most} m long, after units and the armature's \
                         scale",
                        JOINT_NAMES[start]
                    );
                    violations.add(joint_name(side, end), what);
                }
            }
        }
        if violations.len() > before {
            return None;
        }
        let wrist = at(index::WRIST)?;
        let has: [bool; 5] = std::array::from_fn(|digit| at(base_of(digit)).is_some());
        let [_, fingers @ ..] = has;
        let knuckle = |finger: usize| {
            let Neighbours { before, after, share } = neighbours(fingers, finger)?;
            Some(at(base_of(before + 1))?.lerp(at(base_of(after + 1))?, share))
        };
        let knuckles = [knuckle(0)?, knuckle(1)?, knuckle(2)?, knuckle(3)?];
        let palm = PalmFrame::new(wrist, knuckles);
        let knuckle = |finger: usize| reference.digits[finger + 1].wrist_from_base.position;
        let of_reference = PalmFrame::new(Vec3::ZERO, [0, 1, 2, 3].map(knuckle));
        if palm.axes.determinant() < 0.5 || palm.breadth < BONE_RANGE[0] {
            let what = "has its knuckles in line with the wrist, so that the palm has no breadth";
            violations.add(hand_name(side), what);
            return None;
        }
        let frame_from_wrist = Pose::new(
            wrist,
            Quat::from_mat3(&(palm.axes * of_reference.axes.transpose())).normalize(),
        );
        let size = palm.length / of_reference.length;
        let wrist_from_frame = frame_from_wrist.inverse();
        let mut joints = [Vec3::ZERO; JOINT_COUNT];
        for (joint, position) in joints.iter_mut().enumerate() {
            if let Some(at) = at(joint) {
                *position = wrist_from_frame.transform_point(at);
            }
        }
        for digit in (0..5).filter(|&digit| has[digit]) {
            let (tip, chain) = (index::TIP_OF_DIGIT[digit], &reference.digits[digit]);
            if at(tip).is_none() {
                let last = joints[tip - 1] - joints[tip - 2];
                let length = last.length() * chain.lengths[2] / chain.lengths[1];
                joints[tip] = joints[tip - 1] + length * last.normalize_or(Vec3::Y);
            }
            let first = index::FIRST_OF_DIGIT[digit];
            if digit > 0 && at(first).is_none() {
                // The same share of the way to the knuckle, and the same distance from the line, as in the reference.
                let start = reference.finger_metacarpals[digit - 1];
                let reference_knuckle = chain.wrist_from_base.position;
                let share = start.dot(reference_knuckle) / reference_knuckle.length_squared();
                joints[first] = share * joints[first + 1] + size * (start - share * reference_knuckle);
            }
        }
        for finger in (0..4).filter(|&finger| !fingers[finger]) {
            let Neighbours { before, after, share } = neighbours(fingers, finger)?;
            let between = |before: usize, after: usize| joints[before].lerp(joints[after], share);
            let knuckle = between(base_of(before + 1), base_of(after + 1));
            let first = |finger: usize| index::FIRST_OF_DIGIT[finger + 1];
            let metacarpal = between(first(before), first(after));
            joints[joints_of(finger + 1)].fill(knuckle);
            joints[first(finger)] = metacarpal;
        }
        let skeleton = Self {
            frame_from_wrist,
            size,
            breadth: palm.breadth / of_reference.breadth,
            joints,
            has,
        };
        skeleton.check_shape(side, violations);
        (violations.len() == before).then_some(skeleton)
    }

    /// Adds a violation if the thumb is not beside the fingers, or if all digits bend backward.
    fn check_shape(&self, side: Handedness, violations: &mut Violations) {
        let joint = |joint: usize| self.joints[joint];
        let (index_knuckle, little_knuckle) = (joint(base_of(1)), joint(base_of(4)));
        let across = index_knuckle - little_knuckle;
        let thumb = base_of(0) + 1;
        let middle = index_knuckle.midpoint(little_knuckle);
        let beside = |joint: Vec3| (joint - middle).dot(across) / across.length_squared();
        if beside(joint(thumb - 1)) < THUMB_BESIDE[0] || beside(joint(thumb)) < THUMB_BESIDE[1] {
            violations.add(
                joint_name(side, thumb),
                "is among the fingers or on the little finger's side of the palm; the thumb must be on the index finger's \
                 side (are the fingers' names in order?)",
            );
            return;
        }
        let bend = |digit: usize| {
            let base = base_of(digit);
            let links =
                [0, 1, 2].map(|link| (joint(base + link + 1) - joint(base + link)).normalize_or(Vec3::Y));
            let rise = |direction: Vec3| direction.z.atan2(direction.y.max(1e-3));
            rise(links[2]) - rise(links[0])
        };
        let fingers = (1..5).filter(|&digit| self.has[digit]);
        let mean = fingers.clone().map(bend).sum::<f32>() / fingers.count().max(1) as f32;
        if mean < BENT_BACK && joint(thumb + 1).z < 0.0 {
            violations.add(
                hand_name(side),
                "has fingers that bend backward and a thumb behind the palm, as the other hand would: left and right are \
                 swapped",
            );
        }
    }

    /// The joints, with tips where the skin ends.
    pub(super) fn joints_with_tips(&self, widths: &Widths) -> [Vec3; JOINT_COUNT] {
        let mut joints = self.joints;
        for (tip, end) in index::TIP_OF_DIGIT.into_iter().zip(widths.tips) {
            joints[tip] = end.unwrap_or(joints[tip]);
        }
        joints
    }

    /// The rig with the reference's axes and limits.
    pub(super) fn rig(&self, widths: &Widths, source: &RigSource<'_>) -> Rig {
        let reference = source.reference;
        let radii = self.radii(widths);
        let joints = self.joints_with_tips(widths);
        let digits = std::array::from_fn(|digit| {
            let base = base_of(digit);
            let chain = &reference.digits[digit];
            let length = |link: usize| joints[base + link].distance(joints[base + link + 1]);
            let limits = source.limits[digit];
            let direction = (joints[base + 1] - joints[base]).normalize_or(Vec3::Y);
            let orientation = if digit == Digit::Thumb.index() {
                chain.wrist_from_base.orientation
            } else {
                within_reach(chain, &limits, direction)
            };
            DigitRig {
                wrist_from_base: Pose::new(joints[base], orientation),
                yaw_sign: chain.yaw_sign,
                lengths: std::array::from_fn(length),
                diameters: link_diameters(digit, [0, 1, 2].map(|link| 2.0 * radii[base + link])),
                limits,
            }
        });
        let finger_metacarpals = std::array::from_fn(|finger| joints[index::FIRST_OF_DIGIT[finger + 1]]);
        let middle_knuckle = joints[base_of(2)];
        let along = (middle_knuckle - finger_metacarpals[1]).normalize_or(Vec3::Y);
        let palmar = Quat::from_rotation_arc(Vec3::Y, along) * Vec3::Z;
        let palm_radius = radii[index::PALM];
        let scale = Vec3::new(
            self.breadth,
            self.size,
            palm_radius / reference.joint_radii[index::PALM],
        );
        let mut rig = Rig {
            name: source.name.to_owned(),
            handedness: Handedness::Right,
            palm: finger_metacarpals[1].midpoint(middle_knuckle) + palm_radius * palmar,
            reach: 0.0,
            digits,
            finger_metacarpals,
            palm_segments: reference
                .palm_segments
                .map(|segment| Segment::new(scale * segment.start, scale * segment.end)),
            joint_radii: radii,
            rest_overlaps: None,
            palm_flesh: None,
        };
        let length = |digit: Digit| {
            let stretched = digit_frames(rig.digit(digit), Pose::IDENTITY, DigitAngles::default());
            stretched.tip.length()
        };
        rig.reach = if rig.has(Digit::Middle) {
            length(Digit::Middle)
        } else {
            rig.fingers().map(length).fold(0.0, f32::max)
        };
        rig
    }

    /// The radii of the joints; of a missing finger, those of knuckle and metacarpal are its neighbours', and the others 0.
    fn radii(&self, widths: &Widths) -> [f32; JOINT_COUNT] {
        let mut radii = widths.radii;
        let [_, fingers @ ..] = self.has;
        for finger in (0..4).filter(|&finger| !fingers[finger]) {
            let Some(Neighbours { before, after, share }) = neighbours(fingers, finger) else {
                continue;
            };
            radii[joints_of(finger + 1)].fill(0.0);
            for of_finger in [|digit: usize| index::FIRST_OF_DIGIT[digit], base_of] {
                let [before, after] = [before, after].map(|finger| widths.radii[of_finger(finger + 1)]);
                radii[of_finger(finger + 1)] = before + share * (after - before);
            }
        }
        radii
    }
}

/// The orientation of a finger's base: the reference's, turned until the bone at rest is within its sideways limits.
fn within_reach(chain: &DigitRig, limits: &DigitLimits, direction: Vec3) -> Quat {
    let orientation = chain.wrist_from_base.orientation;
    let yaw = yaw_of(chain, direction);
    let beyond = yaw - yaw.clamp(limits.base_yaw.min, limits.base_yaw.max);
    orientation * Quat::from_rotation_z(chain.yaw_sign * beyond)
}

/// The yaw by which a digit's first link points in a direction of the wrist's frame, in radians.
pub(super) fn yaw_of(chain: &DigitRig, direction: Vec3) -> f32 {
    let local = chain.wrist_from_base.orientation.inverse() * direction;
    chain.yaw_sign * (-local.x).atan2(local.y)
}

/// Diameters of a digit's links from those of its joints: at the first phalanx that of its far joint, then the mean of both
/// joints, then a little less than the last joint; of the thumb, whose first joint is in the palm, one joint farther.
fn link_diameters(digit: usize, [_, second, third]: [f32; 3]) -> [f32; 3] {
    if digit == Digit::Thumb.index() {
        [THUMB_BASE * second, 0.5 * (second + third), 0.92 * third]
    } else {
        [second, 0.5 * (second + third), 0.95 * third]
    }
}
