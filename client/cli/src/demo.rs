//! `grasp demo`

use std::{
    fmt::Write as _,
    net::{Ipv4Addr, Ipv6Addr, SocketAddr},
    path::PathBuf,
    time::{Duration, Instant},
};

use clap::Args;
use grasp_assets::holdouts::{BuiltInHoldout, holdouts};
use grasp_client::{GraspChoice, GraspClient, Handedness, Outcome, Strategy, built_in::request_for, v1};
use grasp_scene::{Handover, Image, Part, ViewSize, contact_sheet};
use grasp_server::{Config, config::StorePlace};
use serde_json::json;
use tokio::{net::TcpListener, sync::oneshot};

use crate::{
    EXIT_CODES, Ending, Failure, Output, blocking,
    input::{STRATEGIES, built_in, one_of, parse_duration, parse_view_size},
    objects::atlas_of,
    output::{
        bar, grasp_type_name, human_time, message_json, rejections_at_a_glance, table, write_file,
        write_json, write_line,
    },
};

const ABOUT: &str = r#"Ask a server inside this process for a grasp on every built-in holdout, and draw the grasps.

The server listens on a free port of the loopback interface and answers over real gRPC. A table shows the result of each
search; the output folder receives a picture (PNG) and a scene (GLB) per holdout, and overview.png with all of them.

With --json: {"folder", "overview", "found", "grasps": [{"object", "holdout", "picture", "scene", "answer",
"round_trip_seconds"}]}, with answers as `grasp find --json` writes them."#;

/// Time limit for the server to load the built-in atlases, usually a few tenths of a second. Without them, searches
/// start from scratch.
const ATLAS_LOAD_TIME: Duration = Duration::from_secs(10);

/// Largest width and height of a picture in the overview, and pictures per row: a row for each built-in object.
const OVERVIEW_VIEW: [u32; 2] = [480, 400];
const OVERVIEW_COLUMNS: usize = 5;

/// Ask a server inside this process for a grasp on every built-in holdout, and draw the grasps.
#[derive(Args, Clone, Debug)]
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

struct AnsweredHoldout {
    holdout: &'static BuiltInHoldout,
    answer: v1::FindGraspResponse,
    round_trip: Duration,
    picture: PathBuf,
    scene: PathBuf,
}

pub(crate) async fn run(arguments: Arguments, output: Output) -> Result<Ending, Failure> {
    let chosen: Vec<&BuiltInHoldout> = if arguments.holdout.is_empty() {
        holdouts().iter().collect()
    } else {
        let names = arguments.holdout.iter();
        names.map(|name| built_in(name)).collect::<Result<_, _>>()?
    };
    // A step to find each grasp, one to draw it, and one for the overview.
    let progress = bar(2 * chosen.len() as u64 + 1, "{pos:>2}/{len}");
    let step = |message: String| {
        progress.set_message(message);
        progress.inc(1);
    };
    // Prefers IPv6, like the server's default; containers often have IPv4 only.
    let addresses = [
        SocketAddr::from((Ipv6Addr::LOCALHOST, 0)),
        SocketAddr::from((Ipv4Addr::LOCALHOST, 0)),
    ];
    let failed = |error| Failure::other("cannot listen on the loopback interface", error);
    let listener = TcpListener::bind(&addresses[..]).await.map_err(failed)?;
    let url = format!("http://{}", listener.local_addr().map_err(failed)?);
    let mut config = Config {
        place: StorePlace::Memory,
        ..Config::default()
    };
    config.budgets.maximum = config.budgets.maximum.max(arguments.budget);
    let (stop, stopped) = oneshot::channel::<()>();
    let serving = grasp_server::run(listener, config, async { stopped.await.unwrap_or_default() });
    let asking = async {
        let all = arguments.ask(url, chosen, step).await;
        drop(stop);
        all
    };
    let (served, all) = tokio::join!(tokio::spawn(serving), asking);
    let served = served.map_err(|error| Failure::other("the server panicked", error))?;
    served.map_err(|error| Failure::other("the server failed", error))?;
    let all = all?;
    let mut small_pictures = Vec::new();
    for answered in &all {
        step(format!("drawing {}", answered.holdout.name));
        small_pictures.push((answered.draw(&arguments).await?, answered.caption()));
    }
    step("drawing the overview".to_owned());
    let path = arguments.out.join("overview.png");
    let overview = blocking(move || {
        let sheet = contact_sheet(&small_pictures, OVERVIEW_COLUMNS);
        sheet.map_or(Ok(()), |sheet| write_file(&path, &sheet.to_png()))?;
        Ok(path)
    });
    let overview = overview.await?;
    progress.finish_and_clear();

    let found = all.iter().filter(|answered| answered.is_found()).count();
    let folder = &arguments.out;
    if output.json {
        let grasps = all
            .iter()
            .map(AnsweredHoldout::to_json)
            .collect::<Result<Vec<_>, _>>()?;
        write_json(&json!({ "folder": folder, "overview": overview, "found": found, "grasps": grasps }))?;
    } else {
        let mut text = describe(&all);
        let (folder, overview, count) = (folder.display(), overview.display(), all.len());
        let _ = write!(
            text,
            "\n{found} of {count} found; pictures and scenes are in {folder}, an overview is {overview}"
        );
        write_line(&text)?;
    }
    Ok(Ending::found(found == all.len()))
}

