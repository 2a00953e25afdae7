//! Packed grasps: see `proto/PACKED.md`.

use std::f32::consts::PI;

use glam::{Quat, Vec3};

use crate::v1;

const VERSION: u8 = 1;

/// Bytes before the rig's id.
const HEADER: usize = 22;

/// Steps of an angle from 0 to pi.
const ANGLE_STEPS: f32 = 2048.0;

/// Bytes of a digit: four angles of 12 bits.
const DIGIT_BYTES: usize = 6;

/// Why bytes are no packed grasp.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PackedGraspError {
    /// Of another version than 1.
    Version(u8),
    /// Bytes are missing, or too many.
    Length(usize),
    /// The id of the rig is not ASCII.
    Rig,
}

impl std::fmt::Display for PackedGraspError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Version(version) => write!(f, "a packed grasp has version {version}; 1 can be read"),
            Self::Length(length) => write!(
                f,
                "a packed grasp is incomplete or too long: it has {length} bytes"
            ),
            Self::Rig => f.write_str("a packed grasp names a rig that is not ASCII"),
        }
    }
}

impl std::error::Error for PackedGraspError {}

impl v1::Grasp {
    /// The grasp in at most 128 bytes; empty without a hand.
    #[must_use]
    pub fn pack(&self) -> Vec<u8> {
        let Some(hand) = &self.hand else {
            return Vec::new();
        };
        let digits = hand.digits();
        let right = u8::from(hand.handedness() == v1::Handedness::Right);
        let present = (0..5).fold(right, |bits, i| bits | u8::from(digits[i].is_some()) << (i + 1));
        // The palm, 0 in the contract, comes after the digits.
        let bit = |contact: &v1::Contact| 1 << ((contact.digit + 5) % 6);
        let touching = self.contacts.iter().fold(0, |bits, contact| bits | bit(contact));
        let scale = (hand.size() * 100.0).round() as u8;
        let wrist = hand.object_from_wrist.unwrap_or_default();
        let position = wrist.position();
        let exponent = unit_exponent(position);
        let unit = f32::from(exponent).exp2();
        let rig = hand.rig.trim_start_matches("rigs/");
        let mut bytes = vec![
            VERSION,
            present,
            touching,
            self.r#type as u8,
            hand.convention as u8,
            scale,
        ];
        bytes.push(exponent.cast_unsigned());
        let orientation = wrist
            .orientation()
            .to_array()
            .map(|part| part * f32::from(i16::MAX));
        let parts = (position / unit).to_array().into_iter().chain(orientation);
        bytes.extend(parts.flat_map(|part| (part.round() as i16).to_le_bytes()));
        bytes.push(rig.len() as u8);
        bytes.extend(rig.bytes());
        for angles in digits.into_iter().flatten() {
            let third = angles.third_pitch.unwrap_or(angles.second_pitch * 2.0 / 3.0);
            let step = |angle: f32| ((angle / PI + 1.0) * ANGLE_STEPS).round().clamp(0.0, 4095.0) as u16;
            for (a, b) in [(angles.base_yaw, angles.base_pitch), (angles.second_pitch, third)] {
                let (a, b) = (step(a), step(b));
                bytes.extend([a as u8, (a >> 8 | (b & 15) << 4) as u8, (b >> 4) as u8]);
            }
        }
        bytes
    }

    /// The grasp of packed bytes: its hand at the object, its type, and contacts with nothing but their digits.
    ///
    /// # Errors
    /// See [`PackedGraspError`].
    pub fn unpack(bytes: &[u8]) -> Result<Self, PackedGraspError> {
        let wrong_length = PackedGraspError::Length(bytes.len());
        let (&version, _) = bytes.split_first().ok_or(wrong_length)?;
        if version != VERSION {
            return Err(PackedGraspError::Version(version));
        }
        let (header, rest) = bytes.split_at_checked(HEADER).ok_or(wrong_length)?;
        let (rig, angles) = rest.split_at_checked(header[21].into()).ok_or(wrong_length)?;
        let present: [bool; 5] = std::array::from_fn(|digit| header[1] >> (digit + 1) & 1 == 1);
        let count = present.iter().filter(|&&present| present).count();
        if angles.len() != count * DIGIT_BYTES {
            return Err(wrong_length);
        }
        let rig = str::from_utf8(rig).ok().filter(|rig| rig.is_ascii());
        let rig = rig.ok_or(PackedGraspError::Rig)?;
        let mut angles = angles.chunks_exact(DIGIT_BYTES).map(|packed| {
            let angle = |step: u16| (f32::from(step) / ANGLE_STEPS - 1.0) * PI;
            let pair = |at: usize| {
                let [a, b, c] = [at, at + 1, at + 2].map(|at| u16::from(packed[at]));
                [angle(a | (b & 15) << 8), angle(b >> 4 | c << 4)]
            };
            let ([base_yaw, base_pitch], [second_pitch, third_pitch]) = (pair(0), pair(3));
            v1::DigitAngles::new([base_yaw, base_pitch, second_pitch, third_pitch])
        });
        let part = |at: usize| f32::from(i16::from_le_bytes([header[at], header[at + 1]]));
        let unit = f32::from(header[6].cast_signed()).exp2();
        let position = Vec3::new(part(7), part(9), part(11)) * unit;
        let orientation = Quat::from_xyzw(part(13), part(15), part(17), part(19));
        let handedness = if header[1] & 1 == 1 {
            v1::Handedness::Right
        } else {
            v1::Handedness::Left
        };
        let scale = f32::from(header[5]) / 100.0;
        let hand = v1::HandPose {
            scale: (scale != 1.0).then_some(scale),
            convention: header[4].into(),
            ..v1::HandPose::new(format!("rigs/{rig}"), handedness)
        };
        let digits = present.map(|present| if present { angles.next() } else { None });
        let pose = v1::Pose::new(position, orientation.normalize());
        let touching = (0..6).filter(|bit| header[2] >> bit & 1 == 1);
        Ok(Self {
            hand: Some(hand.with_digits(digits).with_object_from_wrist(pose)),
            contacts: touching
                .map(|bit| v1::Contact {
                    digit: (bit + 1) % 6,
                    ..v1::Contact::default()
                })
                .collect(),
            r#type: header[3].into(),
            ..Self::default()
        })
    }
}

/// The exponent of the smallest power of two in which all coordinates fit into 16 bits.
fn unit_exponent(position: Vec3) -> i8 {
    let largest = position.abs().max_element() / f32::from(i16::MAX);
    if largest > 0.0 {
        largest.log2().ceil() as i8
    } else {
        i8::MIN
    }
}
