//! Reads meshes from untrusted bytes.
//!
//! One module per format. Each reader is given [`MeshLimits`] and keeps to them:
//! - Memory stays proportional to the bytes within the limits, whatever counts and sizes the file claims.
//! - No file is opened and no network is used: references to other files are ignored.
//! - Every violation is reported with its place in the file, up to a bounded number; nothing panics.
//!
//! What a reader accepts is welded and checked: see [`obj::ObjMesh`].

mod ears;
mod edges;
mod limits;
pub mod obj;
mod polygon;
mod weld;

pub use limits::{MAX_COORDINATE_METRES, MeshLimits};
