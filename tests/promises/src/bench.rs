//! Shared by all scenarios: servers on their cores, requests, progress, and how much the server can do.

use std::{
    fmt::Display,
    path::{Path, PathBuf},
    time::Duration,
};

use indicatif::{ProgressBar, ProgressFinish, ProgressStyle};
use tokio::{runtime::Runtime, sync::OnceCell};

use crate::{
    Failure,
    cores::{Cores, Split},
    load::{Call, LIGHT, Tally, closed_loop, connect, find_grasp},
    report::Row,
    requests::Requests,
    scenarios::{self, Scenario},
    server::ServerProcess,
};

/// The method that searches, for calls by hand; and the window of their answers, in bytes.
pub(crate) const FIND_GRASP: &str = "grasp.v1.GraspService/FindGrasp";
pub(crate) const WINDOW: u32 = 1 << 20;

/// Calls at a time that keep the server busy without a queue that exceeds deadlines, per worker.
const BUSY: usize = 8;

/// Where server and generator run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Placement {
    /// On cores of their own.
    Apart,
    /// Both on all cores.
    Together,
}

/// The setting of all scenarios.
pub(crate) struct Bench {
    program: PathBuf,
    /// Whether loads last as long as the promises say.
    pub(crate) long: bool,
    pub(crate) split: Split,
    pub(crate) requests: Requests,
    runtime: Runtime,
    capacity: OnceCell<f64>,
    bar: ProgressBar,
}

impl Bench {
    /// Places givers and pins this process to its cores.
    pub(crate) fn new(program: PathBuf, long: bool) -> Result<Self, Failure> {
        let split = Split::of_this_process()?;
        split.generator.pin_this_process()?;
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(split.generator.count())
            .enable_all()
            .build()?;
        let style = ProgressStyle::with_template("{spinner} {elapsed:>4} {msg}")?;
        let bar = ProgressBar::new_spinner()
            .with_style(style)
            .with_finish(ProgressFinish::AndClear);
        bar.enable_steady_tick(Duration::from_millis(200));
        bar.set_message("placing givers on objects");
        let server = start(&program, &split.server, NO_ATLASES)?;
        let requests = runtime.block_on(async {
            Ok::<_, Failure>(Requests::new(&connect(server.address, LIGHT).await?).await?)
        })?;
        Ok(Self {
            program,
            long,
            split,
            requests,
            runtime,
            capacity: OnceCell::new(),
            bar,
        })
    }

    /// Measures the promises of a scenario.
    pub(crate) fn measure(&self, scenario: Scenario) -> Result<Vec<Row>, Failure> {
        self.runtime.block_on(scenarios::measure(self, scenario))
    }

    /// Shows the current step.
    pub(crate) fn step(&self, step: impl Display) {
        self.bar.set_message(step.to_string());
    }

    /// The first of two lengths in a long run, else the second.
    pub(crate) fn seconds(&self, long: u64, short: u64) -> Duration {
        Duration::from_secs(if self.long { long } else { short })
    }

    /// A server on cores of its own that builds no atlases, with as many workers as it has cores.
    pub(crate) fn server(&self, flags: &[&str]) -> Result<ServerProcess, Failure> {
        self.server_at(Placement::Apart, flags)
    }

    /// The same, placed.
    pub(crate) fn server_at(&self, placement: Placement, flags: &[&str]) -> Result<ServerProcess, Failure> {
        let cores = match placement {
            Placement::Apart => &self.split.server,
            Placement::Together => &self.split.all,
        };
        start(&self.program, cores, flags)
    }

    /// Runs `during` with this process on all cores.
    pub(crate) async fn unpinned<T>(
        &self,
        during: impl Future<Output = Result<T, Failure>>,
    ) -> Result<T, Failure> {
        self.split.all.pin_this_process()?;
        let output = during.await;
        self.split.generator.pin_this_process()?;
        output
    }

    /// Searches per second that a server on cores of its own answers within their deadline when there are just enough calls.
    pub(crate) async fn saturation(&self) -> Result<f64, Failure> {
        let saturation = self.capacity.get_or_try_init(|| async {
            let server = self.server(NO_ATLASES)?;
            self.step("saturation");
            let call = find_grasp(server.address, LIGHT, &self.requests.searching).await?;
            Ok::<_, Failure>(self.saturate(call, Placement::Apart).await?.goodput())
        });
        saturation.await.copied()
    }

    /// Keeps a server just busy with calls.
    ///
    /// # Errors
    /// It serves none.
    pub(crate) async fn saturate(&self, call: Call, placement: Placement) -> Result<Tally, Failure> {
        let at_a_time = BUSY
            * match placement {
                Placement::Apart => self.split.server.count(),
                Placement::Together => self.split.all.count(),
            };
        let tally = closed_loop(call, at_a_time, self.seconds(20, 3)).await;
        if tally.goodput() > 0.0 {
            Ok(tally)
        } else {
            Err(format!(
                "the server serves none of {at_a_time} calls at a time: {}",
                tally.summary()
            )
            .into())
        }
    }
}

/// A server with as many workers as cores.
fn start(program: &Path, cores: &Cores, flags: &[&str]) -> Result<ServerProcess, Failure> {
    let workers = cores.count().to_string();
    let io_threads = cores.count().div_ceil(8).to_string();
    let mut all = vec!["--workers", &workers, "--io-threads", &io_threads];
    all.extend(flags);
    Ok(ServerProcess::start(program, cores, &all)?)
}

/// Of a server that does nothing between calls.
pub(crate) const NO_ATLASES: &[&str] = &["--builder-threads", "0"];
