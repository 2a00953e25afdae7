//! The first pass over OBJ text: enforces limits, collects violations and groups, writes plain text for `tobj`.

use super::{
    MAX_NAMES_PER_LINE,
    lines::{Lines, shown, words},
};
use crate::{
    error::{ImportError, Violations},
    limits::{MAX_COORDINATE_METRES, MeshLimits},
    names::{FaceNames, NameSets},
    raw::Occurrences,
    runs::{Faces, RawFace},
    stoppable::stopped,
};
use grasp_synthesis::base::stop::Stop;

/// Lines read between two checks whether to stop.
const LINES_PER_CHECK: usize = 1024;

/// Result of the first pass.
#[derive(Debug, Default)]
pub(super) struct Scan {
    /// Text for `tobj`: only `v` with 3 or 4 numbers, `f` with positive vertex indices, and an `o` after each piece of faces.
    pub(super) plain: String,
    /// The faces of `plain`.
    pub(super) faces: Faces,
    /// Number of vertices in `plain`.
    pub(super) vertices: usize,
    /// Vertices that no face uses.
    pub(super) unused_vertices: usize,
    /// Points, lines, and faces with fewer than three corners.
    pub(super) without_area: Occurrences,
    /// Lines that start with an unknown keyword.
    pub(super) unknown: Occurrences,
    /// How vertices were read, where that may surprise.
    pub(super) warnings: Vec<String>,
    /// The names of the faces.
    pub(super) names: NameSets,
}

impl Scan {
    /// Scans the text; allocates in proportion to what was read within the limits.
    pub(super) fn of(
        text: &[u8],
        unit_metres: f32,
        limits: MeshLimits,
        stop: Stop<'_>,
    ) -> Result<Self, Vec<ImportError>> {
        let mut scanner = Scanner {
            unit_metres,
            limits,
            scan: Self {
                plain: String::with_capacity(text.len()),
                ..Self::default()
            },
            is_used: Vec::new(),
            triangles: 0,
            faces_of_piece: 0,
            violations: Violations::default(),
            over_limit: false,
            coloured: Occurrences::default(),
            weighted: Occurrences::default(),
            forward: Vec::new(),
            current: Names::default(),
            names_changed: true,
            names_of_faces: 0,
        };
        for (number, line) in Lines::of(text) {
            stop.check_every(LINES_PER_CHECK, number).map_err(stopped)?;
            scanner.line(number, &line);
            if scanner.over_limit {
                break;
            }
        }
        scanner.finish()
    }
}

/// Faces of the plain text that belong together: `tobj` keeps a hundred bytes for each of them until the next `o`.
const FACES_PER_PIECE: usize = 512;

/// The names in force at a line, as indices.
#[derive(Debug, Default)]
struct Names {
    groups: Vec<u32>,
    object: Option<u32>,
    material: Option<u32>,
}

struct Scanner {
    unit_metres: f32,
    limits: MeshLimits,
    scan: Scan,
    /// Which vertices faces use.
    is_used: Vec<bool>,
    /// Number of triangles so far.
    triangles: usize,
    /// Number of faces since the last `o`.
    faces_of_piece: usize,
    violations: Violations,
    /// A limit was exceeded: scanning stopped, and the rest of the text is unknown.
    over_limit: bool,
    /// Vertices of seven numbers whose fourth is not 1, so that it could be a weight.
    coloured: Occurrences,
    /// Vertices with a weight other than 1.
    weighted: Occurrences,
    /// Line and index of corners that refer to a vertex further down.
    forward: Vec<(usize, usize)>,
    current: Names,
    names_changed: bool,
    /// The set of names that faces have from here on.
    names_of_faces: usize,
}

