//! No input makes the reader panic, and its results are always consistent.

use crate::{Import, ImportedMesh, MeshLimits, read_mesh};
use glam::DVec3;
use proptest::{
    collection::vec,
    prelude::*,
    test_runner::{RngAlgorithm, RngSeed},
};

use crate::tests::obj::{CUBE, reference};

const SMALL: MeshLimits = MeshLimits {
    bytes: 4096,
    vertices: 200,
    triangles: 300,
};

fn config(cases: u32) -> ProptestConfig {
    ProptestConfig {
        cases,
        failure_persistence: None,
        rng_algorithm: RngAlgorithm::ChaCha,
        rng_seed: RngSeed::Fixed(0x0B1),
        ..ProptestConfig::default()
    }
}

/// Invariants of every accepted mesh.
fn assert_sound(read: &ImportedMesh, limits: MeshLimits) {
    let triangles = read.mesh.triangles().len();
    assert!((1..=limits.triangles).contains(&triangles));
    assert!(read.mesh.positions().len() <= limits.vertices);
    assert_eq!(read.indices_in_file.len(), triangles);
    assert!(read.indices_in_file.is_sorted_by(|a, b| a < b));
    assert!((read.indices_in_file[triangles - 1] as usize) < read.triangles_in_file);
    assert!(read.triangles_in_file <= limits.triangles);
    let mut bits: Vec<_> = read
        .mesh
        .positions()
        .iter()
        .map(|position| position.to_array().map(f32::to_bits))
        .collect();
    bits.sort_unstable();
    bits.dedup();
    assert_eq!(bits.len(), read.mesh.positions().len(), "positions are welded");
    assert!(read.groups.is_sorted_by(|(a, _), (b, _)| a < b));
    for (name, members) in &read.groups {
        assert!(!name.is_empty() && !members.is_empty());
        assert!(members.is_sorted_by(|a, b| a < b));
        assert!((members[members.len() - 1] as usize) < triangles);
    }
}

/// Almost valid lines.
fn statement() -> impl Strategy<Value = String> {
    let number = prop_oneof![
        8 => (-9..9_i32).prop_map(|n| n.to_string()),
        2 => any::<f32>().prop_map(|n| n.to_string()),
        1 => "[0-9.e+-]{0,8}",
        1 => prop::sample::select(vec!["nan", "inf", "1e400", "-0", "1e-45", "\\"]).prop_map(str::to_owned),
    ];
    let index = prop_oneof![
        8 => (-6..9_i64).prop_map(|n| n.to_string()),
        2 => (1..5_i64, any::<i8>()).prop_map(|(v, t)| format!("{v}/{t}/{v}")),
        1 => any::<i64>().prop_map(|n| n.to_string()),
        1 => "[0-9/-]{0,6}",
    ];
    prop_oneof![
        6 => vec(number, 2..5).prop_map(|numbers| format!("v {}", numbers.join(" "))),
        6 => vec(index, 1..7).prop_map(|corners| format!("f {}", corners.join(" "))),
        1 => "(g|o|usemtl|mtllib|vt|vn|p|l|s|#|curv)( [a-c]){0,3}",
    ]
}

/// A well-formed file with everything that reorders or drops triangles.
fn well_formed() -> impl Strategy<Value = String> {
    let name = || prop::sample::select(vec!["a", "b", "c", "d"]);
    // Any triangle of the first twelve vertices, or a convex polygon of the last eight.
    let corners = prop_oneof![
        vec(1..=12_i64, 3..4),
        (
            prop::sample::subsequence((13..=20).collect::<Vec<_>>(), 3..=8),
            any::<bool>()
        )
            .prop_map(|(mut corners, reversed)| {
                if reversed {
                    corners.reverse();
                }
                corners
            }),
    ];
    let line = prop_oneof![
        4 => (corners, any::<bool>()).prop_map(|(corners, backward)| {
            let corners: Vec<_> = corners
                .into_iter()
                .map(|corner| (if backward { corner - 21 } else { corner }).to_string())
                .collect();
            format!("f {}", corners.join(" "))
        }),
        1 => name().prop_map(|name| format!("g {name}")),
        1 => (name(), name()).prop_map(|(a, b)| format!("g {a} {b}")),
        1 => name().prop_map(|name| format!("o {name}")),
        1 => name().prop_map(|name| format!("usemtl {name}")),
    ];
    (vec((-3..3_i32, -3..3_i32, -3..3_i32), 12), vec(line, 1..40)).prop_map(|(vertices, lines)| {
        let vertices = vertices.into_iter().map(|(x, y, z)| format!("v {x} {y} {z}"));
        let octagon = [
            (2, 1),
            (1, 2),
            (-1, 2),
            (-2, 1),
            (-2, -1),
            (-1, -2),
            (1, -2),
            (2, -1),
        ];
        let octagon = octagon.map(|(x, y)| format!("v {x} {y} {}", x - y));
        let text: Vec<String> = vertices.chain(octagon).chain(lines).collect();
        text.join("\n")
    })
}

proptest! {
    #![proptest_config(config(2000))]

    #[test]
    fn survives_arbitrary_bytes(bytes in vec(any::<u8>(), 0..600)) {
        if let Ok(read) = read_mesh(&bytes, Import::METRES, SMALL) {
            assert_sound(&read, SMALL);
        }
    }

    #[test]
    fn survives_almost_valid_text(lines in vec(statement(), 0..40), ending in "\n|\r|\r\n") {
        let text = lines.join(&ending);
        match read_mesh(text.as_bytes(), Import::METRES, SMALL) {
            Ok(read) => assert_sound(&read, SMALL),
            Err(errors) => prop_assert!((1..=17).contains(&errors.len())),
        }
    }

    #[test]
    fn survives_damaged_cube(edits in vec((any::<prop::sample::Index>(), any::<u8>()), 1..6), cut: prop::sample::Index) {
        let mut bytes = CUBE.as_bytes().to_vec();
        for (place, byte) in edits {
            let place = place.index(bytes.len());
            bytes[place] = byte;
        }
        bytes.truncate(cut.index(2 * bytes.len()));
        if let Ok(read) = read_mesh(&bytes, Import::METRES, SMALL) {
            assert_sound(&read, SMALL);
        }
    }

    #[test]
    fn agrees_with_reference_reader(text in well_formed(), unit in 0.001_f32..2.0) {
        let expected = reference::read(&text, unit, DVec3::ZERO);
        if expected.triangles.is_empty() {
            prop_assert!(read_mesh(text.as_bytes(), Import::with_unit(unit), SMALL).is_err());
        } else {
            reference::compare(&text, unit);
        }
    }
}
