//! The folder of objects that the server starts with: every mesh `NAME.obj` (or `.stl`, `.ply`, `.glb`,
//! `.gltf`) has a `NAME.toml` next to it.
//!
//! They pass the same checks and limits as objects that clients create. Any mistake keeps the server from starting, and
//! the error lists all of them: a pipeline that misses an object silently would fail much later.

mod manifest;
#[cfg(test)]
mod tests;

use std::{
    collections::{BTreeMap, BTreeSet},
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

pub(crate) use self::manifest::read_manifest;
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
    pub object: StoredObject,
    pub labels: Labels,
}

/// A problem of a folder of objects.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DirectoryProblem {
    /// The file's name; empty for the folder itself.
    pub file: String,
    /// The key of the manifest, or `mesh` for the mesh; empty for the file itself.
    pub field: String,
    /// The value, and the valid ones.
    pub description: String,
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

/// An unusable folder of objects, with all of its problems.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("objects_directory is {}; {}", path.display(), listed(problems))]
pub struct DirectoryError {
    /// The folder.
    pub path: PathBuf,
    /// The problems, file by file.
    pub problems: Vec<DirectoryProblem>,
}

fn listed(problems: &[DirectoryProblem]) -> String {
    let listed = problems
        .iter()
        .take(LISTED_PROBLEMS)
        .map(DirectoryProblem::to_string);
    let more = problems.len().saturating_sub(LISTED_PROBLEMS);
    let more = (more > 0).then(|| format!("and {more} more problems"));
    listed.chain(more).collect::<Vec<_>>().join("\n")
}

/// The problems found so far.
#[derive(Default)]
struct Problems(Vec<DirectoryProblem>);

impl Problems {
    /// Adds a problem of a file or, with an empty name, of the folder.
    fn add(&mut self, file: impl Into<String>, description: impl fmt::Display) {
        self.0.push(DirectoryProblem {
            file: file.into(),
            field: String::new(),
            description: description.to_string(),
        });
    }

    /// Adds the violations of a request as problems of the files that it was made from.
    fn add_violations(&mut self, pair: &Pair, error: ServiceError) {
        let ServiceError::Invalid(violations) = error else {
            return self.add(&pair.mesh, error);
        };
        for Violation {
            field,
            mut description,
            ..
        } in violations
        {
            let key = field.strip_prefix("object.").unwrap_or(&field);
            let (file, field) = match field.as_str() {
                "mesh" => (&pair.mesh, ""),
                "object.name" => {
                    description = format!("is {}; it must be {ID_RULE}", quoted(&pair.id));
                    (&pair.mesh, "the name")
                }
                _ => (&pair.toml, key),
            };
            self.0.push(DirectoryProblem {
                file: file.clone(),
                field: field.to_owned(),
                description,
            });
        }
    }

    /// The value if there are no problems.
    fn finish<T>(self, value: T) -> Result<T, Vec<DirectoryProblem>> {
        if self.0.is_empty() { Ok(value) } else { Err(self.0) }
    }

    /// The bytes of a file, if it has no more than `limit`.
    fn read(&mut self, folder: &Path, name: &str, limit: usize) -> Option<Vec<u8>> {
        let read = read_bounded(&folder.join(name), limit);
        read.map_err(|wrong| self.add(name, wrong)).ok()
    }
}

/// Reads the objects of a folder one after the other, so that loading takes no more memory than one upload in addition
/// to the objects themselves.
pub(crate) fn load(
    path: &Path,
    limits: MeshLimits,
    store: StoreLimits,
) -> Result<Vec<PinnedObject>, DirectoryError> {
    let mut problems = Problems::default();
    let mut objects = Vec::new();
    let mut bytes = 0_usize;
    for pair in pairs(path, store.objects, &mut problems) {
        let Some(object) = read_pair(path, &pair, limits, &mut problems) else {
            continue;
        };
        bytes = bytes.saturating_add(object.object.derived_and_own_bytes());
        if bytes > store.bytes {
            problems.add(
                pair.mesh,
                format_args!(
                    "makes all objects so far take about {bytes} bytes with their search structures; the limit is \
                     cache_bytes, {} (later files were not read)",
                    store.bytes
                ),
            );
            break;
        }
        objects.push(object);
    }
    problems.finish(objects).map_err(|problems| DirectoryError {
        path: path.to_owned(),
        problems,
    })
}

/// A mesh of a folder.
#[derive(Clone, Debug, PartialEq)]
pub struct FolderObject {
    /// The mesh file.
    pub mesh: PathBuf,
    /// The object as its manifest describes it, unchecked. `None` if there is no manifest.
    pub manifest: Option<v1::GraspObject>,
}

