//! The motions to grasps on the built-in objects, checked at many moments of the motion.

use grasp_synthesis::{
    model::grasp::{KeyFrame, Stage},
    search::key_frames::{APPROACH_DISTANCE, OPEN_CLEARANCE, key_frames},
};

use crate::prelude::*;

/// Rounding of distances, in metres, and the accuracy of a motion.
const TOLERANCE: f32 = 0.00015;

/// Moments checked per motion: fingertips move about half a millimetre between them.
const MOMENTS: usize = 120;

/// Ways followed moment by moment per holdout: following takes far longer than planning.
const FOLLOWED: usize = 4;

struct Planned {
    name: String,
    holdout: Holdout,
    grasp: Grasp,
    motion: Option<[KeyFrame; 3]>,
}

fn plan(holdout: &Holdout, name: &str) -> Vec<Planned> {
    let (scene, presented) = (object_scene(&holdout.object), Presented::of(holdout));
    let grasps = valid_grips(holdout, &every(12, name_of(&holdout.object)));
    let planned = grasps.into_iter().flatten().map(|grasp| Planned {
        name: name.to_owned(),
        holdout: holdout.clone(),
        motion: key_frames(&scene, &presented, right(), None, &grasp),
        grasp,
    });
    planned.collect()
}

/// Grasps on the built-in holdouts, and on the same objects floating freely.
static PLANNED: LazyLock<Vec<Planned>> = LazyLock::new(|| {
    let free = OBJECT_NAMES.map(|name| floating(Arc::clone(object(name))));
    let all = tracked_holdouts().chain(free).enumerate();
    all.flat_map(|(place, holdout)| plan(&holdout, &format!("holdout {place}")))
        .collect()
});

fn followed() -> impl Iterator<Item = (&'static Planned, &'static [KeyFrame; 3])> {
    let of_holdouts = PLANNED.chunk_by(|a, b| a.name == b.name);
    of_holdouts.flat_map(|planned| {
        let moving = planned
            .iter()
            .filter_map(|planned| Some((planned, planned.motion.as_ref()?)));
        moving.take(FOLLOWED)
    })
}

/// Signed distance of the hand from the object, negative inside, and its distance from the giver.
fn gaps(planned: &Planned, pose: &HandPose) -> (f32, f32) {
    let solids = HandSolids::of_pose(right(), pose);
    let surface = &planned.holdout.object.surface;
    let object = solids
        .iter()
        .map(|solid| clearance(solid, surface, 0.01))
        .fold(f32::INFINITY, f32::min);
    let giver = planned.holdout.presenting_hand.as_ref();
    let theirs = giver.and_then(|giver| giver.shape.joints());
    let giver =
        theirs.map(|joints| pair_distance(tracked(pose).iter(), TrackedSolids::of_joints(joints).iter()));
    (object, giver.unwrap_or(f32::INFINITY))
}

fn moments(from: &KeyFrame, to: &KeyFrame) -> impl Iterator<Item = HandPose> {
    (0..=MOMENTS).map(|moment| pose_between(&from.pose, &to.pose, moment as f32 / MOMENTS as f32))
}

#[test]
fn key_frames_open_the_hand_far_and_near_and_end_in_the_grasp() {
    let rig = right();
    let mut widened = Vec::new();
    for planned in PLANNED.iter() {
        let Some([approach, pre_grasp, close]) = &planned.motion else {
            continue;
        };
        let stages = [approach.stage, pre_grasp.stage, close.stage];
        assert_eq!(stages, [Stage::Approach, Stage::PreGrasp, Stage::Close]);
        assert_eq!(close.pose, planned.grasp.pose);
        assert_eq!(approach.pose.digits, pre_grasp.pose.digits);
        let [far, near, there] = [approach, pre_grasp, close].map(|frame| frame.pose.frame_from_wrist);
        assert_eq!(far.orientation, there.orientation);
        assert_eq!(near.orientation, there.orientation);
        let motion = near.position - far.position;
        assert!((motion.length() - APPROACH_DISTANCE).abs() < 1e-5, "{motion}");
        // The last stretch, if there is one, keeps the direction.
        let last = there.position - near.position;
        assert!(last.length() < 0.026 && last.angle_between(motion).abs() < 0.01 || last == Vec3::ZERO);
        let limits = rig.digits.map(|digit| digit.limits);
        for ((open, closed), limits) in pre_grasp.pose.digits.iter().zip(&close.pose.digits).zip(limits) {
            assert_eq!(open.base_yaw, closed.base_yaw);
            for (open, closed, range) in [
                (open.base_pitch, closed.base_pitch, limits.base_pitch),
                (open.second_pitch, closed.second_pitch, limits.second_pitch),
                (open.third_pitch, closed.third_pitch, limits.third_pitch),
            ] {
                assert!(open <= closed + 1e-6, "joints bend to close");
                assert!(range.contains(open, 1e-5), "{open} in {range:?}");
            }
        }
        let touching = planned
            .grasp
            .contacts
            .iter()
            .filter_map(|contact| contact.part.digit());
        let finger = touching.filter(|&digit| digit != Digit::Thumb).min();
        let finger = finger.unwrap_or(Digit::Index).index();
        let aperture = |pose: &HandPose| {
            let [thumb, finger] = [0, finger]
                .map(|digit| digit_frames(&rig.digits[digit], pose.frame_from_wrist, pose.digits[digit]));
            thumb.tip.distance(finger.tip)
        };
        widened.push(aperture(&pre_grasp.pose) - aperture(&close.pose));
    }
    // As with people, the thumb and the first holding finger are some centimetres farther apart than in the grasp, except
    // where the thumb lies across a finger.
    let mean = widened.iter().sum::<f32>() / widened.len() as f32;
    assert!((0.02..0.06).contains(&mean), "{mean} m");
    let wider = widened.iter().filter(|&&by| by > 0.01).count();
    assert!(10 * wider > 9 * widened.len(), "{wider} of {}", widened.len());
}

