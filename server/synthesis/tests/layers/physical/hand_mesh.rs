//! Hands of which only the mesh is known, against the ball that the mesh is.

use std::sync::Arc;

use glam::{Quat, Vec3};
use grasp_cases::cases;
use grasp_synthesis::{
    base::pose::Pose,
    geometry::mesh::TriangleMesh,
    model::{
        hand::{HandPose, joints::HandJoints, mesh::HandMesh},
        holdout::{HandShape, Holdout, PresentingHand},
    },
    physical::{
        scene::Presented,
        solids::{HandSolids, Spheres, TaperedCapsule, TrackedSolids},
    },
};

use crate::fixtures::{
    hands::right,
    holdouts::UP,
    meshes::{moved, sheet, sphere},
    objects::object,
    random::Random,
};

/// More than the distance of the mesh's faces from the ball, in metres.
const SLACK: f32 = 1e-4;

/// A ball around a point.
fn ball_at(centre: Vec3, radius: f32) -> TriangleMesh {
    let ball = sphere(radius, 40);
    let from = ball.aabb().centre();
    moved(&ball, Quat::IDENTITY, centre - from)
}

fn holdout(giver: HandMesh, other: Option<HandMesh>) -> Holdout {
    let giver = PresentingHand::of_mesh(Arc::new(giver));
    let mut holdout = Holdout::new(object("remote").clone(), Some(giver), UP).expect("up is a unit vector");
    holdout.other_hands = other
        .into_iter()
        .map(|mesh| HandShape::Mesh(Arc::new(mesh)))
        .collect();
    holdout
}

#[test]
fn clearances_and_verdicts_match_the_ball() {
    let mut random = Random::new(17);
    let (mut clear, mut blocked, mut screened) = (0, 0, 0);
    let count = cases(600);
    for case in 0..count {
        let radius = random.between(0.01, 0.04);
        let centres = [0.08 * random.in_cube(), 0.08 * random.in_cube()];
        let mesh = |centre: Vec3| HandMesh::new(ball_at(centre, radius), None);
        let [first, second] = centres;
        let both = case % 2 == 0;
        let presented = Presented::of(&holdout(mesh(first), both.then(|| mesh(second))));
        let barriers = presented.barriers();
        let pose = HandPose {
            frame_from_wrist: Pose::new(0.12 * random.in_cube(), random.rotation()),
            digits: random.angles(right()),
        };
        let receiver = TrackedSolids::of_joints(&HandJoints::of_pose(right(), &pose));
        let balls = &centres[..if both { 2 } else { 1 }];
        let least = balls
            .iter()
            .map(|&centre| TaperedCapsule::new(centre, centre, radius, radius))
            .flat_map(|ball| receiver.iter().map(move |ours| ours.distance(&ball)))
            .fold(f32::INFINITY, f32::min);
        for required in [0.0, 0.001, 0.02] {
            if (least - required).abs() < SLACK {
                continue;
            }
            let clearances = barriers.clearances(&receiver, required);
            assert_eq!(clearances.is_some(), least >= required, "case {case}: {least}");
            assert_eq!(
                barriers.comes_within(receiver.iter(), required),
                least < required,
                "case {case}: {least}"
            );
            let bounded = barriers.least_distance(receiver.iter(), required + 0.005, required);
            assert_eq!(bounded.is_some(), least >= required, "case {case}: {least}");
            let Some(clearances) = clearances else {
                blocked += 1;
                continue;
            };
            clear += 1;
            let found = clearances.hands.expect("there is a hand");
            assert!((found - least).abs() < SLACK, "case {case}: {found}, not {least}");
        }
        let HandSolids { phalanges, .. } = receiver.hand;
        let links = phalanges.as_flattened();
        let spheres = Spheres::new(|i| (links[i].at(0.5), links[i].radius_at(0.5)));
        if barriers.any_certainly_within(&spheres, 0.001) {
            screened += 1;
            assert!(least < 0.001, "case {case}: {least}");
        }
    }
    // Of a few cases, one less than their share may be screened.
    let few = u32::from(count < 600);
    assert!(
        6 * clear > count && 6 * blocked > count && screened + few > count / 20,
        "{clear} clear, {blocked} blocked, {screened} screened"
    );
}

#[test]
fn a_hand_without_volume_is_kept_clear_of_as_well() {
    let presented = Presented::of(&holdout(HandMesh::new(sheet(0.1, 0.0, 8), None), None));
    let ball = |height: f32| {
        let centre = Vec3::new(0.013, height, 0.027);
        TaperedCapsule::new(centre, centre, 0.01, 0.01)
    };
    let nears = |height: f32| presented.barriers().comes_within([ball(height)].iter(), 0.001);
    assert!(nears(0.005) && nears(-0.005) && nears(0.0109));
    assert!(!nears(0.0112) && !nears(-0.0112));
}

#[test]
fn where_the_receiver_stands_follows_from_the_wrist_alone() {
    let mesh = sphere(0.03, 10);
    let wrist = Pose::new(Vec3::new(0.0, 0.0, -0.1), Quat::from_rotation_y(2.9));
    let with = Presented::of(&holdout(HandMesh::new(mesh.clone(), Some(wrist)), None));
    let without = Presented::of(&holdout(HandMesh::new(mesh, None), None));
    assert!(with.receiver.is_expected());
    assert!(!without.receiver.is_expected());
    // The palm is in front of the wrist.
    let palm = with.giver_palm.expect("there is a giver");
    assert!(
        palm.distance(wrist.transform_point(Vec3::NEG_Z * 0.08)) < 1e-6,
        "{palm}"
    );
}
