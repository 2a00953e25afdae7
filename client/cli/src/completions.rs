//! `grasp completions`

use clap::{Args, CommandFactory as _};
use clap_complete::Shell;

use crate::{Failure, Output, output};

const ABOUT: &str = r#"Write completions for a shell to standard output.

For bash: grasp completions bash > ~/.local/share/bash-completion/completions/grasp

With --json: {"shell": …, "script": …}."#;

/// Write completions for a shell to standard output.
#[derive(Args, Debug)]
#[command(long_about = ABOUT)]
pub(crate) struct Arguments {
    /// The shell.
    shell: Shell,
}

pub(crate) fn run(arguments: &Arguments, output: Output) -> Result<(), Failure> {
    let mut script = Vec::new();
    clap_complete::generate(
        arguments.shell,
        &mut super::Arguments::command(),
        "grasp",
        &mut script,
    );
    if output.json {
        let script = String::from_utf8_lossy(&script);
        output::write_json(&serde_json::json!({ "shell": arguments.shell.to_string(), "script": script }))
    } else {
        output::write_bytes(&script)
    }
}
