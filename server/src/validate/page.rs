//! Checks list requests, and makes page tokens.

use std::cmp::Ordering;

use grasp_proto::v1;
use sha2::{Digest as _, Sha256};

use super::{
    Field, Violations, known,
    labels::{LabelFilter, label_filter},
    quoted,
};
use crate::{error::ServiceError, wire::hex};

/// Number of elements on a page if the request gives no size.
const DEFAULT_PAGE_SIZE: usize = 50;

/// Largest number of objects on a page.
const MAX_PAGE_SIZE: usize = 1000;

/// Prefix of tokens of this version, so that tokens of other versions are rejected.
const TOKEN_PREFIX: &str = "a2-";

/// A page to list.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct PageQuery {
    /// Number of objects.
    pub size: usize,
    /// The place of the last object of the previous page; none for the first page.
    pub after: Option<Place>,
    /// Which objects.
    pub filter: LabelFilter,
    pub order: ObjectOrder,
    /// True to list regions and known grips, too.
    pub is_full: bool,
    /// Identifies filter and order in tokens.
    list: String,
}

/// Where an object is in a list, whatever its order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Place {
    /// Nanoseconds from 1970 to the object's creation.
    pub created: u64,
    /// Nanoseconds from 1970 to its last change.
    pub updated: u64,
    pub id: String,
}

/// What objects are sorted by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Key {
    Name,
    CreateTime,
    UpdateTime,
}

impl Key {
    fn of(name: &str) -> Option<Self> {
        match name {
            "name" => Some(Self::Name),
            "create_time" => Some(Self::CreateTime),
            "update_time" => Some(Self::UpdateTime),
            _ => None,
        }
    }
}

/// The order of a list.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct ObjectOrder(Vec<(Key, Direction)>);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Direction {
    Ascending,
    Descending,
}

impl ObjectOrder {
    /// Compares two places; only places of the same object are equal.
    pub(crate) fn compare(&self, a: &Place, b: &Place) -> Ordering {
        let by_keys = self.0.iter().map(|(key, direction)| {
            let ascending = match key {
                Key::Name => a.id.cmp(&b.id),
                Key::CreateTime => a.created.cmp(&b.created),
                Key::UpdateTime => a.updated.cmp(&b.updated),
            };
            match direction {
                Direction::Ascending => ascending,
                Direction::Descending => ascending.reverse(),
            }
        });
        by_keys
            .fold(Ordering::Equal, Ordering::then)
            .then_with(|| a.id.cmp(&b.id))
    }
}

/// The number of elements on a page of at most `largest`.
pub(super) fn page_size(given: i32, largest: usize, violations: &Violations) -> usize {
    match usize::try_from(given) {
        Ok(0) => DEFAULT_PAGE_SIZE,
        Ok(size) => size.min(largest),
        Err(_) => {
            violations
                .field("page_size")
                .add(format_args!("is {given}; it must not be negative"));
            DEFAULT_PAGE_SIZE
        }
    }
}

/// Rejects a page token of another version or list.
pub(super) fn reject_token<T>(field: Field<'_>, token: &str) -> Option<T> {
    field.reject(format_args!(
        "is {}; it must be the next_page_token of an earlier response",
        quoted(token)
    ))
}

