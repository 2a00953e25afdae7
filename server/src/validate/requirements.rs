//! Checks `Requirements` and `SearchOptions`.

use std::{f32::consts::PI, fmt::Debug, time::Duration};

use grasp_proto::v1;
use grasp_synthesis::{
    model::{
        grasp_type::GraspType,
        hand::Digit,
        requirements::{ApproachCone, DigitSet, Requirements, TypeSet},
        strategy::{BendRatioChoice, Strategy, Validity},
    },
    search::settings::{Query, Run},
};

use super::{
    Field, Violations, check_positive, check_unset, check_within, direction, duration, friction, known,
    positive_duration,
};
use crate::{
    convention::Convention,
    rigs::{RigHand, resource_name},
    wire::wire_digit,
};

/// Largest index of an attempt: 146,000 years at a million attempts per second.
const LAST_ATTEMPT: u64 = (1 << 62) - 1;

/// Longest refinement time: longer ones would keep clients waiting that want the first grasp.
const MAX_REFINEMENT: Duration = Duration::from_secs(1);

/// Budget for `GRASP_CHOICE_BEST_WITHIN_BUDGET` if the request names none: a third of a frame at 60 Hz. If there is no grasp
/// by then, the search continues for the first one.
const BEST_CHOICE_BUDGET: Duration = Duration::from_millis(5);

pub(super) fn validity(sent: Option<&v1::Requirements>) -> Validity {
    match sent.and_then(|sent| sent.thesis) {
        Some(thesis) if thesis.thesis_validity => Validity::Thesis,
        _ => Validity::Physical,
    }
}

/// A search with these requirements, which are in the client's frame and `OpenXR` axes. Wrong fields require nothing. A rig that is
/// known must have the digits that must touch.
pub(super) fn requirements(
    field: Field<'_>,
    sent: &v1::Requirements,
    (validity, convention): (Validity, Convention),
    receiving_hand: Option<&RigHand>,
) -> Query {
    let friction = friction(field.child("friction"), sent.friction);
    let approach = approach(field, sent, convention);
    let types = |name, sent: &[i32], allowed: TypeSet| -> TypeSet {
        let is_allowed = |one| allowed.contains(one);
        listed(
            field.child(name),
            sent,
            grasp_type,
            ("allowed_grasp_types", is_allowed),
        )
    };
    let allowed_types = types(
        "allowed_grasp_types",
        &sent.allowed_grasp_types,
        TypeSet::default(),
    );
    let excluded_types = types("excluded_grasp_types", &sent.excluded_grasp_types, allowed_types);
    field.child("excluded_grasp_types").check(
        GraspType::ALL.iter().any(|&one| !excluded_types.contains(one)),
        format_args!(
            "lists all {} types; at least one must be allowed",
            GraspType::ALL.len()
        ),
    );
    let digits = |name, sent: &[i32], must_touch: DigitSet| -> DigitSet {
        let must = |digit| must_touch.contains(digit);
        listed(field.child(name), sent, digit, ("must_touch", must))
    };
    let must_touch = digits("must_touch", &sent.must_touch, DigitSet::default());
    let must_not_touch = digits("must_not_touch", &sent.must_not_touch, must_touch);
    let thesis_field = field.child("thesis");
    let thesis = sent.thesis.unwrap_or_default();
    let worst_comfort = thesis.max_comfort.filter(|&worst| {
        let text = format_args!("is {worst}; it must be finite and at least 0");
        thesis_field
            .child("max_comfort")
            .check(worst >= 0.0 && worst.is_finite(), text)
    });
    let strategy = strategy(known(thesis_field.child("strategy"), thesis.strategy), validity);
    let ratios = known(thesis_field.child("bend_ratios"), thesis.bend_ratios);
    let rig = receiving_hand.map(|hand| &hand.hand.rig);
    for (rig, digit) in rig
        .into_iter()
        .flat_map(|rig| Digit::ALL.map(|digit| (rig, digit)))
    {
        field.child("must_touch").check(
            rig.has(digit) || !must_touch.contains(digit),
            format_args!(
                "contains {}, which {} does not have; leave it out",
                wire_digit(digit).as_str_name(),
                resource_name(rig)
            ),
        );
    }
    Query {
        strategy,
        validity,
        bend_ratios: bend_ratios(ratios, strategy),
        friction,
        requirements: Requirements {
            reach: None,
            approach,
            // An empty list allows all types, and so does one with only wrong values.
            allowed_types: Some(allowed_types).filter(|&allowed| allowed != TypeSet::default()),
            excluded_types,
            must_touch,
            must_not_touch,
            worst_comfort,
        },
        ..Query::default()
    }
}

