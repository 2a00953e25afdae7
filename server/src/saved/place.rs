//! Where what clients create is kept.

use std::{
    env, fmt,
    path::{Path, PathBuf},
};

/// The folder of the default, in that of the user's data.
const DEFAULT_FOLDER: &str = "grasp";

/// What the setting must be.
pub(crate) const NEEDED_PLACE: &str = if cfg!(feature = "s3") {
    "memory, a folder, or s3://BUCKET/PREFIX"
} else {
    "memory or a folder (s3:// needs a server built with the feature s3)"
};

/// Where created objects and rigs are kept.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum StorePlace {
    /// Nowhere but in memory: they end with the server, or when they are evicted.
    Memory,
    /// In a folder of this server's own.
    Folder(PathBuf),
    /// In a bucket of S3, under a prefix of this server's own.
    #[cfg(feature = "s3")]
    S3 {
        /// The bucket.
        bucket: String,
        /// The prefix, without slashes around it; may be empty.
        prefix: String,
    },
}

impl Default for StorePlace {
    /// The folder `grasp` where the system keeps the user's data (`XDG_DATA_HOME`, by default `~/.local/share`), or in the
    /// working folder for a user without a home.
    fn default() -> Self {
        let set = env::var_os("XDG_DATA_HOME").map(PathBuf::from);
        let in_home = || Some(env::home_dir()?.join(".local/share"));
        let folder = set.filter(|path| path.is_absolute()).or_else(in_home);
        Self::Folder(folder.unwrap_or_default().join(DEFAULT_FOLDER))
    }
}

impl StorePlace {
    /// The folder. `None` if objects are elsewhere.
    pub(crate) fn folder(&self) -> Option<&Path> {
        match self {
            Self::Folder(path) => Some(path),
            Self::Memory => None,
            #[cfg(feature = "s3")]
            Self::S3 { .. } => None,
        }
    }

    /// Reads `memory`, a folder, or `s3://bucket/prefix`. `None` if it is none of them.
    pub(crate) fn parse(text: &str) -> Option<Self> {
        match text.split_once("://") {
            None if text.is_empty() => None,
            None if text == "memory" => Some(Self::Memory),
            None => Some(Self::Folder(text.into())),
            #[cfg(feature = "s3")]
            Some(("s3", place)) => {
                let (bucket, prefix) = place.split_once('/').unwrap_or((place, ""));
                let prefix = prefix.trim_matches('/').to_owned();
                (!bucket.is_empty()).then(|| Self::S3 {
                    bucket: bucket.to_owned(),
                    prefix,
                })
            }
            Some(_) => None,
        }
    }
}

impl fmt::Display for StorePlace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Memory => f.write_str("memory"),
            Self::Folder(path) => path.display().fmt(f),
            #[cfg(feature = "s3")]
            Self::S3 { bucket, prefix } => write!(f, "s3://{bucket}/{prefix}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn printed_places_can_be_read() {
        for text in ["memory", "/var/lib/grasp", "./memory"] {
            assert_eq!(StorePlace::parse(text).unwrap().to_string(), text);
        }
        assert_eq!(
            StorePlace::parse("./memory"),
            Some(StorePlace::Folder("./memory".into()))
        );
    }

    #[test]
    fn the_default_is_a_folder_of_that_name() {
        let place = StorePlace::default();
        assert!(place.folder().unwrap().ends_with(DEFAULT_FOLDER), "{place}");
        assert_eq!(StorePlace::parse(&place.to_string()), Some(place));
    }

    #[test]
    fn other_schemes_and_nothing_are_no_places() {
        for text in ["", "http://bucket", "s3://"] {
            assert_eq!(StorePlace::parse(text), None, "{text}");
        }
        assert_eq!(
            StorePlace::parse("s3://bucket/a/b/").is_some(),
            cfg!(feature = "s3")
        );
    }
}
