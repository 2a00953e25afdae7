//! Helpers of tests.

use super::{Field, Violations};
use crate::{convention::Convention, error::ServiceError};

/// All conventions.
pub(crate) const CONVENTIONS: [Convention; 6] = [
    Convention::OpenXr,
    Convention::Unity,
    Convention::UnityFlipX,
    Convention::Unreal,
    Convention::UnrealXzy,
    Convention::Godot,
];

/// The fields that an answer blames; none if it is right.
pub(super) fn blamed<T>(answer: Result<T, ServiceError>) -> Vec<String> {
    match answer {
        Ok(_) => Vec::new(),
        Err(ServiceError::Invalid(violations)) => violations.into_iter().map(|v| v.field).collect(),
        Err(other) => panic!("{other}"),
    }
}

/// What is read of a field of this name, and the fields that are blamed.
pub(super) fn read_at<T>(name: &str, read: impl FnOnce(Field<'_>) -> T) -> (T, Vec<String>) {
    let violations = Violations::default();
    let value = read(violations.field(name));
    (value, blamed(violations.finish(())))
}
