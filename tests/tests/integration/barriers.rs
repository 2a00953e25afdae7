//! Further hands and obstacles over real gRPC: no answer runs into them, as measured here with code of the test's own on
//! nothing but the joints and radii of requests and answers.

use std::{fmt::Write as _, time::Duration};

use glam::{Quat, Vec3};
use grasp_assets::hands::hand;
use grasp_cases::cases;
use grasp_client::{
    AtlasUse, Choice, FindRequest, Grasp, GraspClient, GraspSource, HandJoints, Handedness, JointPose,
    JointSet, NewObject, Obstacle, Pose, PresentingHand,
};
use grasp_synthesis::{
    base,
    model::hand::{self as synthesis, DigitAngles, HandPose, joints},
};
use grasp_tests::{TestServer, recorded::data_folder_or_skip};

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
    let object = NewObject::new(name, box_obj(half), mass);
    client
        .create_object(&object)
        .await
        .expect("the box can be created")
        .name
}

/// A hand around the end of an object on the x axis: palm up below it, the fingers pointing inward and the thumb up.
/// `side` is -1 for a left hand at the low end and 1 for a right hand at the high end.
fn giver(side: f32, half: Vec3) -> HandJoints {
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
    HandJoints {
        handedness: if side < 0.0 {
            Handedness::Left
        } else {
            Handedness::Right
        },
        joint_set: JointSet::OpenXr26,
        joints: posed
            .joints
            .iter()
            .map(|joint| JointPose {
                client_from_joint: Pose::new(joint.pose.position, joint.pose.orientation),
                radius: joint.radius,
            })
            .collect(),
    }
}

