//! Sharp edges and points.

use grasp_synthesis::geometry::sharp::SharpFeatures;

use crate::prelude::*;

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
