//! The measures of wrist placements.

use grasp_synthesis::{base::rejection::Rejection, model::strategy::Strategy};

use super::{Figure, KINDS, colour_of};
use crate::{
    data::Data,
    plan::Set,
    plot::{Axis, Chart, Panel, Series, palette},
    record::{Measures, output_type},
    tables::{MEASURES, PALM_ANGLE_BIN_DEGREES, palm_angle_counts},
};

/// Largest number of failed attempts drawn per set, as in the thesis: more would hide each other. Tables and CSV have
/// all.
const MAX_DOTS: usize = 1500;

/// Ends of the axes: wrists are placed within a reach of 22 cm of the box, which is a little farther from the object,
/// and palms lie up to a palm's length farther out.
const WRIST_DISTANCE_AXIS_CM: f64 = 26.0;
const PALM_DISTANCE_AXIS_CM: f64 = 36.0;

/// A measure along an axis.
fn axis(measure: usize) -> Axis {
    Axis {
        label: MEASURES[measure].name.to_owned(),
        min: 0.0,
        max: match measure {
            0 => WRIST_DISTANCE_AXIS_CM,
            1 => PALM_DISTANCE_AXIS_CM,
            _ => 180.0,
        },
    }
}

/// Placements of a set with their output type: all valid ones, and up to [`MAX_DOTS`] failed ones, evenly over the
/// holdouts.
fn placements<'a>(data: &Data<'a>, set: Set) -> Vec<(Option<Rejection>, &'a Measures)> {
    let limit = (MAX_DOTS / data.settings.holdouts.len().max(1)) as u64;
    data.both(set)
        .filter(|(record, _)| record.number < limit)
        .filter_map(|(record, details)| Some((record.rejection, details.measures.as_ref()?)))
        .collect()
}

/// Figure 5.9: four measures in set A.
pub(super) fn by_output_type(data: &Data<'_>) -> Figure {
    let placements = placements(data, Set::ladder(Strategy::A));
    let strips = |measure: usize| {
        let series = KINDS.iter().map(|kind| Series {
            name: output_type(*kind).to_owned(),
            colour: colour_of(*kind),
            values: placements
                .iter()
                .filter(|(own, _)| own == kind)
                .filter_map(|(_, measures)| (MEASURES[measure].of)(measures))
                .collect(),
        });
        Panel {
            title: MEASURES[measure].bare_name().to_owned(),
            chart: Chart::Strips {
                x: axis(measure),
                series: series.filter(|series| !series.values.is_empty()).collect(),
            },
        }
    };
    Figure {
        file: "figure-5-09",
        title: "Figure 5.9: measures by output type, grasp set A",
        data: "attempts",
        panels: [0, 1, 3, 2].map(strips).to_vec(),
        columns: 2,
    }
}

/// Figures 5.10 and 5.11.
pub(super) fn pairs(data: &Data<'_>, strategy: Strategy, file: &'static str, title: &'static str) -> Figure {
    let placements = placements(data, Set::ladder(strategy));
    let scatter = |x: usize, y: usize| {
        let series = |name: &str, colour, is_own: fn(Option<Rejection>) -> bool| Series {
            name: name.to_owned(),
            colour,
            values: placements
                .iter()
                .filter(|(kind, _)| is_own(*kind))
                .filter_map(|(_, measures)| (MEASURES[x].of)(measures).zip((MEASURES[y].of)(measures)))
                .collect(),
        };
        Panel {
            title: format!("{} against {}", MEASURES[y].bare_name(), MEASURES[x].bare_name()),
            chart: Chart::Scatter {
                x: axis(x),
                y: axis(y),
                series: vec![
                    series("NoContacts", palette::NO_CONTACTS, |kind| {
                        kind == Some(Rejection::NoContacts)
                    }),
                    series("other failures", palette::OTHER_REJECTIONS, |kind| {
                        kind.is_some_and(|kind| kind != Rejection::NoContacts)
                    }),
                    series("valid", palette::VALID, |kind| kind.is_none()),
                ],
            },
        }
    };
    Figure {
        file,
        title,
        data: "attempts",
        panels: vec![scatter(0, 2), scatter(3, 2)],
        columns: 2,
    }
}

/// Figure 5.13.
pub(super) fn palm_angles(data: &Data<'_>) -> Figure {
    Figure {
        file: "figure-5-13",
        title: "Figure 5.13: palm-CoM-palm angles of the positive grasp set B",
        data: "palm-com-palm",
        panels: vec![Panel {
            title: "Palm-CoM-palm angles of valid grasps, grasp set B".to_owned(),
            chart: Chart::Histogram {
                label: MEASURES[5].name.to_owned(),
                start: 0.0,
                width: PALM_ANGLE_BIN_DEGREES,
                series: vec![Series {
                    name: "valid".to_owned(),
                    colour: palette::VALID,
                    values: palm_angle_counts(data),
                }],
            },
        }],
        columns: 1,
    }
}
