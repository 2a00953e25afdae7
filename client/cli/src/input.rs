//! JSON files and standard input.

use std::{io::Read as _, path::Path};

use grasp_client::{FindRequest, built_in::request_for};
use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::{blocking, failure::Failure, holdout, protobuf_json::from_protobuf};

/// Reads a message as protobuf's JSON from a file or, for `-`, from standard input; `what` names it in errors.
pub(crate) fn read_message<T: DeserializeOwned>(
    what: &str,
    message: &str,
    path: &Path,
) -> Result<T, Failure> {
    let value = read_json(what, path)?;
    message_of(message, value).map_err(|error| Failure::Usage(format!("{what} {}: {error}", path.display())))
}

/// Reads messages of a kind as a list of protobuf's JSON.
pub(crate) fn read_messages<T: DeserializeOwned>(
    what: &str,
    message: &str,
    path: &Path,
) -> Result<Vec<T>, Failure> {
    let values: Vec<Value> = read_json(what, path)?;
    let values = values.into_iter().enumerate();
    let read = values.map(|(place, value)| {
        let wrong = |error| Failure::Usage(format!("{what} {}: [{place}]: {error}", path.display()));
        message_of(message, value).map_err(wrong)
    });
    read.collect()
}

/// The library's form of protobuf's JSON of a message.
///
/// # Errors
/// What is wrong with it.
pub(crate) fn message_of<T: DeserializeOwned>(message: &str, value: Value) -> Result<T, String> {
    serde_json::from_value(from_protobuf(message, value)?).map_err(|error| error.to_string())
}

/// Reads a value from a JSON file or, for `-`, from standard input; `what` names it in errors.
pub(crate) fn read_json<T: DeserializeOwned>(what: &str, path: &Path) -> Result<T, Failure> {
    let cannot_read = |error| Failure::other(format!("cannot read {}", path.display()), error);
    let text = if path == Path::new("-") {
        let mut text = String::new();
        std::io::stdin().read_to_string(&mut text).map_err(cannot_read)?;
        text
    } else {
        std::fs::read_to_string(path).map_err(cannot_read)?
    };
    serde_json::from_str(&text).map_err(|error| Failure::Usage(format!("{what} {}: {error}", path.display())))
}

/// The request of a built-in holdout or of a file, one of which was given.
pub(crate) async fn find_request(holdout: Option<&str>, file: Option<&Path>) -> Result<FindRequest, Failure> {
    match (holdout, file) {
        (Some(name), _) => Ok(request_for(holdout::built_in(name)?)),
        (None, Some(path)) => {
            let path = path.to_owned();
            blocking(move || read_message("request", "FindGraspRequest", &path)).await
        }
        (None, None) => Err(Failure::Usage(
            "neither --holdout nor --request was given".to_owned(),
        )),
    }
}

/// The messages of the example that documentation of a file of them ends with.
#[cfg(test)]
pub(crate) fn example_of<T: DeserializeOwned>(message: &str, documentation: &str) -> Vec<T> {
    let start = documentation.find("  [").expect("it has an example");
    let values: Vec<Value> = serde_json::from_str(&documentation[start..]).expect("it is JSON");
    let read = |value| message_of(message, value).expect("it is right");
    values.into_iter().map(read).collect()
}
