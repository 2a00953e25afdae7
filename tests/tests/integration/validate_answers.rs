//! Every answer of `FindGrasp` is valid for `ValidateGrasp`, with the same figures: several hundred random holdouts, from every
//! source of grasps, in every convention.

use std::{collections::BTreeMap, fs, sync::Arc};

use glam::Vec3;
use grasp_proto::v1::{self, grasp_to_validate::Form, presenting_hand};
use grasp_synthesis::model::object::GraspObject;
use grasp_tests::{
    TestServer,
    random_holdouts::{ClientHoldout, Givers, GivingHand, giving_hands, place},
    recorded::{data_folder, object_of},
};
use rand::SeedableRng as _;
use rand_xoshiro::Xoshiro256PlusPlus;

use crate::{
    atlases::state,
    conventions::engines,
    fixtures::{Folder, milliseconds, receiving},
    own_hands::new_rig,
    validate_grasp::{Client, angles_of, hand_of, request, validated, verdict},
};

const BUILT_IN: [&str; 3] = ["remote", "scalpel", "scissors"];

/// Scanned objects, with masses in kilograms.
const SCANNED: [(&str, f32); 3] = [("osim_mug", 0.3), ("osim_hammer", 0.5), ("osim_banana", 0.12)];

/// Givers placed on each object, which takes up to half a second each.
const GIVERS: u64 = 2;

/// Holdouts of each object.
const HOLDOUTS: usize = 36;

/// How far figures may differ: single precision, on the way through the client's frame.
const ROUNDING: f32 = 2e-5;

/// By how much of itself epsilon may differ: it is exact to five hundredths, and contacts that moved by rounding may end its search
/// a step later.
const OF_EPSILON: f32 = 0.06;

/// The term of the score that depends on epsilon.
const CLOSURE: &str = "closure";

/// Of other terms of the score, which are shares of small differences.
const OF_SCORES: f32 = 2e-3;

/// Of terms and comfort that depend on how the digits share forces: the solver ends within some percent of the best, and takes the
/// next of its steps of friction where contacts barely press firmly enough.
const OF_FORCES: f32 = 0.06;

/// The terms of the score that depend on that.
const FORCE_TERMS: [&str; 3] = ["comfort", "ease", "friction_reserve"];

/// Places givers on an object, on a thread each.
fn givers(object: &Arc<GraspObject>, hands: &[GivingHand]) -> Givers {
    let placed: Vec<_> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..GIVERS)
            .map(|seed| scope.spawn(move || place(object, hands, seed)))
            .collect();
        threads
            .into_iter()
            .map(|thread| thread.join().expect("it places a hand"))
            .collect()
    });
    Givers::new(hands, &placed).expect("the hands are known")
}

