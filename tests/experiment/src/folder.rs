//! The folder of a run, with everything made so far: an interrupted run resumes from it.
//!
//! `manifest.json` describes all records; `records.jsonl` has one record per line, each written at once. A truncated last
//! line is dropped.

use std::{
    fs::{self, File, OpenOptions, TryLockError},
    io::{self, BufRead as _, BufReader, Seek as _, Write as _},
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};

use crate::{
    machine::Machine,
    plan::THESIS_RIG,
    record::{Record, Source},
};

/// Format of the records, incremented when they change. Since 2, records may be of sets under another validity or with
/// an atlas; records of 1 are still read.
const FORMAT: u32 = 2;

/// The oldest format that is still read.
const OLDEST_FORMAT: u32 = 1;

const MANIFEST: &str = "manifest.json";
const RECORDS: &str = "records.jsonl";

/// Properties shared by all records of a folder.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    format: u32,
    /// Start of all randomness.
    pub seed: u64,
    /// The receiving hand of the sets under the thesis' validity.
    pub rig: String,
    /// The machine it was measured on.
    pub machine: Machine,
}

impl Manifest {
    /// The manifest of a run on this machine.
    pub fn new(seed: u64) -> Self {
        Self {
            format: FORMAT,
            seed,
            rig: THESIS_RIG.to_owned(),
            machine: Machine::this(),
        }
    }

    /// Differences to a later manifest that keep their records out of one table.
    fn differences(&self, other: &Self) -> Vec<String> {
        let mut differences = Vec::new();
        if !(OLDEST_FORMAT..=other.format).contains(&self.format) {
            differences.push(format!(
                "its format is {}, now it is {}",
                self.format, other.format
            ));
        }
        if self.seed != other.seed {
            differences.push(format!("its seed is {}, now it is {}", self.seed, other.seed));
        }
        if self.rig != other.rig {
            differences.push(format!("its rig is {:?}, now it is {:?}", self.rig, other.rig));
        }
        if !self.machine.is_like(&other.machine) {
            differences.push(format!(
                "it was made on {}, this is {}",
                self.machine, other.machine
            ));
        }
        differences
    }
}

/// Why a folder cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum FolderError {
    /// A file cannot be read or written.
    #[error("cannot {what} {}", path.display())]
    Io {
        /// "read" and so on.
        what: &'static str,
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A file has other contents.
    #[error("{} is not what a run writes (line {line}); give another folder, or start afresh", path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// Where, from 1.
        line: usize,
        /// Why.
        source: serde_json::Error,
    },
    /// There are records without a manifest.
    #[error("{} has {RECORDS} but no {MANIFEST}; give another folder, or start afresh", .0.display())]
    NoManifest(PathBuf),
    /// The folder is another run's.
    #[error(
        "{} belongs to another run: {}; give another folder, or start afresh",
        path.display(),
        differences.join("; ")
    )]
    OtherRun {
        /// The folder.
        path: PathBuf,
        /// All that differs.
        differences: Vec<String>,
    },
    /// Another process writes here.
    #[error("another run is writing to {}", .0.display())]
    Busy(PathBuf),
    /// Another version of the algorithm made the records.
    #[error(
        "{hand} on {holdout}, seed {seed}, in {} ends differently than recorded: the search has changed since; give \
         another folder, or start afresh",
        path.display()
    )]
    Outdated {
        /// The folder.
        path: PathBuf,
        /// The record's holdout.
        holdout: String,
        /// The record's seed.
        seed: u64,
        /// The record's attempt or grip.
        hand: Source,
    },
}

/// An open folder.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    /// Properties shared by all records.
    pub manifest: Manifest,
    records: Vec<Record>,
    /// Locked while the folder is open.
    file: File,
}

