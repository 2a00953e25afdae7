//! Scissors, scalpel and remote. To come.

use crate::AssetFile;

/// Meshes and manifests of the objects.
pub(crate) fn generate() -> Vec<AssetFile> {
    Vec::new()
}
