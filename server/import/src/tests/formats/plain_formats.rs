//! PLY and STL.

use crate::{
    Import, ImportError, MeshLimits, read_mesh,
    tests::formats::{LIMITS, message, read, solid::Ring},
};

fn ply(header: &str, body: &str) -> Vec<u8> {
    format!("ply\nformat ascii 1.0\n{header}end_header\n{body}").into_bytes()
}

const VERTICES: &str = "element vertex 4\nproperty double x\nproperty double y\nproperty double z\n";
const FACES: &str = "element face 1\nproperty list uchar uint vertex_index\n";
const SQUARE: &str = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n";

#[test]
fn polygons_are_split_and_other_elements_skipped() {
    let edges = "element edge 1\nproperty int vertex1\nproperty int vertex2\n";
    let bytes = ply(
        &format!("{VERTICES}{edges}{FACES}"),
        &format!("{SQUARE}0 1\n4 0 1 2 3\n"),
    );
    let read = read(&bytes).unwrap();
    assert_eq!(read.mesh.triangles().len(), 2);
    let area: f32 = (0..2)
        .map(|triangle| {
            let [a, b, c] = read.mesh.corners(triangle);
            0.5 * (b - a).cross(c - a).length()
        })
        .sum();
    assert_eq!(area, 1.0);
}

#[test]
fn faces_may_precede_vertices() {
    let bytes = ply(&format!("{FACES}{VERTICES}"), &format!("4 0 1 2 3\n{SQUARE}"));
    assert_eq!(read(&bytes).unwrap().mesh.triangles().len(), 2);
}

#[test]
fn what_is_no_mesh_of_faces_is_named() {
    for (bytes, expected) in [
        (
            ply(VERTICES, SQUARE),
            "has 4 vertices and no faces: a point cloud",
        ),
        (
            ply(
                &format!("{VERTICES}element tristrips 1\nproperty list int int vertex_indices\n"),
                SQUARE,
            ),
            "has triangle strips",
        ),
        (
            ply(
                &format!("{VERTICES}element face 1\nproperty list uchar int corners\n"),
                SQUARE,
            ),
            "has faces without a list",
        ),
        (
            ply(
                &format!("element vertex 4\nproperty float x\n{FACES}"),
                "0\n1\n2\n3\n3 0 1 2\n",
            ),
            "has no vertices with x, y and z",
        ),
        (
            ply(&format!("{VERTICES}{FACES}"), &format!("{SQUARE}3 0 1 4\n")),
            "face 0: vertex 4 does not exist",
        ),
        (
            ply(
                &format!("{VERTICES}element face 1\nproperty list uchar int vertex_index\n"),
                &format!("{SQUARE}3 0 1 -1\n"),
            ),
            "face 0: a vertex index is negative",
        ),
        (
            ply(&format!("{VERTICES}{FACES}"), SQUARE),
            "the PLY file: is cut off",
        ),
        (
            ply(
                &format!("{VERTICES}{FACES}"),
                &format!("0 0 zero\n{}3 0 1 2\n", &SQUARE[6..]),
            ),
            "line 10: \"zero\" is not a number",
        ),
        (
            ply(
                &format!("{VERTICES}{FACES}"),
                &format!("0 0 nan\n{}3 0 1 2\n", &SQUARE[6..]),
            ),
            "line 10: \"nan\" is not finite",
        ),
    ] {
        let message = message(&bytes);
        assert!(message.contains(expected), "{expected}: {message}");
    }
}

#[test]
fn every_wrong_face_is_named() {
    let faces = FACES.replace(" 1\n", " 3\n");
    let bytes = ply(
        &format!("{VERTICES}{faces}"),
        &format!("{SQUARE}3 0 1 4\n3 0 1 2\n3 9 1 2\n"),
    );
    let errors: Vec<String> = read(&bytes)
        .unwrap_err()
        .iter()
        .map(ToString::to_string)
        .collect();
    let expected = |face: usize, index: usize| {
        format!("face {face}: vertex {index} does not exist; there are 4, counted from 0")
    };
    assert_eq!(errors, [expected(0, 4), expected(2, 9)]);
}

