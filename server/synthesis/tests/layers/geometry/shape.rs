//! The shape of a mesh: inner balls, local shape and thickness, opposed places, sharp edges and points.

use crate::fixtures::meshes::solids;
use crate::prelude::*;
use grasp_synthesis::geometry::local_shape::{Curvature, LocalShape, Part};
use grasp_synthesis::geometry::mesh::MeshError;
use grasp_synthesis::geometry::opposed::{OPPOSED_ACCURACY, OpposedDistance, opposed_distance};
use grasp_synthesis::geometry::sharp::SharpFeatures;
use grasp_synthesis::geometry::surface_samples::{LocalThickness, SurfaceSample};
use grasp_synthesis::geometry::topology::Topology;
use grasp_synthesis::model::holdout::{Ball, inner_balls};
use std::f64::consts::PI;

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
fn the_largest_ball_is_first_and_fills_a_sphere_and_a_sheet_has_none() {
    let balls = balls_in(sphere(0.03, 20));
    assert!((balls[0].radius - 0.03).abs() < 5e-4, "{:?}", balls[0]);
    let boxed = balls_in(cuboid(Vec3::new(0.1, 0.02, 0.03), 10));
    assert!((boxed[0].radius - 0.02).abs() < 1e-4, "{:?}", boxed[0]);
    assert!(boxed.is_sorted_by(|a, b| a.radius >= b.radius));
    assert_eq!(balls_in(sheet(0.1, 0.0, 8)), []);
}

/// Largest error, as a share: a part consists of some dozens of patches.
const TOLERANCE: f32 = 0.15;

const SPHERE_CENTRE: Vec3 = Vec3::new(0.01, -0.02, 0.03);

fn around(mesh: &TriangleMesh, centre: Vec3, radius: f32) -> Part {
    let shape = LocalShape::of(&even_samples(mesh));
    shape.around(centre, radius).expect("the mesh has a surface")
}

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
fn every_piece_of_a_ball_is_spherical_and_other_shapes_are_less() {
    let ball = sphere(0.04, 24);
    // The inner wall counts as if turned over.
    let hollow =
        Parts::default()
            .sphere(SPHERE_CENTRE, 0.04, 24, true)
            .sphere(SPHERE_CENTRE, 0.037, 24, false);
    for (mesh, offset, radius) in [
        (&ball, Vec3::ZERO, 0.05),
        (&ball, Vec3::Y * 0.02, 0.03),
        (&ball, Vec3::X * 0.035, 0.03),
        (&hollow.mesh(), Vec3::ZERO, 0.05),
    ] {
        let sphericity = around(mesh, SPHERE_CENTRE + offset, radius).sphericity;
        assert!(sphericity > 0.95, "{sphericity} at {offset}");
    }
    let cube = around(&cuboid(Vec3::splat(0.03), 8), Vec3::ZERO, 0.06);
    assert_near(cube.sphericity, 0.6, "a cube");
    let can = around(&cylinder_mesh(0.03, 0.03, 32, 8), Vec3::ZERO, 0.06);
    assert_near(can.sphericity, 0.72, "a can as high as wide");
    let plate = around(&cuboid(Vec3::new(0.05, 0.001, 0.05), 8), Vec3::ZERO, 0.03);
    assert!(plate.sphericity < 0.02, "{plate:?}");
}

#[test]
fn spreads_tell_thickness_and_radius() {
    let plate = around(&cuboid(Vec3::new(0.15, 0.003, 0.15), 4), Vec3::ZERO, 0.05);
    assert_near(plate.spreads[2], 0.003, "half a plate's thickness");
    assert!(plate.spreads[1] > 5.0 * plate.spreads[2], "{plate:?}");
    let rod = around(&cylinder_mesh(0.01, 0.1, 32, 8), Vec3::ZERO, 0.03);
    assert!(rod.sphericity < 0.35, "{rod:?}");
    for spread in &rod.spreads[1..] {
        assert_near(*spread, 0.01 / 2.0_f32.sqrt(), "a rod's radius over √2");
    }
    // The normals of a rod are spread over its cross-section.
    assert!(rod.facing.between(Vec3::Y, Vec3::Y) < 0.01, "{rod:?}");
    assert_near(rod.facing.between(Vec3::X, Vec3::X), 0.5, "normals along x");
}

