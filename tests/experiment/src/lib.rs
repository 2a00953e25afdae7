//! The experiments of the thesis' chapter 5, run on the server's core.

pub mod atlases;
pub mod claims;
pub mod data;
pub mod figures;
pub mod folder;
pub mod machine;
pub mod make;
pub mod plan;
pub mod plot;
pub mod record;
pub mod report;
pub mod run;
pub mod sheet;
pub mod stats;
pub mod table;
pub mod tables;
#[cfg(test)]
mod tests;
pub mod thesis;
pub mod types;
