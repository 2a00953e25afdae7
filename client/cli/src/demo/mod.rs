//! `grasp demo`

mod demo_progress;
mod draw;
mod local_server;
mod results;

use std::{
    path::PathBuf,
    time::{Duration, Instant},
};

use clap::Args;
use grasp_assets::holdouts::{BuiltInHoldout, holdouts};
use grasp_client::{
    FindAnswer, FindRequest, GraspClient, Handedness, Object, Outcome, ReceivingHand, Validity,
    built_in::request_for,
};

use crate::{
    EXIT_CODES, Ending,
    failure::Failure,
    holdout,
    output::Output,
    values::{StrategyName, ViewSize, parse_duration, parse_view_size},
};
use demo_progress::DemoProgress;

const ABOUT: &str = r#"Ask a server inside this process for a grasp on every built-in holdout, and draw the grasps.

The server listens on a free port of the loopback interface and answers over real gRPC. A table shows the result of each
search; the output folder receives a picture (PNG) and a scene (GLB) per holdout, and overview.png with all of them.

With --json: {"folder", "overview", "found", "grasps": [{"object", "holdout", "picture", "scene", "outcome", "grasp",
"report", "round_trip_seconds"}]}, the last four as `grasp find --json` writes them."#;

/// Time limit for the server to load the built-in atlases, usually done in some tenths of a second. Without them, searches
/// start from scratch.
const ATLAS_LOAD_TIME: Duration = Duration::from_secs(10);

/// Ask a server inside this process for a grasp on every built-in holdout, and draw the grasps.
#[derive(Args, Debug)]
#[command(long_about = ABOUT, after_help = EXIT_CODES)]
pub(crate) struct Arguments {
    /// The folder for pictures and scenes.
    #[arg(long, value_name = "FOLDER", default_value = "target/demo")]
    out: PathBuf,
    /// Seed of all random streams. Each search decides by the indices of its valid attempts: the same seed shows the
    /// same grasps.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Search strategy: GUIDED, the server's default, or A to F of chapter 5 with the thesis's hand and checks.
    #[arg(long, ignore_case = true, default_value = "GUIDED")]
    strategy: StrategyName,
    /// Only this holdout, such as remote-hold1; may be repeated. Default: all.
    #[arg(long, value_name = "NAME")]
    holdout: Vec<String>,
    /// Pixels of each of a picture's two views.
    #[arg(long, value_name = "SIZE", default_value = "900x700", value_parser = parse_view_size)]
    view_size: ViewSize,
    /// Time limit of each search.
    #[arg(long, value_name = "DURATION", default_value = "20s", value_parser = parse_duration)]
    budget: Duration,
}

/// The result for one holdout.
#[derive(Clone, Debug)]
struct Asked {
    holdout: &'static BuiltInHoldout,
    request: FindRequest,
    answer: FindAnswer,
    round_trip: Duration,
}

pub(crate) async fn run(arguments: Arguments, output: Output) -> Result<Ending, Failure> {
    let chosen = arguments.chosen()?;
    let server = local_server::start(arguments.budget).await?;
    let progress = DemoProgress::new(2 * chosen.len() as u64 + 1);
    if arguments.validity().is_none() {
        wait_for_atlases(&server.client).await?;
    }
    let asked = ask_all(&arguments, &chosen, &server.client, &progress).await?;
    server.stop().await?;
    let drawn = draw::draw_all(&asked, &arguments.out, arguments.view_size, &progress).await?;
    progress.finish();
    results::write(&arguments.out, &asked, &drawn, output)?;
    let all_found = asked.iter().all(|asked| asked.answer.outcome == Outcome::Found);
    Ok(if all_found { Ending::Done } else { Ending::NoGrasp })
}

impl Arguments {
    /// The thesis's checks for the strategies of its ladder.
    fn validity(&self) -> Option<Validity> {
        match self.strategy {
            StrategyName::Guided => None,
            _ => Some(Validity::Thesis),
        }
    }

    fn chosen(&self) -> Result<Vec<&'static BuiltInHoldout>, Failure> {
        if self.holdout.is_empty() {
            return Ok(holdouts().iter().collect());
        }
        self.holdout.iter().map(|name| holdout::built_in(name)).collect()
    }
}

/// Waits until the grips that ship with the server are read, a moment after its start: then the same seed always shows
/// the same grasps.
async fn wait_for_atlases(client: &GraspClient) -> Result<(), Failure> {
    let start = Instant::now();
    loop {
        let objects = client.list_objects().await?;
        let is_read = |object: &Object| object.atlas.as_ref().is_some_and(|atlas| atlas.entries > 0);
        if objects.iter().all(is_read) || start.elapsed() > ATLAS_LOAD_TIME {
            return Ok(());
        }
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
}

/// Asks for one grasp at a time: each search has the whole machine.
async fn ask_all(
    arguments: &Arguments,
    chosen: &[&'static BuiltInHoldout],
    client: &GraspClient,
    progress: &DemoProgress,
) -> Result<Vec<Asked>, Failure> {
    let mut all = Vec::new();
    for &holdout in chosen {
        progress.step(&format!("asking for {}", holdout.name));
        let request = FindRequest {
            receiving_hand: ReceivingHand {
                rig: None,
                handedness: Some(Handedness::Right),
            },
            budget: Some(arguments.budget),
            strategy: Some(arguments.strategy.into()),
            validity: arguments.validity(),
            seed: Some(arguments.seed),
            reproducible: true,
            ..request_for(holdout)
        };
        let start = Instant::now();
        let answer = client.find_grasp(&request).await?;
        all.push(Asked {
            holdout,
            request,
            answer,
            round_trip: start.elapsed(),
        });
    }
    Ok(all)
}
