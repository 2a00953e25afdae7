//! Meshes are welded, placed, and repaired where that is certain.

use crate::{
    Import, ImportedMesh, UpAxis, read_mesh,
    tests::{self, LIMITS, assert_mentioned, volume},
};
use glam::{DVec3, Vec3};
use proptest::prelude::*;
use std::fmt::Write as _;

fn read(polygons: &Polygons) -> ImportedMesh {
    read_mesh(polygons.obj().as_bytes(), Import::METRES, LIMITS).unwrap_or_else(|errors| panic!("{errors:?}"))
}

fn cube(edge: f64) -> Polygons {
    Polygons::cube(DVec3::ZERO, edge)
}

fn both_sides(polygons: &Polygons) -> Polygons {
    polygons.clone().and(polygons.clone().reversed())
}

#[test]
fn two_sided_sheet_becomes_a_sheet() {
    let square = |x: f64| {
        let corners = [(0.0, 0.0), (0.1, 0.0), (0.1, 0.1), (0.0, 0.1)];
        corners.map(|(along, y)| DVec3::new(x + along, y, 0.0)).to_vec()
    };
    let sheet = Polygons(vec![square(0.0), square(0.1)]);
    let found = read(&both_sides(&sheet));
    assert_eq!(found.mesh, read(&sheet).mesh);
    assert_eq!(
        found.warnings[0],
        "4 triangles that repeat an earlier one with the opposite winding were dropped: of faces with two sides, one was kept; \
         the first is on line 15"
    );
}

#[test]
fn two_sided_solid_becomes_a_solid() {
    let cube = cube(0.1);
    for solid in [both_sides(&cube), both_sides(&cube.clone().reversed())] {
        let found = read(&solid);
        assert!((volume(&found) - 1e-3).abs() < 1e-9);
        assert_eq!(found.mesh.triangles().len(), 12);
    }
}

#[test]
fn side_that_closes_the_surface_is_kept() {
    let mut cube = cube(0.1);
    let lid = cube.0[5].clone();
    for inner_first in [false, true] {
        let mut lids = [lid.clone(), lid.clone()];
        lids[usize::from(!inner_first)].reverse();
        cube.0.truncate(5);
        cube.0.extend(lids);
        let found = read(&cube);
        assert!((volume(&found) - 1e-3).abs() < 1e-9);
        let [dropped, rest @ ..] = &found.warnings[..] else {
            panic!("no warning")
        };
        assert!(
            dropped.starts_with("2 triangles that repeat an earlier "),
            "{dropped}"
        );
        // The kept side may have to be turned; nothing else is wrong.
        assert!(
            rest.iter().all(|warning| warning.contains("were turned")),
            "{rest:?}"
        );
    }
}

#[test]
fn wall_between_two_closed_rooms_stays() {
    let rooms = cube(0.1).and(Polygons::cube(DVec3::X * 0.1, 0.1));
    let found = read(&rooms);
    assert_eq!(found.mesh.triangles().len(), 24);
    assert!((volume(&found) - 2e-3).abs() < 1e-9);
    assert!(found.warnings[0].contains("were kept"), "{:?}", found.warnings);
}

#[test]
fn triangles_that_repeat_earlier_ones_are_dropped() {
    let cube = cube(0.1);
    let found = read(&cube.clone().and(cube.clone()));
    assert_eq!(found.mesh, read(&cube).mesh);
    assert_eq!(
        found.warnings,
        ["12 triangles that repeat an earlier one were dropped; the first is on line 35"]
    );
}

#[test]
fn origin_is_the_centre_of_the_box_in_the_units_and_axes_of_the_file() {
    let millimetres = Import {
        up_axis: UpAxis::Z,
        ..Import::with_unit(1e-3)
    };
    let far = Polygons::cube(DVec3::new(50_000.0, 0.0, 250.0), 100.0);
    let found = read_mesh(far.obj().as_bytes(), millimetres, LIMITS).unwrap();
    assert_eq!(found.origin_in_file, DVec3::new(50_000.0, 0.0, 250.0));
    for position in found.mesh.positions() {
        assert!((position.abs() - Vec3::splat(0.05)).length() < 1e-7, "{position}");
    }
}

#[test]
fn mesh_near_the_origin_of_its_file_stays_there() {
    for (distance, moved) in [(9.99, 0.0), (10.01, 10.01)] {
        let found = read(&Polygons::cube(DVec3::Z * distance, 0.1));
        assert!((found.origin_in_file - DVec3::Z * moved).length() < 1e-12);
        assert_eq!(found.warnings.len(), usize::from(moved > 0.0));
    }
    // Unused vertices do not count.
    let unused = format!("v 5000 0 0\n{}", cube(0.1).obj());
    assert_eq!(tests::read(unused).unwrap().origin_in_file, DVec3::ZERO);
}

#[test]
fn concave_polygon_is_split_exactly_far_away() {
    let outline = [[0, 0], [4, 0], [4, 1], [1, 1], [1, 4], [0, 4]];
    let face = outline.map(|[x, y]| DVec3::new(1e7 + 0.01 * f64::from(x), 0.01 * f64::from(y), 0.0));
    let found = read(&Polygons(vec![face.to_vec()]));
    assert!((found.mesh.area() - 7e-4).abs() < 1e-9, "{}", found.mesh.area());
}

/// Polygons over vertices of their own; vertices at equal positions are one to the reader.
#[derive(Clone, Default)]
pub(crate) struct Polygons(pub(crate) Vec<Vec<DVec3>>);