/// Finds the meshes of a folder and reads the manifests that are next to them, as the server reads its `objects_directory`.
///
/// # Errors
/// All problems of the folder and of manifests.
pub fn objects_of_folder(path: &Path) -> Result<Vec<FolderObject>, Vec<DirectoryProblem>> {
    let mut problems = Problems::default();
    let mut objects = Vec::new();
    for pair in pairs(path, usize::MAX, &mut problems) {
        let mut manifest = None;
        if pair.has_manifest
            && let Some(bytes) = problems.read(path, &pair.toml, BYTES_BESIDES_MESH)
        {
            let violations = Violations::default();
            manifest = read_manifest(&pair.id, &bytes, &violations);
            if let Err(error) = violations.finish(()) {
                problems.add_violations(&pair, error);
            }
        }
        objects.push(FolderObject {
            mesh: path.join(pair.mesh),
            manifest,
        });
    }
    problems.finish(objects)
}

/// Reads one object. `None` if it has problems.
fn read_pair(path: &Path, pair: &Pair, limits: MeshLimits, problems: &mut Problems) -> Option<PinnedObject> {
    let before = problems.0.len();
    if !pair.has_manifest {
        let toml = &pair.toml;
        problems.add(
            &pair.mesh,
            format_args!("has no {toml} next to it, which must give at least mass_kg"),
        );
        return None;
    }
    let manifest = problems.read(path, &pair.toml, BYTES_BESIDES_MESH);
    let mesh = problems.read(path, &pair.mesh, limits.bytes);
    if is_built_in(&pair.id) {
        let id = quoted(&pair.id);
        let taken = format_args!("has the name of the built-in object {id}; choose another name");
        problems.add(&pair.mesh, taken);
    }
    let (manifest, mesh) = (manifest?, mesh?);
    let violations = Violations::default();
    let Some(manifest) = read_manifest(&pair.id, &manifest, &violations) else {
        problems.add_violations(pair, violations.into_error());
        return None;
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
    let object = checked
        .map_err(|error| problems.add_violations(pair, error))
        .ok()?;
    (problems.0.len() == before).then_some(PinnedObject { object, labels })
}

/// A hand of a built-in rig: there are no others before the server has started.
fn built_in_rig(name: &str, handedness: Handedness) -> Option<Rig> {
    let id = name.strip_prefix(rigs::COLLECTION)?;
    hand(id, handedness).map(|hand| (*hand.rig).clone())
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
struct Pair {
    /// The object's id: the name of both without their extensions.
    id: String,
    /// The mesh's file name.
    mesh: String,
    /// The manifest's file name.
    toml: String,
    has_manifest: bool,
}

/// The extensions of meshes.
const MESHES: [&str; 5] = ["glb", "gltf", "obj", "ply", "stl"];

/// The extension of manifests.
const MANIFEST: &str = "toml";

/// All meshes of a folder with their manifests, sorted by name. An unreadable folder and a manifest without a mesh are problems.
///
/// Other files (pictures, material libraries, notes) are ignored, and so are names that start with a dot, which volumes
/// of container platforms contain.
fn pairs(path: &Path, maximum: usize, problems: &mut Problems) -> Vec<Pair> {
    let names = read_names(path, problems).unwrap_or_else(|error| {
        problems.add(
            "",
            format_args!("{error}; it must be a folder that the server may read"),
        );
        BTreeMap::new()
    });
    let count = names.len();
    if count > maximum {
        let limit = format_args!("it has {count} objects; the limit is cache_objects, {maximum}");
        problems.add("", limit);
        return Vec::new();
    }
    let mut pairs = Vec::new();
    for (id, extensions) in names {
        let toml = format!("{id}.{MANIFEST}");
        let meshes = MESHES.iter().filter(|mesh| extensions.contains(*mesh));
        let mut meshes = meshes.map(|extension| format!("{id}.{extension}"));
        let Some(mesh) = meshes.next() else {
            let all = MESHES.join(&format!(", {id}."));
            problems.add(toml, format_args!("has no mesh next to it: {id}.{all}"));
            continue;
        };
        for other in meshes {
            problems.add(
                other,
                format_args!("is a second mesh beside {mesh}; keep one of them"),
            );
        }
        pairs.push(Pair {
            has_manifest: extensions.contains(MANIFEST),
            id,
            mesh,
            toml,
        });
    }
    pairs
}

/// Names without extension, with the extensions found for each.
fn read_names(path: &Path, problems: &mut Problems) -> io::Result<BTreeMap<String, BTreeSet<&'static str>>> {
    let mut names: BTreeMap<String, BTreeSet<&str>> = BTreeMap::new();
    for entry in fs::read_dir(path)? {
        let name = entry?.file_name();
        let text = name.to_string_lossy();
        let Some((stem, extension)) = text.rsplit_once('.').filter(|_| !text.starts_with('.')) else {
            continue;
        };
        let mut known = MESHES.into_iter().chain([MANIFEST]);
        let Some(known) = known.find(|known| extension.eq_ignore_ascii_case(known)) else {
            continue;
        };
        if name.to_str().is_none() {
            problems.add(text, "has a name that is not UTF-8");
        } else if extension == known {
            names.entry(stem.to_owned()).or_default().insert(known);
        } else {
            // Only case-insensitive file systems would find it.
            problems.add(text, "has an extension in capitals; it must be in small letters");
        }
    }
    Ok(names)
}
