//! The limits of one hand, in closed forms; objects with a grasp have none.

use grasp_synthesis::{
    physical::immobility::{MAX_CONTACT_FORCE, MAX_CONTACTS},
    search::limits::Limit,
};

use crate::prelude::*;

fn of_mass(mesh: TriangleMesh, mass: f32, forbidden: &[u32]) -> GraspObject {
    GraspObject::new(mesh, mass, Vec3::ZERO, None, forbidden).expect("the object is sound")
}

fn below(mesh: &TriangleMesh, height: f32) -> Vec<u32> {
    triangles_where(mesh, |triangle| {
        mesh.corners(triangle).iter().any(|corner| corner.y < height)
    })
}

fn limits_of(object: GraspObject) -> Vec<Limit> {
    limits_in(&floating(object))
}

fn limits_in(holdout: &Holdout) -> Vec<Limit> {
    guided(holdout).limits()
}

fn only(limits: &[Limit]) -> Limit {
    assert_eq!(limits.len(), 1, "{limits:?}");
    limits[0]
}

#[test]
fn a_box_heavier_than_all_contacts_carry_is_limited_by_mass() {
    let cube = |mass| of_mass(cuboid(Vec3::splat(0.025), 2), mass, &[]);
    let limit = only(&limits_of(cube(80.0)));
    assert_eq!((limit.check, limit.value), (Check::Mass, 80.0));
    let carried = MAX_CONTACTS as f32 * MAX_CONTACT_FORCE / 9.81;
    // The balance check tolerates 2 % of the weight.
    assert!(
        (limit.bound.unwrap() / carried - 1.0 / 0.98).abs() < 1e-3,
        "{limit:?}"
    );
    assert_eq!(limits_of(cube(70.0)), []);
}

/// A level bar of 1.5 m of which only the last 10 cm may be touched.
fn bar_held_at_its_end(mass: f32) -> Holdout {
    let mesh = cuboid(Vec3::new(0.015, 0.75, 0.015), 30);
    let forbidden = below(&mesh, 0.649);
    Holdout {
        up: Vec3::Z,
        ..floating(of_mass(mesh, mass, &forbidden))
    }
}

#[test]
fn a_long_bar_by_its_end_is_limited_by_torque() {
    let limit = only(&limits_in(&bar_held_at_its_end(8.0)));
    assert_eq!(limit.check, Check::Torque);
    let torque = 8.0 * 9.81 * 0.65;
    assert!((limit.value - torque).abs() < 1e-3 * torque, "{limit:?}");
    // All contacts at the corners of the allowed end, with the torsion of their pads.
    let lever = Vec3::new(0.015, 0.05, 0.015).length() + 0.6 * 0.0033;
    let bound = MAX_CONTACTS as f32 * MAX_CONTACT_FORCE * lever + 0.02 * 8.0 * 9.81 * 0.06;
    assert!((limit.bound.unwrap() - bound).abs() < 1e-3 * bound, "{limit:?}");
    assert_eq!(limits_in(&bar_held_at_its_end(5.0)), [], "32 N·m");
    let upright = Holdout {
        up: Vec3::Y,
        ..bar_held_at_its_end(8.0)
    };
    assert_eq!(limits_in(&upright), [], "the weight hangs below the hand");
}

#[test]
fn boxes_and_balls_beyond_a_hands_span_are_limited_by_width() {
    let turned = moved(
        &cuboid(Vec3::splat(0.2), 3),
        Quat::from_rotation_x(0.6),
        Vec3::ZERO,
    );
    for (mesh, narrowest) in [
        (cuboid(Vec3::splat(0.2), 1), 0.4),
        (turned, 0.4),
        (sphere(0.2, 24), 0.2 * std::f32::consts::SQRT_2),
    ] {
        let limit = only(&limits_of(object_of(mesh, &[])));
        assert_eq!(limit.check, Check::Width);
        // A lower bound within 5 %, and the ball has facets of 7.5°.
        let share = limit.value / narrowest;
        assert!((0.85..=1.0).contains(&share), "{limit:?} for {narrowest}");
        assert!(limit.value > limit.bound.unwrap());
    }
}

#[test]
fn width_is_not_judged_where_it_proves_nothing() {
    let cube = floating(object_of(cuboid(Vec3::splat(0.2), 2), &[]));
    let sticky = guided(&cube).friction(0.9);
    assert_eq!(sticky.limits(), [], "three faces at a corner hold");
    let thesis = guided(&cube).validity(Validity::Thesis);
    assert_eq!(thesis.limits(), []);
    let flat = object_of(cuboid(Vec3::new(0.4, 0.4, 0.01), 4), &[]);
    assert_eq!(limits_of(flat), [], "its rim is thin");
    let open = resized(&object_of(open_box(), &[]), 8.0);
    assert_eq!(limits_of(open), [], "its walls are sheets");
}

