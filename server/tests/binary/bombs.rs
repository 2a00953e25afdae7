//! Messages that are small on the wire and large in memory, many at a time, and a process without files: each is refused within a
//! bound on memory, and others are served.

use std::{
    fs,
    io::{Read as _, Write as _},
    net::TcpStream,
    thread,
    time::{Duration, Instant},
};

use flate2::{Compression, write::GzEncoder};

use crate::Running;

const MIB: usize = 1 << 20;

/// Memory that a bomb may take at its peak, beyond that of an idle server: that of some of the largest messages.
const MAX_GROWTH: usize = 96 * MIB;

/// Uploads at once.
const UPLOADS: usize = 200;

const CREATE_OBJECT: &str = "ObjectService/CreateObject";
const FIND_GRASP: &str = "GraspService/FindGrasp";

/// A message that is refused.
struct Bomb {
    name: &'static str,
    method: &'static str,
    /// Headers besides the usual ones, each with its end of line.
    headers: &'static str,
    body: Vec<u8>,
}

fn bombs() -> Vec<Bomb> {
    let json = "content-type: application/json\r\n";
    let proto = "content-type: application/proto\r\n";
    let bomb = |name, method, headers, body| Bomb {
        name,
        method,
        headers,
        body,
    };
    let list = |start: &str, item: &str, bytes: usize| {
        let items = vec![item; bytes / (item.len() + 1)].join(",");
        format!("{start}{items}").into_bytes()
    };
    // An object of empty known grips, the contract's largest message, and a rig of empty models.
    let grips = within(1, &b"\x42\0".repeat(4 * MIB));
    let models = b"\x12\0".repeat(4 * MIB);
    let hands = within(1, &b"\x22\0".repeat(75_000));
    vec![
        bomb("empty grips", CREATE_OBJECT, proto, grips),
        bomb("empty models", "HandRigService/CreateRig", proto, models),
        bomb("empty hands", FIND_GRASP, proto, hands),
        bomb(
            "empty regions in JSON",
            CREATE_OBJECT,
            json,
            list(r#"{"object": {"regions": ["#, "{}", 15 * MIB),
        ),
        bomb(
            "fewer empty regions in JSON",
            CREATE_OBJECT,
            json,
            [&list(r#"{"object": {"regions": ["#, "{}", 780_000), &b"]}}"[..]].concat(),
        ),
        bomb(
            "numbers in JSON",
            CREATE_OBJECT,
            json,
            list(r#"{"object": {"regions": [{"triangles": ["#, "0", 15 * MIB),
        ),
        bomb(
            "labels in JSON",
            CREATE_OBJECT,
            json,
            list(r#"{"object": {"labels": {"a": "b","#, r#""a":"""#, 15 * MIB),
        ),
        bomb("nested JSON", CREATE_OBJECT, json, b"[".repeat(15 * MIB)),
        bomb(
            "zeros in gzip",
            CREATE_OBJECT,
            "content-type: application/proto\r\ncontent-encoding: gzip\r\n",
            packed_zeros(64 * MIB),
        ),
        bomb(
            "zeros in gzip as JSON",
            FIND_GRASP,
            "content-type: application/json\r\ncontent-encoding: gzip\r\n",
            packed_zeros(64 * MIB),
        ),
    ]
}

/// Bytes as a field of a message.
fn within(field: u8, content: &[u8]) -> Vec<u8> {
    let mut message = vec![field << 3 | 2];
    prost::encoding::encode_varint(content.len() as u64, &mut message);
    message.extend(content);
    message
}

fn packed_zeros(bytes: usize) -> Vec<u8> {
    let mut packer = GzEncoder::new(Vec::new(), Compression::best());
    packer.write_all(&vec![0; bytes]).expect("memory is written");
    packer.finish().expect("memory is written")
}

/// Sends a request over HTTP/1; the status of the answer, 0 if the connection is closed without one.
fn post(address: &str, method: &str, headers: &str, body: &[u8]) -> u16 {
    let mut stream = TcpStream::connect(address).expect("it listens");
    let head = format!(
        "POST /grasp.v1.{method} HTTP/1.1\r\nhost: x\r\nconnection: close\r\ncontent-length: {}\r\n{headers}\r\n",
        body.len()
    );
    // It may answer before it has read all.
    let _ = stream
        .write_all(head.as_bytes())
        .and_then(|()| stream.write_all(body));
    let mut answer = Vec::new();
    let _ = stream.read_to_end(&mut answer);
    let line = String::from_utf8_lossy(&answer[..answer.len().min(12)]).into_owned();
    line.split(' ')
        .nth(1)
        .and_then(|status| status.parse().ok())
        .unwrap_or(0)
}

/// The status of a small request.
fn list(address: &str) -> u16 {
    let json = "content-type: application/json\r\n";
    post(address, "ObjectService/ListObjects", json, b"{}")
}

impl Running {
    /// A value of the process' status, in bytes.
    fn memory(&self, key: &str) -> usize {
        let status = fs::read_to_string(format!("/proc/{}/status", self.child.id())).expect("it runs");
        let value = status
            .lines()
            .find_map(|line| line.strip_prefix(key)?.trim().strip_suffix(" kB"));
        value
            .expect("it has the value")
            .trim()
            .parse::<usize>()
            .expect("it is a number")
            << 10
    }

    /// The largest memory in use while something happens, beyond that in use before.
    fn growth(&self, happens: impl FnOnce()) -> usize {
        let process = self.child.id();
        // Sets the peak to what is in use now.
        fs::write(format!("/proc/{process}/clear_refs"), "5").expect("it runs");
        let before = self.memory("VmRSS:");
        happens();
        self.memory("VmHWM:").saturating_sub(before)
    }

    /// Processor time that it has used.
    fn processor_time(&self) -> Duration {
        const TICK: Duration = Duration::from_millis(10);
        let stat = fs::read_to_string(format!("/proc/{}/stat", self.child.id())).expect("it runs");
        let (_, fields) = stat.rsplit_once(") ").expect("the name ends");
        let ticks = fields
            .split(' ')
            .skip(11)
            .take(2)
            .map(|field| field.parse::<u32>().expect("a number"));
        TICK * ticks.sum::<u32>()
    }

    /// Sets its limit on open files.
    fn limit_files(&self, files: u64) {
        use rustix::process::{Pid, Resource, Rlimit, getrlimit, prlimit};
        let process = Pid::from_child(&self.child);
        let limit = Rlimit {
            current: Some(files),
            ..getrlimit(Resource::Nofile)
        };
        prlimit(Some(process), Resource::Nofile, limit).expect("it is a child");
    }
}

fn start(variables: &[(&str, &str)]) -> Running {
    let usual = [("GRASP_LISTEN", "127.0.0.1:0"), ("GRASP_BUILDER_THREADS", "0")];
    Running::start(&[&usual, variables].concat())
}

#[test]
fn messages_that_are_large_in_memory_are_refused_within_a_bound_on_it() {
    let server = start(&[]);
    assert_eq!(list(&server.address), 200);
    for bomb in bombs() {
        let mut status = 0;
        let start = Instant::now();
        let growth = server.growth(|| {
            status = post(&server.address, bomb.method, bomb.headers, &bomb.body);
        });
        let (sent, grown) = (bomb.body.len() as f64 / MIB as f64, growth / MIB);
        println!(
            "{}: {sent:.2} MiB sent, answered with {status} after {:?}; the server grew by {grown} MiB",
            bomb.name,
            start.elapsed()
        );
        assert_eq!(status, 400, "{}", bomb.name);
        assert!(growth < MAX_GROWTH, "{}: {grown} MiB", bomb.name);
        assert_eq!(list(&server.address), 200);
    }
    let huge = format!("x-large: {}\r\n", "a".repeat(MIB));
    let status = post(&server.address, FIND_GRASP, &huge, b"");
    assert!([0, 431].contains(&status), "{status}");
    server.terminate();
}

#[test]
fn two_hundred_uploads_at_once_stay_within_the_memory_of_some() {
    let server = start(&[]);
    let mesh = within(2, &b"v 0.1 0.2 0.3\n".repeat(8 * MIB / 14));
    let json = "content-type: application/proto\r\n";
    let mut statuses = Vec::new();
    let growth = server.growth(|| {
        thread::scope(|scope| {
            let uploads: Vec<_> = (0..UPLOADS)
                .map(|_| scope.spawn(|| post(&server.address, CREATE_OBJECT, json, &mesh)))
                .collect();
            let start = Instant::now();
            assert_eq!(list(&server.address), 200);
            println!("another call beside {UPLOADS} uploads took {:?}", start.elapsed());
            statuses.extend(
                uploads
                    .into_iter()
                    .map(|upload| upload.join().expect("it does not panic")),
            );
        });
    });
    statuses.sort_unstable();
    let refused = statuses.iter().filter(|&&status| status != 400).count();
    println!(
        "{refused} of {UPLOADS} uploads of 8 MiB were refused as too many, or cut off; the server grew by {} MiB",
        growth / MIB
    );
    assert!(growth < 2 * MAX_GROWTH, "{} MiB", growth / MIB);
    assert_eq!(list(&server.address), 200);
    server.terminate();
}

#[test]
fn a_process_without_files_serves_open_connections_idles_and_recovers() {
    const WITHOUT_FILES: Duration = Duration::from_secs(2);
    let server = start(&[]);
    let mut open = TcpStream::connect(&server.address).expect("it listens");
    let ask =
        b"POST /grasp.v1.ObjectService/ListObjects HTTP/1.1\r\nhost: x\r\ncontent-type: application/json\r\n\
        content-length: 2\r\n\r\n{}";
    let mut answered = |ask: &[u8]| {
        open.write_all(ask).expect("it is open");
        let mut start = [0; 15];
        open.read_exact(&mut start).expect("it is answered");
        let mut rest = vec![0; 1 << 20];
        let _ = open.read(&mut rest);
        assert_eq!(&start, b"HTTP/1.1 200 OK");
    };
    answered(ask);
    // A connection with a call is not closed to make room.
    let mut watch = TcpStream::connect(&server.address).expect("it listens");
    watch
        .write_all(
            b"POST /grasp.v1.ObjectService/WatchObjects HTTP/1.1\r\nhost: x\r\ncontent-type: application/connect+json\r\n\
              content-length: 7\r\n\r\n\0\0\0\0\x02{}",
        )
        .expect("it is open");
    watch.read_exact(&mut [0; 12]).expect("it is answered");
    let files = fs::read_dir(format!("/proc/{}/fd", server.child.id()))
        .expect("it runs")
        .count();
    server.limit_files(files as u64 - 1);
    let waiting: Vec<_> = (0..50)
        .map(|_| TcpStream::connect(&server.address).expect("the kernel accepts it"))
        .collect();
    let before = server.processor_time();
    thread::sleep(WITHOUT_FILES);
    let used = server.processor_time().saturating_sub(before);
    answered(ask);
    println!(
        "{used:?} of processor time in {WITHOUT_FILES:?} without files, with {} waiting",
        waiting.len()
    );
    assert!(used < WITHOUT_FILES / 10, "{used:?}");
    server.limit_files(1024);
    let start = Instant::now();
    assert_eq!(list(&server.address), 200);
    println!("served again {:?} after files were free", start.elapsed());
    assert!(start.elapsed() < Duration::from_secs(5));
    server.terminate();
}
