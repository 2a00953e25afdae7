//! What is taken, and what is said about it.

use glam::Vec3;
use grasp_assets::obj::read_obj;

use crate::{CUBE, LIMITS, read, volume};

#[test]
fn a_clean_cube_is_read_without_a_warning() {
    let cube = read(CUBE).unwrap();
    assert_eq!(cube.mesh.positions().len(), 8);
    assert_eq!(cube.mesh.triangles().len(), 12);
    assert_eq!(cube.warnings, [""; 0]);
    assert_eq!(cube.groups, []);
    assert!((volume(&cube) - 8.0).abs() < 1e-9);
}

#[test]
fn polygons_become_fans_from_their_first_corner() {
    let pentagon = read("v 0 0 0\nv 2 0 0\nv 3 1 0\nv 1 2 0\nv -1 1 0\nf 2 3 4 5 1\n").unwrap();
    let corner = [(2, 0), (3, 1), (1, 2), (-1, 1), (0, 0)].map(|(x, y)| Vec3::new(x as f32, y as f32, 0.0));
    let corners: Vec<_> = (0..3).map(|t| pentagon.mesh.corners(t)).collect();
    assert_eq!(corners, [1, 2, 3].map(|k| [corner[0], corner[k], corner[k + 1]]));
}

#[test]
fn coordinates_are_scaled_to_metres() {
    let cube = read_obj(CUBE.as_bytes(), 0.01, LIMITS).unwrap();
    assert!((volume(&cube) - 8e-6).abs() < 1e-12);
}

#[test]
fn negative_indices_count_back_from_the_line_they_stand_in() {
    let early = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 0 0 1\nf -4 -1 -3\n";
    let plain = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nv 0 0 1\nf 1 4 2\n";
    assert_eq!(read(early).unwrap().mesh, read(plain).unwrap().mesh);
}

#[test]
fn faces_may_come_before_their_vertices() {
    let text: Vec<_> = CUBE.lines().rev().collect();
    let cube = read(&text.join("\n")).unwrap();
    // Vertices and faces are reversed, but the indices are not: vertex k became 9 − k, which mirrors the cube in all
    // three axes and turns it inside out.
    assert!((volume(&cube).abs() - 8.0).abs() < 1e-9);
}

#[test]
fn line_endings_continuations_and_comments_do_not_matter() {
    let plain = read(CUBE).unwrap().mesh;
    for text in [
        CUBE.replace('\n', "\r\n"),
        CUBE.replace('\n', "\r"),
        CUBE.replace("f 4 3 2 1", "f 4 3 \\\n2 1"),
        CUBE.replace("f 4 3 2 1", "f 4 3 \\\r\n2 1 # below"),
        CUBE.replace("v ", "  v\t"),
        format!("\u{feff}# a cube\n\n{CUBE}"),
        CUBE.trim_end().to_owned(),
    ] {
        assert_eq!(read(&text).unwrap().mesh, plain, "{text:?}");
    }
}

#[test]
fn text_that_is_not_utf8_is_no_hindrance_in_names_and_comments() {
    let mut text = b"# caf\xE9\ng caf\xE9\n".to_vec();
    text.extend_from_slice(CUBE.as_bytes());
    let cube = read_obj(&text, 1.0, LIMITS).unwrap();
    assert_eq!(cube.groups.len(), 1);
    assert_eq!(cube.groups[0].0, "caf\u{fffd}");
}

#[test]
fn weights_divide_and_colours_are_passed_over() {
    let weighted = read("v 0 0 0 2\nv 4 0 0 2\nv 0 2 0\nf 1 2 3\n").unwrap();
    assert_eq!(weighted.mesh.corners(0)[1], Vec3::new(2.0, 0.0, 0.0));
    let coloured = read("v 0 0 0 1 0 0\nv 2 0 0 nan nan nan\nv 0 2 0 1 0.5 0.5 0.5\nf 1 2 3\n").unwrap();
    assert_eq!(coloured.mesh, weighted.mesh);
}

