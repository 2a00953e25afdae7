//! Verdicts about hands that somebody posed.

use grasp_synthesis::{
    model::plain_object::BannedGrip,
    physical::{
        barriers::{Barrier, OBSTACLE_CLEARANCE},
        solids::SolidPart,
    },
    search::verdicts::Against,
};

use crate::prelude::*;

fn failed(judgement: &Judgement) -> Vec<Check> {
    let failed = judgement.verdicts.iter().filter(|verdict| !verdict.passed);
    failed.map(|verdict| verdict.check).collect()
}

fn on_bar() -> (Holdout, Grasp) {
    let holdout = floating(bar());
    let search = guided(&holdout).max_attempts(500);
    let grasp = search.grasp().expect("a bar can be held");
    (holdout, grasp)
}

fn moved(pose: &HandPose, offset: Vec3) -> HandPose {
    let mut moved = *pose;
    moved.frame_from_wrist.position += offset;
    moved
}

#[test]
fn depth_is_that_of_the_deepest_sphere_in_a_box() {
    let (holdout, grasp) = on_bar();
    let search = guided(&holdout);
    let half = Vec3::new(0.015, 0.08, 0.015);
    // Distance of a point outside from the surface of the box.
    let outside = |p: Vec3| (p.abs() - half).max(Vec3::ZERO).length();
    let mut random = Random::new(3);
    for _ in 0..40 {
        let pose = moved(&grasp.pose, random.direction() * random.between(0.0, 0.006));
        let solids = HandSolids::of_pose(right(), &pose);
        let all: Vec<(Vec3, f32)> = solids.iter().flat_map(|solid| balls(solid, 400)).collect();
        if all.iter().any(|&(centre, _)| outside(centre) == 0.0) {
            continue;
        }
        let expected = all
            .iter()
            .map(|&(centre, radius)| radius - outside(centre))
            .fold(0.0, f32::max);
        let judged = search.judge(&pose);
        let depth = verdict(&judged, Check::Penetration);
        let figure = depth.figure.expect("there is always a depth");
        assert!((figure - expected).abs() < 3e-5, "{figure} {expected}");
        assert_eq!(depth.passed, figure <= MAX_PENETRATION + 5e-6);
        if figure > 0.0 {
            // The depth is measured on the box, within the named part of the hand.
            let at = depth.at.expect("a depth is somewhere");
            assert!(((at.abs() - half).max_element()).abs() < 1e-4, "{at}");
            let part = depth.part.expect("a depth is of a part");
            let nearest = solids
                .parts()
                .filter(|(other, _)| *other == part)
                .map(|(_, solid)| solid.signed_distance(at))
                .fold(f32::INFINITY, f32::min);
            assert!((nearest + figure).abs() < 1e-4, "{nearest} {figure}");
        }
    }
}

#[test]
fn distances_name_the_nearest_hand_and_obstacle() {
    let (mut holdout, grasp) = on_bar();
    // A floor below all of the hand and a far wall; the hand's lowest sphere decides.
    let tracked = tracked(&grasp.pose);
    let lowest = tracked
        .iter()
        .flat_map(|solid| [(solid.start, solid.start_radius), (solid.end, solid.end_radius)])
        .map(|(centre, radius)| centre.y - radius)
        .fold(f32::INFINITY, f32::min);
    let slab = |top: f32| {
        Obstacle::Box(oriented_box(
            Pose::from_position(Vec3::Y * (top - 0.5)),
            Vec3::new(3.0, 0.5, 3.0),
        ))
    };
    let hand_at = |offset: Vec3| {
        let joints = HandJoints::of_pose(right(), &grasp.pose);
        HandShape::Joints(Box::new(joints.transformed(Pose::from_position(offset))))
    };
    for gap in [-0.01, 0.00005, 0.0002, 0.02] {
        holdout.obstacles = vec![slab(lowest - 2.0), slab(lowest - gap)];
        holdout.other_hands = [3.0, 0.8, 2.0].map(|x| hand_at(Vec3::X * x)).to_vec();
        let judged = guided(&holdout).judge(&grasp.pose);
        let obstacle = verdict(&judged, Check::ObstacleClearance);
        let figure = obstacle.figure.expect("there are obstacles");
        assert!((figure - gap).abs() < 1e-5, "{figure} {gap}");
        assert_eq!(obstacle.passed, gap >= OBSTACLE_CLEARANCE, "{gap}");
        assert_eq!(obstacle.against, Some(Against::Barrier(Barrier::Obstacle(1))));
        let at = obstacle.at.expect("a distance is somewhere");
        assert!((at.y - lowest).abs() < 1e-4, "{at}");
        let hand = verdict(&judged, Check::GiverClearance);
        assert_eq!(hand.against, Some(Against::Barrier(Barrier::OtherHand(1))));
        // By samples: the same hand, moved.
        let brute = tracked
            .iter()
            .flat_map(|solid| balls(solid, 400))
            .map(|(centre, radius)| {
                let from = |solid: &TaperedCapsule| solid.signed_distance(centre - Vec3::X * 0.8);
                tracked.iter().map(from).fold(f32::INFINITY, f32::min) - radius
            })
            .fold(f32::INFINITY, f32::min);
        let figure = hand.figure.expect("there are hands");
        assert!(
            (figure - brute).abs() < 2e-4 && figure <= brute + 1e-5,
            "{figure} {brute}"
        );
    }
}

