//! A linear axis with given ticks and texts.

use std::ops::Range;

use plotters::coord::{
    ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter},
    types::RangedCoordf64,
};

use super::{numbers::Tick, words};

/// The axis.
pub(super) struct Scale {
    line: RangedCoordf64,
    ticks: Vec<Tick>,
}

impl Scale {
    /// From end to end with these ticks.
    pub(super) fn new((low, high): (f64, f64), ticks: Vec<Tick>) -> Self {
        Self {
            line: (low..high).into(),
            ticks,
        }
    }
}

impl Ranged for Scale {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        self.line.map(value, limit)
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        // Light points are grid lines between the ticks.
        if hint.weight().allow_light_points() {
            Vec::new()
        } else {
            self.ticks.iter().map(|tick| tick.at).collect()
        }
    }

    fn range(&self) -> Range<f64> {
        self.line.range()
    }
}

impl ValueFormatter<f64> for Scale {
    fn format_ext(&self, value: &f64) -> String {
        let tick = self.ticks.iter().find(|tick| tick.at == *value);
        tick.map(|tick| words::drawable(&tick.text)).unwrap_or_default()
    }
}
