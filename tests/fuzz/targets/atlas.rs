//! Atlases: what follows the key, as many grips as there are, without the checksum that keeps changed bytes from being read.

#![no_main]

use std::sync::LazyLock;

use grasp_assets::hands::hand;
use grasp_fuzz::{DENSE_BYTES, LONGEST, Target, bounded_as_all, fuzz};
use grasp_synthesis::{
    known::{
        codec::{decode, encode},
        growth::Growth,
        primitives::Primitive,
    },
    model::hand::Handedness,
    physical::grip::Gripper,
    propose::prepared::{PreparedObject, PreparedRig},
};
use sha2::{Digest as _, Sha256};

/// Bytes before what is fuzzed: mark, format and key; and of the checksum.
const START: usize = 8 + 2 + 32;
const CHECKSUM: usize = 32;

struct Setting {
    object: PreparedObject,
    rig: &'static PreparedRig,
    /// A small atlas.
    atlas: Vec<u8>,
}

static SETTING: LazyLock<Setting> = LazyLock::new(|| {
    let object = PreparedObject::new(Primitive::ALL[10].object().into());
    let rig = &hand("adult", Handedness::Right).expect("the rig is built in").rig;
    let mut growth = Growth::new(&object, rig);
    let mut gripper = Gripper::default();
    while growth.len() < 3 {
        growth.round(&mut gripper);
    }
    let atlas = encode(&growth.grown(), &object, rig);
    Setting { object, rig, atlas }
});

fn read(input: &[u8]) {
    let setting = &*SETTING;
    let mut file = [&setting.atlas[..START], input].concat();
    let checksum = Sha256::digest(&file);
    file.extend_from_slice(&checksum);
    let _ = decode(&file, &setting.object, setting.rig);
}

fn content() -> &'static [u8] {
    let atlas = &SETTING.atlas;
    &atlas[START..atlas.len() - CHECKSUM]
}

/// Bytes of the header after the key.
const HEADER: usize = 1 + 4 + 8 + 8;

fuzz!(Target {
    read,
    seeds: || vec![content().to_vec(), [&[0; HEADER], &content()[HEADER..]].concat()],
    dense: || {
        let (header, grips) = content().split_at(HEADER);
        let times = DENSE_BYTES / grips.len();
        let mut count = [0; 4];
        count.copy_from_slice(&header[1..5]);
        let count = (u32::from_be_bytes(count) * times as u32).to_be_bytes();
        bounded_as_all([[&header[..1], &count, &header[5..], &grips.repeat(times)].concat()])
    },
    longest: LONGEST,
    words: Vec::new,
});
