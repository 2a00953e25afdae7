//! Accepted text, its vertices and warnings, and bytes that are no mesh.

use crate::{
    Import, ImportError, ImportedMesh, read_mesh,
    tests::obj::{CUBE, LIMITS, read, volume},
};
use glam::Vec3;

#[test]
fn clean_cube_raises_no_warning() {
    let cube = read(CUBE).unwrap();
    assert_eq!(cube.mesh.positions().len(), 8);
    assert_eq!(cube.mesh.triangles().len(), 12);
    assert_eq!(cube.warnings, [""; 0]);
    assert_eq!(cube.groups, []);
    assert!((volume(&cube) - 8.0).abs() < 1e-9);
}

#[test]
fn splits_polygons_into_fans_from_first_corner() {
    let pentagon = read("v 0 0 0\nv 2 0 0\nv 3 1 0\nv 1 2 0\nv -1 1 0\nf 2 3 4 5 1\n").unwrap();
    let corner = [(2, 0), (3, 1), (1, 2), (-1, 1), (0, 0)].map(|(x, y)| Vec3::new(x as f32, y as f32, 0.0));
    let corners: Vec<_> = (0..3).map(|t| pentagon.mesh.corners(t)).collect();
    assert_eq!(corners, [1, 2, 3].map(|k| [corner[0], corner[k], corner[k + 1]]));
}

#[test]
fn scales_coordinates_to_metres() {
    let cube = read_mesh(CUBE.as_bytes(), Import::with_unit(0.01), LIMITS).unwrap();
    assert!((volume(&cube) - 8e-6).abs() < 1e-12);
}

#[test]
fn negative_indices_count_back_from_their_line() {
    let early = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 0 0 1\nf -4 -1 -3\n";
    let plain = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nv 0 0 1\nf 1 4 2\n";
    assert_eq!(read(early).unwrap().mesh, read(plain).unwrap().mesh);
}

#[test]
fn accepts_faces_before_their_vertices() {
    let text: Vec<_> = CUBE.lines().rev().collect();
    let cube = read(&text.join("\n")).unwrap();
    // Vertices and faces are reversed, but the indices are not: vertex k became 9 − k, which mirrors the cube in all
    // three axes and turns it inside out.
    assert!((volume(&cube).abs() - 8.0).abs() < 1e-9);
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
    let text = format!("# café\ng café\n{CUBE}");
    let plain = read(&text).unwrap();
    let encoded = |mark: &str, unit: fn(u16) -> [u8; 2]| -> Vec<u8> {
        format!("{mark}{text}").encode_utf16().flat_map(unit).collect()
    };
    for unit in [u16::to_le_bytes, u16::to_be_bytes] {
        let marked = read_mesh(&encoded("\u{feff}", unit), Import::METRES, LIMITS).unwrap();
        assert_eq!(marked.mesh, plain.mesh);
        assert_eq!(marked.groups, plain.groups);
        assert_eq!(marked.warnings, [""; 0]);
        let unmarked = read_mesh(&encoded("", unit), Import::METRES, LIMITS).unwrap();
        assert_eq!(unmarked.mesh, plain.mesh);
        assert_eq!(
            unmarked.warnings,
            ["the text is UTF-16 without a byte order mark"]
        );
    }
}

#[test]
fn backslash_in_name_swallows_no_statement() {
    let text = format!("mtllib C:\\\n{}", CUBE.replace("f 4", "usemtl parts\\\nf 4"));
    let cube = read(&text).unwrap();
    assert_eq!(cube.mesh, read(CUBE).unwrap().mesh);
    assert_eq!(cube.groups, [("parts\\".to_owned(), (0..12).collect())]);
}

#[test]
fn replaces_invalid_utf8_in_names() {
    let mut text = b"# caf\xE9\ng caf\xE9\n".to_vec();
    text.extend_from_slice(CUBE.as_bytes());
    let cube = read_mesh(&text, Import::METRES, LIMITS).unwrap();
    assert_eq!(cube.groups.len(), 1);
    assert_eq!(cube.groups[0].0, "caf\u{fffd}");
}

#[test]
fn ignores_texture_coordinates_and_normals() {
    for face in [
        "f 1/1 2/2 3/3",
        "f 1//9 2//9 3//9",
        "f 1/1/1 2/1/1 3/1/1",
        "f 1// 2// 3//",
        "f 1/0/-5 2/0/-5 3/0/-5",
    ] {
        let text = format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt oh no\n{face}\n");
        assert_eq!(read(&text).unwrap().mesh.triangles(), [[0, 1, 2]], "{face}");
    }
}

