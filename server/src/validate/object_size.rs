//! Checks the size and mass at which an object is held out.

use super::{Field, check_within, object::check_mass};

/// Allowed sizes of an object relative to its mesh.
const OBJECT_SCALES: std::ops::RangeInclusive<f32> = 0.25..=4.0;

/// What a request says about the size of its object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RequestedSize {
    /// Hundredths of the size of its mesh.
    pub hundredths: u16,
    /// Mass in kilograms; none for that of the same material.
    pub mass: Option<f32>,
}

/// The size of the object; that of its mesh if it is wrong.
pub(super) fn object_size(holdout: Field<'_>, scale: Option<f32>, mass: Option<f32>) -> RequestedSize {
    let scale = scale.unwrap_or(1.0);
    check_within(holdout.child("scale"), scale, OBJECT_SCALES);
    if let Some(mass) = mass {
        check_mass(holdout.child("mass_kg"), mass);
    }
    RequestedSize {
        // Saturates for what is wrong.
        hundredths: (100.0 * scale).round() as u16,
        mass,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::validate::testing::read_at;

    fn size(scale: Option<f32>, mass: Option<f32>) -> (RequestedSize, Vec<String>) {
        read_at("holdout", |field| object_size(field, scale, mass))
    }

    #[test]
    fn scales_are_rounded_to_hundredths() {
        for (scale, hundredths) in [
            (None, 100),
            (Some(0.25), 25),
            (Some(1.004), 100),
            (Some(1.006), 101),
            (Some(4.0), 400),
        ] {
            let expected = RequestedSize {
                hundredths,
                mass: None,
            };
            assert_eq!(size(scale, None), (expected, Vec::new()));
        }
    }

    #[test]
    fn scales_and_masses_out_of_range_are_rejected() {
        for wrong in [0.0, -1.0, 0.24, 4.01, f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            assert_eq!(size(Some(wrong), None).1, ["holdout.scale"], "{wrong}");
        }
        for wrong in [0.0, -1.0, 1001.0, f32::NAN, f32::INFINITY] {
            assert_eq!(
                size(Some(5.0), Some(wrong)).1,
                ["holdout.scale", "holdout.mass_kg"],
                "{wrong}"
            );
        }
    }
}
