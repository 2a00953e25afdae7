//! Rigs of hands, from models and from joints at rest.

mod checking;
mod naming;
mod rejecting;
mod skins;

use crate::{ImportError, ImportedRig, MappedJoint, MeshLimits, RigSource, read_rig};
use grasp_assets::hands::hand;
use grasp_synthesis::model::hand::{
    Handedness,
    joints::{HandJoints, JOINT_COUNT, JOINT_NAMES},
    rig::Rig,
};
use serde_json::Value;

const LIMITS: MeshLimits = MeshLimits {
    bytes: 8 << 20,
    vertices: 200_000,
    triangles: 200_000,
};

fn adult(side: Handedness) -> &'static Rig {
    &hand("adult", side).expect("the rig is built in").rig
}

/// The adult's joints at rest, as a client would describe them.
fn adult_at_rest(side: Handedness) -> HandJoints {
    hand("adult", side)
        .expect("the rig is built in")
        .skin
        .bind
        .clone()
}

fn source(joint_map: &[MappedJoint]) -> RigSource<'_> {
    RigSource {
        name: "own",
        reference: adult(Handedness::Right),
        side: None,
        joint_map,
        limits: None,
        width_scale: 1.0,
        radii: [None; JOINT_COUNT],
        is_of_pair: false,
    }
}

/// A GLB with a changed document.
fn edited(glb: &[u8], change: impl FnOnce(&mut Value)) -> Vec<u8> {
    let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    let mut document = serde_json::from_slice(&glb[20..20 + length]).unwrap();
    change(&mut document);
    grasp_characters::glb(&document, glb[28 + length..].to_vec())
}

fn read(glb: &[u8]) -> Result<ImportedRig, Vec<ImportError>> {
    read_rig(glb, source(&[]), LIMITS)
}

fn messages(read: Result<ImportedRig, Vec<ImportError>>) -> Vec<String> {
    read.expect_err("it is wrong")
        .iter()
        .map(ToString::to_string)
        .collect()
}

/// The largest difference of two rigs: of bones' ends and lengths in metres, of directions in radians, and of radii as a share,
/// with what differs most in each.
fn differences(rig: &Rig, expected: &Rig) -> [(f32, String); 3] {
    let mut worst = [(0.0, String::new()), (0.0, String::new()), (0.0, String::new())];
    let mut note = |kind: usize, value: f32, what: String| {
        if value > worst[kind].0 {
            worst[kind] = (value, what);
        }
    };
    note(0, rig.palm.distance(expected.palm), "palm".to_owned());
    note(0, (rig.reach - expected.reach).abs(), "reach".to_owned());
    for (digit, (own, other)) in rig.digits.iter().zip(&expected.digits).enumerate() {
        let (own_base, other_base) = (own.wrist_from_base, other.wrist_from_base);
        note(
            0,
            own_base.position.distance(other_base.position),
            format!("base {digit}"),
        );
        note(
            1,
            own_base.orientation.angle_between(other_base.orientation),
            format!("base {digit}"),
        );
        assert_eq!(own.yaw_sign, other.yaw_sign);
        for link in 0..3 {
            note(
                0,
                (own.lengths[link] - other.lengths[link]).abs(),
                format!("length {digit} {link}"),
            );
            note(
                2,
                (own.diameters[link] / other.diameters[link] - 1.0).abs(),
                format!("diameter {digit} {link}"),
            );
        }
    }
    for (finger, (own, other)) in rig
        .finger_metacarpals
        .iter()
        .zip(expected.finger_metacarpals)
        .enumerate()
    {
        note(0, own.distance(other), format!("metacarpal {finger}"));
    }
    for (joint, (own, other)) in rig.joint_radii.iter().zip(expected.joint_radii).enumerate() {
        note(
            2,
            (own / other - 1.0).abs(),
            format!("radius of {} ({own} for {other})", JOINT_NAMES[joint]),
        );
    }
    worst
}