/// Checks a list request.
pub(crate) fn page_query(request: &v1::ListObjectsRequest) -> Result<PageQuery, ServiceError> {
    let violations = Violations::default();
    let size = page_size(request.page_size, MAX_PAGE_SIZE, &violations);
    let list = list_of(request);
    let after = if request.page_token.is_empty() {
        None
    } else {
        place_of_token(&request.page_token, &list, &violations)
    };
    let filter = label_filter(violations.field("filter"), &request.filter);
    let order = object_order(&request.order_by, &violations);
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

fn object_order(text: &str, violations: &Violations) -> ObjectOrder {
    let mut keys: Vec<(Key, Direction)> = Vec::new();
    if text.trim().is_empty() {
        return ObjectOrder(keys);
    }
    for (place, part) in text.split(',').enumerate() {
        let mut words = part.split_ascii_whitespace();
        let key = words.next().and_then(Key::of);
        let direction = match words.next() {
            None => Some(Direction::Ascending),
            Some("desc") => Some(Direction::Descending),
            Some(_) => None,
        };
        match (key, direction, words.next()) {
            (Some(key), Some(direction), None) if keys.iter().all(|(other, _)| *other != key) => {
                keys.push((key, direction));
            }
            _ => {
                violations.field("order_by").add(format_args!(
                        "has {} as part {}; parts must be name, create_time or update_time, each at most once and \
                         optionally followed by desc",
                        quoted(part.trim()),
                        place + 1
                    ));
                break;
            }
        }
    }
    ObjectOrder(keys)
}

/// Identifies the filter and order of a request.
fn list_of(request: &v1::ListObjectsRequest) -> String {
    let mut hash = Sha256::new();
    hash.update((request.filter.len() as u64).to_le_bytes());
    hash.update(&request.filter);
    hash.update(&request.order_by);
    hex(&hash.finalize()[..8])
}

/// The token of the page after an object.
pub(crate) fn page_token(query: &PageQuery, last: &Place) -> String {
    let Place { created, updated, id } = last;
    let text = format!("{} {created} {updated} {id}", query.list);
    format!("{TOKEN_PREFIX}{}", hex(text.as_bytes()))
}

fn place_of_token(token: &str, list: &str, violations: &Violations) -> Option<Place> {
    let field = violations.field("page_token");
    let Some((of_list, place)) = parse_token(token) else {
        return reject_token(field, token);
    };
    if of_list != list {
        field.add("is of a list with another filter or order_by; they must stay the same from page to page");
    }
    Some(place)
}

/// The list that a token is of, and the place in it.
fn parse_token(token: &str) -> Option<(String, Place)> {
    let digits = token.strip_prefix(TOKEN_PREFIX)?;
    if digits.len() % 2 != 0 || !digits.bytes().all(|b| b.is_ascii_hexdigit()) {
        return None;
    }
    let bytes: Option<Vec<u8>> = (0..digits.len())
        .step_by(2)
        .map(|at| u8::from_str_radix(&digits[at..at + 2], 16).ok())
        .collect();
    let text = String::from_utf8(bytes?).ok()?;
    let mut parts = text.splitn(4, ' ');
    let list = parts.next()?.to_owned();
    let place = Place {
        created: parts.next()?.parse().ok()?,
        updated: parts.next()?.parse().ok()?,
        id: parts.next()?.to_owned(),
    };
    Some((list, place))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::validate::testing::blamed;

    fn request(page_size: i32, page_token: &str) -> v1::ListObjectsRequest {
        v1::ListObjectsRequest {
            page_size,
            page_token: page_token.to_owned(),
            ..Default::default()
        }
    }

    fn ordered_by(order_by: &str) -> Result<ObjectOrder, ServiceError> {
        let request = v1::ListObjectsRequest {
            order_by: order_by.to_owned(),
            ..Default::default()
        };
        Ok(page_query(&request)?.order)
    }

    fn place(id: &str, created: u64, updated: u64) -> Place {
        Place {
            created,
            updated,
            id: id.to_owned(),
        }
    }

    #[test]
    fn reads_its_own_tokens_of_the_same_list() {
        let first = v1::ListObjectsRequest {
            filter: "a=b".to_owned(),
            order_by: "update_time desc".to_owned(),
            ..Default::default()
        };
        let query = page_query(&first).unwrap();
        let last = place("mug-1", 17, 18);
        let next = v1::ListObjectsRequest {
            page_token: page_token(&query, &last),
            ..first
        };
        assert!(!next.page_token.contains("mug"));
        assert_eq!(page_query(&next).unwrap().after, Some(last));
        let other = v1::ListObjectsRequest {
            filter: "a=c".to_owned(),
            ..next
        };
        assert_eq!(blamed(page_query(&other)), ["page_token"]);
    }

    #[test]
    fn page_size_has_a_default_and_a_maximum() {
        assert_eq!(page_query(&request(0, "")).unwrap().size, 50);
        assert_eq!(page_query(&request(5000, "")).unwrap().size, 1000);
    }

    #[test]
    fn reports_every_field_at_once() {
        for token in ["x", "a2-", "a2-6", "a2-zz", "a2-ff", "a2-é0", "mug", "a1-6d7567"] {
            let request = v1::ListObjectsRequest {
                filter: "=".to_owned(),
                order_by: "size".to_owned(),
                view: 9,
                ..request(-1, token)
            };
            let fields = blamed(page_query(&request));
            assert_eq!(
                fields,
                ["page_size", "page_token", "filter", "order_by", "view"],
                "{token}"
            );
        }
    }

    #[test]
    fn orders_by_each_key_then_by_name() {
        let [a, b, c] = [place("a", 2, 5), place("b", 1, 5), place("c", 3, 4)];
        for (order_by, expected) in [
            ("", ["a", "b", "c"]),
            ("name desc", ["c", "b", "a"]),
            ("create_time", ["b", "a", "c"]),
            ("create_time desc", ["c", "a", "b"]),
            ("update_time", ["c", "a", "b"]),
            (" update_time  desc , name desc", ["b", "a", "c"]),
        ] {
            let order = ordered_by(order_by).unwrap();
            let mut places = [&a, &b, &c];
            places.sort_by(|a, b| order.compare(a, b));
            assert_eq!(places.map(|place| place.id.as_str()), expected, "{order_by}");
        }
    }

    #[test]
    fn rejects_other_orders() {
        for order_by in [
            "size",
            "name up",
            "name desc desc",
            "name,",
            "name, name desc",
            "Name",
        ] {
            assert_eq!(blamed(ordered_by(order_by)), ["order_by"], "{order_by}");
        }
    }
}
