//! An answer for people.

use std::fmt::Write as _;

use glam::Vec3;
use grasp_client::{Arm, FindAnswer, FindRequest, Grasp, Handedness, Outcome, SearchReport, StandingReport};

use crate::{
    format::{all_rejections, grasp_type_name, human_time, name_of},
    output::{pairs, table},
};

/// The whole answer as text.
pub(super) fn describe(request: &FindRequest, answer: &FindAnswer, round_trip_seconds: f64) -> String {
    let report = &answer.report;
    let mut lines = vec![
        ("object", request.object.clone()),
        (
            "outcome",
            match answer.outcome {
                Outcome::Found => "found".to_owned(),
                Outcome::BudgetExhausted => "no grasp within the budget".to_owned(),
                Outcome::Aborted => "aborted: the committed grasp is not valid".to_owned(),
            },
        ),
    ];
    if let Some(standing) = &answer.standing {
        lines.push(("standing grasp", describe_standing(standing)));
    }
    for grasp in answer.grasp.iter().chain(&answer.other_grasp) {
        lines.extend(describe_grasp(grasp));
    }
    lines.extend(describe_search(
        report,
        answer.grasp.as_ref().map(|grasp| grasp.handedness),
    ));
    lines.push(("round trip", human_time(round_trip_seconds)));
    let mut text = pairs(&lines);
    for grasp in answer.grasp.iter().chain(&answer.other_grasp) {
        let _ = write!(text, "\n\n{}", contact_table(grasp));
    }
    text
}

/// What became of the standing grasp, and why.
fn describe_standing(standing: &StandingReport) -> String {
    let mut text = name_of(&standing.status).replace('_', " ");
    if !standing.moved_digits.is_empty() {
        let moved: Vec<_> = standing.moved_digits.iter().map(name_of).collect();
        let _ = write!(text, ", moved {}", moved.join(", "));
    }
    if let Some(fall) = &standing.fall {
        let _ = write!(text, ": {}", fall.description);
    }
    if let Some(reason) = &standing.no_grasp {
        let _ = write!(text, "; no other: {}", name_of(reason).replace('_', " "));
    }
    if let Some(way) = &standing.way {
        let _ = write!(
            text,
            "; {:.3} away, turned by {:.0}°",
            way.distance,
            way.angle.to_degrees()
        );
    }
    text
}

fn describe_grasp(grasp: &Grasp) -> Vec<(&'static str, String)> {
    let wrist = grasp.client_from_wrist;
    let (p, q) = (wrist.position, wrist.orientation);
    let mut lines = vec![
        (
            "hand",
            format!("{}, rig {}", name_of(&grasp.handedness), grasp.rig),
        ),
        (
            "wrist",
            format!(
                "{:.4}, {:.4}, {:.4} m, turned {:.4}, {:.4}, {:.4}, {:.4}",
                p.x, p.y, p.z, q.x, q.y, q.z, q.w
            ),
        ),
        ("grasp type", grasp_type(grasp)),
        ("comfort E", format!("{:.4}", grasp.comfort)),
        ("wrench angle", format!("{:.2}°", grasp.wrench_angle.to_degrees())),
    ];
    if grasp.hangs {
        lines.push(("holds", "it hangs in hooked fingers".to_owned()));
    }
    if let Some(margins) = &grasp.margins {
        let giver = margins.giver_clearance.map_or_else(String::new, |clearance| {
            format!(", {:.1} mm clear of other hands", 1e3 * clearance)
        });
        let obstacles = margins.obstacle_clearance.map_or_else(String::new, |clearance| {
            format!(", {:.1} mm clear of obstacles", 1e3 * clearance)
        });
        lines.push((
            "margins",
            format!(
                "epsilon {:.3}, {:.1} % of the weight unbalanced, {:.1} mm deep{giver}{obstacles}",
                margins.epsilon,
                100.0 * margins.residual,
                1e3 * margins.penetration
            ),
        ));
    }
    if let Some(arm) = &grasp.arm {
        lines.push(("arm", describe_arm(arm)));
    }
    if let Some(score) = &grasp.score {
        let terms: Vec<_> = score
            .terms
            .iter()
            .map(|term| format!("{} {:.2}", term.name.replace('_', " "), term.value))
            .collect();
        lines.push(("score", format!("{:.2}: {}", score.total, terms.join(", "))));
    }
    if !grasp.key_frames.is_empty() {
        let names: Vec<_> = grasp
            .key_frames
            .iter()
            .map(|frame| name_of(&frame.kind))
            .collect();
        lines.push(("key frames", names.join(", ")));
    }
    lines
}

