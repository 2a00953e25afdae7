//! Crossings of segments and meshes against all triangles.

use crate::prelude::*;

/// Compares both crossing queries with brute force; returns how many segments cross and how many are too close to call.
fn compare(name: &str, mesh: &TriangleMesh, bvhs: &[MeshBvh], count: usize, seed: u64) -> (usize, usize) {
    let mut random = Random::new(seed);
    let (mut crossed, mut doubtful) = (0, 0);
    for i in 0..count {
        let segment = random.segment(mesh);
        let expected = oracle::crosses_mesh(mesh, segment);
        doubtful += usize::from(expected.doubtful);
        crossed += usize::from(expected.nearest.is_some());
        for bvh in bvhs {
            compare_one(&format!("{name} {i}"), bvh, segment, &expected);
        }
    }
    (crossed, doubtful)
}

fn compare_one(name: &str, bvh: &MeshBvh, segment: Segment, expected: &oracle::MeshVerdict) {
    let any = bvh.is_crossed_by(segment);
    let first = bvh.first_hit(segment);
    assert_eq!(any, first.is_some(), "{name}: {segment:?} {first:?}");
    let length = segment.start.distance(segment.end);
    if let Some(hit) = first {
        let on_segment = segment.start + (segment.end - segment.start) * (hit.distance / length);
        assert!(hit.position.distance(on_segment) < 1e-6, "{name}: {hit:?}");
        let off = oracle::distance_to_triangle(bvh.mesh().corners(hit.triangle as usize), hit.position);
        assert!(off < 1e-6, "{name}: {hit:?} is {off} m off its triangle");
    }
    if let Some((triangle, t)) = expected.nearest {
        let hit = first.unwrap_or_else(|| panic!("{name}: {segment:?} misses triangle {triangle} at {t}"));
        let beyond = f64::from(hit.distance) - t * f64::from(length);
        // A triangle that is too close to call may come first.
        assert!(beyond < 1e-7, "{name} {hit:?} {beyond}");
        assert!(expected.doubtful || beyond > -1e-7, "{name} {hit:?} {beyond}");
    } else if !expected.doubtful {
        assert!(!any, "{name}: {segment:?} crosses nothing, but {first:?}");
    }
}

/// The mesh in both qualities.
fn both(mesh: &TriangleMesh) -> [MeshBvh; 2] {
    [MeshBvh::build(mesh.clone()), MeshBvh::build_quick(mesh.clone())]
}

#[test]
fn crossings_match_brute_force() {
    for (seed, (name, mesh)) in meshes::all().into_iter().enumerate() {
        let count = cases(10_000) as usize;
        let (crossed, doubtful) = compare(name, &mesh, &both(&mesh), count, seed as u64);
        // Else the comparison proves nothing. Segments on vertices, on the surface or without length, about half, are
        // too close to call.
        assert!(20 * crossed > count, "{name}: only {crossed} segments cross");
        assert!(100 * doubtful < 65 * count, "{name} {doubtful}");
    }
}

#[test]
fn crossings_of_real_objects_match_brute_force() {
    for (name, mesh) in real_objects() {
        let count = cases(1_000) as usize;
        let (crossed, _) = compare(&name, &mesh, &both(&mesh), count, 5);
        assert!(10 * crossed > count, "{name}: only {crossed} segments cross");
    }
}

/// `f32` holds the box' coordinates exactly, so points on its faces are exact.
#[test]
fn segments_that_end_on_the_surface_cross_it() {
    let half = Vec3::new(0.0625, 0.031_25, 0.015_625);
    let bvh = MeshBvh::build(cuboid(half, 8));
    let mut random = Random::new(1);
    for _ in 0..10_000 {
        let axis = random.index(3);
        let side = if random.index(2) == 0 { 1.0 } else { -1.0 };
        let mut on_face = random.in_cube() * half;
        on_face[axis] = side * half[axis];
        let mut away = random.direction();
        away[axis] = side * away[axis].abs().max(1e-3);
        let outside = on_face + away * random.between(1e-5, 0.05);
        for segment in [Segment::new(on_face, outside), Segment::new(outside, on_face)] {
            assert!(bvh.is_crossed_by(segment), "{segment:?}");
        }
        let hit = bvh.first_hit(Segment::new(on_face, outside));
        assert_eq!(hit.map(|hit| (hit.position, hit.distance)), Some((on_face, 0.0)));
    }
}