#[test]
fn texture_coordinates_and_normals_are_passed_over_even_when_absent() {
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
fn material_files_are_not_looked_for() {
    let cube = read(&format!(
        "mtllib /etc/passwd\nmtllib ../../x.mtl\nusemtl steel blue\n{CUBE}"
    ))
    .unwrap();
    assert_eq!(cube.warnings, [""; 0]);
    assert_eq!(cube.groups, [("steel blue".to_owned(), (0..12).collect())]);
}

#[test]
fn groups_objects_and_materials_hold_until_replaced() {
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
    assert_eq!(read.places, [0, 1, 2, 3, 5]);
    assert_eq!(read.places_in_file, 6);
}

#[test]
fn vertices_of_equal_position_are_welded_zeros_of_either_sign_too() {
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nv 1 0 -0\nv -0 0 -0.0\nv 0 0 1\nf 4 5 6\n";
    let read = read(text).unwrap();
    assert_eq!(read.mesh.positions().len(), 4);
    assert_eq!(read.mesh.triangles(), [[0, 1, 2], [1, 0, 3]]);
}

#[test]
fn what_has_no_area_is_dropped_with_its_line() {
    let text =
        format!("{CUBE}p 1\nl 1 2\nf 1 2\nf 1\nf 1 1 2\nf 1 2 1\nv 3 3 3\nv 4 4 4\nv 5 5 5\nf 9 10 11\n");
    let read = read(&text).unwrap();
    assert_eq!(read.mesh.triangles().len(), 12);
    assert!(read.warnings.contains(
        &"4 points, lines and faces of less than three corners were dropped; the first is in line 15".into()
    ));
    assert!(
        read.warnings
            .contains(&"3 triangles without area were dropped; the first is in line 19".into())
    );
}

#[test]
fn repeated_triangles_are_dropped_but_not_their_other_side() {
    let sheet = read("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 2 3 1\nf 3 2 1\n").unwrap();
    assert_eq!(sheet.mesh.triangles(), [[0, 1, 2], [2, 1, 0]]);
    assert_eq!(
        sheet.warnings,
        ["1 triangles that repeat an earlier one were dropped; the first is in line 5"]
    );
}

#[test]
fn a_closed_mesh_that_is_inside_out_is_turned() {
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
fn holes_winding_parts_and_leftovers_are_told() {
    let warnings = |text: &str| read(text).unwrap().warnings;
    assert_eq!(
        warnings(&CUBE.replace("f 5 6 7 8\n", "")),
        ["4 edges are open: the surface has holes and its volume is a guess"]
    );
    assert_eq!(
        warnings(&CUBE.replace("f 5 6 7 8\n", "f 8 7 6 5\n")),
        ["4 edges join triangles that face opposite sides: the winding is inconsistent"]
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
        ["2 separate parts share no vertex"]
    );
    assert_eq!(
        warnings(&format!("{CUBE}v 9 9 9\n")),
        ["1 vertices are not used by any face"]
    );
    assert_eq!(
        warnings(&format!("{CUBE}curv 0 1\nwhat is this\n")),
        ["2 lines begin with an unknown word and were not read; the first is in line 15"]
    );
    let fin = warnings(&format!("{CUBE}v 0 0 9\nf 1 2 9\n"));
    assert!(
        fin.contains(&"1 edges join more than two triangles".to_owned()),
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

#[test]
fn a_polygon_whose_fan_overlaps_itself_is_told() {
    // The second corner from the end is reflex as seen from the first corner.
    let arrow = "v 0 0 0\nv 4 0 0\nv 1 1 0\nv 0 4 0\n";
    assert!(
        read(&format!("{arrow}f 2 3 4 1\n")).unwrap().warnings[0]
            .starts_with("line 5: a polygon is not convex")
    );
    // The same polygon can be a fan from its reflex corner.
    let from_reflex = read(&format!("{arrow}f 3 4 1 2\n")).unwrap();
    assert!(
        !from_reflex
            .warnings
            .iter()
            .any(|warning| warning.contains("convex"))
    );
}
