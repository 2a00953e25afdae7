//! Checks a grasp that a client wants to be checked.

use grasp_proto::v1;
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::{
        Digit, DigitAngles, HandPose, Handedness,
        fit::fitted,
        joints::{HandJoints, thesis_from_openxr_frame},
        rig::Rig,
    },
};

use super::{
    angles::check_count,
    hand_scale, required_handedness, rig_named,
    tracked::{Lacking, tracked_hand},
};
use crate::{
    convention::Convention,
    rigs::store::RigStore,
    validate::{Field, Violations, pose},
};

/// Largest joint angle, in radians: beyond half a turn, it is a mistake of units.
const LARGEST_ANGLE: f32 = std::f32::consts::PI;

/// A grasp as it was given.
#[derive(Clone, Debug)]
pub(crate) enum GivenGrasp {
    /// A posed hand in the object's frame.
    AtObject(HandPose),
    /// A posed hand in the client's frame, in `OpenXR` axes.
    InClient(HandPose),
    /// Tracked joints in the client's frame, in `OpenXR` axes.
    Tracked(Box<HandJoints>),
}

impl GivenGrasp {
    /// The hand in the object's frame. A tracked one is posed with the rig.
    pub(crate) fn at_object(&self, rig: &Rig, client_from_object: Pose) -> HandPose {
        let moved = |pose: &HandPose| HandPose {
            frame_from_wrist: client_from_object.inverse() * pose.frame_from_wrist,
            ..*pose
        };
        match self {
            Self::AtObject(pose) => *pose,
            Self::InClient(pose) => moved(pose),
            Self::Tracked(joints) => moved(&fitted(rig, joints)),
        }
    }
}

/// A checked grasp.
#[derive(Clone, Debug)]
pub(in crate::validate) struct Given {
    /// The grasp; none if it is wrong.
    pub grasp: Option<GivenGrasp>,
    /// The receiving hand that it is of, as far as it says.
    pub hand: v1::ReceivingHand,
    /// What was repaired.
    pub warnings: Vec<String>,
}

/// The grasp. Angles need not be within the limits of their rig.
pub(in crate::validate) fn given_grasp(
    field: Field<'_>,
    sent: Option<v1::GraspToValidate>,
    convention: Convention,
    rigs: &RigStore,
    violations: &mut Violations,
) -> Given {
    use v1::grasp_to_validate::Form;
    let nothing = || Given {
        grasp: None,
        hand: v1::ReceivingHand::default(),
        warnings: Vec::new(),
    };
    let Some(form) = sent.and_then(|sent| sent.form) else {
        violations.add(field, "is empty; it must have hand, angles or joints");
        return nothing();
    };
    match form {
        Form::Hand(hand) => {
            let posed = Posed {
                field: field.child("hand"),
                wrist: ("object_from_wrist", hand.object_from_wrist),
                rig: hand.rig,
                handedness: hand.handedness,
                hand_scale: hand.hand_scale,
                digits: &hand.digits,
            };
            posed.check(
                GivenGrasp::AtObject,
                Convention::joint_at_object_to_openxr,
                convention,
                rigs,
                violations,
            )
        }
        Form::Angles(angles) => {
            let posed = Posed {
                field: field.child("angles"),
                wrist: ("client_from_wrist", angles.client_from_wrist),
                rig: angles.rig,
                handedness: angles.handedness,
                hand_scale: angles.hand_scale,
                digits: &angles.digits,
            };
            posed.check(
                GivenGrasp::InClient,
                Convention::joint_to_openxr,
                convention,
                rigs,
                violations,
            )
        }
        Form::Joints(joints) => {
            let hand = tracked_hand(
                field.child("joints"),
                &joints,
                convention,
                Lacking::Nothing,
                violations,
            );
            let Some(hand) = hand else { return nothing() };
            Given {
                hand: v1::ReceivingHand {
                    handedness: joints.handedness,
                    ..v1::ReceivingHand::default()
                },
                warnings: hand.warnings,
                grasp: Some(GivenGrasp::Tracked(Box::new(hand.joints))),
            }
        }
    }
}

/// A hand of a rig, in either frame.
struct Posed<'a> {
    field: Field<'a>,
    /// The wrist's field and pose.
    wrist: (&'static str, Option<v1::Pose>),
    rig: String,
    handedness: i32,
    hand_scale: Option<f32>,
    digits: &'a [v1::DigitAngles],
}

impl Posed<'_> {
    fn check(
        self,
        form: impl FnOnce(HandPose) -> GivenGrasp,
        to_openxr: fn(Convention, Pose) -> Pose,
        convention: Convention,
        rigs: &RigStore,
        violations: &mut Violations,
    ) -> Given {
        let Self {
            field,
            wrist: (wrist_name, wrist),
            rig,
            handedness,
            hand_scale: scale,
            digits,
        } = self;
        let before = violations.len();
        let side = required_handedness(field.child("handedness"), handedness, violations);
        let stored = rig_named(field.child("rig"), &rig, rigs, violations);
        hand_scale(field.child("hand_scale"), scale, violations);
        let wrist = pose(
            field.child(wrist_name),
            wrist,
            convention.metres_per_unit(),
            violations,
        );
        let known = stored.as_ref().map(|stored| {
            let side = side.unwrap_or(Handedness::Right);
            &*stored.hand(side).hand.rig
        });
        let digits = any_digits(field.child("digits"), digits, known, violations);
        let pose = HandPose {
            frame_from_wrist: thesis_from_openxr_frame(to_openxr(convention, wrist)),
            digits,
        };
        let is_right = violations.len() == before;
        Given {
            grasp: is_right.then(|| form(pose)),
            // One that is wrong is not to be found wrong again.
            hand: if is_right {
                v1::ReceivingHand {
                    rig,
                    handedness,
                    hand_scale: scale,
                }
            } else {
                v1::ReceivingHand::default()
            },
            warnings: Vec::new(),
        }
    }
}

/// Five digits, thumb first, whatever the limits; those that the rig lacks are as if stretched.
fn any_digits(
    field: Field<'_>,
    sent: &[v1::DigitAngles],
    rig: Option<&Rig>,
    violations: &mut Violations,
) -> [DigitAngles; 5] {
    check_count(field, sent, violations);
    let mut digits = [DigitAngles::default(); 5];
    for (place, (angles, sent)) in digits.iter_mut().zip(sent).enumerate() {
        let digit = Digit::ALL[place];
        if rig.is_some_and(|rig| !rig.has(digit)) {
            continue;
        }
        let field = field.at(place);
        let mut checked = |name, angle: f32| {
            if angle.abs() <= LARGEST_ANGLE {
                return angle;
            }
            // NaN comes here, too: the comparison is false for it.
            violations.add(
                field.child(name),
                format_args!("is {angle} rad; it must be within half a turn, {LARGEST_ANGLE} rad"),
            );
            0.0
        };
        let second_pitch = checked("second_pitch", sent.second_pitch);
        let coupled = DigitAngles::coupled(
            checked("base_yaw", sent.base_yaw),
            checked("base_pitch", sent.base_pitch),
            second_pitch,
        );
        let third_pitch = sent.third_pitch.map(|angle| checked("third_pitch", angle));
        *angles = DigitAngles {
            third_pitch: third_pitch.unwrap_or_else(|| {
                let limits = rig.map(|rig| rig.digit(digit).limits);
                limits.map_or(coupled.third_pitch, |limits| limits.clamped(coupled).third_pitch)
            }),
            ..coupled
        };
    }
    digits
}
