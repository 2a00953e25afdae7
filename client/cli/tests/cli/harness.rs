//! Calls of the command line, with their files and servers.

use grasp_server::{Config, config::StorePlace};
use serde_json::Value;
use std::{
    ffi::OsStr,
    fs,
    io::Write as _,
    net::Ipv4Addr,
    path::{Path, PathBuf},
    process::{Command, Output, Stdio},
};
use tokio::{net::TcpListener, task::JoinHandle};

/// A command line with its standard input.
#[derive(Clone)]
pub(crate) struct Call {
    arguments: Vec<String>,
    input: String,
}

/// A call with these arguments, separated by spaces.
pub(crate) fn grasp(line: &str) -> Call {
    let call = Call {
        arguments: Vec::new(),
        input: String::new(),
    };
    call.with(line)
}

impl Call {
    /// The same call with further arguments, separated by spaces.
    pub(crate) fn with(&self, line: &str) -> Self {
        let mut call = self.clone();
        call.arguments.extend(line.split_whitespace().map(str::to_owned));
        call
    }

    /// The same call with a further argument that may contain spaces, such as the name of a file.
    pub(crate) fn arg(&self, argument: impl AsRef<OsStr>) -> Self {
        let mut call = self.clone();
        call.arguments
            .push(argument.as_ref().to_str().unwrap().to_owned());
        call
    }

    /// The same call to this server.
    pub(crate) fn at(&self, url: &str) -> Self {
        self.with("--server").arg(url)
    }

    /// The same call with this standard input.
    pub(crate) fn input(&self, input: impl Into<String>) -> Self {
        let input = input.into();
        Self {
            input,
            ..self.clone()
        }
    }

    /// The process to start, without variables of the environment that would affect it.
    pub(crate) fn command(&self) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_grasp"));
        command
            .args(&self.arguments)
            .env_remove("GRASP_SERVER")
            .env_remove("GRASP_LOG")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        command
    }

    /// Runs it while the test's runtime serves.
    pub(crate) fn run(&self) -> Ended {
        let output = tokio::task::block_in_place(|| {
            let mut child = self.command().spawn().unwrap();
            // Fails if the command has closed its input.
            let _ = child.stdin.take().unwrap().write_all(self.input.as_bytes());
            child.wait_with_output().unwrap()
        });
        output.into()
    }

    /// Runs it; it must end with this exit code.
    #[track_caller]
    pub(crate) fn ends_with(&self, code: i32) -> Ended {
        let ended = self.run();
        assert_eq!(ended.code, code, "{:?}: {}", self.arguments, ended.stderr);
        ended
    }

    /// Runs it; it must succeed, and its output is returned.
    #[track_caller]
    pub(crate) fn text(&self) -> String {
        self.ends_with(0).stdout
    }

    /// Runs it with `--json`; it must succeed.
    #[track_caller]
    pub(crate) fn json(&self) -> Value {
        self.with("--json").ends_with(0).json()
    }

    /// Runs it; it must end with this exit code and an error message that contains `expected`.
    #[track_caller]
    pub(crate) fn complains(&self, code: i32, expected: &str) {
        let Ended { stderr, .. } = self.ends_with(code);
        assert!(stderr.contains(expected), "{:?}: {stderr}", self.arguments);
    }
}

/// Output and exit code of a call.
#[derive(Debug)]
pub(crate) struct Ended {
    pub(crate) code: i32,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

impl From<Output> for Ended {
    fn from(output: Output) -> Self {
        Self {
            code: output.status.code().unwrap_or(-1),
            stdout: String::from_utf8(output.stdout).unwrap(),
            stderr: String::from_utf8(output.stderr).unwrap(),
        }
    }
}

impl Ended {
    /// Standard output as JSON.
    pub(crate) fn json(&self) -> Value {
        parsed(&self.stdout)
    }

    /// Each line of standard output as JSON.
    pub(crate) fn lines(&self) -> Vec<Value> {
        self.stdout.lines().map(parsed).collect()
    }

    /// The error on standard error as JSON.
    pub(crate) fn error(&self) -> Value {
        parsed(&self.stderr)["error"].clone()
    }
}

fn parsed(text: &str) -> Value {
    serde_json::from_str(text).unwrap_or_else(|error| panic!("{error} in {text:?}"))
}

/// Asserts that an object in JSON has these members; null means absent.
#[track_caller]
pub(crate) fn assert_has(object: &Value, members: &Value) {
    for (name, member) in members.as_object().unwrap() {
        assert_eq!(object[name], *member, "{name} of {object}");
    }
}

/// Asserts that a text contains all of these.
#[track_caller]
pub(crate) fn assert_contains(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "{part} in {text}");
    }
}

/// An empty folder for one test, in cargo's folder for integration tests.
pub(crate) fn empty_folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    folder
}

pub(crate) fn file(folder: &Path, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
    let path = folder.join(name);
    fs::write(&path, content).unwrap();
    path
}

#[track_caller]
pub(crate) fn assert_png(path: impl AsRef<Path>) {
    assert!(fs::read(path).unwrap().starts_with(b"\x89PNG\r\n\x1a\n"));
}

/// Asserts that a file is a scene that mentions all of these.
#[track_caller]
pub(crate) fn assert_scene(path: impl AsRef<Path>, parts: &[&str]) {
    let scene = fs::read(path).unwrap();
    assert!(scene.starts_with(b"glTF"));
    for part in parts {
        let mut places = scene.windows(part.len());
        assert!(places.any(|bytes| bytes == part.as_bytes()), "{part}");
    }
}

/// The points of a node of a scene.
pub(crate) fn node_points(path: &Path, name: &str) -> Vec<[f32; 3]> {
    let gltf::Gltf { document, blob } = gltf::Gltf::open(path).unwrap();
    let blob = blob.unwrap();
    let node = document.nodes().find(|node| node.name() == Some(name)).unwrap();
    let mut points = Vec::new();
    for primitive in node.mesh().unwrap().primitives() {
        points.extend(primitive.reader(|_| Some(&blob)).read_positions().unwrap());
    }
    points
}

/// Starts a server on a free port; returns its URL and its task.
pub(crate) async fn serve(
    config: Config,
    stopped: impl Future<Output = ()> + Send + 'static,
) -> (String, JoinHandle<()>) {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).await.unwrap();
    let url = format!("http://{}", listener.local_addr().unwrap());
    let serving = tokio::spawn(async { grasp_server::run(listener, config, stopped).await.unwrap() });
    (url, serving)
}

/// The URL of a server that lives as long as the test.
pub(crate) async fn real_server() -> String {
    let config = Config {
        place: StorePlace::Memory,
        ..Config::default()
    };
    serve(config, std::future::pending()).await.0
}
