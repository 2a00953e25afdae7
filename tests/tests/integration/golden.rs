//! The grasps by which clients in other languages check their conversions and how they unpack grasps: `proto/golden/grasps.json`.
//!
//! After a change of the search, `GRASP_WRITE_GOLDEN=1 cargo test -p grasp-tests golden` writes the file.

use std::{env, fs, path::PathBuf};

use glam::Vec3;
use grasp_assets::holdouts::{BuiltInHoldout, holdouts};
use grasp_client::json::to_json;
use grasp_proto::{
    PackedGraspError,
    v1::{self, presenting_hand::Form},
};
use grasp_tests::TestServer;
use serde_json::{Value, json};

use crate::{
    conventions::engines,
    fixtures::{built_in_request, find, receiving, reproducible, with},
};

const COUNT: usize = 12;

/// The last bits differ between processors.
const ROUNDING: f64 = 2e-5;

fn path() -> PathBuf {
    PathBuf::from(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../proto/golden/grasps.json"
    ))
}

/// A built-in holdout in which positions are of few bits, so that centimetres round nothing.
fn request(place: usize, holdout: &BuiltInHoldout) -> v1::FindGraspRequest {
    let sides = [v1::Handedness::Right, v1::Handedness::Left];
    let rounded = |pose: Option<v1::Pose>| {
        pose.map(|pose| v1::Pose::new((pose.position() * 4096.0).round() / 4096.0, pose.orientation()))
    };
    with(reproducible(built_in_request(holdout)), |request| {
        request.receiver = Some(receiving(sides[place % 2]));
        request.output_mut().packed = true;
        request.search_mut().ignore_atlas = true;
        let holdout = request.holdout_mut();
        holdout.client_from_object = rounded(holdout.client_from_object);
        if let Some(Form::Pose(hand)) = holdout
            .presenting_hand
            .as_mut()
            .and_then(|hand| hand.form.as_mut())
        {
            hand.client_from_wrist = rounded(hand.client_from_wrist);
        }
    })
}

async fn vector(server: &TestServer, name: &str, openxr: v1::FindGraspRequest) -> Option<Value> {
    let engines = engines();
    let converted = engines[..3].iter().map(|engine| engine.request(&openxr));
    let requests: Vec<_> = [openxr.clone().with_convention(v1::Convention::Openxr)]
        .into_iter()
        .chain(converted)
        .collect();
    let mut conventions = Vec::new();
    for request in requests {
        let convention = request.output.expect("it is set").convention();
        let mut answer = find(server, request.clone()).await;
        let grasp = answer.grasps.first_mut()?;
        assert_unpacks(grasp);
        (grasp.margins, grasp.score_terms, grasp.thesis) = (Vec::new(), Vec::new(), None);
        let answer = v1::FindGraspResponse {
            report: None,
            origin: None,
            ..answer
        };
        conventions.push(json!({
            "convention": convention.as_str_name(),
            "request": short(to_json(&request).unwrap()),
            "answer": short(to_json(&answer).unwrap()),
        }));
    }
    Some(json!({"name": name, "conventions": conventions}))
}

