//! `grasp evaluate`

use std::{path::PathBuf, time::Duration};

use clap::{ArgGroup, Args};
use glam::Vec3;
use grasp_client::{
    built_in::request_for,
    v1::{self, presenting_hand::Form},
    wire_duration,
};

use crate::{
    EXIT_CODES, Ending, Failure, Output, ServerOptions,
    input::{HoldoutOptions, built_in, parse_duration},
    output::{list, name_of, pairs, table, warnings},
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
    /// Time limit for all givers together. Default: the server's.
    #[arg(long, value_name = "DURATION", value_parser = parse_duration)]
    budget: Option<Duration>,
    #[command(flatten)]
    server: ServerOptions,
}

pub(crate) async fn run(arguments: Arguments, output: Output) -> Result<Ending, Failure> {
    let (names, request) = arguments.to_request().await?;
    let client = arguments.server.connect().await?;
    let answer = client.evaluate_holdout(&request).await?;
    output.write_message(&answer, |answer| describe(&names, answer))?;
    // Also false for obstructions that only a newer server names.
    let can_be_taken = answer.ratings.iter().any(|rating| rating.no_grasp == 0);
    Ok(Ending::found(can_be_taken))
}

impl Arguments {
    async fn to_request(&self) -> Result<(Vec<String>, v1::EvaluateHoldoutRequest), Failure> {
        let mut names = self.holdout.clone();
        if self.request.is_some() {
            names.insert(0, "request".to_owned());
        }
        let first = HoldoutOptions {
            holdout: self.holdout.first().cloned().filter(|_| self.request.is_none()),
            request: self.request.clone(),
        };
        let mut holdout = first.to_request().await?;
        if let Some(budget) = self.budget {
            holdout.search_mut().budget = Some(wire_duration(budget));
        }
        let mut request = v1::EvaluateHoldoutRequest::from(holdout);
        for name in &names[1..] {
            let giver = giver_of(name, request.holdout_mut())?;
            request.other_presenting_hands.push(giver);
        }
        Ok((names, request))
    }
}

/// The giver's hand of a built-in holdout, at the object of another one.
fn giver_of(name: &str, holdout: &v1::Holdout) -> Result<v1::PresentingHand, Failure> {
    let other = request_for(built_in(name)?).holdout.unwrap_or_default();
    if other.object != holdout.object {
        let (other, object) = (&other.object, &holdout.object);
        let wrong = format!("holdout {name:?} is of {other}, not of {object}");
        return Err(Failure::usage(wrong));
    }
    let client_from_other = holdout.client_from_object() * other.client_from_object().inverse();
    match other.presenting_hand.and_then(|hand| hand.form) {
        Some(Form::Pose(hand)) => {
            let wrist = client_from_other * hand.client_from_wrist.unwrap_or_default();
            Ok(hand.with_client_from_wrist(wrist).into())
        }
        _ => Err(Failure::usage(format!("holdout {name:?} has no giver"))),
    }
}

fn describe(names: &[String], answer: &v1::EvaluateHoldoutResponse) -> String {
    let mut ratings = table(
        "giver | can be taken | >valid | >known | >share | >best score | from (object's axes) | in the way of the others",
    );
    for rating in &answer.ratings {
        let name = names.get(rating.presenting_hand as usize);
        let known: u32 = rating.sides.iter().map(|side| side.known).sum();
        let valid: u32 = rating.sides.iter().map(|side| side.valid).sum();
        ratings.add_row([
            name.cloned().unwrap_or_default(),
            match rating.no_grasp {
                0 => "yes".to_owned(),
                _ => name_of(rating.no_grasp()),
            },
            valid.to_string(),
            known.to_string(),
            percent(valid.into(), known),
            format!("{:.3}", rating.best_score),
            sides(rating),
            hindrances(rating, known),
        ]);
    }
    if answer.warnings.is_empty() {
        return ratings.to_string();
    }
    let warnings: Vec<_> = warnings(&answer.warnings).collect();
    format!("{ratings}\n\n{}", pairs(&warnings))
}

/// A share of the known grasps.
fn percent(count: u64, known: u32) -> String {
    format!("{:.0} %", 100.0 * count as f64 / f64::from(known.max(1)))
}

fn sides(rating: &v1::HoldoutRating) -> String {
    let mut free: Vec<_> = rating.sides.iter().filter(|side| side.valid > 0).collect();
    free.sort_by_key(|side| std::cmp::Reverse(side.valid));
    list(free.into_iter().map(|side| {
        let direction = side.direction.unwrap_or_default();
        format!("{} {}/{}", axis(direction.into()), side.valid, side.known)
    }))
}

fn axis(direction: Vec3) -> &'static str {
    let axis = direction.abs().max_position();
    let names = [["-x", "+x"], ["-y", "+y"], ["-z", "+z"]];
    names[axis][usize::from(direction[axis] > 0.0)]
}

fn hindrances(rating: &v1::HoldoutRating, known: u32) -> String {
    list(rating.hindrances.iter().map(|hindrance| {
        let share = percent(hindrance.count, known);
        format!("{} {share}", name_of(hindrance.check()))
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn givers_of_other_holdouts_keep_their_place_at_the_object() {
        let [first, other] = ["remote-hold1", "remote-hold2"]
            .map(|name| request_for(built_in(name).unwrap()).holdout.unwrap());
        let at_object = |holdout: &v1::Holdout, hand: Option<v1::PresentingHand>| {
            let Some(Form::Pose(hand)) = hand.unwrap().form else {
                panic!("built-in givers have angles")
            };
            (holdout.client_from_object().inverse() * hand.client_from_wrist.unwrap()).position()
        };
        let a = at_object(&first, Some(giver_of("remote-hold2", &first).unwrap()));
        let b = at_object(&other, other.presenting_hand.clone());
        assert!(a.abs_diff_eq(b, 1e-5), "{a} {b}");
        assert!(giver_of("scissors-hold1", &first).is_err());
    }
}
