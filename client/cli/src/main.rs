//! The command line `grasp`: one module per command, and shared code.

mod bake;
mod demo;
mod evaluate;
mod failure;
mod find;
mod input;
mod isaac;
mod objects;
mod output;
mod rigs;
mod track;
mod validate;
mod view;

use std::process::ExitCode;

use clap::{CommandFactory as _, Parser, Subcommand};
use clap_complete::Shell;
use grasp_client::Health;
use serde_json::json;
use tracing_subscriber::EnvFilter;

use failure::Failure;
use input::ServerOptions;
use output::Output;

const HEALTH: &str = r#"Check whether the server accepts requests; the exit code is 0 exactly if it does.

With --json: {"health": "serving" | "not_serving" | "unknown"}."#;

/// Exit codes at the end of help pages; scripts rely on them.
const EXIT_CODES: &str = "\
Exit codes:
    0  done; for find: a grasp was found; for validate: the grasp is valid; for evaluate: the object can be taken; for health: serving
    1  any other error, such as a file that cannot be read
    2  usage: unknown options, values or names, or a malformed request file
    3  no grasp within the budget; for validate: the grasp is not valid; for bake: an object that no hand takes
    4  rejected by the server: invalid, not found, already exists, read-only, changed meanwhile, or not permitted
    5  no answer: the server is unreachable, not serving, or too slow
  130  interrupted";

/// Finds hand poses with which a virtual character takes an object that a person holds out.
#[derive(Debug, Parser)]
#[command(name = "grasp", version, after_help = EXIT_CODES)]
struct Arguments {
    /// Write results to standard output and errors to standard error as JSON.
    #[arg(long, global = true)]
    json: bool,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Demo(demo::Arguments),
    Find(Box<find::Arguments>),
    Validate(validate::Arguments),
    Evaluate(evaluate::Arguments),
    Track(track::Arguments),
    View(view::Arguments),
    Objects(objects::Arguments),
    Rigs(rigs::Arguments),
    Bake(bake::Arguments),
    /// Check whether the server accepts requests; the exit code is 0 exactly if it does.
    #[command(long_about = HEALTH, after_help = EXIT_CODES)]
    Health(ServerOptions),
    /// Write completions for a shell to standard output.
    ///
    /// For bash: grasp completions bash > ~/.local/share/bash-completion/completions/grasp
    ///
    /// With --json: {"shell": …, "script": …}.
    Completions {
        /// The shell.
        shell: Shell,
    },
}

/// Outcome of a command that did not fail, with its exit code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Ending {
    /// The command did its work.
    Done = 0,
    /// No grasp was found within the budget, or the grasp to check is not valid.
    NoGrasp = 3,
    /// The server rejected some of several objects.
    Rejected = 4,
    /// The server is up but not serving.
    NotServing = 5,
}

impl Ending {
    fn found(is_found: bool) -> Self {
        if is_found { Self::Done } else { Self::NoGrasp }
    }
}

fn main() -> ExitCode {
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => return failure::report_usage(&error),
    };
    // Off by default: commands report results and errors themselves.
    let filter = EnvFilter::try_from_env("GRASP_LOG").unwrap_or_else(|_| EnvFilter::new("off"));
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .init();
    let Arguments { json, command } = arguments;
    match run_until_interrupted(command, Output { json }) {
        Ok(ending) => ExitCode::from(ending as u8),
        Err(failure) => failure.report(json),
    }
}

fn run_until_interrupted(command: Command, output: Output) -> Result<Ending, Failure> {
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .enable_all()
        .build()
        .map_err(|error| Failure::other("cannot start the runtime", error))?;
    let result = runtime.block_on(async {
        tokio::select! {
            result = run(command, output) => result,
            _ = tokio::signal::ctrl_c() => Err(Failure::interrupted()),
        }
    });
    // Does not wait for blocking work, such as a picture, after an interrupt.
    runtime.shutdown_background();
    result
}

async fn run(command: Command, output: Output) -> Result<Ending, Failure> {
    let done = |()| Ending::Done;
    match command {
        Command::Demo(arguments) => Box::pin(demo::run(arguments, output)).await,
        Command::Find(arguments) => Box::pin(find::run(*arguments, output)).await,
        Command::Validate(arguments) => Box::pin(validate::run(arguments, output)).await,
        Command::Evaluate(arguments) => Box::pin(evaluate::run(arguments, output)).await,
        Command::Objects(arguments) => Box::pin(objects::run(arguments, output)).await.map(done),
        Command::Rigs(arguments) => rigs::run(arguments, output).await.map(done),
        Command::Bake(arguments) => Box::pin(bake::run(arguments, output)).await,
        Command::View(arguments) => Box::pin(view::run(arguments, output)).await,
        Command::Track(arguments) => Box::pin(track::run(arguments, output)).await,
        Command::Health(server) => health(&server, output).await,
        Command::Completions { shell } => completions(shell, output).map(done),
    }
}

async fn health(server: &ServerOptions, output: Output) -> Result<Ending, Failure> {
    let health = server.connect().await?.health().await?;
    let (text, ending) = match health {
        Health::Serving => ("serving", Ending::Done),
        Health::NotServing => ("not serving", Ending::NotServing),
        Health::Unknown => ("unknown", Ending::NotServing),
    };
    output.write(&json!({ "health": health }), |_| text.to_owned())?;
    Ok(ending)
}

fn completions(shell: Shell, output: Output) -> Result<(), Failure> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Arguments::command(), "grasp", &mut script);
    if output.json {
        let script = String::from_utf8_lossy(&script);
        return output::write_json(&json!({ "shell": shell.to_string(), "script": script }));
    }
    output::write_bytes(&script)
}

/// Runs blocking work off the runtime, which stays responsive to interrupts.
async fn blocking<T: Send + 'static>(
    work: impl FnOnce() -> Result<T, Failure> + Send + 'static,
) -> Result<T, Failure> {
    tokio::task::spawn_blocking(work)
        .await
        .map_err(|error| Failure::other("the command panicked", error))?
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn command_line_is_consistent() {
        Arguments::command().debug_assert();
    }
}
