//! Why a current grasp is not kept, as searches and verdicts say it.

use grasp_synthesis::{model::plain_object::BannedGrip, search::current::FailedCheck};

use super::{after, current, settled};
use crate::prelude::*;

/// How far figures may differ, in metres or as shares.
const ROUNDING: f32 = 1e-6;

/// The first check that a judged hand fails, in the order of [`Check`], with its figure; requirements are judged one by one.
fn first_failure(judged: &Judgement, requirements: &Requirements) -> Option<(Check, Option<f32>)> {
    let verdict = |check| verdict(judged, check);
    let grasp = &judged.grasp;
    let wrist = grasp.pose.frame_from_wrist;
    let of_check = |check| (check, verdict(check).passed, verdict(check).figure);
    let of_requirement = |check, is_met| (check, is_met, None);
    let closed = verdict(Check::Closure);
    let in_order = [
        of_check(Check::GiverClearance),
        of_check(Check::ObstacleClearance),
        of_check(Check::Penetration),
        of_check(Check::SelfCollision),
        of_check(Check::Forbidden),
        of_check(Check::Reach),
        of_requirement(Check::Approach, requirements.admits_approach(wrist)),
        (Check::Banned, verdict(Check::Banned).passed, None),
        of_requirement(Check::Digits, requirements.admits_contacts(&grasp.contacts)),
        (
            Check::Closure,
            closed.passed && verdict(Check::Contacts).passed,
            closed.figure,
        ),
        of_requirement(
            Check::GraspType,
            requirements.admits_type(grasp.classification.grasp_type),
        ),
        of_check(Check::Balance),
        of_requirement(Check::Comfort, requirements.admits_comfort(grasp.comfort)),
    ];
    let first = in_order.into_iter().find(|(_, passed, _)| !passed);
    assert_eq!(first.is_none(), judged.is_valid(), "{:#?}", judged.verdicts);
    first.map(|(check, _, figure)| (check, figure))
}

fn assert_fails_as_judged(failed: &FailedCheck, (check, figure): (Check, Option<f32>), what: &str) {
    assert_eq!(failed.check, check, "{what}: {failed}");
    let value = match (check, failed.figure, failed.bound) {
        // The figure of a verdict is the excess over the limit.
        (Check::Reach, Some(distance), Some(longest)) => Some(distance - longest),
        (Check::Reach, ..) => Some(0.0),
        (_, figure, _) => figure,
    };
    match (value, figure) {
        (Some(a), Some(b)) => assert!((a - b).abs() <= ROUNDING, "{what}: {a}, {b}: {failed}"),
        (a, b) => assert_eq!(a, b, "{what}: {failed}"),
    }
}

/// Settles a current hand and compares the result with its verdicts; the failed check, `None` if the hand was kept.
fn compared(search: &Search<'_>, hand: HandPose, what: &str) -> Option<Check> {
    let after = search.clone().current(CurrentGrasp {
        is_committed: true,
        ..current(hand)
    });
    let judged = search.judge(&hand);
    let first = first_failure(&judged, &search.settings.query.requirements);
    let Settlement::Settled(settled) = after.settle() else {
        panic!("{what}: a committed grasp is settled");
    };
    let (outcome, verdict) = *settled;
    let Some(failed) = verdict.failed_check else {
        assert_eq!(verdict.status, CurrentGraspStatus::Kept, "{what}");
        assert_eq!(first, None, "{what}");
        let (kept, seen) = (outcome.grasp.expect("it is kept"), &judged.grasp);
        assert_eq!((kept.pose, &kept.contacts), (hand, &seen.contacts), "{what}");
        assert_eq!(
            (kept.hangs, kept.classification),
            (seen.hangs, seen.classification)
        );
        assert!((kept.comfort - seen.comfort).abs() < 1e-4, "{what}");
        let [a, b] = [&kept, seen].map(|grasp| grasp.margins.expect("it is physical"));
        assert!(
            (a.epsilon - b.epsilon).abs() + (a.residual - b.residual).abs() < 1e-4,
            "{what}"
        );
        assert!((score(&kept) - score(seen)).abs() < 1e-4, "{what}");
        return None;
    };
    let first = first.unwrap_or_else(|| panic!("{what}: {failed} although every check is passed"));
    assert_fails_as_judged(&failed, first, what);
    if let Some(adjusted) = outcome.grasp {
        assert_eq!(verdict.status, CurrentGraspStatus::Adjusted);
        let judged = search.judge(&adjusted.pose);
        assert_eq!(
            first_failure(&judged, &search.settings.query.requirements),
            None,
            "{what}"
        );
    }
    Some(failed.check)
}

