//! Triangles that face the wrong way.

use glam::DVec3;
use proptest::prelude::*;

use crate::tests::repair::{read, solids::Polygons, volume};

fn cube(edge: f64) -> Polygons {
    Polygons::cube(DVec3::ZERO, edge)
}

proptest! {
    #[test]
    fn any_faces_of_a_closed_solid_may_be_turned(turned in prop::collection::vec(any::<bool>(), 6)) {
        let mut polygons = cube(0.1);
        for (face, _) in polygons.0.iter_mut().zip(&turned).filter(|(_, turned)| **turned) {
            face.reverse();
        }
        let found = read(&polygons.obj());
        prop_assert!((volume(&found) - 1e-3).abs() < 1e-9);
        prop_assert_eq!(found.warnings.is_empty(), !turned.contains(&true));
    }
}

#[test]
fn each_part_faces_outward_on_its_own() {
    let beside = Polygons::cube(DVec3::X, 0.2).reversed();
    let found = read(&cube(0.1).and(beside).obj());
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
    let found = read(&hollow.obj());
    assert!((volume(&found) - 7e-3).abs() < 1e-8);
    assert_eq!(found.warnings, ["2 parts are disconnected: they share no vertex"]);
    // As a whole, it may be inside out.
    let found = read(&hollow.reversed().obj());
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
    let found = read(&cube(0.1).and(beside).obj());
    assert!((volume(&found) - 2e-3).abs() < 1e-9);
    assert!(found.warnings[0].starts_with("12 triangles of parts that were inside out"));
    assert!(found.warnings[1].starts_with("1 edges join more than two triangles"));
}

#[test]
fn open_surface_keeps_the_side_of_its_larger_part() {
    let mut tray = cube(0.1);
    tray.0.pop();
    tray.0[4].reverse();
    let found = read(&tray.obj());
    let expected = [
        "2 triangles faced the opposite way of the rest of their part and were turned; the first is on line 25",
        "4 edges are open: the surface has holes and its volume is an estimate; the first is at the face on line 5",
    ];
    assert_eq!(found.warnings, expected);
    tray.0[4].reverse();
    assert!((volume(&found) - volume(&read(&tray.obj()))).abs() < 1e-12);
    // Inside out or not is not certain of an open one.
    let inward = read(&tray.reversed().obj());
    assert!(
        inward.warnings.iter().all(|warning| warning.contains("open")),
        "{:?}",
        inward.warnings
    );
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
        let corners = [
            point(step, -1.0),
            point(step + 1, -1.0),
            point(step + 1, 1.0),
            point(step, 1.0),
        ];
        corners.map(round).to_vec()
    });
    let found = read(&Polygons(strip.collect()).obj());
    let inconsistent = "1 edges join triangles that face opposite ways: the winding is inconsistent";
    assert!(
        found
            .warnings
            .iter()
            .any(|warning| warning.starts_with(inconsistent)),
        "{:?}",
        found.warnings
    );
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
    let found = read(&parts.obj());
    // Whether parts were turned one by one or not at all, what is left is said.
    assert!(
        found
            .warnings
            .iter()
            .any(|warning| warning.starts_with("2000 parts"))
    );
    assert!(started.elapsed().as_secs() < 5, "{:?}", started.elapsed());
}
