//! Files from elsewhere: built-in objects, scans, and files known to break readers.

use std::{
    fs,
    path::{Path, PathBuf},
};

use crate::{Import, ImportError, ImportedMesh, read_mesh};

use crate::tests::obj::{LIMITS, polygons, reference, volume};

/// The OBJ files of a folder of the test data, sorted by name; `None` if the data are missing.
fn data(folder: &str) -> Vec<(String, Vec<u8>)> {
    let root = std::env::var_os("GRASP_TEST_DATA").map_or_else(
        || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data")),
        PathBuf::from,
    );
    let Ok(entries) = fs::read_dir(root.join(folder)) else {
        eprintln!(
            "SKIPPED: no test data in {}; GRASP_TEST_DATA names their folder",
            root.display()
        );
        return Vec::new();
    };
    let mut files: Vec<_> = entries
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "obj"))
        .map(|path| {
            let name = path.file_stem().unwrap().to_string_lossy().into_owned();
            (name, fs::read(path).unwrap())
        })
        .collect();
    files.sort();
    files
}

#[test]
fn built_in_objects_agree_with_reference_reader_without_warnings() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/objects");
    for name in ["remote", "scalpel", "scissors"] {
        let text = fs::read_to_string(folder.join(name).with_extension("obj")).unwrap();
        reference::compare(&text, 1.0);
        let read = read_mesh(text.as_bytes(), Import::METRES, LIMITS).unwrap();
        assert_eq!(read.warnings, [""; 0], "{name}");
    }
}

#[test]
fn reads_real_objects_completely() {
    for (name, bytes) in data("objects") {
        let read =
            read_mesh(&bytes, Import::METRES, LIMITS).unwrap_or_else(|errors| panic!("{name}: {errors:?}"));
        reference::compare(std::str::from_utf8(&bytes).unwrap(), 1.0);
        // Between 1 cm³ and 2 l.
        let volume = volume(&read);
        assert!(
            (1e-6..2e-3).contains(&volume),
            "{name}: {volume} m³, {:?}",
            read.warnings
        );
    }
}

#[test]
fn reads_or_rejects_ugly_files_for_the_right_reason() {
    for (name, bytes) in data("ugly") {
        let result = read_mesh(&bytes, Import::METRES, LIMITS);
        match name.as_str() {
            "tinyobj_invalid-face-definition" | "tinyobj_line-prim" | "tinyobj_points-prim" => {
                assert!(
                    matches!(result.unwrap_err()[..], [ImportError::Empty { .. }]),
                    "{name}"
                );
            }
            "trimesh_empty" => assert_eq!(result.unwrap_err(), [ImportError::Blank], "{name}"),
            "trimesh_wallhole" => {
                // Its walls have holes, each reached over a side that is passed in both directions.
                let read = result.unwrap();
                polygons::assert_areas_match(&String::from_utf8_lossy(&bytes), &read);
                assert!(!read.warnings.iter().any(|warning| warning.contains("intersect")));
            }
            "tinyobj_invalid-relative-vertex-index" => {
                let errors = result.unwrap_err();
                assert_eq!(errors.len(), 3, "{name}: {errors:?}");
                let first = ImportError::IndexOutOfRange {
                    line: 1,
                    index: -4,
                    vertices: 0,
                };
                assert_eq!(errors[0], first, "{name}");
            }
            "tinyobj_issue-140-zero-face-idx" => {
                let errors = result.unwrap_err();
                let only = ImportError::IndexOutOfRange {
                    line: 16,
                    index: 0,
                    vertices: 4,
                };
                assert_eq!(errors, [only], "{name}");
            }
            "tinyobj_test-nan" => {
                let errors = result.unwrap_err();
                assert!(
                    matches!(errors[0], ImportError::NotFinite { line: 12, .. }),
                    "{name}: {errors:?}"
                );
            }
            _ => {
                let read = result.unwrap_or_else(|errors| panic!("{name}: {errors:?}"));
                reference::compare(&String::from_utf8_lossy(&bytes), 1.0);
                check_warnings(&name, &read);
            }
        }
    }
}

/// Known defects of some of them.
fn check_warnings(name: &str, read: &ImportedMesh) {
    let expected = match name {
        "trimesh_polygonfaces" | "tinyobj_leading-decimal-dot-issue-201" => "edges are open",
        _ => return,
    };
    assert!(
        read.warnings.iter().any(|warning| warning.contains(expected)),
        "{name}: {:?}",
        read.warnings
    );
}
