//! Files that calls read and write.

use std::{
    fs,
    path::{Path, PathBuf},
};

/// An empty folder for one test, in cargo's folder for integration tests.
pub(crate) fn empty_folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    folder
}

/// A new file in a folder.
pub(crate) fn file(folder: &Path, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
    let path = folder.join(name);
    fs::write(&path, content).unwrap();
    path
}

/// A file is a picture.
#[track_caller]
pub(crate) fn assert_png(path: impl AsRef<Path>) {
    assert!(fs::read(path).unwrap().starts_with(b"\x89PNG\r\n\x1a\n"));
}

/// A file is a scene that mentions all of these.
#[track_caller]
pub(crate) fn assert_scene(path: impl AsRef<Path>, parts: &[&str]) {
    let scene = fs::read(path).unwrap();
    assert!(scene.starts_with(b"glTF"));
    for part in parts {
        let mut places = scene.windows(part.len());
        assert!(places.any(|bytes| bytes == part.as_bytes()), "{part}");
    }
}

/// The points of a node of a scene.
pub(crate) fn node_points(path: &Path, name: &str) -> Vec<[f32; 3]> {
    let gltf::Gltf { document, blob } = gltf::Gltf::open(path).unwrap();
    let blob = blob.unwrap();
    let node = document.nodes().find(|node| node.name() == Some(name)).unwrap();
    let mut points = Vec::new();
    for primitive in node.mesh().unwrap().primitives() {
        points.extend(primitive.reader(|_| Some(&blob)).read_positions().unwrap());
    }
    points
}
