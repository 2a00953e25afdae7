//! `grasp demo`

mod asked;
mod draw;
mod everyday;
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
use asked::Asked;

const ABOUT: &str = r#"Ask a server inside this process for a grasp on every built-in holdout, and draw the grasps.

The server listens on a free port of the loopback interface and answers over real gRPC. A table shows the result of each
search; the output folder receives a picture (PNG) and a scene (GLB) per holdout, and overview.png with all of them.

With --json: {"folder", "overview", "found", "grasps": [{"object", "holdout", "picture", "scene", "answer",
"round_trip_seconds"}]}, with answers as `grasp find --json` writes them.

With --everyday, the service takes a hundred everyday objects instead, from a needle to a chair, that nobody holds
out. Each is created and requested at once with the default settings, so no search has an atlas. The folder receives
index.html, a page of all pictures that also says what is beyond one hand and why. A grasp that is not found in time
is a result: the exit code is 0. In the output of --json, "one_hand" objects are within one hand and "found" of these
have a grasp, "page" is the page, and each of "grasps" has "what", "mass_kg" and "beyond_one_hand", null or the
reason, instead of "holdout"."#;

/// Time limit for the server to load the built-in atlases, usually done in some tenths of a second. Without them, searches
/// start from scratch.
const ATLAS_LOAD_TIME: Duration = Duration::from_secs(10);

/// Ask a server inside this process for a grasp on every built-in holdout or everyday object, and draw the grasps.
#[derive(Args, Debug)]
#[command(long_about = ABOUT, after_help = EXIT_CODES)]
pub(crate) struct Arguments {
    /// Everyday objects instead of the built-in holdouts.
    #[arg(long, conflicts_with_all = ["strategy", "holdout"])]
    everyday: bool,
    /// The folder for pictures and scenes. Default: target/demo, or target/everyday with --everyday.
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,
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
    /// Only this everyday object, such as needle; may be repeated. Default: all.
    #[arg(long, value_name = "NAME", requires = "everyday")]
    object: Vec<String>,
    /// Pixels of each picture. Default: 900x700, or 480x400 with --everyday.
    #[arg(long, value_name = "SIZE", value_parser = parse_view_size)]
    view_size: Option<ViewSize>,
    /// Time limit of each search. Default: 20s, or 50ms with --everyday.
    #[arg(long, value_name = "DURATION", value_parser = parse_duration)]
    budget: Option<Duration>,
}

/// What the options say, or their defaults, and the layout of the overview.
#[derive(Clone, Debug)]
struct Plan {
    folder: PathBuf,
    seed: u64,
    budget: Duration,
    /// Pixels of each picture.
    view_size: ViewSize,
    /// Pixels of a picture in the overview, unless the others are smaller.
    small_view: ViewSize,
    /// Pictures per row of the overview.
    columns: usize,
}

pub(crate) async fn run(arguments: Arguments, output: Output) -> Result<Ending, Failure> {
    if arguments.everyday {
        let plan = arguments.everyday_plan();
        Box::pin(everyday::run(&plan, &arguments.object, output)).await?;
        return Ok(Ending::Done);
    }
    let chosen = arguments.chosen()?;
    let plan = arguments.plan();
    let server = local_server::start(plan.budget).await?;
    let progress = progress_of(chosen.len());
    if !arguments.is_of_thesis() {
        wait_for_atlases(&server.client).await?;
    }
    let mut all = Vec::new();
    for holdout in chosen {
        step(&progress, format!("asking for {}", holdout.name));
        let request = arguments.request(holdout, &plan);
        let look = ObjectLook::built_in(&holdout.object).ok_or_else(|| {
            let object = &holdout.object;
            Failure::Usage(format!("{object} is not built in, so it cannot be drawn"))
        })?;
        all.push(Asked::ask(&server.client, (&holdout.name, holdout), look, &request).await?);
    }
    server.stop().await?;
    let drawn = draw::draw_all(&all, &plan, &progress).await?;
    progress.finish_and_clear();
    results::write(&plan, &all, &drawn, output)?;
    let all_found = all.iter().all(Asked::is_found);
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
    /// The plan for the built-in holdouts. A row of five in the overview fills a wide screen and gives each object a row.
    fn plan(&self) -> Plan {
        let view_size = |width, height| ViewSize { width, height };
        Plan {
            folder: self.out.clone().unwrap_or_else(|| "target/demo".into()),
            seed: self.seed,
            budget: self.budget.unwrap_or(Duration::from_secs(20)),
            view_size: self.view_size.unwrap_or(view_size(900, 700)),
            small_view: view_size(480, 400),
            columns: 5,
        }
    }

    /// The plan for everyday objects. The overview is as wide as the longest caption, in about as many rows as columns.
    fn everyday_plan(&self) -> Plan {
        let view_size = |width, height| ViewSize { width, height };
        Plan {
            folder: self.out.clone().unwrap_or_else(|| "target/everyday".into()),
            budget: self.budget.unwrap_or(Duration::from_millis(50)),
            view_size: self.view_size.unwrap_or(view_size(480, 400)),
            small_view: view_size(340, 280),
            columns: 10,
            ..self.plan()
        }
    }

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

    fn request(&self, holdout: &BuiltInHoldout, plan: &Plan) -> v1::FindGraspRequest {
        let mut request = request_for(holdout)
            .receiving(Handedness::Right)
            .with_budget(plan.budget)
            .with_seed(plan.seed);
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
