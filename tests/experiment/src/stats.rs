//! Means, medians and ranks.

/// Mean; none without values.
pub fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// The quantile at a share from 0 to 1, with linear interpolation.
pub fn quantile(values: &[f64], share: f64) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let place = share.clamp(0.0, 1.0) * (sorted.len().checked_sub(1)? as f64);
    let (below, above) = (place.floor() as usize, place.ceil() as usize);
    Some(sorted[below] + (sorted[above] - sorted[below]) * place.fract())
}

/// Sample variance; none for fewer than two values.
pub fn variance(values: &[f64]) -> Option<f64> {
    let centre = mean(values)?;
    let squares: f64 = values.iter().map(|value| (value - centre).powi(2)).sum();
    (values.len() > 1).then(|| squares / (values.len() - 1) as f64)
}

/// Standard error of a mean of group means, in which each group counts the same.
pub fn standard_error_of_group_means(groups: &[Vec<f64>]) -> Option<f64> {
    let mut sum = 0.0;
    for group in groups {
        sum += variance(group)? / group.len() as f64;
    }
    (!groups.is_empty()).then(|| sum.sqrt() / groups.len() as f64)
}

/// Spearman's rank correlation of pairs; none for fewer than three, or where one side is constant.
pub fn rank_correlation(pairs: &[(f64, f64)]) -> Option<f64> {
    if pairs.len() < 3 {
        return None;
    }
    let (xs, ys): (Vec<_>, Vec<_>) = pairs.iter().copied().unzip();
    let (xs, ys) = (ranks(&xs), ranks(&ys));
    let centre = mean(&xs)?;
    let mut covariance = 0.0;
    let mut squares = [0.0, 0.0];
    for (x, y) in xs.iter().zip(&ys) {
        covariance += (x - centre) * (y - centre);
        squares[0] += (x - centre).powi(2);
        squares[1] += (y - centre).powi(2);
    }
    let size = (squares[0] * squares[1]).sqrt();
    (size > 0.0).then(|| covariance / size)
}

/// Ranks from 1; equal values share the mean of theirs.
fn ranks(values: &[f64]) -> Vec<f64> {
    let rank = |value: &f64| {
        let below = values.iter().filter(|other| *other < value).count();
        let equal = values.iter().filter(|other| *other == value).count();
        below as f64 + f64::midpoint(equal as f64, 1.0)
    };
    values.iter().map(rank).collect()
}

/// The Kolmogorov-Smirnov distance of the values from a uniform distribution from `min` to `max`.
pub fn distance_from_uniform(values: &[f64], min: f64, max: f64) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let count = sorted.len() as f64;
    let distances = sorted.iter().enumerate().map(|(index, value)| {
        let expected = ((value - min) / (max - min)).clamp(0.0, 1.0);
        let (before, after) = (index as f64 / count, (index + 1) as f64 / count);
        (expected - before).abs().max((expected - after).abs())
    });
    distances.reduce(f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_quantiles_and_variances_match_hand_computed_values() {
        let values = [4.0, 1.0, 3.0, 2.0];
        assert_eq!(mean(&values), Some(2.5));
        assert_eq!(quantile(&values, 0.5), Some(2.5));
        assert_eq!(quantile(&values, 0.0), Some(1.0));
        assert_eq!(quantile(&values, 1.0), Some(4.0));
        assert!((variance(&values).expect("four values") - 5.0 / 3.0).abs() < 1e-12);
        assert_eq!(mean(&[]), None);
        assert_eq!(quantile(&[], 0.5), None);
        assert_eq!(variance(&[1.0]), None);
    }

    #[test]
    fn rank_correlation_does_not_depend_on_scale() {
        let pairs = [(1.0, 10.0), (2.0, 1000.0), (3.0, 1001.0), (4.0, 1e9)];
        assert_eq!(rank_correlation(&pairs), Some(1.0));
        let falling = pairs.map(|(x, y)| (x, -y));
        assert_eq!(rank_correlation(&falling), Some(-1.0));
        // By hand: ranks 1 2 3 4 against 2 1 4 3, 1 - 6 Σd² / (n (n² - 1)) = 1 - 24 / 60.
        let mixed = [(1.0, 2.0), (2.0, 1.0), (3.0, 4.0), (4.0, 3.0)];
        assert!((rank_correlation(&mixed).expect("four pairs") - 0.6).abs() < 1e-12);
        assert_eq!(rank_correlation(&[(1.0, 1.0), (2.0, 1.0), (3.0, 1.0)]), None);
    }

    #[test]
    fn the_error_of_a_mean_of_means_treats_groups_as_independent() {
        // Two groups with variances 2 and 0: (2/2 + 0/2) summed, root, halved.
        let groups = [vec![1.0, 3.0], vec![5.0, 5.0]];
        assert_eq!(standard_error_of_group_means(&groups), Some(0.5));
        assert_eq!(standard_error_of_group_means(&[vec![1.0]]), None);
    }

    #[test]
    fn a_uniform_sample_is_near_and_a_lump_is_far() {
        let even: Vec<_> = (0..100).map(|i| (f64::from(i) + 0.5) / 100.0).collect();
        assert!(distance_from_uniform(&even, 0.0, 1.0).expect("values") < 0.006);
        assert_eq!(distance_from_uniform(&[0.0; 4], 0.0, 1.0), Some(1.0));
    }
}
