//! The binary as a platform runs it: exit codes, messages, signals, health checks.
#![cfg(target_os = "linux")]

mod process;

use std::{
    fs,
    io::Write as _,
    net::{Ipv4Addr, TcpListener},
};

use process::{Running, output};

/// An address where nobody listens: a port that was free a moment ago.
fn free_address() -> String {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).expect("there is a free port");
    listener.local_addr().expect("it is bound").to_string()
}

#[test]
fn a_server_is_healthy_from_its_start_to_its_end() {
    // On all addresses, which cannot be connected to: the check has to know which one to take.
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
fn the_health_check_reads_the_same_configuration() {
    let server = Running::start(&[("GRASP_LISTEN", "127.0.0.1:0")]);
    let folder = std::env::temp_dir().join(format!("grasp-health-{}", std::process::id()));
    let mut file = fs::File::create(&folder).expect("the temporary directory can be written to");
    writeln!(file, "listen = {:?}", server.address()).expect("a file can be written");
    let path = folder.to_str().expect("the path is text");
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
    fs::remove_file(&folder).expect("the file is still there");
}

#[test]
fn one_that_accepts_but_does_not_answer_is_not_healthy() {
    // The kernel accepts; nobody reads.
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
fn every_bad_setting_is_named() {
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
fn the_log_says_in_json_why_there_is_no_server() {
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
    let error = lines.last().expect("it says something")["error"]
        .as_str()
        .expect("a text");
    assert!(
        error.starts_with("objects_directory is /nowhere/at/all; "),
        "{error}"
    );
}

#[test]
fn too_little_memory_is_told_with_what_to_lower() {
    // 1 GiB of address space; the cache alone may take more.
    let command = "ulimit -v 1048576 && exec grasp-server --listen 127.0.0.1:0 --cache-bytes 2147483648";
    let result = output(command, &[]);
    assert_eq!(result.code, 1);
    for part in [
        "too little memory: the limit is 1024 MiB (RLIMIT_AS)",
        "2048 MiB for created objects and atlases (cache_bytes is 2147483648)",
    ] {
        assert!(result.text.contains(part), "{part} in {}", result.text);
    }
}

#[test]
fn a_configuration_that_fits_the_memory_serves_in_it() {
    let settings = [
        ("GRASP_LISTEN", "127.0.0.1:0"),
        ("GRASP_CACHE_BYTES", "67108864"),
        ("GRASP_MAXIMUM_UPLOADS", "1"),
        ("GRASP_MAXIMUM_SEARCHES", "8"),
        ("GRASP_WORKERS", "2"),
        ("GRASP_IO_THREADS", "2"),
    ];
    let server = Running::start_command("ulimit -v 409600 && exec grasp-server", &settings);
    let check = output(
        "grasp-server --health-check",
        &[("GRASP_LISTEN", server.address())],
    );
    assert_eq!(check.code, 0, "{}", check.text);
    server.terminate();
}
