//! Names that a client gives to what it knows of an object.

use std::collections::HashSet;

use super::{Field, quoted};

/// Largest number of characters of a name.
const LONGEST: usize = 63;

/// The names given so far in one list, each of which must differ from the others.
#[derive(Debug)]
pub(super) struct GivenNames {
    /// What has the names, in the singular.
    what: &'static str,
    names: HashSet<String>,
}

impl GivenNames {
    /// No names yet, of `what`, in the singular.
    pub(super) fn of(what: &'static str) -> Self {
        Self {
            what,
            names: HashSet::new(),
        }
    }

    /// Checks the next name.
    pub(super) fn check(&mut self, field: Field<'_>, name: &str) {
        let length = name.chars().count();
        if !(1..=LONGEST).contains(&length) || name.chars().any(char::is_control) {
            field.add(format_args!(
                "is {}; it must be 1 to {LONGEST} characters, without control characters",
                quoted(name)
            ));
        }
        if !self.names.insert(name.to_owned()) {
            field.add(format_args!(
                "is {} again; every {} needs a name of its own",
                quoted(name),
                self.what
            ));
        }
    }
}
