//! Barriers against the distances of all pairs of solids.

use grasp_synthesis::model::holdout::HandMesh;

use crate::prelude::*;

/// How much closer than other hands obstacles may be, in metres.
const CLOSER: f32 = 0.0009;

/// A hand of known joints, or one of which only the mesh is known, which is a ball.
enum Hand {
    Joints(Box<HandJoints>),
    Ball(TaperedCapsule),
}

impl Hand {
    fn any(random: &mut Random, is_ball: bool) -> Self {
        if is_ball {
            let centre = random.in_cube() * 0.08;
            let radius = random.between(0.01, 0.04);
            Self::Ball(TaperedCapsule::new(centre, centre, radius, radius))
        } else {
            Self::Joints(Box::new(any_hand(random)))
        }
    }

    fn presenting(&self) -> PresentingHand {
        match self {
            Self::Joints(joints) => PresentingHand::of_joints((**joints).clone()),
            Self::Ball(ball) => {
                let mesh = Parts::default().sphere(ball.start, ball.start_radius, 40, true);
                PresentingHand::of_mesh(Arc::new(HandMesh::new(mesh.mesh(), None)))
            }
        }
    }

    fn solids(&self) -> Vec<TaperedCapsule> {
        match self {
            Self::Joints(joints) => TrackedSolids::of_joints(joints).iter().copied().collect(),
            Self::Ball(ball) => vec![*ball],
        }
    }
}

fn any_hand(random: &mut Random) -> HandJoints {
    let wrist = Pose::new(random.in_cube() * 0.25, random.rotation());
    HandJoints::of_pose(right(), &hand_pose(wrist, random.angles(right())))
}

fn any_obstacle(random: &mut Random) -> Obstacle {
    let place = random.in_cube() * 0.3;
    if random.index(2) == 0 {
        let end = place + random.direction() * random.between(0.0, 0.3);
        let mut radius = || random.between(0.005, 0.05);
        Obstacle::Capsule(TaperedCapsule::new(place, end, radius(), radius()))
    } else {
        Obstacle::Box(oriented_box(
            Pose::new(place, random.rotation()),
            Vec3::splat(0.01) + random.in_cube().abs() * 0.2,
        ))
    }
}

