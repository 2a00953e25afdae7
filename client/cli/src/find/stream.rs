//! `grasp find --stream` and `--alternatives`: grasps as they come.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use grasp_client::{
    DifferBy, FindRequest, Grasp, GraspClient, Outcome, StreamEvent, StreamSummary, Streamed, StreamedGrasp,
};

use serde_json::json;

use super::Drawing;
use crate::{
    Ending,
    failure::Failure,
    format::{grasp_type_name, human_time, name_of},
    output::{Output, write_line, write_message_line},
};

/// Options of a stream.
#[derive(Args, Debug)]
pub(super) struct StreamOptions {
    /// Show each grasp that is better than those before as it is found, until the budget ends.
    #[arg(long, conflicts_with_all = ["alternatives", "only_attempt", "reproducible"])]
    stream: bool,
    /// Most grasps per second; the best of those that come sooner is shown. Default: 30.
    #[arg(long, value_name = "RATE", requires = "stream")]
    most_per_second: Option<f32>,
    /// Show the best grasps that differ, up to so many (1 to 32), best first, when the budget ends.
    #[arg(long, value_name = "COUNT", conflicts_with_all = ["only_attempt", "reproducible"])]
    alternatives: Option<u32>,
    /// What they differ by, such as approach,type. Default: approach.
    #[arg(long, value_name = "WHAT", value_delimiter = ',', requires = "alternatives")]
    differ_by: Vec<DifferByName>,
}

/// What grasps differ by.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum DifferByName {
    /// The side of the object that the hand comes from, and the hand.
    Approach,
    /// The grasp type.
    Type,
    /// The part of the object that is held.
    Region,
}

impl From<DifferByName> for DifferBy {
    fn from(name: DifferByName) -> Self {
        match name {
            DifferByName::Approach => Self::Approach,
            DifferByName::Type => Self::Type,
            DifferByName::Region => Self::Region,
        }
    }
}

impl StreamOptions {
    /// What is streamed, if anything.
    pub(super) fn streamed(&self) -> Option<Streamed> {
        if let Some(count) = self.alternatives {
            return Some(Streamed::Alternatives {
                count,
                differ_by: self.differ_by.iter().map(|&name| name.into()).collect(),
            });
        }
        self.stream.then_some(Streamed::Better {
            most_per_second: self.most_per_second,
        })
    }
}

/// Shows a stream, and draws each grasp.
pub(super) async fn run(
    client: &GraspClient,
    request: &FindRequest,
    streamed: &Streamed,
    drawing: Option<Drawing>,
    output: Output,
) -> Result<Ending, Failure> {
    let mut stream = client.stream_grasps(request, streamed).await?;
    if !output.is_json() {
        write_line(&line([
            "#",
            "score",
            "found after",
            "hand",
            "grasp type",
            "source",
        ]))?;
    }
    let mut number = 0;
    let mut ending = Ending::NoGrasp;
    while let Some(event) = stream.next().await? {
        match event {
            StreamEvent::Grasp(found) => {
                number += 1;
                if output.is_json() {
                    write_message_line("StreamGraspsResponse", &json!({ "grasp": found }))?;
                } else {
                    write_line(&row(number, &found))?;
                }
                if let Some(drawing) = drawing.clone() {
                    numbered(drawing, number, &found.grasp).write().await?;
                }
            }
            StreamEvent::Summary(summary) => {
                if output.is_json() {
                    write_message_line("StreamGraspsResponse", &json!({ "summary": summary }))?;
                } else {
                    write_line(&end(&summary))?;
                }
                ending = match summary.outcome {
                    Outcome::Found => Ending::Done,
                    Outcome::BudgetExhausted | Outcome::Aborted => Ending::NoGrasp,
                };
            }
        }
    }
    Ok(ending)
}

/// The drawing of one of several grasps.
fn numbered(drawing: Drawing, number: usize, grasp: &Grasp) -> Drawing {
    let name = |path: Option<PathBuf>| path.map(|path| numbered_path(&path, number));
    Drawing {
        picture: drawing.picture.with_grasp(grasp.clone()),
        png: name(drawing.png),
        glb: name(drawing.glb),
        ..drawing
    }
}

/// `scene.glb` becomes `scene-3.glb`.
fn numbered_path(path: &Path, number: usize) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let name = match path.extension() {
        Some(extension) => format!("{stem}-{number}.{}", extension.to_string_lossy()),
        None => format!("{stem}-{number}"),
    };
    path.with_file_name(name)
}

fn row(number: usize, found: &StreamedGrasp) -> String {
    let grasp = &found.grasp;
    let score = grasp.score.as_ref().map(|score| format!("{:.3}", score.total));
    line([
        &number.to_string(),
        &score.unwrap_or_else(|| format!("E {:.3}", grasp.comfort)),
        &human_time(found.found_after.as_secs_f64()),
        &name_of(&grasp.handedness),
        &grasp_type_name(grasp),
        &found.source.map(|source| name_of(&source)).unwrap_or_default(),
    ])
}

/// A row of the table, whose widths cannot follow rows that are yet to come.
fn line([number, score, after, hand, grasp_type, source]: [&str; 6]) -> String {
    format!("{number:>4}  {score:>7}  {after:>11}  {hand:5}  {grasp_type:24}  {source}")
        .trim_end()
        .to_owned()
}

fn end(summary: &StreamSummary) -> String {
    let StreamSummary {
        outcome,
        report,
        sent,
        skipped,
    } = summary;
    let what = match outcome {
        Outcome::Found => format!("{sent} of {} valid grasps", report.candidates),
        Outcome::BudgetExhausted | Outcome::Aborted => "no grasp within the budget".to_owned(),
    };
    let skipped = match skipped {
        0 => String::new(),
        skipped => format!(", {skipped} skipped"),
    };
    let took = human_time(report.search_time.as_secs_f64());
    format!("{what}{skipped} in {} attempts and {took}", report.attempts)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_several_grasps_are_numbered() {
        let name = |path: &str| numbered_path(Path::new(path), 3).display().to_string();
        assert_eq!(name("target/scene.glb"), "target/scene-3.glb");
        assert_eq!(name("scene"), "scene-3");
        assert_eq!(name("a.b/c.d.png"), "a.b/c.d-3.png");
    }

    #[test]
    fn rows_are_aligned() {
        let header = line(["#", "score", "found after", "hand", "grasp type", "source"]);
        let row = line(["12", "0.815", "12.3 ms", "right", "medium wrap", "atlas"]);
        for column in ["right", "medium wrap", "atlas"] {
            let place = row.find(column).expect("it is in the row");
            assert!(header.chars().nth(place - 1) == Some(' ') && header.chars().nth(place) != Some(' '));
        }
    }
}
