//! Attempts and time per valid grasp (Figures 5.5a, 5.12a, 5.14a, 5.16a, 5.21a).

use crate::{
    data::{Data, attempts, milliseconds},
    plan::Set,
    record::SearchFigures,
    stats::{mean, quantile, standard_error_of_group_means},
    table::{Table, Value},
    thesis,
};

/// Half the width of a 95 % interval, in standard errors.
const STANDARD_ERRORS: f64 = 1.96;

/// A row per set: means over the holdouts, each of which counts the same.
pub fn ladder(data: &Data<'_>) -> Table {
    let more = data.more_threads();
    let mut header = vec![
        "set".to_owned(),
        "grasps".to_owned(),
        "attempts".to_owned(),
        "attempts ± (95 %)".to_owned(),
        "thesis: attempts".to_owned(),
        "ms".to_owned(),
        "ms ± (95 %)".to_owned(),
        "median ms".to_owned(),
        "thesis: ms".to_owned(),
        "µs per attempt".to_owned(),
        "prunes per attempt".to_owned(),
    ];
    header.extend(more.map(|threads| format!("ms on {threads} threads")));
    header.extend(more.map(|_| "times as fast".to_owned()));
    let mut table = Table::new("ladder", "Attempts and time per valid grasp", header);
    for set in data.sets() {
        let mut searches = data.searches_by_holdout(set, 1);
        searches.retain(|own| !own.is_empty());
        let attempts: Vec<_> = searches.iter().map(|own| attempts(own)).collect();
        let times: Vec<_> = searches.iter().map(|own| milliseconds(own)).collect();
        let all: Vec<_> = searches.concat();
        let total_attempts: u64 = all.iter().map(|search| search.attempts).sum();
        let total_prunes: u64 = all.iter().map(|search| search.pruned_placements).sum();
        let total_ms: f64 = times.iter().flatten().sum();
        let thesis = thesis::ladder(set.strategy);
        let mean_ms = mean_of_means(&times);
        let error =
            |groups: &[Vec<f64>]| standard_error_of_group_means(groups).map(|error| STANDARD_ERRORS * error);
        let mut row = vec![
            Value::from(set.name()),
            (all.len() as u64).into(),
            Value::number(mean_of_means(&attempts)),
            Value::number(error(&attempts)),
            Value::number(thesis.map(|thesis| thesis.attempts)),
            Value::number(mean_ms),
            Value::number(error(&times)),
            Value::number(quantile(&times.concat(), 0.5)),
            Value::number(thesis.map(|thesis| thesis.milliseconds)),
            Value::number(total_ms * 1e3 / total_attempts as f64),
            Value::number(total_prunes as f64 / total_attempts as f64),
        ];
        if let Some(threads) = more {
            let raced: Vec<_> = data
                .searches_by_holdout(set, threads)
                .iter()
                .map(|own| milliseconds(own))
                .collect();
            let raced_ms = mean_of_means(&raced);
            row.push(Value::number(raced_ms));
            row.push(Value::number(mean_ms.zip(raced_ms).map(|(one, more)| one / more)));
        }
        table.push(row);
    }
    table
}

/// Mean of the groups' means, without empty groups; none if all are empty.
pub(crate) fn mean_of_means(groups: &[Vec<f64>]) -> Option<f64> {
    let means: Vec<_> = groups.iter().filter_map(|group| mean(group)).collect();
    mean(&means)
}

/// A row per holdout and object, a pair of columns per set, and the thesis' columns where it has them.
pub fn per_holdout(data: &Data<'_>) -> Table {
    let mut columns = Vec::new();
    for set in data.sets() {
        columns.push(Columns::of_set(data, set.name(), set));
    }
    for strategy in data.ladder() {
        let printed: Option<Vec<_>> = data
            .settings
            .holdouts
            .iter()
            .map(|&holdout| thesis::by_holdout(strategy, holdout))
            .collect();
        columns.extend(printed.map(|printed| Columns {
            name: format!("thesis {strategy:?}"),
            attempts: printed.iter().map(|grasp| grasp.attempts).collect(),
            milliseconds: printed.iter().map(|grasp| grasp.milliseconds).collect(),
        }));
    }
    by_holdout(
        data,
        "per-holdout",
        "Attempts and time per valid grasp, by holdout",
        &columns,
    )
}

