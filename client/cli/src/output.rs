//! Results on standard output, text for people and JSON for scripts, and in files. A closed pipe is reported, not a panic.

use std::{
    fs,
    io::{self, Write as _},
    path::Path,
};

use comfy_table::{CellAlignment, ContentArrangement, LineStyle, Table, TableStyle};
use grasp_client::json::to_json;
use prost::{Message, Name};
use serde::Serialize;
use serde_json::Value;

use crate::{Failure, format::joined};

/// A line below the header only: keeps tables compact and easy to paste.
const LINE_BELOW_HEADER: TableStyle =
    TableStyle::new().header_separator(LineStyle::none().fill('─').junction('─'));

/// The form of results.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Output {
    /// True for JSON, false for text.
    pub(crate) json: bool,
}

impl Output {
    /// Writes a message as protobuf's JSON, or as the text that `text` makes of it.
    pub(crate) fn write_message<M: Message + Name>(
        self,
        message: &M,
        text: impl FnOnce(&M) -> String,
    ) -> Result<(), Failure> {
        if self.json {
            write_message(message)
        } else {
            write_line(&text(message))
        }
    }

    /// Writes `value` as JSON, or as the text that `text` makes of it.
    pub(crate) fn write<T: Serialize>(
        self,
        value: &T,
        text: impl FnOnce(&T) -> String,
    ) -> Result<(), Failure> {
        if self.json {
            write_json(value)
        } else {
            write_line(&text(value))
        }
    }
}

/// Writes a message as protobuf's JSON, whatever form is selected.
pub(crate) fn write_message<M: Message + Name>(message: &M) -> Result<(), Failure> {
    write_json(&message_json(message)?)
}

/// Writes a message as one line of protobuf's JSON.
pub(crate) fn write_message_line<M: Message + Name>(message: &M) -> Result<(), Failure> {
    write_line(&message_json(message)?.to_string())
}

/// A message as protobuf's JSON.
pub(crate) fn message_json<M: Message + Name>(message: &M) -> Result<Value, Failure> {
    to_json(message).map_err(|error| Failure::other("cannot write the result as JSON", error))
}

/// Writes `value` as JSON, whatever form is selected.
pub(crate) fn write_json<T: Serialize>(value: &T) -> Result<(), Failure> {
    let text = serde_json::to_string_pretty(value)
        .map_err(|error| Failure::other("cannot write the result as JSON", error))?;
    write_line(&text)
}

/// Writes raw bytes to standard output.
pub(crate) fn write_bytes(bytes: &[u8]) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    let written = out.write_all(bytes).and_then(|()| out.flush());
    written.map_err(Failure::Output)
}

/// Writes a line of text.
pub(crate) fn write_line(text: &str) -> Result<(), Failure> {
    write_bytes(format!("{text}\n").as_bytes())
}

/// Writes a file, creating its folder if necessary.
pub(crate) fn write_file(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty());
    parent
        .map_or(Ok(()), fs::create_dir_all)
        .and_then(|()| fs::write(path, bytes))
        .map_err(|error| Failure::other(format!("cannot write {}", path.display()), error))
}

/// A table with a header of names with " | " in between; a leading `>` aligns a column to the right.
pub(crate) fn table(header: &str) -> Table {
    let header: Vec<&str> = header.split(" | ").collect();
    let mut table = Table::new();
    table
        .load_style(LINE_BELOW_HEADER)
        .set_content_arrangement(ContentArrangement::Dynamic)
        .set_header(header.iter().map(|name| name.trim_start_matches('>')));
    for (name, column) in header.iter().zip(table.column_iter_mut()) {
        if name.starts_with('>') {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    table
}

/// Names and values, one pair per line, with aligned values.
pub(crate) fn pairs(pairs: &[(&str, String)]) -> String {
    let width = pairs.iter().map(|(name, _)| name.len()).max().unwrap_or(0);
    let lines = pairs
        .iter()
        .map(|(name, value)| format!("{name:width$}  {value}"));
    joined("\n", lines)
}