#[test]
fn opens_no_material_files() {
    let cube = read(&format!(
        "mtllib /etc/passwd\nmtllib ../../x.mtl\nusemtl steel blue\n{CUBE}"
    ))
    .unwrap();
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
fn drops_degenerate_elements_and_reports_their_line() {
    let text =
        format!("{CUBE}p 1\nl 1 2\nf 1 2\nf 1\nf 1 1 2\nf 1 2 1\nv 3 3 3\nv 4 4 4\nv 5 5 5\nf 9 10 11\n");
    let read = read(&text).unwrap();
    assert_eq!(read.mesh.triangles().len(), 12);
    assert!(
        read.warnings.contains(
            &"4 points, lines and faces with fewer than three corners were dropped; the first is on line 15"
                .into()
        )
    );
    assert!(
        read.warnings
            .contains(&"3 triangles without area were dropped; the first is on line 19".into())
    );
}

#[test]
fn keeps_one_of_triangles_that_repeat_with_either_winding() {
    let sheet = read("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 2 3 1\nf 3 2 1\n").unwrap();
    assert_eq!(sheet.mesh.triangles(), [[0, 1, 2]]);
    assert_eq!(
        sheet.warnings,
        [
            "1 triangles that repeat an earlier one were dropped; the first is on line 5",
            "1 triangles that repeat an earlier one with the opposite winding were dropped: of faces with two sides, one was \
             kept; the first is on line 6",
            "3 edges are open: the surface has holes and its volume is an estimate; the first is at the face on line 4",
        ]
    );
}

#[test]
fn flips_closed_mesh_that_is_inside_out() {
    let inverted: String = CUBE
        .lines()
        .map(|line| match line.strip_prefix("f ") {
            Some(corners) => format!("f {}\n", corners.chars().rev().collect::<String>()),
            None => format!("{line}\n"),
        })
        .collect();
    let cube = read(&inverted).unwrap();
    assert!((volume(&cube) - 8.0).abs() < 1e-9);
    assert_eq!(
        cube.warnings,
        ["the mesh was inside out; all triangles were turned"]
    );
}

#[test]
fn warns_of_holes_winding_parts_and_unused_vertices() {
    let warnings = |text: &str| read(text).unwrap().warnings;
    assert_eq!(
        warnings(&CUBE.replace("f 5 6 7 8\n", "")),
        [
            "4 edges are open: the surface has holes and its volume is an estimate; the first is at the face on line 10"
        ]
    );
    assert_eq!(
        warnings(&CUBE.replace("f 5 6 7 8\n", "f 8 7 6 5\n")),
        [
            "2 triangles faced the opposite way of the rest of their part and were turned; the first is on line 10"
        ]
    );
    let far_cube: String = CUBE
        .lines()
        .map(|line| match line.strip_prefix("v ") {
            Some(numbers) => {
                let (x, rest) = numbers.split_once(' ').unwrap();
                format!("v {} {rest}\n", x.parse::<f32>().unwrap() + 5.0)
            }
            None => format!("f {}\n", shifted(&line[2..], 8)),
        })
        .collect();
    assert_eq!(
        warnings(&format!("{CUBE}{far_cube}")),
        ["2 parts are disconnected: they share no vertex"]
    );
    assert_eq!(
        warnings(&format!("{CUBE}v 9 9 9\n")),
        ["1 vertices are not used by any face"]
    );
    assert_eq!(
        warnings(&format!("{CUBE}curv 0 1\nwhat is this\n")),
        ["2 lines start with an unknown keyword and were ignored; the first is on line 15"]
    );
    let fin = warnings(&format!("{CUBE}v 0 0 9\nf 1 2 9\n"));
    assert!(
        fin.contains(&"1 edges join more than two triangles; the first is at the face on line 9".to_owned()),
        "{fin:?}"
    );
}

fn shifted(corners: &str, by: usize) -> String {
    let shifted: Vec<_> = corners
        .split(' ')
        .map(|corner| (corner.parse::<usize>().unwrap() + by).to_string())
        .collect();
    shifted.join(" ")
}

/// A right triangle with legs of 2 and 1, each corner followed by more numbers.
fn triangle(extras: [&str; 3]) -> ImportedMesh {
    let [a, b, c] = extras;
    read(&format!("v 0 0 0 {a}\nv 2 0 0 {b}\nv 0 1 0 {c}\nf 1 2 3\n")).unwrap()
}

#[test]
fn colours_change_nothing() {
    let plain = triangle([""; 3]);
    for extras in [
        ["1 0 0", "0.5 0.5 0.5", "nan nan nan"],
        ["255 0 0", "128 128 0", "0 0 0"],
        ["1", "1", "1 0.5 0.5 0.5"],
        ["1 0.5 0.5 0.5", "1 0.1 0.1 0.1", "1 200 100 0"],
    ] {
        let coloured = triangle(extras);
        assert_eq!(coloured.mesh, plain.mesh, "{extras:?}");
        assert_eq!(coloured.warnings, plain.warnings, "{extras:?}");
    }
}

#[test]
fn seven_ambiguous_numbers_are_a_colour_with_alpha_and_a_warning() {
    let plain = triangle([""; 3]);
    for extras in [
        ["0.5 0.2 0.8 1", "0.25 0.4 0.3 1", "0.9 0.9 0.9 1"],
        ["0.5 0.2 0.8 0.7", "0.5 0.2 0.8 0.7", "0.5 0.2 0.8 0.7"],
        ["128 64 32 255", "30 64 32 255", "255 64 32 255"],
    ] {
        let coloured = triangle(extras);
        assert_eq!(coloured.mesh, plain.mesh, "{extras:?}");
        assert_eq!(
            coloured.warnings[0],
            "3 vertices have seven numbers, read as x y z and a colour with alpha, not as x y z and a weight and a \
             colour; the first is on line 1"
        );
    }
}

#[test]
fn weights_divide_with_a_warning() {
    let weighted = triangle(["2", "2", ""]);
    assert_eq!(weighted.mesh.corners(0)[1], Vec3::new(1.0, 0.0, 0.0));
    assert_eq!(
        weighted.warnings[0],
        "2 vertices have a weight other than 1, by which their coordinates were divided; the first is on line 1"
    );
}

/// The message for bytes that are rejected.
fn message(bytes: &[u8]) -> String {
    let errors = read_mesh(bytes, Import::METRES, LIMITS).expect_err("must be rejected");
    assert!(
        matches!(errors[..], [ImportError::NotAMesh { .. }]),
        "{errors:?} for {:?}",
        String::from_utf8_lossy(bytes)
    );
    errors[0].to_string()
}

#[test]
fn names_formats_by_their_marks() {
    let cases: [(&[u8], &str); 12] = [
        (b"\n [1, 2, 3]", "JSON"),
        (b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", "OFF"),
        (b"Kaydara FBX Binary  \0\x1a\0", "FBX"),
        (b"<!DOCTYPE html><html><body>404 Not found</body></html>", "HTML"),
        (b"\xEF\xBB\xBF<HTML>\n<BODY>Sign in</BODY>", "HTML"),
        (
            b"<?xml version=\"1.0\"?>\n<COLLADA version=\"1.4.1\"></COLLADA>",
            "COLLADA",
        ),
        (b"PK\x03\x04\x14\0\0\0\x08\0mesh.obj", "ZIP"),
        (b"\xFF\xFE\0\0v\0\0\0", "UTF-32"),
        (b"newmtl steel\nKd 1 1 1\n", "material library"),
        (b"0 0 0\n1 0 0\n0 1 0\n", "some other text"),
        (b"\0\x01\x02\x03\x04", "binary data"),
        (b"404: Not Found", "some other text"),
    ];
    for (bytes, name) in cases {
        let message = message(bytes);
        assert!(message.contains(name), "{name}: {message}");
    }
}

#[test]
fn says_that_no_line_is_a_statement() {
    assert_eq!(
        message(b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n"),
        "none of the 3 lines begins with a word of OBJ (v, f, ...); this looks like a Git LFS pointer: send the file \
         that it stands for (git lfs pull)"
    );
}

#[test]
fn recognises_other_text_in_utf16() {
    let page = "\u{feff}<html><body>404</body></html>";
    let bytes: Vec<u8> = page.encode_utf16().flat_map(u16::to_le_bytes).collect();
    assert!(message(&bytes).contains("HTML"));
}

#[test]
fn accidental_words_of_obj_do_not_hide_the_format() {
    let mut bytes = b"\x89PNG\r\n\x1a\n".to_vec();
    for _ in 0..10 {
        bytes.extend(b"\x01\x02\nIDAT\n\x03");
    }
    bytes.extend(b"\nf \xFF\xFE\x01\nv\n");
    let message = message(&bytes);
    assert!(
        message.starts_with("words of OBJ (v, f, ...) begin only 2 of the "),
        "{message}"
    );
    assert!(message.contains("PNG"), "{message}");
}

#[test]
fn wrong_obj_text_keeps_its_own_errors() {
    // Whatever it begins with, most lines are statements.
    for start in ["OFF\n", "{\n", "<<<<<<< HEAD\n", "solid facet\n"] {
        let text = format!("{start}{CUBE}f 1 2 99\n");
        let errors = read_mesh(text.as_bytes(), Import::METRES, LIMITS).unwrap_err();
        assert!(
            matches!(
                errors[..],
                [ImportError::IndexOutOfRange {
                    line: 16,
                    index: 99,
                    ..
                }]
            ),
            "{errors:?}"
        );
    }
}
