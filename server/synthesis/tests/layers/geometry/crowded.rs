//! Objects that are hard to prepare: thousands of triangles through one place, and sizes that nobody holds.

use std::{sync::atomic::AtomicUsize, time::Instant};

use grasp_synthesis::base::stop::Stopped;

use crate::prelude::*;

/// Thin triangles a metre long and 10 µm wide, in all directions through the origin.
fn needles(count: usize) -> TriangleMesh {
    let golden_angle = std::f32::consts::PI * (3.0 - 5.0_f32.sqrt());
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    for needle in 0..count {
        let height = 1.0 - 2.0 * (needle as f32 + 0.5) / count as f32;
        let radius = (1.0 - height * height).sqrt();
        let (sin, cos) = (golden_angle * needle as f32).sin_cos();
        let along = 0.5 * Vec3::new(radius * cos, height, radius * sin);
        let first = positions.len() as u32;
        positions.extend([along, -along, along.any_orthonormal_vector() * 1e-5 - along]);
        triangles.push([first, first + 1, first + 2]);
    }
    TriangleMesh::new(positions, triangles).unwrap()
}

fn prepared(mesh: TriangleMesh, stop: Stop<'_>) -> Result<PreparedObject, Stopped> {
    let object = GraspObject::new_until(mesh, 0.1, Vec3::ZERO, None, &[], stop)?;
    PreparedObject::new_until(Arc::new(object.unwrap()), stop)
}

#[test]
fn needles_through_one_place_are_prepared_in_bounded_time() {
    let started = Instant::now();
    let object = prepared(needles(10_000), Stop::NEVER).unwrap();
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
fn bounds_on_gaps_hold_on_a_crowded_surface() {
    let surface = MeshBvh::build(needles(4_000));
    for place in 0..200 {
        let start = Vec3::new((place % 7) as f32, (place % 11) as f32, (place % 13) as f32) * 0.06 - 0.3;
        let capsule = TaperedCapsule::new(start, start + Vec3::new(0.03, 0.01, -0.02), 0.008, 0.006);
        let gap = surface
            .closest_to_capsule(&capsule, 2.0)
            .expect("the surface is nearer")
            .gap;
        assert!(surface.gap_lower_bound(&capsule) <= gap + 1e-5, "{start}: {gap}");
    }
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
