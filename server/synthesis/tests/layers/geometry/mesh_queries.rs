//! Queries on meshes: closest points, containment, crossings of segments, and crowded surfaces.

use crate::prelude::*;
use grasp_synthesis::{base::stop::Stopped, model::plain_object::PlainObject};
use std::{sync::atomic::AtomicUsize, time::Instant};

fn compare_closest(name: &str, mesh: &TriangleMesh, bvh: &MeshBvh, count: usize) {
    let mut random = Random::new(3);
    let size = mesh.aabb().diagonal();
    for i in 0..count {
        let point = match random.index(3) {
            0 => random.near(mesh, 0.05),
            1 => random.on_surface(mesh).0,
            _ => random.on_surface(mesh).0 + random.direction() * random.between(0.0, 0.002),
        };
        let expected = distance_to_mesh(mesh, point);
        // Rounding of the closest point's coordinates.
        let tolerance = f64::from(f32::EPSILON * (point.length() + size)) + 1e-6 * expected;
        let limit = [f32::MAX.sqrt(), 0.08, 0.004][random.index(3)];
        match bvh.closest_point_within(point, limit) {
            Some(found) => {
                assert!(found.distance <= limit, "{name} {i}: {found:?}");
                let distance = f64::from(found.distance);
                assert!(
                    (distance - expected).abs() <= tolerance,
                    "{name} {i}: {point} {found:?}, brute force says {expected}"
                );
                assert!(
                    (f64::from(point.distance(found.position)) - distance).abs() <= tolerance,
                    "{name} {i}: {point} {found:?}"
                );
                let off = oracle::distance_to_triangle(mesh.corners(found.triangle as usize), found.position);
                assert!(off <= tolerance, "{name} {i} {found:?} {off}");
            }
            None => assert!(
                expected > f64::from(limit) - tolerance,
                "{name} {i}: {point} is {expected} m away, within {limit} m"
            ),
        }
    }
}

#[test]
fn closest_points_match_brute_force() {
    for (name, mesh) in meshes::all_and_real() {
        let count = cases_for(&name, 10_000);
        compare_closest(&name, &mesh, &MeshBvh::build(mesh.clone()), count);
        compare_closest(&name, &mesh, &MeshBvh::build_quick(mesh.clone()), count / 5);
    }
}

/// Largest fraction of a winding number that [`compare_containment`] takes for that of a point far from sheets and holes.
const WHOLE: f64 = 0.05;

/// Compares containment with the winding number; returns how many points were inside. Where `has_sheets`, points with
/// fractional winding numbers are left out: sheets, which enclose nothing, have a share in them.
fn compare_containment(name: &str, mesh: &TriangleMesh, count: usize, has_sheets: bool) -> usize {
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
    let tilted = moved(&open_box(), Quat::from_rotation_y(-2.2), Vec3::ZERO);
    let all = meshes::all_and_real().chain([("tilted open box".to_owned(), tilted)]);
    // Each triangle of the soup is a sheet.
    for (name, mesh) in all.filter(|(name, _)| *name != "soup") {
        let count = cases_for(&name, 5_000);
        let inside = compare_containment(&name, &mesh, count, name.contains('/'));
        assert!(100 * inside > count, "{name}: only {inside} points are inside");
    }
}