/// Figure 5.20 by holdout.
pub fn columns_per_holdout(data: &Data<'_>) -> Table {
    let sets = if data.settings.bend_ratio_columns {
        &Set::BEND_RATIO_COLUMNS[..]
    } else {
        &[]
    };
    let columns: Vec<_> = sets
        .iter()
        .enumerate()
        .map(|(index, set)| Columns::of_set(data, format!("({})", column_letter(index)), *set))
        .collect();
    by_holdout(
        data,
        "bend-ratio-choices-per-holdout",
        "Ways to choose the bend ratios, attempts and time per valid grasp by holdout",
        &columns,
    )
}

/// The letter of a column of Figure 5.20.
pub(crate) fn column_letter(index: usize) -> char {
    char::from(b'a' + index as u8)
}

/// A pair of columns, by holdout.
struct Columns {
    name: String,
    attempts: Vec<f64>,
    milliseconds: Vec<f64>,
}

impl Columns {
    fn of_set(data: &Data<'_>, name: String, set: Set) -> Self {
        let searches = data.searches_by_holdout(set, 1);
        let means = |of: fn(&[SearchFigures]) -> Vec<f64>| {
            searches
                .iter()
                .map(|own| mean(&of(own)).unwrap_or(f64::NAN))
                .collect()
        };
        Self {
            name,
            attempts: means(attempts),
            milliseconds: means(milliseconds),
        }
    }
}

/// Rows for the holdouts, the objects and all; empty without columns.
fn by_holdout(data: &Data<'_>, file: &'static str, title: &str, columns: &[Columns]) -> Table {
    let names = columns
        .iter()
        .flat_map(|own| [format!("{}: attempts", own.name), format!("{}: ms", own.name)]);
    let mut table = Table::new(file, title, std::iter::once("holdout".to_owned()).chain(names));
    if columns.is_empty() {
        return table;
    }
    let built_in = grasp_assets::holdouts::holdouts();
    let holdouts = &data.settings.holdouts;
    let row_of = |name: &str, rows: &[usize]| {
        let mean_of = |column: &[f64]| {
            let values = rows.iter().map(|&row| column[row]);
            let values: Vec<_> = values.filter(|value| value.is_finite()).collect();
            Value::number(mean(&values))
        };
        let means = columns
            .iter()
            .flat_map(|own| [mean_of(&own.attempts), mean_of(&own.milliseconds)]);
        std::iter::once(name.into()).chain(means).collect()
    };
    for (row, &holdout) in holdouts.iter().enumerate() {
        table.push(row_of(&built_in[holdout].name, &[row]));
    }
    let mut objects: Vec<_> = holdouts
        .iter()
        .map(|&holdout| &built_in[holdout].object)
        .collect();
    objects.dedup();
    for object in objects {
        let rows: Vec<_> = (0..holdouts.len())
            .filter(|&row| built_in[holdouts[row]].object == *object)
            .collect();
        table.push(row_of(&format!("mean of {object}"), &rows));
    }
    table.push(row_of("mean of all", &(0..holdouts.len()).collect::<Vec<_>>()));
    table
}

/// Index and mean attempts of each holdout with grasps.
pub(crate) fn holdout_means(data: &Data<'_>, set: Set) -> Vec<(usize, f64)> {
    let searches = data.searches_by_holdout(set, 1);
    let means = searches.iter().map(|own| mean(&attempts(own)));
    let pairs = data.settings.holdouts.iter().copied().zip(means);
    pairs
        .filter_map(|(holdout, mean)| Some((holdout, mean?)))
        .collect()
}
