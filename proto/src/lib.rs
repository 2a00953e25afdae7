//! The contract of the grasp service, compiled from `proto/grasp/v1`.

mod answers;
pub mod codec;
#[cfg(feature = "json")]
pub mod json;
mod packed;
mod parts;
mod requests;
mod values;

pub use packed::PackedGraspError;
pub use parts::{MAX_DECODED_BESIDES, is_too_large_decoded};
pub use values::{JOINT_COUNT, code_name, std_duration, wire_duration};

/// Messages, clients and servers of package `grasp.v1`.
#[allow(missing_docs, clippy::large_enum_variant, clippy::pedantic, unreachable_pub)]
pub mod v1 {
    tonic::include_proto!("grasp.v1");
}

/// The descriptor set of `grasp.v1` and its imports, for server reflection.
pub const FILE_DESCRIPTOR_SET: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/grasp_descriptor.bin"));
