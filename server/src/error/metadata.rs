//! Keeps errors small enough to arrive.
//!
//! A status travels in headers, and clients drop calls with large ones: gRPC's C core at random beyond 8 kB. Whatever is wrong with a
//! request, its message and details take less than 4 kB as they are sent, the message percent-encoded and the details in base64,
//! with room for the other headers of an answer.

use std::collections::HashMap;

use tonic_types::FieldViolation;

use super::{Violation, count};

/// Largest message of a status, in bytes as they are sent.
pub(super) const MAX_MESSAGE: usize = 360;

/// Largest part of the message that describes the first of several violations; the rest is for their number.
pub(super) const MAX_SUMMARY: usize = 320;

/// Largest name of a resource or value that details repeat, in bytes.
pub(super) const MAX_NAME: usize = 160;

/// Largest path of a field, in bytes.
const MAX_FIELD: usize = 160;

/// Largest description of a violation, in bytes.
const MAX_DESCRIPTION: usize = 900;

/// Largest size of all listed violations, in bytes before base64.
const MAX_LISTED: usize = 1800;

/// The part of [`MAX_LISTED`] for the entry that says what is not listed.
const UNLISTED_ENTRY: usize = 260;

/// Bytes of a violation in the details beside its texts.
const PER_VIOLATION: usize = 9;

/// Largest number of kinds of violations that the entry about unlisted ones names.
const NAMED_KINDS: usize = 2;

/// A text of at most `most` bytes.
pub(super) fn clipped(text: &str, most: usize) -> String {
    clipped_by(text, most, char::len_utf8)
}

/// A text of at most `most` bytes once it is percent-encoded, as gRPC sends messages.
pub(super) fn clipped_message(text: &str, most: usize) -> String {
    clipped_by(text, most, |character| {
        let is_plain = matches!(character, '!'..='~') && !"\"#%<>`?{}".contains(character);
        if is_plain { 1 } else { 3 * character.len_utf8() }
    })
}

/// A text of at most `most` units, of which each character takes some. One that is cut ends with an ellipsis.
fn clipped_by(text: &str, most: usize, units: impl Fn(char) -> usize) -> String {
    const ELLIPSIS: char = '…';
    let (mut taken, mut cut) = (0, 0);
    for (place, character) in text.char_indices() {
        if taken + units(ELLIPSIS) <= most {
            cut = place;
        }
        taken += units(character);
        if taken > most {
            return format!("{}{ELLIPSIS}", &text[..cut]);
        }
    }
    text.to_owned()
}

/// The violations that the details list, in their order: of each kind the first, then of each kind the second and so on, as far as there is room. If
/// any are left out, the last entry says how many, and has no field.
pub(super) fn listed(violations: &[Violation]) -> Vec<FieldViolation> {
    let mut of_kind: HashMap<String, usize> = HashMap::new();
    let mut ranked: Vec<(usize, usize)> = Vec::new();
    for (place, violation) in violations.iter().enumerate() {
        let rank = of_kind.entry(kind(&violation.field)).or_default();
        ranked.push((*rank, place));
        *rank += 1;
    }
    ranked.sort_unstable();
    let entries: Vec<FieldViolation> = violations
        .iter()
        .map(|violation| {
            FieldViolation::new(
                clipped(&violation.field, MAX_FIELD),
                clipped(&violation.description, MAX_DESCRIPTION),
            )
        })
        .collect();
    let bytes = |entry: &FieldViolation| entry.field.len() + entry.description.len() + PER_VIOLATION;
    let total = count(violations);
    let is_complete = total == entries.len() && entries.iter().map(bytes).sum::<usize>() <= MAX_LISTED;
    if is_complete {
        return entries;
    }
    let mut room = MAX_LISTED - UNLISTED_ENTRY;
    let mut is_listed = vec![false; entries.len()];
    for (_, place) in ranked {
        if bytes(&entries[place]) <= room {
            room -= bytes(&entries[place]);
            is_listed[place] = true;
        }
    }
    let left_out = || {
        violations
            .iter()
            .zip(&is_listed)
            .filter(|(_, is_listed)| !**is_listed)
    };
    let mut kinds: Vec<(&str, usize)> = Vec::new();
    for (violation, _) in left_out() {
        let same = |(first, _): &&mut (&str, usize)| kind(first) == kind(&violation.field);
        match kinds.iter_mut().find(same) {
            Some((_, number)) => *number += 1,
            None => kinds.push((&violation.field, 1)),
        }
    }
    kinds.sort_by_key(|(_, number)| std::cmp::Reverse(*number));
    let named = kinds.iter().take(NAMED_KINDS);
    let named: Vec<String> = named
        .map(|(first, number)| format!("{number} like {}", clipped(first, MAX_FIELD / 2)))
        .collect();
    let number = total - is_listed.iter().filter(|&&is_listed| is_listed).count();
    let colon = if named.is_empty() { "" } else { ": " };
    let rest = format!(
        "{number} more violations are not listed{colon}{}",
        named.join(", ")
    );
    let mut listed: Vec<FieldViolation> = entries
        .into_iter()
        .zip(is_listed)
        .filter_map(|(entry, is_listed)| is_listed.then_some(entry))
        .collect();
    listed.push(FieldViolation::new("", rest));
    listed
}

