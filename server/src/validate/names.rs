//! Checks labels of objects, and names that a client gives to what it knows of one.

use std::collections::{BTreeMap, HashSet};

use super::{Field, quoted};

/// Labels by key.
pub(crate) type Labels = BTreeMap<String, String>;

/// Largest number of labels of an object.
const MAX_LABELS: usize = 16;

/// Largest number of characters in a key.
const MAX_KEY_LENGTH: usize = 63;

/// Largest number of bytes in a value.
const MAX_VALUE: usize = 63;

/// Checks labels.
pub(super) fn labels(field: Field<'_>, labels: &Labels) {
    if labels.len() > MAX_LABELS {
        field.add(format_args!(
            "has {} labels; the limit is {MAX_LABELS}",
            labels.len()
        ));
    }
    for (key, value) in labels {
        if !(1..=MAX_KEY_LENGTH).contains(&key.len()) || !key.chars().all(is_key_character) {
            field.add(format_args!(
                "has the key {}; it must be 1 to {MAX_KEY_LENGTH} of a-z, 0-9, -, _, . and /",
                quoted(key)
            ));
        }
        if value.len() > MAX_VALUE || value.chars().any(char::is_control) {
            field.add(format_args!(
                "has the value {} of {}; it must be at most {MAX_VALUE} bytes without control characters",
                quoted(value),
                quoted(key)
            ));
        }
    }
}

/// True for a character that keys consist of.
pub(super) fn is_key_character(c: char) -> bool {
    c.is_ascii_lowercase() || c.is_ascii_digit() || matches!(c, '-' | '_' | '.' | '/')
}

/// Largest number of characters of a name.
const MAX_NAME: usize = 63;

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
        if !(1..=MAX_NAME).contains(&length) || name.chars().any(char::is_control) {
            field.add(format_args!(
                "is {}; it must be 1 to {MAX_NAME} characters, without control characters",
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::validate::testing::read_at;

    #[test]
    fn accepts_labels_within_the_bounds_and_names_others() {
        let check = |checked: &Labels| read_at("labels", |field| labels(field, checked)).1.len();
        let of = |key: &str, value: &str| Labels::from([(key.to_owned(), value.to_owned())]);
        let (longest_key, longest_value) = ("k".repeat(63), "v".repeat(63));
        for (key, value) in [
            (longest_key.as_str(), longest_value.as_str()),
            ("a/b_c.d-9", ""),
            ("owner", "Ada Ł."),
        ] {
            assert_eq!(check(&of(key, value)), 0, "{key}={value}");
        }
        for (key, value) in [
            ("", "v"),
            ("Key", "v"),
            ("k y", "v"),
            ("k", "a\nb"),
            (&"k".repeat(64), "v"),
            ("k", &"é".repeat(32)),
        ] {
            assert_eq!(check(&of(key, value)), 1, "{key}={value}");
        }
        let many: Labels = (0..17).map(|n| (format!("k{n}"), String::new())).collect();
        assert_eq!(check(&many), 1);
    }
}
