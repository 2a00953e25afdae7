//! Bend angles and bend ratios (Figures 5.17 to 5.20).

use grasp_synthesis::model::{bend_ratios::BEND_RATIOS, hand::Digit, strategy::Strategy};

use super::ladder::{column_letter, mean_of_means};
use crate::{
    data::{Data, attempts, milliseconds},
    plan::{Set, choice_name},
    record::DigitFigures,
    table::{Table, Value},
    thesis,
};

/// Width of a bin of Figure 5.17, in degrees.
pub(crate) const BEND_BIN_DEGREES: f64 = 10.0;

/// The digits of grasp set C that touch, valid or not.
fn touching<'a>(data: &Data<'a>, digit: Digit) -> impl Iterator<Item = &'a DigitFigures> {
    data.both(Set::ladder(Strategy::C))
        .filter_map(move |(_, details)| details.digits.get(digit.index()))
        .filter(|posed| posed.bend_ratio.is_some())
}

/// Index among the three ratios.
fn ratio_index(ratio: f32) -> Option<usize> {
    BEND_RATIOS.iter().position(|known| *known == ratio)
}

/// Figure 5.17: bend angles of a touching digit in set C. Returns the start of the first bin in degrees, and the counts
/// by ratio and bin.
pub(crate) fn bend_angle_bins(data: &Data<'_>, digit: Digit) -> (f64, [Vec<u64>; 3]) {
    let bin_of = |posed: &DigitFigures| (f64::from(posed.bend_degrees) / BEND_BIN_DEGREES).floor() as i64;
    let bins: Vec<_> = touching(data, digit)
        .map(|posed| (bin_of(posed), posed.bend_ratio))
        .collect();
    let first = bins.iter().map(|(bin, _)| *bin).min().unwrap_or(0);
    let last = bins.iter().map(|(bin, _)| *bin).max().unwrap_or(0);
    let mut counts = [(); 3].map(|()| vec![0; (last - first + 1) as usize]);
    for (bin, ratio) in bins {
        if let Some(ratio) = ratio.and_then(ratio_index) {
            counts[ratio][(bin - first) as usize] += 1;
        }
    }
    (first as f64 * BEND_BIN_DEGREES, counts)
}

/// Figure 5.17 as numbers.
pub fn bend_angles(data: &Data<'_>) -> Table {
    let mut table = Table::new(
        "bend-angles",
        "Bend angles of touching digits in grasp set C",
        ["digit", "from, °", "to, °", "0.7", "1.0", "1.42"],
    );
    for digit in Digit::ALL {
        let (start, [low, one, high]) = bend_angle_bins(data, digit);
        for (bin, ((low, one), high)) in low.into_iter().zip(one).zip(high).enumerate() {
            let from = start + BEND_BIN_DEGREES * bin as f64;
            table.push(vec![
                format!("{digit:?}").into(),
                Value::decimals(from, 0),
                Value::decimals(from + BEND_BIN_DEGREES, 0),
                low.into(),
                one.into(),
                high.into(),
            ]);
        }
    }
    table
}

/// Figure 5.18: how often each ratio found a touching pose in set C.
pub fn ratio_counts(data: &Data<'_>) -> Table {
    let mut table = Table::new(
        "bend-ratios-used",
        "Touching digits of grasp set C by bend ratio",
        ["digit", "0.7", "1.0", "1.42"],
    );
    let mut sums = [0; 3];
    for digit in Digit::ALL {
        let counts = bend_angle_bins(data, digit)
            .1
            .map(|bins| bins.iter().sum::<u64>());
        for (sum, count) in sums.iter_mut().zip(counts) {
            *sum += count;
        }
        table.push(row(format!("{digit:?}"), counts));
    }
    table.push(row("all".to_owned(), sums));
    table
}

fn row(name: String, counts: [u64; 3]) -> Vec<Value> {
    std::iter::once(name.into())
        .chain(counts.map(Value::from))
        .collect()
}

