//! The statements of chapter 5 against a run.

mod open;
mod placement;
mod posing;
mod speed;
mod steps;

use crate::{
    data::Data,
    table::{Table, Value},
    types::SetTypes,
};

/// Whether a run confirms the thesis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Yes.
    Agrees,
    /// In direction only, not in size.
    InPart,
    /// No.
    Differs,
    /// The thesis leaves it open; this is a first figure.
    Answered,
}

/// Counts the claims with a verdict.
pub fn count(claims: &[Claim], verdict: Verdict) -> usize {
    claims.iter().filter(|claim| claim.verdict == verdict).count()
}

/// A statement of the thesis and the run's answer.
#[derive(Clone, Debug)]
pub struct Claim {
    /// The place in the thesis.
    pub source: &'static str,
    /// The statement, with its figures.
    pub thesis: &'static str,
    /// The run's result.
    pub run: String,
    /// Whether they agree.
    pub verdict: Verdict,
    /// Why they may differ; shown where they do.
    pub why: &'static str,
}

/// All claims with records in the run, in the thesis' order.
pub fn claims(data: &Data<'_>, types: &[SetTypes]) -> Vec<Claim> {
    let all = [
        steps::naive(data),
        placement::claims(data),
        posing::claims(data),
        steps::immobility(data),
        speed::claims(data),
        open::claims(data, types),
    ];
    all.into_iter().flatten().collect()
}

/// The claims as a table.
pub fn table(claims: &[Claim]) -> Table {
    let mut table = Table::new(
        "claims",
        "What chapter 5 says, and what this run shows",
        ["where", "the thesis", "this run", "verdict", "why it may differ"],
    );
    for claim in claims {
        let (verdict, why) = match claim.verdict {
            Verdict::Agrees => ("agrees", Value::Missing),
            Verdict::InPart => ("in part", claim.why.into()),
            Verdict::Differs => ("differs", claim.why.into()),
            Verdict::Answered => ("a first figure", Value::Missing),
        };
        table.push(vec![
            claim.source.into(),
            claim.thesis.into(),
            claim.run.clone().into(),
            verdict.into(),
            why,
        ]);
    }
    table
}

/// A ratio agrees with the thesis' one within a factor of 1.5, and in part on the same side of 1.
fn verdict_of_ratio(ours: f64, thesis: f64) -> Verdict {
    let factor = (ours / thesis).max(thesis / ours);
    if factor <= 1.5 {
        Verdict::Agrees
    } else if (ours > 1.0) == (thesis > 1.0) {
        Verdict::InPart
    } else {
        Verdict::Differs
    }
}

/// A yes or no.
fn verdict_of(holds: bool) -> Verdict {
    if holds { Verdict::Agrees } else { Verdict::Differs }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ratios_agree_in_size_or_in_direction() {
        assert_eq!(verdict_of_ratio(15.0, 12.0), Verdict::Agrees);
        assert_eq!(verdict_of_ratio(3.0, 12.0), Verdict::InPart);
        assert_eq!(verdict_of_ratio(0.9, 2.0), Verdict::Differs);
        assert_eq!(verdict_of_ratio(1.1, 0.9), Verdict::Agrees);
    }

    #[test]
    fn reasons_are_shown_only_where_results_differ() {
        let claim = |verdict| Claim {
            source: "5.2",
            thesis: "a",
            run: "b".to_owned(),
            verdict,
            why: "because",
        };
        let table = table(&[claim(Verdict::Agrees), claim(Verdict::Differs)]);
        assert_eq!(table.rows[0][4], Value::Missing);
        assert_eq!(table.rows[1][4], Value::from("because"));
    }
}
