//! How naive synthesis ends and how long its steps take (5.2), and Immobility Validation (5.5, 5.6).

use grasp_synthesis::{
    base::rejection::Rejection,
    model::strategy::Strategy::{self, A, F},
};

use super::{Claim, Verdict, verdict_of, verdict_of_ratio};
use crate::{
    data::Data,
    plan::Set,
    stats::{mean, quantile, rank_correlation},
    tables::{contacts_of, holdout_means, mean_step_times, negative_counts, step_shares, valid_with_figures},
    thesis,
};

/// 5.2.
pub(super) fn naive(data: &Data<'_>) -> Vec<Claim> {
    if !data.ladder().any(|strategy| strategy == A) {
        return Vec::new();
    }
    let set = Set::ladder(A);
    let counts = negative_counts(data, set);
    let total = counts.iter().sum::<u64>().max(1) as f64;
    let share = |rejection: Rejection| 100.0 * counts[rejection.index()] as f64 / total;
    let no_contacts = share(Rejection::NoContacts);
    let rare = [
        Rejection::NoFingers,
        Rejection::PalmCollision,
        Rejection::FingerCollision,
        Rejection::NotImmobilizing,
    ]
    .map(share);
    let (_, shares, _) = step_shares(data, set);
    let mut claims = vec![
        Claim {
            source: "5.2, Figure 5.5b",
            thesis: "95 % of the naive synthesis' failures are NoContacts",
            run: format!("{no_contacts:.1} %"),
            verdict: verdict_of((no_contacts - 95.0).abs() <= 3.0),
            why: "",
        },
        Claim {
            source: "5.2, Figure 5.5b",
            thesis: "very few NoFingers, PalmCollision, FingerCollision and NotImmobilizing, no UnwantedContact",
            run: format!(
                "{:.1}, {:.1}, {:.1} and {:.1} %; UnwantedContact {:.1} %",
                rare[0],
                rare[1],
                rare[2],
                rare[3],
                share(Rejection::UnwantedContact)
            ),
            verdict: verdict_of(
                rare.iter().all(|share| *share < 3.0) && share(Rejection::UnwantedContact) < 0.5,
            ),
            why: "",
        },
        Claim {
            source: "5.2, Figure 5.7",
            thesis: "90 % of the time is finger posing, 5 % wrist placement",
            run: format!("{:.0} % and {:.0} %", 100.0 * shares[1], 100.0 * shares[0]),
            verdict: if shares[1] > 0.8 {
                Verdict::Agrees
            } else if shares[1] > shares[0] {
                Verdict::InPart
            } else {
                Verdict::Differs
            },
            why: "here a digit whose touch segments cannot reach the object costs one bounded closest-point search; \
                  the thesis' code asks the mesh far more often, so placing the wrist weighs less there",
        },
    ];
    claims.extend(order_of_objects(data, A));
    claims.extend(order_of_holdouts(data, A));
    claims
}

/// "The scissors are fairly easy to validly grasp, whereas the scalpel and especially the remote are hard".
fn order_of_objects(data: &Data<'_>, strategy: Strategy) -> Option<Claim> {
    let means = holdout_means(data, Set::ladder(strategy));
    let of_object = |object: &str| {
        let own: Vec<_> = means
            .iter()
            .filter(|(holdout, _)| grasp_assets::holdouts::holdouts()[*holdout].object == object)
            .map(|(_, attempts)| *attempts)
            .collect();
        mean(&own)
    };
    let [scissors, scalpel, remote] = [
        of_object("scissors")?,
        of_object("scalpel")?,
        of_object("remote")?,
    ];
    Some(Claim {
        source: "5.2, Figure 5.5a",
        thesis: "scissors are easy (19,437 attempts), the scalpel is hard (354,286) and the remote harder (995,139)",
        run: format!("{scissors:.0}, {scalpel:.0} and {remote:.0} attempts"),
        verdict: verdict_of(scissors < scalpel && scalpel < remote),
        why: "the holdouts are our own: the thesis shows them in pictures only, and how much of an object the giver's \
              hand leaves free decides how hard it is",
    })
}

