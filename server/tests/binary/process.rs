//! Runs the server's binary.

use std::{
    io::{BufRead as _, BufReader},
    path::Path,
    process::{Child, ChildStderr, Command, Stdio},
};

/// A process that has ended.
pub(crate) struct Ended {
    /// Its exit code.
    pub code: i32,
    /// Its standard error.
    pub text: String,
}

/// A shell command in which `grasp-server` is the binary under test, with these environment variables only. Objects are in
/// memory only, unless a variable says otherwise.
fn command(line: &str, variables: &[(&str, &str)]) -> Command {
    let binary = Path::new(env!("CARGO_BIN_EXE_grasp-server"));
    let folder = binary.parent().expect("a binary lies in a folder");
    let mut command = Command::new("/bin/sh");
    command.arg("-c").arg(line).env_clear().env("PATH", folder);
    command
        .env("GRASP_STORE", "memory")
        .envs(variables.iter().copied());
    command.stdin(Stdio::null()).stderr(Stdio::piped());
    command
}

/// Runs a command to its end.
pub(crate) fn output(line: &str, variables: &[(&str, &str)]) -> Ended {
    let output = command(line, variables).output().expect("there is a shell");
    Ended {
        code: output.status.code().expect("no signal ended it"),
        text: String::from_utf8(output.stderr).expect("the server writes text"),
    }
}

/// A running server, killed when it is dropped.
pub(crate) struct Running {
    child: Child,
    /// None once it is closed.
    log: Option<BufReader<ChildStderr>>,
    start_log: String,
    address: String,
}

impl Running {
    /// Starts the server and waits until it logs its address.
    pub(crate) fn start(variables: &[(&str, &str)]) -> Self {
        Self::start_command("exec grasp-server", variables)
    }

    /// Starts the server by a command that must `exec` it, and waits until it logs its address.
    pub(crate) fn start_command(line: &str, variables: &[(&str, &str)]) -> Self {
        let mut child = command(line, variables).spawn().expect("there is a shell");
        let log = BufReader::new(child.stderr.take().expect("it is piped"));
        let mut running = Self {
            child,
            log: Some(log),
            start_log: String::new(),
            address: String::new(),
        };
        running.address = running.read_address();
        running
    }

    /// Reads the log up to the line with the address.
    fn read_address(&mut self) -> String {
        let log = &mut self.start_log;
        let lines = self.log.as_mut().expect("it is open");
        loop {
            let start = log.len();
            let read = lines.read_line(log).expect("the server writes text");
            assert!(read > 0, "the server ended before it logged its address: {log}");
            if let Some((_, rest)) = log[start..].split_once("address=") {
                return rest.split_whitespace().next().expect("it follows").to_owned();
            }
        }
    }

    /// The log up to the line with the address.
    pub(crate) fn start_log(&self) -> &str {
        &self.start_log
    }

    /// The address that it listens on.
    pub(crate) fn address(&self) -> &str {
        &self.address
    }

    /// The number of its process.
    pub(crate) fn process(&self) -> u32 {
        self.child.id()
    }

    /// Sends SIGTERM, waits for a successful end and returns the rest of the log.
    pub(crate) fn terminate(self) -> Vec<String> {
        self.end_by("TERM")
    }

    /// Sends a signal to the process.
    fn send(&self, signal: &str) {
        let process = self.child.id().to_string();
        let sent = Command::new("kill").args(["-s", signal, &process]).status();
        assert!(sent.expect("there is kill").success());
    }

    /// Sends a signal, waits for a successful end and returns the rest of the log.
    pub(crate) fn end_by(mut self, signal: &str) -> Vec<String> {
        self.send(signal);
        let log = self.log.take().expect("it is open");
        let log: Vec<String> = log
            .lines()
            .map(|line| line.expect("the server writes text"))
            .collect();
        let status = self.child.wait().expect("it is a child");
        assert!(status.success(), "{status}: {log:?}");
        log
    }

    /// Closes its log, as a terminal that is closed does, sends a signal, and waits for a successful end.
    pub(crate) fn end_without_log_by(mut self, signal: &str) {
        drop(self.log.take());
        self.send(signal);
        let status = self.child.wait().expect("it is a child");
        assert!(status.success(), "{status}");
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // It has already ended unless the test failed.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
