//! Scores and key frames over the wire.

use std::{collections::BTreeMap, time::Duration};

use glam::Vec3;
use grasp_assets::holdouts::holdout;
use grasp_client::{
    ApproachCone, Constraints, Convention, FindRequest, Grasp, KeyFrameKind, Validity, built_in::request_for,
};
use grasp_tests::TestServer;

/// Holdouts that are answered quickly.
const HOLDOUTS: [&str; 3] = ["remote-genhold3", "scissors-hold1", "scissors-genhold1"];

async fn ask(server: &TestServer, name: &str, validity: Validity, convention: Convention) -> Grasp {
    ask_from(server, name, validity, convention, None).await
}

/// [`ask`] with an approach cone, if there is one.
async fn ask_from(
    server: &TestServer,
    name: &str,
    validity: Validity,
    convention: Convention,
    approach: Option<ApproachCone>,
) -> Grasp {
    let mut request = FindRequest {
        validity: Some(validity),
        seed: Some(5),
        reproducible: true,
        budget: Some(Duration::from_secs(10)),
        convention,
        plan_key_frames: true,
        constraints: Constraints {
            approach,
            ..Constraints::default()
        },
        ..request_for(holdout(name).expect("a built-in holdout"))
    };
    if convention != Convention::OpenXr {
        // The giver's pose is written in the built-in holdouts' own convention.
        request.presenting_hand = None;
    }
    let client = server.client().await;
    let answer = client.find_grasp(&request).await.expect("a valid request");
    answer
        .grasp
        .unwrap_or_else(|| panic!("{name}: no grasp: {:?}", answer.report))
}

/// The terms of a score and their weights, as the server's page lists them.
fn weights_on_the_page() -> BTreeMap<&'static str, f32> {
    let page = include_str!("../../../server/README.md");
    let (_, table) = page
        .split_once("| Term | Weight |")
        .expect("the page has the table");
    let (table, _) = table.split_once("\n\n").expect("the table ends");
    let rows = table.lines().skip(2).flat_map(|row| {
        let mut cells = row.trim_start_matches('|').split('|').map(str::trim);
        let (names, weight) = (cells.next().unwrap_or_default(), cells.next().unwrap_or_default());
        let weight = weight
            .trim_end_matches(" each")
            .parse()
            .expect("a weight is a number");
        names.split(", ").map(move |name| (name, weight))
    });
    rows.collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_score_is_the_weighted_mean_of_its_terms() {
    let server = TestServer::start().await;
    for name in HOLDOUTS {
        let grasp = ask(&server, name, Validity::Physical, Convention::OpenXr).await;
        let score = grasp.score.expect("a physical grasp is rated");
        let in_answer = score.terms.iter().map(|term| (term.name.as_str(), term.weight));
        assert_eq!(in_answer.collect::<BTreeMap<_, _>>(), weights_on_the_page());
        let (mut sum, mut weights) = (0.0, 0.0);
        for term in &score.terms {
            assert!((0.0..=1.0).contains(&term.value), "{name}: {term:?}");
            assert!(term.weight > 0.0, "{name}: {term:?}");
            sum += term.value * term.weight;
            weights += term.weight;
        }
        assert!((score.total - sum / weights).abs() < 1e-5, "{name}: {score:?}");
        // Comfort is rated by E alone, closeness by the reported clearance.
        let value = |wanted: &str| {
            let term = score.terms.iter().find(|term| term.name == wanted);
            term.expect("named above").value
        };
        assert!(
            (value("comfort") - (-grasp.comfort / 0.04).exp()).abs() < 1e-4,
            "{name}"
        );
        let clearance = grasp.margins.and_then(|margins| margins.giver_clearance);
        let expected = (clearance.expect("there is a giver") / 0.04).min(1.0);
        assert!((value("giver_clearance") - expected).abs() < 1e-4, "{name}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn key_frames_end_in_the_grasp() {
    let server = TestServer::start().await;
    for name in HOLDOUTS {
        for (convention, per_metre) in [(Convention::OpenXr, 1.0), (Convention::Unreal, 100.0)] {
            let grasp = ask(&server, name, Validity::Physical, convention).await;
            let kinds: Vec<_> = grasp.key_frames.iter().map(|frame| frame.kind).collect();
            let expected = [
                KeyFrameKind::Approach,
                KeyFrameKind::PreGrasp,
                KeyFrameKind::Close,
            ];
            assert_eq!(kinds, expected, "{name}");
            let [approach, pre_grasp, close] = &grasp.key_frames[..] else {
                unreachable!("three kinds");
            };
            assert_eq!(close.client_from_wrist, grasp.client_from_wrist, "{name}");
            assert_eq!(close.digits, grasp.digits, "{name}");
            assert_eq!(close.joints, grasp.joints, "{name}");
            let [from, to] = [approach, pre_grasp].map(|frame| frame.client_from_wrist.position);
            let way = from.distance(to) / per_metre;
            assert!((way - 0.12).abs() < 1e-4, "{name}: {way} m");
            // One of the joints is the wrist, in either convention.
            for frame in &grasp.key_frames {
                let wrist = frame.client_from_wrist.position;
                let nearest = frame
                    .joints
                    .iter()
                    .map(|joint| joint.client_from_joint.position.distance(wrist));
                let nearest = nearest.fold(f32::INFINITY, f32::min);
                assert!(nearest < 1e-5 * per_metre, "{name}: {nearest}");
            }
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn key_frames_approach_within_the_allowed_cone() {
    let server = TestServer::start().await;
    let half_angle = 0.7;
    let mut ways = 0;
    for convention in [Convention::OpenXr, Convention::Unreal] {
        for client_direction in [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z] {
            for name in HOLDOUTS {
                let approach = Some(ApproachCone {
                    client_direction,
                    half_angle,
                });
                let grasp = ask_from(&server, name, Validity::Physical, convention, approach).await;
                let [approach, pre_grasp, _] = &grasp.key_frames[..] else {
                    continue;
                };
                let [from, to] = [approach, pre_grasp].map(|frame| frame.client_from_wrist.position);
                let angle = (to - from).angle_between(client_direction);
                assert!(
                    angle <= half_angle + 1e-3,
                    "{name}, {convention:?}, {client_direction}: {angle}"
                );
                ways += 1;
            }
        }
    }
    assert!(ways > 18, "{ways} ways");
}

#[tokio::test(flavor = "multi_thread")]
async fn key_frames_are_planned_only_on_request() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let mut request = FindRequest {
        seed: Some(5),
        reproducible: true,
        budget: Some(Duration::from_secs(10)),
        ..FindRequest::new("objects/remote")
    };
    let without = client.find_grasp(&request).await.expect("a valid request");
    request.plan_key_frames = true;
    let with = client.find_grasp(&request).await.expect("a valid request");
    let [mut without, mut with] = [without, with].map(|answer| answer.grasp.expect("a grasp"));
    assert_eq!((without.key_frames.len(), with.key_frames.len()), (0, 3));
    // The grasp is the same.
    for grasp in [&mut without, &mut with] {
        grasp.key_frames.clear();
    }
    assert_eq!(without, with);
}

#[tokio::test(flavor = "multi_thread")]
async fn thesis_grasps_have_no_score_and_no_key_frames() {
    let server = TestServer::start().await;
    let grasp = ask(&server, "remote-genhold3", Validity::Thesis, Convention::OpenXr).await;
    assert_eq!(grasp.score, None);
    assert!(grasp.key_frames.is_empty());
}
