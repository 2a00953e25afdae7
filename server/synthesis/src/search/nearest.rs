//! A valid grasp near a hand that is not one, and the way to it.

use super::{scene::Task, settings::SearchSettings};
use crate::{
    base::{
        pose::Pose,
        stop::{Stop, Stopped},
        stopwatch::NoStopwatch,
    },
    known::recheck::GripChecker,
    model::{
        grasp::Grasp,
        hand::{DigitAngles, HandPose, kinematics::hand_frames, rig::Rig},
        object::GraspObject,
    },
    physical::{
        barriers::Barriers,
        grip::{Gripper, MAX_PENETRATION},
        scene::{ObjectScene, Presented},
        solids::{HandSolids, TrackedSolids, comes_within},
    },
    rating::assessment::GraspContext,
};

/// Metres of a wrist's way that a radian of its turn counts as: about a hand's length.
const METRES_PER_RADIAN: f32 = 0.1;

/// How far hands on a way are apart, in metres of [`wrist_way`], at most; and how many are looked at.
const STEP: f32 = 0.004;
const MOST_STEPS: f32 = 100.0;

/// How far a hand has to go to another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HandWay {
    /// Distance of the wrists, in metres.
    pub distance: f32,
    /// Angle between them, in radians.
    pub angle: f32,
    /// Mean distance that the fingertips move in the wrist's frame, in metres.
    pub fingertips: f32,
    /// True if the straight way is free of barriers, and the hand does not pass through the object.
    pub is_free: bool,
}

/// How far apart two wrists are, in metres.
fn wrist_way(from: Pose, to: Pose) -> f32 {
    from.position.distance(to.position) + METRES_PER_RADIAN * from.orientation.angle_between(to.orientation)
}

/// A valid grasp near a hand under `PHYSICAL` validity: the hand itself with digits closed or opened as little as it takes to touch,
/// or the nearest of the known grips in the settings. None if neither is valid.
///
/// # Errors
/// [`Stopped`].
pub fn nearest_grasp(
    task: Task<'_>,
    settings: &SearchSettings,
    from: &HandPose,
    stop: Stop<'_>,
) -> Result<Option<Grasp>, Stopped> {
    let Task { holdout, rig, .. } = task;
    let query = &settings.query;
    let presented = Presented::of(holdout);
    let scene = ObjectScene::new(&holdout.object, query.friction_on(&holdout.object));
    let around = GraspContext {
        object: scene,
        presented: &presented,
        rig,
        constraints: &query.constraints,
    };
    let mut gripper = Gripper::default();
    let posed = |pose: &HandPose, gripper: &mut Gripper| {
        let held = gripper.hold_posed(&scene, rig, pose, &presented);
        let grasp = held.and_then(|(grip, solids)| around.assess(&grip, &solids, gripper, &mut NoStopwatch));
        grasp.ok().map(|grasp| *grasp)
    };
    if let Some(grasp) = posed(&within_limits(rig, from), &mut gripper) {
        return Ok(Some(grasp));
    }
    stop.check()?;
    let way = |to: Pose| wrist_way(from.frame_from_wrist, to);
    let mut preferred: Vec<&HandPose> = settings.known.preferred.iter().collect();
    preferred.sort_by(|a, b| way(a.frame_from_wrist).total_cmp(&way(b.frame_from_wrist)));
    let mut nearest: Option<Grasp> = None;
    for pose in preferred {
        stop.check()?;
        nearest = posed(pose, &mut gripper);
        if nearest.is_some() {
            break;
        }
    }
    let Some(atlas) = settings.known.atlas.as_ref() else {
        return Ok(nearest);
    };
    let checker = GripChecker::new(&scene, rig, &presented);
    let mut order: Vec<(f32, usize)> = atlas
        .entries()
        .iter()
        .enumerate()
        .map(|(place, entry)| (way(entry.grip.pose.frame_from_wrist), place))
        .collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0));
    for (length, place) in order {
        stop.check()?;
        let is_farther = |grasp: &Grasp| way(grasp.pose.frame_from_wrist) <= length;
        if nearest.as_ref().is_some_and(is_farther) {
            break;
        }
        let entry = &atlas.entries()[place];
        if !entry.meets(&query.constraints) || !atlas.grips().may_be_clear(place, presented.barriers()) {
            continue;
        }
        let grasp = checker.check(entry, &entry.tracked_solids(rig), &mut gripper);
        if let Some(grasp) = grasp.filter(|grasp| query.constraints.admits(grasp)) {
            nearest = Some(grasp);
            break;
        }
    }
    Ok(nearest)
}

