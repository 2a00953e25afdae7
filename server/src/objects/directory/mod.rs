//! The folder of objects that the server starts with: every mesh `NAME.obj` (or `.stl`, `.ply`, `.glb`,
//! `.gltf`) has a `NAME.toml` next to it.
//!
//! They pass the same checks and limits as objects that clients create. Any mistake keeps the server from starting, and
//! the error lists all of them: a pipeline that misses an object silently would fail much later.

mod manifest;
#[cfg(test)]
mod tests;

use std::{
    collections::BTreeMap,
    fmt,
    fs::{self, File},
    io::{self, Read as _},
    path::{Path, PathBuf},
};

use grasp_assets::hands::hand;
use grasp_import::MeshLimits;
use grasp_proto::v1;
use grasp_synthesis::{
    base::stop::Stop,
    model::hand::{Handedness, rig::Rig},
};

use self::manifest::read_manifest;
use super::{StoredObject, build::build_object, given::check_grips, store::is_built_in};
use crate::{
    error::{ServiceError, Violation},
    limits::{BYTES_BESIDES_MESH, StoreLimits},
    rigs,
    validate::{ID_RULE, Labels, Violations, object_fields, quoted},
};

/// Largest number of listed problems; the others are only counted, to bound the log line.
const LISTED_PROBLEMS: usize = 100;

/// An object that the server starts with.
#[derive(Debug)]
pub(crate) struct PinnedObject {
    /// The object.
    pub object: StoredObject,
    /// Its labels.
    pub labels: Labels,
}

/// A problem of a folder of objects.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DirectoryProblem {
    /// The file's name; empty for the folder itself.
    pub file: String,
    /// The key of the manifest, or `mesh` for the mesh; empty for the file itself.
    pub field: String,
    /// The value, and what a valid one is.
    pub description: String,
}

impl DirectoryProblem {
    /// A problem of a file or, with an empty name, of the folder.
    fn of(file: impl Into<String>, description: impl fmt::Display) -> Self {
        Self {
            file: file.into(),
            field: String::new(),
            description: description.to_string(),
        }
    }
}

impl fmt::Display for DirectoryProblem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for part in [&self.file, &self.field] {
            if !part.is_empty() {
                write!(f, "{part}: ")?;
            }
        }
        f.write_str(&self.description)
    }
}

/// An unusable folder of objects, with everything that is wrong.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("objects_directory is {}; {}", path.display(), listed(problems))]
pub struct DirectoryError {
    /// The folder.
    pub path: PathBuf,
    /// What is wrong, file by file.
    pub problems: Vec<DirectoryProblem>,
}

fn listed(problems: &[DirectoryProblem]) -> String {
    let mut lines: Vec<String> = problems
        .iter()
        .take(LISTED_PROBLEMS)
        .map(DirectoryProblem::to_string)
        .collect();
    if problems.len() > LISTED_PROBLEMS {
        lines.push(format!("and {} more problems", problems.len() - LISTED_PROBLEMS));
    }
    lines.join("\n")
}

/// Reads the objects of a folder one after the other, so that loading takes no more memory than one upload in addition
/// to the objects themselves.
///
/// # Errors
/// Everything that is wrong, in the order of the file names.
pub(crate) fn load(
    path: &Path,
    limits: MeshLimits,
    store: StoreLimits,
) -> Result<Vec<PinnedObject>, DirectoryError> {
    let mut problems = Vec::new();
    let mut objects = Vec::new();
    let mut bytes = 0_usize;
    for pair in pairs(path, store.objects, Manifests::Required, &mut problems) {
        match read_pair(path, &pair, limits) {
            Ok(object) => {
                bytes = bytes.saturating_add(object.object.derived_and_own_bytes());
                if bytes > store.bytes {
                    problems.push(DirectoryProblem::of(
                        pair.mesh,
                        format_args!(
                            "makes all objects so far take about {bytes} bytes with their search structures; the \
                             limit is cache_bytes, {} (later files were not read)",
                            store.bytes
                        ),
                    ));
                    break;
                }
                objects.push(object);
            }
            Err(found) => problems.extend(found),
        }
    }
    if problems.is_empty() {
        Ok(objects)
    } else {
        Err(DirectoryError {
            path: path.to_owned(),
            problems,
        })
    }
}

/// A mesh of a folder.
#[derive(Clone, Debug, PartialEq)]
pub struct FolderObject {
    /// The mesh file.
    pub mesh: PathBuf,
    /// What the manifest next to it says of the object, as yet unchecked. `None` if there is no manifest.
    pub manifest: Option<v1::GraspObject>,
}

