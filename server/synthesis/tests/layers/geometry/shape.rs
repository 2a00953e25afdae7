//! What is derived of a mesh's shape: inner balls, local shape and thickness, opposed places, what is sharp.

use crate::{fixtures::meshes::solids, prelude::*};
use grasp_synthesis::{
    geometry::{
        local_shape::{Curvature, LocalShape, Part},
        opposed::{OPPOSED_ACCURACY, OpposedDistance, opposed_distance},
        sharp::SharpFeatures,
        surface_samples::{LocalThickness, SurfaceSample},
    },
    model::holdout::{Ball, inner_balls},
};

const COUNT: usize = 48;

fn balls_in(mesh: TriangleMesh) -> Vec<Ball> {
    inner_balls(&MeshBvh::build_quick(mesh), COUNT)
}

#[test]
fn balls_lie_inside_the_volume() {
    for (name, mesh) in solids() {
        let balls = balls_in(mesh.clone());
        assert!(
            !balls.is_empty() && balls.len() <= COUNT,
            "{name}: {}",
            balls.len()
        );
        for Ball { centre, radius } in balls {
            assert!(winding_number(&mesh, centre).abs() > 0.5, "{name}: {centre}");
            let distance = distance_to_mesh(&mesh, centre);
            assert!(distance >= f64::from(radius), "{name}: {distance}, not {radius}");
        }
    }
}

#[test]
fn the_largest_ball_is_first_and_fills_a_sphere() {
    let balls = balls_in(sphere(0.03, 20));
    assert!((balls[0].radius - 0.03).abs() < 5e-4, "{:?}", balls[0]);
    let boxed = balls_in(cuboid(Vec3::new(0.1, 0.02, 0.03), 10));
    assert!((boxed[0].radius - 0.02).abs() < 1e-4, "{:?}", boxed[0]);
    assert!(boxed.is_sorted_by(|a, b| a.radius >= b.radius));
}

#[test]
fn a_sheet_has_none() {
    assert_eq!(balls_in(sheet(0.1, 0.0, 8)), []);
}

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

/// Largest error, as a share: some dozens of samples make up a part.
const THICKNESS_TOLERANCE: f32 = 0.12;

fn thickness(mesh: &TriangleMesh) -> LocalThickness {
    LocalThickness::of(&even_samples(mesh))
}

fn assert_thickness(found: f32, expected: f32, what: &str) {
    assert!(
        (found / expected - 1.0).abs() < THICKNESS_TOLERANCE,
        "{what}: {found} m instead of {expected} m"
    );
}

/// Root mean square distance of a square's sides from its middle, as a multiple of half its side.
const SQUARE: f32 = 1.154_700_5;

#[test]
fn rods_are_as_thick_as_their_radius_and_balls_nearly() {
    let rod = thickness(&torus(0.5, 0.01, 96));
    assert_thickness(rod.near(Vec3::new(0.5, 0.0, 0.0)), 0.01, "a hoop");
    let bar = Parts::default().cuboid(Vec3::ZERO, Vec3::new(0.012, 0.4, 0.012), 1);
    let bar = thickness(&bar.mesh());
    assert_thickness(bar.near(Vec3::ZERO), 0.012 * SQUARE, "a square bar");
    let ball = thickness(&sphere(0.03, 16));
    let expected = 0.03 * (2.0_f32 / 3.0).sqrt();
    assert_thickness(ball.near(Vec3::new(0.01, -0.02, 0.03)), expected, "a ball");
}

#[test]
fn what_is_far_from_the_hand_does_not_count() {
    let stick = Parts::default().cuboid(Vec3::ZERO, Vec3::new(0.01, 0.65, 0.01), 1);
    let with_bar = stick
        .clone()
        .cuboid(Vec3::new(0.0, 0.65, 0.0), Vec3::new(0.15, 0.01, 0.01), 1);
    let [bare, barred] = [stick, with_bar].map(|parts| thickness(&parts.mesh()));
    for height in [-0.6, -0.3, 0.0, 0.3, 0.5] {
        let place = Vec3::new(0.0, height, 0.0);
        assert_thickness(bare.near(place), 0.01 * SQUARE, "the bare stick");
        assert_thickness(barred.near(place), 0.01 * SQUARE, "the stick with a bar");
    }
}

