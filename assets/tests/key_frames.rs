//! The ways to grasps on the built-in objects, judged by looking at the moving hand at many moments.

use std::sync::{Arc, LazyLock};

use glam::Vec3;
use grasp_assets::{
    hands::hand,
    holdouts::{BuiltInHoldout, holdouts},
};
use grasp_synthesis::{
    base::pose::Pose,
    geometry::mesh::TriangleMesh,
    known::{growth::Growth, recheck::Recheck},
    model::{
        constraints::ApproachCone,
        grasp::{Grasp, KeyFrame, Stage},
        hand::{DigitAngles, HandPose, Handedness, kinematics::digit_frames, rig::Rig},
        holdout::Holdout,
        object::GraspObject,
        strategy::Validity,
    },
    physical::{
        grip::{DEEPEST, GIVER_CLEARANCE, Gripper},
        scene::{ObjectScene, Presented},
        solids::{HandSolids, TrackedSolids, clearance, self_clearance},
    },
    search::key_frames::{APPROACH_DISTANCE, OPEN_CLEARANCE, key_frames},
};

/// What distances and their sums are rounded by, in metres, with what is left open about a way.
const TOLERANCE: f32 = 0.00015;

/// Grips that are tried of each object.
const GRIPS: usize = 120;

/// Moments of a motion that are looked at: fingertips move about half a millimetre between them.
const MOMENTS: usize = 120;

/// Ways that are followed moment by moment of each holdout: following takes far longer than planning.
const FOLLOWED: usize = 4;

fn rig(handedness: Handedness) -> &'static Rig {
    &hand("adult", handedness).expect("a built-in rig").rig
}

/// A grasp, how its object is held out, and the way to it.
struct Planned {
    name: String,
    holdout: Holdout,
    grasp: Grasp,
    way: Option<[KeyFrame; 3]>,
}

fn friction(object: &GraspObject) -> f32 {
    object.friction_under(Validity::Physical)
}

/// Grasps on an object as it is held out.
fn plan(name: &str, holdout: &Holdout, grips: &Growth<'_>, rig: &Rig) -> Vec<Planned> {
    let scene = ObjectScene::new(&holdout.object, friction(&holdout.object));
    let presented = Presented::of(holdout);
    let mut gripper = Gripper::default();
    let atlas = grips.atlas();
    let asked = Recheck::new(&scene, rig, &presented);
    let grasps = atlas
        .entries()
        .iter()
        .filter_map(|entry| asked.hold(entry, &entry.tracked_solids(rig), &mut gripper));
    grasps
        .map(|grasp| Planned {
            name: name.to_owned(),
            holdout: holdout.clone(),
            way: key_frames(&scene, &presented, rig, None, &grasp),
            grasp,
        })
        .collect()
}

fn grown<'a>(object: &'a GraspObject, rig: &'a Rig) -> Growth<'a> {
    let mut growth = Growth::new(object, rig);
    let mut gripper = Gripper::default();
    while growth.len() < GRIPS && !growth.is_complete() {
        growth.round(&mut gripper);
    }
    growth
}

/// Grasps on the built-in holdouts, and on the same objects floating freely.
static PLANNED: LazyLock<Vec<Planned>> = LazyLock::new(|| {
    let rig = rig(Handedness::Right);
    let mut planned = Vec::new();
    for object in ["remote", "scalpel", "scissors"] {
        let held = |holdout: &&BuiltInHoldout| holdout.object == object;
        let first = holdouts().iter().find(held).expect("every object has holdouts");
        let first = first.to_holdout().expect("a built-in holdout");
        let grips = grown(&first.object, rig);
        for holdout in holdouts().iter().filter(held) {
            let name = &holdout.name;
            let holdout = holdout.to_holdout().expect("a built-in holdout");
            planned.extend(plan(name, &holdout, &grips, rig));
        }
        let floating = Holdout {
            presenting_hand: None,
            ..first.clone()
        };
        planned.extend(plan(object, &floating, &grips, rig));
    }
    planned
});

/// Ways to be followed: the first of each holdout.
fn followed() -> impl Iterator<Item = (&'static Planned, &'static [KeyFrame; 3])> {
    let mut last = ("", 0);
    PLANNED
        .iter()
        .filter_map(|planned| Some((planned, planned.way.as_ref()?)))
        .filter(move |(planned, _)| {
            last = if planned.name == last.0 {
                (last.0, last.1 + 1)
            } else {
                (&planned.name, 0)
            };
            last.1 < FOLLOWED
        })
}

