//! Text of an answer.

use std::fmt::Write as _;

use glam::Vec3;
use grasp_client::{Check, Digit, Handedness, Outcome, std_duration, v1};

use crate::output::{grasp_type_name, human_time, list, metres, name_of, pairs, rejections, table, warnings};

/// The steps of Algorithm 1 of the thesis.
const STEPS: [&str; 5] = [
    "wrist placement",
    "finger posing",
    "collision validation",
    "contact validation",
    "immobility validation",
];

pub(super) fn describe(
    request: &v1::FindGraspRequest,
    answer: &v1::FindGraspResponse,
    round_trip_seconds: f64,
) -> String {
    let outcome = match answer.outcome() {
        Outcome::Found => "found",
        Outcome::BudgetExhausted => "no grasp within the budget",
        Outcome::Aborted => "aborted: the committed grasp is not valid",
        Outcome::Unspecified => "unknown",
    };
    let object = request.holdout.as_ref().map(|holdout| holdout.object.clone());
    let mut lines = vec![
        ("object", object.unwrap_or_default()),
        ("outcome", outcome.to_owned()),
    ];
    if let Some(current) = &answer.current {
        lines.push(("current grasp", describe_current(current)));
    }
    for grasp in &answer.grasps {
        lines.extend(describe_grasp(grasp));
    }
    lines.extend(describe_search(answer));
    lines.push(("round trip", human_time(round_trip_seconds)));
    let mut text = pairs(&lines);
    for grasp in &answer.grasps {
        let _ = write!(text, "\n\n{}", contact_table(grasp));
    }
    text
}

/// Status of the current grasp, and the reason.
fn describe_current(current: &v1::CurrentGraspReport) -> String {
    let mut text = name_of(current.status());
    if !current.moved_digits.is_empty() {
        let _ = write!(text, ", moved {}", list(current.moved_digits().map(name_of)));
    }
    if let Some(failed) = &current.failed_check {
        let _ = write!(text, ": {}", failed.description);
    }
    if current.no_grasp() != Check::Unspecified {
        let _ = write!(text, "; no other: {}", name_of(current.no_grasp()));
    }
    if let Some(motion) = &current.motion {
        let (distance, degrees) = (motion.distance, motion.angle.to_degrees());
        let _ = write!(text, "; {distance:.3} away, turned by {degrees:.0}°");
    }
    text
}

fn describe_grasp(grasp: &v1::Grasp) -> Vec<(&'static str, String)> {
    let mut lines = Vec::new();
    if let Some(hand) = &grasp.hand {
        let wrist = hand.client_from_wrist.unwrap_or_default();
        let (p, q) = (wrist.position(), wrist.orientation());
        let side = name_of(hand.handedness());
        lines.push(("hand", format!("{side}, rig {}", hand.rig)));
        let turn = format!("{:.4}, {:.4}, {:.4}, {:.4}", q.x, q.y, q.z, q.w);
        let text = format!("{:.4}, {:.4}, {:.4} m, turned {turn}", p.x, p.y, p.z);
        lines.push(("wrist", text));
    }
    let name = grasp_type_name(grasp);
    let sure = 100.0 * grasp.type_confidence;
    lines.push(("grasp type", format!("{name}, {sure:.0} % sure")));
    if let Some(thesis) = &grasp.thesis {
        lines.push(("comfort E", format!("{:.4}", thesis.comfort)));
        let angle = thesis.wrench_angle.to_degrees();
        lines.push(("wrench angle", format!("{angle:.2}°")));
    }
    if grasp.hangs {
        lines.push(("holds", "it hangs in hooked fingers".to_owned()));
    }
    if !grasp.margins.is_empty() {
        lines.push(("margins", describe_margins(grasp)));
    }
    if let Some(arm) = &grasp.arm {
        lines.push(("arm", describe_arm(arm)));
    }
    if let Some(score) = grasp.score {
        let term = |term: &v1::ScoreTerm| format!("{} {:.2}", term.name.replace('_', " "), term.value);
        let terms = list(grasp.score_terms.iter().map(term));
        lines.push(("score", format!("{score:.2}: {terms}")));
    }
    if !grasp.key_frames.is_empty() {
        let kinds = grasp.key_frames.iter().map(v1::KeyFrame::kind);
        lines.push(("key frames", list(kinds.map(name_of))));
    }
    lines
}

