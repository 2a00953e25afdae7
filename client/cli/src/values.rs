//! Values of options.

use std::{sync::LazyLock, time::Duration};

use clap::{ValueEnum, builder::PossibleValue};
use glam::Vec3;
use grasp_client::{Digit, GraspChoice, GraspType, Handedness, Strategy, v1::BendRatios};

use crate::format::name_of;

/// Parses a duration such as `250us`, `500ms`, `1.5s` or `2m`; more than 0.
pub(crate) fn parse_duration(text: &str) -> Result<Duration, String> {
    let expected = || format!("{text:?} is not a duration; write for example 500ms, 2s or 1m, more than 0");
    duration(text)
        .filter(|duration| !duration.is_zero())
        .ok_or_else(expected)
}

/// Parses a duration in the same way, or 0 with any unit or none.
pub(crate) fn parse_duration_or_none(text: &str) -> Result<Duration, String> {
    if text == "0" {
        return Ok(Duration::ZERO);
    }
    duration(text).ok_or_else(|| format!("{text:?} is not a duration; write for example 2ms, 1s or 0"))
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
    let numbers: Vec<f32> = text
        .split(',')
        .map(|number| number.trim().parse::<f32>())
        .collect::<Result<_, _>>()
        .map_err(|_| expected())?;
    let [x, y, z] = numbers.try_into().map_err(|_| expected())?;
    Ok(Vec3::new(x, y, z))
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

/// A cone of directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cone {
    /// The axis, of any length.
    pub(crate) direction: Vec3,
    /// Largest angle from the axis.
    pub(crate) half_angle_degrees: f32,
}

/// Parses a cone such as `0,0,-1,45`: a vector and degrees.
pub(crate) fn parse_cone(text: &str) -> Result<Cone, String> {
    let expected = || format!("{text:?} is not a cone; write a direction and degrees, for example 0,0,-1,45");
    let (direction, degrees) = text.rsplit_once(',').ok_or_else(expected)?;
    Ok(Cone {
        direction: parse_vector(direction).map_err(|_| expected())?,
        half_angle_degrees: degrees.trim().parse().map_err(|_| expected())?,
    })
}

/// A place and a turn about the vertical.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Turned {
    /// The place.
    pub(crate) position: Vec3,
    /// The turn.
    pub(crate) degrees: f32,
}

/// Parses a place with a turn such as `0,0,-1,180`: a position and degrees.
pub(crate) fn parse_turned(text: &str) -> Result<Turned, String> {
    let expected =
        || format!("{text:?} is not a place; write a position and degrees, for example 0,0,-1,180");
    let (position, degrees) = text.rsplit_once(',').ok_or_else(expected)?;
    Ok(Turned {
        position: parse_vector(position).map_err(|_| expected())?,
        degrees: degrees.trim().parse().map_err(|_| expected())?,
    })
}

/// Pixels of each of a picture's two views.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ViewSize {
    /// Pixels per row.
    pub(crate) width: u32,
    /// Number of rows.
    pub(crate) height: u32,
}

/// Parses a size such as `900x700`; each side from 16 to 8192 pixels.
pub(crate) fn parse_view_size(text: &str) -> Result<ViewSize, String> {
    let side = |text: &str| {
        text.parse::<u32>()
            .ok()
            .filter(|pixels| (16..=8192).contains(pixels))
    };
    text.split_once('x')
        .and_then(|(width, height)| {
            Some(ViewSize {
                width: side(width)?,
                height: side(height)?,
            })
        })
        .ok_or_else(|| {
            format!("{text:?} is not a size; write for example 900x700, each side from 16 to 8192")
        })
}

/// Triangle indices such as `7` or `10-20`, both ends included.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct TriangleRange(pub(crate) std::ops::RangeInclusive<u32>);

/// Parses an index or a range of indices.
pub(crate) fn parse_triangles(text: &str) -> Result<TriangleRange, String> {
    let expected = || format!("{text:?} is not a triangle index; write for example 7 or the range 10-20");
    let (first, last) = text.split_once('-').unwrap_or((text, text));
    let first: u32 = first.parse().map_err(|_| expected())?;
    let last: u32 = last.parse().map_err(|_| expected())?;
    // A typing error must not exhaust memory: no server accepts a mesh this large.
    if first > last || last - first >= 10_000_000 {
        return Err(expected());
    }
    Ok(TriangleRange(first..=last))
}

/// The ladder of chapter 5 of the thesis, and GUIDED.
#[derive(Clone, Copy, Debug, ValueEnum)]
#[value(rename_all = "UPPER")]
pub(crate) enum StrategyName {
    /// Naive synthesis.
    A,
    /// Placement measures relative to the object.
    B,
    /// Palm-CoM-palm angle.
    C,
    /// Early stop if the thumb has no contact.
    D,
    /// Fewer bend ratios per finger.
    E,
    /// First sufficient force distribution.
    F,
    /// Places hands at opposed surfaces; with physical validity, tries known grasps first.
    Guided,
}

