//! `grasp demo`

mod demo_progress;
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
use grasp_client::{GraspChoice, GraspClient, Handedness, Outcome, Strategy, built_in::request_for, v1};
use grasp_scene::client::ObjectLook;

use crate::{
    EXIT_CODES, Ending,
    failure::Failure,
    holdout,
    objects::atlas_of,
    output::Output,
    picture::Picture,
    values::{STRATEGIES, ViewSize, one_of, parse_duration, parse_view_size},
};
use demo_progress::DemoProgress;
use draw::{Drawing, Layout};

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

/// How the pictures of holdouts are laid out: a row of five in the overview fills a wide screen and gives each object a row.
const SMALL_VIEW: ViewSize = ViewSize {
    width: 480,
    height: 400,
};
const COLUMNS: usize = 5;

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
    /// Pixels of each of a picture's two views. Default: 900x700, or 480x400 with --everyday.
    #[arg(long, value_name = "SIZE", value_parser = parse_view_size)]
    view_size: Option<ViewSize>,
    /// Time limit of each search. Default: 20s, or 50ms with --everyday.
    #[arg(long, value_name = "DURATION", value_parser = parse_duration)]
    budget: Option<Duration>,
}

/// What the options say, or their defaults.
#[derive(Clone, Debug)]
struct Plan {
    folder: PathBuf,
    seed: u64,
    view_size: ViewSize,
    budget: Duration,
}

/// The result for one holdout.
#[derive(Clone, Debug)]
struct Asked {
    holdout: &'static BuiltInHoldout,
    request: v1::FindGraspRequest,
    answer: v1::FindGraspResponse,
    round_trip: Duration,
}

pub(crate) async fn run(arguments: Arguments, output: Output) -> Result<Ending, Failure> {
    if arguments.everyday {
        let plan = arguments.plan("target/everyday", (480, 400), Duration::from_millis(50));
        return everyday::run(&plan, &arguments.object, output).await;
    }
    let chosen = arguments.chosen()?;
    let plan = arguments.plan("target/demo", (900, 700), Duration::from_secs(20));
    let server = local_server::start(plan.budget).await?;
    let progress = DemoProgress::new(2 * chosen.len() as u64 + 1);
    if !arguments.is_of_thesis() {
        wait_for_atlases(&server.client).await?;
    }
    let asked = ask_all(&arguments, &plan, &chosen, &server.client, &progress).await?;
    server.stop().await?;
    let drawings = asked.iter().map(drawing).collect::<Result<_, _>>()?;
    let layout = Layout {
        view_size: plan.view_size,
        small_view: SMALL_VIEW,
        columns: COLUMNS,
    };
    let drawn = draw::draw_all(drawings, &plan.folder, layout, &progress).await?;
    progress.finish();
    results::write(&plan.folder, &asked, &drawn, output)?;
    let all_found = asked.iter().all(|asked| asked.answer.outcome() == Outcome::Found);
    Ok(if all_found { Ending::Done } else { Ending::NoGrasp })
}

fn drawing(asked: &Asked) -> Result<Drawing, Failure> {
    let object = &asked.holdout.object;
    let look = ObjectLook::built_in(object)
        .ok_or_else(|| Failure::Usage(format!("{object} is not built in, so it cannot be drawn")))?;
    let name = asked.holdout.name.clone();
    Ok(Drawing {
        caption: caption(&name, &asked.answer),
        name,
        picture: Picture::new(look, &asked.request)?.with_grasps(asked.answer.grasps.clone()),
    })
}

/// The line below a picture in the overview.
fn caption(name: &str, answer: &v1::FindGraspResponse) -> String {
    match answer.outcome() {
        Outcome::Found => name.to_owned(),
        _ => format!("{name}: no grasp"),
    }
}

impl Arguments {
    fn plan(&self, folder: &str, (width, height): (u32, u32), budget: Duration) -> Plan {
        Plan {
            folder: self.out.clone().unwrap_or_else(|| folder.into()),
            seed: self.seed,
            view_size: self.view_size.unwrap_or(ViewSize { width, height }),
            budget: self.budget.unwrap_or(budget),
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
        self.holdout.iter().map(|name| holdout::built_in(name)).collect()
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

/// Asks for one grasp at a time: each search has the whole machine.
async fn ask_all(
    arguments: &Arguments,
    plan: &Plan,
    chosen: &[&'static BuiltInHoldout],
    client: &GraspClient,
    progress: &DemoProgress,
) -> Result<Vec<Asked>, Failure> {
    let mut all = Vec::new();
    for &holdout in chosen {
        progress.step(&format!("asking for {}", holdout.name));
        let mut request = request_for(holdout)
            .receiving(Handedness::Right)
            .with_budget(plan.budget)
            .with_seed(plan.seed);
        request.search_mut().set_choice(GraspChoice::Reproducible);
        let mut thesis = v1::ThesisOptions {
            thesis_validity: arguments.is_of_thesis(),
            ..v1::ThesisOptions::default()
        };
        thesis.set_strategy(arguments.strategy);
        request.requirements_mut().thesis = Some(thesis);
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
