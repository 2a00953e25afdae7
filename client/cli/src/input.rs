//! Files and standard input.

use std::{
    io::Read as _,
    path::{Path, PathBuf},
};

use clap::Args;
use grasp_assets::holdouts::{BuiltInHoldout, holdout, holdouts};
use grasp_client::{
    built_in::request_for,
    json::{JsonError, from_json},
    v1,
};
use prost::{Message, Name};
use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::{Failure, blocking, format::list};

/// Reads a message as protobuf's JSON from a file or, for `-`, from standard input; `what` names it in errors.
pub(crate) fn read_message<M: Message + Name + Default>(what: &str, path: &Path) -> Result<M, Failure> {
    from_json(&read_json(what, path)?)
        .map_err(|error| Failure::Usage(format!("{what} {}: {error}", path.display())))
}

/// Reads messages of a kind as a list of protobuf's JSON.
pub(crate) fn read_messages<M: Message + Name + Default>(what: &str, path: &Path) -> Result<Vec<M>, Failure> {
    let values: Vec<Value> = read_json(what, path)?;
    messages_of(&values)
        .map_err(|(place, error)| Failure::Usage(format!("{what} {}: [{place}]: {error}", path.display())))
}

/// Messages of their protobuf's JSON.
///
/// # Errors
/// The place of the first that is wrong.
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
        .map_err(|error| Failure::Usage(format!("{what} {}: {error}", path.display())))
}

/// Reads all of a file.
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
    /// The request of the built-in holdout or of the file.
    pub(crate) async fn to_request(&self) -> Result<v1::FindGraspRequest, Failure> {
        match (&self.holdout, self.request.clone()) {
            (Some(name), _) => Ok(request_for(built_in(name)?)),
            (None, Some(path)) => blocking(move || read_message("request", &path)).await,
            (None, None) => Err(Failure::usage("neither --holdout nor --request was given")),
        }
    }
}

/// A built-in holdout by name; the failure lists all names.
pub(crate) fn built_in(name: &str) -> Result<&'static BuiltInHoldout, Failure> {
    holdout(name).ok_or_else(|| {
        let names = list(holdouts().iter().map(|holdout| &holdout.name));
        Failure::Usage(format!(
            "holdout {name:?} is not built in; the built-in ones are {names}"
        ))
    })
}

/// The messages of the example that documentation of a file of them ends with.
#[cfg(test)]
pub(crate) fn example_of<M: Message + Name + Default>(documentation: &str) -> Vec<M> {
    let start = documentation.find("  [").expect("it has an example");
    let values: Vec<Value> = serde_json::from_str(&documentation[start..]).expect("it is JSON");
    messages_of(&values).expect("they are right")
}
