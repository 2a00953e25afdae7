//! Digits of a closed hand that make way for barriers, while wrist and other digits stay where they are.

use super::{
    barriers::Barriers,
    closer::Closer,
    grip::{GIVER_CLEARANCE, nears_forbidden_surface},
    obstacle::Obstacle,
    scene::ObjectScene,
    shape::{HandShape, TUCKED_FLEXION},
    solids::{HandSolids, TaperedCapsule, TrackedSolids, comes_within, self_clearance},
};
use crate::model::hand::{
    Digit, DigitAngles, HandPose,
    kinematics::DigitPlane,
    rig::{AngleRange, Rig},
};

/// Total flexions in radians that a digit may make way to: stretched, up to tucked into the palm.
const FLEXIONS: [f32; 8] = [0.0, 0.35, 0.7, 1.15, 1.6, 2.2, 3.0, TUCKED_FLEXION];

/// Yaws that a thumb may make way to, as shares of its range; fingers keep theirs.
const THUMB_YAWS: [f32; 3] = [0.0, 0.5, 1.0];

/// How digits bend that hold nothing: all joints alike.
const SHAPE: HandShape = HandShape {
    thumb_yaw: 0.5,
    spread: 0.5,
    bend_ratios: [1.0; 2],
    closing: [true; 5],
    preshape: [0.0; 2],
    tucks: false,
};

/// A hand after some of its digits have made way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Evaded {
    /// The hand, in the object's frame.
    pub pose: HandPose,
    /// The digits that were moved, thumb first. They do not touch the object.
    pub moved: [bool; 5],
}

/// Moves the digits of a hand that are too close to barriers, each as little as it takes. The others stay as they are. `None`
/// if palm or forearm are too close, too, or if a digit has nowhere to go.
pub(crate) fn evade(
    scene: &ObjectScene<'_>,
    rig: &Rig,
    pose: &HandPose,
    barriers: Barriers<'_>,
) -> Option<Evaded> {
    let solids = HandSolids::of_pose(rig, pose);
    let tracked = TrackedSolids::of_rig(rig, pose.frame_from_wrist, &solids);
    let nears = |part: &TaperedCapsule| barriers.comes_within(std::iter::once(part), GIVER_CLEARANCE);
    if tracked.still().any(nears) {
        return None;
    }
    let mut evaded = Evaded {
        pose: *pose,
        moved: [false; 5],
    };
    for digit in Digit::ALL.into_iter().filter(|&digit| rig.has(digit)) {
        if parts_of(digit, &solids).any(nears) {
            evaded.moved[digit.index()] = true;
        }
    }
    let mut obstacles: Vec<Obstacle> = Obstacle::of_palm(&solids).collect();
    for digit in Digit::ALL {
        if evaded.moved[digit.index()] {
            evaded.pose = with_digit_away(scene, rig, &evaded.pose, digit, barriers, &obstacles)?;
        }
        if digit == Digit::Thumb {
            obstacles.extend(Obstacle::of_thumb(&HandSolids::of_pose(rig, &evaded.pose)));
        }
    }
    Some(evaded)
}

/// What moves with a digit.
fn parts_of(digit: Digit, solids: &HandSolids) -> impl Iterator<Item = &TaperedCapsule> + Clone {
    let ball: &[TaperedCapsule] = if digit == Digit::Thumb {
        &solids.thenar
    } else {
        &[]
    };
    solids.phalanges[digit.index()].iter().chain(ball)
}

/// The hand with a digit in the nearest pose that is clear of barriers, object and hand.
fn with_digit_away(
    scene: &ObjectScene<'_>,
    rig: &Rig,
    pose: &HandPose,
    digit: Digit,
    barriers: Barriers<'_>,
    obstacles: &[Obstacle],
) -> Option<HandPose> {
    let closer = Closer {
        scene,
        barriers,
        rig,
        shape: &SHAPE,
        object_from_wrist: pose.frame_from_wrist,
    };
    let present = pose.digits[digit.index()];
    let AngleRange { min, max } = rig.digit(digit).limits.base_yaw;
    let other_yaws = THUMB_YAWS.map(|share| min + (max - min) * share);
    let other_yaws: &[f32] = if digit == Digit::Thumb { &other_yaws } else { &[] };
    let yaws = std::iter::once(present.base_yaw).chain(other_yaws.iter().copied());
    let mut poses: Vec<(f32, DigitAngles)> = yaws
        .flat_map(|yaw| FLEXIONS.map(|flexion| closer.relaxed(digit, yaw, flexion, obstacles)))
        .map(|angles| (travel(rig, digit, pose, angles), angles))
        .collect();
    poses.sort_by(|a, b| a.0.total_cmp(&b.0));
    poses.into_iter().find_map(|(_, angles)| {
        let mut tried = *pose;
        tried.digits[digit.index()] = angles;
        let solids = HandSolids::of_pose(rig, &tried);
        let surface = &scene.object.surface;
        let is_clear = !barriers.comes_within(parts_of(digit, &solids), GIVER_CLEARANCE)
            && !solids.phalanges[digit.index()]
                .iter()
                .any(|link| comes_within(link, surface, 0.0))
            && self_clearance(rig, &solids) >= 0.0
            && !nears_forbidden_surface(scene, parts_of(digit, &solids));
        is_clear.then_some(tried)
    })
}

/// How far the joints of a digit move together to its pose in another hand with the same wrist, in metres.
fn travel(rig: &Rig, digit: Digit, pose: &HandPose, angles: DigitAngles) -> f32 {
    let joints = |angles: DigitAngles| {
        DigitPlane::new(rig.digit(digit), pose.frame_from_wrist, angles.base_yaw).joints(&angles)
    };
    let (from, to) = (joints(pose.digits[digit.index()]), joints(angles));
    from.iter().zip(&to).map(|(from, to)| from.distance(*to)).sum()
}
