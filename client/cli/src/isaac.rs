//! Files in the format `isaac_grasp` 1.0, which Isaac Sim's Grasp Editor reads and writes: grasps of one object by one
//! gripper, here by a hand of a rig.

use std::{fmt, path::Path, str::FromStr};

use glam::{Quat, Vec3};
use grasp_client::{
    Handedness,
    v1::{self, DigitAngles, GraspObject, HandPose, Pose},
};
use indexmap::IndexMap;
use serde::{Deserialize, Serialize};
use yaml_serde::Value;

use crate::{
    Failure,
    input::read_file,
    output::{list, write_file},
};

/// The part of help pages about the files.
pub(crate) const ABOUT: &str = "\
A file in the format isaac_grasp 1.0 has grasps of one object by one gripper: a hand of a rig, which gripper_frame names, such as
rigs/adult/right, or rigs/adult/right/1.1 for a hand 1.1 times as large as its rig. Position and orientation are those of its
wrist's joint (-Z to the fingertips, +Y out of the hand's back) in the axes of the object's mesh file and in metres. Joints are
thumb, index, middle, ring and little, each with _base_yaw, _base_pitch, _second_pitch and _third_pitch, in radians;
confidence is the score, and pregrasp_cspace_position is the open hand.";

const DIGITS: [&str; 5] = ["thumb", "index", "middle", "ring", "little"];
const ANGLES: [&str; 4] = ["base_yaw", "base_pitch", "second_pitch", "third_pitch"];

/// A hand of a rig, written as "rigs/adult/right" or, with its size over the rig's, "rigs/adult/right/1.1".
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Gripper {
    rig: String,
    handedness: Handedness,
    scale: Option<f32>,
}

impl Gripper {
    pub(crate) fn of(hand: &HandPose) -> Self {
        Self {
            rig: hand.rig.clone(),
            handedness: hand.handedness(),
            scale: hand.scale,
        }
    }

    /// The gripper as a receiver whose body may be anywhere.
    pub(crate) fn receiver(&self) -> v1::Receiver {
        v1::Receiver {
            rig: self.rig.clone(),
            handedness: self.handedness.into(),
            scale: self.scale,
            body: Some(v1::receiver::Body::Anywhere(true)),
            ..v1::Receiver::default()
        }
    }
}

impl fmt::Display for Gripper {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let side = match self.handedness {
            Handedness::Left => "left",
            Handedness::Right | Handedness::Unspecified => "right",
        };
        write!(f, "{}/{side}", self.rig)?;
        self.scale.map_or(Ok(()), |scale| write!(f, "/{scale}"))
    }
}

impl FromStr for Gripper {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("{text:?} is not a hand of a rig; write for example rigs/adult/right");
        let mut parts = text.split('/');
        let (Some("rigs"), Some(rig), Some(side)) = (parts.next(), parts.next(), parts.next()) else {
            return Err(wrong());
        };
        let handedness = match side {
            "left" => Handedness::Left,
            "right" => Handedness::Right,
            _ => return Err(wrong()),
        };
        let scale = parts.next().map(str::parse).transpose().map_err(|_| wrong())?;
        if rig.is_empty() || parts.next().is_some() {
            return Err(wrong());
        }
        Ok(Self {
            rig: format!("rigs/{rig}"),
            handedness,
            scale,
        })
    }
}

/// A grasp of a file.
pub(crate) struct NamedGrasp {
    pub(crate) name: String,
    /// In the axes of `OpenXR`, with its wrist in the object's frame.
    pub(crate) hand: HandPose,
    /// The score; 0 of a grasp that is not valid.
    pub(crate) confidence: f32,
    /// The open hand at the object.
    pub(crate) pre_grasp: Option<HandPose>,
}

