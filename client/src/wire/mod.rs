//! Conversion between the library's types and messages of `grasp.v1`; generated types are used nowhere else.
//!
//! Functions named `*_to_wire` cannot fail: the server validates requests. Functions named `*_from_wire` reject answers
//! that violate the contract, with the path of the field.

mod constraint_codec;
mod evaluation_codec;
mod geometry_codec;
mod hand_codec;
mod known_grip_codec;
mod object_codec;
mod object_request_codec;
mod obstacle_codec;
mod receiver_codec;
mod region_codec;
mod rig_codec;
mod search_codec;
mod standing_codec;
mod stream_codec;
mod track_codec;
mod verdict_codec;

pub(crate) use evaluation_codec::{evaluate_answer_from_wire, evaluate_request_to_wire};
pub(crate) use object_codec::{health_from_wire, news_from_wire, object_from_wire, object_page_from_wire};
pub(crate) use object_request_codec::{described_object_to_wire, new_object_to_wire, update_to_wire};
pub(crate) use rig_codec::{new_rig_to_wire, rig_from_wire, rig_page_from_wire};
pub(crate) use search_codec::{find_answer_from_wire, find_request_to_wire};
pub(crate) use stream_codec::{stream_event_from_wire, stream_request_to_wire};
pub(crate) use track_codec::{track_answer_from_wire, track_frame_to_wire, track_setup_to_wire};
pub(crate) use verdict_codec::{validate_answer_from_wire, validate_request_to_wire};

use crate::error::ClientError;

/// A field of an answer that violates the contract.
#[derive(Debug, PartialEq)]
pub(crate) struct Malformed {
    path: String,
    problem: String,
}

impl Malformed {
    fn new(field: &str, problem: impl Into<String>) -> Self {
        Self {
            path: field.to_owned(),
            problem: problem.into(),
        }
    }

    fn missing(field: &str) -> Self {
        Self::new(field, "is missing")
    }

    fn unknown_value(field: &str, value: i32) -> Self {
        Self::new(field, format!("has the unknown value {value}"))
    }

    /// The same error with a path that starts at the message containing `parent`.
    fn within(mut self, parent: &str) -> Self {
        self.path = format!("{parent}.{}", self.path);
        self
    }
}

impl From<Malformed> for ClientError {
    fn from(malformed: Malformed) -> Self {
        Self::Malformed {
            field: malformed.path,
            problem: malformed.problem,
        }
    }
}

/// The value of a required field.
fn required<T>(field: &str, value: Option<T>) -> Result<T, Malformed> {
    value.ok_or_else(|| Malformed::missing(field))
}

/// Converts every element of a repeated field; the error names the malformed one.
fn each<T, U>(
    field: &str,
    values: Vec<T>,
    convert: impl Fn(T) -> Result<U, Malformed>,
) -> Result<Vec<U>, Malformed> {
    values
        .into_iter()
        .enumerate()
        .map(|(i, value)| convert(value).map_err(|malformed| malformed.within(&format!("{field}[{i}]"))))
        .collect()
}

/// A repeated field of fixed length.
fn exactly<T, const N: usize>(field: &str, values: Vec<T>) -> Result<[T; N], Malformed> {
    let count = values.len();
    values
        .try_into()
        .map_err(|_| Malformed::new(field, format!("has {count} elements instead of {N}")))
}