#[test]
fn forbidden_narrow_sides_leave_only_wide_ones() {
    // 40 × 40 × 5 cm, its two large faces forbidden.
    let mesh = cuboid(Vec3::new(0.2, 0.2, 0.025), 4);
    let forbidden = triangles_where(&mesh, |triangle| mesh.normal(triangle).z.abs() > 0.9);
    let limit = only(&limits_of(object_of(mesh, &forbidden)));
    assert_eq!((limit.check, limit.bound), (Check::Forbidden, None));
    // 2 × 40 × 40 of 2 × 40 × 40 + 4 × 40 × 5 cm².
    assert!((limit.value - 0.8).abs() < 1e-3);
}

/// A ball in a giver's flat hand, `height` metres above the middle of its thickest palm solid.
fn in_the_palm(radius: f32, height: f32) -> Holdout {
    let pose = hand_pose(Pose::IDENTITY, right().stretched());
    let solids = HandSolids::of_pose(right(), &pose);
    let thickest = solids
        .palm
        .iter()
        .max_by(|a, b| a.radius_at(0.5).total_cmp(&b.radius_at(0.5)))
        .expect("a palm has solids");
    // The fixture's ball is around this point.
    let ball = Vec3::new(0.01, -0.02, 0.03);
    let offset = ball - thickest.at(0.5) - Vec3::Z * height;
    let joints = HandJoints::of_pose(right(), &pose).transformed(Pose::from_position(offset));
    Holdout {
        presenting_hand: Some(PresentingHand::of_joints(joints)),
        ..floating(object_of(sphere(radius, 12), &[]))
    }
}

#[test]
fn a_ball_inside_the_givers_hand_is_limited_by_the_giver() {
    let limit = only(&limits_in(&in_the_palm(0.004, 0.0)));
    assert_eq!(limit.check, Check::GiverClearance);
    assert!(limit.value < limit.bound.unwrap());
    assert_eq!(limits_in(&in_the_palm(0.02, 0.03)), [], "most of it is free");
}

#[test]
fn an_object_beyond_the_receivers_reach_or_arm_is_limited_by_reach() {
    let cube = floating(object_of(cuboid(Vec3::splat(0.025), 2), &[]));
    let limits_at = |metres: f32| {
        let shoulder = Vec3::X * (metres + 0.025);
        let arm = arm(shoulder, 0.4, 0.3);
        let of_arm = Holdout {
            stance: Stance::At(arm),
            ..cube.clone()
        };
        let of_reach = guided(&cube).requirements(within_reach(shoulder, 0.7)).limits();
        [limits_in(&of_arm), of_reach]
    };
    for limits in limits_at(1.2) {
        let limit = only(&limits);
        assert_eq!(limit.check, Check::Reach);
        assert!((limit.value - 1.2).abs() < 1e-4 && limit.bound.unwrap() > 0.7 + right().reach - 1e-6);
    }
    assert_eq!(limits_at(0.8), [[], []]);
}

fn everyday_objects() -> Vec<(String, Arc<GraspObject>)> {
    let mut objects: Vec<_> = OBJECT_NAMES
        .map(|name| (name.to_owned(), Arc::clone(object(name))))
        .to_vec();
    let made = [("bar", bar()), ("plate", plate()), ("rod", rod())];
    objects.extend(made.map(|(name, made)| (name.to_owned(), Arc::new(made))));
    let real = real_objects().into_iter().filter_map(|(path, mesh)| {
        let centre = mesh.volume_centroid()?;
        let object = GraspObject::new(mesh, 0.3, centre, None, &[]).ok()?;
        Some((path, Arc::new(object)))
    });
    objects.extend(real);
    objects
}

#[test]
fn objects_with_a_grasp_have_no_limits() {
    let mut random = Random::new(22);
    let mut found = 0;
    for (name, object) in everyday_objects() {
        for _ in 0..cases(6) {
            let mass = 0.05 * 1000.0_f32.powf(random.between(0.0, 1.0));
            let forbidden_below = random.in_cube().x * 0.1;
            let mesh = object.surface.mesh();
            let forbidden = below(mesh, forbidden_below);
            let heavier = GraspObject::new(mesh.clone(), mass, object.centre_of_mass, None, &forbidden)
                .expect("the object stays sound");
            let holdout = Holdout {
                up: random.direction(),
                ..floating(heavier)
            };
            let search = guided(&holdout)
                .friction(random.between(0.3, 1.2))
                .max_attempts(60)
                .requirements(within_reach(random.direction(), random.between(0.7, 1.2)));
            if search.grasp().is_some() {
                found += 1;
                assert_eq!(search.limits(), [], "{name}, {mass} kg");
            }
        }
    }
    assert!(found >= cases(6), "only {found} were found");
}
