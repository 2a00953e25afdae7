//! Built-in holdouts by name.

use grasp_assets::holdouts::{BuiltInHoldout, holdout, holdouts};

use crate::Failure;

/// A built-in holdout by name; the failure lists all names.
pub(crate) fn built_in(name: &str) -> Result<&'static BuiltInHoldout, Failure> {
    holdout(name).ok_or_else(|| {
        let names: Vec<_> = holdouts().iter().map(|holdout| holdout.name.as_str()).collect();
        Failure::Usage(format!(
            "holdout {name:?} is not built in; the built-in ones are {}",
            names.join(", ")
        ))
    })
}
