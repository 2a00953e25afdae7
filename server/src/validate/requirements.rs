//! Checks `Requirements`.

use std::{f32::consts::PI, fmt::Debug};

use grasp_proto::v1;
use grasp_synthesis::model::{
    grasp_type::GraspType,
    hand::Digit,
    requirements::{ApproachCone, DigitSet, Requirements, TypeSet},
    strategy::{BendRatioChoice, Strategy, Validity},
};

use super::{Field, Violations, check_unset, direction, friction, known, receiver::ReceivingHands};
use crate::{convention::Convention, rigs::resource_name, wire::wire_digit};

/// What a grasp must satisfy.
#[derive(Clone, Copy, Debug)]
pub(super) struct CheckedRequirements {
    /// In place of the object's.
    pub friction: Option<f32>,
    /// In the client's frame and `OpenXR` axes, without the receiver's reach.
    pub requirements: Requirements,
    pub thesis: Thesis,
}

/// Options of the thesis, beside comfort.
#[derive(Clone, Copy, Debug)]
pub(super) struct Thesis {
    pub validity: Validity,
    pub strategy: Strategy,
    pub bend_ratios: BendRatioChoice,
    pub record_step_times: bool,
}

impl Thesis {
    fn of(field: Field<'_>, sent: v1::ThesisOptions, validity: Validity) -> Self {
        let strategy = strategy(known(field.child("strategy"), sent.strategy), validity);
        Self {
            validity,
            strategy,
            bend_ratios: bend_ratios(known(field.child("bend_ratios"), sent.bend_ratios), strategy),
            record_step_times: sent.record_step_times,
        }
    }

    /// True for searches of which grasps can be kept, or taken by both hands.
    pub(super) fn is_default(self) -> bool {
        (self.strategy, self.validity) == (Strategy::Guided, Validity::Physical)
    }
}

/// The notion of a valid grasp of a request with these requirements.
pub(super) fn validity(sent: Option<&v1::Requirements>) -> Validity {
    match sent.and_then(|sent| sent.thesis) {
        Some(thesis) if thesis.thesis_validity => Validity::Thesis,
        _ => Validity::Physical,
    }
}

/// What a grasp must satisfy. Wrong fields require nothing.
pub(super) fn requirements(
    field: Field<'_>,
    sent: Option<v1::Requirements>,
    convention: Convention,
) -> CheckedRequirements {
    let validity = validity(sent.as_ref());
    let sent = sent.unwrap_or_default();
    let friction = sent
        .friction
        .map(|value| friction(field.child("friction"), value));
    let approach = approach(field, &sent, convention);
    let types = |name, sent: &[i32], allowed: Option<TypeSet>| {
        let is_allowed = |one| allowed.is_some_and(|allowed| allowed.contains(one));
        let opposite = ("allowed_grasp_types", is_allowed);
        listed::<_, TypeSet>(field.child(name), sent, grasp_type, opposite)
    };
    let allowed_types = types("allowed_grasp_types", &sent.allowed_grasp_types, None);
    // An empty list allows all types, and so does one with only wrong values.
    let allowed_types = Some(allowed_types).filter(|&allowed| allowed != TypeSet::default());
    let excluded_types = types("excluded_grasp_types", &sent.excluded_grasp_types, allowed_types);
    if GraspType::ALL.iter().all(|&one| excluded_types.contains(one)) {
        field.child("excluded_grasp_types").add(format_args!(
            "lists all {} types; at least one must be allowed",
            GraspType::ALL.len()
        ));
    }
    let digits = |name, sent: &[i32], must_touch: DigitSet| {
        let opposite = ("must_touch", |digit| must_touch.contains(digit));
        listed::<_, DigitSet>(field.child(name), sent, digit, opposite)
    };
    let must_touch = digits("must_touch", &sent.must_touch, DigitSet::default());
    let must_not_touch = digits("must_not_touch", &sent.must_not_touch, must_touch);
    let thesis_field = field.child("thesis");
    let thesis = sent.thesis.unwrap_or_default();
    let worst_comfort = thesis
        .max_comfort
        .and_then(|worst| comfort(thesis_field.child("max_comfort"), worst));
    CheckedRequirements {
        friction,
        requirements: Requirements {
            reach: None,
            approach,
            allowed_types,
            excluded_types,
            must_touch,
            must_not_touch,
            worst_comfort,
        },
        thesis: Thesis::of(thesis_field, thesis, validity),
    }
}

