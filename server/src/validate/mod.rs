//! Turns requests into checked values, or into a list of everything that is wrong with them.
//!
//! Every function takes the field that it reads, adds its violations to that, and returns a usable value even for wrong
//! input, so that all violations are found; [`Violations::finish`] decides in the end: the error is
//! [`ServiceError::Invalid`](crate::error::ServiceError::Invalid) with every violation. A valid request without further
//! hands and obstacles causes no allocations here.

mod current_grasp;
mod fields;
mod find_grasp;
mod hand;
mod holdout;
mod lists;
mod object;
mod receiver;
mod regions;
mod requirements;
mod rig;
mod searches;
#[cfg(test)]
mod tests;
mod track;
mod update;

pub(crate) use crate::wire::quoted;
use fields::{
    FARTHEST, check_count, check_positive, check_unset, check_within, direction, duration, factor, finite,
    friction, handedness, known, point, pose, positive_duration, required, required_handedness,
};
pub(crate) use fields::{Field, Violations};
pub(crate) use find_grasp::{FindQuery, find_query};
pub(crate) use hand::{GiverHand, MeshedHand};
pub(crate) use holdout::RequestedSize;
#[cfg(test)]
pub(crate) use holdout::tests::any_obstacles;
pub(crate) use lists::{ObjectFilter, PageQuery, Place, WatchQuery, page_query, page_token, watch_query};
pub(crate) use object::{
    COLLECTION, ID_RULE, Labels, ObjectFields, RequestKey, UploadQuery, object_fields, object_id_of,
    saved_object_fields, upload_query,
};
pub(crate) use regions::{GripFields, GripKind, PreferredGrip, RegionFields, RegionKind};
pub(crate) use rig::{RigFields, RigOrigin, rig_fields, rig_id_of, rig_page_query, rig_page_token};
pub(crate) use searches::{
    EvaluateQuery, GivenGrasp, Sent, StreamQuery, ValidateQuery, evaluate_query, stream_query, validate_query,
};
#[cfg(test)]
pub(crate) use tests::fixtures;
pub(crate) use track::{Frame, Latest, TrackIntake, TrackPolicy, TrackQuery, sentences, track_query};
pub(crate) use update::{ObjectChange, Setting, UpdateQuery, given_etag, update_query};
