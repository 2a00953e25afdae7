//! Barriers against the distances of all pairs of solids.

use glam::Vec3;
use grasp_synthesis::{
    base::pose::Pose,
    geometry::oriented_box::OrientedBox,
    model::{
        hand::{HandPose, joints::HandJoints},
        holdout::{HandShape, Holdout, PresentingHand},
        obstacle::Obstacle,
    },
    physical::{
        scene::Presented,
        solids::{HandSolids, Spheres, TaperedCapsule, TrackedSolids},
    },
};

use crate::fixtures::{hands::right, holdouts::UP, objects::object, random::Random};

/// How much closer than other hands obstacles may be, in metres.
const CLOSER: f32 = 0.0009;

fn any_hand(random: &mut Random, spread: f32) -> HandJoints {
    let pose = HandPose {
        frame_from_wrist: Pose::new(random.in_cube() * spread, random.rotation()),
        digits: random.angles(right()),
    };
    HandJoints::of_pose(right(), &pose)
}

fn any_obstacle(random: &mut Random, spread: f32) -> Obstacle {
    let place = random.in_cube() * spread;
    if random.index(2) == 0 {
        Obstacle::Capsule(TaperedCapsule::new(
            place,
            place + random.direction() * random.between(0.0, 0.3),
            random.between(0.005, 0.05),
            random.between(0.005, 0.05),
        ))
    } else {
        Obstacle::Box(OrientedBox {
            object_from_box: Pose::new(place, random.rotation()),
            half_extents: Vec3::splat(0.01) + random.in_cube().abs() * 0.2,
        })
    }
}

/// Distance of a solid from an obstacle: the least over many balls along its axis.
fn sampled_distance(obstacle: &Obstacle, solid: &TaperedCapsule) -> f32 {
    (0_u16..=400)
        .map(|i| f32::from(i) / 400.0)
        .map(|along| {
            let at = solid.at(along);
            let distance = match obstacle {
                Obstacle::Capsule(capsule) => capsule.signed_distance(at),
                Obstacle::Box(solid_box) => solid_box.signed_distance(at),
            };
            distance - solid.radius_at(along)
        })
        .fold(f32::INFINITY, f32::min)
}

#[test]
fn clearances_and_verdicts_match_all_pairs() {
    let mut random = Random::new(61);
    let (mut clear, mut blocked, mut screened) = (0, 0, 0);
    for case in 0..600 {
        let hands: Vec<HandJoints> = (0..random.index(4))
            .map(|_| any_hand(&mut random, 0.25))
            .collect();
        let obstacles: Vec<Obstacle> = (0..random.index(4))
            .map(|_| any_obstacle(&mut random, 0.3))
            .collect();
        let mut holdout = Holdout::new(
            object("remote").clone(),
            hands
                .first()
                .map(|first| PresentingHand::of_joints(first.clone())),
            UP,
        )
        .expect("up is a unit vector");
        holdout.other_hands = hands
            .iter()
            .skip(1)
            .cloned()
            .map(Box::new)
            .map(HandShape::Joints)
            .collect();
        holdout.obstacles.clone_from(&obstacles);
        let presented = Presented::of(&holdout);
        let barriers = presented.barriers();
        assert_eq!(barriers.is_empty(), hands.is_empty() && obstacles.is_empty());

        let receiver = TrackedSolids::of_joints(&any_hand(&mut random, 0.25));
        let from_hands = hands
            .iter()
            .map(TrackedSolids::of_joints)
            .flat_map(|hand| hand.iter().copied().collect::<Vec<_>>())
            .flat_map(|theirs| receiver.iter().map(move |ours| ours.distance(&theirs)))
            .reduce(f32::min);
        let from_obstacles = obstacles
            .iter()
            .flat_map(|obstacle| receiver.iter().map(|ours| sampled_distance(obstacle, ours)))
            .reduce(f32::min);
        let least = from_hands
            .into_iter()
            .chain(from_obstacles.map(|distance| distance + CLOSER))
            .fold(f32::INFINITY, f32::min);
        // Half a step of the samples along a forearm.
        let slack = 0.5 * 0.3 / 400.0;
        for required in [-0.01, 0.001, 0.02] {
            if (least - required).abs() < slack {
                continue;
            }
            let clearances = barriers.clearances(&receiver, required);
            assert_eq!(clearances.is_some(), least >= required, "case {case}: {least}");
            assert_eq!(
                barriers.comes_within(receiver.iter(), required),
                least < required,
                "case {case}: {least}"
            );
            let enough = required + 0.005;
            let bounded = barriers.least_distance(receiver.iter(), enough, required);
            assert_eq!(bounded.is_some(), least >= required, "case {case}: {least}");
            if let Some(bounded) = bounded {
                assert!(
                    (bounded - least.min(enough)).abs() < slack,
                    "case {case}: {bounded}"
                );
            }
            let Some(clearances) = clearances else {
                blocked += 1;
                continue;
            };
            clear += 1;
            for (found, expected) in [
                (clearances.hands, from_hands),
                (clearances.obstacles, from_obstacles),
            ] {
                assert_eq!(found.is_some(), expected.is_some(), "case {case}");
                let error = found
                    .zip(expected)
                    .map_or(0.0, |(found, expected)| found - expected);
                assert!(error.abs() < slack, "case {case}: {found:?}, not {expected:?}");
            }
        }

        // Spheres inside the hand: what is certainly near them is near the hand, and their bounds hold.
        let HandSolids { phalanges, .. } = receiver.hand;
        let links = phalanges.as_flattened();
        let spheres = Spheres::new(|i| (links[i].at(0.5), links[i].radius_at(0.5)));
        if barriers.any_certainly_within(&spheres, 0.001) {
            screened += 1;
            assert!(least < 0.001 + slack, "case {case}: {least}");
        }
        let bounds = barriers.distance_upper_bounds(&spheres);
        assert!(
            bounds.iter().all(|&bound| bound >= least - slack),
            "case {case}: {bounds:?}"
        );
    }
    assert!(
        clear > 200 && blocked > 200 && screened > 50,
        "{clear} clear, {blocked} blocked, {screened} screened"
    );
}

#[test]
fn a_table_is_not_touched_by_a_hand_above_it() {
    let mut holdout = Holdout::new(object("remote").clone(), None, UP).expect("up is a unit vector");
    let lowest = holdout.object.surface.mesh().aabb().min.y;
    holdout.obstacles = vec![Obstacle::Box(OrientedBox {
        object_from_box: Pose::from_position(Vec3::new(0.0, lowest - 0.5, 0.0)),
        half_extents: Vec3::new(5.0, 0.5, 5.0),
    })];
    let presented = Presented::of(&holdout);
    let ball = |height: f32| {
        let centre = Vec3::new(0.1, lowest + height, 0.0);
        TaperedCapsule::new(centre, centre, 0.01, 0.01)
    };
    let nears = |height: f32| presented.barriers().comes_within([ball(height)].iter(), 0.001);
    assert!(nears(-0.3) && nears(0.005) && nears(0.01005));
    assert!(!nears(0.0102));
}
