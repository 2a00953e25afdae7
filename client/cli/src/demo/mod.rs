//! `grasp demo`

mod answer;
mod draw;
mod local_server;
mod results;

use std::{
    path::PathBuf,
    time::{Duration, Instant},
};

use clap::Args;
use grasp_assets::holdouts::{BuiltInHoldout, holdouts};
use grasp_client::{GraspChoice, GraspClient, Handedness, Strategy, built_in::request_for, v1};
use grasp_scene::client::ObjectLook;
use indicatif::ProgressBar;

use crate::{
    EXIT_CODES, Ending, Failure, Output,
    input::built_in,
    objects::atlas_of,
    progress_bar::bar,
    values::{STRATEGIES, ViewSize, one_of, parse_duration, parse_view_size},
};
use answer::AnsweredHoldout;

const ABOUT: &str = r#"Ask a server inside this process for a grasp on every built-in holdout, and draw the grasps.

The server listens on a free port of the loopback interface and answers over real gRPC. A table shows the result of each
search; the output folder receives a picture (PNG) and a scene (GLB) per holdout, and overview.png with all of them.

With --json: {"folder", "overview", "found", "grasps": [{"object", "holdout", "picture", "scene", "answer",
"round_trip_seconds"}]}, with answers as `grasp find --json` writes them."#;

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
    /// Seed of all random streams. Searches on holdouts decide by the indices of their valid attempts: the same
    /// seed shows the same grasps.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Search strategy: GUIDED, the server's default, or A to F of chapter 5 with the thesis's hand and checks.
    #[arg(long, value_parser = one_of(STRATEGIES), ignore_case = true, default_value = "GUIDED")]
    strategy: Strategy,
    /// Only this holdout, such as remote-hold1; may be repeated. Default: all.
    #[arg(long, value_name = "NAME")]
    holdout: Vec<String>,
    /// Pixels of each picture.
    #[arg(long, value_name = "SIZE", value_parser = parse_view_size, default_value = "900x700")]
    view_size: ViewSize,
    /// Time limit of each search.
    #[arg(long, value_name = "DURATION", value_parser = parse_duration, default_value = "20s")]
    budget: Duration,
}

pub(crate) async fn run(arguments: Arguments, output: Output) -> Result<Ending, Failure> {
    let chosen = arguments.chosen()?;
    let server = local_server::start(arguments.budget).await?;
    let progress = progress_of(chosen.len());
    if !arguments.is_of_thesis() {
        wait_for_atlases(&server.client).await?;
    }
    let mut all = Vec::new();
    for holdout in chosen {
        step(&progress, format!("asking for {}", holdout.name));
        let request = arguments.request(holdout);
        let look = ObjectLook::built_in(&holdout.object).ok_or_else(|| {
            let object = &holdout.object;
            Failure::Usage(format!("{object} is not built in, so it cannot be drawn"))
        })?;
        all.push(AnsweredHoldout::ask(&server.client, holdout, look, &request).await?);
    }
    server.stop().await?;
    let drawn = draw::draw_all(&all, &arguments, &progress).await?;
    progress.finish_and_clear();
    results::write(&arguments.out, &all, &drawn, output)?;
    let all_found = all.iter().all(AnsweredHoldout::is_found);
    Ok(Ending::found(all_found))
}

/// The bar of a demo that asks for so many grasps, draws each, and an overview.
fn progress_of(grasps: usize) -> ProgressBar {
    bar(2 * grasps as u64 + 1, "{pos:>2}/{len}")
}

/// Shows that the next step of a demo starts.
fn step(progress: &ProgressBar, message: String) {
    progress.set_message(message);
    progress.inc(1);
}

impl Arguments {
    /// Whether it takes the thesis's checks: for the strategies of its ladder.
    fn is_of_thesis(&self) -> bool {
        self.strategy != Strategy::Guided
    }

    fn chosen(&self) -> Result<Vec<&'static BuiltInHoldout>, Failure> {
        if self.holdout.is_empty() {
            return Ok(holdouts().iter().collect());
        }
        self.holdout.iter().map(|name| built_in(name)).collect()
    }

    fn request(&self, holdout: &BuiltInHoldout) -> v1::FindGraspRequest {
        let mut request = request_for(holdout)
            .receiving(Handedness::Right)
            .with_budget(self.budget)
            .with_seed(self.seed);
        request.search_mut().set_choice(GraspChoice::Reproducible);
        let thesis = request.requirements_mut().thesis.get_or_insert_default();
        thesis.thesis_validity = self.is_of_thesis();
        thesis.set_strategy(self.strategy);
        request
    }
}

/// Waits until the grips that ship with the server are read, a moment after its start: then the same seed always shows
/// the same grasps.
async fn wait_for_atlases(client: &GraspClient) -> Result<(), Failure> {
    let start = Instant::now();
    for object in client.list_objects(&v1::ListObjectsRequest::default()).await? {
        while atlas_of(client, &object.name, "right").await?.entry_count == 0
            && start.elapsed() < ATLAS_LOAD_TIME
        {
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    }
    Ok(())
}