impl Polygons {
    /// A cube of an edge around a middle, of six squares wound outward.
    pub(crate) fn cube(middle: DVec3, edge: f64) -> Self {
        let corner = |bits: usize| {
            let side = |axis: usize| if bits >> axis & 1 == 1 { 0.5 } else { -0.5 };
            middle + DVec3::new(side(0), side(1), side(2)) * edge
        };
        let faces = ["0462", "1375", "0154", "2673", "0231", "4576"];
        let face = |corners: &str| -> Vec<DVec3> {
            corners
                .bytes()
                .map(|digit| corner(usize::from(digit - b'0')))
                .collect()
        };
        Self(faces.map(face).to_vec())
    }

    /// The same polygons, wound the other way.
    pub(crate) fn reversed(mut self) -> Self {
        for face in &mut self.0 {
            face.reverse();
        }
        self
    }

    pub(crate) fn and(mut self, other: Self) -> Self {
        self.0.extend(other.0);
        self
    }

    /// OBJ text: four lines of vertices and one of the face per square.
    pub(crate) fn obj(&self) -> String {
        let mut text = String::new();
        for face in &self.0 {
            for DVec3 { x, y, z } in face {
                writeln!(text, "v {x} {y} {z}").unwrap();
            }
            text += "f";
            for back in (1..=face.len()).rev() {
                write!(text, " -{back}").unwrap();
            }
            text += "\n";
        }
        text
    }
}

proptest! {
    #[test]
    fn any_faces_of_a_closed_solid_may_be_turned(turned in prop::collection::vec(any::<bool>(), 6)) {
        let mut polygons = cube(0.1);
        for (face, _) in polygons.0.iter_mut().zip(&turned).filter(|(_, turned)| **turned) {
            face.reverse();
        }
        let found = read(&polygons);
        prop_assert!((volume(&found) - 1e-3).abs() < 1e-9);
        prop_assert_eq!(found.warnings.is_empty(), !turned.contains(&true));
    }
}

#[test]
fn each_part_faces_outward_on_its_own() {
    let beside = Polygons::cube(DVec3::X, 0.2).reversed();
    let found = read(&cube(0.1).and(beside));
    assert!((volume(&found) - 9e-3).abs() < 1e-8);
    assert_eq!(
        found.warnings,
        [
            "12 triangles of parts that were inside out were turned; the first is on line 35",
            "2 parts are disconnected: they share no vertex",
        ]
    );
}

#[test]
fn cavity_stays_a_cavity() {
    let hollow = cube(0.2).and(cube(0.1).reversed());
    let found = read(&hollow);
    assert!((volume(&found) - 7e-3).abs() < 1e-8);
    assert_eq!(found.warnings, ["2 parts are disconnected: they share no vertex"]);
    // As a whole, it may be inside out.
    let found = read(&hollow.reversed());
    assert!((volume(&found) - 7e-3).abs() < 1e-8);
    assert_eq!(
        found.warnings[0],
        "the mesh was inside out; all triangles were turned"
    );
}

#[test]
fn parts_that_share_an_edge_are_turned_apart() {
    // Across the edge from (0.05, 0.05, -0.05) to (0.05, 0.05, 0.05) of the first.
    let beside = Polygons::cube(DVec3::new(0.1, 0.1, 0.0), 0.1).reversed();
    let found = read(&cube(0.1).and(beside));
    assert!((volume(&found) - 2e-3).abs() < 1e-9);
    assert!(found.warnings[0].starts_with("12 triangles of parts that were inside out"));
    assert!(found.warnings[1].starts_with("1 edges join more than two triangles"));
}

#[test]
fn open_surface_keeps_the_side_of_its_larger_part() {
    let mut tray = cube(0.1);
    tray.0.pop();
    tray.0[4].reverse();
    let found = read(&tray);
    let expected = [
        "2 triangles faced the opposite way of the rest of their part and were turned; the first is on line 25",
        "4 edges are open: the surface has holes and its volume is an estimate; the first is at the face on line 5",
    ];
    assert_eq!(found.warnings, expected);
    tray.0[4].reverse();
    assert!((volume(&found) - volume(&read(&tray))).abs() < 1e-12);
    // Inside out or not is not certain of an open one.
    let inward = read(&tray.reversed());
    assert_eq!(inward.warnings.len(), 1, "{:?}", inward.warnings);
}

#[test]
fn one_sided_strip_stays_as_it_is() {
    let steps = 24;
    let point = |step: usize, side: f64| {
        let angle = std::f64::consts::TAU * step as f64 / f64::from(steps);
        let out = DVec3::new(angle.cos(), 0.0, angle.sin());
        let across = out * (0.5 * angle).cos() + DVec3::Y * (0.5 * angle).sin();
        out * 0.05 + across * side * 0.01
    };
    let round = |point: DVec3| (point * 1e6).round() / 1e6;
    let strip = (0..steps as usize).map(|step| {
        let corners = [(step, -1.0), (step + 1, -1.0), (step + 1, 1.0), (step, 1.0)];
        corners.map(|(step, side)| round(point(step, side))).to_vec()
    });
    let found = read(&Polygons(strip.collect()));
    let inconsistent = "1 edges join triangles that face opposite ways: the winding is inconsistent";
    assert_mentioned(&found.warnings, &[inconsistent]);
    assert!(!found.warnings.iter().any(|warning| warning.contains("turned")));
}

#[test]
fn thousands_of_parts_are_compared_in_bounded_time() {
    let mut parts = Polygons::default();
    for part in 0..2_000 {
        let cube = Polygons::cube(DVec3::X * f64::from(part) * 1e-3, 5e-4);
        parts = parts.and(if part % 2 == 0 { cube } else { cube.reversed() });
    }
    let started = std::time::Instant::now();
    let found = read(&parts);
    // Whether parts were turned one by one or not at all, what is left is said.
    assert_mentioned(&found.warnings, &["2000 parts"]);
    assert!(started.elapsed().as_secs() < 5, "{:?}", started.elapsed());
}
