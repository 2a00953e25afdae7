//! Contacts, force distributions and comfort E of the valid grasps (5.5, 5.6, 4.6 and 6.1).

use crate::{
    data::Data,
    make::COMFORT_REPEATS,
    plan::Set,
    record::{Details, GraspFigures, Record},
    stats::{mean, quantile, rank_correlation, variance},
    table::{Table, Value},
    thesis,
};

/// Contacts and force distributions of valid grasps by set.
pub fn contact_counts(data: &Data<'_>) -> Table {
    let mut table = Table::new(
        "contacts",
        "Contacts of valid grasps, and force distributions that suffice",
        [
            "set",
            "grasps",
            "contacts: mean",
            "contacts: most",
            "thesis: most",
            "grasps with two digits, %",
            "of 100 distributions suffice: mean",
            "median",
            "thesis: mean",
            "valid again with new draws, %",
        ],
    );
    for set in data.sets() {
        let grasps: Vec<_> = valid_with_figures(data, set).collect();
        let contacts: Vec<_> = grasps
            .iter()
            .map(|(_, details, _)| contacts_of(details))
            .collect();
        let two_digits = grasps
            .iter()
            .filter(|(_, details, _)| touching_digits(details) == 2.0)
            .count();
        let of_thesis = |value, decimals| Value::decimals(set.is_ladder().then_some(value), decimals);
        // Forces are drawn under the thesis' validity only.
        let drawn = grasps
            .iter()
            .filter_map(|(.., grasp)| Some((f64::from(grasp.sufficient_distributions?), *grasp)));
        let (sufficient, drawn): (Vec<_>, Vec<_>) = drawn.unzip();
        let again: usize = drawn.iter().map(|grasp| grasp.comfort_again.len()).sum();
        let tries = drawn.len() * COMFORT_REPEATS as usize;
        table.push(vec![
            set.name().into(),
            (grasps.len() as u64).into(),
            Value::number(mean(&contacts)),
            Value::decimals(quantile(&contacts, 1.0), 0),
            of_thesis(f64::from(thesis::MAX_CONTACTS), 0),
            Value::decimals(100.0 * two_digits as f64 / grasps.len() as f64, 0),
            Value::number(mean(&sufficient)),
            Value::number(quantile(&sufficient, 0.5)),
            of_thesis(thesis::SUFFICIENT_DISTRIBUTIONS, 1),
            Value::decimals(100.0 * again as f64 / tries as f64, 0),
        ]);
    }
    table
}

/// Whether E varies with the draw of the force distribution or with the grasp.
///
/// "By the draw" is the share of E's variance that remains when only the force distributions of the same grasp are
/// drawn again (one-way random effects). Only the rest depends on the grasp.
pub fn comfort_spread(data: &Data<'_>) -> Table {
    let mut table = Table::new(
        "comfort",
        "Comfort E of valid grasps, and what it varies with",
        [
            "set",
            "grasps",
            "E: median",
            "5 % below",
            "95 % below",
            "of its variance by the draw, %",
            "rank correlation with touching digits",
            "with contacts",
            "with the wrench angle",
        ],
    );
    for set in data.sets() {
        let grasps: Vec<_> = valid_with_figures(data, set).collect();
        let comforts: Vec<_> = grasps
            .iter()
            .map(|(.., grasp)| f64::from(grasp.comfort))
            .collect();
        let correlation = |of: &dyn Fn(&Details, &GraspFigures) -> f64| {
            let pairs: Vec<_> = grasps
                .iter()
                .map(|(_, details, grasp)| (f64::from(grasp.comfort), of(details, grasp)))
                .collect();
            Value::decimals(rank_correlation(&pairs), 2)
        };
        let by_draw = comfort_share_by_draw(data, set);
        table.push(vec![
            set.name().into(),
            (grasps.len() as u64).into(),
            Value::decimals(quantile(&comforts, 0.5), 4),
            Value::decimals(quantile(&comforts, 0.05), 4),
            Value::decimals(quantile(&comforts, 0.95), 4),
            Value::decimals(by_draw.map(|share| 100.0 * share), 0),
            correlation(&|details, _| touching_digits(details)),
            correlation(&|details, _| contacts_of(details)),
            correlation(&|_, grasp| f64::from(grasp.wrench_angle_degrees)),
        ]);
    }
    table
}

/// The share of E's variance in a positive set that is due to the draw of the force distribution.
pub(crate) fn comfort_share_by_draw(data: &Data<'_>, set: Set) -> Option<f64> {
    let drawn: Vec<_> = valid_with_figures(data, set)
        .map(|(.., grasp)| draws(grasp))
        .collect();
    share_by_draw(&drawn)
}

/// E as found, and with repeated draws.
fn draws(grasp: &GraspFigures) -> Vec<f64> {
    std::iter::once(&grasp.comfort)
        .chain(&grasp.comfort_again)
        .map(|comfort| f64::from(*comfort))
        .collect()
}

/// The share of variance within groups: mean variance within, over that plus the variance of the groups' true means
/// (analysis of variance for random effects).
fn share_by_draw(groups: &[Vec<f64>]) -> Option<f64> {
    let drawn: Vec<_> = groups.iter().filter(|group| group.len() > 1).collect();
    let within = mean(
        &drawn
            .iter()
            .filter_map(|group| variance(group))
            .collect::<Vec<_>>(),
    )?;
    let means: Vec<_> = drawn.iter().filter_map(|group| mean(group)).collect();
    let from_draws = mean(
        &drawn
            .iter()
            .map(|group| within / group.len() as f64)
            .collect::<Vec<_>>(),
    )?;
    let between = (variance(&means)? - from_draws).max(0.0);
    (within + between > 0.0).then(|| within / (within + between))
}

/// The positive set with its figures.
pub(crate) fn valid_with_figures<'a>(
    data: &Data<'a>,
    set: Set,
) -> impl Iterator<Item = (&'a Record, &'a Details, &'a GraspFigures)> {
    data.valid(set).filter_map(|record| {
        let details = record.details.as_ref()?;
        Some((record, details, details.grasp.as_ref()?))
    })
}

/// Touching links and contacts of the palm.
pub(crate) fn contacts_of(details: &Details) -> f64 {
    let palm = details.grasp.as_ref().map_or(0, |grasp| grasp.palm_contacts);
    f64::from(palm + details.digits.iter().map(|digit| digit.contacts).sum::<u32>())
}

/// Digits that touch.
pub(crate) fn touching_digits(details: &Details) -> f64 {
    details.digits.iter().filter(|digit| digit.contacts > 0).count() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variance_is_attributed_to_grasps_and_draws() {
        // The grasp alone: every draw gives the same.
        let by_grasp = [vec![1.0, 1.0], vec![2.0, 2.0], vec![3.0, 3.0]];
        assert_eq!(share_by_draw(&by_grasp), Some(0.0));
        // The draw alone: every grasp has the same values.
        let by_draw = [vec![1.0, 3.0], vec![3.0, 1.0], vec![1.0, 3.0]];
        assert_eq!(share_by_draw(&by_draw), Some(1.0));
        // Variance 2 within; means 0 and 4 have variance 8, of which 2 / 2 comes from the draws.
        let both = [vec![-1.0, 1.0], vec![3.0, 5.0]];
        assert!((share_by_draw(&both).expect("two groups") - 2.0 / 9.0).abs() < 1e-12);
        assert_eq!(share_by_draw(&[]), None);
    }
}
