//! The 15 holdouts. To come.

use crate::AssetFile;

/// The holdouts.
pub(crate) fn generate() -> Vec<AssetFile> {
    Vec::new()
}