/// How deep the hand is in the object at its deepest, or how far from it; and how far from the giver.
fn gaps(planned: &Planned, pose: &HandPose) -> (f32, f32) {
    let rig = rig(Handedness::Right);
    let solids = HandSolids::of_pose(rig, pose);
    let told = TrackedSolids::of_rig(rig, pose.frame_from_wrist, &solids);
    let surface = &planned.holdout.object.surface;
    let object = solids
        .iter()
        .map(|solid| clearance(solid, surface, 0.01))
        .fold(f32::INFINITY, f32::min);
    let giver = planned.holdout.presenting_hand.as_ref();
    let theirs = giver.map(|giver| TrackedSolids::of_joints(&giver.joints));
    let giver = theirs.iter().flat_map(TrackedSolids::iter).flat_map(|their| {
        let distances = told.iter().map(|our| our.distance(their));
        distances.collect::<Vec<_>>()
    });
    (object, giver.fold(f32::INFINITY, f32::min))
}

/// The hand between two frames: the wrist goes straight and does not turn, angles change evenly.
fn at(from: &HandPose, to: &HandPose, share: f32) -> HandPose {
    let even = |a: f32, b: f32| a * (1.0 - share) + b * share;
    HandPose {
        frame_from_wrist: Pose::new(
            from.frame_from_wrist.position * (1.0 - share) + to.frame_from_wrist.position * share,
            from.frame_from_wrist.orientation,
        ),
        digits: std::array::from_fn(|digit| {
            let (a, b) = (from.digits[digit], to.digits[digit]);
            DigitAngles {
                base_yaw: even(a.base_yaw, b.base_yaw),
                base_pitch: even(a.base_pitch, b.base_pitch),
                second_pitch: even(a.second_pitch, b.second_pitch),
                third_pitch: even(a.third_pitch, b.third_pitch),
            }
        }),
    }
}

fn moments(from: &KeyFrame, to: &KeyFrame) -> impl Iterator<Item = HandPose> {
    (0..=MOMENTS).map(|moment| at(&from.pose, &to.pose, moment as f32 / MOMENTS as f32))
}

#[test]
fn nearly_every_grasp_has_a_way() {
    let without = PLANNED.iter().filter(|planned| planned.way.is_none()).count();
    assert!(PLANNED.len() > 300, "{} grasps", PLANNED.len());
    assert!(
        20 * without < PLANNED.len(),
        "{without} of {} grasps have none",
        PLANNED.len()
    );
}

#[test]
fn the_frames_are_an_open_hand_far_and_near_and_the_grasp() {
    let rig = rig(Handedness::Right);
    let mut widened = Vec::new();
    for planned in PLANNED.iter() {
        let Some([approach, pre_grasp, close]) = &planned.way else {
            continue;
        };
        let stages = [approach.stage, pre_grasp.stage, close.stage];
        assert_eq!(stages, [Stage::Approach, Stage::PreGrasp, Stage::Close]);
        assert_eq!(close.pose, planned.grasp.pose);
        assert_eq!(approach.pose.digits, pre_grasp.pose.digits);
        let [far, near, there] = [approach, pre_grasp, close].map(|frame| frame.pose.frame_from_wrist);
        assert_eq!(far.orientation, there.orientation);
        assert_eq!(near.orientation, there.orientation);
        let way = near.position - far.position;
        assert!((way.length() - APPROACH_DISTANCE).abs() < 1e-5, "{way}");
        // The last bit, if there is one, goes on in the same direction.
        let last = there.position - near.position;
        assert!(last.length() < 0.026 && last.angle_between(way).abs() < 0.01 || last == Vec3::ZERO);
        let limits = rig.digits.map(|digit| digit.limits);
        for ((open, closed), limits) in pre_grasp.pose.digits.iter().zip(&close.pose.digits).zip(limits) {
            assert_eq!(open.base_yaw, closed.base_yaw);
            for (open, closed, range) in [
                (open.base_pitch, closed.base_pitch, limits.base_pitch),
                (open.second_pitch, closed.second_pitch, limits.second_pitch),
                (open.third_pitch, closed.third_pitch, limits.third_pitch),
            ] {
                assert!(open <= closed + 1e-6, "{}: joints bend to close", planned.name);
                assert!(
                    range.contains(open, 1e-5),
                    "{}: {open} in {range:?}",
                    planned.name
                );
            }
        }
        let aperture = |pose: &HandPose| {
            let [thumb, index] = [0, 1]
                .map(|digit| digit_frames(&rig.digits[digit], pose.frame_from_wrist, pose.digits[digit]));
            thumb.tip.distance(index.tip)
        };
        widened.push(aperture(&pre_grasp.pose) - aperture(&close.pose));
    }
    // Thumb and index finger stand farther apart than in the grasp, by some centimetres as people's do; not where the
    // thumb lies across a finger.
    let mean = widened.iter().sum::<f32>() / widened.len() as f32;
    assert!((0.02..0.06).contains(&mean), "{mean} m");
    let wider = widened.iter().filter(|&&by| by > 0.01).count();
    assert!(10 * wider > 9 * widened.len(), "{wider} of {}", widened.len());
}

