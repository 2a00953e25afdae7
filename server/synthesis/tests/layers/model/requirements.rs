//! Requirements against naive formulas in double precision and plain sets.

use std::{
    collections::{BTreeSet, HashSet},
    f32::consts::{FRAC_1_SQRT_2, PI},
};

use glam::{DQuat, DVec3, Quat, Vec3};
use grasp_synthesis::{
    base::pose::Pose,
    model::{
        grasp::Contact,
        grasp_type::GraspType,
        hand::{Digit, HandPart, Phalanx},
        requirements::{ApproachCone, DigitSet, Reach, Requirements, TypeSet, approach_direction},
    },
};
use proptest::{
    collection::{btree_set, hash_set, vec},
    option,
    prelude::*,
    sample::select,
    test_runner::RngSeed,
};

/// Cases closer to a limit than this are skipped, since single precision decides them.
const UNDECIDED: f64 = 1e-5;

fn runs() -> ProptestConfig {
    ProptestConfig {
        cases: 2000,
        rng_seed: RngSeed::Fixed(6),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

fn vector(largest: f32) -> impl Strategy<Value = Vec3> {
    [-largest..largest, -largest..largest, -largest..largest].prop_map(Vec3::from)
}

fn direction() -> impl Strategy<Value = Vec3> {
    vector(1.0)
        .prop_filter("too short to have a direction", |v| v.length() > 0.1)
        .prop_map(|v| v.normalize_or(Vec3::X))
}

fn pose() -> impl Strategy<Value = Pose> {
    (vector(1.0), direction(), -PI..PI)
        .prop_map(|(position, axis, angle)| Pose::new(position, Quat::from_axis_angle(axis, angle)))
}

fn digits() -> impl Strategy<Value = HashSet<Digit>> {
    hash_set(select(Digit::ALL.to_vec()), 0..=5)
}

fn any_type() -> impl Strategy<Value = GraspType> {
    select(GraspType::ALL.to_vec())
}

fn types() -> impl Strategy<Value = BTreeSet<GraspType>> {
    btree_set(any_type(), 0..=8)
}

fn contact(part: HandPart) -> Contact {
    Contact {
        position: Vec3::ZERO,
        normal: Vec3::Y,
        triangle: 0,
        part,
    }
}

fn touching() -> impl Strategy<Value = Vec<HandPart>> {
    let link = (select(Digit::ALL.to_vec()), select(Phalanx::ALL.to_vec()))
        .prop_map(|(digit, phalanx)| HandPart::Phalanx(digit, phalanx));
    vec(prop_oneof![6 => link, 1 => Just(HandPart::Palm)], 0..8)
}

/// The angle between the hand's approach and an axis, in double precision.
fn approach_angle(wrist: Pose, axis: Vec3) -> f64 {
    let turned = |v: DVec3| {
        let [x, y, z, w] = wrist.orientation.to_array().map(f64::from);
        DQuat::from_xyzw(x, y, z, w).normalize() * v
    };
    let blend = turned(DVec3::Y) + turned(DVec3::Z);
    let axis = axis.as_dvec3();
    (blend.dot(axis) / (blend.length() * axis.length()))
        .clamp(-1.0, 1.0)
        .acos()
}

proptest! {
    #![proptest_config(runs())]

    #[test]
    fn admits_wrists_within_reach(wrist in pose(), shoulder in vector(1.5), distance in 0.1_f32..3.0) {
        let requirements = Requirements {
            reach: Some(Reach { shoulder, distance }),
            ..Requirements::default()
        };
        let away = (wrist.position.as_dvec3() - shoulder.as_dvec3()).length();
        prop_assume!((away - f64::from(distance)).abs() > UNDECIDED);
        prop_assert_eq!(requirements.admits_wrist(wrist), away <= f64::from(distance));
    }

    #[test]
    fn admits_wrists_within_the_approach_cone(wrist in pose(), axis in direction(), half_angle in 0.01_f32..PI) {
        let requirements = Requirements {
            approach: Some(ApproachCone { axis, half_angle }),
            ..Requirements::default()
        };
        let angle = approach_angle(wrist, axis);
        prop_assume!((angle - f64::from(half_angle)).abs() > UNDECIDED);
        prop_assert_eq!(requirements.admits_wrist(wrist), angle <= f64::from(half_angle));
    }

    #[test]
    fn narrow_cones_are_exact_to_rounding(
        wrist in pose(),
        across in direction(),
        angle in 1e-5_f32..1e-3,
    ) {
        // Tilted by a small angle, once in either direction.
        let approach = approach_direction(wrist);
        let side = across.cross(approach);
        prop_assume!(side.length() > 0.1);
        let side = side.normalize_or(Vec3::X);
        for toward in [1.0, -1.0] {
            let cone = |half_angle| Requirements {
                approach: Some(ApproachCone {
                    axis: (approach + toward * side * angle.tan()).normalize_or(Vec3::X),
                    half_angle,
                }),
                ..Requirements::default()
            };
            // Rounding moves a unit vector by some 1e-7.
            prop_assert!(cone(angle + 5e-7).admits_wrist(wrist));
            prop_assert!(!cone(angle - 5e-7).admits_wrist(wrist));
        }
    }

    #[test]
    fn half_turn_cone_admits_every_wrist(wrist in pose(), axis in direction()) {
        for axis in [axis, approach_direction(wrist), -approach_direction(wrist)] {
            let approach = Some(ApproachCone { axis, half_angle: PI });
            let requirements = Requirements { approach, ..Requirements::default() };
            prop_assert!(requirements.admits_wrist(wrist));
        }
    }

    #[test]
    fn reach_and_approach_must_both_hold(
        wrist in pose(),
        shoulder in vector(1.5),
        distance in 0.1_f32..3.0,
        axis in direction(),
        half_angle in 0.01_f32..PI,
    ) {
        let reach = Requirements {
            reach: Some(Reach { shoulder, distance }),
            ..Requirements::default()
        };
        let approach = Requirements {
            approach: Some(ApproachCone { axis, half_angle }),
            ..Requirements::default()
        };
        let both = Requirements { approach: approach.approach, ..reach };
        prop_assert_eq!(
            both.admits_wrist(wrist),
            reach.admits_wrist(wrist) && approach.admits_wrist(wrist)
        );
    }

    #[test]
    fn requirements_do_not_depend_on_the_frame(
        wrist in pose(),
        b_from_a in pose(),
        shoulder in vector(1.5),
        distance in 0.1_f32..3.0,
        axis in direction(),
        half_angle in 0.01_f32..PI,
    ) {
        let requirements = Requirements {
            reach: Some(Reach { shoulder, distance }),
            approach: Some(ApproachCone { axis, half_angle }),
            ..Requirements::default()
        };
        let away = f64::from(wrist.position.distance(shoulder));
        prop_assume!((away - f64::from(distance)).abs() > UNDECIDED);
        prop_assume!((approach_angle(wrist, axis) - f64::from(half_angle)).abs() > UNDECIDED);
        prop_assert_eq!(
            requirements.transformed(b_from_a).admits_wrist(b_from_a * wrist),
            requirements.admits_wrist(wrist)
        );
    }

    #[test]
    fn digits_are_required_and_excluded_one_by_one(
        must in digits(),
        must_not in digits(),
        touching in touching(),
    ) {
        let requirements = Requirements {
            must_touch: must.iter().copied().collect(),
            must_not_touch: must_not.iter().copied().collect(),
            ..Requirements::default()
        };
        let contacts: Vec<_> = touching.iter().copied().map(contact).collect();
        let touches = |digit: &Digit| touching.iter().any(|part| part.digit() == Some(*digit));
        let right = must.iter().all(touches) && !must_not.iter().any(touches);
        prop_assert_eq!(requirements.admits_contacts(&contacts), right);
    }

    #[test]
    fn admits_allowed_types_and_sufficient_comfort(
        allowed in option::of(types()),
        excluded in types(),
        worst in option::of(0.0_f32..1.0),
        grasp_type in option::of(any_type()),
        comfort in 0.0_f32..1.0,
    ) {
        let requirements = Requirements {
            allowed_types: allowed.as_ref().map(|allowed| allowed.iter().copied().collect()),
            excluded_types: excluded.iter().copied().collect(),
            worst_comfort: worst,
            ..Requirements::default()
        };
        let is_allowed = match (&allowed, &grasp_type) {
            (None, _) => true,
            (Some(_), None) => false,
            (Some(allowed), Some(one)) => allowed.contains(one),
        };
        let is_excluded = grasp_type.is_some_and(|one| excluded.contains(&one));
        let is_comfortable = match worst {
            None => true,
            Some(worst) => comfort <= worst,
        };
        prop_assert_eq!(requirements.admits_type(grasp_type), is_allowed && !is_excluded);
        prop_assert_eq!(requirements.admits_comfort(comfort), is_comfortable);
    }

    #[test]
    fn sets_contain_exactly_their_elements(
        a in types(),
        (c, d) in (digits(), digits()),
    ) {
        let type_set: TypeSet = a.iter().copied().collect();
        for one in GraspType::ALL {
            prop_assert_eq!(type_set.contains(one), a.contains(&one));
        }

        let (first, second): (DigitSet, DigitSet) = (c.iter().copied().collect(), d.iter().copied().collect());
        for digit in Digit::ALL {
            prop_assert_eq!(first.contains(digit), c.contains(&digit));
        }
        prop_assert_eq!(first.intersects(second), !c.is_disjoint(&d));
        prop_assert_eq!(first.contains_all(second), c.is_superset(&d));
    }

    #[test]
    fn default_requirements_admit_everything(
        wrist in pose(),
        touching in touching(),
        grasp_type in option::of(any_type()),
        comfort in 0.0_f32..10.0,
    ) {
        let none = Requirements::default();
        let contacts: Vec<_> = touching.into_iter().map(contact).collect();
        prop_assert!(none.is_empty());
        prop_assert!(none.admits_wrist(wrist));
        prop_assert!(none.admits_contacts(&contacts));
        prop_assert!(none.admits_type(grasp_type));
        prop_assert!(none.admits_comfort(comfort));
    }
}

#[test]
fn the_approach_direction_is_halfway_between_fingers_and_palm() {
    let at_rest = approach_direction(Pose::IDENTITY);
    assert!(at_rest.distance(Vec3::new(0.0, FRAC_1_SQRT_2, FRAC_1_SQRT_2)) < 1e-6);
    // A quarter turn about +x points the fingers where the palm faced, and the palm to the forearm.
    let bent = approach_direction(Pose::new(Vec3::ONE, Quat::from_rotation_x(PI / 2.0)));
    assert!(bent.distance(Vec3::new(0.0, -FRAC_1_SQRT_2, FRAC_1_SQRT_2)) < 1e-6);
}
