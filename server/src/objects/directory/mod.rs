//! The folder of objects that the server starts with: every mesh `NAME.obj` (or `.stl`, `.ply`, `.glb`,
//! `.gltf`) has a `NAME.toml` next to it.
//!
//! They pass the same checks and limits as objects that clients create. Any mistake keeps the server from starting, and
//! the error lists all of them: a pipeline that misses an object silently would fail much later.

mod manifest;
mod pairs;

use std::{
    fmt,
    fs::File,
    io::Read as _,
    path::{Path, PathBuf},
};

use grasp_assets::hands::hand;
use grasp_import::MeshLimits;
use grasp_proto::v1;
use grasp_synthesis::{
    base::stop::Stop,
    model::hand::{Handedness, rig::Rig},
};

use super::{StoredObject, build::build_object, grip_check::check_grips, store::is_built_in};
use crate::{
    error::{ServiceError, Violation},
    limits::{BYTES_BESIDES_MESH, StoreLimits},
    rigs,
    validate::{ID_RULE, Labels, Violations, object_fields, quoted},
};
use manifest::read_manifest;
use pairs::{Manifests, Pair, pairs};

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

#[cfg(test)]
mod tests;
