//! The command line `grasp`.

mod cli;

fn main() -> std::process::ExitCode {
    cli::main()
}
