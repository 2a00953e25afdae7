//! STL as text and binary.

use crate::tests::formats::{LIMITS, message, read, solid::Ring};
use crate::{Import, ImportError, MeshLimits, read_mesh};

const FACET: &str =
    "FACET NORMAL 0 0 1\n OUTER LOOP\n  VERTEX 0 0 0\n  VERTEX 1 0 0\n  VERTEX 0 1 0\n ENDLOOP\nENDFACET\n";

#[test]
fn solids_of_text_are_groups() {
    let other = FACET.replace(" 0 0 0", " 0 0 1");
    let text = format!("\u{feff}SOLID Left Half\r\n{FACET}ENDSOLID\nsolid\n{other}endsolid\nremark\n");
    let read = read(text.as_bytes()).unwrap();
    assert_eq!(read.mesh.triangles().len(), 2);
    assert_eq!(read.groups, [("Left Half".to_owned(), vec![0])]);
    let ignored = "1 lines start with an unknown keyword and were ignored; the first is on line 19";
    assert!(
        read.warnings.iter().any(|warning| warning == ignored),
        "{:?}",
        read.warnings
    );
}

#[test]
fn wrong_facets_are_named_by_their_line() {
    for (wrong, right) in [
        ("VERTEX 1 0 0", "VERTEX 1 0"),
        ("VERTEX 1 0 0", "VERTEX 1 nan 0"),
        ("ENDLOOP", ""),
    ] {
        let text = format!("solid a\n{FACET}{}endsolid\n", FACET.replace(wrong, right));
        let message = message(text.as_bytes());
        assert!(message.starts_with("the STL facet on line 9: "), "{message}");
    }
    let cut = format!("solid a\n{FACET}{}", &FACET[..40]);
    assert!(message(cut.as_bytes()).starts_with("the STL facet on line 9: "));
}

#[test]
fn binary_files_have_the_triangles_that_they_claim() {
    let mut bytes = Ring::new().stl_binary();
    bytes.extend([7; 10]);
    let spare = read(&bytes).unwrap();
    assert_eq!(spare.warnings, ["10 bytes behind the last triangle were ignored"]);
    let cut = &Ring::new().stl_binary()[..1000];
    assert_eq!(
        message(cut),
        "the STL file: is cut off: it claims 1152 triangles and has 18"
    );
}

#[test]
fn other_bytes_with_a_number_in_that_place_are_no_stl() {
    // In UTF-16, any four bytes of text claim about two million triangles, or half a billion.
    let text =
        String::from_utf8(Ring::new().obj()).unwrap() + &"# a comment in a large file\n".repeat(40_000);
    for bytes in [
        text.encode_utf16()
            .flat_map(u16::to_le_bytes)
            .collect::<Vec<u8>>(),
        text.encode_utf16().flat_map(u16::to_be_bytes).collect(),
    ] {
        let marked = if bytes[0] == 0 { [0xFE, 0xFF] } else { [0xFF, 0xFE] };
        let found = read(&[marked.to_vec(), bytes].concat()).unwrap();
        assert_eq!(found.mesh.triangles().len(), 1152);
    }
}

#[test]
fn triangles_above_the_limit_are_refused_before_they_are_read() {
    let limits = MeshLimits {
        triangles: 1000,
        ..LIMITS
    };
    for bytes in [Ring::new().stl_binary(), Ring::new().stl_text()] {
        let errors = read_mesh(&bytes, Import::METRES, limits).unwrap_err();
        assert!(
            matches!(
                errors[..],
                [ImportError::TooMany {
                    what: "triangles",
                    limit: 1000,
                    ..
                }]
            ),
            "{errors:?}"
        );
    }
}

#[test]
fn lines_of_text_end_as_they_like() {
    let unix = Ring::new().stl_text();
    let expected = read(&unix).unwrap();
    for ending in ["\r\n", "\r"] {
        let text = String::from_utf8(unix.clone()).unwrap().replace('\n', ending);
        let read = read(text.as_bytes()).unwrap();
        assert_eq!((read.mesh, read.groups.len()), (expected.mesh.clone(), 1));
    }
}
