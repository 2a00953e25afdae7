//! Input: options, files and standard input.

use std::{
    env,
    io::Read as _,
    path::{Path, PathBuf},
    time::Duration,
};

use clap::{
    Args,
    builder::{PossibleValue, PossibleValuesParser, TypedValueParser},
};
use glam::Vec3;
use grasp_assets::holdouts::{BuiltInHoldout, holdout, holdouts};
use grasp_client::{
    GraspClient, Handedness, RetryPolicy, Strategy,
    built_in::request_for,
    json::{JsonError, from_json},
    v1,
};
use grasp_import::MeshLimits;
use grasp_scene::ViewSize;
use prost::{Message, Name};
use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::{
    Failure, blocking,
    output::{joined, list},
};

/// Limits of meshes: the largest that a server can be configured to accept.
pub(crate) const MESH_LIMITS: MeshLimits = MeshLimits {
    bytes: 1 << 30,
    vertices: 10_000_000,
    triangles: 10_000_000,
};

/// Reads a message as protobuf's JSON from a file or, for `-`, from standard input; `what` names it in errors.
pub(crate) fn read_message<M: Message + Name + Default>(what: &str, path: &Path) -> Result<M, Failure> {
    from_json(&read_json(what, path)?)
        .map_err(|error| Failure::usage(format!("{what} {}: {error}", path.display())))
}

/// Reads a list of messages in protobuf's JSON.
pub(crate) fn read_messages<M: Message + Name + Default>(what: &str, path: &Path) -> Result<Vec<M>, Failure> {
    let values: Vec<Value> = read_json(what, path)?;
    messages_of(&values)
        .map_err(|(place, error)| Failure::usage(format!("{what} {}: [{place}]: {error}", path.display())))
}

/// Parses messages in protobuf's JSON.
///
/// # Errors
/// The index of the first invalid value, and the error.
pub(crate) fn messages_of<M: Message + Name + Default>(
    values: &[Value],
) -> Result<Vec<M>, (usize, JsonError)> {
    let read = |(place, value)| from_json(value).map_err(|error| (place, error));
    values.iter().enumerate().map(read).collect()
}

/// Reads a value from a JSON file or, for `-`, from standard input; `what` names it in errors.
pub(crate) fn read_json<T: DeserializeOwned>(what: &str, path: &Path) -> Result<T, Failure> {
    let bytes = if path == Path::new("-") {
        let mut bytes = Vec::new();
        let read = std::io::stdin().read_to_end(&mut bytes);
        read.map_err(|error| Failure::other("cannot read -", error))?;
        bytes
    } else {
        read_file(path)?
    };
    serde_json::from_slice(&bytes)
        .map_err(|error| Failure::usage(format!("{what} {}: {error}", path.display())))
}

pub(crate) fn read_file(path: &Path) -> Result<Vec<u8>, Failure> {
    std::fs::read(path).map_err(|error| Failure::other(format!("cannot read {}", path.display()), error))
}

/// The holdout of a request.
#[derive(Args, Clone, Debug)]
#[group(required = true, multiple = false)]
pub(crate) struct HoldoutOptions {
    /// A built-in holdout, such as remote-hold1.
    #[arg(long, value_name = "NAME")]
    pub(crate) holdout: Option<String>,
    /// A JSON file with a request; - for standard input.
    #[arg(long, value_name = "FILE")]
    pub(crate) request: Option<PathBuf>,
}

impl HoldoutOptions {
    pub(crate) async fn to_request(&self) -> Result<v1::FindGraspRequest, Failure> {
        match (&self.holdout, self.request.clone()) {
            (Some(name), _) => Ok(request_for(built_in(name)?)),
            (None, Some(path)) => blocking(move || read_message("request", &path)).await,
            (None, None) => Err(Failure::usage("give --holdout or --request")),
        }
    }
}

/// The file's name without its extension, in lower case, with hyphens for runs of other characters.
pub(crate) fn id_from_file(path: &Path) -> String {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let name = stem.to_lowercase();
    let words = name.split(|c: char| !c.is_ascii_alphanumeric());
    joined("-", words.filter(|word| !word.is_empty()))
}

