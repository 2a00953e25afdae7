//! Vertices of seven numbers: `x y z r g b a`, or `x y z w r g b`.
//!
//! Both are in use, and neither is in the OBJ specification. Reading a colour as a weight would distort the mesh, so a
//! file's vertices are judged together: they are colours with alpha, unless the numbers cannot be or the file has other
//! weights.

use super::lines::{Lines, words};
use crate::raw::Occurrences;

/// Least brightest component of colours from 0 to 255; smaller numbers would all be black, and are other quantities.
const DARKEST: f32 = 16.0;

/// How a file's vertices of seven numbers are read.
#[derive(Debug)]
pub(super) struct SevenNumbers {
    /// Whether the fourth number is a weight.
    pub(super) have_weights: bool,
    /// How they were read, if they could be read in another way.
    pub(super) warning: Option<String>,
}

impl SevenNumbers {
    /// Judges all vertices of a text.
    pub(super) fn of(text: &[u8]) -> Self {
        let mut evidence = Evidence::default();
        for (number, line) in Lines::of(text) {
            let mut words = words(&line);
            if words.next() != Some(b"v") {
                continue;
            }
            match words.clone().count() {
                4 => evidence.has_weights_of_four = true,
                7 => {
                    let mut extra = [f32::NAN; 4];
                    for (value, word) in extra.iter_mut().zip(words.skip(3)) {
                        let parsed = std::str::from_utf8(word).ok().and_then(|word| word.parse().ok());
                        *value = parsed.unwrap_or(f32::NAN);
                    }
                    evidence.note(number, extra);
                }
                _ => {}
            }
        }
        evidence.judge()
    }
}

/// What the last four numbers of the vertices have in common.
#[derive(Debug)]
#[expect(clippy::struct_excessive_bools, reason = "each is an observation of its own")]
struct Evidence {
    vertices: Occurrences,
    /// The numbers of the first vertex.
    first: [f32; 4],
    /// Whether another vertex has four numbers, the last of which is a weight.
    has_weights_of_four: bool,
    /// The fourth number is 1.
    fourth_is_one: bool,
    /// The fourth number is positive and finite.
    fourth_is_positive: bool,
    /// The fourth number is the same.
    fourth_is_constant: bool,
    /// The last number is the same.
    last_is_constant: bool,
    /// The fifth and the sixth number equal the last.
    rest_is_constant: bool,
    /// All four are from 0 to 1.
    are_units: bool,
    /// The first three are from 0 to 255, and the last is from 0 to 255 or from 0 to 1.
    are_bytes: bool,
    /// Largest of the first three.
    brightest: f32,
    /// The last three are from 0 to 1.
    last_are_units: bool,
    /// The last three are from 0 to 255.
    last_are_bytes: bool,
}

impl Default for Evidence {
    fn default() -> Self {
        Self {
            vertices: Occurrences::default(),
            first: [1.0; 4],
            has_weights_of_four: false,
            fourth_is_one: true,
            fourth_is_positive: true,
            fourth_is_constant: true,
            last_is_constant: true,
            rest_is_constant: true,
            are_units: true,
            are_bytes: true,
            brightest: 0.0,
            last_are_units: true,
            last_are_bytes: true,
        }
    }
}

impl Evidence {
    fn note(&mut self, line: usize, extra: [f32; 4]) {
        if self.vertices.count == 0 {
            self.first = extra;
        }
        self.vertices.note(line);
        let [fourth, fifth, sixth, last] = extra;
        self.fourth_is_one &= fourth == 1.0;
        self.fourth_is_positive &= fourth > 0.0 && fourth.is_finite();
        self.fourth_is_constant &= fourth == self.first[0];
        self.last_is_constant &= last == self.first[3];
        self.rest_is_constant &= [fifth, sixth] == [last; 2];
        self.are_units &= extra.into_iter().all(is_unit);
        self.are_bytes &= [fourth, fifth, sixth].into_iter().all(is_byte) && (is_byte(last) || is_unit(last));
        self.brightest = self.brightest.max(fourth).max(fifth).max(sixth);
        self.last_are_units &= [fifth, sixth, last].into_iter().all(is_unit);
        self.last_are_bytes &= [fifth, sixth, last].into_iter().all(is_byte);
    }