impl Folder {
    /// Opens a run's folder, or begins one. With `fresh`, existing records are discarded.
    ///
    /// # Errors
    /// The folder cannot be written, is in use, or belongs to another run.
    pub fn open(path: &Path, manifest: Manifest, fresh: bool) -> Result<Self, FolderError> {
        fs::create_dir_all(path).map_err(failed_to("make", path))?;
        let records_path = path.join(RECORDS);
        let mut file = OpenOptions::new()
            .create(true)
            .truncate(false)
            .read(true)
            .write(true)
            .open(&records_path)
            .map_err(failed_to("open", &records_path))?;
        file.try_lock().map_err(|error| match error {
            TryLockError::WouldBlock => FolderError::Busy(path.to_owned()),
            TryLockError::Error(error) => failed_to("lock", &records_path)(error),
        })?;
        let manifest_path = path.join(MANIFEST);
        let earlier = if fresh {
            None
        } else {
            read_manifest(&manifest_path)?
        };
        let Some(mut earlier) = earlier else {
            let bytes = file
                .metadata()
                .map_err(failed_to("look at", &records_path))?
                .len();
            if bytes > 0 && !fresh {
                return Err(FolderError::NoManifest(path.to_owned()));
            }
            file.set_len(0).map_err(failed_to("empty", &records_path))?;
            write_manifest(&manifest_path, &manifest)?;
            return Ok(Self {
                path: path.to_owned(),
                manifest,
                records: Vec::new(),
                file,
            });
        };
        let differences = earlier.differences(&manifest);
        if !differences.is_empty() {
            return Err(FolderError::OtherRun {
                path: path.to_owned(),
                differences,
            });
        }
        let (records, whole_bytes) = read_records(&records_path, &file)?;
        file.set_len(whole_bytes)
            .and_then(|()| file.seek(io::SeekFrom::End(0)))
            .map_err(failed_to("continue", &records_path))?;
        if earlier.format < FORMAT {
            // Earlier versions would misread records added from now on: the new format makes them reject the folder.
            earlier.format = FORMAT;
            write_manifest(&manifest_path, &earlier)?;
        }
        Ok(Self {
            path: path.to_owned(),
            manifest: earlier,
            records,
            file,
        })
    }

    /// Its path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// All records so far.
    pub fn records(&self) -> &[Record] {
        &self.records
    }

    /// Adds records, which are in the file afterwards.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn add(&mut self, records: Vec<Record>) -> Result<(), FolderError> {
        let mut text = Vec::new();
        for record in &records {
            serde_json::to_writer(&mut text, record)
                .map_err(|error| failed_to("write", &self.path.join(RECORDS))(error.into()))?;
            text.push(b'\n');
        }
        self.file
            .write_all(&text)
            .map_err(failed_to("write", &self.path.join(RECORDS)))?;
        self.records.extend(records);
        Ok(())
    }
}

pub(crate) fn failed_to(what: &'static str, path: &Path) -> impl FnOnce(io::Error) -> FolderError {
    let path = path.to_owned();
    move |source| FolderError::Io { what, path, source }
}

fn write_manifest(path: &Path, manifest: &Manifest) -> Result<(), FolderError> {
    let text = serde_json::to_string_pretty(manifest).unwrap_or_default() + "\n";
    fs::write(path, text).map_err(failed_to("write", path))
}

fn read_manifest(path: &Path) -> Result<Option<Manifest>, FolderError> {
    match fs::read_to_string(path) {
        Ok(text) => serde_json::from_str(&text)
            .map(Some)
            .map_err(|source| FolderError::Malformed {
                path: path.to_owned(),
                line: source.line(),
                source,
            }),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(failed_to("read", path)(error)),
    }
}

/// The records and their length in bytes, without a truncated last line.
fn read_records(path: &Path, file: &File) -> Result<(Vec<Record>, u64), FolderError> {
    let mut reader = BufReader::new(file);
    let mut records = Vec::new();
    let mut whole_bytes = 0;
    let mut line = Vec::new();
    loop {
        line.clear();
        let bytes = reader
            .read_until(b'\n', &mut line)
            .map_err(failed_to("read", path))?;
        if line.last() != Some(&b'\n') {
            return Ok((records, whole_bytes));
        }
        let record = serde_json::from_slice(&line).map_err(|source| FolderError::Malformed {
            path: path.to_owned(),
            line: records.len() + 1,
            source,
        })?;
        records.push(record);
        whole_bytes += bytes as u64;
    }
}
