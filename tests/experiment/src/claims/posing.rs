//! Finger posing (5.4).

use grasp_synthesis::{
    base::rejection::Rejection,
    model::{
        hand::Digit,
        strategy::Strategy::{C, D, E},
    },
};

use super::{Claim, Verdict, verdict_of, verdict_of_ratio};
use crate::{
    data::Data,
    plan::Set,
    tables::{bend_angle_bins, column_means, lost, negative_counts, touching_yaws, yaw_distance},
};

/// 95 % quantile of the Kolmogorov distribution.
const CHANCE: f64 = 1.36;

pub(super) fn claims(data: &Data<'_>) -> Vec<Claim> {
    let mut claims = Vec::new();
    claims.extend(early_stop(data));
    claims.extend(yaw(data));
    if data.ladder().any(|strategy| strategy == C) {
        claims.extend(bend_angles(data));
        claims.extend(ratios_used(data));
        claims.extend(lost_contacts(data));
    }
    claims.extend(choices(data));
    claims.extend(one_random(data));
    claims
}

/// Strategy D.
fn early_stop(data: &Data<'_>) -> Vec<Claim> {
    let means = |strategy| column_means(data, Set::ladder(strategy));
    let (Some(c), Some(d)) = (means(C), means(D)) else {
        return Vec::new();
    };
    let counts = negative_counts(data, Set::ladder(D));
    let grouped = counts[Rejection::NoContacts.index()] == 0 && counts[Rejection::NoThumb.index()] == 0;
    let share =
        100.0 * counts[Rejection::NoThumbEarlyStop.index()] as f64 / counts.iter().sum::<u64>().max(1) as f64;
    vec![
        Claim {
            source: "5.4, Figure 5.16",
            thesis: "stopping at a thumb without contact leaves the attempts as they were and divides the time by 2.4",
            run: format!("attempts by {:.2}, time by {:.2}", c.0 / d.0, c.1 / d.1),
            verdict: verdict_of_ratio(c.1 / d.1, 2.4),
            why: "posing is a smaller part of an attempt here, beside placing the wrist, and fingers that cannot reach \
                  the object were cheap already",
        },
        Claim {
            source: "5.4, Figure 5.16b",
            thesis: "NoContacts and NoThumb become NoThumbEarlystop",
            run: format!("{share:.0} % of the failures"),
            verdict: verdict_of(grouped),
            why: "",
        },
    ]
}

/// Figure 5.15.
fn yaw(data: &Data<'_>) -> Option<Claim> {
    let count = touching_yaws(data, Digit::Index).len();
    let distance = yaw_distance(data, Digit::Index)?;
    let by_chance = CHANCE / (count as f64).sqrt();
    Some(Claim {
        source: "5.4, Figure 5.15",
        thesis: "the yaw angles of touching index fingers are spread evenly over their range",
        run: format!(
            "largest distance from an even spread {:.1} %, by chance up to {:.1} %",
            100.0 * distance,
            100.0 * by_chance
        ),
        verdict: if distance <= by_chance {
            Verdict::Agrees
        } else if distance <= 3.0 * by_chance {
            Verdict::InPart
        } else {
            Verdict::Differs
        },
        why: "with more grasps than the thesis had, a slight lean shows",
    })
}

/// Figure 5.17.
fn bend_angles(data: &Data<'_>) -> Vec<Claim> {
    let counts = Digit::ALL.map(|digit| {
        let (start, counts) = bend_angle_bins(data, digit);
        let sums: Vec<u64> = (0..counts[0].len())
            .map(|bin| counts.iter().map(|ratio| ratio[bin]).sum())
            .collect();
        (start, sums)
    });
    let empty = counts
        .iter()
        .flat_map(|(_, sums)| sums)
        .filter(|sum| **sum == 0)
        .count();
    // The share of touching fingers in the upper half of the range that touches.
    let upper = counts[1..].iter().map(|(_, sums)| {
        let total: u64 = sums.iter().sum();
        let upper: u64 = sums[sums.len() / 2..].iter().sum();
        upper as f64 / total.max(1) as f64
    });
    let upper: Vec<_> = upper.collect();
    let most = upper.iter().filter(|share| **share > 0.5).count();
    vec![
        Claim {
            source: "5.4, Figure 5.17",
            thesis: "digits touch over the whole range of bend angles: no bin of 10° is empty",
            run: format!("{empty} empty bins"),
            verdict: verdict_of(empty == 0),
            why: "bins at the ends hold few grasps; a small run can leave one empty",
        },
        Claim {
            source: "5.4, Figure 5.17",
            thesis: "most of the fingers' bend angles are on the higher side",
            run: format!(
                "in the upper half: index {:.0} %, middle {:.0} %, ring {:.0} %, little {:.0} %",
                100.0 * upper[0],
                100.0 * upper[1],
                100.0 * upper[2],
                100.0 * upper[3]
            ),
            verdict: match most {
                4 => Verdict::Agrees,
                0 => Verdict::Differs,
                _ => Verdict::InPart,
            },
            why: "a digit stops at the first step that touches; with objects nearer to the palm that is earlier",
        },
    ]
}