#[test]
fn angles_beyond_limits_and_open_hands_fail_their_own_checks() {
    let (holdout, grasp) = on_bar();
    let search = guided(&holdout);
    let mut bent = grasp.pose;
    let range = right().digit(Digit::Ring).limits.second_pitch;
    bent.digits[Digit::Ring.index()].second_pitch = range.max + 0.25;
    let judged = search.judge(&bent);
    let limits = verdict(&judged, Check::JointLimits);
    assert!(!limits.passed && (limits.figure.expect("an excess") - 0.25).abs() < 1e-5);
    assert_eq!(limits.part.and_then(SolidPart::digit), Some(Digit::Ring));
    // A hand far away touches nothing, holds nothing, and collides with nothing.
    let judged = search.judge(&moved(&grasp.pose, Vec3::X));
    for (check, passes) in [
        (Check::Contacts, false),
        (Check::Closure, false),
        (Check::Balance, false),
        (Check::Penetration, true),
        (Check::SelfCollision, true),
        (Check::JointLimits, true),
    ] {
        assert_eq!(verdict(&judged, check).passed, passes, "{check:?}");
    }
    assert_eq!(verdict(&judged, Check::Contacts).figure, Some(0.0));
    let unbalanced = verdict(&judged, Check::Balance).figure.expect("a share");
    // Nothing carries the weight, nor its torque about the middle of no contacts.
    assert!(unbalanced >= 1.0 - 1e-4, "{unbalanced}");
    // Without the thumb, the other digits leave some of the weight unbalanced.
    let mut released = grasp.pose;
    released.digits[0] = right().stretched()[0];
    let judged = search.judge(&released);
    assert!(!judged.is_valid() && judged.grasp.forces.len() == judged.grasp.contacts.len());
}

#[test]
fn reach_requirements_and_banned_grips_have_verdicts_of_their_own() {
    let (holdout, grasp) = on_bar();
    let far = Requirements {
        must_touch: DigitSet::from_iter([Digit::Thumb]),
        ..within_reach(Vec3::X * 3.0, 0.5)
    };
    let judged = guided(&holdout).requirements(far).judge(&grasp.pose);
    assert_eq!(failed(&judged), [Check::Reach]);
    let reach = verdict(&judged, Check::Reach);
    let distance = (Vec3::X * 3.0).distance(grasp.pose.frame_from_wrist.position);
    assert_eq!((reach.figure, reach.bound), (Some(distance - 0.5), Some(0.0)));
    let judged = guided(&holdout).requirements(without_thumb()).judge(&grasp.pose);
    let unmet = verdict(&judged, Check::Requirements);
    assert!(!unmet.passed && unmet.description.contains("digits"));
    let banned = BannedGrip {
        handedness: Handedness::Right,
        object_from_wrist: grasp.pose.frame_from_wrist,
        distance: 0.01,
        angle: 0.1,
    };
    let holdout = floating(changed(&bar(), |plain| plain.with_banned(vec![banned])));
    let judged = guided(&holdout).judge(&grasp.pose);
    assert_eq!(failed(&judged), [Check::Banned]);
}
