//! How attempts end, and how long they take.

use grasp_synthesis::{base::rejection::Rejection, model::strategy::Strategy};

use super::{Figure, KINDS};
use crate::{
    data::Data,
    plan::Set,
    plot::{Chart, Panel, Series, palette},
    record::{STEP_NAMES, output_type},
    tables::{mean_step_times, negative_counts, step_shares},
};

/// Figures 5.5b, 5.12b, 5.14b, 5.16b and 5.21b in one.
pub(super) fn output_types(data: &Data<'_>) -> Figure {
    let counts: Vec<_> = negative_sets(data)
        .map(|set| negative_counts(data, set))
        .collect();
    let series = Rejection::THESIS.map(|rejection| Series {
        name: output_type(Some(rejection)).to_owned(),
        colour: palette::REJECTIONS[rejection.index()],
        values: counts
            .iter()
            .map(|counts| 100.0 * counts[rejection.index()] as f64 / counts.iter().sum::<u64>() as f64)
            .collect(),
    });
    Figure {
        file: "output-types",
        title: "Output types of the negative grasp sets (Figures 5.5b, 5.12b, 5.14b, 5.16b, 5.21b)",
        data: "output-types",
        panels: vec![Panel {
            title: "Output types of the negative grasp sets".to_owned(),
            chart: Chart::StackedBars {
                label: "share of the failed attempts, %".to_owned(),
                rows: set_names(data),
                series: series.to_vec(),
            },
        }],
        columns: 1,
    }
}

/// Figure 5.7, for every set.
pub(super) fn totals(data: &Data<'_>) -> Figure {
    let shares: Vec<_> = negative_sets(data).map(|set| step_shares(data, set).1).collect();
    Figure {
        file: "figure-5-07",
        title: "Figure 5.7: time of the negative grasp sets by step",
        data: "step-totals",
        panels: vec![Panel {
            title: "Time of the negative grasp sets by step".to_owned(),
            chart: Chart::StackedBars {
                label: "share of the time, %".to_owned(),
                rows: set_names(data),
                series: steps_of(|step| shares.iter().map(|shares| 100.0 * shares[step]).collect()),
            },
        }],
        columns: 1,
    }
}

/// Figures 5.6 and 5.22, without types that have no attempts.
pub(super) fn steps(data: &Data<'_>, strategy: Strategy, file: &'static str, title: &'static str) -> Figure {
    let set = Set::ladder(strategy);
    let rows: Vec<_> = KINDS
        .iter()
        .map(|kind| (*kind, mean_step_times(data, set, *kind)))
        .filter(|(_, (count, _))| *count > 0)
        .collect();
    Figure {
        file,
        title,
        data: "step-times",
        panels: vec![Panel {
            title: format!("Time per attempt by step and output type, grasp set {strategy:?}"),
            chart: Chart::StackedBars {
                label: "µs per attempt".to_owned(),
                rows: rows
                    .iter()
                    .map(|(kind, (count, _))| format!("{} ({count})", output_type(*kind)))
                    .collect(),
                series: steps_of(|step| rows.iter().map(|(_, (_, means))| means[step]).collect()),
            },
        }],
        columns: 1,
    }
}

fn steps_of(values: impl Fn(usize) -> Vec<f64>) -> Vec<Series<f64>> {
    let steps = STEP_NAMES.iter().enumerate();
    steps
        .map(|(step, name)| Series {
            name: (*name).to_owned(),
            colour: palette::STEPS[step],
            values: values(step),
        })
        .collect()
}

/// The sets with failed attempts.
fn negative_sets(data: &Data<'_>) -> impl Iterator<Item = Set> {
    data.sets().filter(|set| data.invalid(*set).next().is_some())
}

fn set_names(data: &Data<'_>) -> Vec<String> {
    negative_sets(data).map(Set::name).collect()
}