impl Scanner {
    fn line(&mut self, number: usize, line: &[u8]) {
        let mut words = words(line);
        let Some(keyword) = words.next() else {
            return;
        };
        match keyword {
            b"v" => self.vertex(number, &words.collect::<Vec<_>>()),
            b"f" => self.face(number, words),
            b"p" | b"l" => self.scan.without_area.note(number),
            b"g" => self.groups(number, words.map(String::from_utf8_lossy)),
            b"o" => self.current.object = self.rest_of_line(line, keyword),
            b"usemtl" => self.current.material = self.rest_of_line(line, keyword),
            // Appearance only.
            b"vt" | b"vn" | b"vp" | b"s" | b"mtllib" => {}
            _ => self.scan.unknown.note(number),
        }
        self.names_changed |= matches!(keyword, b"g" | b"o" | b"usemtl");
    }

    fn vertex(&mut self, line: usize, numbers: &[&[u8]]) {
        if self.scan.vertices == self.limits.vertices {
            self.over_limit = true;
            let limit = self.limits.vertices;
            return self.violations.push(ImportError::TooManyVertices { line, limit });
        }
        self.scan.vertices += 1;
        // Three coordinates, then a weight or a colour, which is ignored. Of seven numbers, the last four are a colour with alpha,
        // as several programs write it: taken for a weight, its red would distort the mesh.
        let read = match numbers.len() {
            3 | 6 => 3,
            4 => 4,
            7 => {
                if numbers[3] != b"1" {
                    self.coloured.note(line);
                }
                3
            }
            found => {
                return self.violations.push(ImportError::NumberCount { line, found });
            }
        };
        let mut values = [1.0_f64; 4];
        for (value, word) in values.iter_mut().zip(&numbers[..read]) {
            let text = || shown(word);
            match std::str::from_utf8(word)
                .ok()
                .and_then(|word| word.parse::<f64>().ok())
            {
                Some(number) if number.is_finite() => *value = number,
                Some(_) => {
                    return self
                        .violations
                        .push(ImportError::NotFinite { line, text: text() });
                }
                None => {
                    return self
                        .violations
                        .push(ImportError::NotANumber { line, text: text() });
                }
            }
        }
        let [x, y, z, weight] = values;
        let largest = [x, y, z]
            .map(|coordinate| (coordinate / weight * f64::from(self.unit_metres)).abs())
            .into_iter()
            .fold(0.0, f64::max);
        if weight == 0.0 || !largest.is_finite() {
            let text = shown(numbers[read - 1]);
            return self.violations.push(ImportError::NotFinite { line, text });
        }
        if largest > MAX_COORDINATE_METRES {
            let metres = largest;
            return self.violations.push(ImportError::TooFar { line, metres });
        }
        if weight != 1.0 {
            self.weighted.note(line);
        }
        self.scan.plain.push('v');
        self.write_numbers(&numbers[..read]);
    }