/// The server to call, and time limits.
#[derive(Args, Debug)]
#[command(next_help_heading = "Server")]
pub(crate) struct ServerOptions {
    /// The server's URL.
    #[arg(
        long,
        global = true,
        value_name = "URL",
        env = "GRASP_SERVER",
        default_value = "http://[::1]:50051"
    )]
    server: String,
    /// File with the token to send, for servers that demand one [default: the variable `GRASP_TOKEN`, which has the token itself].
    #[arg(long, global = true, value_name = "FILE", env = "GRASP_TOKEN_FILE")]
    token_file: Option<PathBuf>,
    /// File with the certificate of the authority to trust, in PEM [default: those of the system].
    #[arg(long, global = true, value_name = "FILE", env = "GRASP_TLS_CA")]
    tls_ca: Option<PathBuf>,
    /// File with a certificate to show to the server, in PEM.
    #[arg(
        long,
        global = true,
        value_name = "FILE",
        env = "GRASP_CLIENT_CERTIFICATE",
        requires = "client_key"
    )]
    client_certificate: Option<PathBuf>,
    /// File with the key of that certificate, in PEM.
    #[arg(
        long,
        global = true,
        value_name = "FILE",
        env = "GRASP_CLIENT_KEY",
        requires = "client_certificate"
    )]
    client_key: Option<PathBuf>,
    /// Time limit for connecting.
    #[arg(long, global = true, value_name = "DURATION", default_value = "5s", value_parser = parse_duration)]
    connect_timeout: Duration,
    /// Time limit of a call, retries included; a search's budget is added.
    #[arg(long, global = true, value_name = "DURATION", default_value = "10s", value_parser = parse_duration)]
    timeout: Duration,
    /// Largest number of attempts while the server is unavailable.
    #[arg(long, global = true, value_name = "N", default_value_t = RetryPolicy::default().max_attempts)]
    #[arg(value_parser = clap::value_parser!(u32).range(1..))]
    tries: u32,
}

impl ServerOptions {
    pub(crate) async fn connect(&self) -> Result<GraspClient, Failure> {
        let mut builder = GraspClient::builder(&self.server)
            .connect_timeout(self.connect_timeout)
            .call_timeout(self.timeout)
            .retry(RetryPolicy {
                max_attempts: self.tries,
                ..RetryPolicy::default()
            });
        let token = match &self.token_file {
            Some(path) => Some(String::from_utf8_lossy(&read_file(path)?).into_owned()),
            None => env::var("GRASP_TOKEN").ok(),
        };
        if let Some(token) = token {
            builder = builder.token(token.trim())?;
        }
        if let Some(path) = &self.tls_ca {
            builder = builder.ca_certificate(read_file(path)?);
        }
        if let (Some(certificate), Some(key)) = (&self.client_certificate, &self.client_key) {
            builder = builder.client_certificate(read_file(certificate)?, read_file(key)?);
        }
        Ok(builder.connect().await?)
    }
}

/// A built-in holdout by name; the failure lists all names.
pub(crate) fn built_in(name: &str) -> Result<&'static BuiltInHoldout, Failure> {
    holdout(name).ok_or_else(|| {
        let names = list(holdouts().iter().map(|holdout| &holdout.name));
        Failure::usage(format!(
            "holdout {name:?} is not built in; the built-in ones are {names}"
        ))
    })
}

/// Parses a duration such as `250us`, `500ms`, `1.5s` or `2m`; more than 0.
pub(crate) fn parse_duration(text: &str) -> Result<Duration, String> {
    let expected = || format!("{text:?} is not a duration; write for example 500ms, 2s or 1m, more than 0");
    let duration = duration(text).filter(|duration| !duration.is_zero());
    duration.ok_or_else(expected)
}

fn duration(text: &str) -> Option<Duration> {
    let unit_start = text.find(|c: char| !c.is_ascii_digit() && c != '.')?;
    let (number, unit) = text.split_at(unit_start);
    let seconds_per_unit = match unit {
        "us" => 1e-6,
        "ms" => 1e-3,
        "s" => 1.0,
        "m" => 60.0,
        _ => return None,
    };
    let seconds = number.parse::<f64>().ok()? * seconds_per_unit;
    Duration::try_from_secs_f64(seconds).ok()
}

/// Parses a vector such as `0,0.01,-0.02`.
pub(crate) fn parse_vector(text: &str) -> Result<Vec3, String> {
    let expected = || format!("{text:?} is not a vector; write three numbers, for example 0,0.01,-0.02");
    let numbers = text.split(',').map(|number| number.trim().parse());
    let numbers: Vec<f32> = numbers.collect::<Result<_, _>>().map_err(|_| expected())?;
    let numbers: [f32; 3] = numbers.try_into().map_err(|_| expected())?;
    Ok(numbers.into())
}

/// Parses a label such as `level=kitchen`; without `=`, its value is empty.
pub(crate) fn parse_label(text: &str) -> Result<(String, String), String> {
    let (key, value) = text.split_once('=').unwrap_or((text, ""));
    if key.is_empty() {
        return Err(format!(
            "{text:?} is not a label; write a key and a value, for example level=kitchen"
        ));
    }
    Ok((key.to_owned(), value.to_owned()))
}