#[test]
fn the_open_hand_is_off_everything() {
    let mut count = 0;
    for (planned, [approach, pre_grasp, _]) in followed() {
        for frame in [approach, pre_grasp] {
            let solids = HandSolids::of_pose(rig(Handedness::Right), &frame.pose);
            let (object, giver) = gaps(planned, &frame.pose);
            assert!(
                object >= OPEN_CLEARANCE - TOLERANCE,
                "{}: {object} m",
                planned.name
            );
            // Farther off, there is only the way to keep free.
            let least = if frame.stage == Stage::PreGrasp {
                GIVER_CLEARANCE
            } else {
                0.0
            };
            assert!(giver >= least - 1e-6, "{}: {giver} m", planned.name);
            assert!(self_clearance(&solids) >= 0.0, "{}", planned.name);
        }
        count += 1;
    }
    assert!(count > 30, "{count} ways");
}

#[test]
fn nothing_is_touched_on_the_way_in() {
    for (planned, [approach, pre_grasp, _]) in followed() {
        for (moment, pose) in moments(approach, pre_grasp).enumerate() {
            let (object, giver) = gaps(planned, &pose);
            assert!(
                object > 0.0 && giver > 0.0,
                "{} at {moment}: {object} m, {giver} m",
                planned.name
            );
        }
    }
}

#[test]
fn closing_sinks_no_deeper_than_a_grasp_and_touches_nothing_forbidden() {
    for (planned, [_, pre_grasp, close]) in followed() {
        let object = &planned.holdout.object;
        for (moment, pose) in moments(pre_grasp, close).enumerate() {
            let (depth, giver) = gaps(planned, &pose);
            assert!(
                depth >= -DEEPEST - TOLERANCE && giver > 0.0,
                "{} at {moment}: {depth} m, {giver} m",
                planned.name
            );
            let solids = HandSolids::of_pose(rig(Handedness::Right), &pose);
            let touches = solids.iter().any(|solid| object.is_forbidden_within(solid, 0.0));
            assert!(!touches, "{} at {moment}", planned.name);
        }
    }
}

/// The direction in which the hand of a way moves.
fn direction_of(way: &[KeyFrame; 3]) -> Vec3 {
    let [from, to] = [&way[0], &way[1]].map(|frame| frame.pose.frame_from_wrist.position);
    (to - from).normalize_or_zero()
}

/// The direction in which a hand comes by nature: with its fingers and with its palm.
fn natural(grasp: &Grasp) -> Vec3 {
    (grasp.pose.frame_from_wrist.orientation * (Vec3::Y + Vec3::Z)).normalize_or_zero()
}

/// The way to a planned grasp whose hand may come from a cone only.
fn way_from(planned: &Planned, axis: Vec3, half_angle: f32) -> Option<[KeyFrame; 3]> {
    let object = &planned.holdout.object;
    let scene = ObjectScene::new(object, friction(object));
    let presented = Presented::of(&planned.holdout);
    let cone = ApproachCone { axis, half_angle };
    key_frames(
        &scene,
        &presented,
        rig(Handedness::Right),
        Some(cone),
        &planned.grasp,
    )
}