#[test]
fn balls_curve_alike_in_all_directions_and_rods_and_edges_do_not() {
    let touched = |radius: f32| [Vec3::X, Vec3::NEG_X, Vec3::Z].map(|normal| (radius * normal, normal));
    let on_ball = touched(0.04).map(|(position, normal)| (SPHERE_CENTRE + position, normal));
    let ball = under(&sphere(0.04, 24), SPHERE_CENTRE, on_ball);
    assert!(ball.along > 0.7 && ball.roundness > 0.95, "{ball:?}");
    let rod = under(&cylinder_mesh(0.02, 0.1, 32, 8), Vec3::ZERO, touched(0.02));
    assert!(rod.along < 0.2 && rod.roundness > 0.9, "{rod:?}");
    // Edges do not curve.
    let rim = Vec3::new(0.03, 0.05, 0.0);
    let slanted = Vec3::new(1.0, 1.0, 0.0) * std::f32::consts::FRAC_1_SQRT_2;
    let points = [(rim, slanted), (-rim, -slanted), (Vec3::Z * 0.03, Vec3::Z)];
    let can = under(&cylinder_mesh(0.03, 0.05, 48, 8), Vec3::ZERO, points);
    assert!(can.along < 0.25, "{can:?}");
}

fn thickness(mesh: &TriangleMesh) -> LocalThickness {
    LocalThickness::of(&even_samples(mesh))
}

/// Root mean square distance of a square's sides from its middle, as a multiple of half its side.
const SQUARE: f32 = 1.154_700_5;

