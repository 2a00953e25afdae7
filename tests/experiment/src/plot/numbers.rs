//! Number formats, and the ticks of axes.

use std::ops::RangeInclusive;

/// Sizes from here on count as infinite.
const LARGEST: f64 = 1e300;

/// A tick with its text.
#[derive(Clone, Debug)]
pub(super) struct Tick {
    /// In the axis' units.
    pub at: f64,
    /// Text at the tick.
    pub text: String,
}

/// Sizes from here on are written with a power of ten.
const LONGEST: f64 = 1e9;
/// Smaller sizes are written with a power of ten where digits count.
const SHORTEST: f64 = 1e-8;

/// A number with fixed decimals and commas between groups of three digits: 456,287.
pub(super) fn spelled(value: f64, decimals: usize) -> String {
    if value.abs() >= LONGEST {
        return scientific(value);
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

/// A number with three significant digits, or a whole number from 100 on: 456,287, 28.4, 5.2, 0.05.
pub(super) fn significant(value: f64) -> String {
    let size = value.abs();
    if size > 0.0 && size < SHORTEST {
        return scientific(value);
    }
    let decimals = (2 - magnitude(size)).clamp(0, 10) as usize;
    let text = spelled(value, decimals);
    if text.contains('e') {
        text
    } else {
        without_zeros(&text).to_owned()
    }
}

/// A number with up to three significant digits and a power of ten: 4.56e12.
fn scientific(value: f64) -> String {
    let text = format!("{value:.2e}").replace('-', "−");
    let (digits, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    format!("{}e{exponent}", without_zeros(digits))
}

/// Decimals without the zeros at their end.
fn without_zeros(text: &str) -> &str {
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.')
    } else {
        text
    }
}

/// Whether a number can be drawn: finite, and small enough that sums stay finite.
pub(super) fn is_drawable(value: f64) -> bool {
    value.abs() < LARGEST
}

/// The ends of an axis, drawable, in order and distinct.
pub(super) fn ends(min: f64, max: f64) -> (f64, f64) {
    if !(is_drawable(min) && is_drawable(max)) {
        return (0.0, 1.0);
    }
    let (low, high) = (min.min(max), min.max(max));
    // Ends that differ only by rounding leave no room for ticks between them.
    let slack = 1e-9 * low.abs().max(high.abs());
    if high - low > slack {
        (low, high)
    } else {
        let half = (0.05 * low.abs()).max(0.5);
        (low - half, high + half)
    }
}

/// Ticks at multiples of 1, 2 or 5 times a power of ten, with the narrowest step that `fits` accepts, given the ticks
/// and their distance.
pub(super) fn ticks(low: f64, high: f64, fits: impl Fn(&[Tick], f64) -> bool) -> Vec<Tick> {
    // The finest step has up to about a hundred ticks, the coarsest up to one.
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

/// Common decimals of adjacent values up to `largest`: none for whole numbers, or else three digits for the largest,
/// but at least one decimal.
pub(super) fn common_decimals(mut values: impl Iterator<Item = f64>, largest: f64) -> usize {
    if values.all(|value| value.fract() == 0.0) || largest >= 1000.0 {
        return 0;
    }
    (2 - magnitude(largest)).clamp(1, 10) as usize
}

/// Up to `limit` ticks at powers of ten. `low`, `high` and the ticks' places are exponents.
pub(super) fn decades(low: f64, high: f64, limit: usize) -> Vec<Tick> {
    let exponents: RangeInclusive<i32> = low.ceil() as i32..=high.floor() as i32;
    let stride = exponents.clone().count().div_ceil(limit.max(1)).max(1);
    exponents
        .step_by(stride)
        .map(|exponent| Tick {
            at: f64::from(exponent),
            text: significant(10_f64.powi(exponent)),
        })
        .collect()
}

/// Power of ten of a size's first digit.
fn magnitude(size: f64) -> i32 {
    if size > 0.0 {
        size.log10().floor() as i32
    } else {
        0
    }
}

/// The whole numbers whose multiple of `step` lies between the ends, inclusive.
fn multiples(low: f64, high: f64, step: f64) -> impl Iterator<Item = f64> {
    let slack = 1e-9;
    let first = (low / step - slack).ceil();
    let count = ((high / step + slack).floor() - first + 1.0).max(0.0) as usize;
    // Adding 0 turns −0 into 0.
    (0..count).map(move |index| first + index as f64 + 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_commas_and_a_true_minus_sign() {
        for (value, decimals, text) in [
            (456_287.0, 0, "456,287"),
            (1_000_000.0, 0, "1,000,000"),
            (999.0, 0, "999"),
            (-1234.5, 1, "−1,234.5"),
            (-0.01, 1, "0.0"),
            (0.0, 2, "0.00"),
            (2.5e12, 0, "2.5e12"),
        ] {
            assert_eq!(spelled(value, decimals), text);
        }
    }

    #[test]
    fn three_digits_are_significant_below_a_hundred() {
        for (value, text) in [
            (456_287.4, "456,287"),
            (28.44, "28.4"),
            (5.2, "5.2"),
            (0.05, "0.05"),
            (51.0, "51"),
            (1e-9, "1e−9"),
            (0.0, "0"),
        ] {
            assert_eq!(significant(value), text);
        }
    }

    #[test]
    fn adjacent_values_have_the_same_decimals() {
        for (values, decimals) in [
            (vec![1425.0, 3.0], 0),
            (vec![74.81, 2.0], 1),
            (vec![7.48, 0.03], 2),
            (vec![745.5], 1),
            (vec![7455.5], 0),
        ] {
            let largest = values.iter().copied().fold(0.0, f64::max);
            assert_eq!(common_decimals(values.into_iter(), largest), decimals);
        }
    }

    #[test]
    fn ticks_are_round_and_between_the_ends() {
        let texts = |low, high, least: f64| {
            let ticks = ticks(low, high, |_, step| step >= least);
            ticks.into_iter().map(|tick| tick.text).collect::<Vec<_>>()
        };
        assert_eq!(texts(0.0, 22.0, 3.0), ["0", "5", "10", "15", "20"]);
        assert_eq!(texts(-0.3, 0.35, 0.2), ["−0.2", "0.0", "0.2"]);
        assert_eq!(texts(30.0, 34.0, 2.0), ["30", "32", "34"], "the ends are between");
        assert_eq!(texts(0.0, 1500.0, 400.0), ["0", "500", "1,000", "1,500"]);
    }

    #[test]
    fn powers_of_ten_are_thinned_out() {
        let texts = |limit| {
            decades(-2.0, 6.3, limit)
                .into_iter()
                .map(|tick| tick.text)
                .collect::<Vec<_>>()
        };
        assert_eq!(
            texts(9),
            [
                "0.01",
                "0.1",
                "1",
                "10",
                "100",
                "1,000",
                "10,000",
                "100,000",
                "1,000,000"
            ]
        );
        assert_eq!(texts(3), ["0.01", "10", "10,000"]);
    }

    #[test]
    fn ends_of_an_axis_are_in_order_and_distinct() {
        assert_eq!(ends(1.0, 3.0), (1.0, 3.0));
        assert_eq!(ends(3.0, 1.0), (1.0, 3.0));
        assert_eq!(ends(2.0, 2.0), (1.5, 2.5));
        assert_eq!(ends(f64::NAN, 2.0), (0.0, 1.0));
        assert_eq!(ends(0.0, f64::INFINITY), (0.0, 1.0));
        let (low, high) = ends(1e12, 1e12);
        assert!(low < 1e12 && high > 1e12);
    }
}
