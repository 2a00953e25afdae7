//! Attempts and time per valid grasp of every set.

use super::Figure;
use crate::{
    data::{Data, attempts, milliseconds},
    plan::Set,
    plot::{Chart, Panel, Series, palette},
    record::SearchFigures,
    tables::mean_of_means,
    thesis::{self, PerGrasp},
};

/// Both benchmarks next to the thesis'.
pub(super) fn ladder(data: &Data<'_>) -> Figure {
    let panel = |title: &str,
                 label: &str,
                 of: fn(&[SearchFigures]) -> Vec<f64>,
                 printed: fn(PerGrasp) -> f64,
                 is_time: bool| {
        let ours = |threads| {
            data.sets()
                .map(|set| {
                    let searches = data.searches_by_holdout(set, threads);
                    let groups: Vec<_> = searches.iter().map(|own| of(own)).collect();
                    mean_of_means(&groups).unwrap_or(f64::NAN)
                })
                .collect()
        };
        let mut series = vec![
            Series {
                name: "thesis, one thread".to_owned(),
                colour: palette::THESIS,
                values: data
                    .sets()
                    .map(|set| thesis::ladder(set.strategy).map_or(f64::NAN, printed))
                    .collect(),
            },
            Series {
                name: "this run, one thread".to_owned(),
                colour: palette::HERE,
                values: ours(1),
            },
        ];
        if let Some(threads) = data.more_threads().filter(|_| is_time) {
            series.push(Series {
                name: format!("this run, {threads} threads"),
                colour: palette::HERE_ON_MORE_THREADS,
                values: ours(threads),
            });
        }
        Panel {
            title: title.to_owned(),
            chart: Chart::GroupedBars {
                label: label.to_owned(),
                groups: data.sets().map(Set::name).collect(),
                series,
            },
        }
    };
    Figure {
        file: "ladder",
        title: "Attempts and time per valid grasp (Figures 5.5a, 5.12a, 5.14a, 5.16a, 5.21a)",
        data: "ladder",
        panels: vec![
            panel(
                "Attempts per valid grasp",
                "attempts",
                attempts,
                |printed| printed.attempts,
                false,
            ),
            panel(
                "Time per valid grasp",
                "ms",
                milliseconds,
                |printed| printed.milliseconds,
                true,
            ),
        ],
        // With sets beyond the ladder, names need the whole width.
        columns: if data.sets().all(Set::is_ladder) { 2 } else { 1 },
    }
}
