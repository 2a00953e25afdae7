//! How much memory an object takes at rest, and what is derived from it: less than the bounds, and as much as the estimates say.

use std::{f32::consts::PI, sync::Arc};

use glam::Vec3;
use grasp_assets::hands::hand;
use grasp_synthesis::{
    base::stop::unstopped,
    geometry::mesh::TriangleMesh,
    model::{hand::Handedness, object::GraspObject, plain_object::PlainObject},
    propose::prepared::PreparedObject,
};

use crate::{ALLOCATOR, alone};

/// What an object may take at rest: a multiple of its mesh, and bytes in any case.
const MESHES: usize = 3;
const BYTES_AT_REST: usize = 64 << 10;

/// What may be derived from it, beside the hierarchy of its triangles.
const BYTES_DERIVED: usize = 400_000;

/// Largest error of an estimate, as a share, and what allocations take that nobody counts.
const ERROR: f64 = 0.05;
const UNCOUNTED: f64 = 16_384.0;

/// A bumpy ellipsoid of the size of a computer mouse, of `2 * side * (side - 1)` triangles.
fn ellipsoid(side: u32) -> TriangleMesh {
    let point = |row: u32, column: u32| {
        let polar = PI * row as f32 / side as f32;
        let around = 2.0 * PI * column as f32 / side as f32;
        let direction = Vec3::new(
            polar.sin() * around.cos(),
            polar.sin() * around.sin(),
            polar.cos(),
        );
        direction * Vec3::new(0.026, 0.018, 0.06) * (1.0 + 0.04 * (3.0 * polar).sin() * (4.0 * around).sin())
    };
    let mut positions = vec![point(0, 0), point(side, 0)];
    positions.extend((1..side).flat_map(|row| (0..side).map(move |column| point(row, column))));
    let at = |row: u32, column: u32| match row {
        0 => 0,
        _ if row == side => 1,
        _ => 2 + (row - 1) * side + column % side,
    };
    let mut triangles = Vec::with_capacity((2 * side * (side - 1)) as usize);
    for row in 0..side {
        for column in 0..side {
            let [a, b, c, d] = [
                at(row, column),
                at(row + 1, column),
                at(row + 1, column + 1),
                at(row, column + 1),
            ];
            if row + 1 < side {
                triangles.push([a, b, c]);
            }
            if row > 0 {
                triangles.push([a, c, d]);
            }
        }
    }
    TriangleMesh::new(positions, triangles).expect("the mesh is sound")
}

fn assert_agree(estimate: usize, measured: usize, what: &str) {
    let (estimate, measured) = (estimate as f64, measured as f64);
    assert!(
        (estimate - measured).abs() <= ERROR * measured + UNCOUNTED,
        "{what}: estimated {estimate}, measured {measured}"
    );
}

#[test]
fn memory_is_bounded_and_estimated_rightly() {
    let _alone = alone();
    let hands =
        [Handedness::Left, Handedness::Right].map(|side| hand("adult", side).expect("it is built in"));
    for hand in hands {
        hand.rig.oppositions();
    }
    for side in [32, 101] {
        let (before, mesh) = (ALLOCATOR.current_usage(), ellipsoid(side));
        let triangles = mesh.triangles().len();
        let of_mesh = size_of_val(mesh.positions()) + size_of_val(mesh.triangles());
        let plain = unstopped(|stop| PlainObject::new_until(mesh, 0.1, Vec3::ZERO, None, &[], stop));
        let plain = plain.expect("the object is sound");
        let at_rest = ALLOCATOR.current_usage() - before;
        assert_agree(plain.bytes(), at_rest, "at rest");
        assert!(
            at_rest <= MESHES * of_mesh + BYTES_AT_REST,
            "{triangles} triangles: {at_rest}"
        );

        let before = ALLOCATOR.current_usage();
        let object = unstopped(|stop| GraspObject::of_until(plain, stop));
        let prepared = PreparedObject::new(Arc::new(object));
        for hand in hands {
            prepared.placement_cache(&hand.rig);
        }
        let derived = ALLOCATOR.current_usage() - before;
        let surface = &prepared.surface;
        let of_hierarchy = surface.bytes() - surface.distance_field_bytes();
        println!(
            "{triangles} triangles: {at_rest} bytes at rest, {derived} derived, {of_hierarchy} of them the hierarchy"
        );
        assert_agree(prepared.derived_bytes(), derived, "derived");
        assert!(
            derived - of_hierarchy <= BYTES_DERIVED,
            "{triangles} triangles: {derived}"
        );
    }
}
