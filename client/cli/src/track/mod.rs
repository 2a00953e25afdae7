//! `grasp track`

mod motions;

use std::{
    collections::{BTreeMap, VecDeque},
    fmt,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use clap::{ArgGroup, Args};
use grasp_client::{
    CurrentGraspStatus, Handedness, TrackStream,
    built_in::request_for,
    json::{JsonError, from_json},
    v1::{Track, TrackAnswer, TrackFrame},
    wire_duration,
};
use grasp_scene::{TrackRecording, ViewSize};
use serde::Deserialize;
use serde_json::{Value, json};
use tokio::time::{MissedTickBehavior, interval};

use crate::{
    EXIT_CODES, Ending, Failure, Output, ServerOptions, blocking,
    find::drawn_object,
    input::{HANDS, built_in, messages_of, one_of, parse_duration, read_json},
    output::{
        bar, joined, list, message_json, name_of, pairs, write_file, write_json, write_line,
        write_message_line,
    },
};
use motions::Moving;

/// How long to wait for the answer to the last frame.
const LAST_ANSWER: Duration = Duration::from_secs(2);

/// Size of a moving picture: it fits into a page.
const PICTURE: ViewSize = ViewSize {
    width: 384,
    height: 256,
};

/// The long help: the shape of a motion as JSON.
const ABOUT: &str = r#"Hold on to a grasp while the giver moves, and show what becomes of it.

The motion is one of the built-in ones (--moving) of a built-in holdout (--holdout), or a JSON file (--motion):

  {"track": {…the API's Track in protobuf's JSON}, "frames": [{…TrackFrame}, …]}

--print-motion prints a built-in one as a template. Frames are sent at their capture times, and nobody waits for answers: a
frame may overtake another one. With --json, one line per TrackAnswer in protobuf's JSON, and a last one with the summary.

--glb writes the motion as an animation, a key frame per frame, for Blender, three.js and other viewers of binary glTF, and --png as a
moving picture. Both show giver and object as they were sent, and a receiver who goes for the answered grasps at the speed of a person; without a grasp,
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
    /// Length of a built-in motion.
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
    /// Delay until answers are shown: frames are predicted ahead by it.
    #[arg(long, value_name = "DURATION", value_parser = parse_duration)]
    prediction_horizon: Option<Duration>,
    /// Print the motion as JSON instead of playing it.
    #[arg(long)]
    print_motion: bool,
    /// Write the motion as a binary glTF file with an animation.
    #[arg(long, value_name = "FILE", conflicts_with = "print_motion")]
    glb: Option<PathBuf>,
    /// Write the motion as an animated PNG file, 10 pictures per second.
    #[arg(long, value_name = "FILE", conflicts_with = "print_motion")]
    png: Option<PathBuf>,
    #[command(flatten)]
    server: ServerOptions,
}

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
    // Before the motion is played: reports a scene that cannot be drawn.
    let is_drawn = arguments.glb.is_some() || arguments.png.is_some();
    let object = match &motion.track.holdout {
        Some(holdout) if is_drawn => Some(drawn_object(&client, holdout).await?),
        _ => None,
    };
    let mut track = client.track(&motion.track).await?;
    let mut played = Played {
        tally: Tally {
            frames: motion.frames.len(),
            ..Tally::default()
        },
        recording: object.as_ref().map(|_| TrackRecording::new(&motion.track)),
        output,
    };
    played.play(&mut track, &motion.frames).await?;
    let tally = played.tally;
    if let (Some(object), Some(recording)) = (object, played.recording) {
        let (glb, png) = (arguments.glb, arguments.png);
        blocking(move || {
            if let Some(path) = glb {
                write_file(&path, &recording.to_glb(object.clone())?)?;
            }
            png.map_or(Ok(()), |path| {
                write_file(&path, &recording.to_picture(object, PICTURE)?)
            })
        })
        .await?;
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
        let horizon = self.prediction_horizon.map(wire_duration);
        track.prediction_horizon = horizon.or(track.prediction_horizon);
        Ok(motion)
    }

    fn built_in(&self, name: &str) -> Result<Motion, Failure> {
        let holdout = request_for(built_in(name)?).holdout.unwrap_or_default();
        let track = Track::new(&holdout.object);
        Ok(Motion {
            track: match self.receiving_hand {
                Some(hand) => track.receiving(hand),
                None => track,
            },
            frames: motions::frames(self.moving, &holdout, self.rate, self.length),
        })
    }
}