/// Balls along the bones of a hand: centres and radii.
fn balls(joints: &[JointPose]) -> Vec<(Vec3, f32)> {
    let mut balls = Vec::new();
    let mut fill = |[a, b]: [(Vec3, f32); 2]| {
        for step in 0..=STEPS {
            let share = f32::from(step) / f32::from(STEPS);
            balls.push((a.0.lerp(b.0, share), a.1 + (b.1 - a.1) * share));
        }
    };
    let at = |joint: usize| (joints[joint].client_from_joint.position, joints[joint].radius);
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
fn hands_overlap(grasp: &Grasp, other: &HandJoints) -> f32 {
    let theirs = balls(&other.joints);
    let depths = balls(&grasp.joints).into_iter().flat_map(|(our, our_radius)| {
        theirs
            .iter()
            .map(move |(their, their_radius)| our_radius + their_radius - our.distance(*their))
    });
    depths.fold(f32::NEG_INFINITY, f32::max)
}

/// How deep a hand is in an obstacle in metres; negative if it is outside.
fn obstacle_overlap(joints: &[JointPose], obstacle: &Obstacle) -> f32 {
    let distance = |point: Vec3| match obstacle {
        Obstacle::Box(solid) => {
            let local = solid.client_from_box.inverse().transform_point(point);
            let beyond = local.abs() - solid.half_extents;
            beyond.max(Vec3::ZERO).length() + beyond.max_element().min(0.0)
        }
        Obstacle::Capsule(capsule) => {
            let end_radius = capsule.end_radius.unwrap_or(capsule.radius);
            let along = (0..=200).map(|step| step as f32 / 200.0).map(|share| {
                let ball = capsule.client_start.lerp(capsule.client_end, share);
                ball.distance(point) - (capsule.radius + (end_radius - capsule.radius) * share)
            });
            along.fold(f32::INFINITY, f32::min)
        }
    };
    let depths = balls(joints)
        .into_iter()
        .map(|(centre, radius)| radius - distance(centre));
    depths.fold(f32::NEG_INFINITY, f32::max)
}

/// Fails if an answer runs into a hand or an obstacle of its request, or misstates its distance.
fn assert_is_clear(context: &str, request: &FindRequest, grasp: &Grasp) {
    let margins = grasp.margins.expect("a physical grasp has margins");
    let hands = request.presenting_hand.iter().chain(&request.other_hands);
    let mut nearest = f32::INFINITY;
    for (place, other) in hands.enumerate() {
        let PresentingHand::Joints(other) = other else {
            panic!("{context}: this test sends joints");
        };
        let depth = hands_overlap(grasp, other);
        assert!(depth < TOLERANCE, "{context}: {depth} m deep in hand {place}");
        nearest = nearest.min(-depth);
    }
    match margins.giver_clearance {
        // Palms are fuller than their bones.
        Some(clearance) => assert!(
            clearance >= 0.001 && clearance <= nearest + TOLERANCE,
            "{context}: {clearance}, measured {nearest}"
        ),
        None => assert_eq!(nearest, f32::INFINITY, "{context}"),
    }
    let mut nearest = f32::INFINITY;
    for (place, obstacle) in request.obstacles.iter().enumerate() {
        let depth = obstacle_overlap(&grasp.joints, obstacle);
        assert!(depth < TOLERANCE, "{context}: {depth} m deep in obstacle {place}");
        nearest = nearest.min(-depth);
    }
    match margins.obstacle_clearance {
        Some(clearance) => assert!(
            clearance > 0.0 && clearance <= nearest + TOLERANCE,
            "{context}: {clearance}, measured {nearest}"
        ),
        None => assert!(request.obstacles.is_empty(), "{context}"),
    }
}

/// A request that two hands hold an object's ends.
fn held_by_two(object: &str, half: Vec3) -> FindRequest {
    FindRequest::new(object)
        .with_hand(PresentingHand::Joints(giver(-1.0, half)))
        .with_hand(PresentingHand::Joints(giver(1.0, half)))
}

/// An object that lies on a wide table; up is y.
fn on_table(half: Vec3) -> Obstacle {
    let centre = Vec3::new(0.0, -half.y - 0.5, 0.0);
    Obstacle::solid_box(Pose::new(centre, Quat::IDENTITY), Vec3::new(20.0, 0.5, 20.0))
}

/// A shelf around an object: a floor, a back and two sides, open in front (+z) and above.
fn in_shelf(half: Vec3) -> Vec<Obstacle> {
    let wall = |centre: Vec3, size: Vec3| Obstacle::solid_box(Pose::new(centre, Quat::IDENTITY), size);
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

async fn ask(client: &GraspClient, request: &FindRequest) -> grasp_client::FindAnswer {
    client.find_grasp(request).await.expect("the request is valid")
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
            let request = FindRequest {
                seed: Some(seed),
                atlas: Some(AtlasUse::None),
                budget: Some(Duration::from_secs(10)),
                ..held_by_two(&object, half)
            };
            let answer = ask(&client, &request).await;
            let grasp = answer
                .grasp
                .unwrap_or_else(|| panic!("{name}, seed {seed}: {:?}", answer.report));
            assert_is_clear(&format!("{name}, seed {seed}"), &request, &grasp);

            let one_handed = FindRequest {
                other_hands: Vec::new(),
                ..request
            };
            let grasp = ask(&client, &one_handed).await.grasp.expect("a grasp");
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
                let request = FindRequest {
                    seed: Some(seed),
                    atlas: Some(AtlasUse::None),
                    budget: Some(Duration::from_secs(10)),
                    obstacles: obstacles.clone(),
                    plan_key_frames: seed % 8 == 0,
                    ..FindRequest::new(&object)
                };
                let context = format!("{name}, {setting}, seed {seed}");
                let answer = ask(&client, &request).await;
                let grasp = answer
                    .grasp
                    .unwrap_or_else(|| panic!("{context}: {:?}", answer.report));
                assert_is_clear(&context, &request, &grasp);
                for (key_frame, obstacle) in grasp
                    .key_frames
                    .iter()
                    .flat_map(|frame| obstacles.iter().map(move |obstacle| (frame, obstacle)))
                {
                    let depth = obstacle_overlap(&key_frame.joints, obstacle);
                    assert!(depth < TOLERANCE, "{context}: {depth} m, {:?}", key_frame.kind);
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
        .box_half_extents;
    let name = "objects/remote";
    crate::atlases::state(&server, name, 100).await;
    // A table under the remote whichever way its box lies, a pole through its middle, and a hand at either end.
    let reach = half.length();
    let table = Obstacle::solid_box(
        Pose::new(Vec3::new(0.0, -reach - 0.4, 0.0), Quat::IDENTITY),
        Vec3::new(20.0, 0.5, 20.0),
    );
    let pole = Obstacle::capsule(Vec3::new(0.0, 0.0, -1.0), Vec3::new(0.0, 0.0, 1.0), 0.01);
    let settings = [
        FindRequest::new(name).with_obstacle(table),
        FindRequest::new(name).with_obstacle(pole),
        held_by_two(name, half),
        held_by_two(name, half).with_obstacle(table),
    ];
    let mut sources = [0; 3];
    for (place, setting) in settings.into_iter().enumerate() {
        for seed in 0..u64::from(cases(SEEDS)) {
            for (reproducible, choice) in [
                (false, None),
                (true, None),
                (false, Some(Choice::BestWithinBudget)),
            ] {
                let request = FindRequest {
                    seed: Some(seed),
                    reproducible,
                    choice,
                    budget: choice.is_none().then_some(Duration::from_secs(10)),
                    ..setting.clone()
                };
                let context = format!("setting {place}, seed {seed}, {reproducible}, {choice:?}");
                let answer = ask(&client, &request).await;
                let grasp = answer
                    .grasp
                    .unwrap_or_else(|| panic!("{context}: {:?}", answer.report));
                assert_is_clear(&context, &request, &grasp);
                match answer.report.source.expect("a grasp has a source") {
                    GraspSource::Search => sources[0] += 1,
                    GraspSource::Atlas => sources[1] += 1,
                    GraspSource::Learned => sources[2] += 1,
                    GraspSource::Preferred => panic!("the object has no grips of its own"),
                    GraspSource::Standing => panic!("no request has a standing grasp"),
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
        let request = FindRequest {
            seed: Some(4),
            reproducible: true,
            budget: Some(Duration::from_secs(10)),
            ..held_by_two(&object, half).with_obstacle(on_table(half + Vec3::Y * 0.1))
        };
        let answer = ask(&client, &request).await;
        grasps.push((answer.grasp.expect("a grasp"), answer.report.attempt));
        server.stop().await;
    }
    assert_eq!(grasps[0], grasps[1]);
}

/// A hand of 26 joints from protobuf's JSON, which leaves out zeros.
fn hand_from_json(hand: &serde_json::Value) -> HandJoints {
    let number = |value: &serde_json::Value, key: &str| value[key].as_f64().unwrap_or(0.0) as f32;
    let joints = hand["joints"].as_array().expect("a hand has joints");
    HandJoints {
        handedness: match hand["handedness"].as_str() {
            Some("HANDEDNESS_LEFT") => Handedness::Left,
            Some("HANDEDNESS_RIGHT") => Handedness::Right,
            other => panic!("{other:?}"),
        },
        joint_set: JointSet::OpenXr26,
        joints: joints
            .iter()
            .map(|joint| {
                let (p, q) = (
                    &joint["clientFromJoint"]["position"],
                    &joint["clientFromJoint"]["orientation"],
                );
                let [x, y, z] = ["x", "y", "z"].map(|key| number(p, key));
                let orientation = ["x", "y", "z", "w"].map(|key| number(q, key));
                JointPose {
                    client_from_joint: Pose::new(Vec3::new(x, y, z), Quat::from_array(orientation)),
                    radius: number(joint, "radius"),
                }
            })
            .collect(),
    }
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
        .create_object(&NewObject::new("book", obj, 0.45))
        .await
        .expect("the book can be created");
    for seed in 0..u64::from(cases(SEEDS)) {
        let request = FindRequest {
            up: Some(Vec3::Z),
            seed: Some(100 + seed),
            atlas: Some(AtlasUse::None),
            budget: Some(Duration::from_secs(10)),
            ..FindRequest::new(&book.name)
        }
        .with_hand(PresentingHand::Joints(hand_from_json(
            &find["presentingHand"]["joints"],
        )))
        .with_hand(PresentingHand::Joints(hand_from_json(&second)));
        let answer = ask(&client, &request).await;
        let grasp = answer
            .grasp
            .unwrap_or_else(|| panic!("seed {seed}: {:?}", answer.report));
        assert_is_clear(&format!("seed {seed}"), &request, &grasp);
    }
    server.stop().await;
}