/// Whatever the rounding.
#[test]
fn no_segment_slips_through_shared_edges_or_vertices() {
    for (name, mesh) in meshes::solids() {
        let bvh = MeshBvh::build(mesh.clone());
        let mut random = Random::new(2);
        let mut tested = 0;
        for _ in 0..5_000 {
            let triangle = random.index(mesh.triangles().len());
            let [a, b, _] = mesh.corners(triangle);
            let share = if random.index(4) == 0 {
                0.0
            } else {
                random.between(0.0, 1.0)
            };
            let on_edge = a + (b - a) * share;
            // Through the surface along a slanted normal.
            let through = (mesh.normal(triangle) + 0.3 * random.direction()) * 0.0002;
            // At a sharp edge the segment might only touch; it must pass all triangles there in the same sense.
            let only_touches = (0..mesh.triangles().len()).any(|other| {
                let close = oracle::distance_to_triangle(mesh.corners(other), on_edge) < 2e-4;
                close && mesh.normal(other).dot(through) < 0.1 * through.length()
            });
            if only_touches {
                continue;
            }
            tested += 1;
            let segment = Segment::new(on_edge - through, on_edge + through);
            assert!(bvh.is_crossed_by(segment), "{name}: {segment:?}");
        }
        assert!(tested > 200 || name == "needle", "{name}: only {tested} segments");
    }
}

#[test]
fn degenerate_segments_are_answered_without_panic() {
    for (name, mesh) in meshes::all() {
        let bvh = MeshBvh::build_quick(mesh.clone());
        for position in mesh.positions() {
            assert!(!bvh.is_crossed_by(Segment::new(*position, *position)), "{name}");
        }
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let bad = Vec3::new(0.0, bad, 0.0);
            for segment in [
                Segment::new(bad, Vec3::ZERO),
                Segment::new(Vec3::ZERO, bad),
                Segment::new(bad, bad),
            ] {
                assert!(!bvh.is_crossed_by(segment), "{name}: {segment:?}");
                assert_eq!(bvh.first_hit(segment), None, "{name}: {segment:?}");
            }
            assert!(!bvh.contains(bad), "{name}");
            assert_eq!(bvh.closest_point_within(bad, 1.0), None, "{name}");
        }
        assert_eq!(bvh.closest_point_within(Vec3::ZERO, f32::NAN), None, "{name}");
        assert_eq!(bvh.closest_point_within(Vec3::ZERO, -1.0), None, "{name}");
    }
}

/// A tree far deeper than usual must not overflow a query's stack.
#[test]
fn deep_trees_are_searched_without_overflow() {
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    // Each triangle is a ninth larger than the one before and its box contains that one, so the tree becomes a chain.
    for i in 0..300_u32 {
        let size = 1e-7 * 1.11_f32.powf(i as f32);
        let base = Vec3::new(0.0, 0.0, size);
        positions.extend([base, Vec3::X * size, Vec3::Y * size]);
        triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
    }
    let mesh = TriangleMesh::new(positions, triangles).expect("the mesh is sound");
    for bvh in both(&mesh) {
        for triangle in 0..mesh.triangles().len() {
            let [a, b, c] = mesh.corners(triangle);
            let middle = (a + b + c) / 3.0;
            let lift = Vec3::ONE * (b - a).length() * 0.01;
            assert!(
                bvh.is_crossed_by(Segment::new(middle - lift, middle + lift)),
                "{triangle}"
            );
        }
    }
}
