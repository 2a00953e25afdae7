//! Checks list requests, and makes page tokens.

use grasp_proto::v1;

use super::{Field, Violations, quoted};
use crate::error::ServiceError;

/// Number of objects on a page if the request gives no size.
const DEFAULT_PAGE_SIZE: usize = 50;

/// Largest number of objects on a page.
const LARGEST_PAGE_SIZE: usize = 1000;

/// Prefix of tokens of this version, so that tokens of other versions are rejected.
const TOKEN_PREFIX: &str = "a1-";

/// A page to list.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct PageQuery {
    /// Number of objects.
    pub size: usize,
    /// The last id of the previous page; none for the first page.
    pub after: Option<String>,
}

/// Checks a list request.
///
/// # Errors
/// [`ServiceError::Invalid`] with every violation.
pub(crate) fn page_query(request: &v1::ListObjectsRequest) -> Result<PageQuery, ServiceError> {
    let mut violations = Violations::default();
    let size = match usize::try_from(request.page_size) {
        Ok(0) => DEFAULT_PAGE_SIZE,
        Ok(size) => size.min(LARGEST_PAGE_SIZE),
        Err(_) => {
            violations.add(
                Field::root("page_size"),
                format_args!("is {}; it must not be negative", request.page_size),
            );
            DEFAULT_PAGE_SIZE
        }
    };
    let after = if request.page_token.is_empty() {
        None
    } else {
        let after = id_of_token(&request.page_token);
        if after.is_none() {
            violations.add(
                Field::root("page_token"),
                format_args!(
                    "is {}; it must be the next_page_token of an earlier response",
                    quoted(&request.page_token)
                ),
            );
        }
        after
    };
    violations.finish(PageQuery { size, after })
}

/// The token of the page after the object with this id.
pub(crate) fn page_token(last_id: &str) -> String {
    use std::fmt::Write as _;
    let mut token = TOKEN_PREFIX.to_owned();
    for byte in last_id.bytes() {
        // Writing to a string cannot fail.
        let _ = write!(token, "{byte:02x}");
    }
    token
}

fn id_of_token(token: &str) -> Option<String> {
    let digits = token.strip_prefix(TOKEN_PREFIX)?;
    if digits.is_empty() || digits.len() % 2 != 0 || !digits.bytes().all(|b| b.is_ascii_hexdigit()) {
        return None;
    }
    let bytes: Option<Vec<u8>> = (0..digits.len())
        .step_by(2)
        .map(|at| u8::from_str_radix(&digits[at..at + 2], 16).ok())
        .collect();
    String::from_utf8(bytes?).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn query(page_size: i32, page_token: &str) -> Result<PageQuery, ServiceError> {
        page_query(&v1::ListObjectsRequest {
            page_size,
            page_token: page_token.to_owned(),
        })
    }

    #[test]
    fn reads_its_own_tokens() {
        let token = page_token("mug-1");
        assert!(!token.contains("mug"));
        assert_eq!(
            query(3, &token).unwrap(),
            PageQuery {
                size: 3,
                after: Some("mug-1".into())
            }
        );
    }

    #[test]
    fn page_size_has_a_default_and_a_maximum() {
        assert_eq!(query(0, "").unwrap().size, 50);
        assert_eq!(query(5000, "").unwrap().size, 1000);
    }

    #[test]
    fn reports_both_fields_at_once() {
        for token in ["x", "a1-", "a1-6", "a1-zz", "a1-ff", "a1-é0", "mug"] {
            let Err(ServiceError::Invalid(violations)) = query(-1, token) else {
                panic!("{token} must be rejected");
            };
            let fields: Vec<_> = violations.iter().map(|v| v.field.as_str()).collect();
            assert_eq!(fields, ["page_size", "page_token"], "{token}");
        }
    }
}
