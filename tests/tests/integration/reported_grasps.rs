//! Requests made after reports of objects that programs of this kind do not take, or not as people do.

use std::{path::Path, time::Duration};

use grasp_proto::v1;
use grasp_tests::TestServer;

use crate::{
    fixtures::unaided,
    parts::{hand, reproducible, with},
    reported::{create, find_request, joints, json, report, text, vector},
};

/// A request for an object that nobody holds, with time enough on any machine.
fn floating(file: &Path) -> v1::FindGraspRequest {
    let value = json(file);
    let request = v1::FindGraspRequest::new(text(&value, "object")).with_budget(Duration::from_secs(5));
    with(unaided(request), |request| {
        request.holdout_mut().up = value.get("up").map(vector);
        request.search_mut().seed = value["seed"].as_u64();
    })
}

async fn found(server: &TestServer, request: v1::FindGraspRequest) -> v1::Grasp {
    let name = request.holdout.clone().expect("it is about an object").object;
    let answer = server.grasps().await.find_grasp(request).await;
    let answer = answer
        .unwrap_or_else(|status| panic!("{name}: {status}"))
        .into_inner();
    let grasp = answer.grasp();
    grasp
        .unwrap_or_else(|| panic!("{name}: {:?}", answer.report))
        .clone()
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_far_from_the_hand_does_not_keep_it_from_holding() {
    let test = "what_is_far_from_the_hand_does_not_keep_it_from_holding";
    let Some(folder) = report(test, "long-and-wide") else {
        return;
    };
    let server = TestServer::start().await;
    for object in [
        "broom",
        "crutch",
        "fishing-net",
        "hoop-90cm",
        "rake",
        "stick-cross",
        "stick",
        "sword",
        "umbrella-open",
    ] {
        create(&server, &folder.join(format!("create-t2-{object}.json")))
            .await
            .unwrap();
        found(&server, floating(&folder.join(format!("find-t2-{object}.json")))).await;
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn sheets_of_no_thickness_are_taken_like_thin_boxes() {
    let test = "sheets_of_no_thickness_are_taken_like_thin_boxes";
    let Some(folder) = report(test, "zero-thickness") else {
        return;
    };
    let server = TestServer::start().await;
    for card in ["box", "plane", "two-sided"] {
        create(&server, &folder.join(format!("create-{card}.json")))
            .await
            .unwrap();
        found(&server, floating(&folder.join(format!("find-{card}.json")))).await;
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_lunch_box_hangs_in_hooked_fingers() {
    let Some(folder) = report("a_lunch_box_hangs_in_hooked_fingers", "hook-carry") else {
        return;
    };
    let server = TestServer::start().await;
    create(&server, &folder.join("create.json")).await.unwrap();
    let asked = floating(&folder.join("find.json"));
    let hooked = v1::FindGraspRequest {
        requirements: Some(v1::Requirements {
            allowed_grasp_types: vec![v1::GraspType::FixedHook.into()],
            ..Default::default()
        }),
        ..asked.clone()
    };
    let grasp = found(&server, hooked).await;
    assert_eq!(grasp.r#type(), v1::GraspType::FixedHook);
    assert!(grasp.hangs);
    let without_thumb = v1::FindGraspRequest {
        requirements: Some(v1::Requirements {
            must_not_touch: vec![v1::Digit::Thumb.into()],
            ..Default::default()
        }),
        ..asked
    };
    let grasp = found(&server, without_thumb).await;
    let mut digits = grasp.contacts.iter().map(v1::Contact::digit);
    assert!(digits.all(|digit| digit != v1::Digit::Thumb), "{grasp:?}");
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn first_answers_on_a_new_object_mostly_have_a_clear_type() {
    let test = "first_answers_on_a_new_object_mostly_have_a_clear_type";
    let Some(folder) = report(test, "cold-unnatural") else {
        return;
    };
    let server = TestServer::start().await;
    create(&server, &folder.join("create.json")).await.unwrap();
    let asked = floating(&folder.join("find-1.json"));
    let mut unclear = 0;
    for seed in 1..=15 {
        // Reproducible: the verdict does not depend on the machine's speed.
        let grasp = found(&server, reproducible(asked.clone()).with_seed(seed)).await;
        unclear += usize::from(grasp.type_confidence < 0.5);
    }
    // Eight of these 15 were reported.
    assert!(unclear <= 1, "{unclear} of 15 answers have no clear type");
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn answers_keep_clear_of_both_hands_of_a_giver() {
    let test = "answers_keep_clear_of_both_hands_of_a_giver";
    let Some(folder) = report(test, "two-handed-giver") else {
        return;
    };
    let server = TestServer::start().await;
    create(&server, &folder.join("create.json")).await.unwrap();
    let second = joints(&json(&folder.join("second_hand.json")));
    let asked = find_request(&folder.join("find.json")).with_hand(second.clone());
    let mut answered = 0;
    for seed in 100..140 {
        let request = asked.clone().with_seed(seed);
        let answer = server
            .grasps()
            .await
            .find_grasp(request)
            .await
            .unwrap()
            .into_inner();
        let Some(grasp) = answer.grasp() else { continue };
        answered += 1;
        for (a, b) in hand(grasp)
            .joints
            .iter()
            .flat_map(|a| second.joints.iter().map(move |b| (a, b)))
        {
            let gap = a.position().distance(b.position()) - a.radius - b.radius;
            assert!(gap > -0.002, "seed {seed}: joints overlap by {} m", -gap);
        }
    }
    assert!(answered >= 38, "{answered} of 40");
    server.stop().await;
}
