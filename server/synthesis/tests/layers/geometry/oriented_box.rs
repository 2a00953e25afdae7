//! Oriented boxes around meshes.

use grasp_synthesis::geometry::aabb::Aabb;

use crate::prelude::*;

/// Checks the box of any mesh.
fn check(name: &str, mesh: &TriangleMesh) -> OrientedBox {
    let fitted = OrientedBox::around(mesh);
    let aabb = mesh.aabb();
    let rounding = 1e-6 * (aabb.diagonal() + aabb.centre().length());
    assert!(
        fitted.volume() <= (aabb.extents() + rounding).element_product(),
        "{name}: {fitted:?} is larger than {aabb:?}"
    );
    let touched = mesh.positions().iter().fold(Aabb::EMPTY, |touched, &position| {
        assert!(fitted.contains(position), "{name} {position} {fitted:?}");
        touched.including(fitted.object_from_box.inverse().transform_point(position))
    });
    let slack = (fitted.half_extents - touched.max)
        .abs()
        .max((fitted.half_extents + touched.min).abs());
    assert!(
        slack.max_element() < 4e-6 * (1.0 + aabb.centre().length()),
        "{name}: {fitted:?} has slack {slack}"
    );
    assert_eq!(fitted, OrientedBox::around(mesh), "{name}");
    fitted
}

fn sorted(extents: Vec3) -> [f32; 3] {
    let mut sorted = extents.to_array();
    sorted.sort_by(f32::total_cmp);
    sorted
}

#[test]
fn boxes_fit_their_meshes_tightly() {
    for (name, mesh) in meshes::all() {
        check(name, &mesh);
    }
    for (name, mesh) in real_objects() {
        check(&name, &mesh);
    }
}

#[test]
fn turned_boxes_are_recovered() {
    let mut random = Random::new(6);
    for i in 0..60 {
        let half = match i % 4 {
            0 => Vec3::splat(0.04),
            1 => Vec3::new(0.04, 0.04, 0.01),
            _ => Vec3::splat(0.001) + 0.1 * random.in_cube().abs(),
        };
        let turned = moved(&cuboid(half, 4), random.rotation(), random.in_cube());
        let fitted = check("turned box", &turned);
        for (found, expected) in sorted(fitted.half_extents).into_iter().zip(sorted(half)) {
            assert!(
                (found - expected).abs() < 0.01 * expected + 1e-6,
                "{:?} is not {half}",
                fitted.half_extents
            );
        }
        let aabb = turned.aabb().extents().element_product();
        assert!(fitted.volume() < 0.99 * aabb || i < 4, "{aabb} {fitted:?}");
    }
}

#[test]
fn an_aligned_box_keeps_the_axes_of_the_object() {
    let half = Vec3::new(0.02, 0.05, 0.03);
    let fitted = OrientedBox::around(&cuboid(half, 2));
    assert!(
        fitted.object_from_box.orientation.w.abs() > 0.999_999,
        "{fitted:?}"
    );
    assert!(fitted.half_extents.distance(half) < 1e-5, "{fitted:?}");
}

#[test]
fn a_flat_mesh_gets_a_flat_box() {
    let mut random = Random::new(10);
    let rotation = random.rotation();
    let corners = [(0.0, 0.0), (0.2, 0.0), (0.2, 0.1), (0.0, 0.1)];
    let mesh = TriangleMesh::new(
        corners.map(|(x, y)| rotation * Vec3::new(x, y, 0.0)).to_vec(),
        vec![[0, 1, 2], [0, 2, 3]],
    )
    .expect("it is sound");
    let [thickness, width, length] = sorted(check("rectangle", &mesh).half_extents);
    assert!(thickness < 1e-6, "{thickness}");
    assert!(
        (width - 0.05).abs() < 5e-4 && (length - 0.1).abs() < 1e-3,
        "{width} {length}"
    );
}

#[test]
fn distances_to_the_box_match_its_surface() {
    let rotation = Quat::from_axis_angle(Vec3::new(0.0, 0.6, 0.8), 1.1);
    let half = Vec3::new(0.05, 0.03, 0.02);
    let mesh = moved(&cuboid(half, 1), rotation, Vec3::new(0.1, 0.2, -0.1));
    let fitted = check("box", &mesh);
    let mut random = Random::new(11);
    for _ in 0..2_000 {
        let point = random.near(&mesh, 0.05);
        let expected = distance_to_mesh(&mesh, point) as f32;
        let signed = fitted.signed_distance(point);
        assert!(
            (signed.abs() - expected).abs() < 1e-5,
            "{point}: {signed} {expected}"
        );
        assert_eq!(signed <= 0.0, fitted.contains(point), "{point}: {signed}");
        assert_eq!(fitted.distance(point), signed.max(0.0), "{point}");
    }
}
