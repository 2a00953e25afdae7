//! Halton's low-discrepancy sequence: evenly spread numbers without a generator's state.

/// The `index`-th number of the sequence of a prime `base`, from 0 (included) to 1.
pub(crate) fn halton(mut index: u32, base: u32) -> f64 {
    let mut share = 1.0;
    let mut value = 0.0;
    while index > 0 {
        share /= f64::from(base);
        value += share * f64::from(index % base);
        index /= base;
    }
    value
}

#[cfg(test)]
mod tests {
    use super::halton;

    #[test]
    fn first_numbers_are_the_published_ones() {
        assert_eq!([1, 2, 3, 4].map(|i| halton(i, 2)), [0.5, 0.25, 0.75, 0.125]);
        assert!((halton(5, 3) - 7.0 / 9.0).abs() < 1e-12);
    }
}
