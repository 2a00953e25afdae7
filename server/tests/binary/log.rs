//! What the log has of calls, and what it has not.

use std::{
    io::{BufRead as _, Read as _, Write as _},
    net::TcpStream,
};

use super::Running;

/// What no line may have: the values of headers that prove who calls.
const SECRETS: [&str; 3] = ["s3cret-token", "s3cret-cookie", "s3cret-query"];

/// Calls by Connect's JSON over HTTP/1.1, with secrets in the headers; the answer.
fn call(address: &str, path: &str, id: &[u8], body: &str) -> String {
    let mut stream = TcpStream::connect(address).expect("the server listens");
    let length = body.len();
    let head = format!(
        "POST {path}?key=s3cret-query HTTP/1.1\r\nhost: test\r\ncontent-type: application/json\r\ncontent-length: {length}\r\n\
         authorization: Bearer s3cret-token\r\ncookie: session=s3cret-cookie\r\nuser-agent: a\\n\"b\" level=ERROR\r\n\
         connection: close\r\nx-request-id: "
    );
    stream
        .write_all(&[head.as_bytes(), id, b"\r\n\r\n", body.as_bytes()].concat())
        .expect("it reads");
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).expect("it answers");
    String::from_utf8_lossy(&answer).into_owned()
}

#[test]
fn hostile_calls_neither_forge_lines_nor_leak_secrets_at_any_level() {
    for (level, format) in [("info", "text"), ("trace", "text"), ("trace", "json")] {
        let variables = [
            ("GRASP_LISTEN", "127.0.0.1:0"),
            ("GRASP_LOG", level),
            ("GRASP_LOG_FORMAT", format),
        ];
        let mut server = Running::start(&variables);
        // The log is longer than a pipe holds.
        let log = server.log.take().expect("it is open");
        let reading = std::thread::spawn(move || {
            log.lines()
                .map(|line| line.expect("it is text"))
                .collect::<Vec<_>>()
        });
        let find = "/grasp.v1.GraspService/FindGrasp";
        let forged = "objects/a\\nFORGED ERROR \\u001b[2J\\u0085";
        let wrong = format!("{{\"holdout\": {{\"object\": \"{forged}\"}}}}");
        let right = "{\"holdout\": {\"object\": \"objects/scissors\"}}";
        for (path, id, body) in [
            (find, &b"sound-id"[..], right),
            (find, b"quoted\"id\\n", right),
            (find, b"no id \x1b[2J\x85", &wrong),
            (find, b"x", "{\"\\nFORGED\": 1}"),
            ("/grasp.v1.GraspService/Strange%0AFORGED", b"y", right),
            ("/%1b[2J/FORGED", b"z", "{}"),
        ] {
            let answer = call(&server.address, path, id, body);
            assert!(answer.starts_with("HTTP/1.1 "), "{answer:?}");
        }
        server.signal("TERM");
        let lines = reading.join().expect("it reads");
        assert!(server.child.wait().expect("it is a child").success());
        for line in &lines {
            assert!(!line.contains(char::is_control), "{line:?}");
            assert!(
                SECRETS.iter().all(|secret| !line.contains(secret)),
                "{level}: {line}"
            );
            if format == "json" {
                assert!(serde_json::from_str::<serde_json::Value>(line).is_ok(), "{line}");
            } else {
                // Every event begins with its time.
                assert!(line.starts_with("20") && line.contains('Z'), "{line}");
            }
        }
        let calls: Vec<_> = lines
            .iter()
            .filter(|line| line.contains("sound-id") && line.contains("status"))
            .collect();
        assert!(calls.len() == 1 && calls[0].contains("127.0.0.1"), "{calls:?}");
        println!("{level} {format}: {} lines", lines.len());
    }
}
