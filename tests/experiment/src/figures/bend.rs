//! Yaw angles, bend angles and bend ratios.

use grasp_synthesis::model::{hand::Digit, strategy::Strategy};

use super::Figure;
use crate::{
    data::Data,
    plan::{Set, choice_name},
    plot::{Axis, Chart, Panel, Series, palette},
    tables::{BEND_BIN_DEGREES, bend_angle_bins, column_letter, column_means, lost},
    thesis,
};

const RATIO_NAMES: [&str; 3] = ["ratio 0.7", "ratio 1.0", "ratio 1.42"];

fn by_ratio<T>(values: [Vec<T>; 3]) -> Vec<Series<T>> {
    values
        .into_iter()
        .enumerate()
        .map(|(ratio, values)| Series {
            name: RATIO_NAMES[ratio].to_owned(),
            colour: palette::BEND_RATIOS[ratio],
            values,
        })
        .collect()
}

/// Figure 5.15, for the index finger.
pub(super) fn yaw_and_bend(data: &Data<'_>) -> Figure {
    let mut dots: [Vec<(f64, f64)>; 3] = [const { Vec::new() }; 3];
    let details = data
        .valid(Set::ladder(Strategy::D))
        .filter_map(|record| record.details.as_ref());
    for posed in details.filter_map(|details| details.digits.get(Digit::Index.index())) {
        let ratio = match posed.bend_ratio {
            None => continue,
            Some(..0.85) => 0,
            Some(..1.2) => 1,
            Some(_) => 2,
        };
        dots[ratio].push((f64::from(posed.bend_degrees), f64::from(posed.yaw_degrees)));
    }
    Figure {
        file: "figure-5-15",
        title: "Figure 5.15: yaw against bend angle of the index finger, positive grasp set D",
        data: "attempts",
        panels: vec![Panel {
            title: "Touching index fingers of valid grasps, grasp set D".to_owned(),
            chart: Chart::Scatter {
                x: Axis {
                    label: "bend angle, °".to_owned(),
                    min: 0.0,
                    max: 90.0,
                },
                y: Axis {
                    label: "yaw angle, °".to_owned(),
                    min: -6.0,
                    max: 6.0,
                },
                series: by_ratio(dots),
            },
        }],
        columns: 1,
    }
}

/// Figure 5.17.
pub(super) fn bend_angles(data: &Data<'_>) -> Figure {
    let panels = Digit::ALL.map(|digit| {
        let (start, counts) = bend_angle_bins(data, digit);
        Panel {
            title: format!("{digit:?}"),
            chart: Chart::Histogram {
                label: "bend angle, °".to_owned(),
                start,
                width: BEND_BIN_DEGREES,
                series: by_ratio(counts),
            },
        }
    });
    Figure {
        file: "figure-5-17",
        title: "Figure 5.17: bend angles of touching digits, grasp set C",
        data: "bend-angles",
        panels: panels.to_vec(),
        columns: 2,
    }
}

/// Figure 5.18.
pub(super) fn ratios_used(data: &Data<'_>) -> Figure {
    let sums = Digit::ALL.map(|digit| {
        bend_angle_bins(data, digit)
            .1
            .map(|bins| bins.iter().sum::<u64>() as f64)
    });
    Figure {
        file: "figure-5-18",
        title: "Figure 5.18: bend ratios of touching digits, grasp set C",
        data: "bend-ratios-used",
        panels: vec![Panel {
            title: "Touching digits by bend ratio, grasp set C".to_owned(),
            chart: Chart::StackedBars {
                label: "touching digits".to_owned(),
                rows: Digit::ALL.map(|digit| format!("{digit:?}")).to_vec(),
                series: by_ratio([0, 1, 2].map(|ratio| sums.iter().map(|sum| sum[ratio]).collect())),
            },
        }],
        columns: 1,
    }
}

/// Figure 5.19: lost contacts by the new ratio, next to the thesis' numbers.
pub(super) fn lost_contacts(data: &Data<'_>) -> Figure {
    let on_new = |counts: [[[u64; 3]; 3]; 5]| {
        [0, 1, 2].map(|new| {
            let of_digit = |digit: [[u64; 3]; 3]| digit.iter().map(|old| old[new] as f64).sum();
            counts.map(of_digit).to_vec()
        })
    };
    let panel = |title: &str, counts| Panel {
        title: title.to_owned(),
        chart: Chart::StackedBars {
            label: "lost contacts, by the ratio that lost them".to_owned(),
            rows: Digit::ALL.map(|digit| format!("{digit:?}")).to_vec(),
            series: by_ratio(on_new(counts)),
        },
    };
    Figure {
        file: "figure-5-19",
        title: "Figure 5.19: contacts lost when one bend ratio replaces another, positive grasp set C",
        data: "lost-contacts",
        panels: vec![
            panel("This run", Digit::ALL.map(|digit| lost(data, digit).0)),
            panel("The thesis", thesis::LOST_CONTACTS),
        ],
        columns: 2,
    }
}

/// Figure 5.20: time and attempts of each column in percent of column (a).
pub(super) fn choices(data: &Data<'_>) -> Figure {
    let printed_all = thesis::BEND_RATIO_COLUMNS[0];
    let ours = Set::BEND_RATIO_COLUMNS.map(|set| column_means(data, set).unwrap_or((f64::NAN, f64::NAN)));
    let printed = thesis::BEND_RATIO_COLUMNS.map(|column| {
        let is_all = column == printed_all;
        let attempts = if is_all { 0.0 } else { column.attempts } + printed_all.attempts;
        let ms = if is_all { 0.0 } else { column.milliseconds } + printed_all.milliseconds;
        (attempts, ms)
    });
    let panel = |title: &str, of: fn((f64, f64)) -> f64| {
        let relative =
            |columns: [(f64, f64); 6]| columns.map(|column| 100.0 * of(column) / of(columns[0])).to_vec();
        Panel {
            title: title.to_owned(),
            chart: Chart::GroupedBars {
                label: "% of (a)".to_owned(),
                groups: Set::BEND_RATIO_COLUMNS
                    .iter()
                    .enumerate()
                    .map(|(index, set)| {
                        format!("({}) {}", column_letter(index), choice_name(set.bend_ratios))
                    })
                    .collect(),
                series: vec![
                    Series {
                        name: "thesis".to_owned(),
                        colour: palette::THESIS,
                        values: relative(printed),
                    },
                    Series {
                        name: "this run".to_owned(),
                        colour: palette::HERE,
                        values: relative(ours),
                    },
                ],
            },
        }
    };
    Figure {
        file: "figure-5-20",
        title: "Figure 5.20: ways to choose the bend ratios",
        data: "bend-ratio-choices",
        panels: vec![
            panel("Attempts per valid grasp", |(attempts, _)| attempts),
            panel("Time per valid grasp", |(_, ms)| ms),
        ],
        columns: 1,
    }
}
