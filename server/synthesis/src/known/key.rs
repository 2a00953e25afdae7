//! The identity of an atlas: a different object, hand or algorithm makes different grips.

mod algorithm;

use std::fmt::Write as _;

use sha2::{Digest as _, Sha256};

use crate::model::{hand::rig::Rig, plain_object::PlainObject, strategy::Validity};

pub use crate::known::key::algorithm::ALGORITHM;

/// Length of a key in bytes.
pub const KEY_BYTES: usize = 32;

/// Bytes of the key used in a file name: 128 bits do not collide by chance.
const FILE_NAME_BYTES: usize = 16;

/// The SHA-256 of everything that the grips of an object and a hand depend on.
pub fn key(object: &PlainObject, rig: &Rig) -> [u8; KEY_BYTES] {
    let mut hash = Hash(Sha256::new());
    hash.0.update(ALGORITHM.to_le_bytes());
    hash.object(object);
    hash.0.update(rig.content());
    hash.0.finalize().into()
}

/// The file name of the atlas of an object and a hand: hexadecimal digits of the key and ".atlas".
pub fn file_name(object: &PlainObject, rig: &Rig) -> String {
    let mut name = String::with_capacity(2 * FILE_NAME_BYTES + 6);
    for byte in &key(object, rig)[..FILE_NAME_BYTES] {
        // Writing to a string cannot fail.
        let _ = write!(name, "{byte:02x}");
    }
    name + ".atlas"
}

/// Hashes numbers, little-endian.
struct Hash(Sha256);

impl Hash {
    fn count(&mut self, count: u32) {
        self.0.update(count.to_le_bytes());
    }

    fn numbers(&mut self, numbers: impl IntoIterator<Item = f32>) {
        for number in numbers {
            self.0.update(number.to_le_bytes());
        }
    }

    fn object(&mut self, object: &PlainObject) {
        let mesh = &object.mesh;
        self.count(mesh.positions().len() as u32);
        self.count(mesh.triangles().len() as u32);
        for position in mesh.positions() {
            self.numbers(position.to_array());
        }
        for (triangle, corners) in mesh.triangles().iter().enumerate() {
            for &corner in corners {
                self.count(corner);
            }
            self.0.update([u8::from(object.is_forbidden(triangle as u32))]);
        }
        self.numbers([object.mass, object.friction_under(Validity::Physical)]);
        self.numbers(object.centre_of_mass.to_array());
        // Others guide the choice of grips only.
        if object.regions().require_contacts() {
            self.numbers(object.regions().numbers());
        }
    }
}
