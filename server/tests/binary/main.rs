//! The binary: exit codes, messages, signals, health checks.
#![cfg(target_os = "linux")]

mod process;
mod saved;
mod unread;

use std::{
    fs,
    io::Write as _,
    net::{Ipv4Addr, TcpListener},
};

use process::{Running, output};

/// An address where nothing listens: its port was free a moment ago.
fn free_address() -> String {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).expect("there is a free port");
    listener.local_addr().expect("it is bound").to_string()
}

#[test]
fn health_check_passes_while_the_server_runs() {
    // All addresses, to which no client can connect: the check must choose one.
    let port = free_address()
        .rsplit_once(':')
        .expect("it has a port")
        .1
        .to_owned();
    let listen = format!("0.0.0.0:{port}");
    let check = || output("grasp-server --health-check", &[("GRASP_LISTEN", &listen)]);
    assert_eq!(check().code, 1);
    let server = Running::start(&[("GRASP_LISTEN", &listen)]);
    let healthy = check();
    assert_eq!((healthy.code, healthy.text.as_str()), (0, ""));
    let log = server.terminate();
    assert!(log.iter().any(|line| line.contains("stopped")), "{log:?}");
    let dead = check();
    assert_eq!(dead.code, 1);
    assert_eq!(dead.text.lines().count(), 1, "{}", dead.text);
    assert!(
        dead.text
            .starts_with(&format!("error: cannot connect to 127.0.0.1:{port}: ")),
        "{}",
        dead.text
    );
}

#[test]
fn health_check_reads_the_configuration_of_the_server() {
    let server = Running::start(&[("GRASP_LISTEN", "127.0.0.1:0")]);
    let file_path = std::env::temp_dir().join(format!("grasp-health-{}", std::process::id()));
    let mut file = fs::File::create(&file_path).expect("the temporary directory can be written to");
    writeln!(file, "listen = {:?}", server.address()).expect("a file can be written");
    let path = file_path.to_str().expect("the path is text");
    assert_eq!(
        output("grasp-server --health-check", &[("GRASP_CONFIG", path)]).code,
        0
    );
    let flags = format!("grasp-server --health-check --listen {}", server.address());
    assert_eq!(output(&flags, &[("GRASP_LISTEN", &free_address())]).code, 0);
    let wrong = output("grasp-server --health-check", &[("GRASP_LISTEN", "here")]);
    assert_eq!(wrong.code, 1);
    assert!(wrong.text.contains("listen is \"here\""), "{}", wrong.text);
    server.terminate();
    fs::remove_file(&file_path).expect("the file is still there");
}

#[test]
fn health_check_fails_without_an_answer() {
    // The kernel accepts connections; nothing reads them.
    let silent = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).expect("there is a free port");
    let address = silent.local_addr().expect("it is bound").to_string();
    let result = output("grasp-server --health-check", &[("GRASP_LISTEN", &address)]);
    assert_eq!(result.code, 1);
    assert!(
        result.text.contains("did not answer within 900 ms"),
        "{}",
        result.text
    );
}

#[test]
fn start_removes_unfinished_atlas_files() {
    let folder = std::env::temp_dir().join(format!("grasp-unfinished-{}", std::process::id()));
    let unfinished = folder.join(format!("{}.1-0.part", "0f".repeat(16)));
    let foreign = folder.join("download.part");
    fs::create_dir_all(&folder).expect("the temporary directory can be written to");
    for path in [&unfinished, &foreign] {
        fs::write(path, "unfinished").expect("a file can be written");
    }
    let path = folder.to_str().expect("the path is text");
    let server = Running::start(&[("GRASP_LISTEN", "127.0.0.1:0"), ("GRASP_ATLAS_DIRECTORY", path)]);
    assert!(!unfinished.exists() && foreign.exists());
    let log = server.start_log();
    let line = log
        .lines()
        .find(|line| line.contains("removed unfinished atlas files"));
    let line = line.unwrap_or_else(|| panic!("{log}"));
    assert!(line.contains("files=1") && line.contains("bytes=10"), "{line}");
    server.terminate();
    fs::remove_dir_all(&folder).expect("it is still there");
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

/// A command that has no setting of the store, but a home.
const DEFAULT_STORE: &str = "unset GRASP_STORE; exec grasp-server";

#[test]
fn objects_are_saved_in_the_users_folder_by_default() {
    let home = std::env::temp_dir().join(format!("grasp-home-{}", std::process::id()));
    let path = home.to_str().expect("the path is text");
    let server = Running::start_command(DEFAULT_STORE, &[("HOME", path), ("GRASP_LISTEN", "127.0.0.1:0")]);
    let log = server.start_log().to_owned() + &server.terminate().join("\n");
    let folder = home.join(".local/share/grasp");
    for part in ["objects", "meshes", "atlases"] {
        assert!(folder.join(part).is_dir(), "{part}: {log}");
    }
    let place = format!("store={}", folder.display());
    assert!(log.contains(&place), "{place} in {log}");
    fs::remove_dir_all(&home).expect("it is there");
}

#[test]
fn a_folder_that_cannot_be_written_is_reported_with_the_setting() {
    // Not even root can make a folder there.
    let variables = [("HOME", "/proc"), ("GRASP_LISTEN", "127.0.0.1:0")];
    let result = output(DEFAULT_STORE, &variables);
    assert_eq!(result.code, 1);
    for part in [
        "error: store is /proc/.local/share/grasp; ",
        "or memory, with which",
    ] {
        assert!(result.text.contains(part), "{part} in {}", result.text);
    }
}

#[test]
fn reports_every_invalid_setting() {
    let result = output(
        "grasp-server --workers 0",
        &[("GRASP_LOG_FORMAT", "xml"), ("GRASP_OBJECTS_DIRECTORY", "")],
    );
    assert_eq!(result.code, 1);
    for key in [
        "workers is 0",
        "log_format is \"xml\"",
        "objects_directory is \"\"",
    ] {
        assert!(result.text.contains(key), "{key} in {}", result.text);
    }
}

#[test]
fn json_log_contains_the_reason_of_a_failed_start() {
    let settings = [
        ("GRASP_LOG_FORMAT", "json"),
        ("GRASP_OBJECTS_DIRECTORY", "/nowhere/at/all"),
    ];
    let result = output("grasp-server --listen 127.0.0.1:0", &settings);
    assert_eq!(result.code, 1);
    let lines: Vec<serde_json::Value> = result
        .text
        .lines()
        .map(|line| serde_json::from_str(line).expect("every line is JSON"))
        .collect();
    let error = lines.last().expect("the log is not empty")["error"]
        .as_str()
        .expect("a text");
    assert!(
        error.starts_with("objects_directory is /nowhere/at/all; "),
        "{error}"
    );
}

#[test]
fn serves_with_a_warning_if_its_limits_exceed_the_memory_of_the_process() {
    // 1 GiB of address space, less than the cache alone.
    let command = "ulimit -v 1048576 && exec grasp-server --listen 127.0.0.1:0 --cache-bytes 2147483648";
    let server = Running::start_command(command, &[("GRASP_WORKERS", "2"), ("GRASP_IO_THREADS", "2")]);
    let log = server.start_log().to_owned();
    let line = log
        .lines()
        .find(|line| line.contains("the configured limits add up to"));
    let line = line.unwrap_or_else(|| panic!("{log}"));
    for part in ["WARN", "limit=1073741824", "RLIMIT_AS", "lower cache_bytes"] {
        assert!(line.contains(part), "{part} in {line}");
    }
    server.terminate();
}
