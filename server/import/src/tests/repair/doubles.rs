//! Triangles that are there twice.

use glam::DVec3;

use crate::tests::repair::{read, solids::Polygons, volume};

fn square(corners: [[f64; 3]; 4]) -> Polygons {
    Polygons(vec![corners.map(DVec3::from_array).to_vec()])
}

fn both_sides(polygons: &Polygons) -> Polygons {
    polygons.clone().and(polygons.clone().reversed())
}

#[test]
fn two_sided_sheet_becomes_a_sheet() {
    let sheet = square([[0.0; 3], [0.1, 0.0, 0.0], [0.1, 0.1, 0.0], [0.0, 0.1, 0.0]]).and(square([
        [0.1, 0.0, 0.0],
        [0.2, 0.0, 0.0],
        [0.2, 0.1, 0.0],
        [0.1, 0.1, 0.0],
    ]));
    let found = read(&both_sides(&sheet).obj());
    assert_eq!(found.mesh, read(&sheet.obj()).mesh);
    assert_eq!(
        found.warnings[0],
        "4 triangles that repeat an earlier one with the opposite winding were dropped: of faces with two sides, one was kept; \
         the first is on line 15"
    );
}

#[test]
fn two_sided_solid_becomes_a_solid() {
    let cube = Polygons::cube(DVec3::ZERO, 0.1);
    for solid in [both_sides(&cube), both_sides(&cube.clone().reversed())] {
        let found = read(&solid.obj());
        assert!((volume(&found) - 1e-3).abs() < 1e-9);
        assert_eq!(found.mesh.triangles().len(), 12);
    }
}

#[test]
fn side_that_closes_the_surface_is_kept() {
    let mut cube = Polygons::cube(DVec3::ZERO, 0.1);
    let lid = cube.0[5].clone();
    for inner_first in [false, true] {
        let mut reversed = lid.clone();
        reversed.reverse();
        cube.0.truncate(5);
        cube.0.extend(if inner_first {
            [reversed, lid.clone()]
        } else {
            [lid.clone(), reversed]
        });
        let found = read(&cube.obj());
        assert!((volume(&found) - 1e-3).abs() < 1e-9);
        let kinds: Vec<&str> = found.warnings.iter().map(|warning| &warning[..35]).collect();
        assert_eq!(kinds[0], "2 triangles that repeat an earlier ");
        // The kept side may have to be turned; nothing else is wrong.
        assert!(
            found.warnings[1..]
                .iter()
                .all(|warning| warning.contains("were turned")),
            "{:?}",
            found.warnings
        );
    }
}

#[test]
fn wall_between_two_closed_rooms_stays() {
    let rooms = Polygons::cube(DVec3::ZERO, 0.1).and(Polygons::cube(DVec3::X * 0.1, 0.1));
    let found = read(&rooms.obj());
    assert_eq!(found.mesh.triangles().len(), 24);
    assert!((volume(&found) - 2e-3).abs() < 1e-9);
    assert!(found.warnings[0].contains("were kept"), "{:?}", found.warnings);
}

#[test]
fn triangles_that_repeat_earlier_ones_are_dropped() {
    let cube = Polygons::cube(DVec3::ZERO, 0.1);
    let found = read(&cube.clone().and(cube.clone()).obj());
    assert_eq!(found.mesh, read(&cube.obj()).mesh);
    assert_eq!(
        found.warnings,
        ["12 triangles that repeat an earlier one were dropped; the first is on line 35"]
    );
}