#[test]
fn claims_beyond_the_file_are_refused_before_they_are_read() {
    let vertices = VERTICES.replace(" 4", " 18446744073709551615");
    assert!(message(&ply(&format!("{vertices}{FACES}"), SQUARE)).contains("more than the"));
    let nothing = format!("{VERTICES}{FACES}element nothing 9000000000000000000\n");
    let message = message(&ply(&nothing, &format!("{SQUARE}3 0 1 2\n")));
    assert!(
        message.contains("element \"nothing\" has no properties"),
        "{message}"
    );
}

#[test]
fn lines_end_as_they_like() {
    let unix = Ring::new().ply("ascii");
    let windows = String::from_utf8(unix.clone()).unwrap().replace('\n', "\r\n");
    let mac = String::from_utf8(unix.clone()).unwrap().replace('\n', "\r");
    let expected = read(&unix).unwrap();
    for text in [windows, mac] {
        assert_eq!(read(text.as_bytes()).unwrap().mesh, expected.mesh);
    }
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
        assert_eq!(
            read(&odd).unwrap().mesh.triangles().len(),
            expected.mesh.triangles().len()
        );
    }
}

#[test]
fn blank_lines_and_comments_in_the_body_are_skipped() {
    let body = format!(
        "\ncomment a square\n{}\n\n4 0 1 2 3\n\n",
        SQUARE.replace('\n', "\n \n")
    );
    let read = read(&ply(&format!("{VERTICES}{FACES}"), &body)).unwrap();
    assert_eq!(read.mesh.triangles().len(), 2);
    assert!(!read.warnings.iter().any(|warning| warning.contains("behind")));
}

#[test]
fn numbers_that_are_none_are_named_where_they_count() {
    let header = format!("{}{FACES}", VERTICES.replace("z\n", "z\nproperty float nx\n"));
    let with_normals = |x: &str, normal: &str| {
        let body = format!("{x} 0 0 {normal}\n1 0 0 0\n1 1 0 1e-3\n0 1 0 .5\n4 0 1 2 3\n");
        ply(&header, &body)
    };
    assert_eq!(
        read(&with_normals("0.", "nan")).unwrap().mesh.triangles().len(),
        2
    );
    let finite = "line 11: \"inf\" is not finite or makes the vertex infinite";
    assert_eq!(message(&with_normals("inf", "0")), finite);
    assert_eq!(
        message(&with_normals("1,5", "0")),
        "line 11: \"1,5\" is not a number"
    );
    let short = ply(
        &format!("{VERTICES}{FACES}"),
        "0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n",
    );
    assert_eq!(
        message(&short),
        "line 10: ends before \"z\" of element \"vertex\" is complete"
    );
}

#[test]
fn headers_that_cannot_be_read_are_named_by_line() {
    let floats = FACES.replace("uint", "float");
    let why = message(&ply(
        &format!("{VERTICES}{floats}"),
        &format!("{SQUARE}4 0 1 2 3\n"),
    ));
    assert!(why.contains("a list vertex_index of fractions"), "{why}");
    let odd = VERTICES.replace("double y", "decimal y");
    let why = message(&ply(&format!("{odd}{FACES}"), SQUARE));
    assert_eq!(
        why,
        "line 5: \"property decimal y\" is not understood in the header of a PLY file"
    );
    assert!(message(b"ply\nformat ascii 1.0\nelement vertex 4\n").contains("there is no line end_header"));
}

#[test]
fn what_follows_the_last_element_is_told() {
    let text = ply(
        &format!("{VERTICES}{FACES}"),
        &format!("{SQUARE}4 0 1 2 3\n1 2 3\n"),
    );
    let warnings = read(&text).unwrap().warnings;
    assert!(
        warnings.contains(&"1 lines behind the last element were ignored".to_owned()),
        "{warnings:?}"
    );
    let binary = [Ring::new().ply("binary_little_endian"), vec![0; 7]].concat();
    assert_eq!(
        read(&binary).unwrap().warnings,
        ["7 bytes behind the last element were ignored"]
    );
}

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
