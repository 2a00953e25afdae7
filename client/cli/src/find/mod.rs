//! `grasp find`

mod answer;

use std::{
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use clap::Args;
use grasp_client::{
    Convention, GraspChoice, GraspClient, GraspSource, Handedness, Outcome, Strategy,
    v1::{self, BendRatios, DifferBy, stream_grasps_request::Sent},
    wire_duration,
};
use grasp_import::{Import, read_mesh};
use grasp_scene::{Finish, Handover, Part, ViewSize, linear_from_srgb};

use crate::{
    EXIT_CODES, Ending, Failure, Output, ServerOptions, blocking,
    input::{
        Choice, HANDS, HoldoutOptions, MESH_LIMITS, STRATEGIES, full_name, one_of, parse_duration,
        parse_view_size, read_file, read_message,
    },
    isaac::{self, NamedGrasp},
    output::{
        grasp_type_name, human_time, joined, name_of, write_file, write_line, write_message,
        write_message_line,
    },
};

/// Most grasps per second of a stream.
const MAX_RATE_HZ: f32 = 30.0;

/// Whether the checks that a valid grasp must pass are the thesis's.
const VALIDITIES: [Choice<bool>; 2] = [
    ("thesis", true, "The checks of the thesis"),
    ("physical", false, "Solid hands, and forces that hold the object"),
];

/// The columns of the thesis's Figure 5.20.
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

const CHOICES: [Choice<GraspChoice>; 2] = [
    ("first", GraspChoice::FirstValid, "The first one found"),
    (
        "best",
        GraspChoice::BestWithinBudget,
        "The best one found within the budget",
    ),
];

const DIFFERENCES: [Choice<DifferBy>; 3] = [
    (
        "approach",
        DifferBy::Approach,
        "The side of the object that the hand comes from, and the hand",
    ),
    ("type", DifferBy::Type, "The grasp type"),
    ("region", DifferBy::Region, "The part of the object that is held"),
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
#[expect(clippy::struct_excessive_bools, reason = "each is a flag of the command line")]
pub(crate) struct Arguments {
    #[command(flatten)]
    holdout: HoldoutOptions,
    /// Search strategy. Default: the server's.
    #[arg(long, value_parser = one_of(STRATEGIES), ignore_case = true)]
    strategy: Option<Strategy>,
    /// Checks that a grasp must pass. Default: the server's.
    #[arg(long, value_parser = one_of(VALIDITIES))]
    validity: Option<bool>,
    /// Bend ratios that fingers try. Default: the strategy's.
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
    /// Keep the grasp of an earlier answer while it is valid: a file that --json wrote; - for standard input.
    #[arg(long, value_name = "FILE")]
    current: Option<PathBuf>,
    /// Print the request as JSON instead of sending it.
    #[arg(long)]
    print_request: bool,
    /// Write a picture of the grasp, if one is found.
    #[arg(long, value_name = "FILE", conflicts_with = "print_request")]
    png: Option<PathBuf>,
    /// Write the scene as a binary glTF file, if a grasp is found.
    #[arg(long, value_name = "FILE", conflicts_with = "print_request")]
    glb: Option<PathBuf>,
    /// Write the grasps to a file in the format `isaac_grasp` 1.0, if one is found; see `grasp objects grips export --help`.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["print_request", "stream"])]
    isaac: Option<PathBuf>,
    /// The file that the receiving hand's rig was created from, to draw the hand with its own skin.
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// Pixels of the picture.
    #[arg(long, value_name = "SIZE", default_value = "900x700", value_parser = parse_view_size)]
    view_size: ViewSize,
    /// Show each better grasp as soon as it is found, until the budget ends.
    #[arg(long, conflicts_with_all = ["alternatives", "replay_attempt", "reproducible"])]
    stream: bool,
    /// Show up to this many (1 to 32) of the best grasps that differ, best first, when the budget ends.
    #[arg(long, value_name = "COUNT", conflicts_with_all = ["replay_attempt", "reproducible"])]
    alternatives: Option<u32>,
    /// Criteria by which they differ, such as approach,type. Default: approach.
    #[arg(long, value_name = "WHAT", value_parser = one_of(DIFFERENCES))]
    #[arg(value_delimiter = ',', requires = "alternatives")]
    differ_by: Vec<DifferBy>,
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
    // Before the search: reports a scene that cannot be drawn, and axes that a file does not have.
    let drawing = arguments.drawing(&client, &request).await?;
    if arguments.isaac.is_some() {
        require_openxr(&request, "files in the format isaac_grasp require")?;
    }
    if let Some(sent) = arguments.sent() {
        let request = v1::StreamGraspsRequest {
            sent: Some(sent),
            ..request.into()
        };
        return Box::pin(arguments.show_stream(&client, &request, drawing, output)).await;
    }
    let start = Instant::now();
    let answer = client.find_grasp(&request).await?;
    let round_trip_seconds = start.elapsed().as_secs_f64();
    tracing::debug!(round_trip_seconds, "answered");
    if let Some(drawing) = drawing
        && !answer.grasps.is_empty()
    {
        arguments.draw(&drawing, &answer.grasps, None).await?;
    }
    arguments
        .write_isaac(&client, request.holdout.as_ref(), &answer.grasps)
        .await?;
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
        if self.isaac.is_some() {
            request = request.with_key_frames();
        }
        if let Some(path) = self.current.clone() {
            let answer: v1::FindGraspResponse = blocking(move || read_message("current", &path)).await?;
            let without = || Failure::usage("current: the answer has no grasp");
            request.current = Some(answer.grasp().ok_or_else(without)?.current());
        }
        Ok(request)
    }

    fn sent(&self) -> Option<Sent> {
        if let Some(count) = self.alternatives {
            let differ_by = self.differ_by.iter().map(|&what| what.into()).collect();
            return Some(Sent::Alternatives(v1::Alternatives { count, differ_by }));
        }
        self.stream.then_some(Sent::MaxRateHz(MAX_RATE_HZ))
    }

    /// The scene to draw with grasps; `None` without files to write.
    async fn drawing(
        &self,
        client: &GraspClient,
        request: &v1::FindGraspRequest,
    ) -> Result<Option<Handover>, Failure> {
        if self.png.is_none() && self.glb.is_none() {
            return Ok(None);
        }
        require_openxr(request, "pictures require")?;
        let holdout = request.holdout.clone().unwrap_or_default();
        let model = self.model.as_deref().map(read_file).transpose()?;
        Ok(Some(Handover {
            object: drawn_object(client, &holdout).await?,
            holdout,
            grasps: Vec::new(),
            model: model.map(Into::into),
        }))
    }

    async fn draw(
        &self,
        drawing: &Handover,
        grasps: &[v1::Grasp],
        number: Option<usize>,
    ) -> Result<(), Failure> {
        let mut handover = drawing.clone();
        handover.grasps = grasps.to_vec();
        let (png, glb, size) = (self.png.clone(), self.glb.clone(), self.view_size);
        blocking(move || {
            if let Some(path) = png {
                write_file(&numbered(&path, number), &handover.draw(size)?.to_png())?;
            }
            if let Some(path) = glb {
                write_file(&numbered(&path, number), &handover.to_glb()?)?;
            }
            Ok(())
        })
        .await
    }

    /// Writes the grasps to the file of `--isaac`.
    async fn write_isaac(
        &self,
        client: &GraspClient,
        holdout: Option<&v1::Holdout>,
        grasps: &[v1::Grasp],
    ) -> Result<(), Failure> {
        let (Some(path), Some(holdout)) = (&self.isaac, holdout) else {
            return Ok(());
        };
        if grasps.is_empty() {
            return Ok(());
        }
        let object = client.get_object(&holdout.object).await?;
        let named = grasps.iter().enumerate();
        let named: Vec<_> = named
            .map(|(number, grasp)| NamedGrasp::found(format!("grasp_{number}"), grasp))
            .collect();
        isaac::write(path, &object, &named)
    }

    async fn show_stream(
        &self,
        client: &GraspClient,
        request: &v1::StreamGraspsRequest,
        drawing: Option<Handover>,
        output: Output,
    ) -> Result<Ending, Failure> {
        let mut stream = client.stream_grasps(request).await?;
        if !output.json {
            write_line(&line(HEADER))?;
        }
        let mut grasps = Vec::new();
        let mut end = Ending::NoGrasp;
        while let Some(message) = stream.next().await? {
            let grasp = message.grasp();
            grasps.extend(grasp.cloned());
            let count = grasps.len();
            if output.json {
                write_message_line(&message)?;
            } else {
                let row = grasp.map(|grasp| row(count, grasp, &message));
                write_line(&row.unwrap_or_else(|| summary(count, &message)))?;
            }
            match (grasp, &drawing) {
                (Some(_), Some(drawing)) => self.draw(drawing, &message.grasps[..1], Some(count)).await?,
                (Some(_), None) => {}
                (None, _) => end = Ending::found(message.outcome() == Outcome::Found),
            }
        }
        self.write_isaac(client, request.holdout.as_ref(), &grasps)
            .await?;
        Ok(end)
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

/// Refuses a request in the axes of an engine; `what` needs others.
fn require_openxr(request: &v1::FindGraspRequest, what: &str) -> Result<(), Failure> {
    let convention = request.output.as_ref().map(v1::OutputOptions::convention);
    match convention.unwrap_or_default() {
        Convention::Unspecified | Convention::Openxr => Ok(()),
        _ => Err(Failure::usage(format!(
            "{what} a request in the openxr convention"
        ))),
    }
}

/// Removes a part of a request that has only defaults.
fn without_default<T: Default + PartialEq>(part: &mut Option<T>) {
    part.take_if(|part| *part == T::default());
}

/// A holdout's object to draw: a built-in one in its own colours, any other from the server's mesh.
pub(crate) async fn drawn_object(client: &GraspClient, holdout: &v1::Holdout) -> Result<Part, Failure> {
    let name = holdout.object.clone();
    let part = if let Some(part) = Part::built_in_object(&name) {
        part
    } else {
        let glb = client.get_mesh(&name).await?.glb;
        blocking(move || {
            let read = read_mesh(&glb, Import::METRES, MESH_LIMITS);
            let read =
                read.map_err(|errors| Failure::other(format!("cannot read {name}"), joined("; ", errors)))?;
            let forbidden = read.groups.into_iter().find(|(group, _)| group == "forbidden");
            let forbidden = forbidden.map(|(_, triangles)| triangles).unwrap_or_default();
            let colour = linear_from_srgb(186, 176, 150);
            Ok(Part::object(&read.mesh, &forbidden, colour, Finish::Satin))
        })
        .await?
    };
    Ok(part.scaled(holdout.scale.unwrap_or(1.0)))
}

/// `scene.glb` becomes `scene-3.glb`.
fn numbered(path: &Path, number: Option<usize>) -> PathBuf {
    let Some(number) = number else {
        return path.to_owned();
    };
    let mut name = path.file_stem().unwrap_or_default().to_owned();
    name.push(format!("-{number}"));
    if let Some(extension) = path.extension() {
        name.push(".");
        name.push(extension);
    }
    path.with_file_name(name)
}

const HEADER: [&str; 6] = ["#", "score", "found after", "hand", "grasp type", "source"];

fn row(number: usize, grasp: &v1::Grasp, found: &v1::FindGraspResponse) -> String {
    let score = match (grasp.score, &grasp.thesis) {
        (Some(score), _) => format!("{score:.3}"),
        (None, Some(thesis)) => format!("E {:.3}", thesis.comfort),
        (None, None) => String::new(),
    };
    let hand = grasp.hand.as_ref().map(|hand| name_of(hand.handedness()));
    let source = match found.source() {
        GraspSource::Unspecified => String::new(),
        source => name_of(source),
    };
    let after = human_time(found.search_time().as_secs_f64());
    let (number, grasp_type) = (number.to_string(), grasp_type_name(grasp));
    line([
        &number,
        &score,
        &after,
        &hand.unwrap_or_default(),
        &grasp_type,
        &source,
    ])
}

/// A row of the table; its widths are fixed, as later rows are unknown.
fn line([number, score, after, hand, grasp_type, source]: [&str; 6]) -> String {
    let line = format!("{number:>4}  {score:>7}  {after:>11}  {hand:5}  {grasp_type:24}  {source}");
    line.trim_end().to_owned()
}

/// The last line, after `count` grasps.
fn summary(count: usize, last: &v1::FindGraspResponse) -> String {
    let what = match last.outcome() {
        Outcome::Found => format!("{count} valid grasps"),
        _ => "no grasp within the budget".to_owned(),
    };
    let took = human_time(last.search_time().as_secs_f64());
    format!("{what} in {} attempts and {took}", last.attempts())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_several_grasps_are_numbered() {
        let name = |path: &str| numbered(Path::new(path), Some(3)).display().to_string();
        assert_eq!(name("target/scene.glb"), "target/scene-3.glb");
        assert_eq!(name("scene"), "scene-3");
        assert_eq!(name("a.b/c.d.png"), "a.b/c.d-3.png");
    }
}
