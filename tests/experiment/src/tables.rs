//! The tables of chapter 5 from a run's records, next to the thesis' figures.

mod atlas;
mod bend_ratios;
mod comfort;
mod ladder;
mod lists;
mod outputs;
mod placement;
mod types;

pub use atlas::atlas_answers;
pub(crate) use atlas::different_grasps;
pub(crate) use bend_ratios::{BEND_BIN_DEGREES, bend_angle_bins, column_means, lost};
pub use bend_ratios::{bend_angles, columns, lost_contacts, ratio_counts};
pub(crate) use comfort::{comfort_share_by_draw, contacts_of, touching_digits, valid_with_figures};
pub use comfort::{comfort_spread, contact_counts};
pub(crate) use ladder::{column_letter, holdout_means, mean_of_means};
pub use ladder::{columns_per_holdout, ladder, per_holdout};
pub use lists::{attempt_list, grasp_list};
pub(crate) use outputs::{mean_step_times, negative_counts, step_shares};
pub use outputs::{output_types, step_times, step_totals};
pub(crate) use placement::{
    MEASURES, PALM_ANGLE_BIN_DEGREES, palm_angle_counts, share_in_range, touching_yaws, valid_values,
    yaw_distance,
};
pub use placement::{measure_ranges, palm_angle_bins, yaw_spread};
pub use types::{grasp_types, unclassifiable};
