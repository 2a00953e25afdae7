//! Reads Wavefront OBJ text: vertices, faces, and the names in force at these.
//!
//! A scan checks every line and keeps the names; `tobj` then parses its vertices and faces, rewritten in plain form.

use std::{
    fmt::Write,
    io::{self, BufReader, Read},
};

use glam::DVec3;
use grasp_synthesis::base::stop::Stop;

use crate::{
    MAX_COORDINATE_METRES, MeshLimits,
    error::{ImportError, Violations},
    format::foreign,
    parts::FaceNames,
    raw::{Occurrences, Oddity, RawMesh, too_far},
    text::{decode, lines, not_finite, number, parsed, shown, words},
};

/// Largest number of names on one `g` line. Each face belongs to all of them, so this bounds the memory for groups.
const MAX_NAMES_PER_LINE: usize = 16;

/// Faces that `tobj` gets at once: it keeps a hundred bytes for each of them.
const FACES_PER_PIECE: usize = 512;

/// Lines read between two checks whether to stop.
const LINES_PER_CHECK: usize = 1024;

/// Reads OBJ text, in UTF-8 or UTF-16; `unit_metres` is the length of one unit.
pub(crate) fn read(
    bytes: &[u8],
    unit_metres: f32,
    limits: MeshLimits,
    stop: Stop<'_>,
) -> Result<RawMesh, Violations> {
    let (text, warning) = decode(bytes);
    let mut raw = Scanner::default()
        .read(&text, unit_metres, limits, stop)
        .map_err(|errors| foreign(bytes, &text).map_or(errors, Violations::from))?;
    raw.warnings.extend(warning);
    Ok(raw)
}

#[derive(Default)]
struct Scanner {
    raw: RawMesh,
    /// The vertices for `tobj`, each of 3 or 4 numbers.
    vertices: String,
    /// The faces for `tobj`, of indices counted from 1, with an `o` after each piece.
    faces: String,
    /// The number of faces since the last `o`.
    piece: usize,
    /// Which vertices faces use.
    is_used: Vec<bool>,
    violations: Violations,
    /// Vertices of seven numbers whose fourth is not 1, so that it could be a weight.
    coloured: Occurrences,
    /// Vertices with a weight other than 1.
    weighted: Occurrences,
    /// True if a corner refers to a vertex further down.
    looks_ahead: bool,
    groups: Vec<u32>,
    object: Option<u32>,
    material: Option<u32>,
    /// The set of these names; `None` if no face has had them yet.
    names: Option<u32>,
}

impl Scanner {
    /// Reads the text; allocates in proportion to what was read within the limits.
    fn read(
        mut self,
        text: &[u8],
        unit_metres: f32,
        limits: MeshLimits,
        stop: Stop<'_>,
    ) -> Result<RawMesh, Violations> {
        for (number, line) in lines(text) {
            stop.check_every(LINES_PER_CHECK, number)?;
            if let Err(over_limit) = self.line(number, &line, unit_metres, limits) {
                // The rest of the text is unknown.
                self.violations.push(over_limit);
                self.looks_ahead = false;
                break;
            }
        }
        self.finish(stop)
    }

    /// Reads a line; fails if a limit is exceeded.
    fn line(
        &mut self,
        number: usize,
        line: &[u8],
        unit_metres: f32,
        limits: MeshLimits,
    ) -> Result<(), ImportError> {
        let mut words = words(line);
        let Some(keyword) = words.next() else {
            return Ok(());
        };
        match keyword {
            b"v" if self.is_used.len() == limits.vertices => {
                let what = format!("the mesh has more than {} vertices", limits.vertices);
                return Err(ImportError::on_line(number, what));
            }
            b"v" => {
                self.is_used.push(false);
                let read = self.position(number, &words.collect::<Vec<_>>(), unit_metres);
                read.unwrap_or_else(|wrong| self.violations.push(wrong));
            }
            b"f" => self.face(number, words, limits.triangles)?,
            b"p" | b"l" => self.raw.oddities.note(Oddity::FewCorners, number),
            b"g" => self.groups(number, words),
            b"o" => self.object = self.rest_of_line(line, keyword),
            b"usemtl" => self.material = self.rest_of_line(line, keyword),
            // Appearance only.
            b"vt" | b"vn" | b"vp" | b"s" | b"mtllib" => {}
            _ => self.raw.oddities.note(Oddity::UnknownLine, number),
        }
        if matches!(keyword, b"g" | b"o" | b"usemtl") {
            self.names = None;
        }
        Ok(())
    }

