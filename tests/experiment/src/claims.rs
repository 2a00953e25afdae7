//! What chapter 5 says, against a run: does it come out?

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

/// Does a run bear out what the thesis says?
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Yes.
    Agrees,
    /// In direction, but not in size.
    InPart,
    /// No.
    Differs,
    /// The thesis asks; this is a first figure.
    Answered,
}

/// How many claims have a verdict.
pub fn count(claims: &[Claim], verdict: Verdict) -> usize {
    claims.iter().filter(|claim| claim.verdict == verdict).count()
}

/// A statement of the thesis and what a run has to say to it.
#[derive(Clone, Debug)]
pub struct Claim {
    /// Where the thesis says it.
    pub source: &'static str,
    /// What it says, with its figures.
    pub thesis: &'static str,
    /// What the run shows.
    pub run: String,
    /// Is it the same?
    pub verdict: Verdict,
    /// Why the two may differ; shown where they do.
    pub why: &'static str,
}

/// All claims that the run has records for, in the thesis' order.
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

/// A ratio that should be about as large as the thesis' one: within a factor of 1.5 it agrees; on the same side of 1 it
/// agrees in part.
fn verdict_of_ratio(ours: f64, thesis: f64) -> Verdict {
    let off = (ours / thesis).max(thesis / ours);
    if off <= 1.5 {
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
    fn reasons_are_given_where_the_two_differ() {
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
