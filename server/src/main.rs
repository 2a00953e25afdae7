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
    Config, ConfigError, ListenAddress, Listener, LogLines, Server, check_health,
    config::{LogFormat, RawConfig, read_file, unknown_variables},
    fit_open_files, is_reserved_memory_limited, new_token, warn_of_memory,
};
use rustix::fs::Mode;
use tokio::signal::unix::{SignalKind, signal};
use tracing_subscriber::{
    Registry, filter::Targets, fmt, layer::SubscriberExt as _, reload, util::SubscriberInitExt as _,
};

/// How long to wait at the end for work that has not stopped.
const RUNTIME_END: Duration = Duration::from_millis(500);

/// Answers grasp requests over gRPC, gRPC-Web and Connect.
///
/// Every option can also be set in the environment or in a file. Flags override the environment, and the environment
/// overrides the file.
///
/// The server refuses to start, prints the reason and exits with 1 if a value or an object of the objects directory is
/// invalid. After SIGTERM, SIGINT or SIGQUIT it answers running calls and exits with 0. After SIGHUP it does the same if its
/// standard input is a terminal, which sends the signal when it is closed; otherwise it reads certificates, tokens
/// and the filter of the log again. A second signal ends it at once, with 1.
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
    /// Make a token for a client, print its entry for the file of tokens and, to standard error, the secret, and exit.
    ///
    /// grasp-server --new-token NAME >> tokens.toml
    #[arg(long, value_name = "NAME", conflicts_with_all = ["print_config", "health_check", "descriptor_set"])]
    new_token: Option<String>,
    #[command(flatten)]
    values: RawConfig,
}

