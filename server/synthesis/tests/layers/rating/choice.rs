//! Terms of the score that follow what people choose.

use grasp_synthesis::rating::choice::{across_long_axis, choice_values, from_side_or_above, upright_values};

use crate::prelude::*;

/// A wrist at a distance from a point, with palm and fingers leading toward it in a direction.
fn reaching(target: Vec3, direction: Vec3) -> Pose {
    // Palm and fingers lead alike: +y and +z of the wrist are both at 45° to the approach.
    let approach = Vec3::new(0.0, 1.0, 1.0).normalize_or(Vec3::Y);
    let orientation = Quat::from_rotation_arc(approach, direction);
    Pose::new(target - direction * 0.12, orientation)
}

/// Thumb and index finger on two points.
fn pinch(thumb: Vec3, index: Vec3) -> [Contact; 2] {
    [(thumb, Digit::Thumb), (index, Digit::Index)].map(|(at, digit)| {
        let part = HandPart::Phalanx(digit, Phalanx::Third);
        contact(at, at.normalize_or(Vec3::X), part)
    })
}

fn value(object: &GraspObject, wrist: Pose, contacts: &[Contact], term: Term) -> f32 {
    choice_values(object, wrist, contacts)[term as usize]
}

fn rod() -> GraspObject {
    object_of(cylinder_mesh(0.01, 0.1, 24, 12), &[])
}

/// A body with a bar that sticks out of it along x, between 6 and 18 cm.
fn pan() -> GraspObject {
    let mesh: TriangleMesh = Parts::default()
        .cuboid(Vec3::ZERO, Vec3::new(0.06, 0.02, 0.06), 6)
        .cuboid(Vec3::new(0.125, 0.0, 0.0), Vec3::new(0.065, 0.01, 0.01), 6)
        .mesh();
    object_of(mesh, &[])
}

#[test]
fn hands_across_the_long_axis_score_and_those_along_it_do_not() {
    let rod = rod();
    let axis = rod.parts().long_axis;
    assert!(axis.y.abs() > 0.99 && rod.parts().is_long > 0.99);
    let mut random = Random::new(1);
    for _ in 0..100 {
        let across = random.direction().reject_from(Vec3::Y).normalize_or(Vec3::X);
        assert!(across_long_axis(rod.parts(), reaching(Vec3::ZERO, across)) > 0.99);
        let along = (Vec3::Y + across * random.between(0.0, 0.3)).normalize_or(Vec3::Y);
        let end = reaching(Vec3::Y * -0.1, along);
        assert!(across_long_axis(rod.parts(), end) < 0.05, "{along}");
    }
}

#[test]
fn round_things_are_taken_from_anywhere() {
    let ball = object_of(sphere(0.04, 16), &[]);
    let mut random = Random::new(2);
    for _ in 0..50 {
        let from = random.direction();
        assert!(across_long_axis(ball.parts(), reaching(Vec3::ZERO, from)) > 0.99);
    }
}

#[test]
fn hands_from_beneath_lose_those_from_side_and_above_do_not() {
    for (direction, expected) in [(Vec3::NEG_Y, 1.0), (Vec3::X, 1.0), (Vec3::Y, 0.0)] {
        let wrist = reaching(Vec3::ZERO, direction);
        let value = from_side_or_above(wrist, Vec3::Y);
        assert!((value - expected).abs() < 0.35, "{direction}: {value}");
    }
}

#[test]
fn contacts_near_the_centre_score_above_those_at_an_end() {
    let rod = rod();
    let at = |y: f32| pinch(Vec3::new(-0.01, y, 0.0), Vec3::new(0.01, y, 0.0));
    let near = |y: f32| value(&rod, reaching(Vec3::ZERO, Vec3::X), &at(y), Term::NearCentre);
    assert!(near(0.0) > 0.99 && near(0.095) < 0.25 && near(0.03) > near(0.06));
}

#[test]
fn opposition_across_a_small_side_scores_above_that_across_a_large_one() {
    let block = object_of(cuboid(Vec3::new(0.01, 0.04, 0.08), 6), &[]);
    let wrist = reaching(Vec3::ZERO, Vec3::X);
    let thin = pinch(Vec3::X * -0.01, Vec3::X * 0.01);
    let wide = pinch(Vec3::Y * -0.04, Vec3::Y * 0.04);
    assert!(value(&block, wrist, &thin, Term::SmallSpan) > 0.99);
    assert!(value(&block, wrist, &wide, Term::SmallSpan) < 0.1);
}

#[test]
fn hands_on_the_handle_score_and_those_on_the_body_do_not() {
    let pan = pan();
    assert!(pan.parts().is_handled);
    let wrist = reaching(Vec3::X * 0.13, Vec3::NEG_Y);
    let handle = pinch(Vec3::new(0.13, 0.01, 0.0), Vec3::new(0.14, -0.01, 0.0));
    let body = pinch(Vec3::new(0.0, 0.02, 0.0), Vec3::new(0.0, -0.02, 0.0));
    assert!(value(&pan, wrist, &handle, Term::OnHandle) > 0.99);
    assert!(value(&pan, wrist, &body, Term::OnHandle) == 0.0);
    // A rod is all handle, so nothing sets a part of it apart.
    let rod = rod();
    assert!(!rod.parts().is_handled);
    assert!(value(&rod, wrist, &body, Term::OnHandle) > 0.99);
}

#[test]
fn torque_at_the_wrist_grows_with_mass_and_lever() {
    let light = rod();
    let load = |distance: f32, object: &GraspObject| {
        let wrist = Pose::from_position(object.centre_of_mass + Vec3::X * distance);
        upright_values(object, wrist, Vec3::Y)[Term::WristLoad as usize]
    };
    assert!(load(0.1, &light) > 0.99);
    let heavy = GraspObject::new(cuboid(Vec3::splat(0.05), 4), 6.0, Vec3::ZERO, None, &[]);
    let heavy = Arc::new(heavy.expect("it is an object"));
    assert!(load(0.02, &heavy) > load(0.06, &heavy) && load(0.12, &heavy) == 0.0);
    // Along gravity there is no lever.
    let above = Pose::from_position(Vec3::Y * 0.12);
    assert!(upright_values(&heavy, above, Vec3::Y)[Term::WristLoad as usize] > 0.99);
}
