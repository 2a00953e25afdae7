//! Ids of requests: the client's, or a new one. They are in the answer, in the details of an error and in the log.

use std::{
    hash::{BuildHasher as _, RandomState},
    sync::{
        LazyLock,
        atomic::{AtomicU64, Ordering},
    },
};

use http::{HeaderMap, HeaderName, HeaderValue};

/// Header of requests and answers.
pub(crate) const REQUEST_ID: HeaderName = HeaderName::from_static("x-request-id");

/// Longest id of a client.
const MAX_LENGTH: usize = 64;

/// Tells ids of this process from those of others.
static PROCESS: LazyLock<u64> = LazyLock::new(|| RandomState::new().hash_one(()));

/// Number of ids made by this process.
static MADE: AtomicU64 = AtomicU64::new(0);

/// The id in the headers of a request if it is short and of visible ASCII characters, or a new one.
pub(super) fn request_id(headers: &HeaderMap) -> HeaderValue {
    let is_sound = |id: &&HeaderValue| {
        (1..=MAX_LENGTH).contains(&id.len()) && id.as_bytes().iter().all(u8::is_ascii_graphic)
    };
    headers
        .get(REQUEST_ID)
        .filter(is_sound)
        .cloned()
        .unwrap_or_else(|| {
            let number = MADE.fetch_add(1, Ordering::Relaxed);
            let id = format!("{:016x}-{number:x}", *PROCESS);
            HeaderValue::try_from(id).expect("digits are valid in a header")
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(id: &[u8]) -> HeaderValue {
        let id = HeaderValue::from_bytes(id).unwrap();
        request_id(&HeaderMap::from_iter([(REQUEST_ID, id)]))
    }

    #[test]
    fn a_sound_id_is_kept_and_any_other_replaced_by_a_new_one() {
        for sound in [
            "a",
            "3f2a9c1e-8d57-4b06-9e1b-5a70c4d2f683",
            &"x".repeat(MAX_LENGTH),
        ] {
            assert_eq!(of(sound.as_bytes()), sound);
        }
        let mut new = vec![request_id(&HeaderMap::new())];
        for wrong in [
            &b""[..],
            b"a b",
            b"\ta",
            "é".as_bytes(),
            b"\x80",
            &[b'x'; MAX_LENGTH + 1],
        ] {
            new.push(of(wrong));
        }
        for (place, id) in new.iter().enumerate() {
            assert!(id.len() <= MAX_LENGTH && !new[..place].contains(id), "{id:?}");
        }
    }
}