    fn position(&mut self, line: usize, words: &[&[u8]], unit_metres: f32) -> Result<(), ImportError> {
        // Three coordinates, then a weight or a colour, which is ignored. Of seven numbers, the last four are a colour with alpha,
        // as several programs write it: taken for a weight, its red would distort the mesh.
        let read = match words.len() {
            3 | 6 | 7 => 3,
            4 => 4,
            found => {
                let what = format!(
                    "a vertex has {found} numbers; it must have 3, 4 with a weight, 6 with a colour, or 7 with a colour and its \
                     alpha or a weight"
                );
                return Err(ImportError::on_line(line, what));
            }
        };
        if words.len() == 7 && words[3] != b"1" {
            self.coloured.note(line);
        }
        let mut numbers = [1.0; 4];
        for (value, word) in numbers.iter_mut().zip(&words[..read]) {
            *value = number(line, word)?;
        }
        let [x, y, z, weight] = numbers;
        let metres = (DVec3::new(x, y, z) / weight).abs().max_element() * f64::from(unit_metres);
        if weight == 0.0 || !metres.is_finite() {
            return Err(not_finite(line, words[read - 1]));
        }
        if metres > MAX_COORDINATE_METRES {
            return Err(ImportError::on_line(line, too_far(metres)));
        }
        if weight != 1.0 {
            self.weighted.note(line);
        }
        let numbers = words[..read].join(&b' ');
        self.vertices
            .extend(["v ", &String::from_utf8_lossy(&numbers), "\n"]);
        Ok(())
    }

    fn face<'a>(
        &mut self,
        line: usize,
        words: impl Iterator<Item = &'a [u8]> + Clone,
        limit: usize,
    ) -> Result<(), ImportError> {
        let corners = words.clone().count();
        if corners < 3 {
            self.raw.oddities.note(Oddity::FewCorners, line);
            return Ok(());
        }
        if self.raw.triangles + corners - 2 > limit {
            let what = format!("the mesh has more than {limit} triangles");
            return Err(ImportError::on_line(line, what));
        }
        self.faces.push('f');
        for word in words {
            let read = self.corner(line, word);
            read.unwrap_or_else(|wrong| self.violations.push(wrong));
        }
        self.piece = (self.piece + 1) % FACES_PER_PIECE;
        self.faces.push_str(if self.piece == 0 { "\no\n" } else { "\n" });
        let names = *self.names.get_or_insert_with(|| {
            self.raw.names.add(FaceNames {
                parts: self.groups.iter().chain(&self.object).copied().collect(),
                material: self.material,
                ..FaceNames::default()
            })
        });
        self.raw.add_face(corners, line, names);
        Ok(())
    }

    /// Writes the vertex of a corner; it may be further down.
    fn corner(&mut self, line: usize, corner: &[u8]) -> Result<(), ImportError> {
        let index = vertex_index(corner).ok_or_else(|| {
            let what =
                "is not a vertex reference; it must be an index, or up to three indices separated by /";
            ImportError::on_line(line, format!("{:?} {what}", shown(corner)))
        })?;
        let known = self.is_used.len();
        let vertex = if index < 0 {
            known.checked_sub(index.unsigned_abs() as usize)
        } else {
            (index as usize).checked_sub(1)
        };
        let vertex = vertex.ok_or_else(|| no_such_vertex(line, index, known))?;
        match self.is_used.get_mut(vertex) {
            Some(is_used) => *is_used = true,
            None => self.looks_ahead = true,
        }
        // Writing to a string cannot fail.
        _ = write!(self.faces, " {}", vertex + 1);
        Ok(())
    }

    fn groups<'a>(&mut self, line: usize, words: impl Iterator<Item = &'a [u8]> + Clone) {
        let found = words.clone().count();
        let names = words.take(MAX_NAMES_PER_LINE).map(String::from_utf8_lossy);
        self.groups = names.map(|name| self.raw.names.intern(&name)).collect();
        if found > MAX_NAMES_PER_LINE {
            let what = format!("{found} group names; at most {MAX_NAMES_PER_LINE} are allowed");
            self.violations.push(ImportError::on_line(line, what));
        }
    }

    /// The name after a keyword; it may contain spaces.
    fn rest_of_line(&mut self, line: &[u8], keyword: &[u8]) -> Option<u32> {
        let name = String::from_utf8_lossy(line.trim_ascii()[keyword.len()..].trim_ascii());
        (!name.is_empty()).then(|| self.raw.names.intern(&name))
    }

    /// Checks all corners once the vertices are known. Their indices are in the text already: a list of those further down would take
    /// several times the memory.
    fn look_ahead(&mut self) {
        let known = self.is_used.len();
        let faces = self.faces.lines().filter_map(|line| line.strip_prefix('f'));
        for (face, corners) in self.raw.faces.iter().zip(faces) {
            let corners = corners.split_ascii_whitespace();
            for index in corners.filter_map(|index| index.parse().ok()) {
                if let Some(is_used) = self.is_used.get_mut(index as usize - 1) {
                    *is_used = true;
                } else {
                    let wrong = no_such_vertex(face.place as usize, index, known);
                    self.violations.push(wrong);
                }
            }
        }
    }

    fn finish(mut self, stop: Stop<'_>) -> Result<RawMesh, Violations> {
        if self.looks_ahead {
            self.look_ahead();
        }
        self.violations.into_result()?;
        let mut raw = self.raw;
        if raw.triangles == 0 {
            return Err(raw.empty().into());
        }
        raw.unused_vertices = self.is_used.iter().filter(|is_used| !**is_used).count();
        (raw.positions, raw.corners) = parse(self.vertices, self.faces, stop)?;
        let mut warn = |Occurrences { count, first }, what: &str| {
            let warning = format!("{count} vertices {what}; the first is on line {first}");
            raw.warnings.extend((count > 0).then_some(warning));
        };
        warn(
            self.coloured,
            "have seven numbers, read as x y z and a colour with alpha, not as x y z and a weight and a colour",
        );
        warn(
            self.weighted,
            "have a weight other than 1, by which their coordinates were divided",
        );
        Ok(raw)
    }
}