#[test]
fn motions_keep_clear() {
    let mut count = 0;
    for (planned, [approach, pre_grasp, close]) in followed() {
        let name = &planned.name;
        for frame in [approach, pre_grasp] {
            let (object, giver) = gaps(planned, &frame.pose);
            assert!(object >= OPEN_CLEARANCE - TOLERANCE, "{name}: {object} m");
            // At the approach, only the motion must be free.
            let is_near = frame.stage == Stage::PreGrasp;
            assert!(!is_near || giver >= GIVER_CLEARANCE - 1e-6, "{name}: {giver} m");
            let solids = HandSolids::of_pose(right(), &frame.pose);
            assert!(self_clearance(right(), &solids) >= 0.0, "{name}");
        }
        for (moment, pose) in moments(approach, pre_grasp).enumerate() {
            let (object, giver) = gaps(planned, &pose);
            assert!(object > 0.0 && giver > 0.0, "{name} {moment} {object} {giver}");
        }
        for (moment, pose) in moments(pre_grasp, close).enumerate() {
            let (object, giver) = gaps(planned, &pose);
            let is_free = object >= -MAX_PENETRATION - TOLERANCE && giver > 0.0;
            assert!(is_free, "{name} at {moment}: {object}, {giver}");
            let solids = HandSolids::of_pose(right(), &pose);
            let is_forbidden = |solid| planned.holdout.object.is_forbidden_within(solid, 0.0);
            assert!(!solids.iter().any(is_forbidden), "{name} at {moment}");
        }
        count += 1;
    }
    assert!(count > 30, "{count} motions");
}

fn direction_of(motion: &[KeyFrame; 3]) -> Vec3 {
    let [from, to] = [&motion[0], &motion[1]].map(|frame| frame.pose.frame_from_wrist.position);
    (to - from).normalize_or_zero()
}

/// The motion to a planned grasp within an approach cone.
fn motion_from(planned: &Planned, axis: Vec3, half_angle: f32) -> Option<[KeyFrame; 3]> {
    let object = &planned.holdout.object;
    let scene = object_scene(object);
    let presented = Presented::of(&planned.holdout);
    let cone = ApproachCone { axis, half_angle };
    key_frames(&scene, &presented, right(), Some(cone), &planned.grasp)
}

#[test]
fn hands_approach_only_within_the_allowed_cone() {
    let (mut natural_motions, mut blocked, mut others) = (0, 0, 0);
    for (number, planned) in PLANNED.iter().enumerate() {
        let Some(motion) = &planned.motion else { continue };
        let (free, natural) = (
            direction_of(motion),
            approach_direction(planned.grasp.pose.frame_from_wrist),
        );
        // Of all directions tried, only the natural one is within 10° of itself. As it is tried first, a motion from
        // elsewhere means that it is blocked.
        let only = motion_from(planned, natural, 10_f32.to_radians());
        if free.angle_between(natural) < 0.01 {
            assert_eq!(only.as_ref(), Some(motion), "{}", planned.name);
            natural_motions += 1;
        } else {
            assert_eq!(only, None, "{}", planned.name);
            blocked += 1;
        }
        // All directions tried are within 80° of the natural one, so none is within 57° of its opposite.
        assert_eq!(motion_from(planned, -natural, 1.0), None, "{}", planned.name);
        // A cone that excludes the unconstrained motion: another motion, or `None`.
        let side = free.any_orthonormal_vector();
        let side = if number % 2 == 0 { side } else { -side };
        let axis = (free * 0.5 + side).normalize_or_zero();
        let half_angle = 50_f32.to_radians();
        if let Some(other) = motion_from(planned, axis, half_angle) {
            let angle = direction_of(&other).angle_between(axis);
            assert!(angle <= half_angle + 1e-3, "{}: {angle}", planned.name);
            others += 1;
        }
    }
    assert!(
        natural_motions > 20 && blocked > 10 && others > 20,
        "{natural_motions} natural, {blocked} blocked, {others} from the side"
    );
}
