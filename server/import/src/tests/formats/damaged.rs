//! Damaged files are meshes or errors, never panics.

use std::cell::Cell;

use proptest::{
    prelude::*,
    test_runner::{Config, RngSeed, TestRunner},
};

use crate::tests::formats::{read, solid::Ring};

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
