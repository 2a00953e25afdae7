//! Further hands and obstacles over real gRPC: no answer runs into them, as measured here with code of the test's own on
//! nothing but the joints and radii of requests and answers.

use std::{fmt::Write as _, time::Duration};

use glam::{Quat, Vec3};
use grasp_assets::hands::hand;
use grasp_cases::cases;
use grasp_client::GraspClient;
use grasp_proto::v1::{self, presenting_hand::Form, shape::Kind};
use grasp_synthesis::{
    base,
    model::hand::{self as synthesis, DigitAngles, HandPose, joints},
};
use grasp_tests::{TestServer, recorded::data_folder_or_skip, wire_pose};

use crate::{
    fixtures::unaided,
    parts::{hand as hand_of, reproducible, with},
};

/// How deep capsules around joints may overlap, in metres: they are at most a millimetre thicker than what is kept clear
/// of.
const TOLERANCE: f32 = 0.001;

/// Requests per object and setting.
const SEEDS: u32 = 40;

/// Steps along a capsule's axis at which this test measures.
const STEPS: u16 = 40;

/// The joints of each digit from its metacarpal to its tip, in the order of `OpenXR`.
const DIGITS: [std::ops::RangeInclusive<usize>; 5] = [2..=5, 6..=10, 11..=15, 16..=20, 21..=25];

