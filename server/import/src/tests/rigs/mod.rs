//! Rigs of hands, from models and from joints at rest.

mod naming;
mod odd_models;
mod skins;

use crate::{ImportError, ImportedRig, MappedJoint, RigSource, read_rig, tests::LIMITS};
use grasp_assets::hands::hand;
use grasp_characters::{Character, Style};
use grasp_synthesis::model::hand::{
    Handedness,
    joints::{HandJoints, JOINT_COUNT, JOINT_NAMES},
    rig::Rig,
};
use serde_json::Value;

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
        limits: adult(Handedness::Right)
            .digits
            .each_ref()
            .map(|digit| digit.limits),
        width_scale: 1.0,
        radii: [None; JOINT_COUNT],
        is_of_pair: false,
    }
}

/// The document of a GLB, and its buffer.
fn opened(glb: &[u8]) -> (Value, Vec<u8>) {
    let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    let document = serde_json::from_slice(&glb[20..20 + length]).unwrap();
    (document, glb[28 + length..].to_vec())
}

/// A GLB with a changed document.
fn edited(glb: &[u8], change: impl FnOnce(&mut Value)) -> Vec<u8> {
    let (mut document, buffer) = opened(glb);
    change(&mut document);
    grasp_characters::glb(&document, buffer)
}

fn read(glb: &[u8]) -> Result<ImportedRig, Vec<ImportError>> {
    read_rig(glb, source(&[]), LIMITS)
}

/// A character with the nodes' names of a program.
fn named(name: Name) -> Style {
    Style { name, ..Style::PLAIN }
}

/// The name of a joint's node.
type Name = fn(Handedness, usize) -> Option<String>;

/// The model of a character whose nodes have the names of a program.
fn model(name: Name) -> Vec<u8> {
    Character::new(&named(name)).glb
}

/// The largest differences of two rigs, with what differs most.
struct Differences {
    /// Of bones' ends and lengths, in metres.
    places: (f32, String),
    /// In radians.
    directions: (f32, String),
    /// Of radii, as a share.
    radii: (f32, String),
}

impl Differences {
    #[track_caller]
    fn assert_below(&self, [places, directions, radii]: [f32; 3], of: &str) {
        assert!(self.places.0 < places, "{of}: {:?}", self.places);
        assert!(self.directions.0 < directions, "{of}: {:?}", self.directions);
        assert!(self.radii.0 < radii, "{of}: {:?}", self.radii);
    }
}

fn differences(rig: &Rig, expected: &Rig) -> Differences {
    let nothing = || (0.0, String::new());
    let mut differences = Differences {
        places: nothing(),
        directions: nothing(),
        radii: nothing(),
    };
    let note = |worst: &mut (f32, String), value: f32, what: String| {
        if value > worst.0 {
            *worst = (value, what);
        }
    };
    let Differences {
        places,
        directions,
        radii,
    } = &mut differences;
    note(places, rig.palm.distance(expected.palm), "palm".to_owned());
    note(places, (rig.reach - expected.reach).abs(), "reach".to_owned());
    for (digit, (own, other)) in rig.digits.iter().zip(&expected.digits).enumerate() {
        let (base, other_base) = (own.wrist_from_base, other.wrist_from_base);
        let turn = base.orientation.angle_between(other_base.orientation);
        note(
            places,
            base.position.distance(other_base.position),
            format!("base {digit}"),
        );
        note(directions, turn, format!("base {digit}"));
        assert_eq!(own.yaw_sign, other.yaw_sign);
        for link in 0..3 {
            let length = (own.lengths[link] - other.lengths[link]).abs();
            note(places, length, format!("length {digit} {link}"));
            let diameter = (own.diameters[link] / other.diameters[link] - 1.0).abs();
            note(radii, diameter, format!("diameter {digit} {link}"));
        }
    }
    let metacarpals = rig.finger_metacarpals.iter().zip(expected.finger_metacarpals);
    for (finger, (own, other)) in metacarpals.enumerate() {
        note(places, own.distance(other), format!("metacarpal {finger}"));
    }
    for (joint, (own, other)) in rig.joint_radii.iter().zip(expected.joint_radii).enumerate() {
        let what = format!("radius of {} ({own} for {other})", JOINT_NAMES[joint]);
        note(radii, (own / other - 1.0).abs(), what);
    }
    differences
}
