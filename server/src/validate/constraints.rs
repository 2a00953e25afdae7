//! Checks `Constraints`.

use std::{f32::consts::PI, fmt::Debug};

use grasp_proto::v1;
use grasp_synthesis::model::{
    constraints::{ApproachCone, Constraints, DigitSet, Reach, TypeSet},
    grasp_type::GraspType,
    hand::Digit,
};

use super::{FARTHEST, Field, Violations, direction, hand::ReceivingHands, known, point};
use crate::convention::Convention;

/// The digits as the contract names them.
const DIGITS: [(v1::Digit, Digit); 5] = [
    (v1::Digit::Thumb, Digit::Thumb),
    (v1::Digit::Index, Digit::Index),
    (v1::Digit::Middle, Digit::Middle),
    (v1::Digit::Ring, Digit::Ring),
    (v1::Digit::Little, Digit::Little),
];

/// The constraints on the grasp, in the client's frame and `OpenXR` axes. Wrong fields constrain nothing.
pub(super) fn constraints(
    field: Field<'_>,
    sent: Option<v1::Constraints>,
    convention: Convention,
    violations: &mut Violations,
) -> Constraints {
    let Some(sent) = sent else {
        return Constraints::default();
    };
    let reach = sent
        .receiver_reach
        .and_then(|sent| reach(field.child("receiver_reach"), sent, convention, violations));
    let approach = sent
        .approach
        .and_then(|sent| approach(field.child("approach"), sent, convention, violations));
    let types = |name, sent: &[i32], allowed: Option<TypeSet>, violations: &mut Violations| {
        let is_allowed = |one| allowed.is_some_and(|allowed| allowed.contains(one));
        let opposite = ("allowed_grasp_types", is_allowed);
        listed::<_, TypeSet>(field.child(name), sent, grasp_type, opposite, violations)
    };
    let allowed_types = types("allowed_grasp_types", &sent.allowed_grasp_types, None, violations);
    // An empty list allows all types, and so does one with only wrong values.
    let allowed_types = Some(allowed_types).filter(|&allowed| allowed != TypeSet::default());
    let excluded_types = types(
        "excluded_grasp_types",
        &sent.excluded_grasp_types,
        allowed_types,
        violations,
    );
    if GraspType::ALL.iter().all(|&one| excluded_types.contains(one)) {
        violations.add(
            field.child("excluded_grasp_types"),
            format_args!(
                "lists all {} types; at least one must be allowed",
                GraspType::ALL.len()
            ),
        );
    }
    let digits = |name, sent: &[i32], must_touch: DigitSet, violations: &mut Violations| {
        let opposite = ("must_touch", |digit| must_touch.contains(digit));
        listed::<_, DigitSet>(field.child(name), sent, digit, opposite, violations)
    };
    let must_touch = digits("must_touch", &sent.must_touch, DigitSet::default(), violations);
    let must_not_touch = digits("must_not_touch", &sent.must_not_touch, must_touch, violations);
    let worst_comfort = sent
        .max_comfort_e
        .and_then(|worst| comfort(field.child("max_comfort_e"), worst, violations));
    Constraints {
        reach,
        approach,
        allowed_types,
        excluded_types,
        must_touch,
        must_not_touch,
        worst_comfort,
    }
}

fn reach(
    field: Field<'_>,
    sent: v1::Reach,
    convention: Convention,
    violations: &mut Violations,
) -> Option<Reach> {
    let before = violations.len();
    let shoulder_field = field.child("client_shoulder");
    let shoulder = sent
        .client_shoulder
        .map(|shoulder| point(shoulder_field, shoulder, convention.metres_per_unit(), violations));
    if shoulder.is_none() {
        violations.add(shoulder_field, "is required");
    }
    let farthest = FARTHEST / convention.metres_per_unit();
    if !(sent.reach > 0.0 && sent.reach <= farthest) {
        violations.add(
            field.child("reach"),
            format_args!(
                "is {}; it must be more than 0 and at most {farthest} (1 km)",
                sent.reach
            ),
        );
    }
    let shoulder = shoulder.filter(|_| violations.len() == before)?;
    Some(Reach {
        shoulder: convention.point_to_openxr(shoulder),
        distance: convention.length_to_openxr(sent.reach),
    })
}

