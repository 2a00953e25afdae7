//! Containment against winding numbers.

use crate::prelude::*;

/// Largest fraction of a winding number that [`compare`] takes for that of a point far from sheets and holes.
const WHOLE: f64 = 0.05;

/// Compares containment with the winding number; returns how many points were inside. Where `has_sheets`, points with
/// fractional winding numbers are left out: sheets, which enclose nothing, have a share in them.
fn compare(name: &str, mesh: &TriangleMesh, count: usize, has_sheets: bool) -> usize {
    let bvhs = [MeshBvh::build(mesh.clone()), MeshBvh::build_quick(mesh.clone())];
    let mut random = Random::new(4);
    let mut inside = 0;
    for i in 0..count {
        let point = if random.index(3) == 0 {
            let (surface, triangle) = random.on_surface(mesh);
            surface + mesh.normal(triangle) * random.between(-1e-3, 1e-3)
        } else {
            random.near(mesh, 0.002)
        };
        if distance_to_mesh(mesh, point) < 1e-6 {
            continue;
        }
        let winding = winding_number(mesh, point);
        let is_fraction = (winding - winding.round()).abs() > WHOLE;
        if (winding.abs() - 0.5).abs() < 1e-4 || has_sheets && is_fraction {
            continue;
        }
        let expected = winding.abs() > 0.5 && mesh.aabb().contains(point);
        for bvh in &bvhs {
            assert_eq!(bvh.contains(point), expected, "{name} {i} {point} {winding}");
        }
        inside += usize::from(expected);
    }
    inside
}

#[test]
fn containment_matches_the_winding_number() {
    // Each triangle of the soup is a sheet.
    let tilted = moved(&open_box(), Quat::from_rotation_y(-2.2), Vec3::ZERO);
    let all = meshes::all().into_iter().chain([("tilted open box", tilted)]);
    for (name, mesh) in all.filter(|(name, _)| *name != "soup") {
        let count = cases(5_000) as usize;
        let inside = compare(name, &mesh, count, false);
        assert!(100 * inside > count, "{name}: only {inside} points are inside");
    }
}

#[test]
fn containment_in_real_objects_matches_the_winding_number() {
    for (name, mesh) in real_objects() {
        let count = cases(400) as usize;
        let inside = compare(&name, &mesh, count, true);
        assert!(40 * inside > count, "{name}: only {inside} points are inside");
    }
}

#[test]
fn sheets_enclose_nothing() {
    for (bulge, name) in [(0.0, "a card"), (0.02, "a filled sail")] {
        let sheet = sheet(0.05, bulge, 8);
        let bvh = MeshBvh::build(sheet.clone());
        for triangle in 0..sheet.triangles().len() {
            let [a, b, c] = sheet.corners(triangle);
            for side in [-1e-5, 1e-5] {
                let point = (a + b + c) / 3.0 + sheet.normal(triangle) * side;
                assert!(!bvh.contains(point), "{name}, triangle {triangle}");
            }
        }
    }
}

/// As some programs export them: no two faces share a vertex, and rounding keeps them apart.
#[test]
fn faces_that_do_not_quite_meet_still_enclose_a_volume() {
    let half = Vec3::new(0.03, 0.05, 0.02);
    let whole = cuboid(half, 1);
    let mut random = Random::new(5);
    let mut positions = Vec::new();
    for triangle in 0..whole.triangles().len() {
        let shift = random.direction() * 1e-5;
        positions.extend(whole.corners(triangle).map(|corner| corner + shift));
    }
    let triangles = (0..whole.triangles().len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]);
    let apart = TriangleMesh::new(positions, triangles.collect()).expect("the mesh is sound");
    let bvh = MeshBvh::build(apart);
    for _ in 0..200 {
        let share = Vec3::from_array(std::array::from_fn(|_| random.between(-1.2, 1.2)));
        if (share.abs().max_element() - 1.0).abs() > 0.05 {
            let is_inside = share.abs().max_element() < 1.0;
            assert_eq!(bvh.contains(share * half), is_inside, "{share}");
        }
    }
}

/// A bottle without a bottom is a solid with a hole, whatever sheet is part of the same mesh.
#[test]
fn solids_next_to_sheets_keep_their_volume() {
    let sheet = sheet(0.05, 0.0, 4);
    let both = Parts::default()
        .with(&open_box(), Vec3::ZERO)
        .with(&sheet, Vec3::Z * 0.2);
    let bvh = MeshBvh::build(both.mesh());
    assert!(bvh.contains(Vec3::new(0.0, 0.0, -0.02)));
    assert!(!bvh.contains(Vec3::new(0.0, -1e-5, 0.2)));
    assert!(!bvh.contains(Vec3::new(0.0, 1e-5, 0.2)));
}

/// Points on a grid line up with edges and vertices in as many directions as possible.
#[test]
fn points_in_line_with_vertices_are_classified_correctly() {
    let half = Vec3::new(0.0625, 0.031_25, 0.015_625);
    let mesh = cuboid(half, 8);
    let bvh = MeshBvh::build(mesh);
    for x in -10..=10 {
        for y in -10..=10 {
            for z in -10..=10 {
                let share = Vec3::new(x as f32, y as f32, z as f32) / 8.0;
                if share.abs().max_element() == 1.0 {
                    continue;
                }
                let is_inside = share.abs().max_element() < 1.0;
                assert_eq!(bvh.contains(share * half), is_inside, "{share}");
            }
        }
    }
}

#[test]
fn a_segment_inside_touches_without_crossing() {
    let bvh = MeshBvh::build(cuboid(Vec3::splat(0.05), 3));
    let inside = Segment::new(Vec3::splat(-0.01), Vec3::splat(0.02));
    assert!(!bvh.is_crossed_by(inside));
    assert!(bvh.touches(inside));
    assert!(bvh.touches(Segment::new(Vec3::ZERO, Vec3::X)));
    assert!(!bvh.touches(Segment::new(Vec3::X, Vec3::Y)));
}