/// Finds the meshes of a folder and reads the manifests that are next to them, as the server reads its `objects_directory`.
///
/// # Errors
/// Everything that is wrong with the folder and with manifests.
pub fn objects_of_folder(path: &Path) -> Result<Vec<FolderObject>, Vec<DirectoryProblem>> {
    let mut problems = Vec::new();
    let mut objects = Vec::new();
    for pair in pairs(path, usize::MAX, Manifests::Optional, &mut problems) {
        let mut object = FolderObject {
            mesh: path.join(&pair.mesh),
            manifest: None,
        };
        if pair.has_manifest {
            let violations = Violations::default();
            match read_bounded(&path.join(&pair.toml), BYTES_BESIDES_MESH) {
                Ok(bytes) => {
                    object.manifest = read_manifest(&pair.id, &bytes, &violations);
                }
                Err(wrong) => problems.push(DirectoryProblem::of(&pair.toml, wrong)),
            }
            if !violations.is_empty() {
                problems.extend(problems_of(&pair, violations.into_error()));
            }
        }
        objects.push(object);
    }
    if problems.is_empty() {
        Ok(objects)
    } else {
        Err(problems)
    }
}

/// Reads one object.
fn read_pair(path: &Path, pair: &Pair, limits: MeshLimits) -> Result<PinnedObject, Vec<DirectoryProblem>> {
    let mut problems = Vec::new();
    let mut read = |name: &str, limit| match read_bounded(&path.join(name), limit) {
        Ok(bytes) => Some(bytes),
        Err(description) => {
            problems.push(DirectoryProblem::of(name, description));
            None
        }
    };
    let manifest = read(&pair.toml, BYTES_BESIDES_MESH);
    let mesh = read(&pair.mesh, limits.bytes);
    if is_built_in(&pair.id) {
        problems.push(DirectoryProblem::of(
            &pair.mesh,
            format_args!(
                "has the name of the built-in object {}; choose another name",
                quoted(&pair.id)
            ),
        ));
    }
    let (Some(manifest), Some(mesh)) = (manifest, mesh) else {
        return Err(problems);
    };
    let violations = Violations::default();
    let Some(manifest) = read_manifest(&pair.id, &manifest, &violations) else {
        problems.extend(problems_of(pair, violations.into_error()));
        return Err(problems);
    };
    let request = v1::CreateObjectRequest {
        object: Some(manifest),
        mesh,
        request_id: String::new(),
    };
    let mut fields = object_fields(request, limits.bytes, &violations);
    let labels = std::mem::take(&mut fields.labels);
    let built = build_object(&fields, limits, violations, Stop::NEVER);
    let checked = built.and_then(|object| check_grips(&object, built_in_rig, Stop::NEVER).map(|()| object));
    match checked {
        Ok(object) if problems.is_empty() => Ok(PinnedObject { object, labels }),
        Ok(_) => Err(problems),
        Err(error) => {
            problems.extend(problems_of(pair, error));
            Err(problems)
        }
    }
}

/// A hand of a built-in rig: there are no others before the server has started.
fn built_in_rig(name: &str, handedness: Handedness) -> Option<Rig> {
    let id = name.strip_prefix(rigs::COLLECTION)?;
    hand(id, handedness).map(|hand| (*hand.rig).clone())
}

/// The violations of a request as problems of the files that it was made from.
fn problems_of(pair: &Pair, error: ServiceError) -> Vec<DirectoryProblem> {
    let ServiceError::Invalid(violations) = error else {
        return vec![DirectoryProblem::of(&pair.mesh, error)];
    };
    let problem = |Violation {
                       field, description, ..
                   }| {
        let (file, field, description) = match field.as_str() {
            "mesh" => (&pair.mesh, String::new(), description),
            "object.name" => {
                let wrong = format!("is {}; it must be {ID_RULE}", quoted(&pair.id));
                (&pair.mesh, "the name".to_owned(), wrong)
            }
            field => {
                let key = field.strip_prefix("object.").unwrap_or(field);
                (&pair.toml, key.to_owned(), description)
            }
        };
        DirectoryProblem {
            file: file.clone(),
            field,
            description,
        }
    };
    violations.into_iter().map(problem).collect()
}

/// The bytes of a file, if it has no more than `limit`.
fn read_bounded(path: &Path, limit: usize) -> Result<Vec<u8>, String> {
    let unreadable = |error| format!("cannot be read: {error}");
    // Checked before opening: opening a pipe would wait for its writer.
    if !path.metadata().map_err(unreadable)?.is_file() {
        return Err("is not a regular file".to_owned());
    }
    let mut bytes = Vec::new();
    let mut file = File::open(path).map_err(unreadable)?.take(limit as u64 + 1);
    file.read_to_end(&mut bytes).map_err(unreadable)?;
    if bytes.len() > limit {
        return Err(format!("has more than {limit} bytes, the limit"));
    }
    Ok(bytes)
}

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
