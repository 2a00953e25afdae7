//! Real objects, if the shared test data are there.

use std::{env, fs, path::PathBuf};

use glam::Vec3;
use grasp_synthesis::geometry::mesh::TriangleMesh;

/// The folder of objects: under `GRASP_TEST_DATA`, or under `shared/data` next to the repository.
fn folder() -> PathBuf {
    let root = env::var_os("GRASP_TEST_DATA").map_or_else(
        || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data")),
        PathBuf::from,
    );
    root.join("objects")
}

/// Every readable object by name; says so if there are none.
pub(crate) fn objects() -> Vec<(String, TriangleMesh)> {
    let Ok(entries) = fs::read_dir(folder()) else {
        eprintln!("skipped: no real objects in {}", folder().display());
        return Vec::new();
    };
    let mut paths: Vec<PathBuf> = entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.extension().is_some_and(|extension| extension == "obj"))
        .collect();
    paths.sort();
    paths
        .into_iter()
        .map(|path| {
            let text = fs::read_to_string(&path).expect("the object is readable");
            (path.display().to_string(), parse(&text))
        })
        .collect()
}

/// Positions and faces of an OBJ file; faces of more corners as fans.
fn parse(text: &str) -> TriangleMesh {
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    for line in text.lines() {
        let mut words = line.split_ascii_whitespace();
        match words.next() {
            Some("v") => {
                let numbers: Vec<f32> = words.filter_map(|word| word.parse().ok()).collect();
                positions.push(Vec3::from_slice(&numbers));
            }
            Some("f") => {
                let corners: Vec<u32> = words
                    .filter_map(|word| word.split('/').next()?.parse::<u32>().ok())
                    .map(|index| index - 1)
                    .collect();
                triangles.extend((1..corners.len() - 1).map(|i| [corners[0], corners[i], corners[i + 1]]));
            }
            _ => {}
        }
    }
    TriangleMesh::without_degenerates(positions, &triangles).expect("the object has triangles")
}
