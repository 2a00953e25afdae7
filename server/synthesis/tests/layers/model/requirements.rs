//! Requirements against naive formulas in double precision and plain sets.

use std::{collections::BTreeSet, f32::consts::PI};

use proptest::{
    collection::{btree_set, hash_set, vec},
    option,
    prelude::*,
    sample::select,
    strategy::Strategy,
    test_runner::RngSeed,
};

use crate::prelude::*;

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

fn touching() -> impl Strategy<Value = Vec<HandPart>> {
    let link = (select(Digit::ALL.to_vec()), select(Phalanx::ALL.to_vec()))
        .prop_map(|(digit, phalanx)| HandPart::Phalanx(digit, phalanx));
    vec(prop_oneof![6 => link, 1 => Just(HandPart::Palm)], 0..8)
}

/// The angle between the hand's approach and an axis, in double precision.
fn approach_angle(wrist: Pose, axis: Vec3) -> f64 {
    let turned = |v: DVec3| wrist.orientation.as_dquat().normalize() * v;
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
        let requirements = within_reach(shoulder, distance);
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
    fn requirements_do_not_depend_on_the_frame(
        wrist in pose(),
        b_from_a in pose(),
        shoulder in vector(1.5),
        distance in 0.1_f32..3.0,
        axis in direction(),
        half_angle in 0.01_f32..PI,
    ) {
        let requirements = Requirements {
            approach: Some(ApproachCone { axis, half_angle }),
            ..within_reach(shoulder, distance)
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
        let contacts: Vec<_> = touching.iter().map(|&part| contact(Vec3::ZERO, Vec3::Y, part)).collect();
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
}