impl From<StrategyName> for Strategy {
    fn from(name: StrategyName) -> Self {
        match name {
            StrategyName::A => Self::A,
            StrategyName::B => Self::B,
            StrategyName::C => Self::C,
            StrategyName::D => Self::D,
            StrategyName::E => Self::E,
            StrategyName::F => Self::F,
            StrategyName::Guided => Self::Guided,
        }
    }
}

impl From<StrategyName> for grasp_synthesis::model::strategy::Strategy {
    fn from(name: StrategyName) -> Self {
        match name {
            StrategyName::A => Self::A,
            StrategyName::B => Self::B,
            StrategyName::C => Self::C,
            StrategyName::D => Self::D,
            StrategyName::E => Self::E,
            StrategyName::F => Self::F,
            StrategyName::Guided => Self::Guided,
        }
    }
}

/// Which valid grasp is returned.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum ChoiceName {
    /// The first one found.
    First,
    /// The best one found within the budget.
    Best,
}

impl From<ChoiceName> for GraspChoice {
    fn from(name: ChoiceName) -> Self {
        match name {
            ChoiceName::First => Self::FirstValid,
            ChoiceName::Best => Self::BestWithinBudget,
        }
    }
}

/// How many of the receiver's hands take the object.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum HandsName {
    /// The receiving hand alone.
    One,
    /// Left and right hand together, for what one hand cannot hold.
    Both,
}

/// The checks that a valid grasp must pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ValidityName {
    /// The checks of the thesis.
    Thesis,
    /// Solid hands, and forces that hold the object.
    Physical,
}

/// The columns of Figure 5.20.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum BendRatiosName {
    /// 0.7, 1 and 1.42 in turn.
    All,
    /// The same, but fingers skip 0.7.
    AllFingersWithoutLow,
    /// One of the three, at random.
    OneRandom,
    /// The same, but fingers skip 0.7.
    OneRandomFingersWithoutLow,
    /// Only 1.
    OnlyOne,
    /// Only 1.42.
    OnlyHigh,
}

impl From<BendRatiosName> for BendRatios {
    fn from(name: BendRatiosName) -> Self {
        match name {
            BendRatiosName::All => Self::All,
            BendRatiosName::AllFingersWithoutLow => Self::AllFingersWithoutLow,
            BendRatiosName::OneRandom => Self::OneRandom,
            BendRatiosName::OneRandomFingersWithoutLow => Self::OneRandomFingersWithoutLow,
            BendRatiosName::OnlyOne => Self::OnlyOne,
            BendRatiosName::OnlyHigh => Self::OnlyHigh,
        }
    }
}

/// The hand to pose.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum HandName {
    /// The left hand.
    Left,
    /// The right hand.
    Right,
    /// The better of both.
    Either,
}

impl From<HandName> for Handedness {
    fn from(name: HandName) -> Self {
        match name {
            HandName::Left => Self::Left,
            HandName::Right => Self::Right,
            HandName::Either => Self::Unspecified,
        }
    }
}

/// Where a receiver is expected to stand.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum StanceName {
    /// Opposite the giver.
    Facing,
    /// Anywhere.
    Any,
}

/// A digit of the hand.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum DigitName {
    /// The thumb.
    Thumb,
    /// The index finger.
    Index,
    /// The middle finger.
    Middle,
    /// The ring finger.
    Ring,
    /// The little finger.
    Little,
}

impl From<DigitName> for Digit {
    fn from(name: DigitName) -> Self {
        match name {
            DigitName::Thumb => Self::Thumb,
            DigitName::Index => Self::Index,
            DigitName::Middle => Self::Middle,
            DigitName::Ring => Self::Ring,
            DigitName::Little => Self::Little,
        }
    }
}

/// A type of the taxonomy, by its name with hyphens, or with spaces or underscores as in answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct GraspTypeName(pub(crate) GraspType);