/// The full name in a collection: "objects/remote" for "remote" or itself.
pub(crate) fn full_name(collection: &str, name: &str) -> String {
    match name.split_once('/') {
        Some((given, _)) if given == collection => name.to_owned(),
        _ => format!("{collection}/{name}"),
    }
}

/// Parses a size such as `900x700`; each side from 16 to 8192 pixels.
pub(crate) fn parse_view_size(text: &str) -> Result<ViewSize, String> {
    let expected = || format!("{text:?} is not a size; write for example 900x700, each side from 16 to 8192");
    let side = |text: &str| match text.parse() {
        Ok(pixels @ 16..=8192) => Ok(pixels),
        _ => Err(expected()),
    };
    let (width, height) = text.split_once('x').ok_or_else(expected)?;
    let (width, height) = (side(width)?, side(height)?);
    Ok(ViewSize { width, height })
}

/// A named value of an option: the name, the value, and its help text.
pub(crate) type Choice<T> = (&'static str, T, &'static str);

pub(crate) fn one_of<T, const COUNT: usize>(values: [Choice<T>; COUNT]) -> impl TypedValueParser<Value = T>
where
    T: Copy + Send + Sync + 'static,
{
    let names = values.map(|(name, _, help)| PossibleValue::new(name).help(help));
    PossibleValuesParser::new(names).try_map(move |given| {
        let mut values = values.into_iter();
        let named = values.find(|(name, ..)| name.eq_ignore_ascii_case(&given));
        named.map(|(_, value, _)| value).ok_or("it is unknown")
    })
}

/// The ladder of chapter 5 of the thesis, and GUIDED.
pub(crate) const STRATEGIES: [Choice<Strategy>; 7] = [
    ("A", Strategy::A, "Naive synthesis"),
    ("B", Strategy::B, "Placement measures relative to the object"),
    ("C", Strategy::C, "Palm-CoM-palm angle"),
    ("D", Strategy::D, "Early stop if the thumb has no contact"),
    ("E", Strategy::E, "Fewer bend ratios per finger"),
    ("F", Strategy::F, "First sufficient force distribution"),
    (
        "GUIDED",
        Strategy::Guided,
        "Places hands at opposed surfaces; with physical validity, tries known grasps first",
    ),
];

pub(crate) const HANDS: [Choice<Handedness>; 3] = [
    ("left", Handedness::Left, "The left hand"),
    ("right", Handedness::Right, "The right hand"),
    ("either", Handedness::Unspecified, "The better of both"),
];

#[cfg(test)]
mod tests {
    use std::fmt::Debug;

    use super::*;

    /// Checks that a parser accepts these texts and rejects those that bars separate.
    fn check<T: PartialEq + Debug>(
        parse: impl Fn(&str) -> Result<T, String>,
        accepted: impl IntoIterator<Item = (&'static str, T)>,
        rejected: &str,
    ) {
        for (text, expected) in accepted {
            assert_eq!(parse(text), Ok(expected), "{text:?}");
        }
        for wrong in rejected.split('|') {
            assert!(parse(wrong).is_err(), "{wrong:?}");
        }
    }

    #[test]
    fn values_of_options_are_read_or_rejected() {
        let label = |key: &str, value: &str| (key.to_owned(), value.to_owned());
        let labels = [("a=b=c", label("a", "b=c")), ("fragile", label("fragile", ""))];
        check(parse_label, labels, "=x");
        let durations = [
            ("500ms", Duration::from_millis(500)),
            ("1.5s", Duration::from_millis(1500)),
            ("250us", Duration::from_micros(250)),
            ("2m", Duration::from_mins(2)),
        ];
        let rejected = "|5|s|-1s|0s|0ms|1h|1 s|1e3s|1..2s|NaNs|9999999999999999999999m";
        check(parse_duration, durations, rejected);
        let vectors = [("0, 0.5,-2", Vec3::new(0.0, 0.5, -2.0))];
        check(parse_vector, vectors, "|1,2|1,2,3,4|a,b,c|1;2;3");
        let (width, height) = (900, 700);
        let sizes = [("900x700", ViewSize { width, height })];
        let rejected = "|900|900x|x700|15x700|900x8193|900x700x3|-900x700";
        check(parse_view_size, sizes, rejected);
    }

    #[test]
    fn names_may_lack_their_collection_and_ids_come_from_files() {
        assert_eq!(full_name("objects", "remote"), "objects/remote");
        assert_eq!(full_name("objects", "objects/remote"), "objects/remote");
        assert_eq!(full_name("rigs", "objects/remote"), "rigs/objects/remote");
        let id = |path: &str| id_from_file(Path::new(path));
        assert_eq!(id("/tmp/Coffee Mug (v2).obj"), "coffee-mug-v2");
        assert_eq!(id("/"), "");
    }
}