async fn read_motion(path: &Path) -> Result<Motion, Failure> {
    let path = path.to_owned();
    blocking(move || {
        let wrong = |place: &str, error: &JsonError| {
            Failure::usage(format!("motion {}: {place}: {error}", path.display()))
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

fn parse_rate(text: &str) -> Result<f32, String> {
    match text.parse() {
        Ok(rate) if (1.0..=1000.0).contains(&rate) => Ok(rate),
        _ => Err(format!("{text:?} is not a number from 1 to 1000")),
    }
}

/// Frames sent and answers received.
struct Played {
    tally: Tally,
    recording: Option<TrackRecording>,
    output: Output,
}

impl Played {
    /// Sends every frame at its time, and takes answers as they come.
    async fn play(&mut self, track: &mut TrackStream, frames: &[TrackFrame]) -> Result<(), Failure> {
        let progress = bar(frames.len() as u64, "{pos}/{len}");
        let start = Instant::now();
        let first_time = frames.first().and_then(TrackFrame::capture_time);
        let first_time = first_time.unwrap_or_default();
        // For frames without times: 90 per second, as headsets send them.
        let mut clock = interval(Duration::from_micros(11_111));
        clock.set_missed_tick_behavior(MissedTickBehavior::Burst);
        for frame in frames {
            let is_due = async {
                match frame.capture_time() {
                    Some(time) => {
                        let due = start + time.saturating_sub(first_time);
                        tokio::time::sleep_until(due.into()).await;
                    }
                    None => drop(clock.tick().await),
                }
            };
            tokio::pin!(is_due);
            loop {
                tokio::select! {
                    () = &mut is_due => break,
                    answer = track.answer() => {
                        let Some(answer) = answer? else { return Ok(()) };
                        self.take(&answer)?;
                        progress.set_message(self.tally.line());
                    }
                }
            }
            self.tally.sent.push_back((frame.sequence, Instant::now()));
            track.send(frame);
            if let Some(recording) = &mut self.recording {
                recording.sent(frame);
            }
            progress.inc(1);
        }
        let last = frames.last().map(|frame| frame.sequence);
        while self.tally.last_answered < last
            && let Ok(answer) = tokio::time::timeout(LAST_ANSWER, track.answer()).await
        {
            let Some(answer) = answer? else { break };
            self.take(&answer)?;
        }
        Ok(())
    }

    fn take(&mut self, answer: &TrackAnswer) -> Result<(), Failure> {
        self.tally.answered(answer);
        if let Some(recording) = &mut self.recording {
            recording.answered(answer);
        }
        if self.output.json {
            write_message_line(answer)?;
        }
        Ok(())
    }
}

const STATUSES: [(CurrentGraspStatus, &str); 5] = [
    (CurrentGraspStatus::Kept, "kept"),
    (CurrentGraspStatus::Adjusted, "adjusted"),
    (CurrentGraspStatus::Replanned, "re-planned"),
    (CurrentGraspStatus::None, "none"),
    (CurrentGraspStatus::Aborted, "aborted"),
];

#[derive(Debug, Default)]
struct Tally {
    frames: usize,
    /// When frames that are not answered yet were sent, oldest first.
    sent: VecDeque<(u64, Instant)>,
    last_answered: Option<u64>,
    /// Number of answers with each of [`STATUSES`].
    counts: [usize; STATUSES.len()],
    answered: usize,
    /// Frames overtaken by later ones.
    skipped: u64,
    /// Times in seconds.
    round_trips: Vec<f64>,
    server_times: Vec<f64>,
    /// Why grasps failed, in words, and how often.
    failures: BTreeMap<String, usize>,
    /// Distances of the object from its predicted place, in metres; empty without prediction.
    prediction_errors: Vec<f64>,
    /// Number of answers with a warning, and the first one.
    warned: usize,
    first_warning: Option<String>,
}

/// The median and the 99th percentile of some values.
fn percentiles(values: &[f64]) -> [f64; 2] {
    let mut values = values.to_vec();
    values.sort_by(f64::total_cmp);
    [0.5, 0.99].map(|share| {
        let place = (share * values.len().saturating_sub(1) as f64).round() as usize;
        values.get(place).copied().unwrap_or_default()
    })
}

impl Tally {
    fn answered(&mut self, answer: &TrackAnswer) {
        while let Some((sequence, sent)) = self.sent.pop_front_if(|(sent, _)| *sent <= answer.sequence) {
            if sequence == answer.sequence {
                self.round_trips.push(sent.elapsed().as_secs_f64());
            } else {
                self.skipped += 1;
            }
        }
        self.answered += 1;
        self.last_answered = Some(answer.sequence);
        self.server_times.push(answer.server_time().as_secs_f64());
        let status = answer.status();
        if let Some(place) = STATUSES.iter().position(|(known, _)| *known == status) {
            self.counts[place] += 1;
        }
        let current = answer.current.as_ref();
        if let Some(failed) = current.and_then(|current| current.failed_check.as_ref())
            && status != CurrentGraspStatus::None
        {
            *self.failures.entry(name_of(failed.check())).or_default() += 1;
        }
        if let Some(error) = &answer.last_prediction {
            self.prediction_errors.push(error.object_distance.into());
        }
        if let Some(warning) = answer.warnings.first() {
            self.warned += 1;
            self.first_warning.get_or_insert_with(|| warning.clone());
        }
    }

    fn has_grasp(&self) -> bool {
        let [kept, adjusted, replanned, ..] = self.counts;
        kept + adjusted + replanned > 0
    }

    /// The names of the statuses, each with its number of answers.
    fn by_status(&self) -> impl Iterator<Item = (&'static str, usize)> {
        STATUSES.into_iter().map(|(_, name)| name).zip(self.counts)
    }

    fn line(&self) -> String {
        let counts = self.by_status().map(|(name, count)| format!("{name} {count}"));
        let latest = self.round_trips.last().copied().unwrap_or_default();
        format!("{}  {:.1} ms", joined("  ", counts), latest * 1e3)
    }

    fn to_json(&self) -> Value {
        let both = |values: &[f64]| {
            let [median, p99] = percentiles(values);
            json!({ "median": median, "p99": p99 })
        };
        let errors = &self.prediction_errors;
        let mut all = json!({
            "frames": self.frames,
            "answered": self.answered,
            "skipped": self.skipped,
            "failures": self.failures,
            "round_trip_seconds": both(&self.round_trips),
            "server_seconds": both(&self.server_times),
            "object_prediction_error": (!errors.is_empty()).then(|| both(errors)),
            "warned": self.warned,
            "first_warning": self.first_warning,
        });
        for (name, count) in self.by_status() {
            all[name.replace('-', "")] = json!(count);
        }
        all
    }
}

impl fmt::Display for Tally {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let times = |seconds: &[f64]| {
            let [median, p99] = percentiles(seconds).map(|seconds| seconds * 1e3);
            format!("{median:.2} ms, 99 %: {p99:.2} ms")
        };
        let (frames, answered, overtaken) = (self.frames, self.answered, self.skipped);
        let counts = format!("{frames}, {answered} answered, {overtaken} overtaken");
        let mut lines = vec![("frames", counts)];
        let is_shown = |(name, count): &(&str, usize)| *name != "aborted" || *count > 0;
        let counts = self.by_status().filter(is_shown);
        lines.extend(counts.map(|(name, count)| (name, count.to_string())));
        if !self.failures.is_empty() {
            let failures = self.failures.iter();
            let failures = failures.map(|(why, count)| format!("{why} ({count})"));
            lines.push(("failed checks", list(failures)));
        }
        if let Some(warning) = &self.first_warning {
            lines.push(("with warnings", format!("{}, first: {warning}", self.warned)));
        }
        lines.push(("round trip", times(&self.round_trips)));
        lines.push(("at the server", times(&self.server_times)));
        if !self.prediction_errors.is_empty() {
            let [median, p99] = percentiles(&self.prediction_errors).map(|metres| metres * 1e3);
            lines.push(("predicted", format!("{median:.1} mm off, 99 %: {p99:.1} mm")));
        }
        f.write_str(&pairs(&lines))
    }
}

#[cfg(test)]
mod tests {
    use grasp_client::v1::CurrentGraspReport;

    use super::*;

    fn answer(sequence: u64, status: CurrentGraspStatus) -> TrackAnswer {
        TrackAnswer {
            sequence,
            current: Some(CurrentGraspReport {
                status: status.into(),
                ..CurrentGraspReport::default()
            }),
            ..TrackAnswer::default()
        }
    }

    #[test]
    fn counts_answers_by_status_and_frames_that_were_overtaken() {
        let mut tally = Tally {
            frames: 4,
            sent: (0..4).map(|sequence| (sequence, Instant::now())).collect(),
            ..Tally::default()
        };
        tally.answered(&answer(0, CurrentGraspStatus::Replanned));
        tally.answered(&answer(3, CurrentGraspStatus::Kept));
        assert_eq!(tally.last_answered, Some(3));
        let line = tally.line();
        assert!(line.starts_with("kept 1  adjusted 0  re-planned 1  none 0"));
        let json = tally.to_json();
        assert_eq!(
            [&json["answered"], &json["skipped"], &json["replanned"]],
            [2, 2, 1]
        );
        assert!(tally.has_grasp());
        assert!(tally.to_string().contains("4, 2 answered, 2 overtaken"));
    }
}
