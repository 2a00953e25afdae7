//! Values of options.

use std::time::Duration;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use glam::Vec3;
use grasp_client::{Handedness, Strategy};
use grasp_scene::RenderOptions;

/// Parses a duration such as `250us`, `500ms`, `1.5s` or `2m`; more than 0.
pub(crate) fn parse_duration(text: &str) -> Result<Duration, String> {
    let expected = || format!("{text:?} is not a duration; write for example 500ms, 2s or 1m, more than 0");
    duration(text)
        .filter(|duration| !duration.is_zero())
        .ok_or_else(expected)
}

fn duration(text: &str) -> Option<Duration> {
    let unit_start = text.find(|c: char| !c.is_ascii_digit() && c != '.')?;
    let (number, unit) = text.split_at(unit_start);
    let seconds_per_unit = match unit {
        "us" => 1e-6,
        "ms" => 1e-3,
        "s" => 1.0,
        "m" => 60.0,
        _ => return None,
    };
    let seconds = number.parse::<f64>().ok()? * seconds_per_unit;
    Duration::try_from_secs_f64(seconds).ok()
}

/// Parses a vector such as `0,0.01,-0.02`.
pub(crate) fn parse_vector(text: &str) -> Result<Vec3, String> {
    let expected = || format!("{text:?} is not a vector; write three numbers, for example 0,0.01,-0.02");
    let numbers = text.split(',').map(|number| number.trim().parse());
    let numbers: Vec<f32> = numbers.collect::<Result<_, _>>().map_err(|_| expected())?;
    let numbers: [f32; 3] = numbers.try_into().map_err(|_| expected())?;
    Ok(numbers.into())
}

/// Parses a label such as `level=kitchen`; without `=`, its value is empty.
pub(crate) fn parse_label(text: &str) -> Result<(String, String), String> {
    let (key, value) = text.split_once('=').unwrap_or((text, ""));
    if key.is_empty() {
        return Err(format!(
            "{text:?} is not a label; write a key and a value, for example level=kitchen"
        ));
    }
    Ok((key.to_owned(), value.to_owned()))
}

/// The full name in a collection, such as "objects/remote", for which "remote" is short.
pub(crate) fn full_name(collection: &str, name: &str) -> String {
    match name.split_once('/') {
        Some((given, _)) if given == collection => name.to_owned(),
        _ => format!("{collection}/{name}"),
    }
}

/// Pixels of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ViewSize {
    /// Pixels per row.
    pub(crate) width: u32,
    /// Number of rows.
    pub(crate) height: u32,
}

impl From<ViewSize> for RenderOptions {
    fn from(ViewSize { width, height }: ViewSize) -> Self {
        Self {
            width,
            height,
            ..Self::default()
        }
    }
}

/// Parses a size such as `900x700`; each side from 16 to 8192 pixels.
pub(crate) fn parse_view_size(text: &str) -> Result<ViewSize, String> {
    let expected = || format!("{text:?} is not a size; write for example 900x700, each side from 16 to 8192");
    let side = |text: &str| match text.parse() {
        Ok(pixels @ 16..=8192) => Ok(pixels),
        _ => Err(expected()),
    };
    let (width, height) = text.split_once('x').ok_or_else(expected)?;
    let (width, height) = (side(width)?, side(height)?);
    Ok(ViewSize { width, height })
}

/// A value that is given by name: the name, the value, and what help pages say about it.
pub(crate) type Choice<T> = (&'static str, T, &'static str);

/// Parses the name of one of some values.
pub(crate) fn one_of<T, const COUNT: usize>(values: [Choice<T>; COUNT]) -> impl TypedValueParser<Value = T>
where
    T: Copy + Send + Sync + 'static,
{
    let names = values.map(|(name, _, help)| PossibleValue::new(name).help(help));
    PossibleValuesParser::new(names).try_map(move |given| {
        let mut values = values.into_iter();
        let named = values.find(|(name, ..)| name.eq_ignore_ascii_case(&given));
        named.map(|(_, value, _)| value).ok_or("it is unknown")
    })
}

/// The ladder of chapter 5 of the thesis, and GUIDED.
pub(crate) const STRATEGIES: [Choice<Strategy>; 7] = [
    ("A", Strategy::A, "Naive synthesis"),
    ("B", Strategy::B, "Placement measures relative to the object"),
    ("C", Strategy::C, "Palm-CoM-palm angle"),
    ("D", Strategy::D, "Early stop if the thumb has no contact"),
    ("E", Strategy::E, "Fewer bend ratios per finger"),
    ("F", Strategy::F, "First sufficient force distribution"),
    (
        "GUIDED",
        Strategy::Guided,
        "Places hands at opposed surfaces; with physical validity, tries known grasps first",
    ),
];

/// The hand to pose.
pub(crate) const HANDS: [Choice<Handedness>; 3] = [
    ("left", Handedness::Left, "The left hand"),
    ("right", Handedness::Right, "The right hand"),
    ("either", Handedness::Unspecified, "The better of both"),
];

#[cfg(test)]
mod tests {
    use std::fmt::Debug;

    use super::*;

    /// A parser accepts these texts, and rejects those that bars separate.
    fn check<T: PartialEq + Debug>(
        parse: impl Fn(&str) -> Result<T, String>,
        accepted: impl IntoIterator<Item = (&'static str, T)>,
        rejected: &str,
    ) {
        for (text, expected) in accepted {
            assert_eq!(parse(text), Ok(expected), "{text:?}");
        }
        for wrong in rejected.split('|') {
            assert!(parse(wrong).is_err(), "{wrong:?}");
        }
    }

    #[test]
    fn collection_of_names_is_optional() {
        assert_eq!(full_name("objects", "remote"), "objects/remote");
        assert_eq!(full_name("objects", "objects/remote"), "objects/remote");
        assert_eq!(full_name("rigs", "objects/remote"), "rigs/objects/remote");
    }

    #[test]
    fn labels_are_keys_with_or_without_a_value() {
        let of = |key: &str, value: &str| (key.to_owned(), value.to_owned());
        let accepted = [
            ("level=kitchen", of("level", "kitchen")),
            ("a=b=c", of("a", "b=c")),
            ("fragile", of("fragile", "")),
        ];
        check(parse_label, accepted, "=x");
    }

    #[test]
    fn durations_have_units_and_are_positive() {
        let accepted = [
            ("500ms", Duration::from_millis(500)),
            ("1.5s", Duration::from_millis(1500)),
            ("250us", Duration::from_micros(250)),
            ("2m", Duration::from_mins(2)),
        ];
        let rejected = "|5|s|-1s|0s|0ms|1h|1 s|1e3s|1..2s|NaNs|9999999999999999999999m";
        check(parse_duration, accepted, rejected);
    }

    #[test]
    fn vectors_have_three_numbers() {
        let accepted = [("0, 0.5,-2", Vec3::new(0.0, 0.5, -2.0))];
        check(parse_vector, accepted, "|1,2|1,2,3,4|a,b,c|1;2;3");
    }

    #[test]
    fn sizes_have_two_bounded_sides() {
        let size = ViewSize {
            width: 900,
            height: 700,
        };
        let rejected = "|900|900x|x700|15x700|900x8193|900x700x3|-900x700";
        check(parse_view_size, [("900x700", size)], rejected);
    }
}
