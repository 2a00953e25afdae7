//! How thick meshes are near a point, against closed forms.

use glam::Vec3;
use grasp_synthesis::geometry::local_thickness::LocalThickness;

use crate::fixtures::meshes::{Parts, cuboid, sphere};

/// Largest error, as a share: samples rarely lie exactly at the outermost points.
const TOLERANCE: f32 = 0.08;

fn assert_near(found: f32, expected: f32, what: &str) {
    assert!(
        (found / expected - 1.0).abs() < TOLERANCE,
        "{what}: {found} m instead of {expected} m"
    );
}

#[test]
fn small_objects_have_the_mean_of_their_smaller_half_extents() {
    let half = Vec3::new(0.012, 0.05, 0.02);
    let thickness = LocalThickness::of(&cuboid(half, 3));
    assert_near(thickness.near(Vec3::ZERO), 0.016, "a box");
    let ball = LocalThickness::of(&sphere(0.03, 16));
    assert_near(ball.near(Vec3::new(0.01, -0.02, 0.03)), 0.03, "a ball");
}

#[test]
fn what_is_far_from_the_hand_does_not_count() {
    let stick = Parts::default().cuboid(Vec3::ZERO, Vec3::new(0.01, 0.65, 0.01), 1);
    let with_bar = stick
        .clone()
        .cuboid(Vec3::new(0.0, 0.65, 0.0), Vec3::new(0.15, 0.01, 0.01), 1);
    let [bare, barred] = [stick, with_bar].map(|parts| LocalThickness::of(&parts.mesh()));
    for height in [-0.6, -0.3, 0.0, 0.3, 0.5] {
        let place = Vec3::new(0.0, height, 0.0);
        assert_near(bare.near(place), 0.01, "the bare stick");
        assert_near(barred.near(place), 0.01, "the stick with a bar");
    }
    assert!(barred.near(Vec3::new(0.0, 0.65, 0.0)) > 0.02);
}

/// Samples of a large face are sparse, but it is not thin.
#[test]
fn large_faces_are_thick() {
    let board = LocalThickness::of(&cuboid(Vec3::new(1.5, 0.01, 1.5), 1));
    assert!(board.near(Vec3::ZERO) > 0.03);
}
