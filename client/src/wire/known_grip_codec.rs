//! Known grips of objects.

use grasp_proto::v1;

use super::{
    Malformed,
    geometry_codec::{convention_from_wire, convention_to_wire, pose_from_wire, pose_to_wire},
    hand_codec::{digit_angles_from_wire, digit_angles_to_wire, handedness_from_wire, handedness_to_wire},
};
use crate::known_grip::{KnownGrip, KnownGripUse};

pub(super) fn known_grip_to_wire(grip: &KnownGrip) -> v1::KnownGrip {
    v1::KnownGrip {
        name: grip.name.clone(),
        r#use: match grip.used {
            KnownGripUse::Preferred => v1::KnownGripUse::Preferred,
            KnownGripUse::Banned => v1::KnownGripUse::Banned,
        }
        .into(),
        rig: grip.rig.clone(),
        handedness: handedness_to_wire(grip.handedness).into(),
        hand_scale: grip.hand_scale,
        object_from_wrist: Some(pose_to_wire(grip.object_from_wrist)),
        digits: grip.digits.iter().flatten().map(digit_angles_to_wire).collect(),
        near_metres: grip.near_metres,
        near_radians: grip.near_radians,
        convention: convention_to_wire(grip.convention).into(),
    }
}

pub(super) fn known_grip_from_wire(grip: v1::KnownGrip) -> Result<KnownGrip, Malformed> {
    let used = match v1::KnownGripUse::try_from(grip.r#use) {
        Ok(v1::KnownGripUse::Preferred) => KnownGripUse::Preferred,
        Ok(v1::KnownGripUse::Banned) => KnownGripUse::Banned,
        Ok(v1::KnownGripUse::Unspecified) | Err(_) => {
            return Err(Malformed::unknown_value("use", grip.r#use));
        }
    };
    let digits: Vec<_> = grip.digits.into_iter().map(digit_angles_from_wire).collect();
    Ok(KnownGrip {
        name: grip.name,
        used,
        rig: grip.rig,
        handedness: handedness_from_wire("handedness", grip.handedness)?,
        hand_scale: grip.hand_scale,
        object_from_wrist: pose_from_wire(grip.object_from_wrist),
        // Banned grips may have any number.
        digits: digits.try_into().ok(),
        near_metres: grip.near_metres,
        near_radians: grip.near_radians,
        convention: convention_from_wire("convention", grip.convention)?,
    })
}

#[cfg(test)]
mod tests {
    use glam::{Quat, Vec3};

    use super::*;
    use crate::{
        hand::{DigitAngles, Handedness},
        pose::Pose,
        query::Convention,
    };

    #[test]
    fn known_grips_survive_the_wire() {
        let wrist = Pose::new(Vec3::X, Quat::from_rotation_y(0.3));
        let digits = std::array::from_fn(|digit| DigitAngles {
            base_pitch: digit as f32,
            third_pitch: Some(0.1),
            ..DigitAngles::default()
        });
        for grip in [
            KnownGrip {
                hand_scale: Some(0.8),
                ..KnownGrip::preferred("by the rim", Handedness::Left, wrist, digits)
            },
            KnownGrip {
                near_metres: Some(0.1),
                near_radians: Some(1.0),
                convention: Convention::Unreal,
                ..KnownGrip::banned("never", Handedness::Right, wrist)
            },
        ] {
            assert_eq!(
                known_grip_from_wire(known_grip_to_wire(&grip)).as_ref(),
                Ok(&grip)
            );
            let json = serde_json::to_string(&grip).unwrap();
            assert_eq!(serde_json::from_str::<KnownGrip>(&json).unwrap(), grip);
        }
        let unknown = v1::KnownGrip::default();
        assert_eq!(known_grip_from_wire(unknown).unwrap_err().path, "use");
    }
}
