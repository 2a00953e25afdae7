//! Compiles the contract with protox, so that no protoc is needed.

use std::path::PathBuf;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let files = [
        "grasp/v1/holdout.proto",
        "grasp/v1/grasp_type.proto",
        "grasp/v1/search.proto",
        "grasp/v1/grasp.proto",
        "grasp/v1/track.proto",
        "grasp/v1/grasp_service.proto",
        "grasp/v1/object_service.proto",
        "grasp/v1/hand_rig_service.proto",
        "grasp/v1/error_reason.proto",
    ];
    for file in files {
        println!("cargo::rerun-if-changed={file}");
    }
    let mut compiler = protox::Compiler::new(["."])?;
    compiler.include_imports(true).open_files(files)?;
    let out = PathBuf::from(std::env::var("OUT_DIR")?);
    // Encoded by the compiler: decoded descriptors do not have the annotations of fields.
    std::fs::write(
        out.join("grasp_descriptor.bin"),
        compiler.encode_file_descriptor_set(),
    )?;
    let mut config = tonic_prost_build::Config::new();
    // For JSON, which looks messages up by their names.
    config.enable_type_names();
    tonic_prost_build::configure()
        // Sorted, so that equal messages have equal bytes.
        .btree_map(".")
        .codec_path("crate::codec::SliceCodec")
        .compile_fds_with_config(compiler.file_descriptor_set(), config)?;
    Ok(())
}
