//! The same solid in all formats, damaged files, and particulars of PLY and STL.

use crate::{
    Import, MeshLimits, UpAxis, read_mesh,
    tests::{LIMITS, Ring, assert_mentioned, corners, message, messages, read, volume},
};
use glam::DVec3;
use proptest::{
    prelude::*,
    test_runner::{Config, RngSeed, TestRunner},
};
use std::cell::Cell;

#[test]
fn all_formats_give_the_same_mesh() {
    let ring = Ring::new();
    let expected = read(ring.obj(false)).unwrap();
    assert!((volume(&expected) / Ring::volume() - 1.0).abs() < 1e-5);
    for (name, bytes) in [
        ("text STL", ring.stl_text()),
        ("binary STL", ring.stl_binary()),
        ("text PLY", ring.ply("ascii")),
        ("little-endian PLY", ring.ply("binary_little_endian")),
        ("big-endian PLY", ring.ply("binary_big_endian")),
        ("GLB", ring.glb("")),
    ] {
        let found = read(bytes).unwrap_or_else(|errors| panic!("{name}: {errors:?}"));
        assert_eq!(found.warnings, [""; 0], "{name}");
        assert_eq!(corners(&found), corners(&expected), "{name}");
        assert_eq!(
            found.mesh.positions().len(),
            expected.mesh.positions().len(),
            "{name}"
        );
    }
}

