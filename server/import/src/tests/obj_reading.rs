//! OBJ text that is read: vertices, faces, names, warnings, and files from elsewhere.

use std::{
    fs,
    path::{Path, PathBuf},
};

use crate::{
    ImportedMesh,
    tests::{CUBE, Ring, assert_mentioned, read, reference, volume},
};
use glam::Vec3;

#[test]
fn negative_indices_count_back_from_their_line() {
    let early = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 0 0 1\nf -4 -1 -3\n";
    let plain = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nv 0 0 1\nf 1 4 2\n";
    assert_eq!(read(early).unwrap().mesh, read(plain).unwrap().mesh);
}

#[test]
fn thousands_of_faces_may_be_before_their_vertices() {
    let text = String::from_utf8(Ring::at([0.0; 3], 48).obj(true)).unwrap();
    let (vertices, faces) = text.split_at(text.find('f').unwrap());
    let plain = read(&text).unwrap().mesh;
    assert_eq!(plain.triangles().len(), 2 * 48 * 48);
    assert_eq!(read([faces, vertices].concat()).unwrap().mesh, plain);
}

#[test]
fn ignores_line_endings_continuations_and_comments() {
    let plain = read(CUBE).unwrap().mesh;
    for text in [
        CUBE.replace('\n', "\r\n"),
        CUBE.replace('\n', "\r"),
        CUBE.replace("f 4 3 2 1", "f 4 3 \\\n2 1"),
        CUBE.replace("f 4 3 2 1", "f 4 3 \\\r\n2 1 # below"),
        CUBE.replace("v ", "  v\t"),
        CUBE.replace("f 4 3 2 1", "# in C:\\cubes\\\nf 4 3 2 1 # of C:\\"),
        CUBE.replace("f 4 3 2 1", "# in C:\\cubes\\\r\nf 4 3 2 \\\r\n1"),
        format!("\u{feff}# a cube\n\n{CUBE}"),
        CUBE.trim_end().to_owned(),
    ] {
        assert_eq!(read(&text).unwrap().mesh, plain, "{text:?}");
    }
}

#[test]
fn reads_utf16_like_utf8() {
    let text = format!("# café 🙂\ng café\n{CUBE}");
    let plain = read(&text).unwrap();
    for unit in [u16::to_le_bytes, u16::to_be_bytes] {
        for mark in ["\u{feff}", ""] {
            let bytes: Vec<u8> = format!("{mark}{text}").encode_utf16().flat_map(unit).collect();
            let found = read(bytes).unwrap();
            assert_eq!((&found.mesh, &found.groups), (&plain.mesh, &plain.groups));
            let unmarked = mark
                .is_empty()
                .then_some("the text is UTF-16 without a byte order mark");
            assert_eq!(found.warnings, unmarked.as_slice());
        }
    }
}

#[test]
fn replaces_invalid_utf8_in_names() {
    let cube = read([b"# caf\xE9\ng caf\xE9\n", CUBE.as_bytes()].concat()).unwrap();
    assert_eq!(cube.groups, [("caf\u{fffd}".to_owned(), (0..12).collect())]);
}

#[test]
fn ignores_texture_coordinates_and_normals() {
    for face in
        "f 1/1 2/2 3/3|f 1//9 2//9 3//9|f 1/1/1 2/1/1 3/1/1|f 1// 2// 3//|f 1/0/-5 2/0/-5 3/0/-5".split('|')
    {
        let text = format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt oh no\n{face}\n");
        assert_eq!(read(text).unwrap().mesh.triangles(), [[0, 1, 2]], "{face}");
    }
}

#[test]
fn opens_no_material_files() {
    let libraries = "mtllib /etc/passwd\nmtllib ../../x.mtl\nusemtl steel blue";
    let cube = read(format!("{libraries}\n{CUBE}")).unwrap();
    assert_eq!(cube.warnings, [""; 0]);
    assert_eq!(cube.groups, [("steel blue".to_owned(), (0..12).collect())]);
}

#[test]
fn groups_objects_and_materials_apply_until_replaced() {
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv 1 1 1
        f 1 3 2\ng a b\nf 1 2 4\no thing\nusemtl red\nf 2 3 4\ng\nusemtl blue\no other thing\nf 3 1 4\ng b\nf 3 1 4 5\n";
    let read = read(text).unwrap();
    // Triangle 4 of the file repeats triangle 3 and is dropped; 5 becomes 4.
    let expected = [
        ("a", vec![1, 2]),
        ("b", vec![1, 2, 4]),
        ("blue", vec![3, 4]),
        ("other thing", vec![3, 4]),
        ("red", vec![2]),
        ("thing", vec![2]),
    ];
    assert_eq!(
        read.groups,
        expected.map(|(name, triangles)| (name.to_owned(), triangles))
    );
    assert_eq!(read.indices_in_file, [0, 1, 2, 3, 5]);
    assert_eq!(read.triangles_in_file, 6);
}