#[test]
fn clearances_and_verdicts_match_all_pairs() {
    let mut random = Random::new(61);
    let (mut clear, mut blocked, mut screened) = (0, 0, 0);
    for case in 0..600 {
        // Meshes take long to prepare.
        let has_balls = case % 10 == 0;
        let hands: Vec<Hand> = (0..random.index(4))
            .map(|_| Hand::any(&mut random, has_balls))
            .collect();
        let mut holdout = floating(Arc::clone(object("remote")));
        holdout.presenting_hand = hands.first().map(Hand::presenting);
        let others = hands.iter().skip(1);
        holdout.other_hands = others.map(|hand| hand.presenting().shape).collect();
        holdout.obstacles = (0..random.index(4)).map(|_| any_obstacle(&mut random)).collect();
        let presented = Presented::of(&holdout);
        let barriers = presented.barriers();
        let obstacles = &holdout.obstacles;
        assert_eq!(barriers.is_empty(), hands.is_empty() && obstacles.is_empty());

        let receiver = TrackedSolids::of_joints(&any_hand(&mut random));
        let hand_solids: Vec<TaperedCapsule> = hands.iter().flat_map(Hand::solids).collect();
        let from_hands = (!hands.is_empty()).then(|| pair_distance(receiver.iter(), &hand_solids));
        let from_obstacles = obstacles
            .iter()
            .flat_map(|obstacle| receiver.iter().map(|ours| sampled_distance(obstacle, ours)))
            .reduce(f32::min);
        let least = from_hands
            .into_iter()
            .chain(from_obstacles.map(|distance| distance + CLOSER))
            .fold(f32::INFINITY, f32::min);
        // Half a step of the samples along a forearm, or more than the distance of a mesh's faces from the ball.
        let slack = if obstacles.is_empty() {
            1e-4
        } else {
            0.5 * 0.3 / 400.0
        };
        for required in [-0.01, 0.001, 0.02] {
            if (least - required).abs() < slack {
                continue;
            }
            let clearances = barriers.clearances(&receiver, required);
            assert_eq!(clearances.is_some(), least >= required, "case {case}: {least}");
            let is_near = barriers.comes_within(receiver.iter(), required);
            assert_eq!(is_near, least < required, "case {case}: {least}");
            let enough = required + 0.005;
            let bounded = barriers.least_distance(receiver.iter(), enough, required);
            assert_eq!(bounded.is_some(), least >= required, "case {case}: {least}");
            let off = bounded.map_or(0.0, |bounded| bounded - least.min(enough));
            assert!(off.abs() < slack || has_balls, "case {case}: {bounded:?}");
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
                let off = found.zip(expected).map_or(0.0, |(a, b)| a - b);
                assert!(off.abs() < slack, "case {case}: {found:?}, not {expected:?}");
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
        let hold = bounds.iter().all(|&bound| bound >= least - slack);
        assert!(hold, "case {case}: {bounds:?}");
    }
    assert!(
        clear > 200 && blocked > 200 && screened > 50,
        "{clear} clear, {blocked} blocked, {screened} screened"
    );
}

/// A ball of 2 cm around a point.
fn ball(centre: Vec3) -> TaperedCapsule {
    TaperedCapsule::new(centre, centre, 0.01, 0.01)
}

#[test]
fn a_table_is_not_touched_by_a_hand_above_it() {
    let mut holdout = floating(Arc::clone(object("remote")));
    let lowest = holdout.object.surface.mesh().aabb().min.y;
    holdout.obstacles = vec![Obstacle::Box(oriented_box(
        Pose::from_position(Vec3::new(0.0, lowest - 0.5, 0.0)),
        Vec3::new(5.0, 0.5, 5.0),
    ))];
    let presented = Presented::of(&holdout);
    let nears = |height: f32| {
        let ball = ball(Vec3::new(0.1, lowest + height, 0.0));
        presented.barriers().comes_within([ball].iter(), 0.001)
    };
    assert!(nears(-0.3) && nears(0.005) && nears(0.01005));
    assert!(!nears(0.0102));
}

fn held_by_mesh(mesh: TriangleMesh, wrist: Option<Pose>) -> Presented {
    let mut holdout = floating(Arc::clone(object("remote")));
    holdout.presenting_hand = Some(PresentingHand::of_mesh(Arc::new(HandMesh::new(mesh, wrist))));
    Presented::of(&holdout)
}

#[test]
fn a_hand_without_volume_is_kept_clear_of_as_well() {
    let presented = held_by_mesh(sheet(0.1, 0.0, 8), None);
    let nears = |height: f32| {
        let ball = ball(Vec3::new(0.013, height, 0.027));
        presented.barriers().comes_within([ball].iter(), 0.001)
    };
    assert!(nears(0.005) && nears(-0.005) && nears(0.0109));
    assert!(!nears(0.0112) && !nears(-0.0112));
}

#[test]
fn where_the_receiver_stands_follows_from_the_wrist_alone() {
    let wrist = Pose::new(Vec3::new(0.0, 0.0, -0.1), Quat::from_rotation_y(2.9));
    let with = held_by_mesh(sphere(0.03, 10), Some(wrist));
    let without = held_by_mesh(sphere(0.03, 10), None);
    assert!(with.receiver.is_expected() && !without.receiver.is_expected());
    // The palm is in front of the wrist.
    let palm = with.giver_palm.expect("there is a giver");
    let expected = wrist.transform_point(Vec3::NEG_Z * 0.08);
    assert!(palm.distance(expected) < 1e-6, "{palm}");
}
