//! `grasp validate`

use std::{fmt::Write as _, path::PathBuf, time::Duration};

use clap::{ArgGroup, Args};
use grasp_client::{FindRequest, Grasp, GraspToValidate, HandAtObject, ValidateAnswer, ValidateRequest};
use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::{
    EXIT_CODES, Ending, blocking,
    failure::Failure,
    format::{grasp_type_name, human_time, name_of},
    input::{find_request, message_of, read_json},
    output::{Output, pairs, table},
    server_options::ServerOptions,
    values::parse_duration,
};

/// The long help: the forms of a grasp as JSON.
const ABOUT: &str = r#"Check a grasp against everything that a found one passes.

The holdout is one of the built-in ones (--holdout) or a JSON file as for `grasp find` (--request). The grasp (--grasp) is
what `grasp find --json` wrote, or the API's GraspToValidate in protobuf's JSON, such as

  {"hand": {"rig": "adult", "handedness": "HANDEDNESS_RIGHT", "objectFromWrist": {"position": {"y": 0.1}},
    "digits": [{"basePitch": 0.2, "secondPitch": 0.3, "thirdPitch": 0.2}, …five, thumb first]}}

With --json the answer is the API's ValidateGraspResponse in protobuf's JSON."#;

/// Check a grasp against everything that a found one passes.
#[derive(Args, Debug)]
#[command(long_about = ABOUT, after_help = EXIT_CODES)]
#[command(group(ArgGroup::new("what").required(true).args(["holdout", "request"])))]
pub(crate) struct Arguments {
    /// A built-in holdout, such as remote-hold1.
    #[arg(long, value_name = "NAME")]
    holdout: Option<String>,
    /// A JSON file with a request, as for find; - for standard input.
    #[arg(long, value_name = "FILE")]
    request: Option<PathBuf>,
    /// A JSON file with the grasp, such as the output of find --json; - for standard input.
    #[arg(long, value_name = "FILE")]
    grasp: PathBuf,
    /// Also search for a valid grasp near it, if it is not valid.
    #[arg(long)]
    find_nearest: bool,
    /// Time limit of that search. Default: the server's.
    #[arg(long, value_name = "DURATION", value_parser = parse_duration, requires = "find_nearest")]
    budget: Option<Duration>,
    #[command(flatten)]
    server: ServerOptions,
}

pub(crate) async fn run(arguments: Arguments, output: Output) -> Result<Ending, Failure> {
    let mut holdout = find_request(arguments.holdout.as_deref(), arguments.request.as_deref()).await?;
    holdout.budget = arguments.budget.or(holdout.budget);
    let path = arguments.grasp;
    let given = blocking(move || read_json("grasp", &path)).await?;
    let request = ValidateRequest {
        grasp: grasp(given, &holdout)?,
        holdout,
        find_nearest: arguments.find_nearest,
    };
    let client = arguments.server.connect().await?;
    let answer = client.validate_grasp(&request).await?;
    output.write_message("ValidateGraspResponse", &answer, describe)?;
    Ok(if answer.valid {
        Ending::Done
    } else {
        Ending::NotValid
    })
}

/// The grasp of a file: one to validate, an answer, or the grasp of one.
fn grasp(given: Value, holdout: &FindRequest) -> Result<GraspToValidate, Failure> {
    fn read<T: DeserializeOwned>(message: &str, value: Value) -> Result<T, Failure> {
        message_of(message, value).map_err(|error| Failure::Usage(format!("grasp: {error}")))
    }
    let Value::Object(mut fields) = given else {
        return Err(Failure::Usage("grasp: it is not a JSON object".to_owned()));
    };
    if ["hand", "angles", "joints"]
        .iter()
        .any(|form| fields.len() == 1 && fields.contains_key(*form))
    {
        return read("GraspToValidate", Value::Object(fields));
    }
    let found: Grasp = match fields.remove("grasp") {
        Some(Value::Null) => {
            return Err(Failure::Usage(
                "grasp: it is null; the answer has no grasp".to_owned(),
            ));
        }
        Some(grasp) => read("Grasp", grasp)?,
        None => read("Grasp", Value::Object(fields))?,
    };
    Ok(GraspToValidate::Hand(HandAtObject {
        rig: found.rig,
        handedness: found.handedness,
        // Answers are of the size that was asked for.
        hand_scale: holdout.receiving_hand.hand_scale,
        object_from_wrist: found.object_from_wrist,
        digits: found.digits,
    }))
}

/// The answer for people.
fn describe(answer: &ValidateAnswer) -> String {
    let mut verdicts = table(&["", "check", ">figure", ">bound", "what it is"]);
    for verdict in &answer.verdicts {
        let number = |number: Option<f32>| number.map_or_else(String::new, |number| format!("{number:.4}"));
        verdicts.add_row([
            if verdict.passed { "✓" } else { "✗" }.to_owned(),
            name_of(&verdict.check),
            number(verdict.figure),
            number(verdict.bound),
            verdict.description.clone(),
        ]);
    }
    let mut lines = vec![
        ("valid", if answer.valid { "yes" } else { "no" }.to_owned()),
        ("grasp type", grasp_type_name(&answer.grasp)),
    ];
    if let Some(score) = &answer.grasp.score {
        lines.push(("score", format!("{:.3}", score.total)));
    }
    if let Some(farthest) = answer.farthest_joint {
        lines.push((
            "farthest joint",
            format!("{farthest:.4} from where it is tracked"),
        ));
    }
    if let (Some(nearest), Some(way)) = (&answer.nearest, &answer.way_to_nearest) {
        lines.push((
            "nearest valid",
            format!(
                "{}, {:.4} away, turned by {:.1}°, fingertips by {:.4}; the way is {}",
                grasp_type_name(nearest),
                way.distance,
                way.angle.to_degrees(),
                way.fingertips,
                if way.free { "free" } else { "not free" }
            ),
        ));
    }
    lines.extend(answer.warnings.iter().map(|warning| ("warning", warning.clone())));
    lines.push(("checked in", human_time(answer.check_time.as_secs_f64())));
    let mut text = verdicts.to_string();
    let _ = write!(text, "\n\n{}", pairs(&lines));
    text
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn hand() -> Value {
        let digit = json!({"basePitch": 0.25, "secondPitch": 0.5});
        json!({"rig": "adult", "handedness": "HANDEDNESS_LEFT", "digits": [digit, digit, digit, digit, digit]})
    }

    #[test]
    fn reads_a_hand_and_rejects_what_is_no_grasp() {
        let holdout = FindRequest::new("objects/remote");
        let read = grasp(json!({ "hand": hand() }), &holdout).unwrap();
        let GraspToValidate::Hand(read) = read else {
            panic!("{read:?}")
        };
        assert_eq!((read.rig.as_str(), read.digits[4].base_pitch), ("adult", 0.25));
        for (wrong, word) in [
            (json!([]), "object"),
            (json!({"grasp": null}), "no grasp"),
            (json!({"hand": {}}), "rig"),
            (json!({"outcome": "OUTCOME_FOUND"}), "outcome"),
        ] {
            let Err(Failure::Usage(message)) = grasp(wrong.clone(), &holdout) else {
                panic!("{wrong}")
            };
            assert!(message.contains(word), "{message}");
        }
    }
}
