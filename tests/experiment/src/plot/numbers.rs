//! How numbers are spelled, and where an axis has its ticks.

use std::ops::RangeInclusive;

/// A tick: where, and what it says.
#[derive(Clone, Debug)]
pub(super) struct Tick {
    /// In the axis' units.
    pub at: f64,
    /// Beside the tick.
    pub text: String,
}

/// Numbers from here on, and those below its inverse times ten, are spelled with a power of ten.
const LONGEST: f64 = 1e9;

/// With so many decimals, and with commas between groups of three digits: 456,287.
pub(super) fn spelled(value: f64, decimals: usize) -> String {
    if value.abs() >= LONGEST {
        return format!("{value:.2e}").replace('-', "−");
    }
    let digits = format!("{:.decimals$}", value.abs());
    let (whole, fraction) = digits.split_at(digits.find('.').unwrap_or(digits.len()));
    let is_zero = digits.bytes().all(|digit| matches!(digit, b'0' | b'.'));
    let mut spelled = String::from(if value < 0.0 && !is_zero { "−" } else { "" });
    for (place, digit) in whole.chars().enumerate() {
        if place > 0 && (whole.len() - place).is_multiple_of(3) {
            spelled.push(',');
        }
        spelled.push(digit);
    }
    spelled + fraction
}

/// With three significant digits, or as a whole number from 100 on: 456,287, 28.4, 5.2, 0.05.
pub(super) fn significant(value: f64) -> String {
    let size = value.abs();
    if size > 0.0 && size < 10.0 / LONGEST {
        return format!("{value:.2e}").replace('-', "−");
    }
    let magnitude = if size > 0.0 {
        size.log10().floor() as i32
    } else {
        0
    };
    let decimals = (2 - magnitude).clamp(0, 10) as usize;
    let text = spelled(value, decimals);
    if text.contains('.') && !text.contains('e') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

/// The ends of an axis in order, finite and apart.
pub(super) fn ends(min: f64, max: f64) -> (f64, f64) {
    if !(min.is_finite() && max.is_finite() && (max - min).is_finite()) {
        return (0.0, 1.0);
    }
    let (low, high) = (min.min(max), min.max(max));
    // Ends that only rounding keeps apart leave no room for ticks between them.
    let slack = 1e-9 * low.abs().max(high.abs());
    if high - low > slack {
        (low, high)
    } else {
        let half = (0.05 * low.abs()).max(0.5);
        (low - half, high + half)
    }
}

/// Ticks at multiples of 1, 2 or 5 times a power of ten: the narrowest step that `fits` accepts, given the ticks and
/// the distance between them.
pub(super) fn ticks(low: f64, high: f64, fits: impl Fn(&[Tick], f64) -> bool) -> Vec<Tick> {
    // The finest step to try has at most about a hundred ticks, the coarsest at most one.
    let finest = ((high - low) / 100.0).log10().floor() as i32;
    let steps = (finest..=finest + 3).flat_map(|power| [(1.0, power), (2.0, power), (5.0, power)]);
    for (factor, power) in steps {
        let step = factor * 10_f64.powi(power);
        let decimals = (-power).clamp(0, 12) as usize;
        let ticks: Vec<_> = multiples(low, high, step)
            .map(|multiple| Tick {
                at: multiple * step,
                text: spelled(multiple * step, decimals),
            })
            .collect();
        if fits(&ticks, step) {
            return ticks;
        }
    }
    Vec::new()
}

/// The decimals with which to spell values that stand beside each other, the largest of which is `largest`: none for
/// whole numbers, else three digits for the largest, but at least one decimal.
pub(super) fn common_decimals(mut values: impl Iterator<Item = f64>, largest: f64) -> usize {
    if values.all(|value| value.fract() == 0.0) || largest >= 1000.0 {
        return 0;
    }
    (2 - magnitude(largest)).clamp(1, 10) as usize
}

/// Ticks at powers of ten, at most so many. `low` and `high` are exponents, and so are the places of the ticks.
pub(super) fn decades(low: f64, high: f64, at_most: usize) -> Vec<Tick> {
    let exponents: RangeInclusive<i32> = low.ceil() as i32..=high.floor() as i32;
    let stride = exponents.clone().count().div_ceil(at_most.max(1)).max(1);
    exponents
        .step_by(stride)
        .map(|exponent| Tick {
            at: f64::from(exponent),
            text: significant(10_f64.powi(exponent)),
        })
        .collect()
}

/// The power of ten of the first digit of a size.
fn magnitude(size: f64) -> i32 {
    if size > 0.0 {
        size.log10().floor() as i32
    } else {
        0
    }
}

/// The whole numbers whose `step`-fold lies between the ends, which count as between.
fn multiples(low: f64, high: f64, step: f64) -> impl Iterator<Item = f64> {
    let slack = 1e-9;
    let first = (low / step - slack).ceil();
    let count = ((high / step + slack).floor() - first + 1.0).max(0.0) as usize;
    // Adding 0 turns −0 into 0.
    (0..count).map(move |index| first + index as f64 + 0.0)
}
