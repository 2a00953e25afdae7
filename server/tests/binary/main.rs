//! The binary: exit codes, messages, signals, health checks, and what it bears.
#![cfg(target_os = "linux")]

mod stress;

use std::{
    fs,
    io::{BufRead as _, BufReader},
    net::{Ipv4Addr, TcpListener},
    path::Path,
    process::{Child, ChildStderr, Command, Stdio},
};

/// A process that has ended.
struct Ended {
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
fn output(line: &str, variables: &[(&str, &str)]) -> Ended {
    let output = command(line, variables).output().expect("there is a shell");
    Ended {
        code: output.status.code().expect("no signal ended it"),
        text: String::from_utf8(output.stderr).expect("the server writes text"),
    }
}

/// A running server, killed when it is dropped.
struct Running {
    child: Child,
    /// `None` once it is closed.
    log: Option<BufReader<ChildStderr>>,
    /// The log up to the line with the address.
    start_log: String,
    /// The address that it listens on.
    address: String,
}

impl Running {
    /// Starts the server and waits until it logs its address.
    fn start(variables: &[(&str, &str)]) -> Self {
        Self::start_command("exec grasp-server", variables)
    }

    /// Starts the server by a command that must `exec` it, and waits until it logs its address.
    fn start_command(line: &str, variables: &[(&str, &str)]) -> Self {
        let mut child = command(line, variables).spawn().expect("there is a shell");
        let mut log = BufReader::new(child.stderr.take().expect("it is piped"));
        let mut start_log = String::new();
        let address = loop {
            let start = start_log.len();
            let read = log.read_line(&mut start_log).expect("the server writes text");
            assert!(
                read > 0,
                "the server ended before it logged its address: {start_log}"
            );
            if let Some((_, rest)) = start_log[start..].split_once("address=") {
                break rest.split_whitespace().next().expect("it follows").to_owned();
            }
        };
        Self {
            child,
            log: Some(log),
            start_log,
            address,
        }
    }

    /// The line of the start's log with a text.
    fn line_with(&self, text: &str) -> &str {
        let line = self.start_log.lines().find(|line| line.contains(text));
        line.unwrap_or_else(|| panic!("{}", self.start_log))
    }

    /// Sends SIGTERM, waits for a successful end and returns the rest of the log.
    fn terminate(self) -> Vec<String> {
        self.end_by("TERM")
    }

    /// Sends a signal to the process.
    fn send(&self, signal: &str) {
        let process = self.child.id().to_string();
        let sent = Command::new("kill").args(["-s", signal, &process]).status();
        assert!(sent.expect("there is kill").success());
    }

    /// Sends a signal, waits for a successful end and returns the rest of the log.
    fn end_by(mut self, signal: &str) -> Vec<String> {
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
    fn end_without_log_by(mut self, signal: &str) {
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

/// An address where nothing listens: its port was free a moment ago.
fn free_address() -> String {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).expect("there is a free port");
    listener.local_addr().expect("it is bound").to_string()
}

#[test]
fn health_check_passes_while_the_server_runs() {
    // All addresses, to which no client can connect: the check must choose one.
    let listen = free_address().replace("127.0.0.1", "0.0.0.0");
    let check = || output("grasp-server --health-check", &[("GRASP_LISTEN", &listen)]);
    assert_eq!(check().code, 1);
    let server = Running::start(&[("GRASP_LISTEN", &listen)]);
    let healthy = check();
    assert_eq!((healthy.code, healthy.text.as_str()), (0, ""));
    server.terminate();
    let dead = check();
    assert_eq!(dead.code, 1);
    assert_eq!(dead.text.lines().count(), 1, "{}", dead.text);
    let expected = "error: cannot connect to 127.0.0.1:";
    assert!(dead.text.starts_with(expected), "{}", dead.text);
}

/// A command that has no setting of the store, but a home.
const DEFAULT_STORE: &str = "unset GRASP_STORE; exec grasp-server";

#[test]
fn failures_are_reported_with_their_reason() {
    // The kernel accepts connections; nothing reads them.
    let silent = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).expect("there is a free port");
    let silent = silent.local_addr().expect("it is bound").to_string();
    let check = "grasp-server --health-check";
    for (command, variables, reasons) in [
        (
            check,
            &[("GRASP_LISTEN", silent.as_str())][..],
            &["did not answer within 900 ms"][..],
        ),
        (check, &[("GRASP_LISTEN", "here")], &["listen is \"here\""]),
        (
            "grasp-server --workers 0",
            &[("GRASP_LOG_FORMAT", "xml"), ("GRASP_OBJECTS_DIRECTORY", "")],
            &[
                "workers is 0",
                "log_format is \"xml\"",
                "objects_directory is \"\"",
            ],
        ),
        (
            DEFAULT_STORE,
            // Not even root can make a folder there.
            &[("HOME", "/proc"), ("GRASP_LISTEN", "127.0.0.1:0")],
            &[
                "error: store is /proc/.local/share/grasp; ",
                "or memory, with which",
            ],
        ),
        (
            "grasp-server --listen 127.0.0.1:0",
            &[
                ("GRASP_LOG_FORMAT", "json"),
                ("GRASP_OBJECTS_DIRECTORY", "/nowhere/at/all"),
            ],
            &["\"error\":\"objects_directory is /nowhere/at/all; "],
        ),
    ] {
        let result = output(command, variables);
        assert_eq!(result.code, 1);
        for reason in reasons {
            assert!(result.text.contains(reason), "{reason} in {}", result.text);
        }
    }
}

#[test]
fn every_signal_to_end_drains_even_when_nobody_reads_the_log() {
    for signal in ["TERM", "INT", "QUIT", "HUP"] {
        let log = Running::start(&[("GRASP_LISTEN", "127.0.0.1:0")]).end_by(signal);
        for part in ["draining", "stopped"] {
            assert!(log.iter().any(|line| line.contains(part)), "{signal}: {log:?}");
        }
    }
    Running::start(&[("GRASP_LISTEN", "127.0.0.1:0")]).end_without_log_by("HUP");
}

#[test]
fn objects_are_saved_in_the_users_folder_by_default() {
    let home = std::env::temp_dir().join(format!("grasp-home-{}", std::process::id()));
    let path = home.to_str().expect("the path is text");
    let server = Running::start_command(DEFAULT_STORE, &[("HOME", path), ("GRASP_LISTEN", "127.0.0.1:0")]);
    let log = server.start_log.clone() + &server.terminate().join("\n");
    let folder = home.join(".local/share/grasp");
    assert!(folder.join("objects").is_dir(), "{log}");
    let place = format!("store={}", folder.display());
    assert!(log.contains(&place), "{place} in {log}");
    fs::remove_dir_all(&home).expect("it is there");
}

#[test]
fn serves_with_a_warning_if_its_limits_exceed_the_memory_of_the_process() {
    // 1 GiB of address space, less than the cache alone.
    let command = "ulimit -v 1048576 && exec grasp-server --listen 127.0.0.1:0 --cache-bytes 2147483648";
    let server = Running::start_command(command, &[("GRASP_WORKERS", "2"), ("GRASP_IO_THREADS", "2")]);
    let line = server.line_with("the configured limits add up to");
    for part in ["WARN", "limit=1073741824", "RLIMIT_AS", "lower cache_bytes"] {
        assert!(line.contains(part), "{part} in {line}");
    }
    server.terminate();
}
