//! `grasp find`

mod answer;
mod constraints;
mod receiver;
mod stream;

use std::{
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use clap::{ArgGroup, Args};
use grasp_client::{AtlasUse, FindRequest, Grasp, GraspClient, Outcome, StandingGrasp};
use serde_json::Value;

use constraints::ConstraintOptions;
use receiver::ReceiverOptions;
use stream::StreamOptions;

use crate::{
    EXIT_CODES, Ending, blocking,
    failure::Failure,
    input::{find_request, message_of, read_json, read_messages},
    output::{Output, write_message},
    picture::{Picture, object_look, write_file},
    server_options::ServerOptions,
    values::{
        BendRatiosName, ChoiceName, HandName, HandsName, StrategyName, ValidityName, ViewSize,
        parse_duration, parse_duration_or_none, parse_view_size,
    },
};

/// The long help: the shapes of requests and answers as JSON.
const ABOUT: &str = r#"Ask for a grasp on an object that is held out.

The holdout is one of the built-in ones (--holdout) or a JSON file (--request): the API's FindGraspRequest in protobuf's JSON, as
grpcurl and the libraries of all languages write it. Only "object" is required:

  {
    "object": "objects/remote",
    "clientFromObject": {"position": {"y": 1.2, "z": 0.4}, "orientation": {"w": 1}},
    "presentingHand": {"angles": {
      "rig": "thesis", "handedness": "HANDEDNESS_RIGHT", "clientFromWrist": {"position": {"y": 1.2, "z": 0.2}},
      "digits": [{"basePitch": 0.2, "secondPitch": 0.3, "thirdPitch": 0.2}, …five, thumb first]}},
    "receivingHand": {"handedness": "HANDEDNESS_LEFT"}, "budget": "0.5s", "seed": "42",
    "obstacles": [{"box": {"clientFromBox": {"position": {"y": 0.7}}, "halfExtents": {"x": 0.6, "y": 0.02, "z": 0.4}}}]
  }

--print-request prints the request instead of sending it, as a template: with --holdout, and with options, which override the file.

With --stream, a line comes for each grasp that is better than those before, until the budget ends; with --alternatives, the best
ones that differ. --png and --glb then write a file of each grasp, with -1, -2 … before the extension. With --json, each line is a
StreamGraspsResponse in protobuf's JSON.

With --json the answer is a FindGraspResponse in protobuf's JSON."#;

/// Ask for a grasp on an object that is held out.
#[derive(Args, Debug)]
#[command(long_about = ABOUT, after_help = EXIT_CODES)]
#[command(group(ArgGroup::new("what").required(true).args(["holdout", "request"])))]
#[expect(clippy::struct_excessive_bools, reason = "every switch is a separate option")]
pub(crate) struct Arguments {
    /// A built-in holdout, such as remote-hold1.
    #[arg(long, value_name = "NAME")]
    holdout: Option<String>,
    /// A JSON file with a request; - for standard input.
    #[arg(long, value_name = "FILE")]
    request: Option<PathBuf>,
    /// Search strategy. Default: the server's.
    #[arg(long, ignore_case = true)]
    strategy: Option<StrategyName>,
    /// Checks that a grasp must pass. Default: the server's.
    #[arg(long)]
    validity: Option<ValidityName>,
    /// Bend ratios that fingers try. Default: the strategy's own.
    #[arg(long)]
    bend_ratios: Option<BendRatiosName>,
    /// Which valid grasp to return. Default: the first.
    #[arg(long)]
    choice: Option<ChoiceName>,
    /// How much longer to search after a first grasp that a person would not choose; 0 takes it. Default: the server's.
    #[arg(long, value_name = "DURATION", value_parser = parse_duration_or_none)]
    improvement: Option<Duration>,
    /// Time limit of the search. Default: the server's.
    #[arg(long, value_name = "DURATION", value_parser = parse_duration)]
    budget: Option<Duration>,
    /// Largest number of attempts. Default: limited by the budget only.
    #[arg(long, value_name = "N")]
    max_attempts: Option<u64>,
    /// Seed of all random streams. Default: drawn by the server.
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Replay: run only this attempt of the seed and --receiving-hand, without trying known grasps first.
    #[arg(long, value_name = "N", requires = "seed")]
    only_attempt: Option<u64>,
    /// Decide by the indices of the valid attempts, whatever the number of workers.
    #[arg(long)]
    reproducible: bool,
    /// Search from scratch, without the object's known grasps.
    #[arg(long)]
    no_atlas: bool,
    /// A JSON file with a list of obstacles to keep clear of, as in a request; - for standard input.
    #[arg(long, value_name = "FILE")]
    obstacles: Option<PathBuf>,
    /// The hand to pose. Default: either.
    #[arg(long, value_name = "HAND")]
    receiving_hand: Option<HandName>,
    /// The rig of the hand to pose. Default: the server's.
    #[arg(long, value_name = "RIG")]
    receiving_rig: Option<String>,
    /// How many times as large as its rig the hand is, from 0.5 to 2. Default: 1.
    #[arg(long, value_name = "SCALE")]
    receiving_scale: Option<f32>,
    /// How many times as large as it was created the object is, from 0.25 to 4. Default: 1.
    #[arg(long, value_name = "SCALE")]
    object_scale: Option<f32>,
    /// The object's mass in kilograms. Default: its own, times the cube of --object-scale.
    #[arg(long, value_name = "KG")]
    object_mass: Option<f32>,
    /// How many hands take the object. Default: one.
    #[arg(long, value_name = "HOW_MANY", conflicts_with = "key_frames")]
    hands: Option<HandsName>,
    /// Coefficient of static friction. Default: the object's.
    #[arg(long, value_name = "MU")]
    friction: Option<f32>,
    /// Show the time spent in each step.
    #[arg(long)]
    step_times: bool,
    /// Also plan the motion to the grasp: the open hand drawn back, the open hand at the object, and the grasp.
    #[arg(long)]
    key_frames: bool,
    /// Hold on to the grasp of an earlier answer, a file that --json wrote, while it is valid; - for standard input.
    #[arg(long, value_name = "FILE")]
    standing: Option<PathBuf>,
    /// The hand is closing on the standing grasp: never replace it.
    #[arg(long)]
    committed: bool,
    /// Print the request as JSON instead of sending it.
    #[arg(long)]
    print_request: bool,
    /// Write a picture of the grasp, if one is found.
    #[arg(long, value_name = "FILE", conflicts_with = "print_request")]
    png: Option<PathBuf>,
    /// Write the scene as a binary glTF file, if a grasp is found.
    #[arg(long, value_name = "FILE", conflicts_with = "print_request")]
    glb: Option<PathBuf>,
    /// The file that the receiving hand's rig was created from, to draw the hand with its own skin.
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// Pixels of each of the picture's two views.
    #[arg(long, value_name = "SIZE", default_value = "900x700", value_parser = parse_view_size)]
    view_size: ViewSize,
    #[command(flatten)]
    constraints: ConstraintOptions,
    #[command(flatten)]
    receiver: ReceiverOptions,
    #[command(flatten)]
    stream: StreamOptions,
    #[command(flatten)]
    server: ServerOptions,
}

pub(crate) async fn run(arguments: Arguments, output: Output) -> Result<Ending, Failure> {
    let request = arguments.to_request().await?;
    if arguments.print_request {
        write_message("FindGraspRequest", &request)?;
        return Ok(Ending::Done);
    }
    let client = arguments.server.connect().await?;
    // Reports what cannot be drawn before the search.
    let picture = arguments.picture(&client, &request).await?;
    if let Some(streamed) = arguments.stream.streamed() {
        let drawing = picture.map(|picture| Drawing {
            picture,
            size: arguments.view_size,
            png: arguments.png,
            glb: arguments.glb,
        });
        return Box::pin(stream::run(&client, &request, &streamed, drawing, output)).await;
    }
    let start = Instant::now();
    let answer = client.find_grasp(&request).await?;
    let round_trip_seconds = start.elapsed().as_secs_f64();
    tracing::debug!(round_trip_seconds, "answered");
    if let Some(picture) = picture
        && answer.grasp.is_some()
    {
        let drawing = Drawing {
            picture: picture.with_hands(&answer),
            size: arguments.view_size,
            png: arguments.png,
            glb: arguments.glb,
        };
        drawing.write().await?;
    }
    output.write_message("FindGraspResponse", &answer, |answer| {
        answer::describe(&request, answer, round_trip_seconds)
    })?;
    Ok(match answer.outcome {
        Outcome::Found => Ending::Done,
        Outcome::BudgetExhausted | Outcome::Aborted => Ending::NoGrasp,
    })
}

impl Arguments {
    /// The picture to draw, if requested.
    async fn picture(&self, client: &GraspClient, request: &FindRequest) -> Result<Option<Picture>, Failure> {
        if self.png.is_none() && self.glb.is_none() {
            return Ok(None);
        }
        let look = object_look(client, &request.object, request.object_scale).await?;
        let model = self.model.as_ref().map(std::fs::read).transpose();
        let model = model.map_err(|error| Failure::other("cannot read the model", error))?;
        Ok(Some(Picture::new(look, request.clone())?.with_model(model)))
    }

    /// The request of the holdout or the file, overridden by the options.
    async fn to_request(&self) -> Result<FindRequest, Failure> {
        let mut request = find_request(self.holdout.as_deref(), self.request.as_deref()).await?;
        if let Some(path) = self.obstacles.clone() {
            request.obstacles = blocking(move || read_messages("obstacles", "Obstacle", &path)).await?;
        }
        request.strategy = self.strategy.map(Into::into).or(request.strategy);
        request.validity = self.validity.map(Into::into).or(request.validity);
        request.bend_ratios = self.bend_ratios.map(Into::into).or(request.bend_ratios);
        request.choice = self.choice.map(Into::into).or(request.choice);
        request.improvement = self.improvement.or(request.improvement);
        request.budget = self.budget.or(request.budget);
        request.max_attempts = self.max_attempts.or(request.max_attempts);
        request.seed = self.seed.or(request.seed);
        request.only_attempt = self.only_attempt.or(request.only_attempt);
        request.reproducible |= self.reproducible;
        if self.no_atlas {
            request.atlas = Some(AtlasUse::None);
        }
        request.record_step_times |= self.step_times;
        request.plan_key_frames |= self.key_frames;
        request.hands = self.hands.map(Into::into).or(request.hands);
        request.friction = self.friction.or(request.friction);
        request.object_scale = self.object_scale.or(request.object_scale);
        request.object_mass_kg = self.object_mass.or(request.object_mass_kg);
        self.constraints.override_in(&mut request.constraints);
        self.receiver.override_in(&mut request)?;
        let hand = &mut request.receiving_hand;
        hand.handedness = self.receiving_hand.map_or(hand.handedness, Into::into);
        hand.rig = self.receiving_rig.clone().or(hand.rig.take());
        hand.hand_scale = self.receiving_scale.or(hand.hand_scale);
        if let Some(path) = self.standing.clone() {
            let mut standing = blocking(move || read_standing(&path)).await?;
            standing.hand.hand_scale = request.receiving_hand.hand_scale;
            request.standing = Some(standing);
        }
        match &mut request.standing {
            Some(standing) => standing.committed |= self.committed,
            None if self.committed => {
                return Err(Failure::Usage(
                    "--committed needs a grasp to hold on to: pass it with --standing or in the request"
                        .to_owned(),
                ));
            }
            None => {}
        }
        Ok(request)
    }
}

/// Reads the grasp of an earlier answer.
fn read_standing(path: &Path) -> Result<StandingGrasp, Failure> {
    let wrong = |what: &str| Failure::Usage(format!("standing {}: {what}", path.display()));
    let mut answer: Value = read_json("standing", path)?;
    let grasp = answer
        .get_mut("grasp")
        .map(Value::take)
        .filter(|grasp| !grasp.is_null());
    let grasp = grasp.ok_or_else(|| wrong("the answer has no grasp"))?;
    let grasp: Grasp = message_of("Grasp", grasp).map_err(|error| wrong(&error))?;
    Ok(grasp.standing())
}

/// A picture and the files that show it.
#[derive(Clone)]
struct Drawing {
    picture: Picture,
    size: ViewSize,
    png: Option<PathBuf>,
    glb: Option<PathBuf>,
}

impl Drawing {
    /// Writes the files.
    async fn write(self) -> Result<(), Failure> {
        let Self {
            picture,
            size,
            png,
            glb,
        } = self;
        blocking(move || {
            if let Some(path) = png {
                write_file(&path, &picture.draw(size)?.to_png())?;
            }
            if let Some(path) = glb {
                write_file(&path, &picture.to_glb()?)?;
            }
            Ok(())
        })
        .await
    }
}
