//! Barriers against the distances of all pairs of solids.

use crate::prelude::*;
use glam::Mat3;
use grasp_synthesis::model::holdout::{ArmPose, HandMesh};
use grasp_synthesis::physical::both_hands::suits_one_body;
use grasp_synthesis::physical::receiver::{Receiver, SUITABLE};

/// How much closer than other hands obstacles may be, in metres.
const CLOSER: f32 = 0.0009;

/// A hand by its joints, or by a mesh alone, which is a ball; and its solids.
fn any_presenting(random: &mut Random, is_ball: bool) -> (PresentingHand, Vec<TaperedCapsule>) {
    if is_ball {
        let (centre, radius) = (random.in_cube() * 0.08, random.between(0.01, 0.04));
        let mesh = Parts::default().sphere(centre, radius, 40, true).mesh();
        let ball = TaperedCapsule::new(centre, centre, radius, radius);
        return (
            PresentingHand::of_mesh(Arc::new(HandMesh::new(mesh, None))),
            vec![ball],
        );
    }
    let joints = any_hand(random);
    let solids = TrackedSolids::of_joints(&joints).iter().copied().collect();
    (PresentingHand::of_joints(joints), solids)
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
        let (mut hands, solids): (Vec<_>, Vec<_>) = (0..random.index(4))
            .map(|_| any_presenting(&mut random, has_balls))
            .unzip();
        let mut holdout = floating(Arc::clone(object("remote")));
        holdout.presenting_hand = hands.pop();
        holdout.other_hands = hands.into_iter().map(|hand| hand.shape).collect();
        holdout.obstacles = (0..random.index(4)).map(|_| any_obstacle(&mut random)).collect();
        let presented = Presented::of(&holdout);
        let barriers = presented.barriers();
        let obstacles = &holdout.obstacles;
        assert_eq!(barriers.is_empty(), solids.is_empty() && obstacles.is_empty());

        let receiver = TrackedSolids::of_joints(&any_hand(&mut random));
        let from_hands =
            (!solids.is_empty()).then(|| pair_distance(receiver.iter(), solids.iter().flatten()));
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

        // Spheres inside the hand: a solid certainly near them is near the hand, and their bounds hold.
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

fn ball(centre: Vec3) -> TaperedCapsule {
    TaperedCapsule::new(centre, centre, 0.01, 0.01)
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

const BONES: [f32; 2] = [0.3, 0.26];

/// A wrist at a point whose straight forearm goes in a direction, with the palm about up or down.
fn wrist(position: Vec3, forearm: Vec3, roll: f32) -> Pose {
    let arc = Quat::from_rotation_arc(Vec3::NEG_Y, forearm.normalize_or(Vec3::Z));
    Pose::new(
        position,
        Quat::from_axis_angle(forearm.normalize_or(Vec3::Z), roll) * arc,
    )
}

/// The joint frame of a giver's wrist at a point, with a forearm in a direction.
fn giver(position: Vec3, forearm: Vec3) -> Pose {
    openxr_from_thesis_frame(wrist(position, forearm, 0.3))
}

fn reached(receiver: &Receiver, handedness: Handedness, wrist: Pose) -> Option<ArmPose> {
    static FAR_AWAY: LazyLock<GraspObject> = LazyLock::new(|| object_of(sphere(0.01, 6), &[]));
    receiver.arm(adult(handedness), wrist, &FAR_AWAY.surface, Barriers::NONE)
}

#[test]
fn hands_from_opposite_a_known_giver_suit_and_those_from_the_givers_side_do_not() {
    let mut random = Random::new(3);
    for _ in 0..200 {
        let azimuth = Quat::from_axis_angle(UP, random.between(-3.0, 3.0));
        let forearm = azimuth * Vec3::new(0.0, random.between(-0.5, 0.5), 1.0).normalize_or(Vec3::Z);
        let hand = giver(forearm * 0.1, forearm);
        let receiver = Receiver::new(Stance::Facing, Some(hand), Vec3::ZERO, UP);
        let away = -(azimuth * Vec3::Z);
        assert!(receiver.suits_forearm(away) > 0.8, "{forearm}");
        assert!(receiver.suits_forearm(forearm) == 0.0, "{forearm}");
        let aside = azimuth * Vec3::X;
        assert!(receiver.suits_forearm(aside) < receiver.suits_forearm(away));
        for unknown in [
            Receiver::new(Stance::Facing, None, Vec3::ZERO, UP),
            Receiver::new(Stance::Any, Some(hand), Vec3::ZERO, UP),
        ] {
            assert!(!unknown.is_expected());
            assert_eq!(unknown.suits_forearm(forearm), 1.0);
        }
    }
}

#[test]
fn reached_arms_have_their_bones_lengths_and_bend_the_wrist_within_its_range() {
    let mut random = Random::new(7);
    let mut count = 0;
    for _ in 0..600 {
        let shoulder = Vec3::new(random.between(-0.3, 0.3), random.between(0.0, 0.4), 0.5);
        let at = Vec3::new(5.0, 0.0, 0.0);
        let pose = wrist(at, random.direction(), random.between(-3.0, 3.0));
        let receiver = Receiver::new(Stance::At(arm(at + shoulder, BONES[0], BONES[1])), None, at, UP);
        let handedness = [Handedness::Left, Handedness::Right][random.index(2)];
        let arm = reached(&receiver, handedness, pose);
        assert_eq!(arm.is_some(), receiver.reaches(adult(handedness), pose));
        let Some(arm) = arm else { continue };
        count += 1;
        assert!((arm.elbow.distance(arm.shoulder) - BONES[0]).abs() < 1e-4);
        assert!((arm.elbow.distance(pose.position) - BONES[1]).abs() < 1e-4);
        // The angles lead from the wrist back to the elbow: flexion about x, deviation to the little finger's side.
        let little = -thumb_side(handedness);
        let (bent, along) = arm.deviation.sin_cos();
        let back = Vec3::new(
            little * bent,
            -along * arm.flexion.cos(),
            along * arm.flexion.sin(),
        );
        let elbow = pose.transform_point(back * BONES[1]);
        assert!(elbow.distance(arm.elbow) < 1e-4, "{arm:?}");
        let degrees = [arm.flexion, arm.deviation].map(f32::to_degrees);
        assert!((-70.1..=80.1).contains(&degrees[0]) && (-20.1..=30.1).contains(&degrees[1]));
        assert!(!arm.is_assumed);
    }
    assert!(count > 60, "{count}");
}

#[test]
fn a_wrist_out_of_reach_does_not_suit_and_one_within_suits_as_its_forearm_does() {
    let mut random = Random::new(13);
    let rig = adult(Handedness::Right);
    let (mut within, mut beyond) = (0, 0);
    for _ in 0..600 {
        let at = Vec3::new(0.0, 0.0, 5.0);
        let hand = giver(at + Vec3::Z * 0.1, Vec3::Z);
        let receiver = Receiver::new(Stance::Facing, Some(hand), at, UP);
        let forearm = random.direction();
        // Some wrists are beyond the giver's body.
        let pose = wrist(
            at + Vec3::Z * random.between(-0.2, 1.0),
            forearm,
            random.between(-3.0, 3.0),
        );
        let is_reached = reached(&receiver, Handedness::Right, pose).is_some();
        let (suits, of_forearm) = (receiver.suits(rig, pose), receiver.suits_forearm(forearm));
        if is_reached || of_forearm < SUITABLE {
            assert!((suits - of_forearm).abs() < 1e-6);
            within += usize::from(suits >= SUITABLE);
        } else {
            assert!(suits < SUITABLE);
            beyond += 1;
        }
    }
    assert!(within > 20 && beyond > 20, "{within} within, {beyond} beyond");
}

#[test]
fn assumed_elbows_hang_below_the_shoulder_and_rather_outward() {
    let mut random = Random::new(15);
    let mut count = 0;
    for handedness in [Handedness::Left, Handedness::Right] {
        for _ in 0..600 {
            let at = Vec3::new(0.0, 0.0, 5.0);
            // The receiver looks along +Z, so that the right arm is on the side of -X.
            let hand = giver(at + Vec3::Z * 0.1, Vec3::Z);
            let receiver = Receiver::new(Stance::Facing, Some(hand), at, UP);
            let pose = wrist(at - Vec3::Z * 0.1, random.direction(), random.between(-3.0, 3.0));
            let Some(arm) = reached(&receiver, handedness, pose) else {
                continue;
            };
            count += 1;
            assert!(arm.is_assumed && arm.elbow.y <= arm.shoulder.y + 1e-4);
            let toward = (pose.position - arm.shoulder).normalize_or_zero();
            let right = toward.cross(UP).normalize_or_zero();
            let out = (arm.elbow - arm.shoulder).dot(right);
            assert!(thumb_side(handedness) * out > -0.16, "{arm:?}");
        }
    }
    assert!(count > 60, "{count}");
}

#[test]
fn arms_keep_clear_of_the_object() {
    // A ball where the elbow would hang.
    let at = Vec3::new(0.0, 0.0, 5.0);
    let pose = wrist(at, Vec3::new(0.0, -0.2, 1.0), 0.0);
    let arm = arm(at + Vec3::new(0.0, 0.2, 0.45), BONES[0], BONES[1]);
    let receiver = Receiver::new(Stance::At(arm), None, at, UP);
    let rig = adult(Handedness::Right);
    let far = object_of(sphere(0.01, 6), &[]);
    let free = receiver
        .arm(rig, pose, &far.surface, Barriers::NONE)
        .expect("it reaches");
    let ball = object_of(moved(&sphere(0.06, 48), Quat::IDENTITY, free.elbow), &[]);
    let centre = ball.bounding_box.object_from_box.position;
    if let Some(arm) = receiver.arm(rig, pose, &ball.surface, Barriers::NONE) {
        assert!(arm.elbow.distance(centre) > 0.99 * (0.06 + 0.044), "{arm:?}");
    }
}

/// A wrist at `position` whose fingers point along `fingers` and whose palm faces `palm`.
fn wrist_pose(position: Vec3, fingers: Vec3, palm: Vec3) -> Pose {
    let axes = Mat3::from_cols(fingers.cross(palm), fingers, palm);
    Pose::new(position, Quat::from_mat3(&axes))
}

fn suits(right: Pose, left: Pose) -> bool {
    let hands = [
        (&**adult(Handedness::Right), right),
        (&**adult(Handedness::Left), left),
    ];
    let [a, b] = hands;
    assert_eq!(suits_one_body([a, b], UP), suits_one_body([b, a], UP));
    suits_one_body(hands, UP)
}

/// Hands beside the middle; forward is -z, right is +x.
#[test]
fn hands_suit_one_body_as_arms_allow() {
    let at = |x: f32, fingers: Vec3, palm: Vec3| wrist_pose(Vec3::X * x, fingers, palm);
    let (ahead, aside) = (Vec3::NEG_Z, Vec3::X);
    let facing = |x: f32, palm: Vec3| [at(x, ahead, palm), at(-x, ahead, -palm)];
    let below = |right: Vec3, left: Vec3| [at(0.2, right, Vec3::Y), at(-0.2, left, Vec3::Y)];
    let opposite = [at(0.2, ahead, -aside), at(-0.2, -ahead, -aside)];
    let stacked = |splay: f32| {
        [1.0, -1.0].map(|side| {
            let turn = Quat::from_rotation_y(side * splay);
            // The palms are one above the other.
            let place = side * Vec3::new(0.1 * splay.sin(), 0.1, 0.0);
            wrist_pose(place, turn * ahead, turn * -aside * side)
        })
    };
    for (what, [right, left], expected) in [
        ("palms on both sides of a box", facing(0.2, -aside), true),
        ("crossed hands", facing(-0.1, -aside), false),
        ("farther apart than arms reach", facing(0.7, -aside), false),
        ("palms that carry from below", below(ahead, ahead), true),
        ("forearms toward each other", below(-aside, aside), false),
        ("forearms from opposite sides", opposite, false),
        ("thumbs down", facing(0.2, aside), false),
        ("one above the other, elbows apart", stacked(0.4), true),
        ("one above the other, elbows together", stacked(0.0), false),
    ] {
        assert_eq!(suits(right, left), expected, "{what}");
    }
}