/// The packed grasp has the hand, the type and the touching digits of the whole one.
fn assert_unpacks(grasp: &v1::Grasp) {
    assert!(grasp.packed.len() < 128);
    let unpacked = v1::Grasp::unpack(&grasp.packed).unwrap();
    assert_eq!(unpacked.r#type, grasp.r#type);
    for (whole, contacts) in [
        (&grasp.contacts, &unpacked.contacts),
        (&unpacked.contacts, &grasp.contacts),
    ] {
        assert!(
            whole
                .iter()
                .all(|one| contacts.iter().any(|other| other.digit == one.digit))
        );
    }
    let [whole, hand] = [grasp, &unpacked].map(|grasp| grasp.hand.as_ref().expect("it has a hand"));
    assert_eq!((&whole.rig, whole.handedness), (&hand.rig, hand.handedness));
    assert_eq!((whole.scale, whole.convention), (hand.scale, hand.convention));
    let [whole_wrist, wrist] = [whole, hand].map(|hand| hand.object_from_wrist.expect("it is at the object"));
    let unit = if whole.convention() == v1::Convention::Unreal {
        100.0
    } else {
        1.0
    };
    let distance = whole_wrist.position().distance(wrist.position());
    assert!(distance < 5e-5 * unit, "{distance}");
    let half_turn = whole_wrist
        .orientation()
        .dot(wrist.orientation())
        .abs()
        .min(1.0)
        .acos();
    assert!(half_turn < 1e-3, "{half_turn}");
    for (whole, digit) in whole.digits().into_iter().zip(hand.digits()) {
        assert_eq!(whole.is_some(), digit.is_some());
        let (Some(a), Some(b)) = (whole, digit) else {
            continue;
        };
        for (a, b) in [
            (a.base_yaw, b.base_yaw),
            (a.base_pitch, b.base_pitch),
            (a.second_pitch, b.second_pitch),
            (a.third_pitch.unwrap(), b.third_pitch.unwrap()),
        ] {
            assert!((a - b).abs() < 0.05_f32.to_radians(), "{a} {b}");
        }
    }
}

/// The same value with numbers in as few digits as single precision needs.
fn short(value: Value) -> Value {
    match value {
        Value::Object(map) => map.into_iter().map(|(key, value)| (key, short(value))).collect(),
        Value::Array(values) => values.into_iter().map(short).collect(),
        Value::Number(number) if number.is_f64() => {
            let single = number.as_f64().expect("it is one") as f32;
            json!(single.to_string().parse::<f64>().expect("it is a number"))
        }
        other => other,
    }
}

/// Where two values differ by more than rounding.
fn differences(path: &str, a: &Value, b: &Value, found: &mut Vec<String>) {
    match (a, b) {
        (Value::Object(a), Value::Object(b)) if a.keys().eq(b.keys()) => {
            for (key, value) in a {
                // Its last bits round as well.
                if key != "packed" {
                    differences(&format!("{path}.{key}"), value, &b[key], found);
                }
            }
        }
        (Value::Array(a), Value::Array(b)) if a.len() == b.len() => {
            for (i, (a, b)) in a.iter().zip(b).enumerate() {
                differences(&format!("{path}[{i}]"), a, b, found);
            }
        }
        (Value::Number(a), Value::Number(b)) => {
            let [a, b] = [a, b].map(|number| number.as_f64().unwrap_or(f64::NAN));
            if (a - b).abs() > ROUNDING * a.abs().max(1.0) {
                found.push(format!("{path}: {a} is now {b}"));
            }
        }
        _ if a == b => {}
        _ => found.push(format!("{path}: {a} is now {b}")),
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn golden_grasps_are_as_recorded_and_unpack_to_the_same_hand() {
    let server = TestServer::start().await;
    let mut vectors = Vec::new();
    for (place, holdout) in holdouts().iter().enumerate() {
        vectors.extend(Box::pin(vector(&server, &holdout.name, request(place, holdout))).await);
    }
    vectors.truncate(COUNT);
    assert_eq!(vectors.len(), COUNT, "too few holdouts have a grasp");
    let rig = v1::GetRigRequest {
        name: "rigs/adult".to_owned(),
    };
    let rig = server.rigs().await.get_rig(rig).await.unwrap().into_inner();
    let now = json!({"rigs": {"rigs/adult": short(to_json(&rig).unwrap())}, "vectors": vectors});
    if env::var_os("GRASP_WRITE_GOLDEN").is_some() {
        let lines: Vec<String> = vectors.iter().map(Value::to_string).collect();
        let text = format!(
            "{{\"rigs\": {},\n\"vectors\": [\n{}\n]}}\n",
            now["rigs"],
            lines.join(",\n")
        );
        fs::write(path(), text).unwrap();
    }
    let recorded: Value = serde_json::from_str(&fs::read_to_string(path()).unwrap()).unwrap();
    let mut found = Vec::new();
    differences("", &recorded, &now, &mut found);
    assert!(found.is_empty(), "{:#?}", &found[..found.len().min(20)]);
}

#[test]
fn odd_hands_are_packed_and_damaged_bytes_are_refused() {
    let angles = v1::DigitAngles::new([-3.2, 3.2, 0.0, 0.5]);
    let far = v1::Pose::new(Vec3::new(-900.0, 0.0, 1e-3), glam::Quat::IDENTITY);
    let hand = v1::HandPose {
        scale: Some(0.5),
        ..v1::HandPose::new("rigs/".to_owned() + &"x".repeat(63), v1::Handedness::Left)
    };
    let palm = v1::Contact::default();
    let grasp = v1::Grasp {
        hand: Some(hand.with_object_from_wrist(far).with_digits([
            Some(angles),
            None,
            None,
            Some(angles),
            Some(angles),
        ])),
        contacts: vec![palm],
        ..v1::Grasp::default()
    };
    let packed = grasp.pack();
    let unpacked = v1::Grasp::unpack(&packed).unwrap();
    assert_eq!(unpacked.contacts, grasp.contacts);
    let [whole, hand] = [&grasp, &unpacked].map(|grasp| grasp.hand.as_ref().unwrap());
    assert_eq!((&whole.rig, whole.scale), (&hand.rig, hand.scale));
    let wrist = hand.object_from_wrist.unwrap();
    assert!(wrist.position().distance(far.position()) < 900.0 / 32000.0);
    assert_eq!(
        hand.digits().map(|digit| digit.is_some()),
        [true, false, false, true, true]
    );
    assert!((hand.thumb.unwrap().base_yaw + std::f32::consts::PI).abs() < 1e-3);

    for length in 0..packed.len() {
        let error = v1::Grasp::unpack(&packed[..length]).unwrap_err();
        assert_eq!(error, PackedGraspError::Length(length));
    }
    assert_eq!(
        v1::Grasp::unpack(&[9; 200]).unwrap_err(),
        PackedGraspError::Version(9)
    );
    assert!(v1::Grasp::default().pack().is_empty());
}
