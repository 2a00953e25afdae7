//! Compiles the contract with protox, so that no protoc is needed.

use std::path::PathBuf;

use prost::Message as _;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let files = [
        "grasp/v1/geometry.proto",
        "grasp/v1/hand.proto",
        "grasp/v1/obstacle.proto",
        "grasp/v1/receiver.proto",
        "grasp/v1/constraints.proto",
        "grasp/v1/region.proto",
        "grasp/v1/known_grip.proto",
        "grasp/v1/object_service.proto",
        "grasp/v1/grasp_type.proto",
        "grasp/v1/grasp.proto",
        "grasp/v1/standing_grasp.proto",
        "grasp/v1/find_grasp.proto",
        "grasp/v1/stream_grasps.proto",
        "grasp/v1/track_holdout.proto",
        "grasp/v1/validate_grasp.proto",
        "grasp/v1/evaluate_holdout.proto",
        "grasp/v1/grasp_service.proto",
        "grasp/v1/hand_rig_service.proto",
    ];
    for file in files {
        println!("cargo::rerun-if-changed={file}");
    }
    let descriptors = protox::compile(files, ["."])?;
    let out = PathBuf::from(std::env::var("OUT_DIR")?);
    std::fs::write(out.join("grasp_descriptor.bin"), descriptors.encode_to_vec())?;
    tonic_prost_build::configure()
        // Sorted, so that equal messages have equal bytes.
        .btree_map(".")
        .codec_path("crate::codec::SliceCodec")
        .compile_fds(descriptors)?;
    Ok(())
}
