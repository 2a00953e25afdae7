//! Records: files with the SHA-256 of a message before it, so that any changed or missing byte shows.

use std::{collections::BTreeSet, fmt, sync::Arc};

use bytes::Bytes;
use object_store::{Error, path::Path};
use prost::Message;
use sha2::{Digest as _, Sha256};

use super::{SavedFiles, StoreError, failed};
use crate::error::ServiceError;

/// Length of the hash before the message.
const HASH_BYTES: usize = 32;

/// Largest file of names, in bytes.
const MAX_NAMES: u64 = 1 << 30;

/// What is wrong with a record.
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
fn unsealed(bytes: &[u8]) -> Result<&[u8], Unreadable> {
    let (hash, message) = bytes.split_at_checked(HASH_BYTES).ok_or(Unreadable::Hash)?;
    if Sha256::digest(message).as_slice() == hash {
        Ok(message)
    } else {
        Err(Unreadable::Hash)
    }
}

/// The records of one kind, each a file `{folder}/{id}`, and a file with the names of all. It is written after a new record, and before one
/// is deleted, so that a name without its record means that the record was lost.
#[derive(Debug)]
pub(crate) struct Records {
    files: Arc<SavedFiles>,
    folder: &'static str,
    max_bytes: u64,
}

/// The names of records.
#[derive(Clone, PartialEq, Message)]
struct Names {
    #[prost(string, repeated, tag = "1")]
    names: Vec<String>,
}

/// The ids of records at the start.
#[derive(Debug)]
pub(crate) struct RecordIds {
    /// All, those of lost records included.
    pub all: BTreeSet<String>,
    /// Those in the file of names.
    pub known: BTreeSet<String>,
    /// Number of files of records.
    pub files: usize,
}

/// A record could not be created.
#[derive(Debug)]
pub(crate) struct NotCreated {
    /// True if nothing is left of it.
    pub is_undone: bool,
}

impl Records {
    /// Those in a folder of files, of up to `max_bytes` each.
    pub(crate) fn new(files: Arc<SavedFiles>, folder: &'static str, max_bytes: u64) -> Self {
        Self {
            files,
            folder,
            max_bytes,
        }
    }

    /// An error of the start.
    pub(crate) fn error(&self, reason: &dyn fmt::Display) -> StoreError {
        self.files.error(reason)
    }

    /// The ids of all records.
    ///
    /// # Errors
    /// They cannot be read.
    pub(crate) async fn ids(&self) -> Result<RecordIds, StoreError> {
        let read = async {
            let files = self.files.list(self.folder).await?;
            let known = self.names().await?;
            Ok::<_, Error>(RecordIds {
                files: files.len(),
                all: files.into_keys().chain(known.iter().cloned()).collect(),
                known,
            })
        };
        read.await.map_err(|error| self.error(&error))
    }

    /// Writes the names of records that had none.
    ///
    /// # Errors
    /// They cannot be written.
    pub(crate) async fn adopt(&self, ids: &RecordIds) -> Result<(), StoreError> {
        if ids.all == ids.known {
            return Ok(());
        }
        let written = self.write_names(ids.all.iter().cloned().collect()).await;
        written.map_err(|error| self.error(&error))
    }

    /// Reads a record, and makes something of its message.
    ///
    /// # Errors
    /// It cannot be read; within, what is wrong with the record.
    pub(crate) async fn read<T>(
        &self,
        id: &str,
        parse: impl FnOnce(&[u8]) -> Result<T, Unreadable>,
    ) -> Result<Result<T, Unreadable>, Error> {
        self.read_file(&self.path(id), self.max_bytes, parse).await
    }

    /// Writes a record, new or in place of another.
    ///
    /// # Errors
    /// [`ServiceError::StoreFailed`].
    pub(crate) async fn write(&self, id: &str, record: Bytes) -> Result<(), ServiceError> {
        let written = self.files.write(&self.path(id), record).await;
        written.map_err(|error| failed(&error))
    }

    /// Writes a new record, and then the names of all; `before` writes what it needs.
    ///
    /// # Errors
    /// Something cannot be written.
    pub(crate) async fn create(
        &self,
        id: &str,
        record: Bytes,
        names: Vec<String>,
        before: impl Future<Output = Result<(), Error>>,
    ) -> Result<(), NotCreated> {
        let path = self.path(id);
        let written = async {
            before.await?;
            self.files.write(&path, record).await?;
            self.write_names(names).await
        };
        let Err(error) = written.await else {
            return Ok(());
        };
        failed(&error);
        // What a write that failed late left must not come back at the next start.
        let undone = self.files.delete(&path).await;
        let is_undone = undone.inspect_err(|error| _ = failed(error)).is_ok();
        Err(NotCreated { is_undone })
    }

    /// Writes the names of all other records, and then deletes this one.
    ///
    /// # Errors
    /// [`ServiceError::StoreFailed`]; then the record is as it was, or the next start adopts it.
    pub(crate) async fn delete(&self, id: &str, mut others: Vec<String>) -> Result<(), ServiceError> {
        let named = self.write_names(others.clone()).await;
        named.map_err(|error| failed(&error))?;
        if let Err(error) = self.files.delete(&self.path(id)).await {
            others.push(id.to_owned());
            let _ = self.write_names(others).await;
            return Err(failed(&error));
        }
        Ok(())
    }

    /// The names that were last written; empty if they never were, or cannot be read.
    async fn names(&self) -> Result<BTreeSet<String>, Error> {
        let parse = |message: &[u8]| Names::decode(message).map_err(|_| Unreadable::Message);
        let file = self.names_path();
        match self.read_file(&file, MAX_NAMES, parse).await? {
            Ok(Names { names }) => Ok(names.into_iter().collect()),
            Err(wrong) => {
                if wrong != Unreadable::Missing {
                    tracing::error!(%file, %wrong, "the names of what is saved are damaged: what is missing will not be missed");
                }
                Ok(BTreeSet::new())
            }
        }
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
        let message = bytes.as_deref().ok_or(Unreadable::Missing).and_then(unsealed);
        Ok(message.and_then(parse))
    }

    fn path(&self, id: &str) -> Path {
        Path::from_iter([self.folder, id])
    }

    fn names_path(&self) -> Path {
        Path::from(format!("{}.names", self.folder))
    }
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
        assert_eq!(Names::decode(unsealed(&bytes).unwrap()), Ok(names));
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