#[test]
fn every_format_keeps_shape_and_place_a_thousand_kilometres_away() {
    let place = [1e6, -2e6, 3.5e5];
    let ring = Ring::at(place, 24);
    for (format, bytes) in [
        ("OBJ", ring.obj(false)),
        ("STL", ring.stl_text()),
        ("PLY", ring.ply("ascii")),
        ("glTF", Ring::new().glb(r#","translation":[1e6,-2e6,3.5e5]"#)),
    ] {
        let found = read(bytes).unwrap();
        assert!((volume(&found) / Ring::volume() - 1.0).abs() < 1e-5, "{format}");
        for vertex in found.mesh.positions() {
            let vertex = vertex.as_dvec3() + found.origin_in_file;
            let places = ring.positions.iter().copied().map(DVec3::from_array);
            let distances = places.map(|other| other.distance(vertex));
            let nearest = distances.fold(f64::MAX, f64::min);
            assert!(nearest < 1e-8, "{format}: {nearest} m");
        }
        let [warning] = &found.warnings[..] else {
            panic!("{format}: {:?}", found.warnings)
        };
        assert!(warning.starts_with("the mesh is 2263"), "{warning}");
    }
}

#[test]
fn files_with_z_up_are_turned() {
    let import = Import {
        up_axis: UpAxis::Z,
        ..Import::with_unit(0.5)
    };
    let found = read_mesh(&Ring::new().stl_binary(), import, LIMITS).unwrap();
    assert!((volume(&found) / (Ring::volume() / 8.0) - 1.0).abs() < 1e-5);
    // The first vertex was (0.04, 0, 0), the ring's axis +Y: it is −Z now.
    let flat = found.mesh.positions().iter().map(|position| position.z.abs());
    assert!((flat.fold(0.0, f32::max) - 0.005).abs() < 1e-6);
}

#[test]
fn damaged_files_are_read_or_rejected() {
    let ring = Ring::new();
    let files = [
        ring.stl_text(),
        ring.stl_binary(),
        ring.ply("ascii"),
        ring.ply("binary_little_endian"),
        ring.ply("binary_big_endian"),
        ring.glb(r#","scale":[1,2,1]"#),
    ];
    let config = Config {
        cases: 600,
        rng_seed: RngSeed::Fixed(7),
        failure_persistence: None,
        ..Config::default()
    };
    // The file is cut, or bytes of it all or of its first 600, where headers are, are others.
    let damage = (
        0..files.len(),
        prop_oneof![Just(1.0), Just(1.0), 0.0..1.0],
        prop::collection::vec((0.0..1.0, any::<u8>()), 0..8),
        prop::collection::vec((0..600_usize, any::<u8>()), 0..3),
    );
    let (accepted, rejected) = (Cell::new(0), Cell::new(0));
    let outcome = TestRunner::new(config).run(&damage, |(file, left, bytes, header)| {
        let mut damaged = files[file].clone();
        let length = damaged.len() as f64;
        let places = bytes
            .iter()
            .map(|&(share, byte)| ((share * length) as usize, byte));
        for (place, byte) in places.chain(header) {
            damaged[place] = byte;
        }
        damaged.truncate((left * length) as usize);
        match read(&damaged) {
            Ok(_) => accepted.set(accepted.get() + 1),
            Err(errors) => {
                rejected.set(rejected.get() + 1);
                prop_assert!(!errors.is_empty() && errors.len() <= 17);
                prop_assert!(errors.iter().all(|error| error.to_string().len() < 2000));
            }
        }
        Ok(())
    });
    outcome.unwrap_or_else(|failure| panic!("{failure}"));
    assert!(
        accepted.get() > 50 && rejected.get() > 50,
        "{accepted:?} {rejected:?}"
    );
}

#[test]
fn lines_end_as_they_like() {
    for text in [Ring::new().ply("ascii"), Ring::new().stl_text()] {
        let expected = read(&text).unwrap();
        let text = String::from_utf8(text).unwrap();
        for ending in ["\r\n", "\r"] {
            let found = read(text.replace('\n', ending)).unwrap();
            assert_eq!(
                (&found.mesh, found.groups),
                (&expected.mesh, expected.groups.clone())
            );
        }
    }
    let expected = read(Ring::new().ply("ascii")).unwrap();
    for format in ["binary_little_endian", "binary_big_endian"] {
        let bytes = Ring::new().ply(format);
        let end = b"end_header\n";
        let start = bytes.windows(end.len()).position(|part| part == end).unwrap() + end.len();
        let header = str::from_utf8(&bytes[..start]).unwrap();
        for ending in ["\r", "\r\n"] {
            let changed = [header.replace('\n', ending).as_bytes(), &bytes[start..]].concat();
            assert_eq!(read(&changed).unwrap().mesh, expected.mesh);
        }
        // Behind carriage returns, a body may begin with the byte of a line feed.
        let mut odd = [header.replace('\n', "\r").as_bytes(), &bytes[start..]].concat();
        odd[start] = b'\n';
        assert_eq!(read(&odd).unwrap().triangles_in_file, expected.triangles_in_file);
    }
}

#[test]
fn triangles_above_the_limit_are_refused_before_they_are_read() {
    let limits = MeshLimits {
        triangles: 1000,
        ..LIMITS
    };
    for bytes in [Ring::new().stl_binary(), Ring::new().stl_text()] {
        let texts = messages(read_mesh(&bytes, Import::METRES, limits));
        assert_mentioned(&texts, &["triangles; at most 1000 are allowed"]);
    }
}

const VERTICES: &str = "element vertex 4\nproperty double x\nproperty double y\nproperty double z\n";
const FACES: &str = "element face 1\nproperty list uchar uint vertex_index\n";
const SQUARE: &str = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n";

fn ply(header: &str, body: &str) -> String {
    format!("ply\nformat ascii 1.0\n{header}end_header\n{body}")
}

/// A square by one face, with changed vertices and faces.
fn square(vertices: &str, face: &str) -> String {
    ply(&format!("{VERTICES}{FACES}"), &format!("{vertices}{face}\n"))
}

#[test]
fn ply_of_polygons_is_split_whatever_is_beside_them() {
    let edges = "element edge 1\nproperty int vertex1\nproperty int vertex2\n";
    let spaced = SQUARE.replace('\n', "\n \n");
    let with_edges = format!("{VERTICES}{edges}{FACES}");
    for text in [
        ply(&with_edges, &format!("{SQUARE}0 1\n4 0 1 2 3\n")),
        ply(&format!("{FACES}{VERTICES}"), &format!("4 0 1 2 3\n{SQUARE}")),
        square(&format!("\ncomment a square\n{spaced}"), "\n\n4 0 1 2 3\n"),
    ] {
        let found = read(&text).unwrap();
        assert_eq!(
            (found.mesh.triangles().len(), found.mesh.area()),
            (2, 1.0),
            "{text}"
        );
        assert!(
            !found.warnings.iter().any(|warning| warning.contains("behind")),
            "{text}"
        );
    }
}

#[test]
fn ply_that_cannot_be_read_is_told_by_its_place() {
    let refused = |vertices: &str, faces: &str, expected: &str| {
        let message = message(ply(&format!("{vertices}{faces}"), SQUARE));
        assert!(message.contains(expected), "{expected}: {message}");
    };
    let strips = "element tristrips 1\nproperty list int int vertex_indices\n";
    let corners = FACES.replace("vertex_index", "corners");
    let [heights, decimals] = ["double height", "decimal y"].map(|other| VERTICES.replace("double y", other));
    let endless = VERTICES.replace(" 4", " 18446744073709551615");
    let nothing = format!("{FACES}element nothing 9000000000000000000\n");
    refused(VERTICES, "", "has 4 vertices and no faces: a point cloud");
    refused(VERTICES, strips, "has triangle strips");
    refused(VERTICES, &corners, "has faces without a list");
    refused(
        VERTICES,
        &FACES.replace("uint", "float"),
        "a list vertex_index of fractions",
    );
    refused(&heights, FACES, "has no vertices with x, y and z");
    refused(
        &decimals,
        FACES,
        "line 5: \"property decimal y\" is not understood",
    );
    refused(&endless, FACES, "more than the");
    let splats = format!("{VERTICES}{}", "property float f\n".repeat(1024));
    refused(&splats, FACES, "has more than 1024 properties");
    refused(VERTICES, &nothing, "element \"nothing\" has no properties");
    let headless = message("ply\nformat ascii 1.0\nelement vertex 4\n");
    assert!(headless.contains("there is no line end_header"), "{headless}");
    for (vertices, face, expected) in [
        (SQUARE, "3 0 1 -1", "face 0: a vertex index is negative"),
        (SQUARE, "", "the PLY file: is cut off"),
        ("nan 0 0\n", "", "line 10: \"nan\" is not finite"),
        (
            "0 0\n",
            "",
            "line 10: ends before \"z\" of element \"vertex\" is complete",
        ),
    ] {
        let rest = if vertices == SQUARE {
            ""
        } else {
            "0 1 0\n0 0 1\n1 0 0\n3 0 1 2"
        };
        let message = message(square(vertices, &format!("{face}{rest}")));
        assert!(message.contains(expected), "{expected}: {message}");
    }
    let faces = FACES.replace(" 1\n", " 3\n");
    let body = format!("{SQUARE}3 0 1 4\n3 0 1 2\n3 9 1 2\n");
    let texts = messages(read(ply(&format!("{VERTICES}{faces}"), &body)));
    let expected = [(0, 4), (2, 9)].map(|(face, index)| {
        format!("face {face}: vertex {index} does not exist; there are 4, counted from 0")
    });
    assert_eq!(texts, expected);
}

#[test]
fn ply_numbers_that_do_not_count_may_be_anything() {
    let header = format!("{}{FACES}", VERTICES.replace("z\n", "z\nproperty float nx\n"));
    let text = ply(&header, "0. 0 0 nan\n1 0 0 0\n1 1 0 1e-3\n0 1 0 .5\n4 0 1 2 3\n");
    assert_eq!(read(text).unwrap().mesh.triangles().len(), 2);
}

#[test]
fn bytes_behind_the_end_are_told() {
    let binary = [Ring::new().ply("binary_little_endian"), vec![0; 7]].concat();
    let stl = [Ring::new().stl_binary(), vec![7; 10]].concat();
    for (bytes, expected) in [
        (
            square(SQUARE, "4 0 1 2 3\n1 2 3").into_bytes(),
            "1 lines behind the last element were ignored",
        ),
        (binary, "7 bytes behind the last element were ignored"),
        (stl, "10 bytes behind the last triangle were ignored"),
    ] {
        assert_mentioned(&read(bytes).unwrap().warnings, &[expected]);
    }
    assert_eq!(
        message(&Ring::new().stl_binary()[..1000]),
        "the STL file: is cut off: it claims 1152 triangles and has 18"
    );
}

const FACET: &str =
    "FACET NORMAL 0 0 1\n OUTER LOOP\n  VERTEX 0 0 0\n  VERTEX 1 0 0\n  VERTEX 0 1 0\n ENDLOOP\nENDFACET\n";

#[test]
fn solids_of_stl_text_are_groups() {
    let other = FACET.replace(" 0 0 0", " 0 0 1");
    let text = format!("\u{feff}SOLID Left Half\r\n{FACET}ENDSOLID\nsolid\n{other}endsolid\nremark\n");
    let read = read(text).unwrap();
    assert_eq!(read.mesh.triangles().len(), 2);
    assert_eq!(read.groups, [("Left Half".to_owned(), vec![0])]);
    let ignored = "1 lines start with an unknown keyword and were ignored; the first is on line 19";
    assert_mentioned(&read.warnings, &[ignored]);
}

#[test]
fn wrong_facets_are_told_by_their_line() {
    let cut = FACET[..40].to_owned();
    for second in [
        FACET.replace("VERTEX 1 0 0", "VERTEX 1 0"),
        FACET.replace("VERTEX 1 0 0", "VERTEX 1 nan 0"),
        FACET.replace("ENDLOOP", ""),
        cut,
    ] {
        let texts = message(format!("solid a\n{FACET}{second}endsolid\n"));
        assert!(texts.starts_with("the STL facet on line 9: "), "{texts}");
    }
}

#[test]
fn other_bytes_with_a_number_in_that_place_are_no_stl() {
    // In UTF-16, any four bytes of text claim about two million triangles, or half a billion.
    let comments = "# a comment in a large file\n".repeat(40_000);
    let text = String::from_utf8(Ring::new().obj(false)).unwrap() + &comments;
    for unit in [u16::to_le_bytes, u16::to_be_bytes] {
        let bytes: Vec<u8> = format!("\u{feff}{text}").encode_utf16().flat_map(unit).collect();
        assert_eq!(read(bytes).unwrap().mesh.triangles().len(), 1152);
    }
}
