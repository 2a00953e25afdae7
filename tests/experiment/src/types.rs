//! Grasp types of a run's valid grasps; the thesis calls grasps without a type false valid (5.2, 6.1).
//!
//! Types are not recorded but determined for reports, on grasps reproduced from their seeds and atlases, so all are
//! classified by the same rules.

use std::fmt::Write as _;

use grasp_synthesis::model::grasp_type::GraspType;

use crate::{
    data::Data,
    make::Maker,
    plan::Set,
    stats::standard_error_of_group_means,
    tables::{different_grasps, mean_of_means},
};

/// Half the width of a 95 % interval, in standard errors.
const STANDARD_ERRORS: f64 = 1.96;

/// The types of a positive grasp set.
#[derive(Clone, Debug, PartialEq)]
pub struct SetTypes {
    /// The set.
    pub set: Set,
    /// Type of each grasp, by holdout in the order of the settings; none for unclassifiable grasps.
    pub by_holdout: Vec<Vec<Option<GraspType>>>,
    /// Number of distinct grasps.
    pub different: u64,
}

impl SetTypes {
    /// Number of grasps.
    pub fn count(&self) -> usize {
        self.by_holdout.iter().map(Vec::len).sum()
    }

    /// Share of the grasps of a type, or of none, from 0 to 1; each holdout counts the same.
    pub fn share(&self, of: Option<GraspType>) -> Option<f64> {
        mean_of_means(&self.is(of))
    }

    /// Half of the 95 % interval of the share of unclassifiable grasps. None if grasps repeat, as they then do not vary
    /// like independent ones.
    pub fn margin(&self) -> Option<f64> {
        if self.different < self.count() as u64 {
            return None;
        }
        standard_error_of_group_means(&self.is(None)).map(|error| STANDARD_ERRORS * error)
    }

    /// 1 for each grasp of a type, or of none, else 0.
    fn is(&self, of: Option<GraspType>) -> Vec<Vec<f64>> {
        let is_it = |found: &Option<GraspType>| f64::from(u8::from(*found == of));
        let groups = self.by_holdout.iter().filter(|types| !types.is_empty());
        groups.map(|types| types.iter().map(is_it).collect()).collect()
    }
}

/// The types of the requested positive sets, on one thread.
pub fn set_types(data: &Data<'_>, maker: &Maker) -> Vec<SetTypes> {
    let of_set = |set| {
        let of_holdout = |&holdout: &usize| {
            let own = data.valid(set).filter(|record| record.cell.holdout == holdout);
            own.filter_map(|record| maker.grasp_of(record))
                .map(|grasp| grasp.classification.grasp_type)
                .collect()
        };
        SetTypes {
            set,
            by_holdout: data.settings.holdouts.iter().map(of_holdout).collect(),
            different: different_grasps(data.valid(set)),
        }
    };
    data.sets().map(of_set).collect()
}

/// The shares of unclassifiable grasps in a sentence or two; empty without grasps.
pub fn unclassifiable_in_words(types: &[SetTypes]) -> String {
    let share = |of: &SetTypes| Some(format!("{:.1} % in {}", 100.0 * of.share(None)?, of.set.name()));
    let shares: Vec<_> = types.iter().filter_map(share).collect();
    if shares.is_empty() {
        return String::new();
    }
    let mut text = format!("Of no type are {}.", shares.join(", "));
    for of in types.iter().filter(|of| of.different < of.count() as u64) {
        let _ = write!(
            text,
            " The {} grasps of {} are {} different ones, because an atlas answers a holdout with the same grip again; \
             an interval would say nothing of others.",
            of.count(),
            of.set.name(),
            of.different
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_holdout_counts_the_same() {
        let ring = Some(GraspType::Ring);
        let types = SetTypes {
            set: Set::ALL[0],
            by_holdout: vec![vec![None, None, None, ring], vec![ring, ring], vec![]],
            different: 6,
        };
        assert_eq!(types.count(), 6);
        assert_eq!(types.share(None), Some(0.375));
        assert_eq!(types.share(ring), Some(0.625));
        assert_eq!(types.share(Some(GraspType::Stick)), Some(0.0));
        // Variances 1/4 of four and 0 of two grasps, over two holdouts.
        let margin = types.margin().expect("two holdouts have grasps");
        assert!((margin - 1.96 * 0.25 / 2.0).abs() < 1e-9, "{margin}");
    }

    #[test]
    fn repeated_grasps_have_no_interval() {
        let ring = Some(GraspType::Ring);
        let types = SetTypes {
            set: Set::ATLAS,
            by_holdout: vec![vec![None, None], vec![ring, ring]],
            different: 2,
        };
        assert_eq!(types.share(None), Some(0.5));
        assert_eq!(types.margin(), None);
        let text = unclassifiable_in_words(&[types]);
        assert!(text.starts_with("Of no type are 50.0 % in Atlas."), "{text}");
        assert!(
            text.contains("The 4 grasps of Atlas are 2 different ones"),
            "{text}"
        );
        assert_eq!(unclassifiable_in_words(&[]), "");
    }
}