#[test]
fn sheets_enclose_nothing_and_solids_beside_them_keep_their_volume() {
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
    // A bottle without a bottom is a solid with a hole, whatever sheet is part of the same mesh.
    let both = Parts::default()
        .with(&open_box(), Vec3::ZERO)
        .with(&sheet(0.05, 0.0, 4), Vec3::Z * 0.2);
    let bvh = MeshBvh::build(both.mesh());
    assert!(bvh.contains(Vec3::new(0.0, 0.0, -0.02)));
    assert!(
        [1e-5, -1e-5]
            .iter()
            .all(|&y| !bvh.contains(Vec3::new(0.0, y, 0.2)))
    );
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

/// Compares both crossing queries with brute force; returns how many segments cross and how many are too close to call.
fn compare_crossings(
    name: &str,
    mesh: &TriangleMesh,
    bvhs: &[MeshBvh],
    count: usize,
    seed: u64,
) -> (usize, usize) {
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

/// How many cases to compare with brute force.
fn cases_for(name: &str, most: u32) -> usize {
    cases(if name.contains('/') { most / 10 } else { most }) as usize
}

fn both(mesh: &TriangleMesh) -> [MeshBvh; 2] {
    [MeshBvh::build(mesh.clone()), MeshBvh::build_quick(mesh.clone())]
}

#[test]
fn crossings_match_brute_force() {
    for (seed, (name, mesh)) in meshes::all_and_real().enumerate() {
        let count = cases_for(&name, 10_000);
        let (crossed, doubtful) = compare_crossings(&name, &mesh, &both(&mesh), count, seed as u64);
        // Else the comparison proves nothing. Segments on vertices, on the surface or without length, about half, are
        // too close to call.
        assert!(20 * crossed > count, "{name}: only {crossed} segments cross");
        assert!(
            100 * doubtful < 65 * count || name.contains('/'),
            "{name} {doubtful}"
        );
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
fn degenerate_queries_are_answered_without_panic() {
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
    let surface = MeshBvh::build(cuboid(Vec3::splat(0.02), 3));
    for broken in [f32::NAN, f32::INFINITY] {
        let capsule = TaperedCapsule::new(Vec3::X, Vec3::Y * broken, 0.01, 0.01);
        assert_eq!(surface.closest_to_capsule(&capsule, f32::INFINITY), None);
        assert!(!surface.comes_within(&capsule, 0.01));
    }
}

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

fn prepared(mesh: TriangleMesh, stop: Stop<'_>) -> Result<PreparedObject, Stopped> {
    let plain = PlainObject::new_until(mesh, 0.1, Vec3::ZERO, None, &[], stop)?;
    let object = GraspObject::of_until(plain.unwrap(), stop)?;
    PreparedObject::new_until(Arc::new(object), stop)
}

#[test]
fn needles_through_one_place_are_prepared_in_bounded_time() {
    let started = Instant::now();
    let object = prepared(meshes::needles(10_000), Stop::NEVER).unwrap();
    // Without bounds, it takes minutes; a second is usual for a busy machine.
    assert!(
        started.elapsed() < Duration::from_secs(10),
        "{:?}",
        started.elapsed()
    );
    assert!(object.surface.is_crowded());
    assert!(!MeshBvh::build(cuboid(Vec3::splat(0.05), 2)).is_crowded());
}

#[test]
fn preparation_stops_at_any_check() {
    let checks = AtomicUsize::new(0);
    let count = || {
        checks.fetch_add(1, Ordering::Relaxed);
        false
    };
    prepared(cuboid(Vec3::splat(0.05), 2), Stop::when(&count)).expect("nothing stops it");
    let all = checks.load(Ordering::Relaxed);
    assert!(all > 1000, "{all}");
    for last in [0, 1, 10, all / 10, all / 3, all / 2, all - 100] {
        let left = AtomicUsize::new(last);
        let runs_out = || {
            left.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| left.checked_sub(1))
                .is_err()
        };
        let stopped = prepared(cuboid(Vec3::splat(0.05), 2), Stop::when(&runs_out));
        assert_eq!(stopped.err(), Some(Stopped), "after {last} of {all} checks");
    }
}

#[test]
fn memory_does_not_grow_with_the_size_of_the_object() {
    for half_extents in [
        Vec3::new(5e5, 1e-3, 1e-3),
        Vec3::new(5e5, 5e5, 1e-3),
        Vec3::splat(5e5),
        Vec3::splat(5e-7),
        Vec3::new(5e-7, 1e-9, 1e-9),
    ] {
        let object = prepared(cuboid(half_extents, 1), Stop::NEVER).unwrap();
        let bytes = object.surface.distance_field_bytes();
        assert!(bytes <= 1 << 20, "{half_extents}: {bytes}");
        assert!(object.bounding_box.half_extents.is_finite());
    }
}