#[test]
fn a_hand_comes_only_from_where_it_may() {
    let (mut natural_ways, mut blocked, mut others) = (0, 0, 0);
    for (number, planned) in PLANNED.iter().enumerate() {
        let Some(way) = &planned.way else { continue };
        let (free, natural) = (direction_of(way), natural(&planned.grasp));
        // Only the natural direction is within 10° of itself. It is tried first, so another one means that it is blocked.
        let only = way_from(planned, natural, 10_f32.to_radians());
        if free.angle_between(natural) < 0.01 {
            assert_eq!(only.as_ref(), Some(way), "{}", planned.name);
            natural_ways += 1;
        } else {
            assert_eq!(only, None, "{}", planned.name);
            blocked += 1;
        }
        // All directions are within 80° of the natural one, so none is within 57° of the opposite one.
        assert_eq!(way_from(planned, -natural, 1.0), None, "{}", planned.name);
        // A cone that the free choice is not in: another way, or none.
        let side = free.any_orthonormal_vector();
        let side = if number % 2 == 0 { side } else { -side };
        let axis = (free * 0.5 + side).normalize_or_zero();
        let half_angle = 50_f32.to_radians();
        if let Some(other) = way_from(planned, axis, half_angle) {
            let angle = direction_of(&other).angle_between(axis);
            assert!(angle <= half_angle + 1e-3, "{}: {angle}", planned.name);
            others += 1;
        }
    }
    assert!(
        natural_ways > 20 && blocked > 10 && others > 20,
        "{natural_ways} as by nature, {blocked} blocked, {others} from aside"
    );
}

/// A box with its middle in the origin, and its half edges.
fn cuboid(half: Vec3) -> Arc<GraspObject> {
    let corner = |i: u32| {
        let side = |bit: u32| if i >> bit & 1 == 1 { 1.0 } else { -1.0 };
        half * Vec3::new(side(0), side(1), side(2))
    };
    let quads = [
        [0, 4, 6, 2],
        [1, 3, 7, 5],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 2, 3, 1],
        [4, 5, 7, 6],
    ];
    let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]);
    let mesh = TriangleMesh::new((0..8).map(corner).collect(), triangles.collect()).expect("a box");
    Arc::new(GraspObject::new(mesh, 0.1, Vec3::ZERO, None, &[]).expect("an object"))
}

fn floating(object: &Arc<GraspObject>) -> Holdout {
    Holdout {
        object: Arc::clone(object),
        presenting_hand: None,
        up: Vec3::Y,
    }
}

#[test]
fn the_other_hand_comes_the_mirrored_way() {
    let object = cuboid(Vec3::new(0.02, 0.06, 0.015));
    let holdout = floating(&object);
    let (right, left) = (rig(Handedness::Right), rig(Handedness::Left));
    let planned = plan("box", &holdout, &grown(&object, right), right);
    let scene = ObjectScene::new(&object, friction(&object));
    let mut count = 0;
    for planned in planned.iter().take(50) {
        let mut grasp = planned.grasp.clone();
        grasp.pose.frame_from_wrist = grasp.pose.frame_from_wrist.mirrored_x();
        let mirrored = key_frames(&scene, &Presented::of(&holdout), left, None, &grasp);
        assert_eq!(mirrored.is_some(), planned.way.is_some());
        for (ours, theirs) in planned.way.iter().flatten().zip(mirrored.iter().flatten()) {
            let expected = ours.pose.frame_from_wrist.mirrored_x().position;
            let there = theirs.pose.frame_from_wrist.position;
            assert!(expected.distance(there) < 1e-5, "{expected} and {there}");
            for (ours, theirs) in ours.pose.digits.iter().zip(&theirs.pose.digits) {
                assert!((ours.base_pitch - theirs.base_pitch).abs() < 1e-4);
                assert!((ours.second_pitch - theirs.second_pitch).abs() < 1e-4);
            }
            count += 1;
        }
    }
    assert!(count > 60, "{count} frames");
}

#[test]
fn a_hand_that_is_stuck_has_no_way() {
    let object = cuboid(Vec3::new(0.02, 0.06, 0.015));
    let rig = rig(Handedness::Right);
    let free = plan("box", &floating(&object), &grown(&object, rig), rig);
    let grasp = &free
        .iter()
        .find(|planned| planned.way.is_some())
        .expect("a way")
        .grasp;
    // The same hand in the middle of a block.
    let block = cuboid(Vec3::splat(0.6));
    let scene = ObjectScene::new(&block, friction(&block));
    assert_eq!(
        key_frames(&scene, &Presented::of(&floating(&block)), rig, None, grasp),
        None
    );
}
