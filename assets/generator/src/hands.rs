//! The rigs and skins of the hands. To come.

use crate::AssetFile;

/// Rigs, skins and GLB files of the hands.
pub(crate) fn generate() -> Vec<AssetFile> {
    Vec::new()
}