impl NamedGrasp {
    /// A grasp that the server found or kept.
    pub(crate) fn found(name: impl Into<String>, grasp: &v1::Grasp) -> Self {
        let mut frames = grasp.key_frames.iter();
        let open = frames.find(|frame| frame.kind() == v1::KeyFrameKind::PreGrasp);
        Self {
            name: name.into(),
            hand: grasp.hand.clone().unwrap_or_default(),
            confidence: grasp.score.unwrap_or_default(),
            pre_grasp: open.and_then(|frame| frame.hand.clone()),
        }
    }
}

#[derive(Deserialize, Serialize)]
struct File {
    format: String,
    format_version: Value,
    /// Readers do not rely on the names of frames, of which two spellings are in use.
    #[serde(alias = "object_frame_link", default)]
    object_frame: String,
    #[serde(alias = "gripper_frame_link", default)]
    gripper_frame: String,
    grasps: IndexMap<String, Grasp>,
}

#[derive(Deserialize, Serialize)]
struct Grasp {
    confidence: f32,
    position: [f32; 3],
    orientation: Orientation,
    #[serde(default)]
    cspace_position: IndexMap<String, f32>,
    #[serde(default)]
    pregrasp_cspace_position: IndexMap<String, f32>,
}

#[derive(Deserialize, Serialize)]
struct Orientation {
    w: f32,
    xyz: [f32; 3],
}

/// Writes grasps of an object by one gripper.
///
/// # Errors
/// The grasps are by several grippers, or the file cannot be written.
pub(crate) fn write(path: &Path, object: &GraspObject, grasps: &[NamedGrasp]) -> Result<(), Failure> {
    let mut grippers: Vec<String> = Vec::new();
    for NamedGrasp { hand, .. } in grasps {
        let gripper = Gripper::of(hand).to_string();
        if !grippers.contains(&gripper) {
            grippers.push(gripper);
        }
    }
    if grippers.len() > 1 {
        let why = "a file in the format isaac_grasp has one gripper, but grasps are by";
        return Err(Failure::usage(format!("{why} {}; choose one", list(grippers))));
    }
    let grasps = grasps.iter().map(|grasp| {
        let wrist = grasp.hand.object_from_wrist.unwrap_or_default();
        let wrist = in_file(object, wrist);
        let [x, y, z, w] = wrist.orientation().to_array();
        let written = Grasp {
            confidence: grasp.confidence,
            position: wrist.position().to_array(),
            orientation: Orientation { w, xyz: [x, y, z] },
            cspace_position: angles(&grasp.hand),
            pregrasp_cspace_position: grasp.pre_grasp.as_ref().map(angles).unwrap_or_default(),
        };
        (grasp.name.clone(), written)
    });
    let file = File {
        format: "isaac_grasp".to_owned(),
        format_version: 1.0.into(),
        object_frame: object.name.clone(),
        gripper_frame: grippers.pop().unwrap_or_default(),
        grasps: grasps.collect(),
    };
    let text = yaml_serde::to_string(&file).map_err(|error| Failure::other("cannot write YAML", error))?;
    write_file(path, text.as_bytes())
}

