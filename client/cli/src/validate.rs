//! `grasp validate`

use std::{path::PathBuf, time::Duration};

use clap::Args;
use grasp_client::{
    json::{JsonError, from_json},
    v1::{self, validate_grasp_request::Grasp},
    wire_duration,
};
use serde_json::Value;

use crate::{
    EXIT_CODES, Ending, Failure, Output, ServerOptions, blocking,
    input::{HoldoutOptions, parse_duration, read_json},
    output::{grasp_type_name, name_of, pairs, table, warnings, yes_or_no},
};

/// The long help: the forms of a grasp as JSON.
const ABOUT: &str = r#"Check a grasp against everything that a found one passes.

The holdout is one of the built-in ones (--holdout) or a JSON file as for `grasp find` (--request). The grasp (--grasp) is
what `grasp find --json` wrote, one of the grasps in it, or the API's HandPose as "pose" or HandJoints as "joints", such as

  {"pose": {"rig": "rigs/adult", "handedness": "HANDEDNESS_RIGHT", "objectFromWrist": {"position": {"y": 0.1}},
    "thumb": {}, "index": {"basePitch": 0.2, "secondPitch": 0.3, "thirdPitch": 0.2}, "middle": {}, "ring": {}, "little": {}}}

With --json the answer is the API's ValidateGraspResponse in protobuf's JSON."#;

/// Default time limit of the search for a grasp near an invalid one.
const NEAREST_BUDGET: Duration = Duration::from_secs(1);

/// Check a grasp against everything that a found one passes.
#[derive(Args, Debug)]
#[command(long_about = ABOUT, after_help = EXIT_CODES)]
pub(crate) struct Arguments {
    #[command(flatten)]
    holdout: HoldoutOptions,
    /// A JSON file with the grasp, such as the output of find --json; - for standard input.
    #[arg(long, value_name = "FILE")]
    grasp: PathBuf,
    /// Also search for a valid grasp near it, if it is not valid.
    #[arg(long)]
    find_nearest: bool,
    /// Time limit of that search. Default: the request's, or 1s.
    #[arg(long, value_name = "DURATION", value_parser = parse_duration, requires = "find_nearest")]
    budget: Option<Duration>,
    #[command(flatten)]
    server: ServerOptions,
}

pub(crate) async fn run(arguments: Arguments, output: Output) -> Result<Ending, Failure> {
    let holdout = arguments.holdout.to_request().await?;
    let budget = arguments.budget.or(holdout.budget()).unwrap_or(NEAREST_BUDGET);
    let path = arguments.grasp;
    let given = blocking(move || read_json("grasp", &path)).await?;
    let request = v1::ValidateGraspRequest {
        grasp: Some(grasp(&given)?),
        nearest_budget: arguments.find_nearest.then(|| wire_duration(budget)),
        ..holdout.into()
    };
    let client = arguments.server.connect().await?;
    let answer = client.validate_grasp(&request).await?;
    output.write_message(&answer, describe)?;
    Ok(Ending::found(answer.valid))
}

/// The grasp of a file: a grasp to validate, an answer, or a grasp of an answer.
fn grasp(given: &Value) -> Result<Grasp, Failure> {
    let wrong = |error: JsonError| Failure::usage(format!("grasp: {error}"));
    if given.get("hand").is_some() {
        let grasp: v1::Grasp = from_json(given).map_err(wrong)?;
        return Ok(Grasp::Pose(grasp.hand.unwrap_or_default()));
    }
    if given.get("grasps").or(given.get("outcome")).is_some() {
        let answer: v1::FindGraspResponse = from_json(given).map_err(wrong)?;
        let hand = answer.hand().cloned().map(Grasp::Pose);
        return hand.ok_or_else(|| Failure::usage("grasp: the answer has no grasp"));
    }
    let request: v1::ValidateGraspRequest = from_json(given).map_err(wrong)?;
    let none = || Failure::usage("grasp: it has none of pose, joints, hand and grasps");
    request.grasp.ok_or_else(none)
}

fn describe(answer: &v1::ValidateGraspResponse) -> String {
    let mut verdicts = table(" | check | >figure | >bound | what it is");
    let number = |number: Option<f32>| number.map_or_else(String::new, |number| format!("{number:.4}"));
    for verdict in &answer.verdicts {
        verdicts.add_row([
            if verdict.passed { "✓" } else { "✗" }.to_owned(),
            name_of(verdict.check()),
            number(verdict.value),
            number(verdict.bound),
            verdict.description.clone(),
        ]);
    }
    let mut lines = vec![("valid", yes_or_no(answer.valid))];
    if let Some(grasp) = &answer.grasp {
        lines.push(("grasp type", grasp_type_name(grasp)));
        lines.extend(grasp.score.map(|score| ("score", format!("{score:.3}"))));
    }
    if let Some(farthest) = answer.joint_error {
        let text = format!("{farthest:.4} from where it is tracked");
        lines.push(("farthest joint", text));
    }
    if let (Some(nearest), Some(way)) = (&answer.nearest, &answer.nearest_motion) {
        let text = format!(
            "{}, {:.4} away, turned by {:.1}°, fingertips by {:.4}; the way is {}",
            grasp_type_name(nearest),
            way.distance,
            way.angle.to_degrees(),
            way.fingertips,
            if way.free { "free" } else { "not free" }
        );
        lines.push(("nearest valid", text));
    }
    lines.extend(warnings(&answer.warnings));
    format!("{verdicts}\n\n{}", pairs(&lines))
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn reads_a_hand_and_rejects_other_json() {
        let hand =
            json!({"rig": "rigs/adult", "handedness": "HANDEDNESS_LEFT", "little": {"basePitch": 0.25}});
        for form in [
            json!({ "pose": hand }),
            json!({ "hand": hand, "score": 0.5 }),
            json!({ "outcome": "OUTCOME_FOUND", "grasps": [{ "hand": hand }] }),
        ] {
            let Grasp::Pose(read) = grasp(&form).unwrap() else {
                panic!("{form}")
            };
            assert_eq!(
                (read.rig.as_str(), read.little.unwrap().base_pitch),
                ("rigs/adult", 0.25)
            );
        }
        let joints = json!({"joints": {"handedness": "HANDEDNESS_LEFT"}});
        assert!(matches!(grasp(&joints), Ok(Grasp::Joints(_))));
        for (wrong, word) in [
            (json!([]), "sequence"),
            (json!({}), "none of pose"),
            (json!({"pose": {"rigg": "rigs/adult"}}), "rigg"),
            (json!({"outcome": "OUTCOME_FOUND"}), "no grasp"),
        ] {
            let message = grasp(&wrong).unwrap_err().message;
            assert!(message.contains(word), "{message}");
        }
    }
}
