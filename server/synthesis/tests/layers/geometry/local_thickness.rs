//! How thick meshes are near a point, against closed forms.

use grasp_synthesis::geometry::local_thickness::LocalThickness;

use crate::prelude::*;

/// Largest error, as a share: some dozens of samples make up a part.
const TOLERANCE: f32 = 0.12;

fn thickness(mesh: &TriangleMesh) -> LocalThickness {
    LocalThickness::of(&even_samples(mesh))
}

fn assert_near(found: f32, expected: f32, what: &str) {
    assert!(
        (found / expected - 1.0).abs() < TOLERANCE,
        "{what}: {found} m instead of {expected} m"
    );
}

/// Root mean square distance of a square's sides from its middle, as a multiple of half its side.
const SQUARE: f32 = 1.154_700_5;

#[test]
fn rods_are_as_thick_as_their_radius_and_balls_nearly() {
    let rod = thickness(&torus(0.5, 0.01, 96));
    assert_near(rod.near(Vec3::new(0.5, 0.0, 0.0)), 0.01, "a hoop");
    let bar = Parts::default().cuboid(Vec3::ZERO, Vec3::new(0.012, 0.4, 0.012), 1);
    let bar = thickness(&bar.mesh());
    assert_near(bar.near(Vec3::ZERO), 0.012 * SQUARE, "a square bar");
    let ball = thickness(&sphere(0.03, 16));
    let expected = 0.03 * (2.0_f32 / 3.0).sqrt();
    assert_near(ball.near(Vec3::new(0.01, -0.02, 0.03)), expected, "a ball");
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
        assert_near(bare.near(place), 0.01 * SQUARE, "the bare stick");
        assert_near(barred.near(place), 0.01 * SQUARE, "the stick with a bar");
    }
}

/// Samples of a large face are sparse, but it is not thin.
#[test]
fn large_faces_are_thick() {
    let board = thickness(&cuboid(Vec3::new(1.5, 0.01, 1.5), 1));
    assert!(board.near(Vec3::ZERO) > 0.03);
}