fn main() -> ExitCode {
    match start(&Flags::parse()) {
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

/// The configuration from all sources: every value for people, and checked.
fn configuration(flags: &Flags) -> Result<(RawConfig, Config), ConfigError> {
    let file = match &flags.config {
        Some(path) => read_file(path)?,
        None => RawConfig::default(),
    };
    let mut values = flags.values.clone();
    let config = values.complete(file)?;
    Ok((values, config))
}

fn start(flags: &Flags) -> Result<ExitCode, Box<dyn std::error::Error>> {
    if flags.descriptor_set {
        print_descriptor_set()?;
        return Ok(ExitCode::SUCCESS);
    }
    if let Some(name) = &flags.new_token {
        let (secret, entry) = new_token(name)?;
        print!("{entry}");
        eprintln!("{secret}");
        return Ok(ExitCode::SUCCESS);
    }
    let (values, mut config) = configuration(flags)?;
    if flags.print_config {
        print!("{}", toml::to_string(&values)?);
        return Ok(ExitCode::SUCCESS);
    }
    if flags.health_check {
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()?;
        runtime.block_on(check_health(&config.listen, config.tls.is_some()))?;
        return Ok(ExitCode::SUCCESS);
    }
    // Files of the store are private from their first moment, even where a library creates them.
    rustix::process::umask(Mode::RWXG | Mode::RWXO);
    let arenas = limit_arenas();
    let log_filter = start_log(&config)?;
    if let Err(error) = arenas {
        tracing::warn!(%error, "cannot start again with fewer arenas: allocations may fail below the limit of reserved memory");
    }
    fit_open_files(&mut config);
    let json = config.log_format == LogFormat::Json;
    let config_reloader = ConfigReloader {
        flags,
        values,
        log_filter,
    };
    match run(&config, config_reloader) {
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

fn run(config: &Config, config_reloader: ConfigReloader<'_>) -> Result<(), Box<dyn std::error::Error>> {
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
    let result = runtime.block_on(serve(config, server, config_reloader));
    runtime.shutdown_timeout(RUNTIME_END);
    result
}

async fn serve(
    config: &Config,
    server: Server,
    mut config_reloader: ConfigReloader<'_>,
) -> Result<(), Box<dyn std::error::Error>> {
    let listeners = Listener::bind_all(&config.listen).await;
    let listeners = listeners.map_err(|(address, error)| format!("cannot listen on {address}: {error}"))?;
    // Before logging that the server is there: from now on, signals start the drain.
    let kinds = [
        SignalKind::terminate(),
        SignalKind::interrupt(),
        SignalKind::quit(),
    ];
    let mut signals = kinds.into_iter().map(signal).collect::<io::Result<Vec<_>>>()?;
    let mut hangup = signal(SignalKind::hangup())?;
    // Services have none: for them, the signal means to read the configuration again.
    let has_terminal = io::stdin().is_terminal();
    let reloader = server.reloader();
    let shutdown = async move {
        {
            let mut end = select_all(signals.iter_mut().map(|signal| Box::pin(signal.recv())));
            loop {
                tokio::select! {
                    _ = &mut end => break,
                    _ = hangup.recv() => {
                        if has_terminal {
                            break;
                        }
                        config_reloader.reload();
                        reloader.reload();
                    }
                }
            }
        }
        tokio::spawn(async move {
            select_all(signals.iter_mut().map(|signal| Box::pin(signal.recv()))).await;
            tracing::warn!("a second signal: ending at once");
            std::process::exit(1);
        });
    };
    for listener in &listeners {
        let address = listener.address()?;
        let tls = config.tls.is_some() && matches!(address, ListenAddress::Tcp(_));
        tracing::info!(%address, workers = config.workers, tls, "serving");
        if let ListenAddress::Tcp(address) = address
            && config.viewer
        {
            let scheme = if tls { "https" } else { "http" };
            tracing::info!("the viewer is at {scheme}://{address}/");
        }
    }
    let server = match &config.metrics_listen {
        Some(address) => {
            let listener = Listener::bind(address).await;
            let listener =
                listener.map_err(|error| format!("cannot listen on {address} for metrics: {error}"))?;
            tracing::info!(at = %listener.address()?, "metrics and probes");
            server.monitored_on(listener)
        }
        None => server,
    };
    server.serve(listeners, shutdown).await?;
    Ok(())
}

/// Reads the configuration of a running server again.
struct ConfigReloader<'f> {
    flags: &'f Flags,
    /// The values in force.
    values: RawConfig,
    log_filter: LogFilter,
}

type LogFilter = reload::Handle<Targets, Registry>;

impl ConfigReloader<'_> {
    /// Applies changes that a running server can make, and logs the result.
    fn reload(&mut self) {
        let read = configuration(self.flags);
        let Ok((values, config)) = read.inspect_err(|error| {
            tracing::error!(%error, "the configuration stays as it was");
        }) else {
            return;
        };
        if values.log != self.values.log
            && let Ok(filter) = config.log.parse::<Targets>()
            && self.log_filter.reload(filter).is_ok()
        {
            self.values.log.clone_from(&values.log);
            tracing::info!(log = config.log, "applied a change of the configuration");
        }
        for key in self.values.differences(&values) {
            tracing::warn!(key, "a change of the configuration needs a restart");
        }
    }
}

fn start_log(config: &Config) -> Result<LogFilter, Box<dyn std::error::Error>> {
    let (filter, handle) = reload::Layer::new(config.log.parse::<Targets>()?);
    let filtered = tracing_subscriber::registry().with(filter);
    let is_terminal = io::stderr().is_terminal();
    let log = fmt::layer()
        .with_ansi(is_terminal)
        // Writing to a log that failed, such as a closed terminal, would panic.
        .log_internal_errors(false)
        .with_writer(move || LogLines::new(io::stderr(), is_terminal));
    match config.log_format {
        LogFormat::Text => filtered.with(log).init(),
        LogFormat::Json => filtered.with(log.json().flatten_event(true)).init(),
    }
    std::panic::set_hook(Box::new(|panic| tracing::error!(%panic, "panic")));
    Ok(handle)
}
