//! Every answer of `FindGrasp` is valid for `ValidateGrasp`, with the same figures: several hundred random holdouts, from every
//! source of grasps, in every convention.

use std::{collections::BTreeMap, fs, sync::Arc, time::Duration};

use glam::Vec3;
use grasp_proto::v1::{self, presenting_hand};
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
    fixtures::Folder,
    own_hands::new_rig,
    parts::{hand, with},
    validate_grasp::{Client, in_client, metre, request, validated, verdict},
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
    if grasp.margins.len() < 3 {
        differences.push("no margins".to_owned());
    }
    let mut compare = |name: &str, was: Option<f32>, is: Option<f32>, slack: f32| {
        let agree = match (was, is) {
            (Some(was), Some(is)) => (was - is).abs() <= slack,
            (was, is) => was == is,
        };
        if !agree {
            differences.push(format!("{name} was {was:?}, is {is:?}"));
        }
    };
    for check in [
        v1::Check::Penetration,
        v1::Check::GiverClearance,
        v1::Check::ObstacleClearance,
        v1::Check::Closure,
        v1::Check::Balance,
    ] {
        let (was, is) = (grasp.margin(check), seen.margin(check));
        let slack = match check {
            v1::Check::Closure => ROUNDING + OF_EPSILON * was.unwrap_or_default(),
            v1::Check::Balance => 1e-3,
            _ => ROUNDING * metre,
        };
        compare(check.as_str_name(), was, is, slack);
        compare("a verdict", is, verdict(answer, check).value, 0.0);
    }
    let contacts = Some(seen.contacts.len() as f32);
    compare(
        "a verdict",
        contacts,
        verdict(answer, v1::Check::Contacts).value,
        0.0,
    );
    compare(
        "terms of the score",
        Some(grasp.score_terms.len() as f32),
        Some(seen.score_terms.len() as f32),
        0.0,
    );
    for (was, is) in grasp.score_terms.iter().zip(&seen.score_terms) {
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
    let comfort = |grasp: &v1::Grasp| grasp.thesis.map(|thesis| thesis.comfort);
    compare("comfort", comfort(grasp), comfort(seen), OF_FORCES);
    let force = |grasp: &v1::Grasp| {
        let forces = grasp.contacts.iter().map(v1::Contact::force);
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
        let moved = was.position().distance(is.position());
        require("contact", moved <= 1e-4 * metre);
    }
    differences
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
    /// Asks for a grasp and validates the answer, as it is and by its place in the client's frame in turn.
    async fn ask(
        &mut self,
        client: &mut Client,
        holdout: &v1::FindGraspRequest,
        what: &str,
    ) -> Option<v1::Grasp> {
        self.asked += 1;
        let found = client.find_grasp(holdout.clone()).await;
        let found = found.expect("the request is valid").into_inner();
        let source = found.source();
        let grasp = found.grasp()?.clone();
        let pose = if self.validated.is_multiple_of(2) {
            hand(&grasp).clone()
        } else {
            in_client(&grasp)
        };
        let answer = validated(client, request(holdout.clone(), pose)).await;
        self.validated += 1;
        *self.by_source.entry(source.as_str_name()).or_default() += 1;
        let differences = differences(&answer, &grasp, metre(hand(&grasp).convention()));
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
    let giver = holdout.holdout_mut().presenting_hand.as_mut();
    let form = giver.and_then(|hand| hand.form.as_mut());
    let Some(presenting_hand::Form::Joints(hand)) = form else {
        panic!("the giver has joints");
    };
    for joint in &mut hand.joints {
        joint.pose = Some(v1::Pose::new(joint.position() + by, joint.orientation()));
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
            let create = v1::CreateObjectRequest::new(name.replace('_', "-"), mesh, mass);
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
    let request = holdout
        .request(&format!("objects/{name}"))
        .receiving(side)
        .with_budget(Duration::from_millis(if is_best { 20 } else { 150 }))
        .with_seed(place as u64);
    with(request, |request| {
        match place % 16 {
            6 => request.receiver_mut().scale = Some(0.9),
            10 => "rigs/mine".clone_into(&mut request.receiver_mut().rig),
            13 => request.holdout_mut().scale = Some(0.9),
            _ => {}
        }
        let search = request.search_mut();
        search.ignore_atlas = place % 4 >= 2;
        search.choice = if is_best {
            v1::GraspChoice::BestWithinBudget
        } else {
            v1::GraspChoice::FirstValid
        }
        .into();
    })
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
            // Once as it is, then with the giver nearer.
            let by = if place % 2 == 0 { 0.0 } else { 0.004 };
            let after = converted(&moved(openxr, Vec3::splat(by))).with_current(v1::CurrentGrasp {
                grasp: grasp.hand,
                ..Default::default()
            });
            let after = with(after, |request| {
                request.search_mut().choice = v1::GraspChoice::FirstValid.into();
            });
            tally.ask(&mut client, &after, &format!("{what} current")).await;
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
        "GRASP_SOURCE_CURRENT",
    ] {
        assert!(
            by_source.get(source).is_some_and(|count| *count >= 10),
            "{by_source:?}"
        );
    }
    server.stop().await;
}
