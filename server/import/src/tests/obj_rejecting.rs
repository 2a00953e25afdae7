//! OBJ text that is rejected, bytes that are no mesh, and properties of any input.

use std::collections::HashSet;

use crate::{
    Import, ImportError, ImportedMesh, MeshLimits, read_mesh,
    tests::{CUBE, LIMITS, assert_mentioned, message, messages, read, reference},
};
use glam::DVec3;
use proptest::{
    collection::vec,
    prelude::*,
    test_runner::{RngAlgorithm, RngSeed},
};

#[test]
fn text_without_triangles_is_told_from_none() {
    for text in ["", "\n", "# only a comment", "\\", "\u{feff}"] {
        assert!(
            message(text).starts_with("the file is empty or has only"),
            "{text:?}"
        );
    }
    let text = "v 0 0 0\nv 1 0 0\nv 2 0 0\np 1\nf 1 2\nf 1 2 3\ncurv 0 1\n";
    let expected = "the mesh has no triangles; 3 points, lines and faces without area and 1 lines with an unknown keyword were ignored";
    assert_eq!(message(text), expected);
}

#[test]
fn wrong_lines_are_told_by_number_and_word() {
    let vertex = |words: &str, what: &str| (format!("v {words}"), what.to_owned());
    let not_finite = |word: &str| format!("{word:?} is not finite or makes the vertex infinite");
    let mut cases = vec![
        vertex("1 1 1 0", &not_finite("0")),
        vertex(
            "1e30 0 0",
            "a coordinate is 1000000000000000000000000000000 m from the origin; it must be at most 1000000000 m, is the unit right?",
        ),
    ];
    cases.extend(
        ["nan", "NaN", "inf", "-Infinity", "1e400"]
            .map(|word| vertex(&format!("0 {word} 0"), &not_finite(word))),
    );
    let odd = ["1.#IND", "x", "1,5", "0x10", "--1", "1e"];
    cases.extend(odd.map(|word| vertex(&format!("0 0 {word}"), &format!("{word:?} is not a number"))));
    for (numbers, found) in [("", 0), ("1 2", 2), ("1 2 3 4 5", 5), ("1 2 3 4 5 6 7 8", 8)] {
        let what =
            "it must have 3, 4 with a weight, 6 with a colour, or 7 with a colour and its alpha or a weight";
        cases.push(vertex(numbers, &format!("a vertex has {found} numbers; {what}")));
    }
    for index in [0, 9, -9, i64::MAX, i64::MIN] {
        let what = format!("vertex {index} does not exist; 8 are known, counted from 1 or backward from -1");
        cases.push((format!("f 1 2 {index}"), what));
    }
    for word in ["x", "/1", "1/2/3/4", "1.5", "1/x", "99999999999999999999", "１"] {
        let what = "is not a vertex reference; it must be an index, or up to three indices separated by /";
        cases.push((format!("f 1 2 {word}"), format!("{word:?} {what}")));
    }
    cases.push((
        format!("g{}", " a".repeat(17)),
        "17 group names; at most 16 are allowed".to_owned(),
    ));
    for (line, what) in cases {
        assert_eq!(message(format!("{CUBE}{line}\n")), format!("line 15: {what}"));
    }
    assert!(read(format!("g{}\n{CUBE}", " a".repeat(16))).is_ok());
    let long = message(format!("{CUBE}v 0 0 {}\n", "9x".repeat(1000)));
    assert!(long.len() < 80, "{long}");
}

#[test]
fn sixteen_violations_are_listed_and_the_rest_is_counted() {
    // References to vertices further down are checked at the end.
    let texts = messages(read("v 0 0 nan\nv 0 0\nf 1 2 7\nf a 1 2\n"));
    let lines: Vec<&str> = texts.iter().map(|message| &message[..7]).collect();
    assert_eq!(lines, ["line 1:", "line 2:", "line 4:", "line 3:"]);
    let many = read("v x y z\n".repeat(100)).unwrap_err();
    assert_eq!(many.len(), 17);
    assert_eq!(many[16], ImportError::More(84));
}

#[test]
fn limits_are_kept_exactly() {
    let limits = MeshLimits {
        bytes: CUBE.len(),
        vertices: 8,
        triangles: 12,
    };
    let read = |import, limits| read_mesh(CUBE.as_bytes(), import, limits);
    assert!(read(Import::METRES, limits).is_ok());
    let [mut small, mut sparse, mut coarse] = [limits; 3];
    small.bytes -= 1;
    sparse.vertices -= 1;
    coarse.triangles -= 1;
    let bytes = format!(
        "the file has {} bytes; at most {} are allowed",
        limits.bytes, small.bytes
    );
    for (limits, expected) in [
        (small, bytes.as_str()),
        (sparse, "line 8: the mesh has more than 7 vertices"),
        (coarse, "line 14: the mesh has more than 11 triangles"),
    ] {
        assert_eq!(messages(read(Import::METRES, limits)), [expected]);
    }
    for unit in [0.0, -1.0, f32::INFINITY, f32::NAN] {
        let expected = format!("a unit of {unit} m cannot be used; it must be finite and more than 0");
        assert_eq!(messages(read(Import::with_unit(unit), LIMITS)), [expected]);
    }
}