fn approach(
    field: Field<'_>,
    sent: v1::ApproachCone,
    convention: Convention,
    violations: &mut Violations,
) -> Option<ApproachCone> {
    let axis_field = field.child("client_direction");
    let axis = if let Some(axis) = sent.client_direction {
        direction(axis_field, axis, violations)
    } else {
        violations.add(axis_field, "is required");
        None
    };
    let half_angle = sent.half_angle;
    let has_width = half_angle > 0.0 && half_angle <= PI;
    if !has_width {
        violations.add(
            field.child("half_angle"),
            format_args!("is {half_angle} rad; it must be more than 0 and at most {PI}"),
        );
    }
    axis.filter(|_| has_width).map(|axis| ApproachCone {
        axis: convention.direction_to_openxr(axis),
        half_angle,
    })
}

/// The members of a list, read one by one. None may be in the list named `opposite`.
fn listed<M: Copy + Debug, S: FromIterator<M>>(
    field: Field<'_>,
    sent: &[i32],
    read: impl Fn(Field<'_>, i32, &mut Violations) -> Option<M>,
    (opposite, is_in_opposite): (&str, impl Fn(M) -> bool),
    violations: &mut Violations,
) -> S {
    let check = |(place, &value): (usize, &i32)| {
        let field = field.at(place);
        let member = read(field, value, violations)?;
        if is_in_opposite(member) {
            violations.add(
                field,
                format_args!("is {member:?}, which {opposite} contains as well; it cannot be in both"),
            );
            return None;
        }
        Some(member)
    };
    sent.iter().enumerate().filter_map(check).collect()
}

fn grasp_type(field: Field<'_>, value: i32, violations: &mut Violations) -> Option<GraspType> {
    if v1::GraspType::try_from(value) == Ok(v1::GraspType::Unspecified) {
        violations.add(
            field,
            "is GRASP_TYPE_UNSPECIFIED; it must name a type of the taxonomy",
        );
        return None;
    }
    let wire: v1::GraspType = known(field, value, violations);
    // The contract uses the taxonomy's numbers.
    u32::try_from(i32::from(wire))
        .ok()
        .and_then(GraspType::from_number)
}

fn digit(field: Field<'_>, value: i32, violations: &mut Violations) -> Option<Digit> {
    if v1::Digit::try_from(value) == Ok(v1::Digit::Unspecified) {
        violations.add(field, "is DIGIT_UNSPECIFIED; it must name a digit");
        return None;
    }
    let wire: v1::Digit = known(field, value, violations);
    let named = DIGITS.iter().find(|(name, _)| *name == wire);
    named.map(|&(_, digit)| digit)
}

/// Digits that must touch are digits that the receiving hand has, if its rig is known.
pub(super) fn check_has_digits(
    constraints: &Constraints,
    hands: Option<&ReceivingHands>,
    violations: &mut Violations,
) {
    let Some(hands) = hands else { return };
    let rig = &hands.hand.hand.rig;
    for (name, digit) in DIGITS {
        if constraints.must_touch.contains(digit) && !rig.has(digit) {
            violations.add(
                Field::root("constraints").child("must_touch"),
                format_args!(
                    "contains {}, which {} does not have; leave it out",
                    name.as_str_name(),
                    rig.name
                ),
            );
        }
    }
}

fn comfort(field: Field<'_>, worst: f32, violations: &mut Violations) -> Option<f32> {
    if worst >= 0.0 && worst.is_finite() {
        return Some(worst);
    }
    violations.add(
        field,
        format_args!("is {worst}; it must be finite and at least 0"),
    );
    None
}

#[cfg(test)]
mod tests {
    use glam::{Mat3, Vec3};

    use super::*;

    fn vector(v: Vec3) -> v1::Vector3 {
        let [x, y, z] = v.to_array();
        v1::Vector3 { x, y, z }
    }

    fn checked(sent: v1::Constraints, convention: Convention) -> Constraints {
        let mut violations = Violations::default();
        let constraints = constraints(
            Field::root("constraints"),
            Some(sent),
            convention,
            &mut violations,
        );
        assert!(violations.is_empty(), "{violations:?}");
        constraints
    }

    #[test]
    fn converts_points_lengths_and_directions() {
        // Columns: OpenXR's axes in the engine's. Last: units per metre.
        let unreal = Mat3::from_cols(Vec3::Y, Vec3::Z, Vec3::NEG_X);
        let unity = Mat3::from_cols(Vec3::X, Vec3::Y, Vec3::NEG_Z);
        for (convention, axes, units) in [
            (Convention::OpenXr, Mat3::IDENTITY, 1.0),
            (Convention::Godot, Mat3::IDENTITY, 1.0),
            (Convention::Unity, unity, 1.0),
            (Convention::Unreal, unreal, 100.0),
        ] {
            let shoulder = Vec3::new(0.2, 1.4, -0.5);
            let axis = Vec3::new(2.0, -1.0, 2.0) / 3.0;
            let sent = v1::Constraints {
                receiver_reach: Some(v1::Reach {
                    client_shoulder: Some(vector(axes * shoulder * units)),
                    reach: 0.7 * units,
                }),
                approach: Some(v1::ApproachCone {
                    client_direction: Some(vector(axes * axis * 5.0)),
                    half_angle: 0.4,
                }),
                ..Default::default()
            };
            let constraints = checked(sent, convention);
            let reach = constraints.reach.expect("a reach was sent");
            assert!(reach.shoulder.distance(shoulder) < 1e-6, "{convention:?}");
            assert!((reach.distance - 0.7).abs() < 1e-6, "{convention:?}");
            let approach = constraints.approach.expect("an approach was sent");
            assert!(approach.axis.distance(axis) < 1e-6, "{convention:?}");
            assert_eq!(approach.half_angle, 0.4);
        }
    }

    #[test]
    fn every_grasp_type_has_its_name_in_the_contract() {
        for one in GraspType::ALL {
            let name = one.name().to_uppercase().replace([' ', '-'], "_");
            let wire = v1::GraspType::from_str_name(&format!("GRASP_TYPE_{name}")).expect("the same names");
            let sent = v1::Constraints {
                allowed_grasp_types: vec![wire.into(), wire.into()],
                ..Default::default()
            };
            let allowed = Some([one].into_iter().collect());
            assert_eq!(checked(sent, Convention::OpenXr).allowed_types, allowed, "{name}");
            let sent = v1::Constraints {
                excluded_grasp_types: vec![wire.into()],
                ..Default::default()
            };
            let constraints = checked(sent, Convention::OpenXr);
            assert_eq!(constraints.excluded_types, [one].into_iter().collect(), "{name}");
            assert_eq!(constraints.allowed_types, None, "{name}");
        }
    }

    #[test]
    fn reads_digits_and_comfort() {
        use v1::Digit::{Index, Little, Middle, Ring, Thumb};
        let sent = v1::Constraints {
            must_touch: vec![Thumb.into(), Middle.into(), Thumb.into()],
            must_not_touch: vec![Index.into(), Ring.into(), Little.into()],
            max_comfort_e: Some(0.0),
            ..Default::default()
        };
        let constraints = checked(sent, Convention::OpenXr);
        let expected = Constraints {
            must_touch: [Digit::Thumb, Digit::Middle].into_iter().collect(),
            must_not_touch: [Digit::Index, Digit::Ring, Digit::Little].into_iter().collect(),
            worst_comfort: Some(0.0),
            ..Constraints::default()
        };
        assert_eq!(constraints, expected);
    }

    #[test]
    fn empty_message_is_no_constraint() {
        assert!(checked(v1::Constraints::default(), Convention::Unreal).is_empty());
    }
}
