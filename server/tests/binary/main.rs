//! The binary: exit codes, messages, signals, health checks, kills, and limits on memory and files.
#![cfg(target_os = "linux")]

mod bombs;
mod forged;
mod growth;
mod kills;
mod log;
mod stress;

use std::{
    fs,
    io::{BufRead, BufReader},
    net::{Ipv4Addr, TcpListener},
    os::unix::fs::PermissionsExt as _,
    path::{Path, PathBuf},
    process::{Child, ChildStderr, Command, Stdio},
};

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

/// Runs a command to its end: its exit code and standard error.
fn output(line: &str, variables: &[(&str, &str)]) -> (i32, String) {
    let output = command(line, variables).output().expect("there is a shell");
    let code = output.status.code().expect("no signal ended it");
    let text = String::from_utf8(output.stderr).expect("the server writes text");
    (code, text)
}

/// A running server, killed when it is dropped.
struct Running {
    child: Child,
    /// `None` once it is closed.
    log: Option<BufReader<ChildStderr>>,
    /// The log up to the line with the address.
    start_log: String,
    address: String,
}

impl Running {
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
            // In JSON or as text.
            let line = start_log[start..]
                .replace("\"address\":\"", "address=")
                .replace('"', " ");
            if let Some((_, rest)) = line.split_once("address=") {
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

    fn terminate(self) -> Vec<String> {
        self.end_by("TERM")
    }

    fn signal(&self, signal: &str) {
        let process = self.child.id().to_string();
        let sent = Command::new("kill").args(["-s", signal, &process]).status();
        assert!(sent.expect("there is kill").success());
    }

    /// Reads the log up to a line with this part.
    fn read_until(&mut self, part: &str) {
        let log = self.log.as_mut().expect("it is open");
        let mut read = String::new();
        while !read.lines().last().is_some_and(|line| line.contains(part)) {
            let bytes = log.read_line(&mut read).expect("the server writes text");
            assert!(bytes > 0, "no {part} in {read}");
        }
    }

    /// Sends a signal, waits for a successful end and returns the rest of the log.
    fn end_by(mut self, signal: &str) -> Vec<String> {
        self.signal(signal);
        let log = self.log.take().into_iter().flat_map(BufRead::lines);
        let log: Vec<String> = log.map(|line| line.expect("the server writes text")).collect();
        let status = self.child.wait().expect("it is a child");
        assert!(status.success(), "{status}: {log:?}");
        log
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // It has already ended unless the test failed.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A test's own folder, removed at the end.
struct Folder(PathBuf);

impl Folder {
    fn new(test: &str) -> Self {
        let folder = Self::absent(test);
        fs::create_dir_all(&folder.0).expect("it can be created");
        folder
    }

    fn absent(test: &str) -> Self {
        Self(std::env::temp_dir().join(format!("grasp-{test}-{}", std::process::id())))
    }

    fn path(&self) -> &str {
        self.0.to_str().expect("the path is text")
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
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
    let variables = [
        ("GRASP_LISTEN", listen.as_str()),
        ("GRASP_INSECURE_PUBLIC", "true"),
    ];
    let check = || output("grasp-server --health-check", &variables);
    assert_eq!(check().0, 1);
    let server = Running::start(&variables);
    assert_eq!(check(), (0, String::new()));
    server.terminate();
    let (code, text) = check();
    assert_eq!((code, text.lines().count()), (1, 1), "{text}");
    assert!(text.starts_with("error: cannot connect to 127.0.0.1:"), "{text}");
}

#[test]
fn serves_on_several_addresses_and_a_socket_and_is_healthy_at_the_first_that_answers() {
    let socket = std::env::temp_dir().join(format!("grasp-binary-{}.sock", std::process::id()));
    let unix = format!("unix:{}", socket.display());
    let listen = format!("127.0.0.1:0,{unix}");
    let mut server = Running::start(&[("GRASP_LISTEN", &listen)]);
    let mut line = String::new();
    let log = server.log.as_mut().expect("it is open");
    log.read_line(&mut line).expect("the server writes text");
    assert!(line.contains(&format!("address={unix}")), "{line}");
    let tcp = server.address.clone();
    let nobody = free_address();
    for listen in [
        &unix,
        &tcp,
        &format!("{nobody},{unix}"),
        &format!("{unix},{nobody}"),
    ] {
        let check = output("grasp-server --health-check", &[("GRASP_LISTEN", listen)]);
        assert_eq!(check, (0, String::new()), "{listen}");
    }
    let second = output("grasp-server", &[("GRASP_LISTEN", &unix)]);
    assert_eq!(second.0, 1);
    assert!(second.1.contains("another server listens there"), "{}", second.1);
    server.terminate();
    assert!(!socket.exists());
}

#[test]
fn prints_the_descriptor_set_but_not_to_a_terminal() {
    let mut command = command("grasp-server --descriptor-set", &[]);
    let output = command.output().expect("there is a shell");
    assert!(output.status.success());
    assert_eq!(output.stdout, grasp_proto::FILE_DESCRIPTOR_SET);
}

/// A command without a setting of the store, but with a home.
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
            "grasp-server --listen 0.0.0.0:0",
            &[],
            &[
                "listen is 0.0.0.0:0, which other machines may reach, without TLS; ",
                "insecure_public",
            ],
        ),
        (
            "grasp-server --listen 127.0.0.1:0",
            &[
                ("GRASP_TLS_CERTIFICATE", "/nowhere.pem"),
                ("GRASP_TLS_KEY", "/nowhere.key"),
                ("GRASP_TOKENS_FILE", "/nowhere.toml"),
            ],
            &[
                "tls_certificate is /nowhere.pem; ",
                "tls_key is /nowhere.key; ",
                "tokens_file is /nowhere.toml; ",
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
        let (code, text) = output(command, variables);
        assert_eq!(code, 1);
        for reason in reasons {
            assert!(text.contains(reason), "{reason} in {text}");
        }
    }
}

#[test]
fn every_signal_to_end_drains_even_when_nobody_reads_the_log() {
    for signal in ["TERM", "INT", "QUIT"] {
        let log = Running::start(&[("GRASP_LISTEN", "127.0.0.1:0")]).end_by(signal);
        for part in ["draining", "stopped"] {
            assert!(log.iter().any(|line| line.contains(part)), "{signal}: {log:?}");
        }
    }
    let mut server = Running::start(&[("GRASP_LISTEN", "127.0.0.1:0")]);
    // As with a closed terminal.
    server.log = None;
    server.end_by("QUIT");
}

#[test]
fn a_second_signal_ends_the_server_at_once() {
    let variables = [
        ("GRASP_LISTEN", "127.0.0.1:0"),
        ("GRASP_DRAIN_DELAY_MS", "600000"),
    ];
    let mut server = Running::start(&variables);
    server.signal("TERM");
    server.read_until("draining");
    server.signal("INT");
    let status = server.child.wait().expect("it is a child");
    assert_eq!(status.code(), Some(1));
}

#[test]
fn without_a_terminal_sighup_reads_the_configuration_again() {
    let folder = Folder::new("sighup");
    let [config, tokens] = ["grasp.toml", "tokens.toml"].map(|name| folder.0.join(name));
    let (_, entry) = grasp_server::new_token("studio").expect("it is a name");
    fs::write(&tokens, entry).expect("it can be written");
    let write = |more: &str| {
        let text = format!(
            "listen = '127.0.0.1:0'\ntokens_file = '{}'\n{more}",
            tokens.display()
        );
        fs::write(&config, text).expect("it can be written");
    };
    write("");
    let mut server = Running::start(&[("GRASP_CONFIG", config.to_str().expect("it is text"))]);
    write("log = 'debug'\nworkers = 3");
    server.signal("HUP");
    for part in [
        "applied a change of the configuration log=\"debug\"",
        "a change of the configuration needs a restart key=\"workers\"",
        "read the tokens again",
    ] {
        server.read_until(part);
    }
    fs::write(&config, "nothing").expect("it can be written");
    fs::write(&tokens, "nothing").expect("it can be written");
    server.signal("HUP");
    server.read_until("the configuration stays as it was");
    server.read_until("the tokens stay as they were");
    server.terminate();
}

#[test]
fn health_checks_pass_under_tls_and_without_tokens() {
    let folder = Folder::new("health");
    let issued =
        rcgen::generate_simple_self_signed(["grasp.example".to_owned()]).expect("there is randomness");
    let (secret, entry) = grasp_server::new_token("studio").expect("it is a name");
    assert!(!entry.contains(&secret));
    let file = |name: &str, content: String| {
        let path = folder.0.join(name);
        fs::write(&path, content).expect("it can be written");
        path.display().to_string()
    };
    let listen = free_address().replace("127.0.0.1", "0.0.0.0");
    let variables = [
        ("GRASP_LISTEN", listen),
        ("GRASP_TLS_CERTIFICATE", file("server.pem", issued.cert.pem())),
        (
            "GRASP_TLS_KEY",
            file("server.key", issued.signing_key.serialize_pem()),
        ),
        ("GRASP_TOKENS_FILE", file("tokens.toml", entry)),
    ];
    let variables = variables.each_ref().map(|(name, value)| (*name, value.as_str()));
    let server = Running::start(&variables);
    let check = output("grasp-server --health-check", &variables);
    assert_eq!(check, (0, String::new()));
    server.terminate();
}

#[test]
fn a_new_token_s_secret_is_apart_from_its_entry() {
    let folder = Folder::new("token");
    let line = format!(
        "grasp-server --new-token studio > {}/tokens.toml",
        folder.0.display()
    );
    let (code, secret) = output(&line, &[]);
    let entry = fs::read_to_string(folder.0.join("tokens.toml")).expect("it was written");
    assert_eq!((code, secret.lines().count()), (0, 1), "{secret}");
    assert!(
        secret.starts_with("grasp_") && !entry.contains(secret.trim()),
        "{entry}"
    );
    assert!(entry.starts_with("[studio]\nsha256 = [\""), "{entry}");
}

/// Files and folders under a path that others than their user may use.
fn open_to_others(path: &Path) -> Vec<String> {
    // Unfinished files may be gone by now.
    let Ok(about) = fs::symlink_metadata(path) else {
        return Vec::new();
    };
    let mode = about.permissions().mode() & 0o777;
    let is_open = mode & 0o077 != 0;
    let own = is_open.then(|| format!("{mode:o} {}", path.display()));
    let entries = fs::read_dir(path).into_iter().flatten().flatten();
    let inner = entries.flat_map(|entry| open_to_others(&entry.path()));
    own.into_iter().chain(inner).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn objects_are_saved_in_the_users_folder_by_default_and_private_at_every_moment() {
    let home = Folder::absent("home");
    let line = format!("umask 0; {DEFAULT_STORE}");
    let server = Running::start_command(&line, &[("HOME", home.path()), ("GRASP_LISTEN", "127.0.0.1:0")]);
    let folder = home.0.join(".local/share/grasp");
    let mut client = stress::client(&server).await;
    let creating = tokio::spawn(async move {
        for number in 0..20 {
            let request = stress::hills(&format!("o{number}"), 2);
            client.create_object(request).await.expect("it is an object");
        }
    });
    let mut looks = 0;
    while !creating.is_finished() {
        assert_eq!(open_to_others(&folder), [""; 0]);
        looks += 1;
    }
    creating.await.expect("it did not panic");
    let log = server.start_log.clone() + &server.terminate().join("\n");
    println!("looked {looks} times, with an umask of 0");
    assert!(folder.join("objects/o19").is_file(), "{log}");
    let place = format!("store={}", folder.display());
    assert!(log.contains(&place), "{place} in {log}");
}

#[test]
fn a_second_server_on_a_folder_is_told_who_uses_it() {
    let folder = Folder::absent("owned");
    let store = [("GRASP_STORE", folder.path()), ("GRASP_LISTEN", "127.0.0.1:0")];
    let server = Running::start(&store);
    let (code, text) = output("grasp-server", &store);
    assert_eq!(code, 1);
    let owner = format!("another server uses it (process {} on host ", server.child.id());
    assert!(text.contains(&owner), "{text}");
    // That of a killed one is free.
    drop(server);
    Running::start(&store).terminate();
}

#[test]
fn serves_with_a_warning_if_its_limits_exceed_the_memory_of_the_process() {
    // 1 GiB of address space, less than the cache alone.
    let command = "ulimit -v 1048576 && exec grasp-server --listen 127.0.0.1:0 --cache-bytes 2147483648";
    let server = Running::start_command(command, &[("GRASP_WORKERS", "2"), ("GRASP_IO_THREADS", "2")]);
    let mut lines = server.start_log.lines();
    let line = lines.find(|line| line.contains("the configured limits add up to"));
    let line = line.unwrap_or_else(|| panic!("{}", server.start_log));
    for part in ["WARN", "limit=1073741824", "RLIMIT_AS", "lower cache_bytes"] {
        assert!(line.contains(part), "{part} in {line}");
    }
    server.terminate();
}
