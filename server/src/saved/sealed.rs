//! Messages with their SHA-256 before them: any changed or missing byte shows.

use bytes::Bytes;
use prost::Message;
use sha2::{Digest as _, Sha256};

/// Length of the hash before the message.
const HASH_BYTES: usize = 32;

/// What is wrong with a file that should be a sealed message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum Unreadable {
    /// There is no such file.
    #[error("its file is missing")]
    Missing,
    /// Its bytes do not have the hash before them.
    #[error("its SHA-256 does not match its content")]
    Hash,
    /// They are no message of this version.
    #[error("its content is not a record of this version")]
    Message,
    /// They are the record of something else.
    #[error("it has the name of another record")]
    Name,
}

/// A message as bytes.
pub(crate) fn seal(message: &impl Message) -> Bytes {
    let mut bytes = Vec::with_capacity(HASH_BYTES + message.encoded_len());
    bytes.resize(HASH_BYTES, 0);
    message.encode_raw(&mut bytes);
    let hash = Sha256::digest(&bytes[HASH_BYTES..]);
    bytes[..HASH_BYTES].copy_from_slice(&hash);
    bytes.into()
}

/// The message of sealed bytes.
///
/// # Errors
/// The hash is wrong.
pub(crate) fn unsealed(bytes: &[u8]) -> Result<&[u8], Unreadable> {
    let (hash, message) = bytes.split_at_checked(HASH_BYTES).ok_or(Unreadable::Hash)?;
    if Sha256::digest(message).as_slice() == hash {
        Ok(message)
    } else {
        Err(Unreadable::Hash)
    }
}
