//! The rigs and skins of the hands. To come.

/// To come.
pub fn generate() {}