/// Where the arm's joints are, and how the wrist is bent.
fn describe_arm(arm: &Arm) -> String {
    let point = |p: Vec3| format!("{:.3}, {:.3}, {:.3}", p.x, p.y, p.z);
    let bent = |radians: f32, [positive, negative]: [&str; 2]| {
        let toward = if radians < 0.0 { negative } else { positive };
        format!("{:.0}° {toward}", radians.to_degrees().abs())
    };
    format!(
        "{}shoulder {}, elbow {} m, wrist {} and {}",
        if arm.assumed { "assumed " } else { "" },
        point(arm.client_shoulder),
        point(arm.client_elbow),
        bent(arm.wrist_flexion, ["flexed", "extended"]),
        bent(
            arm.wrist_deviation,
            ["toward the little finger", "toward the thumb"]
        ),
    )
}

/// The grasp's type and its confidence.
fn grasp_type(grasp: &Grasp) -> String {
    let name = grasp_type_name(grasp);
    format!("{name}, {:.0} % sure", 100.0 * grasp.type_confidence)
}

fn describe_search(report: &SearchReport, hand: Option<Handedness>) -> Vec<(&'static str, String)> {
    let mut lines = vec![
        (
            "attempts",
            format!(
                "{} ({} placements pruned)",
                report.attempts, report.pruned_placements
            ),
        ),
        ("rejections", all_rejections(report)),
    ];
    if let Some(miss) = &report.nearest_miss {
        let angle = miss.wrench_angle.map_or_else(String::new, |angle| {
            format!(", wrench angle {:.2}°", angle.to_degrees())
        });
        lines.push((
            "nearest miss",
            format!(
                "attempt {}{}: {}{angle}",
                miss.attempt,
                miss.handedness
                    .map_or_else(String::new, |hand| format!(" of the {} hand", name_of(&hand))),
                name_of(&miss.rejection)
            ),
        ));
    }
    for limit in &report.limits {
        lines.push(("limited by", limit.description.clone()));
    }
    lines.extend(report.warnings.iter().map(|warning| ("warning", warning.clone())));
    for time in &report.step_times {
        lines.push((
            "time in step",
            format!("{} {}", name_of(&time.step), human_time(time.time.as_secs_f64())),
        ));
    }
    lines.push((
        "replay",
        match report.attempt {
            Some(attempt) => {
                let hand = hand.map_or_else(String::new, |hand| {
                    format!(" --receiving-hand {}", name_of(&hand))
                });
                format!("--seed {} --only-attempt {attempt}{hand}", report.seed)
            }
            None => format!("--seed {}", report.seed),
        },
    ));
    lines.push((
        "search",
        format!(
            "{} of {} with {} workers",
            human_time(report.search_time.as_secs_f64()),
            human_time(report.budget.as_secs_f64()),
            report.workers
        ),
    ));
    lines
}

fn contact_table(grasp: &Grasp) -> String {
    let mut table = table(&[
        "digit",
        "phalanx",
        ">x / m",
        ">y / m",
        ">z / m",
        ">triangle",
        ">force / N",
    ]);
    for contact in &grasp.contacts {
        let p = contact.client_position;
        table.add_row([
            contact
                .digit
                .map_or_else(|| "palm".to_owned(), |digit| name_of(&digit)),
            contact
                .phalanx
                .map_or_else(String::new, |phalanx| name_of(&phalanx)),
            format!("{:.4}", p.x),
            format!("{:.4}", p.y),
            format!("{:.4}", p.z),
            contact.triangle.to_string(),
            format!("{:.3}", contact.client_force.length()),
        ]);
    }
    table.to_string()
}