/// The directions of approach. Axis and angle require each other.
fn approach(field: Field<'_>, sent: &v1::Requirements, convention: Convention) -> Option<ApproachCone> {
    let half_angle = sent.max_approach_angle;
    if sent.client_approach.is_none() && half_angle == 0.0 {
        return None;
    }
    let axis_field = field.child("client_approach");
    let axis = match sent.client_approach {
        Some(axis) => direction(axis_field, axis, convention),
        None => axis_field.reject("is required with max_approach_angle"),
    };
    let has_width = check_positive(field.child("max_approach_angle"), half_angle, PI);
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
    let members = field.each(sent, |field, &value| {
        let member = read(field, value)?;
        if is_in_opposite(member) {
            return field.reject(format_args!(
                "is {member:?}, which {opposite} contains as well; it cannot be in both"
            ));
        }
        Some(member)
    });
    members.flatten().collect()
}

fn grasp_type(field: Field<'_>, value: i32) -> Option<GraspType> {
    let text = "is GRASP_TYPE_UNSPECIFIED; it must name a type of the taxonomy";
    field.check(value != 0, text);
    let wire: v1::GraspType = known(field, value);
    // The contract uses the taxonomy's numbers.
    GraspType::from_number(i32::from(wire).cast_unsigned())
}

fn digit(field: Field<'_>, value: i32) -> Option<Digit> {
    field.check(value != 0, "is DIGIT_UNSPECIFIED; it must name a digit");
    let wire: v1::Digit = known(field, value);
    Digit::ALL.into_iter().find(|&digit| wire_digit(digit) == wire)
}