/// Figure 5.18.
fn ratios_used(data: &Data<'_>) -> Option<Claim> {
    let mut sums = [0_u64; 3];
    for digit in &Digit::ALL[1..] {
        let (_, counts) = bend_angle_bins(data, *digit);
        for (sum, bins) in sums.iter_mut().zip(&counts) {
            *sum += bins.iter().sum::<u64>();
        }
    }
    let total = sums.iter().sum::<u64>();
    let share = |index: usize| 100.0 * sums[index] as f64 / total as f64;
    (total > 0).then(|| Claim {
        source: "5.4, Figure 5.18",
        thesis: "the fingers touch less often with ratio 0.7 than with 1 or 1.42, which are equally good",
        run: format!("0.7: {:.0} %, 1: {:.0} %, 1.42: {:.0} %", share(0), share(1), share(2)),
        verdict: verdict_of(sums[0] < sums[1] && sums[0] < sums[2]),
        why: "the ratio that is tried first is found most often, as the thesis says itself: Algorithm 4 as printed \
              tries 0.7 first and is done when it touches. Its figure fits a code that begins with another ratio",
    })
}

/// Figure 5.19.
fn lost_contacts(data: &Data<'_>) -> Vec<Claim> {
    let fingers = &Digit::ALL[1..];
    let mut on_new = [0_u64; 3];
    let mut lost_of_low = [0_u64; 3];
    let mut touching = 0_u64;
    for digit in fingers {
        let (lost, own_touching) = lost(data, *digit);
        touching += own_touching.iter().sum::<u64>();
        for old in lost {
            for (sum, count) in on_new.iter_mut().zip(old) {
                *sum += count;
            }
        }
        for (sum, count) in lost_of_low.iter_mut().zip(lost[0]) {
            *sum += count;
        }
    }
    let share = |count: u64| 100.0 * count as f64 / touching.max(1) as f64;
    vec![
        Claim {
            source: "5.4, Figure 5.19",
            thesis: "closing all fingers with 0.7 loses most contacts (195), with 1 fewer (75), with 1.42 fewest (66)",
            run: format!(
                "{} ({:.0} %), {} ({:.0} %) and {} ({:.0} %) of {touching}",
                on_new[0],
                share(on_new[0]),
                on_new[1],
                share(on_new[1]),
                on_new[2],
                share(on_new[2])
            ),
            verdict: if on_new[0] > on_new[1] && on_new[1] >= on_new[2] {
                Verdict::Agrees
            } else if on_new[0] > on_new[1].min(on_new[2]) {
                Verdict::InPart
            } else {
                Verdict::Differs
            },
            why: "most fingers here touched with 0.7, which is tried first, and a ratio loses none of its own contacts; \
                  in the thesis most touched with 1 or 1.42",
        },
        Claim {
            source: "5.4, Figure 5.19",
            thesis: "fingers that touched with 0.7 lose barely any contact with 1 (3) or 1.42 (11)",
            run: format!(
                "{} and {}: {:.1} % and {:.1} % of all touching fingers",
                lost_of_low[1],
                lost_of_low[2],
                share(lost_of_low[1]),
                share(lost_of_low[2])
            ),
            verdict: if share(lost_of_low[1].max(lost_of_low[2])) < 5.0 {
                Verdict::Agrees
            } else {
                Verdict::Differs
            },
            why: "far more fingers touched with 0.7 to begin with, for the reason above",
        },
    ]
}

/// Figure 5.20.
fn choices(data: &Data<'_>) -> Option<Claim> {
    let columns: Option<Vec<_>> = Set::BEND_RATIO_COLUMNS
        .iter()
        .map(|set| column_means(data, *set))
        .collect();
    let columns = columns?;
    let faster = columns[1..]
        .iter()
        .filter(|column| column.1 < columns[0].1)
        .count();
    let changes: Vec<_> = columns[1..]
        .iter()
        .map(|column| format!("{:+.0} %", 100.0 * (column.1 / columns[0].1 - 1.0)))
        .collect();
    Some(Claim {
        source: "5.4, Figure 5.20",
        thesis: "every other way to choose bend ratios than trying all is faster: -32, -60, -60, -43, -54 %",
        run: changes.join(", "),
        verdict: match faster {
            5 => Verdict::Agrees,
            0 => Verdict::Differs,
            _ => Verdict::InPart,
        },
        why: "leaving ratios out saves time only on digits that do not touch with the first one tried, and most that \
              touch do so with the first here; and it costs the grasps that only the other ratios find",
    })
}

/// Strategy E.
fn one_random(data: &Data<'_>) -> Option<Claim> {
    let d = column_means(data, Set::ladder(D))?;
    let e = column_means(data, Set::ladder(E))?;
    Some(Claim {
        source: "5.4, Figure 5.21",
        thesis: "one random bend ratio leaves the attempts as they were and divides the time by 2.2 (11.6 s to 5.2 s)",
        run: format!("attempts times {:.2}, time by {:.2}", e.0 / d.0, d.1 / e.1),
        verdict: verdict_of_ratio(d.1 / e.1, 2.2),
        why: "an attempt gets a little cheaper, but fewer succeed, because a digit that does not touch with the drawn \
              ratio is given up; and placing the wrist, pruned placements included, costs the same as ever",
    })
}
