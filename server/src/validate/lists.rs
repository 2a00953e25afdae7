//! Checks requests to list and to watch objects, and makes page tokens.

use std::cmp::Ordering;

use grasp_proto::v1;
use sha2::{Digest as _, Sha256};

use super::{
    Field, Labels, Violations, known,
    object::{COLLECTION, is_key_character},
    quoted,
};
use crate::{error::ServiceError, wire::hex};

const DEFAULT_PAGE_SIZE: usize = 50;
const MAX_PAGE_SIZE: usize = 1000;

/// Largest number of bytes in a filter: all of its terms are compared with every object.
const MAX_FILTER: usize = 4096;

/// Prefix of tokens of this version, so that tokens of other versions are rejected.
const TOKEN_PREFIX: &str = "a3-";

#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct PageQuery {
    pub size: usize,
    /// The place of the last object of the previous page; `None` for the first page.
    pub after: Option<Place>,
    pub filter: ObjectFilter,
    pub order: ObjectOrder,
    pub is_full: bool,
    /// Identifies filter and order in tokens.
    list: String,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct WatchQuery {
    pub filter: ObjectFilter,
    pub wants_present: bool,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Place {
    /// Nanoseconds from 1970 to the object's creation.
    pub created: u64,
    pub id: String,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ObjectOrder {
    is_by_time: bool,
    is_descending: bool,
}

impl ObjectOrder {
    /// Compares two places; only places of the same object are equal.
    pub(crate) fn compare(self, a: &Place, b: &Place) -> Ordering {
        let (first, second) = if self.is_descending { (b, a) } else { (a, b) };
        let by_key = if self.is_by_time {
            first.created.cmp(&second.created)
        } else {
            first.id.cmp(&second.id)
        };
        by_key.then_with(|| a.id.cmp(&b.id))
    }
}

/// Which objects are listed or watched: all, unless there are terms.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct ObjectFilter(Vec<Term>);

#[derive(Clone, Debug, PartialEq, Eq)]
enum Term {
    Label { key: String, value: String },
    IdPrefix(String),
}

impl ObjectFilter {
    pub(crate) fn matches(&self, id: &str, labels: &Labels) -> bool {
        self.0.iter().all(|term| match term {
            Term::Label { key, value } => labels.get(key) == Some(value),
            Term::IdPrefix(prefix) => id.starts_with(prefix),
        })
    }
}

fn object_filter(field: Field<'_>, text: &str) -> ObjectFilter {
    let mut terms = Vec::new();
    let mut rest = text.trim();
    while text.len() <= MAX_FILTER
        && let Some((term, after)) = first_term(rest)
    {
        terms.push(term);
        rest = after;
    }
    if text.len() > MAX_FILTER || !rest.is_empty() {
        field.add(format_args!(
            "is {}; it must be terms labels.KEY = \"VALUE\" or name = \"objects/PREFIX*\" joined by AND, in at most \
             {MAX_FILTER} bytes",
            quoted(text)
        ));
    }
    ObjectFilter(terms)
}

/// The first term of a filter, and the text after its AND; `None` if it is not one.
fn first_term(text: &str) -> Option<(Term, &str)> {
    let (name, rest) = text.split_once('=')?;
    let (value, rest) = rest.trim_start().strip_prefix('"')?.split_once('"')?;
    let term = if let Some(key) = name.trim_end().strip_prefix("labels.") {
        // A backslash would escape something in other filters, but nothing here.
        if key.is_empty() || !key.chars().all(is_key_character) || value.contains('\\') {
            return None;
        }
        Term::Label {
            key: key.to_owned(),
            value: value.to_owned(),
        }
    } else {
        let prefix = value.strip_prefix(COLLECTION)?.strip_suffix('*')?;
        if name.trim_end() != "name" || prefix.contains('*') {
            return None;
        }
        Term::IdPrefix(prefix.to_owned())
    };
    if rest.is_empty() {
        return Some((term, rest));
    }
    let next = rest
        .strip_prefix(' ')?
        .trim_start()
        .strip_prefix("AND ")?
        .trim_start();
    (!next.is_empty()).then_some((term, next))
}

fn object_order(field: Field<'_>, text: &str) -> ObjectOrder {
    let words: Vec<&str> = text.split_ascii_whitespace().collect();
    if !matches!(
        words[..],
        [] | ["name" | "create_time"] | ["name" | "create_time", "desc"]
    ) {
        field.add(format_args!(
            "is {}; it must be name or create_time, optionally followed by desc",
            quoted(text)
        ));
    }
    ObjectOrder {
        is_by_time: words.first() == Some(&"create_time"),
        is_descending: words.len() > 1,
    }
}

pub(super) fn page_size(given: i32, largest: usize, violations: &Violations) -> usize {
    violations
        .field("page_size")
        .check(given >= 0, format_args!("is {given}; it must not be negative"));
    match usize::try_from(given) {
        Ok(0) | Err(_) => DEFAULT_PAGE_SIZE,
        Ok(size) => size.min(largest),
    }
}

pub(super) fn reject_token<T>(field: Field<'_>, token: &str) -> Option<T> {
    field.reject(format_args!(
        "is {}; it must be the next_page_token of an earlier response",
        quoted(token)
    ))
}

pub(crate) fn page_query(request: &v1::ListObjectsRequest) -> Result<PageQuery, ServiceError> {
    let violations = Violations::default();
    let size = page_size(request.page_size, MAX_PAGE_SIZE, &violations);
    let list = list_of(request);
    let token = request.page_token.as_str();
    let token_field = violations.field("page_token");
    let after = match parse_token(token) {
        _ if token.is_empty() => None,
        None => reject_token(token_field, token),
        Some((of_list, place)) => {
            token_field.check(
                of_list == list,
                "is of a list with another filter or order_by; they must stay the same from page to page",
            );
            Some(place)
        }
    };
    let filter = object_filter(violations.field("filter"), &request.filter);
    let order = object_order(violations.field("order_by"), &request.order_by);
    let view: v1::ObjectView = known(violations.field("view"), request.view);
    violations.finish(PageQuery {
        size,
        after,
        filter,
        order,
        is_full: view == v1::ObjectView::Full,
        list,
    })
}

pub(crate) fn watch_query(request: &v1::WatchObjectsRequest) -> Result<WatchQuery, ServiceError> {
    let violations = Violations::default();
    let filter = object_filter(violations.field("filter"), &request.filter);
    violations.finish(WatchQuery {
        filter,
        wants_present: request.include_present,
    })
}

fn list_of(request: &v1::ListObjectsRequest) -> String {
    let mut hash = Sha256::new();
    hash.update((request.filter.len() as u64).to_le_bytes());
    hash.update(&request.filter);
    hash.update(&request.order_by);
    hex(&hash.finalize()[..8])
}

pub(crate) fn page_token(query: &PageQuery, last: &Place) -> String {
    let text = format!("{} {} {}", query.list, last.created, last.id);
    format!("{TOKEN_PREFIX}{}", hex(text.as_bytes()))
}

fn parse_token(token: &str) -> Option<(String, Place)> {
    let (pairs, rest) = token.strip_prefix(TOKEN_PREFIX)?.as_bytes().as_chunks::<2>();
    let digit = |digit: u8| char::from(digit).to_digit(16);
    let bytes = pairs
        .iter()
        .map(|&[high, low]| Some((digit(high)? * 16 + digit(low)?) as u8));
    let bytes: Option<Vec<u8>> = bytes.collect();
    let text = String::from_utf8(bytes.filter(|_| rest.is_empty())?).ok()?;
    let mut parts = text.splitn(3, ' ');
    let list = parts.next()?.to_owned();
    let place = Place {
        created: parts.next()?.parse().ok()?,
        id: parts.next()?.to_owned(),
    };
    Some((list, place))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::validate::fixtures::blamed;

    fn request(filter: &str, order_by: &str) -> v1::ListObjectsRequest {
        v1::ListObjectsRequest {
            filter: filter.to_owned(),
            order_by: order_by.to_owned(),
            ..Default::default()
        }
    }

    fn place(id: &str, created: u64) -> Place {
        Place {
            created,
            id: id.to_owned(),
        }
    }

    #[test]
    fn reads_its_own_tokens_of_the_same_list() {
        let first = request("labels.a = \"b\"", "create_time desc");
        let last = place("mug-1", 17);
        let next = v1::ListObjectsRequest {
            page_token: page_token(&page_query(&first).unwrap(), &last),
            ..first
        };
        assert!(!next.page_token.contains("mug"));
        assert_eq!(page_query(&next).unwrap().after, Some(last));
        let other = v1::ListObjectsRequest {
            filter: "labels.a = \"c\"".to_owned(),
            ..next
        };
        assert_eq!(blamed(page_query(&other)), ["page_token"]);
    }

    #[test]
    fn reports_every_field_at_once_and_bounds_the_size() {
        for token in ["x", "a3-", "a3-6", "a3-zz", "a3-ff", "a3-é0", "mug", "a2-6d7567"] {
            let request = v1::ListObjectsRequest {
                page_size: -1,
                page_token: token.to_owned(),
                view: 9,
                ..request("=", "size")
            };
            let fields = ["page_size", "page_token", "filter", "order_by", "view"];
            assert_eq!(blamed(page_query(&request)), fields, "{token}");
        }
        for (page_size, size) in [(0, 50), (7, 7), (5000, 1000)] {
            let request = v1::ListObjectsRequest {
                page_size,
                ..Default::default()
            };
            assert_eq!(page_query(&request).unwrap().size, size);
        }
    }

    #[test]
    fn orders_by_a_key_then_by_name_and_by_nothing_else() {
        let [a, b, c] = [place("a", 2), place("b", 1), place("c", 2)];
        for (order_by, expected) in [
            ("", ["a", "b", "c"]),
            ("name", ["a", "b", "c"]),
            ("name desc", ["c", "b", "a"]),
            ("create_time", ["b", "a", "c"]),
            (" create_time  desc ", ["a", "c", "b"]),
        ] {
            let order = page_query(&request("", order_by)).unwrap().order;
            let mut places = [&a, &b, &c];
            places.sort_by(|a, b| order.compare(a, b));
            assert_eq!(places.map(|place| place.id.as_str()), expected, "{order_by}");
        }
        for order_by in [
            "update_time",
            "name up",
            "name desc desc",
            "name, create_time",
            "Name",
        ] {
            assert_eq!(
                blamed(page_query(&request("", order_by))),
                ["order_by"],
                "{order_by}"
            );
        }
    }

    #[test]
    fn every_term_of_a_filter_must_match() {
        let labels: Labels = [("level", "kitchen"), ("owner", "Ada Ł. = AND"), ("fragile", "")]
            .map(|(key, value)| (key.to_owned(), value.to_owned()))
            .into();
        let both = "labels.level = \"kitchen\"  AND  labels.owner = \"Ada Ł. = AND\"";
        for (filter, matches) in [
            ("  ", true),
            ("labels.level=\"kitchen\"", true),
            (" labels.level  =  \"kitchen\" ", true),
            (both, true),
            ("labels.fragile = \"\"", true),
            ("labels.level = \"cellar\"", false),
            ("labels.level = \"kitchen\" AND labels.broken = \"\"", false),
            ("name = \"objects/mug*\"", true),
            ("name=\"objects/*\" AND labels.level = \"kitchen\"", true),
            ("name = \"objects/pan*\"", false),
        ] {
            let query = page_query(&request(filter, "")).unwrap();
            assert_eq!(query.filter.matches("mug-1", &labels), matches, "{filter}");
            let watch = v1::WatchObjectsRequest {
                filter: filter.to_owned(),
                include_present: true,
            };
            assert_eq!(watch_query(&watch).unwrap().filter, query.filter);
        }
        let long = format!("labels.a = \"{}\"", "b".repeat(MAX_FILTER));
        for filter in [
            "level=kitchen",
            "labels.level = kitchen",
            "labels.level",
            "labels. = \"a\"",
            "labels.a = \"b",
            "labels.a = \"b\\\"c\"",
            "labels.a != \"b\"",
            "labels.a!=\"b\"",
            "labels.a = \"b\" OR labels.c = \"d\"",
            "labels.a = \"b\" AND ",
            "labels.a = \"b\" ANDlabels.c = \"d\"",
            "labels.a = \"b\"AND labels.c = \"d\"",
            "NOT labels.a = \"b\"",
            "name = \"objects/mug\"",
            "name = \"mug*\"",
            "name = \"objects/*mug*\"",
            "create_time = \"objects/a*\"",
            &long,
        ] {
            assert_eq!(blamed(page_query(&request(filter, ""))), ["filter"], "{filter}");
        }
    }
}
