//! `grasp find`

mod answer;
mod drawing;
mod stream;

use std::{
    path::PathBuf,
    time::{Duration, Instant},
};

use clap::Args;
use grasp_client::{
    GraspChoice, Handedness, Outcome, Strategy,
    v1::{self, BendRatios},
    wire_duration,
};

use drawing::DrawOptions;
use stream::StreamOptions;

use crate::{
    EXIT_CODES, Ending, Failure, Output, ServerOptions, blocking,
    input::{HoldoutOptions, read_message},
    output::write_message,
    values::{Choice, HANDS, STRATEGIES, full_name, one_of, parse_duration},
};

/// Whether the checks that a valid grasp must pass are the thesis's.
const VALIDITIES: [Choice<bool>; 2] = [
    ("thesis", true, "The checks of the thesis"),
    ("physical", false, "Solid hands, and forces that hold the object"),
];

/// The columns of Figure 5.20.
const BEND_RATIOS: [Choice<BendRatios>; 6] = [
    ("all", BendRatios::All, "0.7, 1 and 1.42 in turn"),
    (
        "all-fingers-without-low",
        BendRatios::AllFingersWithoutLow,
        "The same, but fingers skip 0.7",
    ),
    ("one-random", BendRatios::OneRandom, "One of the three, at random"),
    (
        "one-random-fingers-without-low",
        BendRatios::OneRandomFingersWithoutLow,
        "The same, but fingers skip 0.7",
    ),
    ("only-one", BendRatios::OnlyOne, "Only 1"),
    ("only-high", BendRatios::OnlyHigh, "Only 1.42"),
];

/// Which valid grasp is returned.
const CHOICES: [Choice<GraspChoice>; 2] = [
    ("first", GraspChoice::FirstValid, "The first one found"),
    (
        "best",
        GraspChoice::BestWithinBudget,
        "The best one found within the budget",
    ),
];

/// The long help: the shapes of requests and answers as JSON.
const ABOUT: &str = r#"Ask for a grasp on an object that is held out.

The holdout is one of the built-in ones (--holdout) or a JSON file (--request): the API's FindGraspRequest in protobuf's JSON, as
grpcurl and the libraries of all languages write it. Only the object is required:

  {
    "holdout": {
      "object": "objects/remote",
      "clientFromObject": {"position": {"y": 1.2, "z": 0.4}, "orientation": {"w": 1}},
      "presentingHand": {"pose": {
        "rig": "rigs/thesis", "handedness": "HANDEDNESS_RIGHT", "clientFromWrist": {"position": {"y": 1.2, "z": 0.2}},
        "thumb": {}, "index": {"basePitch": 0.2, "secondPitch": 0.3, "thirdPitch": 0.2}, "middle": {}, "ring": {}, "little": {}}},
      "obstacles": [{"box": {"pose": {"position": {"y": 0.7}}, "halfExtents": {"x": 0.6, "y": 0.02, "z": 0.4}}}]
    },
    "receiver": {"handedness": "HANDEDNESS_LEFT"},
    "search": {"budget": "0.5s", "seed": "42"}
  }

--print-request prints the request instead of sending it, as a template: with --holdout, and with options, which override the file.
What else the API has, such as requirements, the receiver's body and obstacles, is written into the file.

With --stream, a line comes for each grasp that is better than those before, until the budget ends; with --alternatives, the best
ones that differ. --png and --glb then write a file of each grasp, with -1, -2 … before the extension. With --json, each line is a
FindGraspResponse in protobuf's JSON, the last one without a grasp.

With --json the answer is a FindGraspResponse in protobuf's JSON."#;

