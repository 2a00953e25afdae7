//! Which files of a folder belong together.

use std::{collections::BTreeMap, fs, io, path::Path};

use super::DirectoryProblem;

/// The two files of an object.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Pair {
    /// The object's id: the name of both without their extensions.
    pub id: String,
    /// The mesh's file name.
    pub obj: String,
    /// The manifest's file name.
    pub toml: String,
}

/// What there is under one name.
#[derive(Debug, Default)]
struct Found {
    obj: bool,
    toml: bool,
}

/// All pairs of a folder, sorted by name; what has no partner, and a folder that cannot be read, is a problem.
///
/// Other files (pictures, material libraries, notes) and names that start with a dot (which volumes of container
/// platforms have) are left alone.
pub(super) fn pairs(path: &Path, maximum: usize, problems: &mut Vec<DirectoryProblem>) -> Vec<Pair> {
    let names = match read_names(path, problems) {
        Ok(names) => names,
        Err(error) => {
            let needed = "a folder that the server may read is needed";
            problems.push(DirectoryProblem::of("", format_args!("{error}; {needed}")));
            return Vec::new();
        }
    };
    if names.len() > maximum {
        problems.push(DirectoryProblem::of(
            "",
            format_args!(
                "it has {} objects; at most cache_objects, {maximum}, are allowed",
                names.len()
            ),
        ));
        return Vec::new();
    }
    let mut pairs = Vec::new();
    for (id, found) in names {
        let (obj, toml) = (format!("{id}.obj"), format!("{id}.toml"));
        match found {
            Found {
                obj: true,
                toml: true,
            } => pairs.push(Pair { id, obj, toml }),
            Found { toml: false, .. } => problems.push(DirectoryProblem::of(
                obj,
                format_args!("has no {toml} beside it, which must say mass_kg at least"),
            )),
            Found { obj: false, .. } => {
                problems.push(DirectoryProblem::of(toml, format_args!("has no {obj} beside it")));
            }
        }
    }
    pairs
}

/// Names without extension, with what there is under each.
fn read_names(path: &Path, problems: &mut Vec<DirectoryProblem>) -> io::Result<BTreeMap<String, Found>> {
    let mut names: BTreeMap<String, Found> = BTreeMap::new();
    for entry in fs::read_dir(path)? {
        let name = entry?.file_name();
        let told = name.to_string_lossy();
        let Some((stem, extension)) = told.rsplit_once('.').filter(|(stem, _)| !stem.is_empty()) else {
            continue;
        };
        if told.starts_with('.') || !["obj", "toml"].iter().any(|e| extension.eq_ignore_ascii_case(e)) {
            continue;
        }
        if name.to_str().is_none() {
            problems.push(DirectoryProblem::of(told, "is no name in UTF-8"));
            continue;
        }
        match extension {
            "obj" => names.entry(stem.to_owned()).or_default().obj = true,
            "toml" => names.entry(stem.to_owned()).or_default().toml = true,
            // On some file systems it would be found and on others not.
            _ => problems.push(DirectoryProblem::of(
                told.as_ref(),
                "ends in capitals; .obj and .toml are read",
            )),
        }
    }
    Ok(names)
}
