//! CSV files whose values need no quotes.

use std::{
    fmt::Display,
    fs::File,
    io::{self, BufWriter, Write as _},
    path::Path,
};

/// A row with the names of its columns.
#[derive(Debug, Default)]
pub(crate) struct Row(Vec<(String, String)>);

impl Row {
    pub(crate) fn add(&mut self, column: impl Into<String>, value: impl Display) {
        self.0.push((column.into(), value.to_string()));
    }

    /// Adds a value that may be missing, which leaves its place empty.
    pub(crate) fn add_known(&mut self, column: impl Into<String>, value: Option<impl Display>) {
        let text = value.map_or_else(String::new, |value| value.to_string());
        self.0.push((column.into(), text));
    }
}

/// A file whose rows have the columns of the first.
pub(crate) struct CsvFile {
    out: BufWriter<File>,
    columns: Vec<String>,
}

impl CsvFile {
    pub(crate) fn create(path: &Path) -> io::Result<Self> {
        Ok(Self {
            out: BufWriter::new(File::create(path)?),
            columns: Vec::new(),
        })
    }

    pub(crate) fn write(&mut self, row: Row) -> io::Result<()> {
        let (columns, values): (Vec<_>, Vec<_>) = row.0.into_iter().unzip();
        if self.columns.is_empty() {
            writeln!(self.out, "{}", columns.join(","))?;
            self.columns = columns;
        } else {
            debug_assert_eq!(self.columns, columns, "rows have other columns");
        }
        writeln!(self.out, "{}", values.join(","))
    }

    pub(crate) fn finish(mut self) -> io::Result<()> {
        self.out.flush()
    }
}