/// Not in the thesis' text, but in its table.
fn order_of_holdouts(data: &Data<'_>, strategy: Strategy) -> Option<Claim> {
    let pairs: Vec<_> = holdout_means(data, Set::ladder(strategy))
        .into_iter()
        .filter_map(|(holdout, attempts)| Some((thesis::by_holdout(strategy, holdout)?.attempts, attempts)))
        .collect();
    let correlation = rank_correlation(&pairs)?;
    Some(Claim {
        source: "Figure 5.5a",
        thesis: "which holdouts are hard: attempts from 3,890 (Scissors GenHold2) to 2,214,064 (Remote GenHold2)",
        run: format!("rank correlation of attempts by holdout {correlation:.2}"),
        verdict: if correlation > 0.7 {
            Verdict::Agrees
        } else if correlation > 0.3 {
            Verdict::InPart
        } else {
            Verdict::Differs
        },
        why: "the holdouts were rebuilt after the thesis' pictures and the names of their grasp types",
    })
}

/// 5.5 and 5.6.
pub(super) fn immobility(data: &Data<'_>) -> Vec<Claim> {
    let mut claims = Vec::new();
    let strategies: Vec<_> = data.ladder().collect();
    let mut contacts = Vec::new();
    for &strategy in &strategies {
        let own = valid_with_figures(data, Set::ladder(strategy));
        contacts.extend(own.map(|(_, details, _)| contacts_of(details)));
    }
    if let Some(most) = quantile(&contacts, 1.0) {
        claims.push(Claim {
            source: "5.5",
            thesis: "no grasp has more than 6 contacts",
            run: format!("at most {most:.0}, {:.1} on average", mean(&contacts).unwrap_or(0.0)),
            verdict: verdict_of(most <= f64::from(thesis::MAX_CONTACTS)),
            why: "after a first link touches, the outer links go on closing (the prose of 4.4; Algorithm 4 as printed \
                  returns at the first contact), so that a finger can have two or three contacts",
        });
    }
    // The thesis examined Algorithm 9: the sets before F.
    let best_of_hundred = strategies.iter().copied().filter(|strategy| *strategy < F);
    let sufficient: Vec<_> = best_of_hundred
        .flat_map(|strategy| valid_with_figures(data, Set::ladder(strategy)))
        .filter_map(|(.., grasp)| grasp.sufficient_distributions.map(f64::from))
        .collect();
    if let Some(ours) = mean(&sufficient) {
        claims.push(Claim {
            source: "5.6",
            thesis: "an average of 18 of 100 force distributions suffice",
            run: format!("{ours:.1} of 100 drawn again for each valid grasp"),
            verdict: verdict_of_ratio(ours, thesis::SUFFICIENT_DISTRIBUTIONS),
            why: "the thesis does not say how the four shares of a contact's lines are drawn; here every split is as \
                  likely as any other, so that with lines 70° off the normal the sum points almost anywhere, and the \
                  accepted 5° are 0.2 % of all directions: most valid grasps owe it to the draw. More even shares \
                  would suffice more often (not tried)",
        });
    }
    if strategies.contains(&F) {
        claims.extend(early_end(data));
    }
    claims
}

/// Figure 5.22.
fn early_end(data: &Data<'_>) -> Option<Claim> {
    let set = Set::ladder(F);
    let (valid, valid_times) = mean_step_times(data, set, None);
    let (failed, failed_times) = mean_step_times(data, set, Some(Rejection::NotImmobilizing));
    (valid > 0 && failed > 0).then(|| Claim {
        source: "5.6, Figure 5.22",
        thesis: "in set F valid grasps spend much less time in Immobility Validation than NotImmobilizing ones",
        run: format!("{:.1} µs against {:.1} µs", valid_times[4], failed_times[4]),
        verdict: if valid_times[4] < 0.6 * failed_times[4] {
            Verdict::Agrees
        } else if valid_times[4] < failed_times[4] {
            Verdict::InPart
        } else {
            Verdict::Differs
        },
        why: "",
    })
}
