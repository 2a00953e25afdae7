//! What is saved of objects, rigs and their names, without the hashes that keep changed bytes from being read; files of tokens, and
//! objects' manifests. The first byte says which.

#![no_main]

use grasp_fuzz::{LONGEST, Target, bounded_as_all, fuzz, words};
use grasp_proto::v1;
use grasp_server::fuzzing::{
    read_object_manifest, read_saved_names, read_saved_object, read_saved_rig, read_tokens,
};
use prost::Message as _;

fn read(input: &[u8]) {
    let Some((&kind, content)) = input.split_first() else {
        return;
    };
    match kind % 5 {
        0 => read_saved_object("bottle", content),
        1 => read_saved_rig(content),
        2 => read_saved_names(content),
        // TOML takes a hundred times its bytes; only operators write it.
        3 | 4 if content.len() > MAX_TOML => {}
        3 => read_tokens(&String::from_utf8_lossy(content)),
        _ => read_object_manifest(content),
    }
}

/// Files of version 0.1.
const OLD_OBJECT: &[u8] = include_bytes!("../../tests/integration/saved_by_0_1/objects/bottle");
const OLD_RIG: &[u8] = include_bytes!("../../tests/integration/saved_by_0_1/rigs/ada");
const NAMES: &[u8] = include_bytes!("../../tests/integration/saved_by_0_1/objects.names");

/// Longest TOML that is read.
const MAX_TOML: usize = 8 << 10;

/// Bytes of the hash before a file's content.
const HASH: usize = 32;

/// The number of an object or a request in its record.
const MAIN: u8 = 10;

const TOKENS: &str = "[studio]\nsha256 = ['0a0a0a0a0a0a0a0a0a0a0a0a0a0a0a0a0a0a0a0a0a0a0a0a0a0a0a0a0a0a0a0a']\nscopes = ['find', 'read', 'write']
shared = false\ncalls_per_second = 5\nsearches = 3\nobjects = 7\nbytes = 100\n['cert:a']\nscopes = ['read']\n";

const MANIFEST: &str = "mass_kg = 0.3\nmeters_per_unit = 0.01\nz_up = true\ncenter_of_mass = [0, 0.01, 0]\nfriction = 0.5\nparts = ['a']
labels = { a = 'b' }\n[[regions]]\nname = 'rim'\npreference = 'preferred'\nweight = 0.5\ngroups = ['base']\ntriangles = [1]
shapes = [{ tube = { points = [[0, 0, 0]], radii = [1] } }, { box = { pose = { position = [0, 0, 0] }, half_extents = [1, 1, 1] } },
{ half_space = { point = [0, 0, 0], normal = [0, 1, 0] } }]\n[[known_grips]]\nname = 'a'\npreference = 'preferred'
hand = { handedness = 'left', rig = 'rigs/adult', convention = 'unity', object_from_wrist = { position = [0, 0, 0] },
thumb = { base_yaw = 0.1, base_pitch = 0.1, second_pitch = 0.1, third_pitch = 0.1 } }\n";

/// A record's fields: a number's key and its bytes.
fn record(fields: &[(u8, &[u8])]) -> Vec<u8> {
    let mut record = Vec::new();
    for (number, content) in fields {
        record.push(number << 3 | 2);
        prost::encode_length_delimiter(content.len(), &mut record).expect("there is room");
        record.extend_from_slice(content);
    }
    record
}

fn seeds() -> Vec<Vec<u8>> {
    let time = Some(prost_types::Timestamp::default());
    let mut request = v1::CreateObjectRequest::new("bottle", Vec::new(), 0.3);
    let object = v1::GraspObject {
        etag: "1-2".to_owned(),
        create_time: time,
        update_time: time,
        regions: vec![v1::Region::new("rim", v1::Preference::Avoided)],
        ..std::mem::take(request.object_mut())
    };
    let object = record(&[
        (2, &[7; 32]),
        (4, &[1; 16]),
        (5, &[2; 32]),
        (MAIN, &object.encode_to_vec()),
    ]);
    let rig = v1::CreateRigRequest::of_model("own", b"{}".to_vec());
    let rig = record(&[(MAIN, &rig.encode_to_vec()), (11, b"studio")]);
    let seeds: [(u8, &[u8]); 7] = [
        (0, &object),
        (0, &OLD_OBJECT[HASH..]),
        (1, &rig),
        (1, &OLD_RIG[HASH..]),
        (2, &NAMES[HASH..]),
        (3, TOKENS.as_bytes()),
        (4, MANIFEST.as_bytes()),
    ];
    seeds.map(|(kind, content)| [&[kind], content].concat()).to_vec()
}

fuzz!(Target {
    read,
    seeds,
    dense: || bounded_as_all([
        [b"\x02", &*b"\x0a\x01a".repeat(1 << 18)].concat(),
        [b"\0", &*b"\x52\0".repeat(1 << 19)].concat()
    ]),
    longest: LONGEST,
    words: || words(
        "sha256 scopes find read write shared calls_per_second searches objects bytes mass_kg meters_per_unit z_up center_of_mass \
         friction regions known_grips labels parts name preference weight triangles groups shapes tube box half_space points radii \
         hand handedness left right convention object_from_wrist position orientation near_distance near_angle forbidden [[ ]] nan inf"
    ),
});
