//! The solids of a hand and its forearm, as objects and as other hands meet them.

use std::fmt;

use glam::Vec3;

use super::{
    TaperedCapsule, TrackedPalm,
    flesh::{AROUND_METACARPALS, PALM_SOLIDS, Skeleton, THENAR_SOLIDS, palm_as_tracked},
};
use crate::{
    base::pose::Pose,
    model::hand::{
        Digit, HandPose, Phalanx,
        joints::{HandJoints, index, thesis_from_openxr_frame},
        kinematics::DigitPlane,
        rig::Rig,
    },
};

/// Solids of the forearm: two in parallel, because it is twice as wide as thick at the wrist.
pub(crate) const FOREARM_SOLIDS: usize = 2;

/// Modelled length of the forearm behind the wrist, in metres: up to the elbow of an adult.
pub(in crate::physical) const FOREARM_LENGTH: f32 = 0.25;

/// Half the thickness of the forearm at wrist and far end over the wrist's tracked radius (circumferences of ANSUR II).
const FOREARM_RADII: [f32; 2] = [0.95, 2.3];

/// Distance of the two solids from the forearm's axis at wrist and far end, in the same unit.
const FOREARM_SIDES: [f32; 2] = [0.65, 0.85];

/// The solids of a posed hand and its forearm, in the frame of the pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HandSolids {
    /// The three links of each digit, thumb first. The thumb's first link is its metacarpal. Links of a missing digit are a
    /// point within the palm, so they never decide.
    pub phalanges: [[TaperedCapsule; 3]; 5],
    /// The part of the palm that moves with the wrist.
    pub palm: [TaperedCapsule; PALM_SOLIDS],
    /// The ball of the thumb and the web to the index finger, which move with the thumb's metacarpal.
    pub thenar: [TaperedCapsule; THENAR_SOLIDS],
    /// The forearm, behind the wrist.
    pub forearm: [TaperedCapsule; FOREARM_SOLIDS],
}

impl HandSolids {
    /// Number of solids.
    pub(crate) const COUNT: usize = 15 + PALM_SOLIDS + THENAR_SOLIDS + FOREARM_SOLIDS;

    /// The solids of a posed rig, in some 600 ns.
    pub fn of_pose(rig: &Rig, pose: &HandPose) -> Self {
        let wrist = pose.frame_from_wrist;
        let plane = |digit: usize| DigitPlane::new(&rig.digits[digit], wrist, pose.digits[digit].base_yaw);
        let mut joints = [[Vec3::ZERO; 4]; 5];
        for (digit, joints) in joints.iter_mut().enumerate() {
            *joints = plane(digit).joints(&pose.digits[digit]);
        }
        let thumb_pad = plane(0).first_pad(pose.digits[0].base_pitch);
        let skeleton = Skeleton::of_rig(rig, wrist, &joints, thumb_pad);
        Self {
            phalanges: std::array::from_fn(|digit| {
                link_solids(joints[digit], link_radii(rig, Digit::ALL[digit]))
            }),
            palm: skeleton.palm(),
            thenar: skeleton.thenar(),
            forearm: forearm(wrist, rig.joint_radii[index::WRIST]),
        }
    }

    /// The solids of tracked joints, in their frame.
    pub fn of_joints(joints: &HandJoints) -> Self {
        let skeleton = Skeleton::of_joints(joints);
        let at = |joint: usize| joints.joints[joint].pose.position;
        let radius = |joint: usize| joints.joints[joint].radius;
        let mut phalanges = [[TaperedCapsule::default(); 3]; 5];
        for (digit, links) in phalanges.iter_mut().enumerate() {
            let [a, b, c, d] = joints_of_digit(digit);
            *links = link_solids(
                [at(a), at(b), at(c), at(d)],
                [radius(a), radius(b), radius(c), radius(d)],
            );
        }
        Self {
            phalanges,
            palm: skeleton.palm(),
            thenar: skeleton.thenar(),
            forearm: forearm(
                thesis_from_openxr_frame(joints.joints[index::WRIST].pose),
                radius(index::WRIST),
            ),
        }
    }

    /// The same hand, translated.
    #[must_use]
    pub fn moved(&self, offset: Vec3) -> Self {
        self.map(|point| point + offset)
    }

    /// The same hand in another frame, or under a rigid motion.
    #[must_use]
    pub fn transformed(&self, a_from_b: Pose) -> Self {
        self.map(|point| a_from_b.transform_point(point))
    }

    fn map(&self, place: impl Fn(Vec3) -> Vec3) -> Self {
        let mut placed = *self;
        let Self {
            phalanges,
            palm,
            thenar,
            forearm,
        } = &mut placed;
        let others = palm.iter_mut().chain(thenar).chain(forearm);
        // A loop, because mapped arrays are not inlined and the call costs more than its work.
        for solid in phalanges.as_flattened_mut().iter_mut().chain(others) {
            solid.start = place(solid.start);
            solid.end = place(solid.end);
        }
        placed
    }

