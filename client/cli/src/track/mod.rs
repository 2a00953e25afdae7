//! `grasp track`

mod drawing;
mod motions;
mod tally;

use std::{
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use clap::{ArgGroup, Args};
use grasp_client::{
    Handedness, TrackStream,
    built_in::request_for,
    json::{JsonError, from_json},
    v1::{Track, TrackAnswer, TrackFrame},
    wire_duration,
};
use serde::Deserialize;
use serde_json::{Value, json};
use tokio::time::{MissedTickBehavior, interval};

use crate::{
    EXIT_CODES, Ending, Failure, Output, ServerOptions,
    input::{built_in, messages_of, read_json},
    output::{message_json, write_json, write_line, write_message_line},
    progress_bar::bar,
    values::{HANDS, one_of, parse_duration},
};
use drawing::{DrawOptions, Drawing};
use motions::Moving;
use tally::Tally;

/// How long to wait for the answer to the last frame.
const LAST_ANSWER: Duration = Duration::from_secs(2);

/// The long help: the shape of a motion as JSON.
const ABOUT: &str = r#"Hold on to a grasp while the giver moves, and show what becomes of it.

The motion is one of the built-in ones (--moving) of a built-in holdout (--holdout), or a JSON file (--motion):

  {"track": {…the API's Track in protobuf's JSON}, "frames": [{…TrackFrame}, …]}

--print-motion prints a built-in one as a template. Frames are sent at their capture times, and nobody waits for answers: a
frame may overtake another one. With --json, one line per TrackAnswer in protobuf's JSON, and a last one with the summary.

--glb writes the motion as an animation, a key frame per frame, for Blender, three.js and other viewers of binary glTF. It shows
giver and object as they were sent, and a receiver who goes for the answered grasps at the speed of a person; without a grasp,
the open hand waits."#;

/// Hold on to a grasp while the giver moves, and show what becomes of it.
#[derive(Args, Debug)]
#[command(long_about = ABOUT, after_help = EXIT_CODES)]
#[command(group(ArgGroup::new("what").required(true).args(["holdout", "motion"])))]
pub(crate) struct Arguments {
    /// A built-in holdout, such as remote-hold1.
    #[arg(long, value_name = "NAME")]
    holdout: Option<String>,
    /// How its giver moves.
    #[arg(long, value_name = "HOW", default_value = "walk", requires = "holdout")]
    moving: Moving,
    /// How long.
    #[arg(long, value_name = "DURATION", default_value = "5s", value_parser = parse_duration, requires = "holdout")]
    length: Duration,
    /// Frames per second of a built-in motion.
    #[arg(long, value_name = "HZ", default_value_t = 90.0, value_parser = parse_rate, requires = "holdout")]
    rate: f32,
    /// The hand to pose in a built-in motion. Default: either.
    #[arg(long, value_name = "HAND", value_parser = one_of(HANDS), requires = "holdout")]
    receiving_hand: Option<Handedness>,
    /// A JSON file with a motion; - for standard input.
    #[arg(long, value_name = "FILE")]
    motion: Option<PathBuf>,
    /// Time limit of the search for a frame whose grasp failed a check. Default: the server's, 8 ms.
    #[arg(long, value_name = "DURATION", value_parser = parse_duration)]
    budget: Option<Duration>,
    /// How late answers are shown: frames are answered as they will be then.
    #[arg(long, value_name = "DURATION", value_parser = parse_duration)]
    prediction_horizon: Option<Duration>,
    /// Print the motion as JSON instead of playing it.
    #[arg(long)]
    print_motion: bool,
    #[command(flatten)]
    draw: DrawOptions,
    #[command(flatten)]
    server: ServerOptions,
}

/// A motion to play.
#[derive(Debug)]
struct Motion {
    track: Track,
    frames: Vec<TrackFrame>,
}

/// A motion in a file, whose parts are protobuf's JSON of messages.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MotionFile {
    track: Value,
    frames: Vec<Value>,
}

pub(crate) async fn run(arguments: Arguments, output: Output) -> Result<Ending, Failure> {
    let motion = arguments.to_motion().await?;
    if arguments.print_motion {
        let frames = motion.frames.iter().map(message_json);
        let frames = frames.collect::<Result<Vec<_>, _>>()?;
        write_json(&json!({ "track": message_json(&motion.track)?, "frames": frames }))?;
        return Ok(Ending::Done);
    }
    let client = arguments.server.connect().await?;
    // Reports what cannot be drawn before the motion is played.
    let mut drawing = arguments.draw.drawing(&client, &motion.track).await?;
    let mut track = client.track(&motion.track).await?;
    let tally = play(&mut track, &motion.frames, drawing.as_mut(), output).await?;
    if let Some(drawing) = drawing {
        drawing.write().await?;
    }
    write_line(&if output.json {
        tally.to_json().to_string()
    } else {
        tally.to_string()
    })?;
    Ok(Ending::found(tally.has_grasp()))
}