#[test]
fn welds_equal_positions_including_signed_zeros() {
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nv 1 0 -0\nv -0 0 -0.0\nv 0 0 1\nf 4 5 6\n";
    let read = read(text).unwrap();
    assert_eq!(read.mesh.positions().len(), 4);
    assert_eq!(read.mesh.triangles(), [[0, 1, 2], [1, 0, 3]]);
}

#[test]
fn odd_lines_and_elements_are_told_with_the_first_line() {
    let ending = "p 1\nl 1 2\nf 1 2\nf 1\nf 1 1 2\nf 1 2 1\nv 3 3 3\nv 4 4 4\nv 5 5 5\nf 9 10 11\nv 9 9 9\ncurv 0 1\nwhat is this\n";
    let found = read(format!("{CUBE}{ending}")).unwrap();
    assert_eq!(found.mesh.triangles().len(), 12);
    assert_eq!(
        found.warnings[..4],
        [
            "2 lines start with an unknown keyword and were ignored; the first is on line 26",
            "4 points, lines and faces with fewer than three corners were dropped; the first is on line 15",
            "3 triangles without area were dropped; the first is on line 19",
            "1 vertices are not used by any face",
        ]
    );
    let fin = read(format!("{CUBE}v 0 0 9\nf 1 2 9\n")).unwrap().warnings;
    let crowded = "1 edges join more than two triangles; the first is at the face on line 9";
    assert_mentioned(&fin, &[crowded]);
}

/// A right triangle with legs of 2 and 1, each corner followed by more numbers.
fn triangle(extras: [&str; 3]) -> ImportedMesh {
    let [a, b, c] = extras;
    read(format!("v 0 0 0 {a}\nv 2 0 0 {b}\nv 0 1 0 {c}\nf 1 2 3\n")).unwrap()
}

#[test]
fn colours_change_nothing_and_weights_divide() {
    let plain = triangle([""; 3]);
    let ambiguous = "3 vertices have seven numbers, read as x y z and a colour with alpha, not as x y z and a weight and a colour; \
                     the first is on line 1";
    for (extras, warning) in [
        (["1 0 0", "0.5 0.5 0.5", "nan nan nan"], None),
        (["1", "1", "1 0.5 0.5 0.5"], None),
        (["1 0.5 0.5 0.5", "1 0.1 0.1 0.1", "1 200 100 0"], None),
        (
            ["0.5 0.2 0.8 1", "0.25 0.4 0.3 1", "0.9 0.9 0.9 1"],
            Some(ambiguous),
        ),
        (
            ["128 64 32 255", "30 64 32 255", "255 64 32 255"],
            Some(ambiguous),
        ),
    ] {
        let coloured = triangle(extras);
        assert_eq!(coloured.mesh, plain.mesh, "{extras:?}");
        let more = coloured.warnings.len() - plain.warnings.len();
        assert_eq!(coloured.warnings[..more], warning.as_slice()[..], "{extras:?}");
    }
    let weighted = triangle(["2", "2", ""]);
    assert_eq!(weighted.mesh.corners(0)[1], Vec3::new(1.0, 0.0, 0.0));
    assert_eq!(
        weighted.warnings[0],
        "2 vertices have a weight other than 1, by which their coordinates were divided; the first is on line 1"
    );
}

/// The OBJ files of a folder of the test data, sorted; empty without the data.
fn data(folder: &str) -> Vec<PathBuf> {
    let root = std::env::var_os("GRASP_TEST_DATA").map_or_else(
        || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data")),
        PathBuf::from,
    );
    let Ok(entries) = fs::read_dir(root.join(folder)) else {
        let root = root.display();
        eprintln!("SKIPPED: no test data in {root}; GRASP_TEST_DATA names their folder");
        return Vec::new();
    };
    let paths = entries.map(|entry| entry.unwrap().path());
    let is_obj = |path: &PathBuf| path.extension().is_some_and(|extension| extension == "obj");
    let mut files: Vec<_> = paths.filter(is_obj).collect();
    files.sort();
    files
}

#[test]
fn files_from_elsewhere_agree_with_the_reference_reader() {
    let built_in = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/objects");
    let built_in = ["remote", "scalpel", "scissors"].map(|name| built_in.join(name).with_extension("obj"));
    for path in built_in.into_iter().chain(data("objects")).chain(data("ugly")) {
        let bytes = fs::read(&path).unwrap();
        let is_ugly = path.parent().is_some_and(|folder| folder.ends_with("ugly"));
        match read(&bytes) {
            // Which are rejected or have holes, and why, is checked where all files are.
            Err(errors) => assert!(is_ugly, "{}: {errors:?}", path.display()),
            Ok(_) if path.ends_with("trimesh_wallhole.obj") => {}
            Ok(read) => {
                reference::compare(&String::from_utf8_lossy(&bytes), 1.0);
                // Between 1 cm³ and 2 l.
                let volume = volume(&read);
                let is_usual = (1e-6..2e-3).contains(&volume);
                assert!(is_ugly || is_usual, "{}: {volume} m³", path.display());
            }
        }
    }
}
