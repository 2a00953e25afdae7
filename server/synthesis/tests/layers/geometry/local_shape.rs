//! How flat, long or round meshes are near a point, against closed forms.

use grasp_synthesis::geometry::{
    local_shape::{Curvature, LocalShape, Part},
    surface_samples::SurfaceSample,
};

use crate::prelude::*;

/// Largest error, as a share: a part consists of some dozens of patches.
const TOLERANCE: f32 = 0.15;

/// The middle of [`sphere`].
const SPHERE_CENTRE: Vec3 = Vec3::new(0.01, -0.02, 0.03);

fn around(mesh: &TriangleMesh, centre: Vec3, radius: f32) -> Part {
    let shape = LocalShape::of(&even_samples(mesh));
    shape.around(centre, radius).expect("the mesh has a surface")
}

/// How a mesh curves under points with normals.
fn under<const N: usize>(mesh: &TriangleMesh, centre: Vec3, points: [(Vec3, Vec3); N]) -> Curvature {
    let shape = LocalShape::of(&even_samples(mesh));
    shape.under(
        centre,
        0.06,
        points.map(|(position, normal)| SurfaceSample { position, normal }),
    )
}

fn assert_near(found: f32, expected: f32, what: &str) {
    assert!(
        (found / expected - 1.0).abs() < TOLERANCE,
        "{what}: {found} instead of {expected}"
    );
}

#[test]
fn every_piece_of_a_ball_is_spherical() {
    let ball = sphere(0.04, 24);
    for (centre, radius) in [
        (SPHERE_CENTRE, 0.05),
        (SPHERE_CENTRE + Vec3::Y * 0.02, 0.03),
        (SPHERE_CENTRE + Vec3::X * 0.035, 0.03),
    ] {
        let sphericity = around(&ball, centre, radius).sphericity;
        assert!(sphericity > 0.95, "{sphericity}");
    }
    // Its inner wall counts as if turned over.
    let hollow = Parts::default()
        .sphere(Vec3::ZERO, 0.04, 24, true)
        .sphere(Vec3::ZERO, 0.037, 24, false);
    let sphericity = around(&hollow.mesh(), Vec3::ZERO, 0.05).sphericity;
    assert!(sphericity > 0.95, "{sphericity}");
}

#[test]
fn cubes_cylinders_and_plates_are_less_spherical() {
    let cube = around(&cuboid(Vec3::splat(0.03), 8), Vec3::ZERO, 0.06);
    assert_near(cube.sphericity, 0.6, "a cube");
    let can = around(&cylinder_mesh(0.03, 0.03, 32, 8), Vec3::ZERO, 0.06);
    assert_near(can.sphericity, 0.72, "a can as high as wide");
    let rod = around(&cylinder_mesh(0.01, 0.1, 32, 8), Vec3::ZERO, 0.03);
    assert!(rod.sphericity < 0.35, "{rod:?}");
    let plate = around(&cuboid(Vec3::new(0.05, 0.001, 0.05), 8), Vec3::ZERO, 0.03);
    assert!(plate.sphericity < 0.02, "{plate:?}");
}

#[test]
fn spreads_tell_thickness_and_radius() {
    let plate = around(&cuboid(Vec3::new(0.15, 0.003, 0.15), 4), Vec3::ZERO, 0.05);
    assert_near(plate.spreads[2], 0.003, "half a plate's thickness");
    assert!(plate.spreads[1] > 5.0 * plate.spreads[2], "{plate:?}");
    let rod = around(&cylinder_mesh(0.01, 0.1, 32, 8), Vec3::ZERO, 0.03);
    for spread in &rod.spreads[1..] {
        assert_near(*spread, 0.01 / 2.0_f32.sqrt(), "a rod's radius over √2");
    }
    // The normals of a rod are spread over its cross-section.
    assert!(rod.facing.between(Vec3::Y, Vec3::Y) < 0.01, "{rod:?}");
    assert_near(rod.facing.between(Vec3::X, Vec3::X), 0.5, "normals along x");
}

#[test]
fn far_from_a_mesh_its_nearest_part_counts() {
    let parts = Parts::default().cuboid(Vec3::ZERO, Vec3::new(0.2, 0.01, 0.01), 8);
    let part = around(&parts.mesh(), Vec3::new(0.0, 0.5, 0.0), 0.03);
    assert!(part.spreads.iter().all(|spread| spread.is_finite()), "{part:?}");
    assert!(LocalShape::default().around(Vec3::ZERO, 0.03).is_none());
}

#[test]
fn balls_curve_alike_in_all_directions_and_rods_do_not() {
    let touched = |radius: f32| [Vec3::X, Vec3::NEG_X, Vec3::Z].map(|normal| (radius * normal, normal));
    let on_ball = touched(0.04).map(|(position, normal)| (SPHERE_CENTRE + position, normal));
    let ball = under(&sphere(0.04, 24), SPHERE_CENTRE, on_ball);
    assert!(ball.along > 0.7 && ball.roundness > 0.95, "{ball:?}");
    let rod = under(&cylinder_mesh(0.02, 0.1, 32, 8), Vec3::ZERO, touched(0.02));
    assert!(rod.along < 0.2 && rod.roundness > 0.9, "{rod:?}");
}

#[test]
fn edges_and_corners_do_not_curve() {
    let rim = Vec3::new(0.03, 0.05, 0.0);
    let slanted = Vec3::new(1.0, 1.0, 0.0) * std::f32::consts::FRAC_1_SQRT_2;
    let points = [(rim, slanted), (-rim, -slanted), (Vec3::Z * 0.03, Vec3::Z)];
    let can = under(&cylinder_mesh(0.03, 0.05, 48, 8), Vec3::ZERO, points);
    assert!(can.along < 0.25, "{can:?}");
}

#[test]
fn nothing_curves_far_from_the_surface() {
    let far = (Vec3::splat(1.0), Vec3::X);
    let none = under(&sphere(0.04, 24), SPHERE_CENTRE, [far]);
    assert_eq!(none, Curvature::default());
}