/// A pose near a hand's: a wrist moved by up to this many metres and radians, and angles changed by as many radians.
fn perturbed(random: &mut Random, hand: &HandPose, by: f32) -> HandPose {
    let mut wrist = hand.frame_from_wrist;
    let turn = Quat::from_axis_angle(random.direction(), random.between(0.0, by));
    wrist.position += random.direction() * random.between(0.0, 0.1 * by);
    wrist.orientation = (turn * wrist.orientation).normalize();
    let limits = right().digits.map(|digit| digit.limits);
    let near = |digit: usize| limits[digit].clamped(random.near_angles(hand.digits[digit], by));
    hand_pose(wrist, std::array::from_fn(near))
}

/// The holdout with its giver moved toward the hand, or obstacles or an arm added around it.
fn surrounded(random: &mut Random, holdout: &Holdout, hand: &HandPose) -> Holdout {
    let wrist = hand.frame_from_wrist.position;
    let mut holdout = holdout.clone();
    let giver = holdout
        .presenting_hand
        .as_ref()
        .and_then(|giver| giver.shape.joints())
        .cloned();
    let mut near = |least: f32, most: f32| wrist + random.direction() * random.between(least, most);
    let (place, shoulder) = (near(0.02, 0.15), near(0.3, 0.7));
    match (random.index(6), giver) {
        (0, Some(joints)) => {
            let way = (wrist - joints.joints[0].pose.position) * random.between(0.0, 0.5);
            let moved = joints.transformed(Pose::from_position(way));
            holdout.presenting_hand = Some(PresentingHand::of_joints(moved));
        }
        (1, _) => {
            let end = place + random.direction() * 0.05;
            let ball = TaperedCapsule::new(place, end, 0.01, random.between(0.005, 0.02));
            holdout.obstacles = vec![Obstacle::Capsule(ball)];
        }
        (2, _) => {
            let half = Vec3::new(0.1, 0.05, 0.02);
            let block = oriented_box(Pose::new(place, random.rotation()), half);
            holdout.obstacles = vec![Obstacle::Box(block)];
        }
        (3, _) => holdout.stance = Stance::At(arm(shoulder, 0.3, 0.26)),
        (4, Some(joints)) => {
            let moved = joints.transformed(Pose::from_position(random.direction() * 0.1));
            holdout.other_hands = vec![HandShape::Joints(Box::new(moved))];
        }
        _ => {}
    }
    holdout
}

fn constrained(random: &mut Random, hand: &HandPose) -> Requirements {
    let wrist = hand.frame_from_wrist;
    let mut requirements = Requirements::default();
    match random.index(8) {
        0 => {
            requirements.reach = Some(Reach {
                shoulder: wrist.position + random.direction() * 0.5,
                distance: random.between(0.49, 0.51),
            });
        }
        1 => {
            requirements.approach = Some(ApproachCone {
                axis: (approach_direction(wrist) + 0.5 * random.direction()).normalize_or(Vec3::Y),
                half_angle: 0.4,
            });
        }
        2 => requirements.must_not_touch = DigitSet::from_iter([Digit::ALL[random.index(5)]]),
        3 => requirements.must_touch = DigitSet::from_iter([Digit::ALL[random.index(5)]]),
        4 => requirements.worst_comfort = Some(random.between(0.0, 0.1)),
        5 => {
            let types = (0..12).map(|_| GraspType::ALL[random.index(GraspType::ALL.len())]);
            requirements.excluded_types = types.collect();
        }
        _ => {}
    }
    requirements
}

#[test]
fn a_current_grasp_is_kept_or_fails_as_its_verdicts_say() {
    let mut random = Random::new(41);
    let names = holdouts();
    let mut reasons: Vec<Option<Check>> = Vec::new();
    for (place, holdout) in tracked_holdouts().enumerate() {
        let atlas = shipped_atlas(&names[place].object);
        let found = |seed| {
            guided(&holdout)
                .seed(seed)
                .max_attempts(1_000)
                .grasp()
                .map(|grasp| grasp.pose)
        };
        let mut hands: Vec<HandPose> = (0..2).filter_map(found).collect();
        let found = hands.len();
        for _ in 0..4 {
            let entries = atlas.entries();
            hands.push(entries[random.index(entries.len())].grip.pose);
        }
        for (number, hand) in hands.iter().enumerate() {
            for case in 0..10 {
                let by = [0.0, 1e-5, 0.002, 0.02, 0.3][case % 5];
                let posed = perturbed(&mut random, hand, by);
                // Most grips of an atlas are where the giver is.
                let mut free = holdout.clone();
                if number >= found && case >= 2 {
                    free.presenting_hand = None;
                }
                let mut holdout = surrounded(&mut random, &free, &posed);
                if random.index(12) == 0 {
                    let banned = BannedGrip {
                        handedness: Handedness::Right,
                        object_from_wrist: posed.frame_from_wrist,
                        distance: 0.01,
                        angle: 0.1,
                    };
                    let changed = changed(&holdout.object, |plain| plain.with_banned(vec![banned]));
                    holdout.object = Arc::new(changed);
                }
                let search = guided(&holdout).requirements(constrained(&mut random, &posed));
                let what = format!("holdout {place}, hand {number}, case {case}");
                reasons.push(compared(&search, posed, &what));
            }
        }
    }
    let count = |reason| reasons.iter().filter(|other| **other == reason).count();
    assert!(count(None) >= 100, "{} are kept", count(None));
    for reason in [
        Check::GiverClearance,
        Check::ObstacleClearance,
        Check::Penetration,
        Check::SelfCollision,
        Check::Forbidden,
        Check::Reach,
        Check::Approach,
        Check::Banned,
        Check::Digits,
        Check::Closure,
        Check::GraspType,
        Check::Comfort,
    ] {
        assert!(count(Some(reason)) > 0, "none fails by {reason:?}");
    }
}