fn describe_margins(grasp: &v1::Grasp) -> String {
    let convention = grasp.hand.as_ref().map(v1::HandPose::convention);
    let unit = 1e3 * metres(convention.unwrap_or_default());
    let millimetres = |check| grasp.margin(check).map(|value| unit * value);
    let [closure, unbalanced] = [Check::Closure, Check::Balance].map(|check| grasp.margin(check));
    let margins = [
        closure.map(|epsilon| format!("epsilon {epsilon:.3}")),
        unbalanced.map(|share| format!("{:.1} % of the weight unbalanced", 100.0 * share)),
        millimetres(Check::Penetration).map(|depth| format!("{depth:.1} mm deep")),
        millimetres(Check::GiverClearance).map(|gap| format!("{gap:.1} mm clear of other hands")),
        millimetres(Check::ObstacleClearance).map(|gap| format!("{gap:.1} mm clear of obstacles")),
    ];
    list(margins.into_iter().flatten())
}

/// Where the arm's joints are, and how the wrist is bent.
fn describe_arm(arm: &v1::Arm) -> String {
    let point = |point: Option<v1::Vector3>| {
        let v1::Vector3 { x, y, z } = point.unwrap_or_default();
        format!("{x:.3}, {y:.3}, {z:.3}")
    };
    let bent = |radians: f32, ways: [&str; 2]| {
        let way = ways[usize::from(radians < 0.0)];
        format!("{:.0}° {way}", radians.to_degrees().abs())
    };
    let (shoulder, elbow) = (point(arm.client_shoulder), point(arm.client_elbow));
    let flexion = bent(arm.wrist_flexion, ["flexed", "extended"]);
    let sides = ["toward the little finger", "toward the thumb"];
    let deviation = bent(arm.wrist_deviation, sides);
    format!("shoulder {shoulder}, elbow {elbow} m, wrist {flexion} and {deviation}")
}

fn describe_search(answer: &v1::FindGraspResponse) -> Vec<(&'static str, String)> {
    let report = answer.report.clone().unwrap_or_default();
    let thesis = report.thesis.clone().unwrap_or_default();
    let (attempts, pruned) = (report.attempts, thesis.pruned_placements);
    let mut lines = vec![
        ("attempts", format!("{attempts} ({pruned} placements pruned)")),
        ("rejections", rejections(&report, usize::MAX, name_of)),
    ];
    if let Some(miss) = &report.nearest_miss {
        let verdict = miss.verdict.clone().unwrap_or_default();
        let check = name_of(verdict.check());
        let angle = verdict.value.filter(|_| verdict.check() == Check::Balance);
        let angle = angle.map_or_else(String::new, |angle| {
            format!(", wrench angle {:.2}°", angle.to_degrees())
        });
        let hand = of_hand(miss.hand.as_ref(), |hand| format!(" of the {hand} hand"));
        let attempt = miss.attempt;
        lines.push(("nearest miss", format!("attempt {attempt}{hand}: {check}{angle}")));
    }
    for limit in report.limits {
        lines.push(("limited by", limit.description));
    }
    lines.extend(warnings(&report.warnings));
    for (step, time) in STEPS.iter().zip(thesis.step_times) {
        let time = human_time(std_duration(time).as_secs_f64());
        lines.push(("time in step", format!("{step} {time}")));
    }
    if let Some(origin) = &answer.origin {
        let mut replay = format!("--seed {}", origin.seed);
        if let Some(attempt) = origin.attempt {
            let hand = of_hand(answer.hand(), |hand| format!(" --receiving-hand {hand}"));
            let _ = write!(replay, " --replay-attempt {attempt}{hand}");
        }
        lines.push(("replay", replay));
    }
    lines.push(("search", human_time(answer.search_time().as_secs_f64())));
    lines
}

/// A text about a hand's side, if it is known.
fn of_hand(hand: Option<&v1::HandPose>, text: impl Fn(String) -> String) -> String {
    match hand.map(v1::HandPose::handedness).unwrap_or_default() {
        Handedness::Unspecified => String::new(),
        side => text(name_of(side)),
    }
}

fn contact_table(grasp: &v1::Grasp) -> String {
    let mut table = table("digit | phalanx | >x / m | >y / m | >z / m | >triangle | >force / N");
    for contact in grasp.client_contacts() {
        let Vec3 { x, y, z } = contact.position();
        let digit = match contact.digit() {
            Digit::Unspecified => "palm".to_owned(),
            digit => name_of(digit),
        };
        let phalanx = match contact.phalanx {
            1 => "first",
            2 => "second",
            3 => "third",
            _ => "",
        };
        table.add_row([
            digit,
            phalanx.to_owned(),
            format!("{x:.4}"),
            format!("{y:.4}"),
            format!("{z:.4}"),
            contact.triangle.to_string(),
            format!("{:.3}", contact.force().length()),
        ]);
    }
    table.to_string()
}
