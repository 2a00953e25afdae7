//! Pairs the files of a folder.

use std::{collections::BTreeMap, fs, io, path::Path};

use super::DirectoryProblem;

/// The two files of an object.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Pair {
    /// The object's id: the name of both without their extensions.
    pub id: String,
    /// The mesh's file name.
    pub mesh: String,
    /// The manifest's file name.
    pub toml: String,
    /// True if there is a manifest.
    pub has_manifest: bool,
}

/// Whether a mesh must have a manifest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Manifests {
    /// One without is a problem.
    Required,
    /// One without is a pair, too.
    Optional,
}

/// Which files exist under one name.
#[derive(Debug, Default)]
struct Found {
    /// The extensions of meshes.
    meshes: Vec<&'static str>,
    toml: bool,
}

/// The extensions of meshes.
const MESHES: [&str; 5] = ["glb", "gltf", "obj", "ply", "stl"];

/// All pairs of a folder, sorted by name. An unreadable folder, a manifest without a mesh and, if manifests are required, a mesh
/// without a manifest are problems.
///
/// Other files (pictures, material libraries, notes) are ignored, and so are names that start with a dot, which volumes
/// of container platforms contain.
pub(super) fn pairs(
    path: &Path,
    maximum: usize,
    manifests: Manifests,
    problems: &mut Vec<DirectoryProblem>,
) -> Vec<Pair> {
    let names = match read_names(path, problems) {
        Ok(names) => names,
        Err(error) => {
            let needed = "it must be a folder that the server may read";
            problems.push(DirectoryProblem::of("", format_args!("{error}; {needed}")));
            return Vec::new();
        }
    };
    if names.len() > maximum {
        problems.push(DirectoryProblem::of(
            "",
            format_args!(
                "it has {} objects; the limit is cache_objects, {maximum}",
                names.len()
            ),
        ));
        return Vec::new();
    }
    let mut pairs = Vec::new();
    for (id, found) in names {
        let toml = format!("{id}.toml");
        let mut found_meshes = found.meshes.iter().map(|extension| format!("{id}.{extension}"));
        let Some(mesh) = found_meshes.next() else {
            problems.push(DirectoryProblem::of(
                toml,
                format_args!(
                    "has no mesh next to it: {id}.{}",
                    MESHES.join(&format!(", {id}."))
                ),
            ));
            continue;
        };
        for other in found_meshes {
            problems.push(DirectoryProblem::of(
                other,
                format_args!("is a second mesh beside {mesh}; keep one of them"),
            ));
        }
        if found.toml || manifests == Manifests::Optional {
            pairs.push(Pair {
                id,
                mesh,
                toml,
                has_manifest: found.toml,
            });
        } else {
            problems.push(DirectoryProblem::of(
                mesh,
                format_args!("has no {toml} next to it, which must give at least mass_kg"),
            ));
        }
    }
    pairs
}

/// Names without extension, with the files found under each.
fn read_names(path: &Path, problems: &mut Vec<DirectoryProblem>) -> io::Result<BTreeMap<String, Found>> {
    let mut names: BTreeMap<String, Found> = BTreeMap::new();
    for entry in fs::read_dir(path)? {
        let name = entry?.file_name();
        let text = name.to_string_lossy();
        let Some((stem, extension)) = text.rsplit_once('.').filter(|(stem, _)| !stem.is_empty()) else {
            continue;
        };
        let mesh = MESHES
            .into_iter()
            .find(|mesh| extension.eq_ignore_ascii_case(mesh));
        if text.starts_with('.') || (mesh.is_none() && !extension.eq_ignore_ascii_case("toml")) {
            continue;
        }
        if name.to_str().is_none() {
            problems.push(DirectoryProblem::of(text, "has a name that is not UTF-8"));
            continue;
        }
        match (extension, mesh) {
            ("toml", _) => names.entry(stem.to_owned()).or_default().toml = true,
            (_, Some(mesh)) if extension == mesh => {
                let found = names.entry(stem.to_owned()).or_default();
                found.meshes.push(mesh);
                found.meshes.sort_unstable();
            }
            // Only case-insensitive file systems would find it.
            _ => problems.push(DirectoryProblem::of(
                text.as_ref(),
                "has an extension in capitals; it must be in small letters",
            )),
        }
    }
    Ok(names)
}
