//! The objects of a folder for programs that register them, manifests or not.

use std::path::{Path, PathBuf};

use grasp_proto::v1;

use super::{
    DirectoryProblem,
    manifest::read_manifest,
    pairs::{Manifests, pairs},
    problems_of, read_bounded,
};
use crate::{limits::BYTES_BESIDES_MESH, validate::Violations};

/// A mesh of a folder.
#[derive(Clone, Debug, PartialEq)]
pub struct FolderObject {
    /// The mesh file.
    pub mesh: PathBuf,
    /// What the manifest next to it says of the object, as yet unchecked. None if there is no manifest.
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