impl ValueEnum for GraspTypeName {
    fn value_variants<'a>() -> &'a [Self] {
        static ALL: LazyLock<Vec<GraspTypeName>> = LazyLock::new(|| {
            let types = (1..).map_while(|number| GraspType::try_from(number).ok());
            types.map(GraspTypeName).collect()
        });
        &ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        let words = name_of(self.0);
        let aliases = [words.replace(' ', "_"), words.clone()];
        Some(PossibleValue::new(words.replace(' ', "-")).aliases(aliases))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_are_keys_with_or_without_a_value() {
        let of = |key: &str, value: &str| Ok((key.to_owned(), value.to_owned()));
        assert_eq!(parse_label("level=kitchen"), of("level", "kitchen"));
        assert_eq!(parse_label("a=b=c"), of("a", "b=c"));
        assert_eq!(parse_label("fragile"), of("fragile", ""));
        assert!(parse_label("=x").is_err());
    }

    #[test]
    fn zero_is_a_duration_only_where_it_switches_off() {
        assert_eq!(parse_duration_or_none("0"), Ok(Duration::ZERO));
        assert_eq!(parse_duration_or_none("0ms"), Ok(Duration::ZERO));
        assert_eq!(parse_duration_or_none("2ms"), Ok(Duration::from_millis(2)));
        assert!(parse_duration("0ms").is_err());
        for wrong in ["", "-1ms", "5", "1h"] {
            assert!(parse_duration_or_none(wrong).is_err(), "{wrong:?}");
        }
    }

    #[test]
    fn a_turned_place_has_four_numbers() {
        let expected = Turned {
            position: Vec3::new(0.0, -1.0, 0.5),
            degrees: -90.0,
        };
        assert_eq!(parse_turned("0,-1,0.5,-90"), Ok(expected));
        for wrong in ["", "0,0,0", "0,0,0,0,0", "0,0,0,x"] {
            assert!(parse_turned(wrong).is_err(), "{wrong:?}");
        }
    }

    #[test]
    fn accepts_grasp_type_names_of_answers() {
        assert_eq!(GraspTypeName::value_variants().len(), 33);
        for &GraspTypeName(grasp_type) in GraspTypeName::value_variants() {
            let words = name_of(grasp_type);
            for name in [words.replace(' ', "-"), words.replace(' ', "_"), words.clone()] {
                assert_eq!(
                    GraspTypeName::from_str(&name, false),
                    Ok(GraspTypeName(grasp_type))
                );
            }
        }
        for wrong in ["", "unclassifiable", "medium  wrap", "14"] {
            assert!(GraspTypeName::from_str(wrong, false).is_err(), "{wrong:?}");
        }
    }

    #[test]
    fn durations_have_units_and_are_positive() {
        assert_eq!(parse_duration("500ms"), Ok(Duration::from_millis(500)));
        assert_eq!(parse_duration("1.5s"), Ok(Duration::from_millis(1500)));
        assert_eq!(parse_duration("250us"), Ok(Duration::from_micros(250)));
        assert_eq!(parse_duration("2m"), Ok(Duration::from_mins(2)));
        for wrong in [
            "",
            "5",
            "s",
            "-1s",
            "0s",
            "1h",
            "1 s",
            "1e3s",
            "1..2s",
            "NaNs",
            "9999999999999999999999m",
        ] {
            assert!(parse_duration(wrong).is_err(), "{wrong:?}");
        }
    }

    #[test]
    fn vectors_have_three_numbers() {
        assert_eq!(parse_vector("0, 0.5,-2"), Ok(Vec3::new(0.0, 0.5, -2.0)));
        for wrong in ["", "1,2", "1,2,3,4", "a,b,c", "1;2;3"] {
            assert!(parse_vector(wrong).is_err(), "{wrong:?}");
        }
    }

    #[test]
    fn cones_have_a_direction_and_degrees() {
        let cone = Cone {
            direction: Vec3::new(-1.0, 0.5, 0.0),
            half_angle_degrees: 45.0,
        };
        assert_eq!(parse_cone("-1, 0.5,0, 45"), Ok(cone));
        for wrong in ["", "45", "0,0,1", "0,0,1,", "0,0,1,2,3", "x,0,1,45", "0,0,1,wide"] {
            assert!(parse_cone(wrong).is_err(), "{wrong:?}");
        }
    }

    #[test]
    fn sizes_have_two_bounded_sides() {
        let size = ViewSize {
            width: 900,
            height: 700,
        };
        assert_eq!(parse_view_size("900x700"), Ok(size));
        for wrong in [
            "",
            "900",
            "900x",
            "x700",
            "15x700",
            "900x8193",
            "900x700x3",
            "-900x700",
        ] {
            assert!(parse_view_size(wrong).is_err(), "{wrong:?}");
        }
    }

    #[test]
    fn triangles_are_indices_or_ranges() {
        assert_eq!(parse_triangles("7"), Ok(TriangleRange(7..=7)));
        assert_eq!(parse_triangles("10-20"), Ok(TriangleRange(10..=20)));
        for wrong in ["", "-", "20-10", "1-", "x", "0-4294967295"] {
            assert!(parse_triangles(wrong).is_err(), "{wrong:?}");
        }
    }
}
