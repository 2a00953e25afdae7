//! Which violations of a request its error lists: clients drop statuses that are large.

use std::{cmp::Reverse, collections::HashMap};

use tonic_types::FieldViolation;

use super::{Violation, count, status::clipped};

const MAX_FIELD: usize = 160;
const MAX_DESCRIPTION: usize = 900;

/// Largest size of all listed violations, in bytes before base64.
const MAX_LISTED: usize = 1600;

/// The part of [`MAX_LISTED`] for the entry about those that are not listed.
const UNLISTED_ENTRY: usize = 260;

/// Bytes of a violation in the details beside its texts.
const PER_VIOLATION: usize = 9;

/// Largest number of kinds of violations that the entry about unlisted ones names.
const NAMED_KINDS: usize = 2;

/// The violations that the details list, in their order: the first of each kind, then the second of each and so on, while there is
/// room. If any are left out, the last entry says how many, and has no field.
pub(super) fn listed(violations: &[Violation]) -> Vec<FieldViolation> {
    let entry = |violation: &Violation| {
        let field = clipped(&violation.field, MAX_FIELD);
        FieldViolation::new(field, clipped(&violation.description, MAX_DESCRIPTION))
    };
    let entries: Vec<FieldViolation> = violations.iter().map(entry).collect();
    let bytes = |entry: &FieldViolation| entry.field.len() + entry.description.len() + PER_VIOLATION;
    let total = count(violations);
    if total == entries.len() && entries.iter().map(bytes).sum::<usize>() <= MAX_LISTED {
        return entries;
    }
    let kinds: Vec<String> = violations.iter().map(|one| kind(&one.field)).collect();
    let mut of_kind: HashMap<&str, usize> = HashMap::new();
    let mut ranked: Vec<(usize, usize)> = Vec::new();
    for (place, kind) in kinds.iter().enumerate() {
        let rank = of_kind.entry(kind).or_default();
        ranked.push((*rank, place));
        *rank += 1;
    }
    ranked.sort_unstable();
    let mut room = MAX_LISTED - UNLISTED_ENTRY;
    let mut is_listed = vec![false; entries.len()];
    for (_, place) in ranked {
        let bytes = bytes(&entries[place]);
        is_listed[place] = bytes <= room;
        room -= if bytes <= room { bytes } else { 0 };
    }
    let mut left_out: Vec<(usize, usize)> = Vec::new();
    for place in (0..entries.len()).filter(|&place| !is_listed[place]) {
        match left_out
            .iter_mut()
            .find(|(first, _)| kinds[*first] == kinds[place])
        {
            Some((_, count)) => *count += 1,
            None => left_out.push((place, 1)),
        }
    }
    left_out.sort_by_key(|&(_, count)| Reverse(count));
    let named = left_out.into_iter().take(NAMED_KINDS).map(|(first, count)| {
        format!(
            "{count} like {}",
            clipped(&violations[first].field, MAX_FIELD / 2)
        )
    });
    let named = named.collect::<Vec<_>>().join(", ");
    let colon = if named.is_empty() { "" } else { ": " };
    let listed = entries
        .into_iter()
        .zip(is_listed)
        .filter(|(_, is_listed)| *is_listed);
    let mut listed: Vec<FieldViolation> = listed.map(|(entry, _)| entry).collect();
    let rest = total - listed.len();
    let rest = format!("{rest} more violations are not listed{colon}{named}");
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
    use tonic::Status;
    use tonic_types::StatusExt as _;

    use super::*;
    use crate::error::ServiceError;

    fn violations(fields: impl IntoIterator<Item = String>) -> Vec<Violation> {
        let text = "is [0, 0, 0, 0], of norm 0; it must be a unit quaternion, within 1 %";
        fields
            .into_iter()
            .map(|field| Violation::new(field, text))
            .collect()
    }

    #[test]
    fn of_many_violations_the_first_of_each_kind_are_listed_and_the_others_counted() {
        let orientation = |place| format!("holdout.presenting_hand.joints.joints[{place}].pose.orientation");
        let few = violations((0..3).map(orientation));
        let fields: Vec<String> = listed(&few).into_iter().map(|entry| entry.field).collect();
        assert_eq!(fields, [0, 1, 2].map(orientation));
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
        let (last, listed) = details
            .bad_request()
            .unwrap()
            .field_violations
            .split_last()
            .unwrap();
        let (budget, orientations) = listed.split_last().unwrap();
        let count = orientations.len();
        assert!(count > 2 && orientations[1].field == orientation(1), "{listed:?}");
        assert_eq!(
            (budget.field.as_str(), last.field.as_str()),
            ("search.budget", "")
        );
        let (rest, left) = (926 - count, 26 - count);
        let text = format!(
            "{rest} more violations are not listed: {left} like {}",
            orientation(count)
        );
        assert_eq!(last.description, text);
    }

    #[test]
    fn fields_that_differ_by_their_place_in_lists_are_of_a_kind() {
        assert_eq!(kind("a[1].b[22].c"), "a.b.c");
    }
}
