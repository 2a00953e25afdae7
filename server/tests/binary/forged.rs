//! A store with forged files, whose checksums are right: the server starts, in little memory, and serves everything else.

use std::{
    fs,
    time::{Duration, Instant},
};

use grasp_proto::v1::{
    self, grasp_service_client::GraspServiceClient, hand_rig_service_client::HandRigServiceClient,
    object_service_client::ObjectServiceClient,
};
use sha2::{Digest as _, Sha256};
use tonic::Code;

use crate::{
    Folder, Running,
    growth::{channel, memory, mib},
    stress::{hills, mesh},
};

/// Memory that the start may take beyond that without forged files: a few times the largest file.
const MAX_MORE: usize = 160 << 20;

/// Reached only if something hangs.
const HANGS_AFTER: Duration = Duration::from_mins(5);

/// Largest record of an object, in bytes, less a little.
const RECORD: usize = (4 << 20) - 100;

fn varint(mut number: u64) -> Vec<u8> {
    let mut bytes = Vec::new();
    while number >= 0x80 {
        bytes.push(number as u8 | 0x80);
        number >>= 7;
    }
    bytes.push(number as u8);
    bytes
}

/// A field with a content.
fn field(number: u8, content: &[u8]) -> Vec<u8> {
    [&[number << 3 | 2], &varint(content.len() as u64)[..], content].concat()
}

/// As many empty fields as make so many bytes.
fn empty(number: u8, bytes: usize) -> Vec<u8> {
    [number << 3 | 2, 0].repeat(bytes / 2)
}

fn sealed(message: &[u8]) -> Vec<u8> {
    [&Sha256::digest(message)[..], message].concat()
}

/// Files by their paths in the store.
fn forged() -> Vec<(&'static str, Vec<u8>)> {
    let names = field(1, b"ab").repeat(15 << 20);
    vec![
        ("objects/regions", sealed(&field(10, &empty(7, RECORD)))),
        (
            "objects/regions-in-many",
            sealed(&field(10, &empty(7, 1 << 10)).repeat(4000)),
        ),
        ("objects/shapes", sealed(&field(10, &field(7, &empty(6, RECORD))))),
        ("objects/grips", sealed(&field(10, &empty(8, RECORD)))),
        (
            "objects/joints",
            sealed(&field(10, &field(8, &field(3, &empty(12, RECORD))))),
        ),
        ("objects/old-regions", sealed(&field(1, &empty(12, RECORD)))),
        ("objects/many-fields", sealed(&[1 << 3, 1].repeat(RECORD / 2))),
        ("objects/deep", sealed(&vec![10 << 3 | 3; RECORD])),
        (
            "objects/billions",
            sealed(&[&[10 << 3 | 2][..], &varint(u64::MAX / 2)].concat()),
        ),
        ("objects/nothing", Vec::new()),
        ("rigs/hands", sealed(&field(10, &empty(3, 9 << 20)))),
        ("rigs/joints", sealed(&field(10, &field(3, &empty(2, 9 << 20))))),
        ("rigs/nodes", sealed(&field(10, &empty(4, 9 << 20)))),
        ("rigs/old-limits", sealed(&empty(5, 9 << 20))),
        ("rigs/deep", sealed(&vec![10 << 3 | 3; 9 << 20])),
        ("objects.names", sealed(&names)),
        ("rigs.names", sealed(&empty(1, 60 << 20))),
        (
            "atlases/0123456789abcdef0123456789abcdef.atlas",
            vec![0xff; 5 << 20],
        ),
        ("lock", vec![0xff; 1 << 20]),
    ]
}

fn start(folder: &Folder) -> Running {
    Running::start(&[("GRASP_LISTEN", "127.0.0.1:0"), ("GRASP_STORE", folder.path())])
}

#[tokio::test(flavor = "multi_thread")]
async fn forged_files_are_data_loss_by_name_and_take_little_memory() {
    let folder = Folder::absent("forged");
    let server = start(&folder);
    let mut objects = ObjectServiceClient::new(channel(&server.address).await);
    objects
        .create_object(hills("whole", 2))
        .await
        .expect("it is an object");
    let before = memory(&server, "VmHWM:");
    server.terminate();
    // Another record with a number that is none.
    let record = fs::read(folder.0.join("objects/whole")).expect("it is saved");
    let mut message = record[32..].to_vec();
    for (from, to) in [
        (&b"whole"[..], &b"nan-1"[..]),
        (&0.1_f32.to_le_bytes(), &f32::NAN.to_le_bytes()),
    ] {
        let place = message
            .windows(from.len())
            .position(|bytes| bytes == from)
            .expect("it is there");
        message[place..place + from.len()].copy_from_slice(to);
    }
    let mut files = forged();
    files.push(("objects/nan-1", sealed(&message)));
    for (path, bytes) in &files {
        fs::write(folder.0.join(path), bytes).expect("the folder can be written to");
    }

    let begun = Instant::now();
    let server = start(&folder);
    let channel = channel(&server.address).await;
    let mut objects = ObjectServiceClient::new(channel.clone());
    let mut rigs = HandRigServiceClient::new(channel.clone());
    let listed = objects
        .list_objects(v1::ListObjectsRequest::default())
        .await
        .expect("it lists objects");
    let ready = begun.elapsed();
    let listed: Vec<String> = listed
        .into_inner()
        .objects
        .into_iter()
        .map(|object| object.name)
        .collect();
    let listed_rigs = rigs
        .list_rigs(v1::ListRigsRequest::default())
        .await
        .expect("it lists rigs");
    let listed_rigs: Vec<String> = listed_rigs
        .into_inner()
        .rigs
        .into_iter()
        .map(|rig| rig.name)
        .collect();
    for (name, _) in &files {
        let name = (*name).to_owned();
        let status = if name.starts_with("objects/") && name != "objects/nan-1" {
            assert!(listed.contains(&name), "{name}: {listed:?}");
            objects
                .get_object(v1::GetObjectRequest { name: name.clone() })
                .await
                .map(drop)
        } else if name.starts_with("rigs/") {
            assert!(listed_rigs.contains(&name), "{name}: {listed_rigs:?}");
            rigs.get_rig(v1::GetRigRequest { name: name.clone() })
                .await
                .map(drop)
        } else {
            continue;
        };
        assert_eq!(
            status.map_err(|status| status.code()),
            Err(Code::DataLoss),
            "{name}"
        );
    }
    let peak = memory(&server, "VmHWM:");
    let bytes: usize = files.iter().map(|(_, bytes)| bytes.len()).sum();
    println!(
        "{} forged files of {:.0} MiB: ready after {ready:?}, {:.1} MiB at most, {:.1} MiB without them",
        files.len(),
        mib(bytes),
        mib(peak),
        mib(before)
    );
    assert!(peak <= before + MAX_MORE && ready < HANGS_AFTER, "{peak} bytes");
    mesh(&mut objects, "objects/whole".to_owned()).await;
    let mut grasps = GraspServiceClient::new(channel);
    let request = v1::FindGraspRequest::new("objects/nan-1");
    let status = grasps
        .find_grasp(request)
        .await
        .expect_err("its mass is no number");
    assert_eq!(status.code(), Code::FailedPrecondition, "{status:?}");
    server.terminate();
}