/// Ask for a grasp on an object that is held out.
#[derive(Args, Debug)]
#[command(long_about = ABOUT, after_help = EXIT_CODES)]
pub(crate) struct Arguments {
    #[command(flatten)]
    holdout: HoldoutOptions,
    /// Search strategy. Default: the server's.
    #[arg(long, value_parser = one_of(STRATEGIES), ignore_case = true)]
    strategy: Option<Strategy>,
    /// Checks that a grasp must pass. Default: the server's.
    #[arg(long, value_parser = one_of(VALIDITIES))]
    validity: Option<bool>,
    /// Bend ratios that fingers try. Default: the strategy's own.
    #[arg(long, value_parser = one_of(BEND_RATIOS))]
    bend_ratios: Option<BendRatios>,
    /// Which valid grasp to return. Default: the first.
    #[arg(long, value_parser = one_of(CHOICES), conflicts_with = "reproducible")]
    choice: Option<GraspChoice>,
    /// Time limit of the search. Default: the server's.
    #[arg(long, value_name = "DURATION", value_parser = parse_duration)]
    budget: Option<Duration>,
    /// Seed of all random streams. Default: drawn by the server.
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Replay: run only this attempt of the seed and --receiving-hand, without trying known grasps first.
    #[arg(long, value_name = "N", requires = "seed")]
    replay_attempt: Option<u64>,
    /// Decide by the indices of the valid attempts, whatever the number of workers.
    #[arg(long)]
    reproducible: bool,
    /// Search from scratch, without the object's known grasps.
    #[arg(long)]
    ignore_atlas: bool,
    /// The hand to pose. Default: either.
    #[arg(long, value_name = "HAND", value_parser = one_of(HANDS))]
    receiving_hand: Option<Handedness>,
    /// The rig of the hand to pose: "adult" or "rigs/adult". Default: the server's.
    #[arg(long, value_name = "RIG")]
    receiving_rig: Option<String>,
    /// Hold on to the grasp of an earlier answer, a file that --json wrote, while it is valid; - for standard input.
    #[arg(long, value_name = "FILE")]
    current: Option<PathBuf>,
    /// Print the request as JSON instead of sending it.
    #[arg(long)]
    print_request: bool,
    #[command(flatten)]
    draw: DrawOptions,
    #[command(flatten)]
    stream: StreamOptions,
    #[command(flatten)]
    server: ServerOptions,
}

pub(crate) async fn run(arguments: Arguments, output: Output) -> Result<Ending, Failure> {
    let request = arguments.to_request().await?;
    if arguments.print_request {
        write_message(&request)?;
        return Ok(Ending::Done);
    }
    let client = arguments.server.connect().await?;
    // Reports what cannot be drawn before the search.
    let drawing = arguments.draw.drawing(&client, &request).await?;
    if let Some(sent) = arguments.stream.sent() {
        let request = v1::StreamGraspsRequest {
            sent: Some(sent),
            ..request.into()
        };
        return Box::pin(stream::run(&client, &request, drawing, output)).await;
    }
    let start = Instant::now();
    let answer = client.find_grasp(&request).await?;
    let round_trip_seconds = start.elapsed().as_secs_f64();
    tracing::debug!(round_trip_seconds, "answered");
    if let Some(drawing) = drawing
        && !answer.grasps.is_empty()
    {
        drawing.write(&answer.grasps, None).await?;
    }
    output.write_message(&answer, |answer| {
        answer::describe(&request, answer, round_trip_seconds)
    })?;
    Ok(Ending::found(answer.outcome() == Outcome::Found))
}

impl Arguments {
    /// The request of the holdout or the file, overridden by the options.
    async fn to_request(&self) -> Result<v1::FindGraspRequest, Failure> {
        let mut request = self.holdout.to_request().await?;
        let receiver = request.receiver_mut();
        receiver.handedness = self.receiving_hand.map_or(receiver.handedness, Into::into);
        if let Some(rig) = &self.receiving_rig {
            receiver.rig = full_name("rigs", rig);
        }
        let requirements = request.requirements_mut();
        self.override_thesis_options(requirements.thesis.get_or_insert_default());
        without_default(&mut requirements.thesis);
        self.override_search_options(request.search_mut());
        without_default(&mut request.receiver);
        without_default(&mut request.requirements);
        without_default(&mut request.search);
        if let Some(path) = self.current.clone() {
            let answer: v1::FindGraspResponse = blocking(move || read_message("current", &path)).await?;
            let without = || Failure::usage("current: the answer has no grasp");
            request.current = Some(answer.grasp().ok_or_else(without)?.current());
        }
        Ok(request)
    }

    fn override_thesis_options(&self, thesis: &mut v1::ThesisOptions) {
        thesis.thesis_validity = self.validity.unwrap_or(thesis.thesis_validity);
        thesis.strategy = self.strategy.map_or(thesis.strategy, Into::into);
        thesis.bend_ratios = self.bend_ratios.map_or(thesis.bend_ratios, Into::into);
    }

    fn override_search_options(&self, search: &mut v1::SearchOptions) {
        search.budget = self.budget.map(wire_duration).or(search.budget);
        let reproducible = self.reproducible.then_some(GraspChoice::Reproducible);
        let choice = self.choice.or(reproducible);
        search.choice = choice.map_or(search.choice, Into::into);
        search.seed = self.seed.or(search.seed);
        search.replay_attempt = self.replay_attempt.or(search.replay_attempt);
        search.ignore_atlas |= self.ignore_atlas;
    }
}

/// Removes a part of a request that says nothing.
fn without_default<T: Default + PartialEq>(part: &mut Option<T>) {
    part.take_if(|part| *part == T::default());
}