/// A box by its name, half its edge lengths in metres, and its mass in kilograms.
type BoxObject = (&'static str, Vec3, f32);

/// What a giver holds with two hands.
const TWO_HANDED: [BoxObject; 3] = [
    ("book", Vec3::new(0.075, 0.015, 0.11), 0.45),
    ("stick", Vec3::new(0.3, 0.0125, 0.0125), 0.3),
    ("pizza-box", Vec3::new(0.165, 0.02, 0.165), 0.6),
];

/// What lies on a table or stands in a shelf.
const RESTING: [BoxObject; 3] = [
    ("stick", Vec3::new(0.3, 0.0125, 0.0125), 0.3),
    ("paperback", Vec3::new(0.055, 0.0125, 0.09), 0.2),
    ("carton", Vec3::new(0.035, 0.1, 0.035), 1.0),
];

/// A box's surface as OBJ text.
fn box_obj(half: Vec3) -> Vec<u8> {
    let mut text = String::new();
    for corner in 0..8 {
        let side = |axis: u8| if corner >> axis & 1 == 1 { 1.0 } else { -1.0 };
        let Vec3 { x, y, z } = half * Vec3::new(side(0), side(1), side(2));
        let _ = writeln!(text, "v {x} {y} {z}");
    }
    text += "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n";
    text.into_bytes()
}

async fn create(client: &GraspClient, name: &str, half: Vec3, mass: f32) -> String {
    let object = v1::CreateObjectRequest::new(name, box_obj(half), mass);
    let created = client.create_object(&object).await;
    created.expect("the box can be created").name
}

/// A hand around the end of an object on the x axis: palm up below it, the fingers pointing inward and the thumb up.
/// `side` is -1 for a left hand at the low end and 1 for a right hand at the high end.
fn giver(side: f32, half: Vec3) -> v1::HandJoints {
    let handedness = if side < 0.0 {
        synthesis::Handedness::Left
    } else {
        synthesis::Handedness::Right
    };
    let rig = &hand("adult", handedness).expect("it is built in").rig;
    let bent = DigitAngles {
        base_pitch: 0.2,
        second_pitch: 0.3,
        third_pitch: 0.2,
        base_yaw: 0.0,
    };
    // OpenXR's -Z points to the fingertips and +Y out of the back of the hand.
    let ahead = Vec3::X * -side;
    let back = Vec3::NEG_Y;
    let orientation = Quat::from_mat3(&glam::Mat3::from_cols(back.cross(-ahead), back, -ahead));
    let wrist = Vec3::new(side * (half.x.min(0.12) + 0.08), -half.y - 0.025, 0.0);
    let pose = HandPose {
        frame_from_wrist: joints::thesis_from_openxr_frame(base::pose::Pose::new(wrist, orientation)),
        digits: [bent; 5],
    };
    let posed = joints::HandJoints::of_pose(rig, &pose);
    let handedness = if side < 0.0 {
        v1::Handedness::Left
    } else {
        v1::Handedness::Right
    };
    let joints = posed.joints.iter();
    let joints: Vec<_> = joints
        .map(|joint| v1::JointPose::new(wire_pose(joint.pose), joint.radius))
        .collect();
    v1::HandJoints::new(handedness, joints)
}

/// Balls along the bones of a hand: centres and radii.
fn balls(joints: &[v1::JointPose]) -> Vec<(Vec3, f32)> {
    let mut balls = Vec::new();
    let mut fill = |[a, b]: [(Vec3, f32); 2]| {
        for step in 0..=STEPS {
            let share = f32::from(step) / f32::from(STEPS);
            balls.push((a.0.lerp(b.0, share), a.1 + (b.1 - a.1) * share));
        }
    };
    let at = |joint: usize| {
        let v1::JointPose { pose, radius } = joints[joint];
        (pose.expect("the hand has all joints").position(), radius)
    };
    for digit in DIGITS {
        let (tip, last) = (*digit.end(), *digit.end() - 1);
        for joint in *digit.start()..last {
            fill([at(joint), at(joint + 1)]);
        }
        // The tip lies on the skin: the last ball ends there.
        let ((start, radius), (end, end_radius)) = (at(last), at(tip));
        let inset = end_radius.min(start.distance(end));
        let end = end - (end - start).normalize_or_zero() * inset;
        fill([(start, radius), (end, end_radius)]);
    }
    for base in [2, 6, 11, 16, 21] {
        fill([at(1), at(base)]);
    }
    balls
}

/// How deep two hands overlap in metres; negative if they are apart.
fn hands_overlap(grasp: &v1::Grasp, other: &v1::HandJoints) -> f32 {
    let theirs = balls(&other.joints);
    let depths = balls(&hand_of(grasp).joints)
        .into_iter()
        .flat_map(|(our, our_radius)| {
            theirs
                .iter()
                .map(move |(their, their_radius)| our_radius + their_radius - our.distance(*their))
        });
    depths.fold(f32::NEG_INFINITY, f32::max)
}

/// How deep a hand is in an obstacle in metres; negative if it is outside.
fn obstacle_overlap(joints: &[v1::JointPose], obstacle: &v1::Shape) -> f32 {
    let distance = |point: Vec3| match obstacle.kind.as_ref().expect("it has a kind") {
        Kind::Box(solid) => {
            let local = solid.pose.unwrap_or_default().inverse().transform_point(point);
            let beyond = local.abs() - solid.half_extents();
            beyond.max(Vec3::ZERO).length() + beyond.max_element().min(0.0)
        }
        Kind::Tube(tube) => {
            let balls: Vec<_> = tube.balls().collect();
            let segments = balls.windows(2).flat_map(|ends| {
                let [(start, start_radius), (end, end_radius)] = [ends[0], ends[1]];
                (0..=200).map(|step| step as f32 / 200.0).map(move |share| {
                    let ball = start.lerp(end, share);
                    ball.distance(point) - (start_radius + (end_radius - start_radius) * share)
                })
            });
            segments.fold(f32::INFINITY, f32::min)
        }
        Kind::HalfSpace(_) => panic!("no request has one"),
    };
    let depths = balls(joints)
        .into_iter()
        .map(|(centre, radius)| radius - distance(centre));
    depths.fold(f32::NEG_INFINITY, f32::max)
}

/// Fails if an answer runs into a hand or an obstacle of its request, or misstates its distance.
fn assert_is_clear(context: &str, request: &v1::FindGraspRequest, grasp: &v1::Grasp) {
    let holdout = request.holdout.as_ref().expect("a request has a holdout");
    let hands = holdout.presenting_hand.iter().chain(&holdout.other_hands);
    let mut nearest = f32::INFINITY;
    for (place, other) in hands.enumerate() {
        let Some(Form::Joints(other)) = &other.form else {
            panic!("{context}: this test sends joints");
        };
        let depth = hands_overlap(grasp, other);
        assert!(depth < TOLERANCE, "{context}: {depth} m deep in hand {place}");
        nearest = nearest.min(-depth);
    }
    match grasp.margin(v1::Check::GiverClearance) {
        // Palms are fuller than their bones.
        Some(clearance) => assert!(
            clearance >= 0.001 && clearance <= nearest + TOLERANCE,
            "{context}: {clearance}, measured {nearest}"
        ),
        None => assert_eq!(nearest, f32::INFINITY, "{context}"),
    }
    let mut nearest = f32::INFINITY;
    for (place, obstacle) in holdout.obstacles.iter().enumerate() {
        let depth = obstacle_overlap(&hand_of(grasp).joints, obstacle);
        assert!(depth < TOLERANCE, "{context}: {depth} m deep in obstacle {place}");
        nearest = nearest.min(-depth);
    }
    match grasp.margin(v1::Check::ObstacleClearance) {
        Some(clearance) => assert!(
            clearance > 0.0 && clearance <= nearest + TOLERANCE,
            "{context}: {clearance}, measured {nearest}"
        ),
        None => assert!(holdout.obstacles.is_empty(), "{context}"),
    }
}

/// A request that two hands hold an object's ends.
fn held_by_two(object: &str, half: Vec3) -> v1::FindGraspRequest {
    v1::FindGraspRequest::new(object)
        .with_hand(giver(-1.0, half))
        .with_hand(giver(1.0, half))
}

/// An object that lies on a wide table; up is y.
fn on_table(half: Vec3) -> v1::Shape {
    let centre = Vec3::new(0.0, -half.y - 0.5, 0.0);
    v1::Shape::solid_box(v1::Pose::new(centre, Quat::IDENTITY), Vec3::new(20.0, 0.5, 20.0))
}

/// A shelf around an object: a floor, a back and two sides, open in front (+z) and above.
fn in_shelf(half: Vec3) -> Vec<v1::Shape> {
    let wall = |centre: Vec3, size: Vec3| v1::Shape::solid_box(v1::Pose::new(centre, Quat::IDENTITY), size);
    let side = |sign: f32| {
        wall(
            Vec3::new(sign * (half.x + 0.16), 0.2, 0.0),
            Vec3::new(0.01, 0.3, 0.2),
        )
    };
    vec![
        on_table(half),
        wall(Vec3::new(0.0, 0.2, -half.z - 0.06), Vec3::new(0.3, 0.3, 0.01)),
        side(-1.0),
        side(1.0),
    ]
}

/// Longest search.
const BUDGET: Duration = Duration::from_secs(10);

async fn ask(client: &GraspClient, request: &v1::FindGraspRequest) -> v1::FindGraspResponse {
    client.find_grasp(request).await.expect("the request is valid")
}

/// The grasp of an answer that has one.
fn grasp_of(answer: v1::FindGraspResponse, context: &str) -> v1::Grasp {
    let v1::FindGraspResponse { grasps, report, .. } = answer;
    let grasp = grasps.into_iter().next();
    grasp.unwrap_or_else(|| panic!("{context}: {report:?}"))
}

#[tokio::test(flavor = "multi_thread")]
async fn answers_keep_clear_of_both_hands_of_a_giver() {
    let server = TestServer::start().await;
    let client = server.client().await;
    for (name, half, mass) in TWO_HANDED {
        let object = create(&client, name, half, mass).await;
        // The second hand matters: without it, answers run into it.
        let second = giver(1.0, half);
        let mut collisions = 0;
        for seed in 0..u64::from(cases(SEEDS)) {
            let request = held_by_two(&object, half).with_seed(seed).with_budget(BUDGET);
            let request = unaided(request);
            let context = format!("{name}, seed {seed}");
            let grasp = grasp_of(ask(&client, &request).await, &context);
            assert_is_clear(&context, &request, &grasp);

            let one_handed = with(request, |request| request.holdout_mut().other_hands.clear());
            let grasp = grasp_of(ask(&client, &one_handed).await, &context);
            collisions += usize::from(hands_overlap(&grasp, &second) > TOLERANCE);
        }
        assert!(collisions > 0, "{name}: the second hand is in nobody's way");
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn answers_keep_clear_of_tables_and_shelves() {
    let server = TestServer::start().await;
    let client = server.client().await;
    for (name, half, mass) in RESTING {
        let object = create(&client, name, half, mass).await;
        for (setting, obstacles) in [("table", vec![on_table(half)]), ("shelf", in_shelf(half))] {
            for seed in 0..u64::from(cases(SEEDS)) {
                let request = v1::FindGraspRequest::new(&object)
                    .with_seed(seed)
                    .with_budget(BUDGET);
                let request = with(unaided(request), |request| {
                    request.holdout_mut().obstacles.clone_from(&obstacles);
                    request.output_mut().key_frames = seed % 8 == 0;
                });
                let context = format!("{name}, {setting}, seed {seed}");
                let grasp = grasp_of(ask(&client, &request).await, &context);
                assert_is_clear(&context, &request, &grasp);
                for (key_frame, obstacle) in grasp
                    .key_frames
                    .iter()
                    .flat_map(|frame| obstacles.iter().map(move |obstacle| (frame, obstacle)))
                {
                    let hand = key_frame.hand.as_ref().expect("a key frame has a hand");
                    let depth = obstacle_overlap(&hand.joints, obstacle);
                    assert!(depth < TOLERANCE, "{context}: {depth} m, {:?}", key_frame.kind());
                }
            }
        }
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn known_grips_that_run_into_barriers_are_not_returned() {
    let server = TestServer::start_with(|config| config.builder_threads = 1).await;
    let client = server.client().await;
    let half = client
        .get_object("objects/remote")
        .await
        .expect("built in")
        .bounding_box
        .expect("an object has a box")
        .half_extents();
    let name = "objects/remote";
    crate::atlases::state(&server, name, 100).await;
    // A table under the remote whichever way its box lies, a pole through its middle, and a hand at either end.
    let reach = half.length();
    let table = v1::Shape::solid_box(
        v1::Pose::new(Vec3::new(0.0, -reach - 0.4, 0.0), Quat::IDENTITY),
        Vec3::new(20.0, 0.5, 20.0),
    );
    let pole = v1::Shape::capsule(Vec3::new(0.0, 0.0, -1.0), Vec3::new(0.0, 0.0, 1.0), 0.01);
    let settings = [
        v1::FindGraspRequest::new(name).with_obstacle(table.clone()),
        v1::FindGraspRequest::new(name).with_obstacle(pole),
        held_by_two(name, half),
        held_by_two(name, half).with_obstacle(table),
    ];
    let mut sources = [0; 3];
    for (place, setting) in settings.into_iter().enumerate() {
        for seed in 0..u64::from(cases(SEEDS)) {
            for choice in [
                v1::GraspChoice::FirstValid,
                v1::GraspChoice::Reproducible,
                v1::GraspChoice::BestWithinBudget,
            ] {
                let request = with(setting.clone().with_seed(seed), |request| {
                    request.search_mut().choice = choice.into();
                });
                let request = match choice {
                    v1::GraspChoice::BestWithinBudget => request,
                    _ => request.with_budget(BUDGET),
                };
                let context = format!("setting {place}, seed {seed}, {choice:?}");
                let answer = ask(&client, &request).await;
                let source = answer.source();
                assert_is_clear(&context, &request, &grasp_of(answer, &context));
                match source {
                    v1::GraspSource::Search => sources[0] += 1,
                    v1::GraspSource::Atlas => sources[1] += 1,
                    v1::GraspSource::Learned => sources[2] += 1,
                    other => panic!("{context}: the object has no grips of its own: {other:?}"),
                }
            }
        }
    }
    assert!(sources[1] > 0, "no answer was a known grip: {sources:?}");
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn obstacles_do_not_change_with_the_number_of_workers() {
    let (name, half, mass) = TWO_HANDED[0];
    let mut grasps = Vec::new();
    for workers in [1, 3] {
        let server = TestServer::start_with(|config| config.workers = workers.try_into().unwrap()).await;
        let client = server.client().await;
        let object = create(&client, name, half, mass).await;
        let request = held_by_two(&object, half)
            .with_obstacle(on_table(half + Vec3::Y * 0.1))
            .with_seed(4)
            .with_budget(BUDGET);
        let answer = ask(&client, &reproducible(request)).await;
        let attempt = answer.origin.as_ref().expect("it has an origin").attempt;
        grasps.push((grasp_of(answer, name), attempt));
        server.stop().await;
    }
    assert_eq!(grasps[0], grasps[1]);
}

/// A hand of 26 joints from a report's JSON, which leaves out zeros.
fn hand_from_json(hand: &serde_json::Value) -> v1::HandJoints {
    let number = |value: &serde_json::Value, key: &str| value[key].as_f64().unwrap_or(0.0) as f32;
    let joints = hand["joints"].as_array().expect("a hand has joints");
    let handedness = match hand["handedness"].as_str() {
        Some("HANDEDNESS_LEFT") => v1::Handedness::Left,
        Some("HANDEDNESS_RIGHT") => v1::Handedness::Right,
        other => panic!("{other:?}"),
    };
    let joints: Vec<_> = joints
        .iter()
        .map(|joint| {
            let (p, q) = (
                &joint["clientFromJoint"]["position"],
                &joint["clientFromJoint"]["orientation"],
            );
            let [x, y, z] = ["x", "y", "z"].map(|key| number(p, key));
            let orientation = ["x", "y", "z", "w"].map(|key| number(q, key));
            let pose = v1::Pose::new(Vec3::new(x, y, z), Quat::from_array(orientation));
            v1::JointPose::new(pose, number(joint, "radius"))
        })
        .collect();
    v1::HandJoints::new(handedness, joints)
}

#[tokio::test(flavor = "multi_thread")]
async fn a_book_that_a_real_giver_holds_with_both_hands_is_taken_clear_of_both() {
    let Some(folder) =
        data_folder_or_skip("a_book_that_a_real_giver_holds_with_both_hands_is_taken_clear_of_both")
    else {
        return;
    };
    let folder = folder.join("reports/two-handed-giver");
    let read = |file: &str| std::fs::read(folder.join(file));
    let (Ok(obj), Ok(find), Ok(second)) = (read("t2-book2.obj"), read("find.json"), read("second_hand.json"))
    else {
        eprintln!("SKIPPED: {} does not exist", folder.display());
        return;
    };
    let find: serde_json::Value = serde_json::from_slice(&find).expect("it is JSON");
    let second: serde_json::Value = serde_json::from_slice(&second).expect("it is JSON");
    let server = TestServer::start().await;
    let client = server.client().await;
    let book = client
        .create_object(&v1::CreateObjectRequest::new("book", obj, 0.45))
        .await
        .expect("the book can be created");
    for seed in 0..u64::from(cases(SEEDS)) {
        let request = v1::FindGraspRequest::new(&book.name)
            .with_seed(100 + seed)
            .with_budget(BUDGET)
            .with_hand(hand_from_json(&find["presentingHand"]["joints"]))
            .with_hand(hand_from_json(&second));
        let request = with(unaided(request), |request| {
            request.holdout_mut().up = Some(Vec3::Z.into());
        });
        let context = format!("seed {seed}");
        let grasp = grasp_of(ask(&client, &request).await, &context);
        assert_is_clear(&context, &request, &grasp);
    }
    server.stop().await;
}
