//! Rejected text, its messages, and properties of any input.

use crate::{
    Import, ImportError, ImportedMesh, MeshLimits, read_mesh,
    tests::obj::{CUBE, LIMITS, read, reference},
};
use glam::DVec3;
use proptest::{
    collection::vec,
    prelude::*,
    test_runner::{RngAlgorithm, RngSeed},
};

fn messages(text: &str) -> Vec<String> {
    read(text)
        .expect_err("must be rejected")
        .iter()
        .map(ToString::to_string)
        .collect()
}

#[test]
fn rejects_text_without_triangles() {
    for text in ["", "\n", "# only a comment", "\\", "\u{feff}"] {
        assert_eq!(read(text).unwrap_err(), [ImportError::Blank], "{text:?}");
    }
    let empty = ImportError::Empty {
        dropped: 0,
        unknown: 0,
    };
    assert_eq!(read("v 0 0 0\n").unwrap_err(), [empty]);
    assert_eq!(
        messages("v 0 0 0\nv 1 0 0\nv 2 0 0\np 1\nf 1 2\nf 1 2 3\ncurv 0 1\n"),
        [
            "the mesh has no triangles; 3 points, lines and faces without area and 1 lines with an unknown keyword \
             were ignored"
        ]
    );
}

#[test]
fn rejects_coordinates_that_are_not_finite() {
    for bad in ["nan", "NaN", "inf", "-Infinity", "1e400"] {
        let errors = messages(&format!("v 0 {bad} 0\n{CUBE}"));
        assert_eq!(
            errors,
            [format!(
                "line 1: {bad:?} is not finite or makes the vertex infinite"
            )]
        );
    }
    for bad in ["1.#IND", "x", "1,5", "0x10", "--1", "1e"] {
        assert_eq!(
            messages(&format!("{CUBE}v 0 0 {bad}")),
            [format!("line 15: {bad:?} is not a number")]
        );
    }
    assert_eq!(
        messages(&format!("{CUBE}v 1 1 1 0"))[0],
        "line 15: \"0\" is not finite or makes the vertex infinite"
    );
    assert_eq!(
        messages(&format!("{CUBE}v 1e30 0 0"))[0],
        "line 15: a coordinate is 1000000000000000000000000000000 m from the origin; it must be at most 1000000000 m, is the \
         unit right?"
    );
}

#[test]
fn rejects_wrong_number_of_coordinates() {
    for (numbers, found) in [("", 0), ("1 2", 2), ("1 2 3 4 5", 5), ("1 2 3 4 5 6 7 8", 8)] {
        assert_eq!(
            read(&format!("v {numbers}\n{CUBE}")).unwrap_err(),
            [ImportError::NumberCount { line: 1, found }]
        );
    }
}

#[test]
fn rejects_bad_vertex_references() {
    let out_of_range = |index: i64| ImportError::IndexOutOfRange {
        line: 15,
        index,
        vertices: 8,
    };
    for index in [0, 9, -9, i64::MAX, i64::MIN] {
        let errors = read(&format!("{CUBE}f 1 2 {index}\n")).unwrap_err();
        assert_eq!(errors, [out_of_range(index)]);
    }
    for bad in ["x", "/1", "1/2/3/4", "1.5", "1/x", "99999999999999999999", "１"] {
        assert_eq!(
            read(&format!("{CUBE}f 1 2 {bad}\n")).unwrap_err(),
            [ImportError::NotAnIndex {
                line: 15,
                text: bad.to_owned()
            }]
        );
    }
}

#[test]
fn lists_sixteen_violations_and_counts_the_rest() {
    let errors = messages("v 0 0 nan\nv 0 0\nf 1 2 7\nf a 1 2\n");
    assert_eq!(
        errors,
        [
            "line 1: \"nan\" is not finite or makes the vertex infinite",
            "line 2: a vertex has 2 numbers; it must have 3, 4 with a weight, 6 with a colour, or 7 with a colour and \
             its alpha or a weight",
            "line 4: \"a\" is not a vertex reference; it must be an index, or up to three indices separated by /",
            "line 3: vertex 7 does not exist; 2 are known, counted from 1 or backward from -1",
        ]
    );
    let many = read(&"v x y z\n".repeat(100)).unwrap_err();
    assert_eq!(many.len(), 17);
    assert_eq!(many[16], ImportError::More(84));
}

