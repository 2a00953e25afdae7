//! PLY as text and binary.

use crate::tests::formats::{message, read};

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
        (ply(&format!("{VERTICES}{FACES}"), SQUARE), "the PLY file: "),
        (ply(&format!("{VERTICES}{FACES}"), "0 0 zero\n"), "the PLY file: "),
        (
            ply(
                &format!("{VERTICES}{FACES}"),
                &format!("0 0 nan\n{}3 0 1 2\n", &SQUARE[6..]),
            ),
            "the PLY file: Line 10: Couldn't read element line.",
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