/// Parses plain vertices and faces into the positions that faces use, and the corners of all faces.
fn parse(
    mut vertices: String,
    mut faces: String,
    stop: Stop<'_>,
) -> Result<(Vec<DVec3>, Vec<u32>), ImportError> {
    vertices.shrink_to_fit();
    faces.shrink_to_fit();
    let text = vertices.as_bytes().chain(faces.as_bytes());
    // The scan drops references to material libraries; if one got through, it would be rejected, not opened.
    let reject = |_: &std::path::Path| Err(tobj::LoadError::OpenFileFailed);
    // By default, tobj leaves polygons whole.
    let options = tobj::LoadOptions::default();
    let (models, _) = tobj::load_obj_buf(&mut BufReader::new(Stoppable { text, stop }), &options, reject)
        .map_err(|error| match error {
            tobj::LoadError::ReadError => ImportError::Stopped,
            error => ImportError::Whole(format!("the text cannot be read: {error}")),
        })?;
    drop((vertices, faces));
    let sum = |of: fn(&tobj::Mesh) -> usize| models.iter().map(|model| of(&model.mesh)).sum();
    let mut positions = Vec::with_capacity(sum(|mesh| mesh.positions.len() / 3));
    let mut corners = Vec::with_capacity(sum(|mesh| mesh.indices.len()));
    // Pieces have vertices of their own; those that they share are welded later.
    for tobj::Model { mesh, .. } in models {
        let first = positions.len() as u32;
        corners.extend(mesh.indices.iter().map(|index| first + index));
        let (points, _) = mesh.positions.as_chunks();
        positions.extend(points.iter().map(|&point| DVec3::from_array(point)));
    }
    Ok((positions, corners))
}

/// Text that fails to be read once the reader is stopped.
struct Stoppable<'a, R> {
    text: R,
    stop: Stop<'a>,
}

impl<R: Read> Read for Stoppable<'_, R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.stop.check().map_err(io::Error::other)?;
        self.text.read(buffer)
    }
}

fn no_such_vertex(line: usize, index: i64, known: usize) -> ImportError {
    let what =
        format!("vertex {index} does not exist; {known} are known, counted from 1 or backward from -1");
    ImportError::on_line(line, what)
}

/// The vertex index of a corner written as `v`, `v/t`, `v//n` or `v/t/n`; the other indices are only checked.
fn vertex_index(corner: &[u8]) -> Option<i64> {
    let parts: Vec<&[u8]> = corner.splitn(4, |&byte| byte == b'/').collect();
    let is_index = |part: &&[u8]| part.is_empty() || parsed::<i64>(part).is_some();
    let are_indices = parts.len() <= 3 && parts[1..].iter().all(is_index);
    parsed(parts[0]).filter(|_| are_indices)
}