#[test]
fn enforces_limits_exactly() {
    let limits = MeshLimits {
        bytes: CUBE.len(),
        vertices: 8,
        triangles: 12,
    };
    let read = |limits| read_mesh(CUBE.as_bytes(), Import::METRES, limits);
    assert!(read(limits).is_ok());
    assert_eq!(
        read(MeshLimits {
            bytes: CUBE.len() - 1,
            ..limits
        })
        .unwrap_err(),
        [ImportError::TooLong {
            bytes: CUBE.len(),
            limit: CUBE.len() - 1
        }]
    );
    assert_eq!(
        read(MeshLimits {
            vertices: 7,
            ..limits
        })
        .unwrap_err(),
        [ImportError::TooManyVertices { line: 8, limit: 7 }]
    );
    assert_eq!(
        read(MeshLimits {
            triangles: 11,
            ..limits
        })
        .unwrap_err(),
        [ImportError::TooManyTriangles { line: 14, limit: 11 }]
    );
}

#[test]
fn bounds_triangles_of_a_face_and_names_of_a_group() {
    let fan = format!("v 0 0 0\nv 1 0 0\nf{}\n", " 1 2".repeat(100));
    let limits = MeshLimits {
        triangles: 197,
        ..LIMITS
    };
    assert_eq!(
        read_mesh(fan.as_bytes(), Import::METRES, limits).unwrap_err(),
        [ImportError::TooManyTriangles { line: 3, limit: 197 }]
    );
    let names = format!("g{}\n{CUBE}", " a".repeat(17));
    assert_eq!(
        read(&names).unwrap_err(),
        [ImportError::TooManyNames { line: 1, found: 17 }]
    );
    assert!(read(&names.replacen(" a", "", 1)).is_ok());
}

#[test]
fn rejects_concave_polygon_of_too_many_corners() {
    let corners = 10_001;
    let teeth: Vec<_> = (0..corners)
        .map(|k| format!("v {k} {} 0\n", if k == 0 { 9 } else { k % 2 }))
        .collect();
    let face: Vec<_> = (1..=corners).map(|k| k.to_string()).collect();
    let text = format!("{}f {}\n", teeth.concat(), face.join(" "));
    let errors = read_mesh(text.as_bytes(), Import::with_unit(0.01), LIMITS).unwrap_err();
    let place = format!("on line {}", corners + 1);
    assert_eq!(errors, [ImportError::TooManyCorners { place, corners }]);
}

#[test]
fn rejects_unit_that_is_not_positive() {
    for unit in [0.0, -1.0, f32::INFINITY] {
        assert_eq!(
            read_mesh(CUBE.as_bytes(), Import::with_unit(unit), LIMITS).unwrap_err(),
            [ImportError::Unit(unit)]
        );
    }
    let nan = read_mesh(CUBE.as_bytes(), Import::with_unit(f32::NAN), LIMITS).unwrap_err();
    assert_eq!(
        nan[0].to_string(),
        "a unit of NaN m cannot be used; it must be finite and more than 0"
    );
}

#[test]
fn truncates_long_words_in_messages() {
    let errors = messages(&format!("v 0 0 {}\n", "9x".repeat(1000)));
    assert!(errors[0].len() < 80, "{}", errors[0]);
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
    let mut bits: Vec<_> = read
        .mesh
        .positions()
        .iter()
        .map(|position| position.to_array().map(f32::to_bits))
        .collect();
    bits.sort_unstable();
    bits.dedup();
    assert_eq!(bits.len(), read.mesh.positions().len(), "positions are welded");
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
            let corners: Vec<_> = corners
                .into_iter()
                .map(|corner| (if backward { corner - 21 } else { corner }).to_string())
                .collect();
            format!("f {}", corners.join(" "))
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