/// Reads the grasps of an object, by `gripper` or the one that the file names. Their confidence and open hands are left out.
///
/// # Errors
/// The file cannot be read, is of another format, or of a gripper with other joints.
pub(crate) fn read(
    path: &Path,
    object: &GraspObject,
    gripper: Option<&Gripper>,
) -> Result<Vec<(String, HandPose)>, Failure> {
    let text = read_file(path)?;
    let wrong = |why: &dyn fmt::Display| Failure::usage(format!("{}: {why}", path.display()));
    // Refuses names that occur twice.
    let value: Value = yaml_serde::from_slice(&text).map_err(|error| wrong(&error))?;
    let format = value.get("format").and_then(Value::as_str);
    if format != Some("isaac_grasp") {
        return Err(wrong(&"it has no line \"format: isaac_grasp\""));
    }
    let file: File = yaml_serde::from_slice(&text).map_err(|error| wrong(&error))?;
    if file.format_version.as_f64() != Some(1.0) && file.format_version.as_str() != Some("1.0") {
        return Err(wrong(&"format_version is not 1.0"));
    }
    let named = match gripper {
        Some(gripper) => gripper.clone(),
        None => file
            .gripper_frame
            .parse()
            .map_err(|why| wrong(&format!("gripper_frame: {why}, or name the hand by --gripper")))?,
    };
    let read = |(name, grasp): (String, Grasp)| {
        let digits = digits(&grasp.cspace_position).map_err(|why| wrong(&format!("grasps.{name}: {why}")))?;
        let Orientation { w, xyz: [x, y, z] } = grasp.orientation;
        let wrist = Pose::new(Vec3::from(grasp.position), Quat::from_xyzw(x, y, z, w));
        let hand = HandPose {
            scale: named.scale,
            ..HandPose::new(&named.rig, named.handedness)
        };
        let hand = hand.with_object_from_wrist(from_file(object, wrist));
        Ok((name, hand.with_digits(digits)))
    };
    file.grasps.into_iter().map(read).collect()
}

/// Maps the object's axes to those of its mesh file.
fn turned(object: &GraspObject, angle: f32, pose: Pose) -> Pose {
    if object.z_up {
        Pose::new(Vec3::ZERO, Quat::from_rotation_x(angle)) * pose
    } else {
        pose
    }
}

fn in_file(object: &GraspObject, pose: Pose) -> Pose {
    turned(object, std::f32::consts::FRAC_PI_2, pose)
}

fn from_file(object: &GraspObject, pose: Pose) -> Pose {
    turned(object, -std::f32::consts::FRAC_PI_2, pose)
}

/// The angles of the digits that a hand has, by joint.
fn angles(hand: &HandPose) -> IndexMap<String, f32> {
    let digits = DIGITS.into_iter().zip(hand.digits());
    let angles = digits.filter_map(|(digit, angles)| Some((digit, angles?)));
    let named = angles.flat_map(|(digit, angles)| {
        let values = [
            Some(angles.base_yaw),
            Some(angles.base_pitch),
            Some(angles.second_pitch),
            angles.third_pitch,
        ];
        let values = ANGLES.into_iter().zip(values);
        values.filter_map(move |(angle, value)| Some((format!("{digit}_{angle}"), value?)))
    });
    named.collect()
}

/// The digits of a hand with these angles.
fn digits(angles: &IndexMap<String, f32>) -> Result<[Option<DigitAngles>; 5], String> {
    let is_of_hand = |joint: &str| {
        let digit = DIGITS
            .iter()
            .find_map(|digit| joint.strip_prefix(digit)?.strip_prefix('_'));
        digit.is_some_and(|angle| ANGLES.contains(&angle))
    };
    let mut unknown = angles.keys().filter(|joint| !is_of_hand(joint)).peekable();
    if unknown.peek().is_some() {
        let (digits, angles) = (DIGITS.join(", "), ANGLES.join(", _"));
        let unknown = list(unknown);
        return Err(format!(
            "a hand has no joints {unknown}; it has {digits}, each with _{angles}"
        ));
    }
    if angles.is_empty() {
        return Err("cspace_position has no joints".to_owned());
    }
    let mut digits = [None; 5];
    for (name, digit) in DIGITS.into_iter().zip(&mut digits) {
        let [yaw, base, second, third] = ANGLES.map(|angle| angles.get(&format!("{name}_{angle}")).copied());
        *digit = match (yaw, base, second) {
            (None, None, None) if third.is_none() => None,
            (Some(base_yaw), Some(base_pitch), Some(second_pitch)) => Some(DigitAngles {
                base_yaw,
                base_pitch,
                second_pitch,
                third_pitch: third,
            }),
            _ => return Err(format!("cspace_position lacks angles of the digit {name}")),
        };
    }
    Ok(digits)
}

#[cfg(test)]
mod tests;
