//! Wrist placement (5.3).

use grasp_synthesis::{
    base::rejection::Rejection,
    model::strategy::Strategy::{A, B, C},
};

use super::{Claim, Verdict, verdict_of, verdict_of_ratio};
use crate::{
    data::Data,
    plan::Set,
    tables::{MEASURES, column_means, negative_counts, share_in_range, valid_values},
};

/// Below this, the thesis calls an angle sharp, in degrees.
const BLUNT_DEGREES: f64 = 90.0;

pub(super) fn claims(data: &Data<'_>) -> Vec<Claim> {
    let means = |strategy| column_means(data, Set::ladder(strategy));
    let mut claims = Vec::new();
    claims.extend(table_5_3(data));
    if let (Some(a), Some(b)) = (means(A), means(B)) {
        let ratio = a.0 / b.0;
        claims.push(Claim {
            source: "5.3",
            thesis: "the measures relative to the object divide the attempts by 15 (456,287 to 30,302)",
            run: format!("by {ratio:.1} ({:.0} to {:.0})", a.0, b.0),
            verdict: verdict_of_ratio(ratio, 15.1),
            why: "",
        });
        let ratio = a.1 / b.1;
        claims.push(Claim {
            source: "5.3",
            thesis: "and the time by 2.6 (137 s to 52 s)",
            run: format!("by {ratio:.1} ({:.1} ms to {:.1} ms)", a.1, b.1),
            verdict: verdict_of_ratio(ratio, 137.0 / 52.0),
            why: "here a failed naive attempt is very cheap (a fraction of a µs if every digit is out of reach), so \
                  fewer attempts save less time",
        });
    }
    let share_of = |strategy, rejection: Rejection| {
        let counts = negative_counts(data, Set::ladder(strategy));
        let total: u64 = counts.iter().sum();
        (total > 0).then(|| 100.0 * counts[rejection.index()] as f64 / total as f64)
    };
    if let Some(share) = share_of(B, Rejection::NoContacts) {
        claims.push(Claim {
            source: "5.3, Figure 5.12b",
            thesis: "NoContacts fall from 95 % to 48 % of the failures",
            run: format!("to {share:.0} %"),
            verdict: if (share - 48.0).abs() <= 10.0 {
                Verdict::Agrees
            } else {
                verdict_of_ratio(95.0 / share, 95.0 / 48.0)
            },
            why: "the share depends on object and hand sizes and on the box from which placements are drawn; the \
                  measures rule out hands that are too far or turned away in both",
        });
    }
    claims.extend(palm_angle(data));
    if let (Some(b), Some(c)) = (means(B), means(C)) {
        let ratio = b.0 / c.0;
        claims.push(Claim {
            source: "5.3",
            thesis: "the palm-CoM-palm angle divides the attempts by 1.9 (30,302 to 15,931) and the time by 1.9",
            run: format!("attempts by {ratio:.2}, time by {:.2}", b.1 / c.1),
            verdict: verdict_of_ratio(ratio, 1.9),
            why: "it helps as much as the giver's hand is in the way on its own side; a share of the valid grasps is \
                  lost too (those with a sharp angle, above)",
        });
    }
    if let Some((b, c)) = share_of(B, Rejection::NoContacts).zip(share_of(C, Rejection::NoContacts)) {
        let no_thumb = share_of(C, Rejection::NoThumb).unwrap_or(0.0);
        claims.push(Claim {
            source: "5.3, Figure 5.14b",
            thesis: "which leaves the distribution of failures as it was; 31 % are NoThumb",
            run: format!("NoContacts {b:.0} % to {c:.0} %; NoThumb {no_thumb:.0} %"),
            verdict: if (b - c).abs() <= 5.0 && (no_thumb - 31.0).abs() <= 8.0 {
                Verdict::Agrees
            } else {
                Verdict::InPart
            },
            why: "the shares depend on the sizes of hand and objects",
        });
    }
    claims
}

/// "All valid grasps lie inside these ranges".
fn table_5_3(data: &Data<'_>) -> Option<Claim> {
    let shares: Option<Vec<_>> = MEASURES[..5]
        .iter()
        .map(|measure| share_in_range(&valid_values(data, Set::ladder(A), measure), measure.allowed))
        .collect();
    let shares = shares?;
    let smallest = shares.iter().copied().fold(1.0, f64::min);
    let named: Vec<_> = MEASURES[..5]
        .iter()
        .zip(&shares)
        .map(|(measure, share)| format!("{} {:.0} %", measure.bare_name(), 100.0 * share))
        .collect();
    Some(Claim {
        source: "5.3, Table 5.3",
        thesis: "all valid grasps of set A lie in the ranges of Table 5.3",
        run: named.join(", "),
        verdict: if smallest > 0.97 {
            Verdict::Agrees
        } else if smallest > 0.7 {
            Verdict::InPart
        } else {
            Verdict::Differs
        },
        why: "a hand of 22 cm that touches with its fingertips alone has its wrist up to 15 cm from the object; \
              the 12 cm of Table 5.3 prune those grasps from set B on",
    })
}

/// Figure 5.13.
fn palm_angle(data: &Data<'_>) -> Option<Claim> {
    let values = valid_values(data, Set::ladder(B), &MEASURES[5]);
    let blunt = values.iter().filter(|angle| **angle > BLUNT_DEGREES).count() as f64;
    (!values.is_empty()).then(|| Claim {
        source: "5.3, Figure 5.13",
        thesis: "the two palms make a blunt angle (> 90°) for most valid grasps, a sharp one for a number of them",
        run: format!("blunt for {:.0} %", 100.0 * blunt / values.len() as f64),
        verdict: verdict_of(blunt > 0.5 * values.len() as f64 && blunt < values.len() as f64),
        why: "",
    })
}
