//! `grasp find --stream` and `--alternatives`: grasps as they come.

use clap::Args;
use grasp_client::{
    GraspClient, GraspSource, Outcome,
    v1::{self, DifferBy, stream_grasps_request::Sent},
};

use super::drawing::Drawing;
use crate::{
    Ending, Failure, Output,
    format::{grasp_type_name, human_time, name_of},
    output::{write_line, write_message_line},
    values::{Choice, one_of},
};

/// Most grasps per second.
const MAX_RATE_HZ: f32 = 30.0;

/// Options of a stream.
#[derive(Args, Debug)]
pub(super) struct StreamOptions {
    /// Show each grasp that is better than those before as it is found, until the budget ends.
    #[arg(long, conflicts_with_all = ["alternatives", "replay_attempt", "reproducible"])]
    stream: bool,
    /// Show the best grasps that differ, up to so many (1 to 32), best first, when the budget ends.
    #[arg(long, value_name = "COUNT", conflicts_with_all = ["replay_attempt", "reproducible"])]
    alternatives: Option<u32>,
    /// What they differ by, such as approach,type. Default: approach.
    #[arg(long, value_name = "WHAT", value_parser = one_of(DIFFERENCES))]
    #[arg(value_delimiter = ',', requires = "alternatives")]
    differ_by: Vec<DifferBy>,
}

/// What grasps differ by.
const DIFFERENCES: [Choice<DifferBy>; 3] = [
    (
        "approach",
        DifferBy::Approach,
        "The side of the object that the hand comes from, and the hand",
    ),
    ("type", DifferBy::Type, "The grasp type"),
    ("region", DifferBy::Region, "The part of the object that is held"),
];

impl StreamOptions {
    /// What is streamed, if anything.
    pub(super) fn sent(&self) -> Option<Sent> {
        if let Some(count) = self.alternatives {
            let differ_by = self.differ_by.iter().map(|&what| what.into()).collect();
            return Some(Sent::Alternatives(v1::Alternatives { count, differ_by }));
        }
        self.stream.then_some(Sent::MaxRateHz(MAX_RATE_HZ))
    }
}

const HEADER: [&str; 6] = ["#", "score", "found after", "hand", "grasp type", "source"];

/// Shows a stream, and draws each grasp.
pub(super) async fn run(
    client: &GraspClient,
    request: &v1::StreamGraspsRequest,
    drawing: Option<Drawing>,
    output: Output,
) -> Result<Ending, Failure> {
    let mut stream = client.stream_grasps(request).await?;
    if !output.json {
        write_line(&line(HEADER))?;
    }
    let mut count = 0;
    let mut end = Ending::NoGrasp;
    while let Some(message) = stream.next().await? {
        let grasp = message.grasp();
        count += usize::from(grasp.is_some());
        if output.json {
            write_message_line(&message)?;
        } else {
            let row = grasp.map(|grasp| row(count, grasp, &message));
            write_line(&row.unwrap_or_else(|| summary(count, &message)))?;
        }
        match (grasp, &drawing) {
            (Some(_), Some(drawing)) => drawing.write(&message.grasps[..1], Some(count)).await?,
            (Some(_), None) => {}
            (None, _) => end = Ending::found(message.outcome() == Outcome::Found),
        }
    }
    Ok(end)
}

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
    line([
        &number.to_string(),
        &score,
        &human_time(found.search_time().as_secs_f64()),
        &hand.unwrap_or_default(),
        &grasp_type_name(grasp),
        &source,
    ])
}

/// A row of the table, whose widths cannot follow rows that are yet to come.
fn line([number, score, after, hand, grasp_type, source]: [&str; 6]) -> String {
    let line = format!("{number:>4}  {score:>7}  {after:>11}  {hand:5}  {grasp_type:24}  {source}");
    line.trim_end().to_owned()
}

/// The last line, after so many grasps.
fn summary(count: usize, last: &v1::FindGraspResponse) -> String {
    let what = match last.outcome() {
        Outcome::Found => format!("{count} valid grasps"),
        _ => "no grasp within the budget".to_owned(),
    };
    let took = human_time(last.search_time().as_secs_f64());
    format!("{what} in {} attempts and {took}", last.attempts())
}
