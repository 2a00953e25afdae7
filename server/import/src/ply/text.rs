//! The body of a PLY file that is text.

use ply_rs_bw::ply::{ElementDef, PropertyType};

use grasp_synthesis::base::stop::Stop;

use super::{Face, INDEX_LISTS, Vertex, axis, cut_off};
use crate::{
    error::{ImportError, Violations},
    obj::lines::{plain_lines, shown, words},
    stoppable::stopped,
};

/// Lines read between two checks whether to stop.
const LINES_PER_CHECK: usize = 1024;

/// The lines of a body that are neither blank nor comments.
pub(super) struct BodyLines<'a> {
    lines: Box<dyn Iterator<Item = &'a [u8]> + 'a>,
    /// The number of the last line that was read.
    number: usize,
    stop: Stop<'a>,
}

/// An element on a line.
#[derive(Debug, Default)]
pub(super) struct Row {
    pub(super) vertex: Vertex,
    pub(super) face: Face,
}

impl<'a> BodyLines<'a> {
    pub(super) fn of(body: &'a [u8], before: usize, stop: Stop<'a>) -> Self {
        Self {
            lines: Box::new(plain_lines(body)),
            number: before,
            stop,
        }
    }

    /// Reads elements of a kind; what is wrong with a line is among the violations.
    pub(super) fn read(
        &mut self,
        element: &ElementDef,
        violations: &mut Violations,
        mut add: impl FnMut(Row) -> Result<(), ImportError>,
    ) -> Result<(), Vec<ImportError>> {
        for _ in 0..element.count {
            let Some(line) = self.next_line()? else {
                return Err(vec![cut_off(element)]);
            };
            match row(element, self.number, line) {
                Ok(row) => add(row).map_err(|error| vec![error])?,
                Err(error) => {
                    violations.push(error);
                    add(Row::default()).map_err(|error| vec![error])?;
                }
            }
        }
        Ok(())
    }

    /// Number of lines that are left.
    pub(super) fn left(mut self) -> Result<usize, Vec<ImportError>> {
        let mut left = 0;
        while self.next_line()?.is_some() {
            left += 1;
        }
        Ok(left)
    }

    fn next_line(&mut self) -> Result<Option<&'a [u8]>, Vec<ImportError>> {
        for line in self.lines.by_ref() {
            self.number += 1;
            self.stop
                .check_every(LINES_PER_CHECK, self.number)
                .map_err(stopped)?;
            let first = words(line).next();
            if first.is_some_and(|word| word != b"comment") {
                return Ok(Some(line));
            }
        }
        Ok(None)
    }
}

/// The element on a line.
fn row(element: &ElementDef, line: usize, text: &[u8]) -> Result<Row, ImportError> {
    let mut words = words(text);
    let mut row = Row::default();
    for property in element.properties.values() {
        let mut next = || {
            let missing = || {
                ImportError::at(
                    format!("line {line}"),
                    format!(
                        "ends before {:?} of element {:?} is complete",
                        property.name, element.name
                    ),
                )
            };
            words.next().ok_or_else(missing)
        };
        let first = next()?;
        match property.data_type {
            PropertyType::Scalar(_) => {
                if let Some(axis) = axis(&property.name) {
                    row.vertex.0[axis] = coordinate(line, first)?;
                }
            }
            PropertyType::List(..) => {
                let count: usize = parsed(first).ok_or_else(|| not_a_number(line, first))?;
                let mut indices = Vec::new();
                for _ in 0..count {
                    indices.push(parsed(next()?));
                }
                if INDEX_LISTS.contains(&property.name.as_str()) {
                    row.face = Face(indices.into_iter().collect());
                }
            }
        }
    }
    Ok(row)
}

fn coordinate(line: usize, word: &[u8]) -> Result<f64, ImportError> {
    match parsed::<f64>(word) {
        Some(number) if number.is_finite() => Ok(number),
        Some(_) => Err(ImportError::NotFinite {
            line,
            text: shown(word),
        }),
        None => Err(not_a_number(line, word)),
    }
}

fn not_a_number(line: usize, word: &[u8]) -> ImportError {
    ImportError::NotANumber {
        line,
        text: shown(word),
    }
}

fn parsed<T: std::str::FromStr>(word: &[u8]) -> Option<T> {
    str::from_utf8(word).ok()?.parse().ok()
}
