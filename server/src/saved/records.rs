//! Records: files with the SHA-256 of a message before it, so that any changed or missing byte shows.

use std::{
    collections::{BTreeMap, BTreeSet},
    fmt, iter,
    sync::Arc,
};

use bytes::Bytes;
use grasp_proto::is_too_large_decoded;
use object_store::{Error, path::Path};
use prost::{Message, Name, decode_length_delimiter, encode_length_delimiter};
use sha2::{Digest as _, Sha256};

use super::{SavedFiles, StoreError, log_failure};

/// Length of the hash before the message.
const HASH_BYTES: usize = 32;

/// Most names in a file of names: as many as a server can be configured to keep.
const MAX_NAMES: usize = 1_000_000;

/// Longest name, in bytes.
const MAX_NAME: usize = 63;

/// Largest file of names, in bytes: each with the number of its field and its length.
const MAX_NAMES_BYTES: u64 = (MAX_NAMES * (MAX_NAME + 2) + HASH_BYTES) as u64;

/// Why a record cannot be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum Unreadable {
    #[error("its file is missing")]
    Missing,
    #[error("its file has more bytes than the server's limits allow")]
    Size,
    #[error("its SHA-256 does not match its content")]
    Hash,
    #[error("its content is not a record of this version")]
    Message,
    #[error("it has the name of another record")]
    Name,
}

pub(crate) fn seal(message: &impl Message) -> Bytes {
    let mut bytes = Vec::with_capacity(HASH_BYTES + message.encoded_len());
    bytes.resize(HASH_BYTES, 0);
    message.encode_raw(&mut bytes);
    let hash = Sha256::digest(&bytes[HASH_BYTES..]);
    bytes[..HASH_BYTES].copy_from_slice(&hash);
    bytes.into()
}

/// The message of sealed bytes.
fn unsealed(bytes: &[u8]) -> Result<&[u8], Unreadable> {
    let parts = bytes.split_at_checked(HASH_BYTES);
    let whole = parts.filter(|(hash, message)| Sha256::digest(message).as_slice() == *hash);
    whole.map(|(_, message)| message).ok_or(Unreadable::Hash)
}

/// The records of one kind, each a file `{folder}/{id}`, and a file with the names of all. It is written after a new record, and before one
/// is deleted, so that a name without its record means that the record was lost.
#[derive(Debug)]
pub(crate) struct Records {
    files: Arc<SavedFiles>,
    folder: &'static str,
    max_bytes: u64,
}

#[derive(Clone, PartialEq, Message)]
struct Names {
    #[prost(string, repeated, tag = "1")]
    names: Vec<String>,
}

/// The names of a message, read one by one: a forged message takes no more memory than a right one.
pub(crate) fn names_of(mut message: &[u8]) -> Option<BTreeSet<String>> {
    let mut names = BTreeSet::new();
    while !message.is_empty() {
        let field = take_field(&mut message)?;
        let is_name =
            (field.number, field.wire_type) == (1, 2) && (1..=MAX_NAME).contains(&field.content.len());
        if !is_name || names.len() == MAX_NAMES {
            return None;
        }
        names.insert(str::from_utf8(field.content).ok()?.to_owned());
    }
    Some(names)
}

#[derive(Debug)]
pub(crate) struct RecordIds {
    /// All ids, those of lost records included.
    pub all: BTreeSet<String>,
    /// The ids in the file of names.
    pub known: BTreeSet<String>,
    /// Number of files of records.
    pub files: usize,
}

/// A record could not be created.
#[derive(Debug)]
pub(crate) struct CreateFailure {
    /// True if nothing is left of it.
    pub is_undone: bool,
}

impl Records {
    /// Records of up to `max_bytes` each.
    pub(crate) fn new(files: Arc<SavedFiles>, folder: &'static str, max_bytes: u64) -> Self {
        Self {
            files,
            folder,
            max_bytes,
        }
    }

    pub(crate) fn error(&self, reason: &dyn fmt::Display) -> StoreError {
        self.files.error(reason)
    }