/// Samples of a large face are sparse, but it is not thin.
#[test]
fn large_faces_are_thick() {
    let board = thickness(&cuboid(Vec3::new(1.5, 0.01, 1.5), 1));
    assert!(board.near(Vec3::ZERO) > 0.03);
}

/// Distance of a mesh's opposed places, which must be neither close nor beyond a metre.
fn apart(mesh: &TriangleMesh) -> f32 {
    match unstopped(|stop| opposed_distance(mesh, |_| true, 0.0, 1.0, stop)) {
        OpposedDistance::Apart(metres) => metres,
        other => panic!("{other:?}"),
    }
}

/// The least distance between points of opposed triangles, over all pairs: not less than the true one.
fn of_all_pairs(mesh: &TriangleMesh) -> f32 {
    let points = |triangle: usize| {
        let [a, b, c] = mesh.corners(triangle);
        [a, b, c, (a + b + c) / 3.0]
    };
    let mut least = f32::INFINITY;
    for i in 0..mesh.triangles().len() {
        for j in 0..i {
            if mesh.normal(i).dot(mesh.normal(j)) < -2e-3 {
                for p in points(i) {
                    least = points(j)
                        .into_iter()
                        .fold(least, |least, q| least.min(p.distance(q)));
                }
            }
        }
    }
    least
}

#[test]
fn opposed_faces_of_a_turned_box_are_its_shortest_edge_apart() {
    for cells in [1, 5] {
        let mesh = cuboid(Vec3::new(0.2, 0.15, 0.3), cells);
        let mesh = moved(
            &mesh,
            Quat::from_rotation_x(0.7) * Quat::from_rotation_y(0.4),
            Vec3::ONE,
        );
        let distance = apart(&mesh);
        assert!((distance - 0.3).abs() < 0.3 * OPPOSED_ACCURACY, "{distance}");
    }
}

#[test]
fn agrees_with_all_pairs_of_triangles() {
    let meshes = [
        sphere(0.1, 10),
        torus(0.2, 0.06, 10),
        cylinder_mesh(0.1, 0.2, 18, 4),
    ];
    for mesh in meshes {
        let (distance, least) = (apart(&mesh), of_all_pairs(&mesh));
        assert!(distance <= least * (1.0 + OPPOSED_ACCURACY), "{distance} {least}");
        // Points are up to a triangle's size from the nearest ones.
        assert!(distance > 0.6 * least, "{distance}, {least}");
    }
}

#[test]
fn one_thin_place_of_a_large_surface_is_enough() {
    let mesh = cuboid(Vec3::new(0.3, 0.3, 0.04), 8);
    assert_eq!(
        unstopped(|stop| opposed_distance(&mesh, |_| true, 0.1, 0.5, stop)),
        OpposedDistance::CloseOrUnknown
    );
    let is_edge = |triangle: u32| mesh.normal(triangle as usize).z.abs() < 0.5;
    assert_eq!(
        unstopped(|stop| opposed_distance(&mesh, is_edge, 0.1, 0.5, stop)),
        OpposedDistance::BeyondLimit
    );
    assert_eq!(
        unstopped(|stop| opposed_distance(&mesh, |_| false, 0.1, 0.5, stop)),
        OpposedDistance::BeyondLimit
    );
}

/// A profile in y and z, counterclockwise seen from +x, swept along x.
fn swept(profile: &[(f32, f32)], half_length: f32) -> TriangleMesh {
    let positions = [-half_length, half_length]
        .into_iter()
        .flat_map(|x| profile.iter().map(move |&(y, z)| Vec3::new(x, y, z)))
        .collect();
    let n = profile.len() as u32;
    let sides = (0..n).flat_map(|a| {
        let b = (a + 1) % n;
        [[a, b, n + b], [a, n + b, n + a]]
    });
    let caps = (1..n - 1).flat_map(|a| [[0, a + 1, a], [n, n + a, n + a + 1]]);
    TriangleMesh::new(positions, sides.chain(caps).collect()).expect("it is a mesh")
}

/// A wedge along x whose edge, at the origin, encloses an angle in radians.
fn wedge(angle: f32, half_length: f32) -> TriangleMesh {
    let depth = 0.04;
    let half_height = depth * (0.5 * angle).tan();
    swept(
        &[(half_height, -depth), (0.0, 0.0), (-half_height, -depth)],
        half_length,
    )
}