/// Adds a violation for each option that only experiments with searches have.
pub(super) fn check_no_experiment(sent: Option<&v1::Requirements>, v: &Violations) {
    let Some(sent) = sent.and_then(|sent| sent.thesis) else {
        return;
    };
    // Undefined values are rejected elsewhere.
    let strategy = !matches!(sent.strategy(), v1::Strategy::Unspecified | v1::Strategy::Guided);
    let ratios = sent.bend_ratios() != v1::BendRatios::Unspecified;
    let is_set = [
        ("thesis_validity", sent.thesis_validity),
        ("strategy", strategy),
        ("bend_ratios", ratios),
        ("record_step_times", sent.record_step_times),
    ];
    let why_not = "only FindGrasp and StreamGrasps take it: leave it out";
    check_unset(v.field("requirements").child("thesis"), is_set, why_not);
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct SearchLimits {
    pub budget: Option<Duration>,
    /// Requested time for improving a first valid grasp, at most [`MAX_REFINEMENT`].
    pub refinement: Option<Duration>,
    /// True if the search continues for a first grasp when the budget ends without one.
    pub is_patient: bool,
}

pub(super) fn search(field: Field<'_>, sent: &v1::SearchOptions) -> (SearchLimits, Run) {
    let choice: v1::GraspChoice = known(field.child("choice"), sent.choice);
    let is_patient = choice == v1::GraspChoice::BestWithinBudget && sent.budget.is_none();
    let budget = match sent.budget {
        Some(budget) => positive_duration(field.child("budget"), budget),
        None => is_patient.then_some(BEST_CHOICE_BUDGET),
    };
    let refinement = sent
        .refinement_time
        .and_then(|sent| duration(field.child("refinement_time"), sent))
        .map(|sent| sent.min(MAX_REFINEMENT));
    let most = sent.max_attempts.unwrap_or(LAST_ATTEMPT);
    let attempts = field.child("max_attempts");
    attempts.check(most > 0, "is 0; it must be at least 1");
    let only = sent.replay_attempt.unwrap_or(0);
    check_within(field.child("replay_attempt"), only, 0..=LAST_ATTEMPT);
    let limits = SearchLimits {
        budget,
        refinement,
        is_patient,
    };
    let run = Run {
        reproducible: choice == v1::GraspChoice::Reproducible,
        first_attempt: only,
        max_attempts: sent.replay_attempt.map_or(most.min(LAST_ATTEMPT), |_| 1),
        ..Run::default()
    };
    (limits, run)
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
    use glam::Vec3;

    use super::*;
    use crate::validate::fixtures::{CONVENTIONS, read_at};

    fn checked(sent: &v1::Requirements, convention: Convention) -> Requirements {
        let (checked, blamed) = read_at("requirements", |field| {
            requirements(field, sent, (Validity::Physical, convention), None)
        });
        assert_eq!(blamed, [""; 0]);
        checked.requirements
    }

    #[test]
    fn converts_directions() {
        let axis = Vec3::new(2.0, -1.0, 2.0) / 3.0;
        for convention in CONVENTIONS {
            let sent = v1::Requirements {
                client_approach: Some((convention.direction_from_openxr(axis) * 5.0).into()),
                max_approach_angle: 0.4,
                ..Default::default()
            };
            let approach = checked(&sent, convention).approach.expect("an approach was sent");
            assert!(
                approach.axis.distance(axis) < 1e-6 && approach.half_angle == 0.4,
                "{convention:?}"
            );
        }
    }

    #[test]
    fn every_grasp_type_has_its_name_in_the_contract() {
        for one in GraspType::ALL {
            let name = one.name().to_uppercase().replace([' ', '-'], "_");
            let wire = v1::GraspType::from_str_name(&format!("GRASP_TYPE_{name}")).expect("the same names");
            let allowing = v1::Requirements {
                allowed_grasp_types: vec![wire.into(), wire.into()],
                ..Default::default()
            };
            let excluding = v1::Requirements {
                excluded_grasp_types: vec![wire.into()],
                ..Default::default()
            };
            let [allowing, excluding] = [allowing, excluding].map(|sent| checked(&sent, Convention::OpenXr));
            let only = [one].into_iter().collect();
            assert_eq!(allowing.allowed_types, Some(only), "{name}");
            assert_eq!(
                (excluding.allowed_types, excluding.excluded_types),
                (None, only),
                "{name}"
            );
        }
    }

    #[test]
    fn reads_digits_and_comfort() {
        let sent = v1::Requirements {
            must_touch: vec![1, 3, 1],
            must_not_touch: vec![2, 4, 5],
            thesis: Some(v1::ThesisOptions {
                max_comfort: Some(0.0),
                ..Default::default()
            }),
            ..Default::default()
        };
        let expected = Requirements {
            must_touch: [Digit::Thumb, Digit::Middle].into_iter().collect(),
            must_not_touch: [Digit::Index, Digit::Ring, Digit::Little].into_iter().collect(),
            worst_comfort: Some(0.0),
            ..Requirements::default()
        };
        assert_eq!(checked(&sent, Convention::OpenXr), expected);
    }

    #[test]
    fn refinement_may_be_none_and_is_at_most_a_second() {
        for (seconds, expected) in [(0, Duration::ZERO), (60, MAX_REFINEMENT)] {
            let sent = v1::SearchOptions {
                refinement_time: Some(prost_types::Duration { seconds, nanos: 0 }),
                ..Default::default()
            };
            let (read, blamed) = read_at("search", |field| search(field, &sent));
            assert_eq!((read.0.refinement, blamed.len()), (Some(expected), 0));
        }
    }
}