    pub(crate) async fn ids(&self) -> Result<RecordIds, StoreError> {
        let failed = |error| self.error(&error);
        let files = self.files.list(self.folder).await.map_err(failed)?;
        let known = self.names().await.map_err(failed)?;
        Ok(RecordIds {
            files: files.len(),
            all: files.into_keys().chain(known.iter().cloned()).collect(),
            known,
        })
    }

    /// Writes the names of records that had none.
    pub(crate) async fn adopt(&self, ids: &RecordIds) -> Result<(), StoreError> {
        if ids.all == ids.known {
            return Ok(());
        }
        let written = self.write_names(ids.all.iter().cloned().collect()).await;
        written.map_err(|error| self.error(&error))
    }

    /// Reads a record, and parses its message. The inner error is why the record cannot be read.
    pub(crate) async fn read<T>(
        &self,
        id: &str,
        parse: impl FnOnce(&[u8]) -> Result<T, Unreadable>,
    ) -> Result<Result<T, Unreadable>, Error> {
        self.read_file(&self.path(id), self.max_bytes, parse).await
    }

    /// Writes a record, new or in place of another.
    pub(crate) async fn write(&self, id: &str, record: Bytes) -> Result<(), Error> {
        self.files.write(&self.path(id), record).await
    }

    /// Writes a new record, and then the names of all.
    pub(crate) async fn create(
        &self,
        id: &str,
        record: Bytes,
        names: Vec<String>,
    ) -> Result<(), CreateFailure> {
        let mut written = self.write(id, record).await;
        if written.is_ok() {
            written = self.write_names(names).await;
        }
        let Err(error) = written else { return Ok(()) };
        log_failure(&error);
        // A write that failed late may have left a file, which must not come back at the next start.
        let undone = self.files.delete(&self.path(id)).await;
        let is_undone = undone.inspect_err(log_failure).is_ok();
        Err(CreateFailure { is_undone })
    }

    /// Writes the names of all other records, and then deletes this one. After an error, the record is as it was, or the next start
    /// adopts it.
    pub(crate) async fn delete(&self, id: &str, mut others: Vec<String>) -> Result<(), Error> {
        self.write_names(others.clone()).await?;
        let deleted = self.files.delete(&self.path(id)).await;
        if deleted.is_err() {
            others.push(id.to_owned());
            let _ = self.write_names(others).await;
        }
        deleted
    }

    /// The names that were last written; empty if they never were, or cannot be read.
    async fn names(&self) -> Result<BTreeSet<String>, Error> {
        let parse = |message: &[u8]| names_of(message).ok_or(Unreadable::Message);
        let file = self.names_path();
        let read = self.read_file(&file, MAX_NAMES_BYTES, parse).await?;
        if let Err(wrong) = read
            && wrong != Unreadable::Missing
        {
            tracing::error!(%file, %wrong, "the names of what is saved are damaged: what is missing will not be missed");
        }
        Ok(read.unwrap_or_default())
    }

    async fn write_names(&self, names: Vec<String>) -> Result<(), Error> {
        self.files.write(&self.names_path(), seal(&Names { names })).await
    }

    async fn read_file<T>(
        &self,
        path: &Path,
        max_bytes: u64,
        parse: impl FnOnce(&[u8]) -> Result<T, Unreadable>,
    ) -> Result<Result<T, Unreadable>, Error> {
        let bytes = self.files.read(path, max_bytes).await?;
        Ok(bytes.and_then(|bytes| parse(unsealed(&bytes)?)))
    }

    fn path(&self, id: &str) -> Path {
        Path::from_iter([self.folder, id])
    }

    fn names_path(&self) -> Path {
        Path::from(format!("{}.names", self.folder))
    }
}

/// The new place of a field of an old message.
#[derive(Debug)]
pub(crate) struct FieldMove {
    /// Its old number. Several moves of one number are for its first value, its second and so on.
    old: usize,
    /// Its new path: the numbers of the enclosing messages, and its own. Empty: its fields become fields of the whole message.
    now: &'static [usize],
    /// Its own fields, if they moved.
    fields: &'static [FieldMove],
}