/// Every figure of an answered grasp that its validation does not confirm.
fn differences(answer: &v1::ValidateGraspResponse, grasp: &v1::Grasp, metre: f32) -> Vec<String> {
    let mut differences: Vec<String> = answer
        .verdicts
        .iter()
        .filter(|verdict| !verdict.passed)
        .map(|verdict| format!("fails {:?}: {}", verdict.check(), verdict.description))
        .collect();
    if answer.valid != differences.is_empty() || answer.verdicts.len() != 12 {
        differences.push(format!("valid: {}", answer.valid));
    }
    let seen = answer.grasp.as_ref().expect("the grasp is there");
    let (Some(was), Some(is)) = (grasp.margins, seen.margins) else {
        differences.push("no margins".to_owned());
        return differences;
    };
    let mut compare = |name: &str, was: Option<f32>, is: Option<f32>, slack: f32| {
        let agree = match (was, is) {
            (Some(was), Some(is)) => (was - is).abs() <= slack,
            (was, is) => was == is,
        };
        if !agree {
            differences.push(format!("{name} was {was:?}, is {is:?}"));
        }
    };
    let length = ROUNDING * metre;
    compare("penetration", Some(was.penetration), Some(is.penetration), length);
    compare("giver clearance", was.giver_clearance, is.giver_clearance, length);
    compare(
        "obstacle clearance",
        was.obstacle_clearance,
        is.obstacle_clearance,
        length,
    );
    compare(
        "epsilon",
        Some(was.epsilon),
        Some(is.epsilon),
        ROUNDING + OF_EPSILON * was.epsilon,
    );
    compare("residual", Some(was.residual), Some(is.residual), 1e-3);
    let terms = |grasp: &v1::Grasp| grasp.score.clone().unwrap_or_default().terms;
    let (their_terms, our_terms) = (terms(grasp), terms(seen));
    compare(
        "terms of the score",
        Some(their_terms.len() as f32),
        Some(our_terms.len() as f32),
        0.0,
    );
    for (was, is) in their_terms.iter().zip(&our_terms) {
        // The score sees how firm a grasp is by its epsilon.
        let slack = if was.name == CLOSURE {
            OF_EPSILON
        } else if FORCE_TERMS.contains(&was.name.as_str()) {
            OF_FORCES
        } else {
            OF_SCORES
        };
        compare(&was.name, Some(was.value), Some(is.value), slack);
    }
    compare("comfort", Some(grasp.comfort), Some(seen.comfort), OF_FORCES);
    for (check, figure) in [
        (v1::Check::Penetration, Some(is.penetration)),
        (v1::Check::GiverClearance, is.giver_clearance),
        (v1::Check::ObstacleClearance, is.obstacle_clearance),
        (v1::Check::Closure, Some(is.epsilon)),
        (v1::Check::Balance, Some(is.residual)),
        (v1::Check::Contacts, Some(seen.contacts.len() as f32)),
    ] {
        compare("a verdict", figure, verdict(answer, check).figure, 0.0);
    }
    let force = |grasp: &v1::Grasp| {
        let forces = grasp.contacts.iter().map(|contact| vector(contact.object_force));
        forces.map(Vec3::length).sum::<f32>()
    };
    compare(
        "force",
        Some(force(grasp)),
        Some(force(seen)),
        0.02 * force(grasp),
    );
    let mut require = |name: &str, holds: bool| {
        if !holds {
            differences.push(format!("another {name}"));
        }
    };
    require("type", (seen.r#type, seen.hangs) == (grasp.r#type, grasp.hangs));
    require("arm", seen.arm.is_some() == grasp.arm.is_some());
    require("number of contacts", seen.contacts.len() == grasp.contacts.len());
    for (was, is) in grasp.contacts.iter().zip(&seen.contacts) {
        require("part", (was.digit, was.phalanx) == (is.digit, is.phalanx));
        let moved = vector(was.object_position).distance(vector(is.object_position));
        require("contact", moved <= 1e-4 * metre);
    }
    differences
}

fn vector(wire: Option<v1::Vector3>) -> Vec3 {
    let v1::Vector3 { x, y, z } = wire.expect("a contact has it");
    Vec3::new(x, y, z)
}

/// What was validated, by source of the grasps, and what differed.
#[derive(Default)]
struct Tally {
    by_source: BTreeMap<&'static str, usize>,
    asked: usize,
    validated: usize,
    wrong: Vec<String>,
}

impl Tally {
    /// Asks for a grasp and validates the answer, by hand and by angles in turn.
    async fn ask(
        &mut self,
        client: &mut Client,
        holdout: &v1::FindGraspRequest,
        what: &str,
    ) -> Option<v1::Grasp> {
        self.asked += 1;
        let found = client.find_grasp(holdout.clone()).await;
        let found = found.expect("the request is valid").into_inner();
        let grasp = found.grasp?;
        let source = found.report.expect("an answer has a report").source();
        let hand_scale = holdout.receiving_hand.as_ref().and_then(|hand| hand.hand_scale);
        let form = if self.validated.is_multiple_of(2) {
            Form::Hand(v1::HandAtObject {
                hand_scale,
                ..hand_of(&grasp)
            })
        } else {
            Form::Angles(v1::HandAngles {
                hand_scale,
                ..angles_of(&grasp)
            })
        };
        let query = v1::FindGraspRequest {
            standing: None,
            ..holdout.clone()
        };
        let answer = validated(client, request(query, form)).await;
        let metre = if matches!(
            holdout.convention(),
            v1::Convention::Unreal | v1::Convention::UnrealXzy
        ) {
            100.0
        } else {
            1.0
        };
        self.validated += 1;
        *self.by_source.entry(source.as_str_name()).or_default() += 1;
        let differences = differences(&answer, &grasp, metre);
        if !differences.is_empty() {
            self.wrong.push(format!(
                "{what}, {}: {}",
                source.as_str_name(),
                differences.join("; ")
            ));
        }
        Some(grasp)
    }
}

/// The giver's hand a few millimetres away, as after some frames.
fn moved(mut holdout: v1::FindGraspRequest, by: Vec3) -> v1::FindGraspRequest {
    let form = holdout
        .presenting_hand
        .as_mut()
        .and_then(|hand| hand.form.as_mut());
    let Some(presenting_hand::Form::Joints(hand)) = form else {
        panic!("the giver has joints");
    };
    for joint in &mut hand.joints {
        let pose = joint.client_from_joint.as_mut().expect("a joint has a pose");
        let position = pose.position.as_mut().expect("a pose has a position");
        position.x += by.x;
        position.y += by.y;
        position.z += by.z;
    }
    holdout
}

/// The built-in objects and, where the data is, real ones, which it creates.
async fn known_objects(server: &TestServer) -> Vec<(String, Arc<GraspObject>)> {
    let mut objects: Vec<(String, Arc<GraspObject>)> = Vec::new();
    for name in BUILT_IN {
        let built_in = grasp_assets::objects::object(name).expect("it is built in");
        objects.push((name.to_owned(), built_in.object.clone()));
        state(server, &format!("objects/{name}"), 1).await;
    }
    if let Some(data) = data_folder() {
        for (name, mass) in SCANNED {
            let mesh = fs::read(data.join("objects").join(format!("{name}.obj"))).expect("it is in the data");
            objects.push((name.replace('_', "-"), Arc::new(object_of(&mesh, mass))));
            let create = v1::CreateObjectRequest {
                object_id: name.replace('_', "-"),
                mesh,
                mass_kg: mass,
                ..Default::default()
            };
            let mut service = server.objects().await;
            service.create_object(create).await.expect("the object is sound");
        }
    }
    objects
}

/// A request whose hand, choice, time, atlas and size follow from its place among those of an object.
fn varied(holdout: &ClientHoldout, name: &str, place: usize) -> v1::FindGraspRequest {
    let side = [v1::Handedness::Right, v1::Handedness::Left][place % 2];
    let is_best = place % 8 == 3;
    let mut receiving_hand = receiving(side);
    match place % 16 {
        6 => receiving_hand.hand_scale = Some(0.9),
        10 => "rigs/mine".clone_into(&mut receiving_hand.rig),
        _ => {}
    }
    v1::FindGraspRequest {
        receiving_hand: Some(receiving_hand),
        seed: Some(place as u64),
        budget: Some(milliseconds(if is_best { 20 } else { 150 })),
        choice: if is_best {
            v1::Choice::BestWithinBudget
        } else {
            v1::Choice::FirstValid
        }
        .into(),
        atlas: if place % 4 < 2 {
            v1::AtlasUse::Allowed
        } else {
            v1::AtlasUse::None
        }
        .into(),
        object_scale: (place % 16 == 13).then_some(0.9),
        ..holdout.request(&format!("objects/{name}"))
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn every_answer_to_a_random_holdout_is_valid_with_the_same_figures() {
    let folder = Folder::empty("validated-answers");
    let server = TestServer::start_with(|config| {
        config.builder_threads = 1;
        config.atlas_directory = Some(folder.path().to_owned());
    })
    .await;
    let mut client = server.grasps().await;
    let rig = new_rig("mine", 1.1);
    server
        .client()
        .await
        .create_rig(&rig)
        .await
        .expect("the rig is sound");
    let objects = known_objects(&server).await;
    let hands = giving_hands();
    let mut random = Xoshiro256PlusPlus::seed_from_u64(11);
    let mut tally = Tally::default();
    for (name, object) in &objects {
        let givers = givers(object, &hands);
        for place in 0..HOLDOUTS {
            let openxr = varied(&givers.draw(&mut random), name, place);
            let converted = |request: &v1::FindGraspRequest| match place / 4 % 6 {
                0 => request.clone(),
                engine => engines()[engine - 1].request(request),
            };
            let what = format!("{name} {place}");
            let holdout = converted(&openxr);
            let Some(grasp) = tally.ask(&mut client, &holdout, &what).await else {
                continue;
            };
            let hand = |grasp: &v1::Grasp| v1::HandAtObject {
                hand_scale: holdout.receiving_hand.as_ref().and_then(|hand| hand.hand_scale),
                ..hand_of(grasp)
            };
            let standing = v1::StandingGrasp {
                hand: Some(hand(&grasp)),
                ..Default::default()
            };
            // Once as it is, then with the giver nearer.
            let by = if place % 2 == 0 { 0.0 } else { 0.004 };
            let after = v1::FindGraspRequest {
                standing: Some(standing),
                choice: v1::Choice::FirstValid.into(),
                ..converted(&moved(openxr, Vec3::new(by, by, by)))
            };
            tally.ask(&mut client, &after, &format!("{what} standing")).await;
        }
    }
    let Tally {
        by_source,
        asked,
        validated,
        wrong,
    } = tally;
    println!(
        "{validated} grasps of {asked} answers validated, by source {by_source:?}, {} differ",
        wrong.len()
    );
    assert!(
        wrong.is_empty(),
        "{} of {validated}:\n{}",
        wrong.len(),
        wrong.join("\n")
    );
    assert!(validated >= 50 * objects.len(), "{validated} of {asked}");
    for source in [
        "GRASP_SOURCE_ATLAS",
        "GRASP_SOURCE_SEARCH",
        "GRASP_SOURCE_STANDING",
    ] {
        assert!(
            by_source.get(source).is_some_and(|count| *count >= 10),
            "{by_source:?}"
        );
    }
    server.stop().await;
}
