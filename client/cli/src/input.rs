//! JSON files and standard input.

use std::{io::Read as _, path::Path};

use grasp_client::{FindRequest, built_in::request_for};
use serde::de::DeserializeOwned;

use crate::{blocking, failure::Failure, holdout};

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
            blocking(move || read_json("request", &path)).await
        }
        (None, None) => Err(Failure::Usage(
            "neither --holdout nor --request was given".to_owned(),
        )),
    }
}