/// The path of a field without the places in its lists.
fn kind(field: &str) -> String {
    let mut parts = field.split('[');
    let first = parts.next().unwrap_or_default().to_owned();
    parts.fold(first, |kind, part| {
        kind + part.split_once(']').map_or(part, |(_, after)| after)
    })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use tonic::Status;
    use tonic_types::StatusExt as _;

    use super::*;
    use crate::error::ServiceError;

    /// What the headers of an error's answer take: each its name, its value and 32 bytes (RFC 9113, 6.5.2).
    fn header_bytes(error: ServiceError) -> usize {
        let answer = Status::from(error).into_http::<()>();
        let headers = answer.headers().iter();
        headers
            .map(|(name, value)| name.as_str().len() + value.len() + 32)
            .sum()
    }

    /// Less than 4 kB by what a page's answer has besides.
    const MAX_HEADERS: usize = 3750;

    fn violations(fields: impl IntoIterator<Item = String>) -> Vec<Violation> {
        let described = |field| {
            Violation::new(
                field,
                "is [0, 0, 0, 0], of norm 0; it must be a unit quaternion, within 1 %",
            )
        };
        fields.into_iter().map(described).collect()
    }

    fn fields(listed: &[FieldViolation]) -> Vec<&str> {
        listed.iter().map(|entry| entry.field.as_str()).collect()
    }

    #[test]
    fn a_few_violations_are_all_listed() {
        let all = violations((0..3).map(|place| format!("joints[{place}]")));
        assert_eq!(fields(&listed(&all)), ["joints[0]", "joints[1]", "joints[2]"]);
    }

    #[test]
    fn of_many_violations_the_first_of_each_kind_are_listed_and_the_others_counted() {
        let orientation = |place| format!("holdout.presenting_hand.joints.joints[{place}].pose.orientation");
        let mut all = violations((0..26).map(orientation));
        all.extend(violations(["search.budget".to_owned()]));
        all.last_mut().unwrap().unlisted = 900;
        let status = Status::from(ServiceError::Invalid(all));
        assert!(
            status.message().ends_with("(and 926 more)"),
            "{}",
            status.message()
        );
        let details = status.get_error_details();
        let listed = &details.bad_request().unwrap().field_violations;
        let fields = fields(listed);
        let (last, fields) = fields.split_last().unwrap();
        assert!(
            fields.len() > 3 && fields[0] == orientation(0) && fields[1] == orientation(1),
            "{fields:?}"
        );
        assert_eq!((*fields.last().unwrap(), *last), ("search.budget", ""));
        let (rest, orientations) = (927 - fields.len(), 27 - fields.len());
        assert_eq!(
            listed.last().unwrap().description,
            format!(
                "{rest} more violations are not listed: {orientations} like {}",
                orientation(fields.len() - 1)
            )
        );
    }

    #[test]
    fn texts_are_cut_at_characters_and_only_if_they_are_too_long() {
        assert_eq!(clipped("aéb", 4), "aéb");
        assert_eq!(clipped("aébcde", 6), "aé…");
        assert_eq!(clipped_message("a b", 5), "a b");
        assert_eq!(clipped_message("a bcdefghijkl", 12), "a…");
        assert_eq!(kind("a[1].b[22].c"), "a.b.c");
    }

    proptest! {
        /// However many and long the violations are, they arrive.
        #[test]
        fn errors_are_small_enough_to_arrive(
            texts in prop::collection::vec((".{0,300}", ".{0,2000}", 0_usize..10), 0..40),
        ) {
            let all = texts.iter().map(|(field, description, unlisted)| Violation {
                unlisted: *unlisted,
                ..Violation::new(field.as_str(), description.as_str())
            });
            let all: Vec<Violation> = all.collect();
            let bytes = header_bytes(ServiceError::Invalid(all));
            prop_assert!(bytes < MAX_HEADERS, "{bytes}");
        }

        #[test]
        fn long_names_are_small_enough_to_arrive(name in ".{0,4000}", other in ".{0,4000}") {
            let errors = [
                ServiceError::ObjectNotFound { name: name.clone(), evicted: true },
                ServiceError::RequestIdReused { request_id: other.clone(), name: name.clone() },
                ServiceError::ObjectReadOnly { name: name.clone() },
                ServiceError::ObjectChanged { name: name.clone(), etag: other.clone(), current: other.clone() },
                ServiceError::ObjectUnloadable { name: name.clone(), reason: other.clone() },
                ServiceError::RigNotFound { name: name.clone() },
                ServiceError::TrackNotFound { name: name.clone() },
                ServiceError::Malformed(other),
            ];
            for error in errors {
                let bytes = header_bytes(error.clone());
                prop_assert!(bytes < MAX_HEADERS, "{bytes} of {error:?}");
            }
        }
    }
}
