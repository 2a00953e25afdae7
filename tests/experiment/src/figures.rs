//! The figures of chapter 5 as charts.

mod bend;
mod ladder;
mod outputs;
mod placement;

use grasp_synthesis::{
    base::rejection::Rejection,
    model::strategy::Strategy::{A, B, C, D, F},
};

use crate::{
    data::Data,
    plot::{Colour, Panel, palette},
};

/// A picture of a figure of the thesis.
#[derive(Clone, Debug)]
pub struct Figure {
    /// File name without extension.
    pub file: &'static str,
    /// Title, with the thesis' number.
    pub title: &'static str,
    /// File name of the CSV with its data, without extension.
    pub data: &'static str,
    /// Its charts.
    pub panels: Vec<Panel>,
    /// Charts per row.
    pub columns: usize,
}

/// All figures with data, in the thesis' order.
pub fn figures(data: &Data<'_>) -> Vec<Figure> {
    let has = |strategy| data.ladder().any(|requested| requested == strategy);
    let mut figures = vec![
        ladder::ladder(data),
        outputs::output_types(data),
        outputs::totals(data),
    ];
    if has(A) {
        figures.extend([
            outputs::steps(
                data,
                A,
                "figure-5-06",
                "Figure 5.6: time by step and output type, grasp set A",
            ),
            placement::by_output_type(data),
            placement::pairs(
                data,
                A,
                "figure-5-10",
                "Figure 5.10: pairs of measures, grasp set A",
            ),
        ]);
    }
    if has(B) {
        figures.extend([
            placement::pairs(
                data,
                B,
                "figure-5-11",
                "Figure 5.11: pairs of measures, grasp set B",
            ),
            placement::palm_angles(data),
        ]);
    }
    if has(D) {
        figures.push(bend::yaw_and_bend(data));
    }
    if has(C) {
        figures.extend([
            bend::bend_angles(data),
            bend::ratios_used(data),
            bend::lost_contacts(data),
        ]);
    }
    if data.settings.bend_ratio_columns {
        figures.push(bend::choices(data));
    }
    if has(F) {
        figures.push(outputs::steps(
            data,
            F,
            "figure-5-22",
            "Figure 5.22: time by step and output type, grasp set F",
        ));
    }
    figures
}

/// Valid, then the failures in the order of Table 5.2.
const KINDS: [Option<Rejection>; 9] = [
    None,
    Some(Rejection::NoContacts),
    Some(Rejection::NoThumb),
    Some(Rejection::NoThumbEarlyStop),
    Some(Rejection::NoFingers),
    Some(Rejection::PalmCollision),
    Some(Rejection::FingerCollision),
    Some(Rejection::UnwantedContact),
    Some(Rejection::NotImmobilizing),
];

/// The colour of an output type.
fn colour_of(kind: Option<Rejection>) -> Colour {
    match kind {
        None => palette::VALID,
        Some(rejection) => palette::REJECTIONS[rejection.index()],
    }
}
