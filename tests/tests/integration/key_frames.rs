//! Scores and key frames over the wire.

use std::collections::BTreeMap;

use glam::Vec3;
use grasp_assets::holdouts::holdout;
use grasp_proto::v1::{self, Convention};
use grasp_tests::TestServer;

use crate::fixtures::{built_in_request, find, reproducible, with};

/// Holdouts that are answered quickly.
const HOLDOUTS: [&str; 3] = ["remote-genhold3", "scissors-hold1", "scissors-genhold1"];

/// A request for one of them with key frames.
fn request(name: &str, convention: Convention) -> v1::FindGraspRequest {
    let request = built_in_request(holdout(name).expect("a built-in holdout"))
        .with_seed(5)
        .with_convention(convention)
        .with_key_frames();
    with(reproducible(request), |request| {
        if convention != Convention::Openxr {
            // The giver's pose is written in the built-in holdouts' own convention.
            request.holdout_mut().presenting_hand = None;
        }
    })
}

async fn ask(server: &TestServer, request: v1::FindGraspRequest) -> v1::Grasp {
    let answer = find(server, request).await;
    let grasp = answer.grasp();
    grasp
        .unwrap_or_else(|| panic!("no grasp: {:?}", answer.report))
        .clone()
}

/// Where the wrist is at a key frame, in the client's frame.
fn wrist(frame: &v1::KeyFrame) -> Vec3 {
    let hand = frame.hand.as_ref().expect("a key frame has a hand");
    hand.client_from_wrist.expect("a hand has a place").position()
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
        let grasp = ask(&server, request(name, Convention::Openxr)).await;
        let score = grasp.score.expect("a physical grasp is rated");
        let terms = &grasp.score_terms;
        let in_answer = terms.iter().map(|term| (term.name.as_str(), term.weight));
        assert_eq!(in_answer.collect::<BTreeMap<_, _>>(), weights_on_the_page());
        let (mut sum, mut weights) = (0.0, 0.0);
        for term in terms {
            assert!((0.0..=1.0).contains(&term.value), "{name}: {term:?}");
            assert!(term.weight > 0.0, "{name}: {term:?}");
            sum += term.value * term.weight;
            weights += term.weight;
        }
        assert!((score - sum / weights).abs() < 1e-5, "{name}: {score}, {terms:?}");
        // Comfort is rated by E alone, closeness by the reported clearance.
        let value = |wanted: &str| {
            let term = terms.iter().find(|term| term.name == wanted);
            term.expect("named above").value
        };
        let comfort = grasp.thesis.expect("it has a comfort").comfort;
        assert!(
            (value("comfort") - (-comfort / 0.04).exp()).abs() < 1e-4,
            "{name}"
        );
        let clearance = grasp.margin(v1::Check::GiverClearance);
        let expected = (clearance.expect("there is a giver") / 0.04).min(1.0);
        assert!((value("giver_clearance") - expected).abs() < 1e-4, "{name}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn key_frames_end_in_the_grasp() {
    let server = TestServer::start().await;
    for name in HOLDOUTS {
        for (convention, per_metre) in [(Convention::Openxr, 1.0), (Convention::Unreal, 100.0)] {
            let grasp = ask(&server, request(name, convention)).await;
            let kinds: Vec<_> = grasp.key_frames.iter().map(v1::KeyFrame::kind).collect();
            let expected = [
                v1::KeyFrameKind::Approach,
                v1::KeyFrameKind::PreGrasp,
                v1::KeyFrameKind::Close,
            ];
            assert_eq!(kinds, expected, "{name}");
            let [approach, pre_grasp, close] = &grasp.key_frames[..] else {
                unreachable!("three kinds");
            };
            assert_eq!(close.hand, grasp.hand, "{name}");
            let [from, to] = [approach, pre_grasp].map(wrist);
            let way = from.distance(to) / per_metre;
            assert!((way - 0.12).abs() < 1e-4, "{name}: {way} m");
            // One of the joints is the wrist, in either convention.
            for frame in &grasp.key_frames {
                let wrist = wrist(frame);
                let joints = &frame.hand.as_ref().expect("it has a hand").joints;
                let nearest = joints.iter().map(|joint| {
                    let pose = joint.pose.expect("the hand has all joints");
                    pose.position().distance(wrist)
                });
                let nearest = nearest.fold(f32::INFINITY, f32::min);
                assert!(nearest < 1e-5 * per_metre, "{name}: {nearest}");
            }
        }
    }
}