/// The directions of approach. Axis and angle require each other.
fn approach(field: Field<'_>, sent: &v1::Requirements, convention: Convention) -> Option<ApproachCone> {
    let half_angle = sent.max_approach_angle;
    if sent.client_approach.is_none() && half_angle == 0.0 {
        return None;
    }
    let axis_field = field.child("client_approach");
    let axis = if let Some(axis) = sent.client_approach {
        direction(axis_field, axis, convention)
    } else {
        axis_field.reject("is required with max_approach_angle")
    };
    let has_width = half_angle > 0.0 && half_angle <= PI;
    if !has_width {
        field.child("max_approach_angle").add(format_args!(
            "is {half_angle} rad; with client_approach, it must be more than 0 and at most {PI}"
        ));
    }
    axis.filter(|_| has_width)
        .map(|axis| ApproachCone { axis, half_angle })
}

/// The members of a list, read one by one. None may be in the list named `opposite`.
fn listed<M: Copy + Debug, S: FromIterator<M>>(
    field: Field<'_>,
    sent: &[i32],
    read: impl Fn(Field<'_>, i32) -> Option<M>,
    (opposite, is_in_opposite): (&str, impl Fn(M) -> bool),
) -> S {
    let check = |(place, &value): (usize, &i32)| {
        let field = field.at(place);
        let member = read(field, value)?;
        if is_in_opposite(member) {
            return field.reject(format_args!(
                "is {member:?}, which {opposite} contains as well; it cannot be in both"
            ));
        }
        Some(member)
    };
    sent.iter().enumerate().filter_map(check).collect()
}

fn grasp_type(field: Field<'_>, value: i32) -> Option<GraspType> {
    if v1::GraspType::try_from(value) == Ok(v1::GraspType::Unspecified) {
        return field.reject("is GRASP_TYPE_UNSPECIFIED; it must name a type of the taxonomy");
    }
    let wire: v1::GraspType = known(field, value);
    // The contract uses the taxonomy's numbers.
    u32::try_from(i32::from(wire))
        .ok()
        .and_then(GraspType::from_number)
}

fn digit(field: Field<'_>, value: i32) -> Option<Digit> {
    if v1::Digit::try_from(value) == Ok(v1::Digit::Unspecified) {
        return field.reject("is DIGIT_UNSPECIFIED; it must name a digit");
    }
    let wire: v1::Digit = known(field, value);
    Digit::ALL.into_iter().find(|&digit| wire_digit(digit) == wire)
}

/// Digits that must touch are digits that the receiving hand has, if its rig is known.
pub(super) fn check_has_digits(
    field: Field<'_>,
    requirements: &Requirements,
    hands: Option<&ReceivingHands>,
) {
    let Some(hands) = hands else { return };
    let rig = &hands.hand.hand.rig;
    for digit in Digit::ALL {
        if requirements.must_touch.contains(digit) && !rig.has(digit) {
            field.child("must_touch").add(format_args!(
                "contains {}, which {} does not have; leave it out",
                wire_digit(digit).as_str_name(),
                resource_name(rig)
            ));
        }
    }
}

fn comfort(field: Field<'_>, worst: f32) -> Option<f32> {
    if worst >= 0.0 && worst.is_finite() {
        return Some(worst);
    }
    field.reject(format_args!("is {worst}; it must be finite and at least 0"))
}

/// Adds a violation for each option that only experiments with searches have.
pub(super) fn check_no_experiment(sent: Option<&v1::Requirements>, v: &Violations) {
    let Some(sent) = sent.and_then(|sent| sent.thesis) else {
        return;
    };
    let strategies = [v1::Strategy::Unspecified, v1::Strategy::Guided];
    // Values that the contract does not define are found wrong elsewhere.
    let strategy = v1::Strategy::try_from(sent.strategy);
    let ratios = v1::BendRatios::try_from(sent.bend_ratios);
    let is_set = [
        ("thesis_validity", sent.thesis_validity),
        (
            "strategy",
            strategy.is_ok_and(|strategy| !strategies.contains(&strategy)),
        ),
        (
            "bend_ratios",
            ratios.is_ok_and(|ratios| ratios != v1::BendRatios::Unspecified),
        ),
        ("record_step_times", sent.record_step_times),
    ];
    let requirements = v.field("requirements");
    check_unset(
        requirements.child("thesis"),
        is_set,
        "only FindGrasp and StreamGrasps take it: leave it out",
    );
}

/// The default is the fastest strategy for the validity.
fn strategy(strategy: v1::Strategy, validity: Validity) -> Strategy {
    match strategy {
        v1::Strategy::A => Strategy::A,
        v1::Strategy::B => Strategy::B,
        v1::Strategy::C => Strategy::C,
        v1::Strategy::D => Strategy::D,
        v1::Strategy::E => Strategy::E,
        v1::Strategy::F => Strategy::F,
        v1::Strategy::Guided => Strategy::Guided,
        v1::Strategy::Unspecified => match validity {
            Validity::Thesis => Strategy::F,
            Validity::Physical => Strategy::Guided,
        },
    }
}

fn bend_ratios(choice: v1::BendRatios, strategy: Strategy) -> BendRatioChoice {
    match choice {
        v1::BendRatios::Unspecified => strategy.default_bend_ratios(),
        v1::BendRatios::All => BendRatioChoice::All,
        v1::BendRatios::AllFingersWithoutLow => BendRatioChoice::AllFingersWithoutLow,
        v1::BendRatios::OneRandom => BendRatioChoice::OneRandom,
        v1::BendRatios::OneRandomFingersWithoutLow => BendRatioChoice::OneRandomFingersWithoutLow,
        v1::BendRatios::OnlyOne => BendRatioChoice::OnlyOne,
        v1::BendRatios::OnlyHigh => BendRatioChoice::OnlyHigh,
    }
}

#[cfg(test)]
mod tests {
    use glam::{Mat3, Vec3};

    use super::*;
    use crate::validate::testing::read_at;

    fn checked(sent: v1::Requirements, convention: Convention) -> Requirements {
        let (checked, blamed) = read_at("requirements", |field| {
            requirements(field, Some(sent), convention)
        });
        assert_eq!(blamed, [""; 0]);
        checked.requirements
    }

    #[test]
    fn converts_directions() {
        // Columns: OpenXR's axes in the engine's.
        let unreal = Mat3::from_cols(Vec3::Y, Vec3::Z, Vec3::NEG_X);
        let unity = Mat3::from_cols(Vec3::X, Vec3::Y, Vec3::NEG_Z);
        for (convention, axes) in [
            (Convention::OpenXr, Mat3::IDENTITY),
            (Convention::Godot, Mat3::IDENTITY),
            (Convention::Unity, unity),
            (Convention::Unreal, unreal),
        ] {
            let axis = Vec3::new(2.0, -1.0, 2.0) / 3.0;
            let sent = v1::Requirements {
                client_approach: Some((axes * axis * 5.0).into()),
                max_approach_angle: 0.4,
                ..Default::default()
            };
            let approach = checked(sent, convention).approach.expect("an approach was sent");
            assert!(approach.axis.distance(axis) < 1e-6, "{convention:?}");
            assert_eq!(approach.half_angle, 0.4);
        }
    }

    #[test]
    fn every_grasp_type_has_its_name_in_the_contract() {
        for one in GraspType::ALL {
            let name = one.name().to_uppercase().replace([' ', '-'], "_");
            let wire = v1::GraspType::from_str_name(&format!("GRASP_TYPE_{name}")).expect("the same names");
            let sent = v1::Requirements {
                allowed_grasp_types: vec![wire.into(), wire.into()],
                ..Default::default()
            };
            let allowed = Some([one].into_iter().collect());
            assert_eq!(checked(sent, Convention::OpenXr).allowed_types, allowed, "{name}");
            let sent = v1::Requirements {
                excluded_grasp_types: vec![wire.into()],
                ..Default::default()
            };
            let requirements = checked(sent, Convention::OpenXr);
            assert_eq!(requirements.excluded_types, [one].into_iter().collect(), "{name}");
            assert_eq!(requirements.allowed_types, None, "{name}");
        }
    }

    #[test]
    fn reads_digits_and_comfort() {
        use v1::Digit::{Index, Little, Middle, Ring, Thumb};
        let sent = v1::Requirements {
            must_touch: vec![Thumb.into(), Middle.into(), Thumb.into()],
            must_not_touch: vec![Index.into(), Ring.into(), Little.into()],
            thesis: Some(v1::ThesisOptions {
                max_comfort: Some(0.0),
                ..Default::default()
            }),
            ..Default::default()
        };
        let requirements = checked(sent, Convention::OpenXr);
        let expected = Requirements {
            must_touch: [Digit::Thumb, Digit::Middle].into_iter().collect(),
            must_not_touch: [Digit::Index, Digit::Ring, Digit::Little].into_iter().collect(),
            worst_comfort: Some(0.0),
            ..Requirements::default()
        };
        assert_eq!(requirements, expected);
    }

    #[test]
    fn empty_message_requires_nothing() {
        assert!(checked(v1::Requirements::default(), Convention::Unreal).is_empty());
    }
}
