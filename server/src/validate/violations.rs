//! What is wrong with a request, and the paths of its fields.

use std::{cell::RefCell, fmt};

use crate::error::{ServiceError, Violation};

/// Largest number of listed violations; the others are only counted. Four hands whose joints are wrong in every way have fewer.
const MAX_LISTED: usize = 512;

/// The violations found so far.
#[derive(Debug, Default)]
pub(crate) struct Violations(RefCell<FoundViolations>);

#[derive(Debug, Default)]
struct FoundViolations {
    listed: Vec<Violation>,
    unlisted: usize,
    /// Name of a rig whose record is damaged: no fault of the request, and answered before all that are.
    damaged_rig: Option<String>,
}

impl Violations {
    /// A field of the request itself.
    pub(crate) const fn field<'a>(&'a self, name: &'a str) -> Field<'a> {
        Field {
            violations: self,
            parent: None,
            name,
            index: None,
        }
    }

    /// Adds a violation. The texts are formatted only if it is listed.
    pub(crate) fn add(&self, field: impl fmt::Display, description: impl fmt::Display) {
        let mut found = self.0.borrow_mut();
        if found.listed.len() < MAX_LISTED {
            found
                .listed
                .push(Violation::new(field.to_string(), description.to_string()));
        } else {
            found.unlisted += 1;
        }
    }

    /// Adds violations of a message at this path.
    pub(super) fn add_all(&self, path: &str, others: Self) {
        let others = others.0.into_inner();
        for violation in others.listed {
            self.add(format_args!("{path}{}", violation.field), violation.description);
        }
        let mut found = self.0.borrow_mut();
        found.unlisted += others.unlisted;
        found.damaged_rig = found.damaged_rig.take().or(others.damaged_rig);
    }

    /// Names the field `path` and those in it `new_path`.
    pub(super) fn move_path(&self, path: &str, new_path: &str) {
        for Violation { field, .. } in &mut self.0.borrow_mut().listed {
            if let Some(inside) = field.strip_prefix(path) {
                *field = format!("{new_path}{inside}");
            }
        }
    }

    /// True if all of them are of a field of this name, whatever it is in.
    pub(super) fn are_all_of(&self, name: &str) -> bool {
        let found = self.0.borrow();
        let is_of = |violation: &Violation| violation.field.split('.').any(|part| part == name);
        found.unlisted == 0 && found.listed.iter().all(is_of)
    }

    /// True if there are none.
    pub(crate) fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Number of violations.
    pub(crate) fn len(&self) -> usize {
        let found = self.0.borrow();
        found.listed.len() + found.unlisted
    }

    /// Those that are listed.
    pub(super) fn into_listed(self) -> Vec<Violation> {
        self.0.into_inner().listed
    }

    /// `value` if there are no violations.
    pub(crate) fn finish<T>(self, value: T) -> Result<T, ServiceError> {
        if self.is_empty() {
            Ok(value)
        } else {
            Err(self.into_error())
        }
    }

    /// The error that lists the violations.
    pub(crate) fn into_error(self) -> ServiceError {
        let mut found = self.0.into_inner();
        if let Some(name) = found.damaged_rig {
            return ServiceError::RigDamaged { name };
        }
        if let Some(last) = found.listed.last_mut() {
            last.unlisted = found.unlisted;
        }
        ServiceError::Invalid(found.listed)
    }
}

/// A field of a request, whose path is formatted only when it is needed, and where its violations go.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Field<'a> {
    violations: &'a Violations,
    parent: Option<&'a Field<'a>>,
    name: &'a str,
    index: Option<usize>,
}

impl<'a> Field<'a> {
    /// A field of this message.
    pub(crate) const fn child(&'a self, name: &'a str) -> Self {
        Self {
            parent: Some(self),
            name,
            index: None,
            ..*self
        }
    }

    /// An element of this repeated field.
    pub(crate) const fn at(self, index: usize) -> Self {
        Self {
            index: Some(index),
            ..self
        }
    }

    /// The same field, with its violations among others.
    pub(super) const fn among(self, violations: &'a Violations) -> Self {
        Self { violations, ..self }
    }

    /// Adds a violation of this field.
    pub(crate) fn add(self, description: impl fmt::Display) {
        self.violations.add(self, description);
    }

    /// Adds a violation; `None` in place of the value.
    pub(crate) fn reject<T>(self, description: impl fmt::Display) -> Option<T> {
        self.add(description);
        None
    }

    /// Notes that this field needs a rig whose record is damaged.
    pub(super) fn add_damaged_rig(self, name: &str) {
        self.violations.0.borrow_mut().damaged_rig = Some(name.to_owned());
        self.add("names a rig whose record is damaged");
    }

    /// The violations of the request.
    pub(crate) const fn violations(self) -> &'a Violations {
        self.violations
    }
}

impl fmt::Display for Field<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(parent) = self.parent {
            write!(f, "{parent}.")?;
        }
        f.write_str(self.name)?;
        match self.index {
            Some(index) => write!(f, "[{index}]"),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn field_paths_name_every_level() {
        let violations = Violations::default();
        let holdout = violations.field("holdout");
        let hands = holdout.child("other_hands").at(2);
        let pose = hands.child("pose");
        let digit = pose.child("index");
        assert_eq!(
            digit.child("base_pitch").to_string(),
            "holdout.other_hands[2].pose.index.base_pitch"
        );
    }

    #[test]
    fn lists_some_violations_and_counts_the_others() {
        let violations = Violations::default();
        for i in 0..1000 {
            violations.field("f").at(i).add("is wrong");
        }
        let Err(ServiceError::Invalid(listed)) = violations.finish(()) else {
            panic!("violations must not pass");
        };
        assert_eq!(listed.len(), MAX_LISTED);
        assert_eq!(
            listed.iter().map(|violation| violation.unlisted).sum::<usize>(),
            1000 - MAX_LISTED
        );
    }
}
