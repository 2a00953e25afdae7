//! The key of an atlas: everything that determines its grips.

use std::fmt::Write as _;

use sha2::{Digest as _, Sha256};

use super::ALGORITHM;
use crate::model::{hand::rig::Rig, plain_object::PlainObject, strategy::Validity};

/// Length of a key in bytes.
pub(super) const KEY_BYTES: usize = 32;

/// The SHA-256 of everything that the grips of an object and a hand depend on.
pub(super) fn key(object: &PlainObject, rig: &Rig) -> [u8; KEY_BYTES] {
    fn add(hash: &mut Sha256, numbers: &[f32]) {
        for number in numbers {
            hash.update(number.to_le_bytes());
        }
    }
    let mut hash = Sha256::new();
    hash.update(ALGORITHM.to_le_bytes());
    let (positions, triangles) = (object.mesh.positions(), object.mesh.triangles());
    hash.update((positions.len() as u32).to_le_bytes());
    hash.update((triangles.len() as u32).to_le_bytes());
    for position in positions {
        add(&mut hash, &position.to_array());
    }
    for (triangle, corners) in (0..).zip(triangles) {
        for corner in corners {
            hash.update(corner.to_le_bytes());
        }
        hash.update([u8::from(object.is_forbidden(triangle))]);
    }
    add(
        &mut hash,
        &[object.mass, object.friction_under(Validity::Physical)],
    );
    add(&mut hash, &object.centre_of_mass.to_array());
    // Others guide the choice of grips only.
    if object.regions().require_contacts() {
        for number in object.regions().numbers() {
            add(&mut hash, &[number]);
        }
    }
    hash.update(rig.content());
    hash.finalize().into()
}

/// The file name of the atlas of an object and a hand: hexadecimal digits of the key and ".atlas".
pub fn file_name(object: &PlainObject, rig: &Rig) -> String {
    let mut name = String::new();
    // 128 bits do not collide by chance.
    for byte in &key(object, rig)[..KEY_BYTES / 2] {
        // Writing to a string cannot fail.
        let _ = write!(name, "{byte:02x}");
    }
    name + ".atlas"
}