#[test]
fn parts_are_as_thick_as_near_the_hand() {
    let rod = thickness(&torus(0.5, 0.01, 96));
    assert_near(rod.near(Vec3::new(0.5, 0.0, 0.0)), 0.01, "a hoop");
    let bar = Parts::default().cuboid(Vec3::ZERO, Vec3::new(0.012, 0.4, 0.012), 1);
    let bar = thickness(&bar.mesh());
    assert_near(bar.near(Vec3::ZERO), 0.012 * SQUARE, "a square bar");
    let ball = thickness(&sphere(0.03, 16));
    let expected = 0.03 * (2.0_f32 / 3.0).sqrt();
    assert_near(ball.near(Vec3::new(0.01, -0.02, 0.03)), expected, "a ball");
    // Parts far from the hand do not count.
    let stick = Parts::default().cuboid(Vec3::ZERO, Vec3::new(0.01, 0.65, 0.01), 1);
    let with_bar = stick
        .clone()
        .cuboid(Vec3::new(0.0, 0.65, 0.0), Vec3::new(0.15, 0.01, 0.01), 1);
    let [bare, barred] = [stick, with_bar].map(|parts| thickness(&parts.mesh()));
    for height in [-0.6, -0.3, 0.0, 0.3, 0.5] {
        let place = Vec3::new(0.0, height, 0.0);
        assert_near(bare.near(place), 0.01 * SQUARE, "the bare stick");
        assert_near(barred.near(place), 0.01 * SQUARE, "the stick with a bar");
    }
    // Samples of a large face are sparse, but it is not thin.
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
fn agrees_with_all_pairs_of_triangles() {
    let turn = Quat::from_rotation_x(0.7) * Quat::from_rotation_y(0.4);
    let meshes = [
        sphere(0.1, 10),
        torus(0.2, 0.06, 10),
        cylinder_mesh(0.1, 0.2, 18, 4),
        moved(&cuboid(Vec3::new(0.2, 0.15, 0.3), 5), turn, Vec3::ONE),
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
fn narrow_wedges_and_worn_or_rounded_blades_are_sharp_along_their_edges_only() {
    let blades = [1, 6].map(|rounding| blade(12_f32.to_radians(), 0.001, rounding));
    for (shape, mesh) in blades
        .into_iter()
        .chain([wedge(20_f32.to_radians(), 0.03)])
        .enumerate()
    {
        let sharp = sharp_features(&mesh);
        for x in [-0.027, -0.01, 0.0, 0.02, 0.027] {
            assert!(sharp.are_near(Vec3::new(x, 0.0004, -0.0005)), "{shape}: {x}");
            assert!(!sharp.are_near(Vec3::new(x, 0.001, -0.01)), "{shape}: {x}");
        }
    }
}

#[test]
fn blunt_wide_short_or_hollow_edges_are_not_sharp() {
    let edge = wedge(20_f32.to_radians(), 0.05);
    let flipped = edge.triangles().iter().map(|&[a, b, c]| [a, c, b]).collect();
    let groove = TriangleMesh::new(edge.positions().to_vec(), flipped).expect("it is a mesh");
    for (what, mesh) in [
        ("a card, whose sides are parallel", blade(0.0, 0.0008, 1)),
        ("a card with a rounded rim", blade(0.0, 0.0008, 8)),
        ("a blade with a thick end", blade(12_f32.to_radians(), 0.0025, 1)),
        ("a wide wedge", wedge(35_f32.to_radians(), 0.05)),
        (
            "an edge of less than a centimetre",
            wedge(20_f32.to_radians(), 0.004),
        ),
        ("a slot that fingers cannot reach into", groove),
        ("a thin box", cuboid(Vec3::new(0.04, 0.02, 0.0005), 3)),
        ("a ball", sphere(0.03, 16)),
    ] {
        assert!(sharp_features(&mesh).is_empty(), "{what}");
    }
}

#[test]
fn a_narrow_cone_has_a_point_and_a_wide_one_has_none() {
    let sharp = sharp_features(&cone(15_f32.to_radians()));
    assert!(sharp.are_near(Vec3::new(0.0, 0.0, -0.001)));
    assert!(!sharp.are_near(Vec3::new(0.0, 0.0, -0.02)));
    assert!(sharp_features(&cone(40_f32.to_radians())).is_empty());
}

#[test]
fn volume_and_centroid_match_closed_forms() {
    let half = Vec3::new(0.05, 0.03, 0.02);
    let offset = Vec3::new(2.0, -3.0, 1.5);
    let turned = moved(&cuboid(half, 3), Random::new(8).rotation(), offset);
    let volume = 8.0 * f64::from(half.element_product());
    assert!((turned.signed_volume() / volume - 1.0).abs() < 1e-4);
    let centroid = turned.volume_centroid().expect("the box has a volume");
    assert!(centroid.distance(offset) < 1e-6, "{centroid}");
    let area = 8.0 * f64::from(half.x * half.y + half.y * half.z + half.z * half.x);
    assert!((turned.area() / area - 1.0).abs() < 1e-5);

    // A mesh inscribed in a torus is smaller by about 2/3 (π/n)² in each direction.
    let torus = torus(0.05, 0.015, 100);
    let volume = 2.0 * PI * PI * 0.05 * 0.015 * 0.015;
    let share = torus.signed_volume() / volume;
    assert!((0.998..1.0).contains(&share), "{share}");

    let pair =
        Parts::default()
            .cuboid(Vec3::ZERO, Vec3::splat(0.02), 20)
            .cuboid(Vec3::X, Vec3::splat(0.04), 1);
    let centroid = pair.mesh().volume_centroid().expect("it has a volume");
    assert!(centroid.distance(Vec3::X * (8.0 / 9.0)) < 1e-6, "{centroid}");
    assert_eq!(sheet(0.1, 0.0, 1).volume_centroid(), None);

    let inside_out = meshes::inside_out_sphere();
    assert!(inside_out.signed_volume() < 0.0);
    let centroid = inside_out.volume_centroid().expect("it has a volume");
    assert!(centroid.length() < 1e-6, "{centroid}");
}

#[test]
fn topology_distinguishes_closed_from_open_and_counts_parts() {
    let closed = Topology::of(&meshes::overlapping_boxes());
    assert!(closed.is_closed() && closed.is_consistently_wound());
    assert_eq!((closed.components, closed.non_manifold_edges), (2, 0));

    let open = Topology::of(&open_box());
    // Four sides of four cells.
    assert_eq!((open.boundary_edges, open.components), (16, 1));
    assert!(!open.is_closed());

    let soup = Topology::of(&meshes::soup());
    assert_eq!((soup.components, soup.boundary_edges), (300, 900));

    let sphere = sphere(0.04, 8);
    let mut triangles = sphere.triangles().to_vec();
    triangles[100].swap(0, 1);
    let flipped = TriangleMesh::new(sphere.positions().to_vec(), triangles).expect("it is sound");
    let flipped = Topology::of(&flipped);
    assert_eq!(flipped.miswound_edges, 3);
    assert!(flipped.is_closed() && !flipped.is_consistently_wound());

    // Two tetrahedra that share an edge: four triangles at that edge.
    let (x, y) = (Vec3::X, Vec3::Y);
    let positions = vec![Vec3::ZERO, Vec3::Z, x, x + y, -x, -x - y];
    let tetrahedron = |a: u32, b: u32, c: u32, d: u32| [[a, c, b], [a, b, d], [b, c, d], [a, d, c]];
    let triangles = [tetrahedron(0, 1, 2, 3), tetrahedron(0, 1, 4, 5)].concat();
    let pair = TriangleMesh::new(positions, triangles).expect("it is sound");
    let pair = Topology::of(&pair);
    assert_eq!((pair.non_manifold_edges, pair.boundary_edges), (1, 0));
    assert_eq!(pair.components, 1);
}

#[test]
fn rejects_broken_meshes_with_the_reason() {
    let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::X * 2.0];
    let new = |triangles: &[[u32; 3]]| TriangleMesh::new(positions.clone(), triangles.to_vec());
    assert_eq!(new(&[]), Err(MeshError::Empty));
    assert_eq!(
        new(&[[0, 1, 2], [0, 1, 9]]),
        Err(MeshError::IndexOutOfRange {
            triangle: 1,
            vertex: 9,
            vertices: 4
        })
    );
    assert_eq!(new(&[[0, 1, 3]]), Err(MeshError::Degenerate { triangle: 0 }));
    assert_eq!(new(&[[0, 1, 1]]), Err(MeshError::Degenerate { triangle: 0 }));
    assert_eq!(
        TriangleMesh::new(vec![Vec3::ZERO, Vec3::NAN, Vec3::Y], vec![[0, 1, 2]]),
        Err(MeshError::NotFinite { vertex: 1 })
    );
    let repaired = TriangleMesh::without_degenerates(positions.clone(), &[[0, 1, 3], [0, 1, 2]]);
    assert_eq!(repaired.expect("one triangle remains").triangles(), [[0, 1, 2]]);
    assert_eq!(
        TriangleMesh::without_degenerates(positions, &[[0, 1, 3]]),
        Err(MeshError::Empty)
    );
}

#[test]
fn normals_of_tiny_triangles_point_outward() {
    for scale in [1.0, 1e-4, 1e-8] {
        let turn = Quat::from_rotation_x(0.4);
        let positions = [Vec3::ZERO, Vec3::X, Vec3::Y].map(|p| turn * p * scale).to_vec();
        let mesh = TriangleMesh::new(positions, vec![[0, 1, 2]]).expect("it is sound");
        assert!(mesh.normal(0).distance(turn * Vec3::Z) < 1e-6, "{scale}");
    }
}
