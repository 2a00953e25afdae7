//! How attempts end, and how long they take (Figures 5.5b to 5.7, 5.12b, 5.14b, 5.16b, 5.21b, 5.22).

use grasp_synthesis::base::rejection::Rejection;

use crate::{
    data::Data,
    plan::Set,
    record::{Details, STEP_NAMES, output_type},
    table::{Table, Value},
};

/// Output types of each negative set, and for comparison their shares in all failed attempts of the searches for the
/// positive set, in which each holdout counts the same.
pub fn output_types(data: &Data<'_>) -> Table {
    let mut header = vec!["set".to_owned(), "attempts".to_owned()];
    for rejection in Rejection::THESIS {
        let name = output_type(Some(rejection));
        header.extend([name.to_owned(), format!("{name}, %"), format!("{name}, % of all")]);
    }
    let mut table = Table::new("output-types", "Output types of the negative grasp sets", header);
    for set in data.sets() {
        let counts = negative_counts(data, set);
        let total: u64 = counts.iter().sum();
        if total == 0 {
            continue;
        }
        let of_all = shares_of_all(data, set);
        let mut row = vec![Value::from(set.name()), total.into()];
        for (count, share) in counts.into_iter().zip(of_all) {
            row.extend([
                count.into(),
                Value::decimals(100.0 * count as f64 / total as f64, 1),
                Value::decimals(100.0 * share, 1),
            ]);
        }
        table.push(row);
    }
    table
}

/// Failed attempts of the negative set by kind.
pub(crate) fn negative_counts(data: &Data<'_>, set: Set) -> [u64; 8] {
    Rejection::THESIS.map(|kind| {
        let of_kind = data.invalid(set).filter(|record| record.rejection == Some(kind));
        of_kind.count() as u64
    })
}

/// Shares of all failed attempts by kind, the mean of the holdouts.
fn shares_of_all(data: &Data<'_>, set: Set) -> [f64; 8] {
    let mut by_holdout = data.searches_by_holdout(set, 1);
    by_holdout.retain(|searches| !searches.is_empty());
    let mut shares = [0.0; 8];
    for searches in &by_holdout {
        let mut counts = [0_u64; 8];
        for search in searches {
            for (sum, count) in counts.iter_mut().zip(search.rejections) {
                *sum += count;
            }
        }
        let total: u64 = counts.iter().sum();
        for (share, count) in shares.iter_mut().zip(counts) {
            *share += count as f64 / total.max(1) as f64 / by_holdout.len() as f64;
        }
    }
    shares
}

/// Mean time of each step by set and output type. Rare types are shown as well: their numbers show how reliable they
/// are.
pub fn step_times(data: &Data<'_>) -> Table {
    let mut header = vec!["set".to_owned(), "output type".to_owned(), "attempts".to_owned()];
    header.extend(STEP_NAMES.map(|name| format!("{name}, µs")));
    header.push("together, µs".to_owned());
    let mut table = Table::new("step-times", "Time per attempt by step and output type", header);
    for set in data.sets() {
        for kind in Rejection::THESIS.map(Some).into_iter().chain([None]) {
            let (count, means) = mean_step_times(data, set, kind);
            if count == 0 {
                continue;
            }
            let mut row = vec![Value::from(set.name()), output_type(kind).into(), count.into()];
            row.extend(means.map(Value::number));
            row.push(Value::number(means.iter().sum::<f64>()));
            table.push(row);
        }
    }
    table
}

/// Number of attempts of a set with one output type, and the mean times of their steps in microseconds.
pub(crate) fn mean_step_times(data: &Data<'_>, set: Set, kind: Option<Rejection>) -> (u64, [f64; 5]) {
    let of_kind = data.both(set).filter(|(record, _)| record.rejection == kind);
    let (count, sums) = sum_steps(of_kind.map(|(_, details)| details));
    (count, sums.map(|sum| sum / 1e3 / count.max(1) as f64))
}

fn sum_steps<'a>(details: impl Iterator<Item = &'a Details>) -> (u64, [f64; 5]) {
    let mut sums = [0.0; 5];
    let mut count = 0;
    for times in details.filter_map(|details| details.step_nanoseconds) {
        count += 1;
        for (sum, time) in sums.iter_mut().zip(times) {
            *sum += time as f64;
        }
    }
    (count, sums)
}

/// Total time of the negative sets by step (Figure 5.7).
pub fn step_totals(data: &Data<'_>) -> Table {
    let mut header = vec!["set".to_owned(), "attempts".to_owned(), "together, ms".to_owned()];
    header.extend(STEP_NAMES.map(|name| format!("{name}, %")));
    let mut table = Table::new("step-totals", "Time of the negative grasp sets by step", header);
    for set in data.sets() {
        let (count, shares, total) = step_shares(data, set);
        if count == 0 {
            continue;
        }
        let mut row = vec![Value::from(set.name()), count.into(), Value::number(total / 1e6)];
        row.extend(shares.map(|share| Value::decimals(100.0 * share, 1)));
        table.push(row);
    }
    table
}

/// Attempts of a negative set, the share of each step in their time, and that time in nanoseconds.
pub(crate) fn step_shares(data: &Data<'_>, set: Set) -> (u64, [f64; 5], f64) {
    let invalid = data.invalid(set).filter_map(|record| record.details.as_ref());
    let (count, sums) = sum_steps(invalid);
    let total: f64 = sums.iter().sum();
    (count, sums.map(|sum| sum / total), total)
}