impl Arguments {
    async fn ask(
        &self,
        url: String,
        holdouts: Vec<&'static BuiltInHoldout>,
        step: impl Fn(String),
    ) -> Result<Vec<AnsweredHoldout>, Failure> {
        let client = GraspClient::connect(url).await?;
        // The first call of a connection exchanges settings, which measured times should exclude.
        client.health().await?;
        if self.strategy == Strategy::Guided {
            wait_for_atlases(&client).await?;
        }
        let mut all = Vec::new();
        for holdout in holdouts {
            step(format!("asking for {}", holdout.name));
            let start = Instant::now();
            let answer = client.find_grasp(&self.request(holdout)).await?;
            let file = |extension: &str| self.out.join(format!("{}.{extension}", holdout.name));
            all.push(AnsweredHoldout {
                holdout,
                answer,
                round_trip: start.elapsed(),
                picture: file("png"),
                scene: file("glb"),
            });
        }
        Ok(all)
    }

    fn request(&self, holdout: &BuiltInHoldout) -> v1::FindGraspRequest {
        let mut request = request_for(holdout)
            .receiving(Handedness::Right)
            .with_budget(self.budget)
            .with_seed(self.seed);
        request.search_mut().set_choice(GraspChoice::Reproducible);
        let thesis = request.requirements_mut().thesis.get_or_insert_default();
        thesis.thesis_validity = self.strategy != Strategy::Guided;
        thesis.set_strategy(self.strategy);
        request
    }
}

impl AnsweredHoldout {
    fn is_found(&self) -> bool {
        self.answer.outcome() == Outcome::Found
    }

    /// Caption in the overview.
    fn caption(&self) -> String {
        let missing = if self.is_found() { "" } else { ": no grasp" };
        format!("{}{missing}", self.holdout.name)
    }

    /// Writes the picture and the scene; returns the picture for the overview.
    async fn draw(&self, arguments: &Arguments) -> Result<Image, Failure> {
        let object = &self.holdout.object;
        let handover = Handover {
            object: Part::built_in_object(object)
                .ok_or_else(|| Failure::usage(format!("{object} is not built in, so it cannot be drawn")))?,
            holdout: request_for(self.holdout).holdout.unwrap_or_default(),
            grasps: self.answer.grasps.clone(),
            model: None,
        };
        let size = arguments.view_size;
        let (picture, scene) = (self.picture.clone(), self.scene.clone());
        blocking(move || {
            write_file(&picture, &handover.draw(size)?.to_png())?;
            write_file(&scene, &handover.to_glb()?)?;
            let [width, height] = OVERVIEW_VIEW;
            Ok(handover.draw(ViewSize {
                width: size.width.min(width),
                height: size.height.min(height),
            })?)
        })
        .await
    }

    fn to_json(&self) -> Result<serde_json::Value, Failure> {
        Ok(json!({
            "object": self.holdout.object,
            "holdout": self.holdout.name,
            "picture": self.picture,
            "scene": self.scene,
            "answer": message_json(&self.answer)?,
            "round_trip_seconds": self.round_trip.as_secs_f64(),
        }))
    }
}

fn describe(all: &[AnsweredHoldout]) -> String {
    let mut table = table(
        "object | holdout | outcome | >attempts | rejections | type | >comfort E | >server | >round trip",
    );
    for answered in all {
        let AnsweredHoldout { holdout, answer, .. } = answered;
        let outcome = match answer.outcome() {
            Outcome::Found => "found",
            Outcome::Aborted => "aborted",
            _ => "none in time",
        };
        // The object has its own column.
        let name = holdout.name.trim_start_matches(&holdout.object);
        let rejections = answer.report.as_ref().map(rejections_at_a_glance);
        let (grasp_type, comfort) = answer.grasp().map_or_else(
            || ("-".to_owned(), "-".to_owned()),
            |grasp| {
                let comfort = grasp.thesis.unwrap_or_default().comfort;
                (grasp_type_name(grasp), format!("{comfort:.4}"))
            },
        );
        table.add_row([
            holdout.object.clone(),
            name.trim_start_matches('-').to_owned(),
            outcome.to_owned(),
            answer.attempts().to_string(),
            rejections.unwrap_or_default(),
            grasp_type,
            comfort,
            human_time(answer.search_time().as_secs_f64()),
            human_time(answered.round_trip.as_secs_f64()),
        ]);
    }
    table.to_string()
}

/// Waits until the server has loaded its built-in atlases: from then on, the same seed shows the same grasps.
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