pub(crate) const fn field(old: usize, now: &'static [usize]) -> FieldMove {
    message(old, now, &[])
}

pub(crate) const fn message(old: usize, now: &'static [usize], fields: &'static [FieldMove]) -> FieldMove {
    FieldMove { old, now, fields }
}

/// A field of a message as it was written.
struct WrittenField<'m> {
    number: usize,
    wire_type: usize,
    /// The content of a message, text or bytes; of a number, nothing or its bytes.
    content: &'m [u8],
    /// All but the number and the type.
    value: &'m [u8],
}

/// Takes the first field off a message. `None` if it is not a message.
fn take_field<'m>(message: &mut &'m [u8]) -> Option<WrittenField<'m>> {
    let key = decode_length_delimiter(&mut *message).ok()?;
    let mut rest = *message;
    let length = match key & 7 {
        0 => decode_length_delimiter(&mut rest).map(|_| 0).ok()?,
        1 => 8,
        5 => 4,
        _ => decode_length_delimiter(&mut rest).ok()?,
    };
    let (content, rest) = rest.split_at_checked(length)?;
    let value = &message[..message.len() - rest.len()];
    *message = rest;
    Some(WrittenField {
        number: key >> 3,
        wire_type: key & 7,
        content,
        value,
    })
}

/// True if a record has one message of this type at most, in the field `number`, which is small enough in memory to be decoded.
pub(crate) fn is_decodable<M: Name>(record: &[u8], number: usize) -> bool {
    let mut contents = contents(record, number);
    let is_small = contents
        .next()
        .is_none_or(|content| !is_too_large_decoded::<M>(content));
    is_small && contents.next().is_none()
}

/// The contents of a message's fields of this number, up to the first that is not one.
fn contents(mut message: &[u8], number: usize) -> impl Iterator<Item = &[u8]> {
    let fields = iter::from_fn(move || take_field(&mut message));
    fields
        .filter(move |field| field.number == number)
        .map(|field| field.content)
}

/// A message with its fields in their new places. `None` if it is not a message.
pub(crate) fn move_fields(mut old: &[u8], moves: &[FieldMove]) -> Option<Vec<u8>> {
    let (mut now, mut counts) = (Vec::new(), BTreeMap::<usize, usize>::new());
    while !old.is_empty() {
        let field = take_field(&mut old)?;
        let count = counts.entry(field.number).or_default();
        *count += 1;
        let places = moves.iter().filter(|to| to.old == field.number);
        let Some(place) = places.take(*count).last() else {
            continue;
        };
        let inner;
        let mut content = field.content;
        let mut value = field.value.to_vec();
        if !place.fields.is_empty() {
            inner = move_fields(content, place.fields)?;
            content = &inner;
            value = [&varint(content.len()), content].concat();
        }
        let [outer @ .., own] = place.now else {
            now.extend(content);
            continue;
        };
        value.splice(0..0, varint((own << 3) | field.wire_type));
        for number in outer.iter().rev() {
            value = [varint((number << 3) | 2), varint(value.len()), value].concat();
        }
        now.extend(value);
    }
    Some(now)
}

fn varint(number: usize) -> Vec<u8> {
    let mut bytes = Vec::new();
    encode_length_delimiter(number, &mut bytes).expect("a vector has room");
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_changed_cut_or_added_byte_is_found() {
        let names = Names {
            names: vec!["mug".to_owned(), "a longer name".to_owned()],
        };
        let bytes = seal(&names);
        assert_eq!(
            names_of(unsealed(&bytes).unwrap()),
            Some(names.names.into_iter().collect())
        );
        for place in 0..bytes.len() {
            for flipped in [0x01, 0x80, 0xff] {
                let mut damaged = bytes.to_vec();
                damaged[place] ^= flipped;
                assert_eq!(unsealed(&damaged), Err(Unreadable::Hash), "byte {place}");
            }
            assert_eq!(unsealed(&bytes[..place]), Err(Unreadable::Hash), "{place}");
        }
        assert_eq!(unsealed(&[&bytes[..], &[0]].concat()), Err(Unreadable::Hash));
    }
}