/// The way from one hand of a rig to another at the same object.
pub fn hand_way(
    rig: &Rig,
    [from, to]: [&HandPose; 2],
    object: &GraspObject,
    barriers: Barriers<'_>,
) -> HandWay {
    let (start, end) = (from.frame_from_wrist, to.frame_from_wrist);
    let tips = |pose: &HandPose| {
        let at_wrist = HandPose {
            frame_from_wrist: Pose::IDENTITY,
            ..*pose
        };
        hand_frames(rig, &at_wrist).digits.map(|digit| digit.tip)
    };
    let pairs = tips(from).into_iter().zip(tips(to));
    let digits = crate::model::hand::Digit::ALL.into_iter();
    let moved: Vec<f32> = digits
        .zip(pairs)
        .filter(|(digit, _)| rig.has(*digit))
        .map(|(_, (a, b))| a.distance(b))
        .collect();
    let fingertips = moved.iter().sum::<f32>() / moved.len().max(1) as f32;
    HandWay {
        distance: start.position.distance(end.position),
        angle: start.orientation.angle_between(end.orientation),
        fingertips,
        is_free: is_free(rig, [from, to], fingertips, object, barriers),
    }
}

/// True if the hands between two, wrist and angles turned in proportion, touch no barrier and are no deeper in the object than flesh
/// yields.
fn is_free(
    rig: &Rig,
    [from, to]: [&HandPose; 2],
    fingertips: f32,
    object: &GraspObject,
    barriers: Barriers<'_>,
) -> bool {
    let length = wrist_way(from.frame_from_wrist, to.frame_from_wrist) + fingertips;
    let steps = (length / STEP).ceil().clamp(1.0, MOST_STEPS);
    (1..steps as u32).all(|step| {
        let pose = between(from, to, step as f32 / steps);
        let solids = HandSolids::of_pose(rig, &pose);
        let tracked = TrackedSolids::of_rig(rig, pose.frame_from_wrist, &solids);
        !barriers.comes_within(tracked.iter(), 0.0)
            && !solids
                .iter()
                .any(|part| comes_within(part, &object.surface, -MAX_PENETRATION))
    })
}

/// The hand at a share of the way from one to another.
fn between(from: &HandPose, to: &HandPose, share: f32) -> HandPose {
    let (start, end) = (from.frame_from_wrist, to.frame_from_wrist);
    let mix = |a: f32, b: f32| a + (b - a) * share;
    HandPose {
        frame_from_wrist: Pose::new(
            start.position.lerp(end.position, share),
            start.orientation.slerp(end.orientation, share),
        ),
        digits: std::array::from_fn(|digit| {
            let (a, b) = (from.digits[digit], to.digits[digit]);
            DigitAngles {
                base_yaw: mix(a.base_yaw, b.base_yaw),
                base_pitch: mix(a.base_pitch, b.base_pitch),
                second_pitch: mix(a.second_pitch, b.second_pitch),
                third_pitch: mix(a.third_pitch, b.third_pitch),
            }
        }),
    }
}

/// The hand with angles clamped to the rig's limits.
fn within_limits(rig: &Rig, pose: &HandPose) -> HandPose {
    HandPose {
        digits: std::array::from_fn(|digit| rig.digits[digit].limits.clamped(pose.digits[digit])),
        ..*pose
    }
}