    /// The solid at an index of [`HandSolids::iter`], without iterating.
    pub(crate) fn solid(&self, index: usize) -> &TaperedCapsule {
        let Self {
            phalanges,
            palm,
            thenar,
            forearm,
        } = self;
        let phalanges = phalanges.as_flattened();
        let mut index = index;
        for solids in [phalanges, palm, thenar] {
            match solids.get(index) {
                Some(solid) => return solid,
                None => index -= solids.len(),
            }
        }
        &forearm[index]
    }

    /// All solids: phalanges by digit, palm, ball of the thumb, forearm.
    pub fn iter(&self) -> impl Iterator<Item = &TaperedCapsule> + Clone {
        self.phalanges
            .as_flattened()
            .iter()
            .chain(&self.palm)
            .chain(&self.thenar)
            .chain(&self.forearm)
    }

    /// All solids with their parts, in the order of [`HandSolids::iter`].
    pub fn parts(&self) -> impl Iterator<Item = (SolidPart, &TaperedCapsule)> + Clone {
        (0..).map(part_at).zip(self.iter())
    }
}

/// The `OpenXR` joints at the ends of a digit's three links.
fn joints_of_digit(digit: usize) -> [usize; 4] {
    let tip = index::TIP_OF_DIGIT[digit];
    [tip - 3, tip - 2, tip - 1, tip]
}

/// Distances from bone to skin at the ends of a digit's three links, in metres.
pub(crate) fn link_radii(rig: &Rig, digit: Digit) -> [f32; 4] {
    joints_of_digit(digit.index()).map(|joint| rig.joint_radii[joint])
}

/// The links of a digit with joints and tip at `points` and distances `radii` from there to the skin. The tip lies on
/// the skin, so the last link's sphere ends there. Links of a missing digit are a point within the palm.
pub fn link_solids(points: [Vec3; 4], radii: [f32; 4]) -> [TaperedCapsule; 3] {
    if radii[3] <= 0.0 {
        return [TaperedCapsule::new(points[0], points[0], 0.0, 0.0); 3];
    }
    let link = |i: usize| TaperedCapsule::new(points[i], points[i + 1], radii[i], radii[i + 1]);
    let last = link(2);
    let direction = (last.end - last.start).normalize_or_zero();
    let inset = last.end_radius.min(last.length());
    let end = last.end - direction * inset;
    [link(0), link(1), TaperedCapsule { end, ..last }]
}

/// The forearm straight behind a wrist of `radius` metres.
fn forearm(frame_from_wrist: Pose, radius: f32) -> [TaperedCapsule; FOREARM_SOLIDS] {
    let [near, far] = FOREARM_SIDES.map(|side| side * radius);
    let [near_radius, far_radius] = FOREARM_RADII.map(|share| share * radius);
    [-1.0, 1.0].map(|side| {
        TaperedCapsule::new(
            frame_from_wrist.transform_point(Vec3::new(side * near, 0.0, 0.0)),
            frame_from_wrist.transform_point(Vec3::new(side * far, -FOREARM_LENGTH, 0.0)),
            near_radius,
            far_radius,
        )
    })
}

/// The middle of the forearm behind a wrist of `radius` metres, starting at the wrist's tracked sphere: it fills the
/// dip between the two parallel solids.
pub(super) fn middle_of_forearm(frame_from_wrist: Pose, radius: f32) -> TaperedCapsule {
    let end = frame_from_wrist.transform_point(Vec3::new(0.0, -FOREARM_LENGTH, 0.0));
    TaperedCapsule::new(frame_from_wrist.position, end, radius, FOREARM_RADII[1] * radius)
}

/// Solids of such a hand in addition to [`HandSolids`].
pub const TRACKED_SOLIDS: usize = AROUND_METACARPALS + 1;

/// A hand and forearm as solids for where two hands meet: nowhere thinner than skin fitted to a hand of its size, and
/// at most a millimetre thinner than its joints' radii, from which clients draw it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackedSolids {
    /// The hand as it is compared with an object.
    pub hand: HandSolids,
    /// Its palm, along the metacarpals at least as thick as tracked.
    pub palm: [TaperedCapsule; PALM_SOLIDS],
    /// The other tracked parts: across the knuckles, from the wrist to all metacarpal bases, and the middle of the
    /// forearm.
    pub tracked: [TaperedCapsule; TRACKED_SOLIDS],
}

impl TrackedSolids {
    /// Number of solids.
    pub(crate) const COUNT: usize = HandSolids::COUNT + TRACKED_SOLIDS;