#[test]
fn concave_polygons_of_too_many_corners_are_refused() {
    let text = |corners: usize| {
        let teeth = (0..corners).map(|k| format!("v {k} {} 0\n", if k == 0 { 9 } else { k % 2 }));
        let face: Vec<_> = (1..=corners).map(|k| k.to_string()).collect();
        format!("{}f {}\n", teeth.collect::<String>(), face.join(" "))
    };
    let expected = "on line 10002: a polygon that is not convex has 10001 corners; at most 10000 are allowed, split it into triangles";
    assert_eq!(message(text(10_001)), expected);
}

#[test]
fn bytes_that_are_no_mesh_are_named() {
    let page = "\u{feff}<html><body>404</body></html>";
    let page: Vec<u8> = page.encode_utf16().flat_map(u16::to_le_bytes).collect();
    let data = b"\x01\x02\nIDAT\n\x03".repeat(10);
    let picture = [&b"\x89PNG\r\n\x1a\n"[..], &data, b"\nf \xFF\xFE\x01\nv\n"].concat();
    let cases: [(&[u8], &str); 15] = [
        (
            b"version https://git-lfs\noid sha256:4d7a\nsize 123\n",
            "a Git LFS pointer",
        ),
        (b"\n [1, 2, 3]", "JSON"),
        (b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", "OFF"),
        (b"Kaydara FBX Binary  \0\x1a\0", "FBX"),
        (b"<!DOCTYPE html><html><body>404 Not found</body></html>", "HTML"),
        (b"\xEF\xBB\xBF<HTML>\n<BODY>Sign in</BODY>", "HTML"),
        (b"<?xml version=\"1.0\"?>\n<COLLADA></COLLADA>", "COLLADA"),
        (b"PK\x03\x04\x14\0\0\0\x08\0mesh.obj", "ZIP"),
        (b"\xFF\xFE\0\0v\0\0\0", "UTF-32"),
        (b"newmtl steel\nKd 1 1 1\n", "material library"),
        (b"0 0 0\n1 0 0\n0 1 0\n", "some other text"),
        (b"\0\x01\x02\x03\x04", "binary data"),
        (b"404: Not Found", "some other text"),
        (&page, "HTML"),
        (&picture, "PNG"),
    ];
    for (bytes, name) in cases {
        assert_mentioned(&[message(bytes)], &["; this looks like ", name]);
    }
    assert!(message(cases[0].0).starts_with("none of the 3 lines begins with a word of OBJ (v, f, ...); "));
    // Accidental words of OBJ do not hide the format.
    assert!(message(&picture).starts_with("words of OBJ (v, f, ...) begin only 2 of the "));
}

#[test]
fn wrong_obj_text_keeps_its_own_errors() {
    // Whatever it begins with, most lines are statements.
    for start in ["OFF\n", "{\n", "<<<<<<< HEAD\n", "solid facet\n"] {
        let texts = message(format!("{start}{CUBE}f 1 2 99\n"));
        assert!(texts.starts_with("line 16: vertex 99 does not exist"), "{texts}");
    }
}

const SMALL: MeshLimits = MeshLimits {
    bytes: 4096,
    vertices: 200,
    triangles: 300,
};

fn config(cases: u32) -> ProptestConfig {
    ProptestConfig {
        cases,
        failure_persistence: None,
        rng_algorithm: RngAlgorithm::ChaCha,
        rng_seed: RngSeed::Fixed(0x0B1),
        ..ProptestConfig::default()
    }
}

/// Invariants of every accepted mesh.
fn assert_sound(read: &ImportedMesh, limits: MeshLimits) {
    let triangles = read.mesh.triangles().len();
    assert!((1..=limits.triangles).contains(&triangles));
    assert!(read.mesh.positions().len() <= limits.vertices);
    assert_eq!(read.indices_in_file.len(), triangles);
    assert!(read.indices_in_file.is_sorted_by(|a, b| a < b));
    assert!((read.indices_in_file[triangles - 1] as usize) < read.triangles_in_file);
    assert!(read.triangles_in_file <= limits.triangles);
    let positions = read.mesh.positions().iter();
    let different: HashSet<_> = positions
        .map(|position| position.to_array().map(f32::to_bits))
        .collect();
    assert_eq!(
        different.len(),
        read.mesh.positions().len(),
        "positions are welded"
    );
    assert!(read.groups.is_sorted_by(|(a, _), (b, _)| a < b));
    for (name, members) in &read.groups {
        assert!(!name.is_empty() && !members.is_empty());
        assert!(members.is_sorted_by(|a, b| a < b));
        assert!((members[members.len() - 1] as usize) < triangles);
    }
}

/// Almost valid lines.
fn statement() -> impl Strategy<Value = String> {
    let number = prop_oneof![
        8 => (-9..9_i32).prop_map(|n| n.to_string()),
        2 => any::<f32>().prop_map(|n| n.to_string()),
        1 => "[0-9.e+-]{0,8}",
        1 => prop::sample::select(vec!["nan", "inf", "1e400", "-0", "1e-45", "\\"]).prop_map(str::to_owned),
    ];
    let index = prop_oneof![
        8 => (-6..9_i64).prop_map(|n| n.to_string()),
        2 => (1..5_i64, any::<i8>()).prop_map(|(v, t)| format!("{v}/{t}/{v}")),
        1 => any::<i64>().prop_map(|n| n.to_string()),
        1 => "[0-9/-]{0,6}",
    ];
    prop_oneof![
        6 => vec(number, 2..5).prop_map(|numbers| format!("v {}", numbers.join(" "))),
        6 => vec(index, 1..7).prop_map(|corners| format!("f {}", corners.join(" "))),
        1 => "(g|o|usemtl|mtllib|vt|vn|p|l|s|#|curv)( [a-c]){0,3}",
    ]
}

/// A well-formed file with everything that reorders or drops triangles.
fn well_formed() -> impl Strategy<Value = String> {
    let name = || prop::sample::select(vec!["a", "b", "c", "d"]);
    // Any triangle of the first twelve vertices, or a convex polygon of the last eight.
    let corners = prop_oneof![
        vec(1..=12_i64, 3..4),
        (
            prop::sample::subsequence((13..=20).collect::<Vec<_>>(), 3..=8),
            any::<bool>()
        )
            .prop_map(|(mut corners, reversed)| {
                if reversed {
                    corners.reverse();
                }
                corners
            }),
    ];
    let line = prop_oneof![
        4 => (corners, any::<bool>()).prop_map(|(corners, backward)| {
            let offset = if backward { 21 } else { 0 };
            let corners = corners.into_iter().map(|corner| format!(" {}", corner - offset));
            format!("f{}", corners.collect::<String>())
        }),
        1 => name().prop_map(|name| format!("g {name}")),
        1 => (name(), name()).prop_map(|(a, b)| format!("g {a} {b}")),
        1 => name().prop_map(|name| format!("o {name}")),
        1 => name().prop_map(|name| format!("usemtl {name}")),
    ];
    (vec((-3..3_i32, -3..3_i32, -3..3_i32), 12), vec(line, 1..40)).prop_map(|(vertices, lines)| {
        let vertices = vertices.into_iter().map(|(x, y, z)| format!("v {x} {y} {z}"));
        let octagon = [
            (2, 1),
            (1, 2),
            (-1, 2),
            (-2, 1),
            (-2, -1),
            (-1, -2),
            (1, -2),
            (2, -1),
        ];
        let octagon = octagon.map(|(x, y)| format!("v {x} {y} {}", x - y));
        let text: Vec<String> = vertices.chain(octagon).chain(lines).collect();
        text.join("\n")
    })
}

proptest! {
    #![proptest_config(config(2000))]

    #[test]
    fn survives_arbitrary_bytes(bytes in vec(any::<u8>(), 0..600)) {
        if let Ok(read) = read_mesh(&bytes, Import::METRES, SMALL) {
            assert_sound(&read, SMALL);
        }
    }

    #[test]
    fn survives_almost_valid_text(lines in vec(statement(), 0..40), ending in "\n|\r|\r\n") {
        let text = lines.join(&ending);
        match read_mesh(text.as_bytes(), Import::METRES, SMALL) {
            Ok(read) => assert_sound(&read, SMALL),
            Err(errors) => prop_assert!((1..=17).contains(&errors.len())),
        }
    }

    #[test]
    fn survives_damaged_cube(edits in vec((any::<prop::sample::Index>(), any::<u8>()), 1..6), cut: prop::sample::Index) {
        let mut bytes = CUBE.as_bytes().to_vec();
        for (place, byte) in edits {
            let place = place.index(bytes.len());
            bytes[place] = byte;
        }
        bytes.truncate(cut.index(2 * bytes.len()));
        if let Ok(read) = read_mesh(&bytes, Import::METRES, SMALL) {
            assert_sound(&read, SMALL);
        }
    }

    #[test]
    fn agrees_with_reference_reader(text in well_formed(), unit in 0.001_f32..2.0) {
        let expected = reference::read(&text, unit, DVec3::ZERO);
        if expected.triangles.is_empty() {
            prop_assert!(read_mesh(text.as_bytes(), Import::with_unit(unit), SMALL).is_err());
        } else {
            reference::compare(&text, unit);
        }
    }
}
