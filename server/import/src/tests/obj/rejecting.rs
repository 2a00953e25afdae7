//! Rejected text, and the messages.

use crate::{Import, ImportError, MeshLimits, read_mesh};

use crate::tests::obj::{CUBE, LIMITS, read};

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