    /// The solids of tracked joints, in their frame.
    pub fn of_joints(joints: &HandJoints) -> Self {
        let wrist = joints.joints[index::WRIST];
        let forearm = middle_of_forearm(thesis_from_openxr_frame(wrist.pose), wrist.radius);
        Self::new(
            &HandSolids::of_joints(joints),
            &TrackedPalm::of_joints(joints),
            forearm,
        )
    }

    /// The solids of a rig's hand with a given wrist pose, whose [`HandSolids`] are known.
    pub fn of_rig(rig: &Rig, frame_from_wrist: Pose, hand: &HandSolids) -> Self {
        let forearm = middle_of_forearm(frame_from_wrist, rig.joint_radii[index::WRIST]);
        Self::new(hand, &TrackedPalm::of_rig(rig, frame_from_wrist), forearm)
    }

    fn new(hand: &HandSolids, palm: &TrackedPalm, forearm: TaperedCapsule) -> Self {
        let mut tracked = [forearm; TRACKED_SOLIDS];
        tracked[..AROUND_METACARPALS].copy_from_slice(&palm.around_metacarpals());
        Self {
            hand: *hand,
            palm: palm_as_tracked(&hand.palm, palm),
            tracked,
        }
    }

    /// The same hand, translated.
    #[must_use]
    pub fn moved(&self, offset: Vec3) -> Self {
        let mut moved = Self {
            hand: self.hand.moved(offset),
            ..*self
        };
        for solid in moved.palm.iter_mut().chain(&mut moved.tracked) {
            solid.start += offset;
            solid.end += offset;
        }
        moved
    }

    /// All solids for comparing hands: those of [`HandSolids::iter`] in the same order, then the additional ones.
    pub fn iter(&self) -> impl Iterator<Item = &TaperedCapsule> + Clone {
        let HandSolids {
            phalanges,
            thenar,
            forearm,
            ..
        } = &self.hand;
        phalanges
            .as_flattened()
            .iter()
            .chain(&self.palm)
            .chain(thenar)
            .chain(forearm)
            .chain(&self.tracked)
    }

    /// All solids with their parts, in the order of [`TrackedSolids::iter`].
    pub fn parts(&self) -> impl Iterator<Item = (SolidPart, &TaperedCapsule)> + Clone {
        (0..).map(part_at).zip(self.iter())
    }

    /// The solids that move with the wrist only.
    pub fn still(&self) -> impl Iterator<Item = &TaperedCapsule> + Clone {
        self.palm.iter().chain(&self.hand.forearm).chain(&self.tracked)
    }

    /// All solids in the order of [`TrackedSolids::iter`].
    pub(crate) fn to_array(self) -> [TaperedCapsule; Self::COUNT] {
        let mut all = [self.tracked[0]; Self::COUNT];
        for (place, solid) in all.iter_mut().zip(self.iter()) {
            *place = *solid;
        }
        all
    }
}

/// A part of a hand and its forearm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SolidPart {
    /// A link of a digit.
    Phalanx(Digit, Phalanx),
    /// The part of the palm that moves with the wrist.
    Palm,
    /// The ball of the thumb and the web to the index finger.
    ThumbBall,
    /// The forearm.
    Forearm,
}

impl SolidPart {
    /// The digit; `None` for palm, ball of the thumb and forearm.
    pub const fn digit(self) -> Option<Digit> {
        match self {
            Self::Phalanx(digit, _) => Some(digit),
            Self::Palm | Self::ThumbBall | Self::Forearm => None,
        }
    }
}

impl fmt::Display for SolidPart {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Phalanx(Digit::Thumb, _) => "thumb",
            Self::Phalanx(Digit::Index, _) => "index finger",
            Self::Phalanx(Digit::Middle, _) => "middle finger",
            Self::Phalanx(Digit::Ring, _) => "ring finger",
            Self::Phalanx(Digit::Little, _) => "little finger",
            Self::Palm => "palm",
            Self::ThumbBall => "ball of the thumb",
            Self::Forearm => "forearm",
        })
    }
}

/// The part of the solid at an index of [`HandSolids::iter`] or [`TrackedSolids::iter`].
fn part_at(index: usize) -> SolidPart {
    /// The last solid is the middle of the forearm.
    const TRACKED_PALM: usize = HandSolids::COUNT + TRACKED_SOLIDS - 1;
    const PALM: usize = 15 + PALM_SOLIDS;
    const THENAR: usize = PALM + THENAR_SOLIDS;
    match index {
        0..15 => SolidPart::Phalanx(Digit::ALL[index / 3], Phalanx::ALL[index % 3]),
        15..PALM => SolidPart::Palm,
        PALM..THENAR => SolidPart::ThumbBall,
        HandSolids::COUNT..TRACKED_PALM => SolidPart::Palm,
        _ => SolidPart::Forearm,
    }
}