    fn judge(&self) -> SevenNumbers {
        if self.fourth_is_one {
            // Dividing by 1 changes nothing.
            return SevenNumbers {
                have_weights: false,
                warning: None,
            };
        }
        let can_be_colours = self.are_units || (self.are_bytes && self.brightest >= DARKEST);
        let can_be_weights = self.fourth_is_positive && (self.last_are_units || self.last_are_bytes);
        // As the alpha of opaque colours is, of which some may be brighter than white.
        let is_opaque = (self.first[3] == 1.0 || self.first[3] == 255.0)
            && self.last_is_constant
            && !self.fourth_is_constant
            && !self.rest_is_constant;
        let have_weights = can_be_weights && (self.has_weights_of_four || !(can_be_colours || is_opaque));
        let is_certain = can_be_colours && !can_be_weights;
        SevenNumbers {
            have_weights,
            warning: (!is_certain).then(|| {
                let (read, other) = if have_weights {
                    ("a weight and a colour", "a colour with alpha")
                } else {
                    ("a colour with alpha", "a weight and a colour")
                };
                let Occurrences { count, first } = self.vertices;
                format!(
                    "{count} vertices have seven numbers, read as x y z and {read}, not as x y z and {other}; the first \
                     is on line {first}"
                )
            }),
        }
    }
}

fn is_unit(value: f32) -> bool {
    (0.0..=1.0).contains(&value)
}

fn is_byte(value: f32) -> bool {
    (0.0..=255.0).contains(&value) && value.fract() == 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether vertices with these numbers after x y z have weights, and whether there is a warning.
    fn judged(extras: &[&str]) -> (bool, bool) {
        let lines: Vec<_> = extras.iter().map(|extra| format!("v 1 2 3 {extra}")).collect();
        let read = SevenNumbers::of(lines.join("\n").as_bytes());
        (read.have_weights, read.warning.is_some())
    }

    #[test]
    fn fourth_number_of_1_is_never_ambiguous() {
        assert_eq!(
            judged(&["1 0.5 0.5 0.5", "1 200 100 0", "1 x y z"]),
            (false, false)
        );
    }

    #[test]
    fn colours_are_kept_apart_from_weights() {
        // A weight of 0 is impossible.
        assert_eq!(judged(&["0 0.5 0.5 1", "1 0.5 0.5 1"]), (false, false));
        // Colours up to 255 with an alpha up to 1: no weight has such a colour.
        assert_eq!(judged(&["128 64 32 0.5", "255 0 0 1"]), (false, false));
        assert_eq!(judged(&["0.3 0.4 0.8 1", "0.6 0.2 0.5 1"]), (false, true));
        assert_eq!(judged(&["128 64 32 255", "255 0 0 255"]), (false, true));
        // A colour brighter than white, with an opaque alpha.
        assert_eq!(judged(&["1.5 0.4 0.8 1", "0.6 0.2 0.5 1"]), (false, true));
    }

    #[test]
    fn numbers_beyond_colours_are_weights() {
        assert_eq!(judged(&["2 0.5 0.25 0.75", "1 0.5 0.25 0.75"]), (true, true));
        assert_eq!(judged(&["2 1 1 1", "2 1 1 1"]), (true, true));
        assert_eq!(judged(&["0.5 200 100 7", "0.25 20 10 70"]), (true, true));
        // Another vertex has only a weight.
        assert_eq!(judged(&["0.5 0.2 0.3 0.4", "2"]), (true, true));
    }

    #[test]
    fn neither_colour_nor_weight_is_ignored_with_a_warning() {
        assert_eq!(judged(&["-3 0.5 0.5 0.5", "nan 7 1.5 -2"]), (false, true));
    }
}
