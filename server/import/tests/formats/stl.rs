//! STL as text and binary.

use crate::{LIMITS, message, read, solid::Ring};
use grasp_import::{Import, ImportError, MeshLimits, read_mesh};

const FACET: &str =
    "FACET NORMAL 0 0 1\n OUTER LOOP\n  VERTEX 0 0 0\n  VERTEX 1 0 0\n  VERTEX 0 1 0\n ENDLOOP\nENDFACET\n";

#[test]
fn solids_of_text_are_groups() {
    let other = FACET.replace(" 0 0 0", " 0 0 1");
    let text = format!("\u{feff}SOLID Left Half\r\n{FACET}ENDSOLID\nsolid\n{other}endsolid\nremark\n");
    let read = read(text.as_bytes()).unwrap();
    assert_eq!(read.mesh.triangles().len(), 2);
    assert_eq!(read.groups, [("Left Half".to_owned(), vec![0])]);
    let ignored = "1 lines are no statements of STL and were ignored; the first is on line 19";
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
        assert!(message.starts_with("the facet on line 9: "), "{message}");
    }
    let cut = format!("solid a\n{FACET}{}", &FACET[..40]);
    assert!(message(cut.as_bytes()).starts_with("the facet on line 9: "));
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
