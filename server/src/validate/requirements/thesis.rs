//! Checks `ThesisOptions`.

use grasp_proto::v1;
use grasp_synthesis::model::{
    bend_ratios::BendRatioChoice,
    strategy::{Strategy, Validity},
};

use crate::validate::{Field, Violations, check_unset, known};

/// Options of the thesis, beside comfort.
#[derive(Clone, Copy, Debug)]
pub(in crate::validate) struct Thesis {
    pub validity: Validity,
    pub strategy: Strategy,
    pub bend_ratios: BendRatioChoice,
    pub record_step_times: bool,
}

impl Thesis {
    pub(super) fn of(field: Field<'_>, sent: v1::ThesisOptions, validity: Validity) -> Self {
        let strategy = strategy(known(field.child("strategy"), sent.strategy), validity);
        Self {
            validity,
            strategy,
            bend_ratios: bend_ratios(known(field.child("bend_ratios"), sent.bend_ratios), strategy),
            record_step_times: sent.record_step_times,
        }
    }

    /// True for searches of which grasps can be kept, or taken by both hands.
    pub(in crate::validate) fn is_default(self) -> bool {
        (self.strategy, self.validity) == (Strategy::Guided, Validity::Physical)
    }
}

/// Adds a violation for each option that only experiments with searches have.
pub(in crate::validate) fn check_no_experiment(sent: Option<&v1::Requirements>, v: &Violations) {
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
