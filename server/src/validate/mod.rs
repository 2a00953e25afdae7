//! Turns requests into checked values, or into a list of everything that is wrong with them.
//!
//! Every function takes the field that it reads, adds its violations to that, and returns a usable value even for wrong
//! input, so that all violations are found; [`Violations::finish`] decides in the end: the error is
//! [`ServiceError::Invalid`](crate::error::ServiceError::Invalid) with every violation. A valid request without further
//! hands and obstacles causes no allocations here.

mod current_grasp;
mod evaluate_holdout;
mod find_grasp;
mod frames;
mod hand;
mod holdout;
mod known_grips;
mod lists;
mod names;
mod object;
mod obstacles;
mod receiver;
mod regions;
mod requirements;
mod rig;
mod search;
mod shapes;
mod stream_grasps;
#[cfg(test)]
pub(crate) mod testing;
#[cfg(test)]
mod tests;
mod track;
mod update;
mod validate_grasp;
mod values;
mod violations;

pub(crate) use evaluate_holdout::{EvaluateQuery, evaluate_query};
pub(crate) use find_grasp::{FindQuery, find_query};
#[cfg(test)]
pub(crate) use hand::fixtures;
pub(crate) use hand::{GiverHand, MeshedHand};
pub(crate) use holdout::RequestedSize;
pub(crate) use known_grips::{GripFields, GripKind, PreferredGrip};
pub(crate) use lists::{ObjectFilter, PageQuery, Place, WatchQuery, page_query, page_token, watch_query};
pub(crate) use names::Labels;
pub(crate) use object::{
    COLLECTION, ID_RULE, ObjectFields, RequestKey, UploadQuery, object_fields, object_id_of,
    saved_object_fields, upload_query,
};
#[cfg(test)]
pub(crate) use obstacles::tests::any_obstacles;
pub(crate) use regions::{RegionFields, RegionKind};
pub(crate) use rig::{RigFields, RigOrigin, rig_fields, rig_id_of, rig_page_query, rig_page_token};
pub(crate) use stream_grasps::{Sent, StreamQuery, stream_query};
pub(crate) use track::{Frame, Latest, TrackIntake, TrackPolicy, TrackQuery, sentences, track_query};
pub(crate) use update::{ObjectChange, Setting, UpdateQuery, given_etag, update_query};
pub(crate) use validate_grasp::{GivenGrasp, ValidateQuery, validate_query};
pub(crate) use values::quoted;
use values::{
    FARTHEST, check_count, check_positive, check_unset, check_within, direction, duration, finite, friction,
    handedness, known, point, pose, positive_duration, required, required_handedness,
};
pub(crate) use violations::{Field, Violations};