    fn face<'a>(&mut self, line: usize, words: impl Iterator<Item = &'a [u8]> + Clone) {
        let corners = words.clone().count();
        if corners < 3 {
            return self.scan.without_area.note(line);
        }
        self.triangles += corners - 2;
        if self.triangles > self.limits.triangles {
            self.over_limit = true;
            let limit = self.limits.triangles;
            return self
                .violations
                .push(ImportError::TooManyTriangles { line, limit });
        }
        if self.faces_of_piece == FACES_PER_PIECE {
            self.scan.plain.push_str("o\n");
            self.faces_of_piece = 0;
        }
        self.faces_of_piece += 1;
        self.scan.plain.push('f');
        for corner in words {
            match vertex_index(corner) {
                None => {
                    let text = shown(corner);
                    self.violations.push(ImportError::NotAnIndex { line, text });
                }
                Some(index) => self.corner(line, index),
            }
        }
        self.scan.plain.push('\n');
        if self.names_changed {
            let Names {
                groups,
                object,
                material,
            } = &self.current;
            self.names_of_faces = self.scan.names.add(FaceNames {
                parts: groups.iter().chain(object).copied().collect(),
                material: *material,
                ..FaceNames::default()
            });
            self.names_changed = false;
        }
        self.scan.faces.push(RawFace {
            place: line,
            corners,
            names: self.names_of_faces,
        });
    }

    /// Writes a corner to the plain text, counted from 1.
    fn corner(&mut self, line: usize, index: i64) {
        let vertices = self.scan.vertices;
        let positive = if index < 0 {
            usize::try_from(index.unsigned_abs())
                .ok()
                .and_then(|back| (vertices + 1).checked_sub(back))
        } else {
            usize::try_from(index).ok()
        };
        let Some(positive) = positive.filter(|&positive| positive > 0) else {
            return self.violations.push(ImportError::IndexOutOfRange {
                line,
                index,
                vertices,
            });
        };
        if positive > vertices {
            self.forward.push((line, positive));
        } else {
            self.is_used.resize(vertices, false);
            self.is_used[positive - 1] = true;
        }
        self.scan.plain.push(' ');
        self.scan.plain.push_str(&positive.to_string());
    }

    fn groups<'a>(&mut self, line: usize, names: impl Iterator<Item = std::borrow::Cow<'a, str>>) {
        self.current.groups.clear();
        let mut found = 0;
        for name in names {
            found += 1;
            if found <= MAX_NAMES_PER_LINE {
                let index = self.scan.names.intern(&name);
                self.current.groups.push(index);
            }
        }
        if found > MAX_NAMES_PER_LINE {
            self.violations.push(ImportError::TooManyNames { line, found });
        }
    }

    /// The name after a keyword; it may contain spaces.
    fn rest_of_line(&mut self, line: &[u8], keyword: &[u8]) -> Option<u32> {
        let line = line.trim_ascii();
        let name = String::from_utf8_lossy(line[keyword.len()..].trim_ascii());
        (!name.is_empty()).then(|| self.scan.names.intern(&name))
    }

    fn write_numbers(&mut self, numbers: &[&[u8]]) {
        for number in numbers {
            self.scan.plain.push(' ');
            // Parsed as a number, so it is ASCII.
            self.scan.plain.push_str(&String::from_utf8_lossy(number));
        }
        self.scan.plain.push('\n');
    }

    fn finish(mut self) -> Result<Scan, Vec<ImportError>> {
        let vertices = self.scan.vertices;
        if self.over_limit {
            self.forward.clear();
        }
        for &(line, index) in self.forward.iter().filter(|(_, index)| *index > vertices) {
            let index = i64::try_from(index).unwrap_or(i64::MAX);
            self.violations.push(ImportError::IndexOutOfRange {
                line,
                index,
                vertices,
            });
        }
        self.violations.into_result()?;
        self.is_used.resize(vertices, false);
        for (_, index) in self.forward {
            self.is_used[index - 1] = true;
        }
        self.scan.unused_vertices = self.is_used.iter().filter(|is_used| !**is_used).count();
        if self.coloured.count > 0 {
            let Occurrences { count, first } = self.coloured;
            self.scan.warnings.push(format!(
                "{count} vertices have seven numbers, read as x y z and a colour with alpha, not as x y z and a weight and a colour; \
                 the first is on line {first}"
            ));
        }
        if self.weighted.count > 0 {
            let Occurrences { count, first } = self.weighted;
            self.scan.warnings.push(format!(
                "{count} vertices have a weight other than 1, by which their coordinates were divided; the first is on \
                 line {first}"
            ));
        }
        Ok(self.scan)
    }
}

/// The vertex index of a corner written as `v`, `v/t`, `v//n` or `v/t/n`; the other indices are only checked.
fn vertex_index(corner: &[u8]) -> Option<i64> {
    let mut parts = std::str::from_utf8(corner).ok()?.split('/');
    let index = parts.next()?.parse().ok()?;
    let mut others = 0;
    for part in parts {
        others += 1;
        if others > 2 || !(part.is_empty() || part.parse::<i64>().is_ok()) {
            return None;
        }
    }
    Some(index)
}