/// Contacts of positive set C that are lost when a digit that touched with the first ratio closes with the second
/// alone, at the same wrist and yaw; and the number that touched with the first.
pub(crate) fn lost(data: &Data<'_>, digit: Digit) -> ([[u64; 3]; 3], [u64; 3]) {
    let mut lost = [[0; 3]; 3];
    let mut touching = [0; 3];
    let details = data
        .valid(Set::ladder(Strategy::C))
        .filter_map(|record| record.details.as_ref());
    for posed in details.filter_map(|details| details.digits.get(digit.index())) {
        let (Some(old), Some(touches)) = (posed.bend_ratio.and_then(ratio_index), posed.touches_with) else {
            continue;
        };
        touching[old] += 1;
        for (new, touches) in touches.into_iter().enumerate() {
            lost[old][new] += u64::from(!touches);
        }
    }
    (lost, touching)
}

/// Figure 5.19, next to the thesis' numbers.
pub fn lost_contacts(data: &Data<'_>) -> Table {
    let mut table = Table::new(
        "lost-contacts",
        "Contacts lost when the digits of the positive grasp set C close with another bend ratio alone",
        [
            "digit",
            "old ratio",
            "touching",
            "lost on 0.7",
            "lost on 1.0",
            "lost on 1.42",
            "thesis: on 0.7",
            "thesis: on 1.0",
            "thesis: on 1.42",
        ],
    );
    let mut totals = [[0; 3]; 4];
    for digit in Digit::ALL {
        let (lost, touching) = lost(data, digit);
        let printed = thesis::LOST_CONTACTS[digit.index()];
        for old in 0..3 {
            let mut row = vec![
                format!("{digit:?}").into(),
                Value::decimals(f64::from(BEND_RATIOS[old]), 2),
                touching[old].into(),
            ];
            for counts in [lost[old], printed[old]] {
                row.extend((0..3).map(|new| {
                    if new == old {
                        Value::Missing
                    } else {
                        counts[new].into()
                    }
                }));
            }
            table.push(row);
            for new in 0..3 {
                totals[0][new] += lost[old][new];
                totals[1][new] += printed[old][new];
                if digit != Digit::Thumb {
                    totals[2][new] += lost[old][new];
                    totals[3][new] += printed[old][new];
                }
            }
        }
    }
    for (name, [ours, printed]) in [
        ("all digits", [totals[0], totals[1]]),
        ("fingers", [totals[2], totals[3]]),
    ] {
        let mut row = vec![name.into(), Value::Missing, Value::Missing];
        row.extend(ours.into_iter().chain(printed).map(Value::from));
        table.push(row);
    }
    table
}

/// Means over the holdouts of attempts and milliseconds per valid grasp for a column of Figure 5.20.
pub(crate) fn column_means(data: &Data<'_>, set: Set) -> Option<(f64, f64)> {
    let searches = data.searches_by_holdout(set, 1);
    let attempts: Vec<_> = searches.iter().map(|own| attempts(own)).collect();
    let times: Vec<_> = searches.iter().map(|own| milliseconds(own)).collect();
    mean_of_means(&attempts).zip(mean_of_means(&times))
}

/// Figure 5.20: choices of bend ratios as differences from trying all, next to the thesis' numbers.
pub fn columns(data: &Data<'_>) -> Table {
    let mut table = Table::new(
        "bend-ratio-choices",
        "Ways to choose the bend ratios, difference from (a) in percent",
        [
            "column",
            "bend ratios",
            "attempts",
            "ms",
            "attempts, %",
            "ms, %",
            "thesis: attempts, %",
            "thesis: ms, %",
        ],
    );
    let Some((all_attempts, all_ms)) = column_means(data, Set::BEND_RATIO_COLUMNS[0]) else {
        return table;
    };
    let printed_all = thesis::BEND_RATIO_COLUMNS[0];
    for (index, set) in Set::BEND_RATIO_COLUMNS.into_iter().enumerate() {
        let Some((attempts, ms)) = column_means(data, set) else {
            continue;
        };
        let printed = thesis::BEND_RATIO_COLUMNS[index];
        let changes = [
            100.0 * (attempts / all_attempts - 1.0),
            100.0 * (ms / all_ms - 1.0),
            100.0 * printed.attempts / printed_all.attempts,
            100.0 * printed.milliseconds / printed_all.milliseconds,
        ];
        let mut row = vec![
            format!("({})", column_letter(index)).into(),
            choice_name(set.bend_ratios).into(),
            Value::number(attempts),
            Value::number(ms),
        ];
        row.extend(changes.map(|change| match index {
            0 => Value::Missing,
            _ => Value::decimals(change, 0),
        }));
        table.push(row);
    }
    table
}
