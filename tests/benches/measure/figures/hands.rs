//! Hands of the clients' own next to the built-in one of their size: cold, then with atlases that the server grew.

use std::time::{Duration, Instant};

use grasp_assets::objects::objects;
use grasp_characters::{
    Character, Style,
    names::{bone, mixamo, vrm_1},
    webxr_hand,
};
use grasp_proto::v1;
use grasp_synthesis::model::hand::Handedness;
use grasp_tests::TestServer;

use crate::figures::{
    Row,
    cold::without_atlas,
    requests::{Answer, search_times, share, within_50_ms},
    setting::{Setting, default_hand, knows_all},
    table::{Line, Target, Unit, time},
};

/// Limit on requests per hand and kind.
const MAX_REQUESTS: usize = 300;

/// Requests that are not measured.
const WARM_UP: usize = 15;

/// Share of the answers of the built-in hand that another one has to give.
const AS_MANY: f64 = 0.99;

/// Share of the first calls to answer within 50 ms.
const COLD_IN_TIME: f64 = 0.95;

/// How many times as long as with the built-in hand a warm search may take at the median.
const AS_FAST: f64 = 1.3;

/// Longest wait for the atlases of one hand.
const ATLAS_TIMEOUT: Duration = Duration::from_mins(10);

/// A receiving hand, and the built-in one to compare it with.
struct Compared {
    what: &'static str,
    hand: v1::Receiver,
    built_in: v1::Receiver,
}

pub(crate) fn measure(setting: &Setting) -> Vec<Line> {
    let server = setting.server(|config| {
        config.builder_threads = std::thread::available_parallelism().map_or(1, usize::from);
    });
    let mut lines = Vec::new();
    for compared in hands(setting, &server) {
        let Compared { what, hand, built_in } = compared;
        let (cold, own) = answers(setting, &server, what, &hand);
        let (other_cold, other) = answers(setting, &server, "the built-in one", &built_in);
        let adult = format!("adult of the size of {what}");
        lines.push(cold_line(&adult, &other_cold));
        lines.push(cold_line(what, &cold));
        lines.push(warm_line(&adult, &other, &other));
        lines.push(warm_line(what, &own, &other));
    }
    setting.serving.block_on(server.stop());
    lines
}

/// Creates the rigs.
fn hands(setting: &Setting, server: &TestServer) -> Vec<Compared> {
    let mixamo = Style {
        name: mixamo,
        units_per_metre: 100.0,
        ..Style::PLAIN
    };
    let vrm = Style {
        name: bone,
        extensions: vrm_1,
        ..Style::PLAIN
    };
    let mut models = vec![
        ("mixamo", Character::new(&mixamo).glb),
        ("vrm", Character::new(&vrm).glb),
    ];
    match webxr_hand() {
        Some(glb) => models.push(("webxr", glb)),
        None => println!("skipped: the WebXR hand, which tests/foreign/run fetches, is not there"),
    }
    let reach = default_hand(Handedness::Right).rig.reach;
    let create = async |(what, model): (&'static str, Vec<u8>)| {
        let request = v1::CreateRigRequest {
            handedness: v1::Handedness::Right.into(),
            ..v1::CreateRigRequest::of_model(what, model)
        };
        let created = server.rigs().await.create_rig(request).await;
        let rig = created.expect("the model is sound").into_inner();
        let size = (length(&rig.hands[1]) / reach * 100.0).round() / 100.0;
        Compared {
            what,
            hand: right("rigs/".to_owned() + what, None),
            // At its own size, the adult has atlases that were grown for longer than a server grows them.
            built_in: right(
                "rigs/adult".to_owned(),
                Some(if size == 1.0 { 1.01 } else { size }),
            ),
        }
    };
    setting.calling.block_on(async {
        let mut compared = Vec::new();
        for model in models {
            compared.push(create(model).await);
        }
        compared
    })
}

fn right(rig: String, scale: Option<f32>) -> v1::Receiver {
    v1::Receiver {
        rig,
        handedness: v1::Handedness::Right.into(),
        scale,
        ..v1::Receiver::default()
    }
}

/// From the wrist to the tip of the middle finger, in metres.
fn length(hand: &v1::RigHand) -> f32 {
    let at = |joint: usize| hand.stretched_joints[joint].position();
    at(1).distance(at(15))
}

/// The answers to the built-in holdouts without and with atlases.
fn answers(
    setting: &Setting,
    server: &TestServer,
    what: &str,
    hand: &v1::Receiver,
) -> (Vec<Answer>, Vec<Answer>) {
    let requests = setting.built_in_requests().into_iter().take(MAX_REQUESTS);
    let requests = requests.map(|request| v1::FindGraspRequest {
        receiver: Some(hand.clone()),
        ..within_50_ms(request)
    });
    let requests: Vec<_> = requests.collect();
    let send = |kind: &str, requests: Vec<v1::FindGraspRequest>| {
        let warm_up = WARM_UP.min(requests.len() / 2);
        setting
            .send_all(server, &format!("{kind}, {what}"), requests)
            .split_off(warm_up)
    };
    let cold = send("cold", requests.iter().cloned().map(without_atlas).collect());
    if !setting.quick {
        setting.calling.block_on(wait_for_atlases(server, hand));
    }
    (cold, send("warm", requests))
}

/// Asks for each object until its atlas for the hand is complete.
async fn wait_for_atlases(server: &TestServer, hand: &v1::Receiver) {
    let start = Instant::now();
    for object in objects() {
        while !knows_all(server, &format!("objects/{}", object.name), hand.clone()).await {
            assert!(
                start.elapsed() < ATLAS_TIMEOUT,
                "atlases were not complete in time"
            );
            // Builders hardly work while searches run.
            tokio::time::sleep(Duration::from_millis(500)).await;
        }
    }
}

fn in_time(answers: &[Answer]) -> f64 {
    share(answers, Answer::is_in_time)
}

fn cold_line(what: &str, answers: &[Answer]) -> Line {
    let spread = search_times(answers);
    Line::new(Row::Hands, format!("cold, {what}"), Unit::Seconds, spread).target(Target::at_least(
        "in 50 ms",
        Unit::Share,
        in_time(answers),
        COLD_IN_TIME,
    ))
}

fn warm_line(what: &str, answers: &[Answer], built_in: &[Answer]) -> Line {
    let spread = search_times(answers);
    let deepest = answers
        .iter()
        .map(|answer| answer.penetration)
        .fold(0.0, f32::max);
    let entries: Vec<u32> = answers.iter().map(|answer| answer.atlas_entries).collect();
    let median = search_times(built_in).median;
    Line::new(Row::Hands, format!("warm, {what}"), Unit::Seconds, spread)
        .target(Target::at_most(
            "median",
            Unit::Seconds,
            spread.median,
            AS_FAST * median,
        ))
        .target(Target::at_least(
            "in 50 ms",
            Unit::Share,
            in_time(answers),
            AS_MANY * in_time(built_in),
        ))
        .remark(format!(
            "{:.2} × the built-in hand's {}; {} to {} grips per atlas; at most {:.2} mm deep",
            spread.median / median,
            time(median),
            entries.iter().min().unwrap_or(&0),
            entries.iter().max().unwrap_or(&0),
            1000.0 * deepest
        ))
}