/// A cone along z with its tip at the origin and half an angle in radians there.
fn cone(half_angle: f32) -> TriangleMesh {
    let length = 0.05;
    meshes::double_cone([0.0, -length], -length, length * half_angle.tan(), 24)
}

/// A blade along x, 6 cm long: its faces meet at an angle in radians in front of an end at the origin that is cut off, or
/// rounded by a number of faces.
fn blade(angle: f32, end_thickness: f32, rounding: u32) -> TriangleMesh {
    let depth = 0.02;
    let half = 0.5 * end_thickness;
    let mut profile = vec![(half + depth * (0.5 * angle).tan(), -depth)];
    for step in 0..=rounding {
        let turn = std::f32::consts::PI * (step as f32 / rounding as f32 - 0.5);
        profile.push((
            -half * turn.sin(),
            half * turn.cos() * f32::from(u8::from(rounding > 1)),
        ));
    }
    profile.push((-half - depth * (0.5 * angle).tan(), -depth));
    swept(&profile, 0.03)
}

fn sharp_features(mesh: &TriangleMesh) -> SharpFeatures {
    unstopped(|stop| SharpFeatures::of(&MeshBvh::build(mesh.clone()), stop))
}

#[test]
fn a_worn_or_rounded_blade_is_sharp_along_its_edge_only() {
    for rounding in [1, 6] {
        let mesh = blade(12_f32.to_radians(), 0.001, rounding);
        assert!(mesh.signed_volume() > 0.0);
        let sharp = sharp_features(&mesh);
        for x in [-0.027, -0.01, 0.0, 0.02, 0.027] {
            assert!(sharp.are_near(Vec3::new(x, 0.0004, -0.0005)), "{rounding}: {x}");
            assert!(!sharp.are_near(Vec3::new(x, 0.001, -0.01)), "{rounding}: {x}");
        }
    }
}

#[test]
fn cards_and_blades_with_thick_ends_are_not_sharp() {
    // A card's sides are parallel, even if its rim is rounded.
    for (angle, end_thickness, rounding) in [
        (0.0, 0.0008, 1),
        (0.0, 0.0008, 8),
        (12_f32.to_radians(), 0.0025, 1),
    ] {
        let mesh = blade(angle, end_thickness, rounding);
        assert!(
            sharp_features(&mesh).is_empty(),
            "{angle} {end_thickness} {rounding}"
        );
    }
}

#[test]
fn a_narrow_wedge_is_sharp_along_its_edge_only() {
    let sharp = sharp_features(&wedge(20_f32.to_radians(), 0.05));
    for x in [-0.045, -0.01, 0.0, 0.02, 0.045] {
        assert!(sharp.are_near(Vec3::new(x, 0.0, -0.0005)), "{x}");
        assert!(!sharp.are_near(Vec3::new(x, 0.0, -0.008)), "{x}");
    }
}

#[test]
fn wide_wedges_boxes_and_balls_are_not_sharp() {
    for mesh in [
        wedge(35_f32.to_radians(), 0.05),
        cuboid(Vec3::new(0.04, 0.02, 0.0005), 3),
        sphere(0.03, 16),
    ] {
        assert!(sharp_features(&mesh).is_empty());
    }
}

#[test]
fn an_edge_shorter_than_a_centimetre_is_a_flaw_of_the_mesh() {
    assert!(sharp_features(&wedge(20_f32.to_radians(), 0.004)).is_empty());
}

#[test]
fn a_narrow_cone_has_a_point_and_a_wide_one_has_none() {
    let sharp = sharp_features(&cone(15_f32.to_radians()));
    assert!(sharp.are_near(Vec3::new(0.0, 0.0, -0.001)));
    assert!(!sharp.are_near(Vec3::new(0.0, 0.0, -0.02)));
    assert!(sharp_features(&cone(40_f32.to_radians())).is_empty());
}

#[test]
fn a_groove_is_no_edge() {
    // The wedge inside out: a slot that fingers cannot reach into.
    let wedge = wedge(20_f32.to_radians(), 0.05);
    let flipped = wedge.triangles().iter().map(|&[a, b, c]| [a, c, b]).collect();
    let slot = TriangleMesh::new(wedge.positions().to_vec(), flipped).expect("it is a mesh");
    assert!(sharp_features(&slot).is_empty());
}
