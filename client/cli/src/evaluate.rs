//! `grasp evaluate`

use std::{fmt::Write as _, path::PathBuf, time::Duration};

use clap::{ArgGroup, Args};
use glam::Vec3;
use grasp_client::{
    EvaluateAnswer, EvaluateRequest, FindRequest, HoldoutRating, PresentingHand, built_in::request_for,
};

use crate::{
    EXIT_CODES, Ending,
    failure::Failure,
    format::{human_time, name_of},
    holdout::built_in,
    input::find_request,
    output::{Output, pairs, table},
    server_options::ServerOptions,
    values::parse_duration,
};

/// The long help.
const ABOUT: &str = "\
Rate whether and from which sides an object can be taken.

The holdout is one of the built-in ones (--holdout) or a JSON file as for `grasp find` (--request). Further --holdout of the same
object add their giver's hand, as it holds the object there, and are ranked with it.

With --json the answer is the API's EvaluateHoldoutResponse in protobuf's JSON.";

/// Rate whether and from which sides an object can be taken.
#[derive(Args, Debug)]
#[command(long_about = ABOUT, after_help = EXIT_CODES)]
#[command(group(ArgGroup::new("what").required(true).multiple(true).args(["holdout", "request"])))]
pub(crate) struct Arguments {
    /// A built-in holdout, such as remote-hold1; may be repeated.
    #[arg(long, value_name = "NAME")]
    holdout: Vec<String>,
    /// A JSON file with a request, as for find; - for standard input. Its giver comes first.
    #[arg(long, value_name = "FILE")]
    request: Option<PathBuf>,
    /// Time limit, of all givers together. Default: the server's.
    #[arg(long, value_name = "DURATION", value_parser = parse_duration)]
    budget: Option<Duration>,
    #[command(flatten)]
    server: ServerOptions,
}

pub(crate) async fn run(arguments: Arguments, output: Output) -> Result<Ending, Failure> {
    let (names, request) = arguments.to_request().await?;
    let client = arguments.server.connect().await?;
    let answer = client.evaluate_holdout(&request).await?;
    output.write_message("EvaluateHoldoutResponse", &answer, |answer| {
        describe(&names, answer)
    })?;
    let is_receivable = answer.ratings.iter().any(|rating| rating.receivable);
    Ok(if is_receivable {
        Ending::Done
    } else {
        Ending::NoGrasp
    })
}

impl Arguments {
    /// The names of the givers, and the request.
    async fn to_request(&self) -> Result<(Vec<String>, EvaluateRequest), Failure> {
        let (first, others) = match (&self.request, self.holdout.split_first()) {
            (None, Some((first, others))) => (first.as_str(), others),
            (Some(_), _) | (None, None) => ("request", self.holdout.as_slice()),
        };
        let by_name = self.request.is_none().then_some(first);
        let mut holdout = find_request(by_name, self.request.as_deref()).await?;
        holdout.budget = self.budget.or(holdout.budget);
        let mut names = vec![first.to_owned()];
        let mut other_presenting_hands = Vec::new();
        for name in others {
            other_presenting_hands.push(giver_of(name, &holdout)?);
            names.push(name.clone());
        }
        let request = EvaluateRequest {
            holdout,
            other_presenting_hands,
        };
        Ok((names, request))
    }
}

/// The giver's hand of a built-in holdout, at the object of another one.
fn giver_of(name: &str, holdout: &FindRequest) -> Result<PresentingHand, Failure> {
    let other = request_for(built_in(name)?);
    if other.object != holdout.object {
        return Err(Failure::Usage(format!(
            "holdout {name:?} is of {}, not of {}",
            other.object, holdout.object
        )));
    }
    match other.presenting_hand {
        Some(PresentingHand::Angles(mut hand)) => {
            let client_from_other = holdout.client_from_object * other.client_from_object.inverse();
            hand.client_from_wrist = client_from_other * hand.client_from_wrist;
            Ok(PresentingHand::Angles(hand))
        }
        _ => Err(Failure::Usage(format!("holdout {name:?} has no giver"))),
    }
}

/// The answer for people: givers from the best on.
fn describe(names: &[String], answer: &EvaluateAnswer) -> String {
    let mut ratings = table(&[
        "giver",
        "can be taken",
        ">valid",
        ">known",
        ">share",
        ">best score",
        "from (object's axes)",
        "in the way of the others",
    ]);
    let ranked = answer.ranking.iter().filter_map(|&place| {
        let rating = answer.ratings.get(place as usize)?;
        Some((names.get(place as usize)?, rating))
    });
    for (name, rating) in ranked {
        ratings.add_row([
            name.clone(),
            match (rating.receivable, rating.reason) {
                (true, _) => "yes".to_owned(),
                (false, Some(reason)) => name_of(&reason),
                (false, None) => "no".to_owned(),
            },
            rating.valid.to_string(),
            rating.known.to_string(),
            format!("{:.0} %", 100.0 * rating.valid_share),
            format!("{:.3}", rating.best_score),
            sides(rating),
            hindrances(rating),
        ]);
    }
    let mut lines: Vec<(&str, String)> = answer
        .warnings
        .iter()
        .map(|warning| ("warning", warning.clone()))
        .collect();
    lines.push(("time", human_time(answer.time.as_secs_f64())));
    let mut text = ratings.to_string();
    let _ = write!(text, "\n\n{}", pairs(&lines));
    text
}

/// The sides with valid grasps, most first.
fn sides(rating: &HoldoutRating) -> String {
    let mut free: Vec<_> = rating.sides.iter().filter(|side| side.valid > 0).collect();
    free.sort_by_key(|side| std::cmp::Reverse(side.valid));
    let names: Vec<String> = free
        .iter()
        .map(|side| format!("{} {}/{}", axis(side.object_direction), side.valid, side.known))
        .collect();
    names.join(", ")
}

/// The name of a direction along an axis.
fn axis(direction: Vec3) -> &'static str {
    let axis = direction.abs().max_position();
    match (axis, direction[axis] > 0.0) {
        (0, true) => "+x",
        (0, false) => "-x",
        (1, true) => "+y",
        (1, false) => "-y",
        (_, true) => "+z",
        (_, false) => "-z",
    }
}

fn hindrances(rating: &HoldoutRating) -> String {
    let names: Vec<String> = rating
        .hindrances
        .iter()
        .map(|hindrance| format!("{} {:.0} %", name_of(&hindrance.what), 100.0 * hindrance.share))
        .collect();
    names.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn givers_of_other_holdouts_keep_their_place_at_the_object() {
        let first = request_for(built_in("remote-hold1").unwrap());
        let other = request_for(built_in("remote-hold2").unwrap());
        let PresentingHand::Angles(moved) = giver_of("remote-hold2", &first).unwrap() else {
            panic!("built-in givers have angles")
        };
        let Some(PresentingHand::Angles(original)) = &other.presenting_hand else {
            panic!("built-in givers have angles")
        };
        let at_object = |holdout: &FindRequest, wrist: grasp_client::Pose| {
            (holdout.client_from_object.inverse() * wrist).position
        };
        let (a, b) = (
            at_object(&first, moved.client_from_wrist),
            at_object(&other, original.client_from_wrist),
        );
        assert!(a.abs_diff_eq(b, 1e-5), "{a} {b}");
        assert!(giver_of("scissors-hold1", &first).is_err());
    }

    #[test]
    fn axes_are_named_with_their_sign() {
        assert_eq!(axis(Vec3::NEG_Y), "-y");
        assert_eq!(axis(Vec3::Z), "+z");
    }
}
