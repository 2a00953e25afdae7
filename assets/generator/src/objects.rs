//! Scissors, scalpel and remote. To come.

/// To come.
pub fn generate() {}