impl Arguments {
    async fn to_motion(&self) -> Result<Motion, Failure> {
        let mut motion = match (&self.motion, &self.holdout) {
            (Some(path), _) => read_motion(path).await?,
            (None, Some(name)) => self.built_in(name)?,
            // Ruled out by the group of arguments.
            (None, None) => return Err(Failure::usage("give --holdout or --motion")),
        };
        let track = &mut motion.track;
        if let Some(budget) = self.budget {
            track.search_mut().budget = Some(wire_duration(budget));
        }
        track.prediction_horizon = self
            .prediction_horizon
            .map(wire_duration)
            .or(track.prediction_horizon);
        Ok(motion)
    }

    /// A built-in motion.
    fn built_in(&self, name: &str) -> Result<Motion, Failure> {
        let holdout = request_for(built_in(name)?).holdout.unwrap_or_default();
        let mut track = Track::new(&holdout.object);
        if let Some(hand) = self.receiving_hand {
            track = track.receiving(hand);
        }
        Ok(Motion {
            track,
            frames: motions::frames(self.moving, &holdout, self.rate, self.length),
        })
    }
}

async fn read_motion(path: &Path) -> Result<Motion, Failure> {
    let path = path.to_owned();
    crate::blocking(move || {
        let wrong = |place: &str, error: &JsonError| {
            Failure::Usage(format!("motion {}: {place}: {error}", path.display()))
        };
        let MotionFile { track, frames } = read_json("motion", &path)?;
        Ok(Motion {
            track: from_json(&track).map_err(|error| wrong("track", &error))?,
            frames: messages_of(&frames)
                .map_err(|(place, error)| wrong(&format!("frames[{place}]"), &error))?,
        })
    })
    .await
}

/// Frames per second.
fn parse_rate(text: &str) -> Result<f32, String> {
    match text.parse() {
        Ok(rate) if (1.0..=1000.0).contains(&rate) => Ok(rate),
        _ => Err(format!("{text:?} is not a number from 1 to 1000")),
    }
}

/// Sends every frame at its time, and takes answers as they come.
async fn play(
    track: &mut TrackStream,
    frames: &[TrackFrame],
    mut drawing: Option<&mut Drawing>,
    output: Output,
) -> Result<Tally, Failure> {
    let mut tally = Tally::new(frames.len());
    let progress = bar(frames.len() as u64, "{pos}/{len}");
    let start = Instant::now();
    let first_time = frames.first().and_then(TrackFrame::capture_time);
    let first_time = first_time.unwrap_or_default();
    let due = |frame: &TrackFrame| {
        let time = frame.capture_time().unwrap_or_default();
        start + time.saturating_sub(first_time)
    };
    // For frames without times: as a headset sends them.
    let mut clock = interval(Duration::from_micros(11_111));
    clock.set_missed_tick_behavior(MissedTickBehavior::Burst);
    let mut left = frames.iter();
    let mut next = left.next();
    while let Some(frame) = next {
        let is_due = async {
            match frame.capture_time {
                Some(_) => tokio::time::sleep_until(due(frame).into()).await,
                None => drop(clock.tick().await),
            }
        };
        tokio::select! {
            () = is_due => {
                tally.sent(frame.sequence);
                track.send(frame);
                if let Some(drawing) = &mut drawing {
                    drawing.recording.sent(frame);
                }
                next = left.next();
            }
            answer = track.answer() => {
                let Some(answer) = answer? else { return Ok(tally) };
                take(&mut tally, drawing.as_deref_mut(), &answer, output)?;
            }
        }
        progress.inc(u64::from(next.is_none_or(|next| next.sequence != frame.sequence)));
        progress.set_message(tally.line());
    }
    let last = frames.last().map(|frame| frame.sequence);
    while tally.last_answered() < last
        && let Ok(answer) = tokio::time::timeout(LAST_ANSWER, track.answer()).await
    {
        let Some(answer) = answer? else { break };
        take(&mut tally, drawing.as_deref_mut(), &answer, output)?;
    }
    Ok(tally)
}

fn take(
    tally: &mut Tally,
    drawing: Option<&mut Drawing>,
    answer: &TrackAnswer,
    output: Output,
) -> Result<(), Failure> {
    tally.answered(answer);
    if let Some(drawing) = drawing {
        drawing.recording.answered(answer);
    }
    if output.json {
        write_message_line(answer)?;
    }
    Ok(())
}
