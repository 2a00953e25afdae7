//! Lists in pages.

use crate::error::ClientError;

/// The token of the page after the one that `token` named; none after the last one.
pub(crate) fn next_token(token: &str, next: String) -> Result<Option<String>, ClientError> {
    if next.is_empty() {
        Ok(None)
    } else if next == token {
        // Following it would never end.
        Err(ClientError::malformed(
            "next_page_token",
            "repeats the token of the previous page",
        ))
    } else {
        Ok(Some(next))
    }
}
