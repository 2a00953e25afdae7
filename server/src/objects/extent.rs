//! Whether an object is as large as something that is held, and which unit would make it so.

use grasp_synthesis::geometry::mesh::TriangleMesh;

/// Longest edges of a bounding box without a warning, in metres: from a bead to a long pole.
const USUAL: [f32; 2] = [0.002, 5.0];

/// Longest edges of a bounding box that can be used at all, in metres. Within them, squares of the areas of triangles a thousandth
/// as long are normal numbers in single precision, and so is the square of the volume.
const USABLE: [f32; 2] = [1e-6, 1e6];

/// Longest edges of most things that are held, in metres.
const PLAUSIBLE: [f32; 2] = [0.03, 1.0];

/// By what a wrong unit is usually off: micrometres, millimetres, centimetres, inches or decimetres for metres, a unit converted
/// twice, and the contrary.
const USUAL_ERRORS: [f32; 9] = [1e-6, 0.001, 0.01, 0.0254, 0.1, 10.0, 100.0, 1000.0, 1e6];

/// What the warning about an unusual size says after the number.
const UNUSUAL: &str = "m long, which is unusual";

/// A warning about an unusual size, instead of one from before.
///
/// # Errors
/// Why an object of this size cannot be used.
pub(super) fn check_extent(mesh: &TriangleMesh, warnings: &mut Vec<String>) -> Result<(), String> {
    warnings.retain(|warning| !warning.contains(UNUSUAL));
    let extent = mesh.aabb().extents().max_element();
    // The negation also rejects an extent that overflowed.
    if !within(USABLE, extent) {
        let [smallest, largest] = USABLE;
        return Err(format!(
            "is {} m long; it must be {smallest} m to {largest} m: multiply meters_per_unit by what makes it so",
            rounded(extent)
        ));
    }
    if !within(USUAL, extent) {
        let factor = likely_factor(extent);
        warnings.push(format!(
            "the object is {} {UNUSUAL}: is meters_per_unit right? Multiplied by {factor}, it would make the object {} m long",
            rounded(extent),
            rounded(extent * factor)
        ));
    }
    Ok(())
}

/// Checks the size of an object that was created at a usable one.
///
/// # Errors
/// Why an object of this size cannot be used.
pub(super) fn check_resized(mesh: &TriangleMesh) -> Result<(), String> {
    let extent = mesh.aabb().extents().max_element();
    if within(USABLE, extent) {
        return Ok(());
    }
    let [smallest, largest] = USABLE;
    Err(format!(
        "makes the object {} m long; it must be {smallest} m to {largest} m",
        rounded(extent)
    ))
}

/// A length to four digits.
fn rounded(metres: f32) -> f64 {
    let metres = f64::from(metres);
    let scale = 10_f64.powf(3.0 - metres.log10().floor());
    (metres * scale).round() / scale
}

fn within([low, high]: [f32; 2], extent: f32) -> bool {
    (low..=high).contains(&extent)
}

/// The usual error whose correction brings a length nearest to the middle of what is plausible.
fn likely_factor(extent: f32) -> f32 {
    let middle = (PLAUSIBLE[0] * PLAUSIBLE[1]).sqrt();
    let off = |factor: f32| (extent * factor / middle).ln().abs();
    USUAL_ERRORS
        .into_iter()
        .min_by(|&a, &b| off(a).total_cmp(&off(b)))
        .unwrap_or(1.0)
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    fn long(extent: f32) -> Result<Option<String>, String> {
        let corners = vec![Vec3::ZERO, Vec3::X * extent, Vec3::Y * extent];
        let mesh = TriangleMesh::new(corners, vec![[0, 1, 2]]).unwrap();
        let mut warnings = vec!["another".to_owned()];
        // The second check replaces the warning of the first.
        check_extent(&mesh, &mut warnings)?;
        check_extent(&mesh, &mut warnings)?;
        assert!(
            (1..=2).contains(&warnings.len()) && warnings[0] == "another",
            "{warnings:?}"
        );
        Ok(warnings.into_iter().nth(1))
    }

    #[test]
    fn sizes_of_held_things_are_usual() {
        for extent in [0.002, 0.17, 5.0] {
            assert_eq!(long(extent), Ok(None), "{extent}");
        }
    }

    #[test]
    fn warning_names_the_factor_of_the_likely_unit() {
        for (extent, factor, right) in [
            (240.0, 0.001, 0.24),
            (24.0, 0.01, 0.24),
            (7.0, 0.0254, 0.1778),
            (150_000.0, 1e-6, 0.15),
            (0.000_24, 1000.0, 0.24),
            (0.001_5, 100.0, 0.15),
        ] {
            let warning = long(extent).unwrap().unwrap();
            let expected = format!("Multiplied by {factor}, it would make the object {right} m long");
            assert!(warning.contains(&expected), "{warning}");
        }
    }

    #[test]
    fn factor_makes_any_length_plausible_that_a_usual_error_explains() {
        for error in USUAL_ERRORS {
            for true_length in [0.05, 0.1, 0.3] {
                let extent = true_length / error;
                if !within(USUAL, extent) {
                    let right = extent * likely_factor(extent);
                    assert!(within(PLAUSIBLE, right), "{extent}: {right}");
                }
            }
        }
    }

    #[test]
    fn refuses_sizes_at_which_numbers_end() {
        for extent in [9e-7, 1.1e6] {
            let wrong = long(extent).unwrap_err();
            assert!(wrong.contains("it must be 0.000001 m to 1000000 m"), "{wrong}");
        }
    }
}