#[test]
fn a_hanging_grasp_fails_the_checks_that_its_verdicts_name() {
    let holdout = floating(lunch_box(0.03));
    let hooking = guided(&holdout).requirements(without_thumb()).max_attempts(3_000);
    let grasp = hooking.grasp().expect("it hangs in fingers");
    assert!(grasp.hangs);
    let judged = |requirements| {
        let search = guided(&holdout).requirements(requirements);
        compared(&search, grasp.pose, "a hook")
    };
    assert_eq!(judged(without_thumb()), None);
    let uncomfortable = Requirements {
        worst_comfort: Some(0.5 * grasp.comfort),
        ..without_thumb()
    };
    assert_eq!(judged(uncomfortable), Some(Check::Comfort));
    let no_hook = Requirements {
        excluded_types: TypeSet::from_iter([GraspType::FixedHook]),
        ..without_thumb()
    };
    assert_eq!(judged(no_hook), Some(Check::GraspType));
    let upside_down = Holdout {
        up: Vec3::NEG_Y,
        ..holdout.clone()
    };
    let judged = guided(&upside_down).judge(&grasp.pose);
    assert!(!judged.is_valid() && !judged.grasp.hangs && judged.grasp.score.is_none());
}

#[test]
fn a_committed_hand_that_a_giver_meets_is_opened_and_drawn_back() {
    let atlas = shipped_atlas("scissors");
    for entry in atlas.entries().iter().step_by(29) {
        let hand = entry.grip.pose;
        let mut giver = hand;
        giver.frame_from_wrist.position += Vec3::new(0.01, 0.005, 0.02);
        let holdout = held_by("scissors", &giver);
        let current = CurrentGrasp {
            is_committed: true,
            min_score_gain: Some(0.0),
            ..current(hand)
        };
        let (outcome, verdict) = settled(after(&holdout, &atlas, current).settle());
        assert_eq!(verdict.status, CurrentGraspStatus::Aborted);
        assert_eq!((outcome.end, outcome.grasp), (SearchEnd::Aborted, None));
        let failed = verdict.failed_check.expect("it failed a check");
        assert!(failed.to_string().contains("another person's hand"), "{failed}");
        let back = verdict.withdrawal.expect("there is a pose");
        let [there, here] = [&back, &hand].map(|pose| pose.frame_from_wrist);
        let way = there.position - here.position;
        assert!((way.length() - 0.12).abs() < 1e-4, "{way}");
        assert!(way.dot(approach_direction(here)) < 0.0);
        assert_eq!(there.orientation, here.orientation);
        let bend = |pose: &HandPose| pose.digits[1].base_pitch + pose.digits[1].second_pitch;
        assert!(bend(&back) < bend(&hand) || bend(&hand) < 0.1);
    }
}

#[test]
fn the_absence_of_a_grasp_is_explained_by_limits_or_by_failed_checks_of_known_grips() {
    let atlas = shipped_atlas("scissors");
    let free = floating(Arc::clone(object("scissors")));
    let none = Requirements::default();
    let far = within_reach(Vec3::Y * 3.0, 0.5);
    // A pole through everything.
    let pole = TaperedCapsule::new(Vec3::NEG_Y, Vec3::Y, 0.2, 0.2);
    let buried = Holdout {
        obstacles: vec![Obstacle::Capsule(pole)],
        ..free.clone()
    };
    let heavy = floating(changed(&free.object, |plain| {
        let heavy = plain.with_properties(200.0, Vec3::ZERO, None, &[]);
        heavy.expect("it is sound")
    }));
    for (holdout, requirements, expected) in [
        (&free, far, Check::Reach),
        (&free, none, Check::Time),
        (&buried, none, Check::GiverClearance),
        (&heavy, none, Check::Holdable),
    ] {
        let search = after(holdout, &atlas, current(atlas.entries()[0].grip.pose));
        assert_eq!(search.requirements(requirements).no_grasp_reason(), expected);
    }
}
