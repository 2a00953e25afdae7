//! Every mesh file of the test data: what becomes of it, in which time, and in how much memory.

mod expected;

use std::{
    fs,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use crate::{ALLOCATOR, alone};
use expected::{Expected, FILES};
use grasp_import::{Import, MeshLimits, read_mesh};

/// Memory that reading may take at its peak, as a multiple of the file, and in any case: the OBJ parser keeps a hundred bytes
/// for some hundred faces.
const BYTES_PER_BYTE: usize = 6;
const BYTES_BESIDES: usize = 64 << 10;

/// Reached only if something hangs, even without optimisation on a busy machine.
const HANGS_AFTER: Duration = Duration::from_secs(20);

const LIMITS: MeshLimits = MeshLimits {
    bytes: 16 << 20,
    vertices: 200_000,
    triangles: 200_000,
};

#[test]
fn every_file_becomes_what_is_expected_in_bounded_time_and_memory() {
    let _alone = alone();
    let root = std::env::var_os("GRASP_TEST_DATA").map_or_else(
        || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data")),
        PathBuf::from,
    );
    let found = meshes(&root);
    if found.is_empty() {
        eprintln!(
            "SKIPPED: no test data in {}; GRASP_TEST_DATA names their folder",
            root.display()
        );
        return;
    }
    let unexpected = found
        .iter()
        .filter(|name| FILES.iter().all(|(known, _)| known != name));
    assert_eq!(
        unexpected.collect::<Vec<_>>(),
        Vec::<&String>::new(),
        "not in the table"
    );
    for (name, expected) in FILES {
        let Ok(bytes) = fs::read(root.join(name)) else {
            eprintln!("SKIPPED: {name} is not in {}", root.display());
            continue;
        };
        let before = ALLOCATOR.current_usage();
        ALLOCATOR.reset_peak_usage();
        let started = Instant::now();
        let read = read_mesh(&bytes, Import::METRES, LIMITS);
        let (time, peak) = (started.elapsed(), ALLOCATOR.peak_usage() - before);
        assert!(time < HANGS_AFTER, "{name}: {time:?}");
        assert!(
            peak <= BYTES_PER_BYTE * bytes.len() + BYTES_BESIDES,
            "{name}: {peak} bytes for {}",
            bytes.len()
        );
        let (found, expected) = match (&read, expected) {
            (Ok(read), Expected::Mesh(warnings)) => (read.warnings.clone(), *warnings),
            (Err(errors), Expected::Errors(errors_expected)) => {
                (errors.iter().map(ToString::to_string).collect(), *errors_expected)
            }
            (read, expected) => panic!("{name}: {expected:?}, not {read:?}"),
        };
        assert_eq!(found.len(), expected.len(), "{name}: {found:#?}");
        for (found, expected) in found.iter().zip(expected) {
            assert!(found.starts_with(expected), "{name}: {expected:?}, not {found:?}");
        }
    }
}

/// The paths of all mesh files of the folders that the table is about.
fn meshes(root: &Path) -> Vec<String> {
    let mut found = Vec::new();
    let mut folders = ["objects", "ugly", "reports"]
        .map(|folder| root.join(folder))
        .to_vec();
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).into_iter().flatten() {
            let path = entry.unwrap().path();
            let extension = path
                .extension()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned();
            if path.is_dir() {
                folders.push(path);
            } else if ["obj", "stl", "ply", "glb", "gltf"].contains(&extension.as_str()) {
                found.push(path.strip_prefix(root).unwrap().to_string_lossy().into_owned());
            }
        }
    }
    found.sort();
    found
}
