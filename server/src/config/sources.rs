//! Where values come from besides flags: a file, and the environment.

use std::{fs, path::Path};

use super::{ConfigError, RawConfig};

const VARIABLE_PREFIX: &str = "GRASP_";

/// Reads a configuration file.
///
/// # Errors
/// The file cannot be read, is not TOML, or has an unknown key.
pub fn read_file(path: &Path) -> Result<RawConfig, ConfigError> {
    let text = fs::read_to_string(path).map_err(|source| ConfigError::Unreadable {
        path: path.to_owned(),
        source,
    })?;
    toml::from_str(&text).map_err(|source| ConfigError::Malformed {
        path: path.to_owned(),
        source: Box::new(source),
    })
}

/// Names among `present` that have the server's prefix but are not `known`, most likely misspelt. They are logged, not
/// rejected, because container platforms add their own variables.
pub fn unknown_variables(present: impl IntoIterator<Item = String>, known: &[String]) -> Vec<String> {
    present
        .into_iter()
        .filter(|name| name.starts_with(VARIABLE_PREFIX) && !known.contains(name))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_misspelt_variables() {
        let present = ["GRASP_WORKER", "GRASP_WORKERS", "PATH"].map(str::to_owned);
        assert_eq!(
            unknown_variables(present, &["GRASP_WORKERS".to_owned()]),
            ["GRASP_WORKER"]
        );
    }
}
