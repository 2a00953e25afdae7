//! Files of all formats from elsewhere, and damaged ones.

use crate::{
    Import, UpAxis, read_mesh,
    tests::formats::{LIMITS, read, solid::Ring, volume},
};
use proptest::{
    prelude::*,
    test_runner::{Config, RngSeed, TestRunner},
};
use std::{cell::Cell, fs, path::PathBuf};

#[test]
fn all_formats_give_the_same_mesh() {
    let ring = Ring::new();
    let reference = read(&ring.obj()).unwrap();
    assert!(
        (volume(&reference) / Ring::volume() - 1.0).abs() < 1e-5,
        "{}",
        volume(&reference)
    );
    for (name, bytes) in [
        ("text STL", ring.stl_text()),
        ("binary STL", ring.stl_binary()),
        ("text PLY", ring.ply("ascii")),
        ("little-endian PLY", ring.ply("binary_little_endian")),
        ("big-endian PLY", ring.ply("binary_big_endian")),
        ("GLB", ring.glb("")),
    ] {
        let found = read(&bytes).unwrap_or_else(|errors| panic!("{name}: {errors:?}"));
        assert_eq!(found.warnings, [""; 0], "{name}");
        assert_eq!(
            found.mesh.triangles().len(),
            reference.mesh.triangles().len(),
            "{name}"
        );
        for triangle in 0..found.mesh.triangles().len() {
            assert_eq!(
                found.mesh.corners(triangle),
                reference.mesh.corners(triangle),
                "{name}"
            );
        }
        assert_eq!(
            found.mesh.positions().len(),
            reference.mesh.positions().len(),
            "{name}"
        );
    }
}

#[test]
fn files_with_z_up_are_turned() {
    let import = Import {
        up_axis: UpAxis::Z,
        ..Import::with_unit(0.5)
    };
    let found = read_mesh(&Ring::new().stl_binary(), import, LIMITS).unwrap();
    assert!((volume(&found) / (Ring::volume() / 8.0) - 1.0).abs() < 1e-5);
    // The first vertex was (0.04, 0, 0), the ring's axis +Y: it is −Z now.
    let flat = found.mesh.positions().iter().map(|position| position.z.abs());
    assert!((flat.fold(0.0, f32::max) - 0.005).abs() < 1e-6);
}

#[test]
fn files_from_elsewhere_are_read() {
    let root = std::env::var_os("GRASP_TEST_DATA").map_or_else(
        || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data")),
        PathBuf::from,
    );
    // Numbers of triangles as the files' own headers or facets give them.
    for (name, triangles, warning) in [
        ("trimesh_cycloidal.ply", 43_368, None),
        ("trimesh_multibody.stl", 32, Some("disconnected")),
        ("trimesh_soup.stl", 100, Some("open")),
    ] {
        let Ok(bytes) = fs::read(root.join("ugly").join(name)) else {
            eprintln!(
                "SKIPPED: {name} is not in {}; GRASP_TEST_DATA names the folder",
                root.display()
            );
            continue;
        };
        let millimetres = Import::with_unit(1e-3);
        let found =
            read_mesh(&bytes, millimetres, LIMITS).unwrap_or_else(|errors| panic!("{name}: {errors:?}"));
        assert_eq!(found.triangles_in_file, triangles, "{name}");
        if let Some(expected) = warning {
            let warnings = &found.warnings;
            assert!(
                warnings.iter().any(|warning| warning.contains(expected)),
                "{name}: {warnings:?}"
            );
        }
    }
}

/// What is done to a file.
#[derive(Clone, Debug)]
enum Damage {
    /// Only a share of it is left.
    Cut(f64),
    /// Some bytes, at shares of its length, are others.
    Bytes(Vec<(f64, u8)>),
    /// Some bytes of its first 600, where headers are, are others.
    Header(Vec<(usize, u8)>),
}

fn damage() -> impl Strategy<Value = Damage> {
    prop_oneof![
        (0.0..1.0).prop_map(Damage::Cut),
        prop::collection::vec((0.0..1.0, any::<u8>()), 1..8).prop_map(Damage::Bytes),
        prop::collection::vec((0..600_usize, any::<u8>()), 1..4).prop_map(Damage::Header),
    ]
}

#[test]
fn damaged_files_are_read_or_rejected() {
    let ring = Ring::new();
    let files = [
        ring.stl_text(),
        ring.stl_binary(),
        ring.ply("ascii"),
        ring.ply("binary_little_endian"),
        ring.ply("binary_big_endian"),
        ring.glb(r#","scale":[1,2,1]"#),
    ];
    let config = Config {
        cases: 600,
        rng_seed: RngSeed::Fixed(7),
        failure_persistence: None,
        ..Config::default()
    };
    let (accepted, rejected) = (Cell::new(0), Cell::new(0));
    let outcome = TestRunner::new(config).run(&(0..files.len(), damage()), |(file, damage)| {
        let mut bytes = files[file].clone();
        let at = |share: f64| (share * bytes.len() as f64) as usize;
        match damage {
            Damage::Cut(share) => {
                let length = at(share);
                bytes.truncate(length);
            }
            Damage::Bytes(changes) => {
                let changes: Vec<_> = changes
                    .into_iter()
                    .map(|(share, byte)| (at(share), byte))
                    .collect();
                for (place, byte) in changes {
                    bytes[place] = byte;
                }
            }
            Damage::Header(changes) => {
                for (place, byte) in changes {
                    bytes[place] = byte;
                }
            }
        }
        match read(&bytes) {
            Ok(_) => accepted.set(accepted.get() + 1),
            Err(errors) => {
                rejected.set(rejected.get() + 1);
                prop_assert!(!errors.is_empty() && errors.len() <= 17);
                prop_assert!(errors.iter().all(|error| error.to_string().len() < 2000));
            }
        }
        Ok(())
    });
    outcome.unwrap_or_else(|failure| panic!("{failure}"));
    assert!(
        accepted.get() > 50 && rejected.get() > 50,
        "{accepted:?} {rejected:?}"
    );
}
