//! The binary: configuration, log, runtime, listeners and signals; the health check, and the descriptor set.

use std::{
    env, io,
    io::{IsTerminal as _, Write as _},
    os::unix::process::CommandExt as _,
    path::PathBuf,
    process::{Command, ExitCode},
    time::Duration,
};

use clap::{CommandFactory as _, Parser};
use futures_util::future::select_all;
use grasp_server::{
    Config, ListenAddress, Listener, Server, check_health,
    config::{LogFormat, RawConfig, read_file, unknown_variables},
    fit_open_files, is_reserved_memory_limited, warn_of_memory,
};
use rustix::fs::Mode;
use tokio::signal::unix::{SignalKind, signal};
use tracing_subscriber::{filter::Targets, fmt, layer::SubscriberExt as _, util::SubscriberInitExt as _};

/// How long to wait at the end for work that has not stopped.
const RUNTIME_END: Duration = Duration::from_millis(500);

/// Answers grasp requests over gRPC, gRPC-Web and Connect.
///
/// Every option can also be set in the environment or in a file. Flags override the environment, and the environment
/// overrides the file.
///
/// The server refuses to start, prints the reason and exits with 1 if a value or an object of the objects directory is
/// invalid. After SIGTERM, SIGINT, SIGQUIT or SIGHUP, which a terminal sends when it is closed, it
/// answers running calls and exits with 0.
#[derive(Debug, Parser)]
#[command(version, name = "grasp-server")]
struct Flags {
    /// Configuration file (TOML); its keys are the names of the options with _ instead of -.
    #[arg(long, env = "GRASP_CONFIG", value_name = "FILE")]
    config: Option<PathBuf>,
    /// Print the effective configuration as TOML and exit.
    #[arg(long)]
    print_config: bool,
    /// Check the health of the server that runs with this configuration; exit with 0 if it serves.
    ///
    /// An unspecified address (0.0.0.0, [::]) is reached over the loopback interface. The time limit is 900 ms.
    #[arg(long, conflicts_with = "print_config")]
    health_check: bool,
    /// Print the descriptor set of the contract, for tools without reflection, and exit.
    #[arg(long, conflicts_with_all = ["print_config", "health_check"])]
    descriptor_set: bool,
    #[command(flatten)]
    values: RawConfig,
}

fn main() -> ExitCode {
    match start(Flags::parse()) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Where reserved memory is limited, starts the program again with two arenas of glibc's allocator, which reads their number when
/// a process starts. Each reserves 64 MiB, used or not, and otherwise nearly every thread has one.
fn limit_arenas() -> io::Result<()> {
    const VARIABLE: &str = "MALLOC_ARENA_MAX";
    if cfg!(not(target_env = "gnu")) || env::var_os(VARIABLE).is_some() || !is_reserved_memory_limited() {
        return Ok(());
    }
    let mut again = Command::new(env::current_exe()?);
    Err(again.args(env::args_os().skip(1)).env(VARIABLE, "2").exec())
}

fn start(mut flags: Flags) -> Result<ExitCode, Box<dyn std::error::Error>> {
    if flags.descriptor_set {
        print_descriptor_set()?;
        return Ok(ExitCode::SUCCESS);
    }
    let file = match &flags.config {
        Some(path) => read_file(path)?,
        None => RawConfig::default(),
    };
    let mut config = flags.values.complete(file)?;
    if flags.print_config {
        print!("{}", toml::to_string(&flags.values)?);
        return Ok(ExitCode::SUCCESS);
    }
    if flags.health_check {
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()?;
        runtime.block_on(check_health(&config.listen))?;
        return Ok(ExitCode::SUCCESS);
    }
    // Files of the store are private from their first moment, even where a library creates them.
    rustix::process::umask(Mode::RWXG | Mode::RWXO);
    let arenas = limit_arenas();
    start_log(&config)?;
    if let Err(error) = arenas {
        tracing::warn!(%error, "cannot start again with fewer arenas: allocations may fail below the limit of reserved memory");
    }
    fit_open_files(&mut config);
    let json = config.log_format == LogFormat::Json;
    match run(&config) {
        Ok(()) => Ok(ExitCode::SUCCESS),
        // Readers of a JSON log need the reason there, too.
        Err(error) if json && tracing::enabled!(tracing::Level::ERROR) => {
            tracing::error!(%error, "the server failed");
            Ok(ExitCode::FAILURE)
        }
        Err(error) => Err(error),
    }
}

fn print_descriptor_set() -> Result<(), Box<dyn std::error::Error>> {
    let mut output = io::stdout();
    if output.is_terminal() {
        return Err(
            "the descriptor set is binary; redirect it: grasp-server --descriptor-set > grasp.binpb".into(),
        );
    }
    output.write_all(grasp_proto::FILE_DESCRIPTOR_SET)?;
    Ok(output.flush()?)
}

fn run(config: &Config) -> Result<(), Box<dyn std::error::Error>> {
    let variables = env::vars_os().filter_map(|(name, _)| name.into_string().ok());
    let flags = Flags::command();
    let known = flags.get_arguments().filter_map(|argument| argument.get_env());
    let known: Vec<String> = known
        .filter_map(|name| name.to_str().map(str::to_owned))
        .collect();
    for name in unknown_variables(variables, &known) {
        tracing::warn!(
            name,
            "unknown environment variable with the prefix of the server's"
        );
    }
    warn_of_memory(config);
    let server = Server::new(config.clone())?;
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(config.io_threads.get())
        .max_blocking_threads(config.blocking_threads())
        .enable_all()
        .build()?;
    let result = runtime.block_on(serve(config, server));
    runtime.shutdown_timeout(RUNTIME_END);
    result
}

async fn serve(config: &Config, server: Server) -> Result<(), Box<dyn std::error::Error>> {
    let listeners = Listener::bind_all(&config.listen).await;
    let listeners = listeners.map_err(|(address, error)| format!("cannot listen on {address}: {error}"))?;
    // Before logging that the server is there: from now on, signals start the drain.
    let kinds = [
        SignalKind::terminate(),
        SignalKind::interrupt(),
        SignalKind::quit(),
        SignalKind::hangup(),
    ];
    let mut signals = kinds.into_iter().map(signal).collect::<io::Result<Vec<_>>>()?;
    let shutdown = async move {
        select_all(signals.iter_mut().map(|signal| Box::pin(signal.recv()))).await;
    };
    for listener in &listeners {
        let address = listener.address()?;
        tracing::info!(%address, workers = config.workers, "serving");
        if let ListenAddress::Tcp(address) = address
            && config.viewer
        {
            tracing::info!("the viewer is at http://{address}/");
        }
    }
    server.serve(listeners, shutdown).await?;
    Ok(())
}

fn start_log(config: &Config) -> Result<(), Box<dyn std::error::Error>> {
    let filtered = tracing_subscriber::registry().with(config.log.parse::<Targets>()?);
    let log = fmt::layer()
        .with_ansi(io::stderr().is_terminal())
        // Writing to a log that failed, such as a closed terminal, would panic.
        .log_internal_errors(false)
        .with_writer(io::stderr);
    match config.log_format {
        LogFormat::Text => filtered.with(log).init(),
        LogFormat::Json => filtered.with(log.json().flatten_event(true)).init(),
    }
    std::panic::set_hook(Box::new(|panic| tracing::error!(%panic, "panic")));
    Ok(())
}
