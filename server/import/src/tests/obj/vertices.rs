//! Vertices with weights and colours.

use crate::ImportedMesh;
use glam::Vec3;

use crate::tests::obj::read;

/// A right triangle with legs of 2 and 1, each corner followed by more numbers.
fn triangle(extras: [&str; 3]) -> ImportedMesh {
    let [a, b, c] = extras;
    read(&format!("v 0 0 0 {a}\nv 2 0 0 {b}\nv 0 1 0 {c}\nf 1 2 3\n")).unwrap()
}

#[test]
fn colours_change_nothing() {
    let plain = triangle([""; 3]);
    for extras in [
        ["1 0 0", "0.5 0.5 0.5", "nan nan nan"],
        ["255 0 0", "128 128 0", "0 0 0"],
        ["1", "1", "1 0.5 0.5 0.5"],
        ["1 0.5 0.5 0.5", "1 0.1 0.1 0.1", "1 200 100 0"],
    ] {
        let coloured = triangle(extras);
        assert_eq!(coloured.mesh, plain.mesh, "{extras:?}");
        assert_eq!(coloured.warnings, plain.warnings, "{extras:?}");
    }
}

#[test]
fn seven_ambiguous_numbers_are_a_colour_with_alpha_and_a_warning() {
    let plain = triangle([""; 3]);
    for extras in [
        ["0.5 0.2 0.8 1", "0.25 0.4 0.3 1", "0.9 0.9 0.9 1"],
        ["0.5 0.2 0.8 0.7", "0.5 0.2 0.8 0.7", "0.5 0.2 0.8 0.7"],
        ["128 64 32 255", "30 64 32 255", "255 64 32 255"],
    ] {
        let coloured = triangle(extras);
        assert_eq!(coloured.mesh, plain.mesh, "{extras:?}");
        assert_eq!(
            coloured.warnings[0],
            "3 vertices have seven numbers, read as x y z and a colour with alpha, not as x y z and a weight and a \
             colour; the first is on line 1"
        );
    }
}

#[test]
fn weights_divide_with_a_warning() {
    let weighted = triangle(["2", "2", ""]);
    assert_eq!(weighted.mesh.corners(0)[1], Vec3::new(1.0, 0.0, 0.0));
    assert_eq!(
        weighted.warnings[0],
        "2 vertices have a weight other than 1, by which their coordinates were divided; the first is on line 1"
    );
}
