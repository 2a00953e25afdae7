//! Checks `SearchOptions`.

use grasp_proto::v1;
use grasp_synthesis::model::strategy::Choice;

use super::{
    Field, known,
    search_limits::{SearchLimits, search_limits},
};

/// How to search.
#[derive(Clone, Copy, Debug)]
pub(super) struct Search {
    pub limits: SearchLimits,
    pub choice: Choice,
    /// True if the indices of the valid attempts must decide.
    pub reproducible: bool,
    pub seed: Option<u64>,
    pub allows_atlas: bool,
    pub is_replay: bool,
}

pub(super) fn search(field: Field<'_>, sent: Option<v1::SearchOptions>) -> Search {
    let sent = sent.unwrap_or_default();
    let choice: v1::GraspChoice = known(field.child("choice"), sent.choice);
    let reproducible = choice == v1::GraspChoice::Reproducible;
    let choice = match choice {
        v1::GraspChoice::Unspecified | v1::GraspChoice::FirstValid | v1::GraspChoice::Reproducible => {
            Choice::FirstValid
        }
        v1::GraspChoice::BestWithinBudget => Choice::BestWithinBudget,
    };
    Search {
        limits: search_limits(field, &sent, choice),
        choice,
        reproducible,
        seed: sent.seed,
        allows_atlas: !sent.ignore_atlas,
        is_replay: sent.replay_attempt.is_some(),
    }
}
