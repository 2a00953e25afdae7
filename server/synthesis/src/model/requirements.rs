//! A client's demands on a grasp beyond validity: the receiver's reach, the approach direction, the grasp type, the
//! digits that touch, and comfort.
//!
//! The `admits_*` functions follow the order in which an attempt can check them: [`Requirements::admits_wrist`] before
//! the digits are posed, [`Requirements::admits_contacts`] and [`Requirements::admits_type`] afterwards,
//! [`Requirements::admits_comfort`] once the forces are known. [`Requirements::admits`] checks a finished grasp.

use glam::Vec3;

use super::{
    grasp::{Contact, Grasp},
    grasp_type::GraspType,
    hand::Digit,
};
use crate::base::pose::Pose;

/// Demands on a grasp. The default demands nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Requirements {
    /// The reach of the receiver's arm; `None` for any.
    pub reach: Option<Reach>,
    /// The directions from which the hand may approach; `None` for any.
    pub approach: Option<ApproachCone>,
    /// The only grasp types allowed; `None` for any, including grasps without a type.
    pub allowed_types: Option<TypeSet>,
    /// Grasp types not allowed. Grasps without a type are unaffected.
    pub excluded_types: TypeSet,
    /// Digits that must each have a contact.
    pub must_touch: DigitSet,
    /// Digits that may not have a contact.
    pub must_not_touch: DigitSet,
    /// Upper bound of the comfort cost E of Eq. 4.6, at least 0; 0 is the most comfortable.
    pub worst_comfort: Option<f32>,
}

/// How requirements treat hooks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hooks {
    /// Only hooks are likely to meet them.
    Demanded,
    /// Hooks and other grasps can meet them.
    Allowed,
    /// No hook meets them.
    RuledOut,
}

/// The sphere around the shoulder in which the wrist must lie, modelling an arm that bends freely.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reach {
    /// The receiver's shoulder, in the object's frame, in metres.
    pub shoulder: Vec3,
    /// Largest distance from shoulder to wrist, in metres; more than 0.
    pub distance: f32,
}

/// A cone of directions in which the hand may approach.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ApproachCone {
    /// The direction of the hand's motion toward the object, a unit vector in the object's frame.
    pub axis: Vec3,
    /// Largest angle between the axis and [`approach_direction`], in radians; more than 0, and from π on any direction.
    pub half_angle: f32,
}

/// The direction in which a hand moves toward its object, a unit vector in the target frame of
/// `frame_from_wrist`. It is halfway between the direction of the fingers (+y of the wrist frame) and of the palm
/// (+z), since a hand leads with both.
pub fn approach_direction(frame_from_wrist: Pose) -> Vec3 {
    const IN_WRIST: Vec3 = Vec3::new(
        0.0,
        std::f32::consts::FRAC_1_SQRT_2,
        std::f32::consts::FRAC_1_SQRT_2,
    );
    frame_from_wrist.transform_vector(IN_WRIST)
}

impl Requirements {
    /// True if there are no demands.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// The same demands, expressed in frame b.
    #[must_use]
    pub fn transformed(&self, b_from_a: Pose) -> Self {
        Self {
            reach: self.reach.map(|reach| Reach {
                shoulder: b_from_a.transform_point(reach.shoulder),
                ..reach
            }),
            approach: self.approach.map(|cone| ApproachCone {
                axis: b_from_a.transform_vector(cone.axis),
                ..cone
            }),
            ..*self
        }
    }

    /// True if reach and approach allow this wrist pose.
    pub fn admits_wrist(&self, object_from_wrist: Pose) -> bool {
        self.reaches(object_from_wrist) && self.admits_approach(object_from_wrist)
    }

    /// True if the reach allows this wrist pose.
    pub fn reaches(&self, object_from_wrist: Pose) -> bool {
        self.reach.is_none_or(|reach| reach.admits(object_from_wrist))
    }

    /// True if the approach allows this wrist pose.
    pub fn admits_approach(&self, object_from_wrist: Pose) -> bool {
        self.approach
            .is_none_or(|cone| cone.contains(approach_direction(object_from_wrist)))
    }

    /// True if the required digits touch and no forbidden one does. The palm may always touch.
    pub fn admits_contacts(&self, contacts: &[Contact]) -> bool {
        let digits = contacts.iter().filter_map(|contact| contact.part.digit());
        let touching: DigitSet = digits.collect();
        touching.contains_all(self.must_touch) && !touching.intersects(self.must_not_touch)
    }

    /// Whether grasps in which a load hangs from hooked fingers, without the thumb, are demanded, allowed or ruled out.
    pub fn hooks(&self) -> Hooks {
        let only_hook = TypeSet::from_iter([GraspType::FixedHook]);
        let without_thumb = DigitSet::from_iter([Digit::Thumb]);
        if self.must_touch.intersects(without_thumb) || !self.admits_type(Some(GraspType::FixedHook)) {
            Hooks::RuledOut
        } else if self.must_not_touch.intersects(without_thumb) || self.allowed_types == Some(only_hook) {
            Hooks::Demanded
        } else {
            Hooks::Allowed
        }
    }

    /// True if the grasp type is allowed; pass `None` for a grasp without a type.
    pub fn admits_type(&self, grasp_type: Option<GraspType>) -> bool {
        match grasp_type {
            None => self.allowed_types.is_none(),
            Some(grasp_type) => {
                self.allowed_types
                    .is_none_or(|allowed| allowed.contains(grasp_type))
                    && !self.excluded_types.contains(grasp_type)
            }
        }
    }

    /// True if the comfort cost E of Eq. 4.6 is within the bound.
    pub fn admits_comfort(&self, comfort: f32) -> bool {
        self.worst_comfort.is_none_or(|worst| comfort <= worst)
    }

    /// True if a finished grasp meets every demand.
    pub fn admits(&self, grasp: &Grasp) -> bool {
        self.admits_wrist(grasp.pose.frame_from_wrist)
            && self.admits_contacts(&grasp.contacts)
            && self.admits_type(grasp.classification.grasp_type)
            && self.admits_comfort(grasp.comfort)
    }
}

impl Reach {
    /// True if the wrist is within reach.
    pub fn admits(&self, object_from_wrist: Pose) -> bool {
        self.shoulder.distance_squared(object_from_wrist.position) <= self.distance * self.distance
    }
}

impl ApproachCone {
    /// True if the cone contains the direction, a unit vector in the object's frame.
    pub fn contains(&self, direction: Vec3) -> bool {
        // The cosine alone does not resolve angles within about 0.0003 rad of 0 or π.
        let angle = f32::atan2(self.axis.cross(direction).length(), self.axis.dot(direction));
        angle <= self.half_angle
    }
}

/// A set of grasp types.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TypeSet(u64);

impl TypeSet {
    /// True if the type is in the set.
    pub fn contains(self, grasp_type: GraspType) -> bool {
        self.0 & Self::bit(grasp_type) != 0
    }

    fn bit(grasp_type: GraspType) -> u64 {
        1 << grasp_type.number()
    }
}

impl FromIterator<GraspType> for TypeSet {
    fn from_iter<I: IntoIterator<Item = GraspType>>(types: I) -> Self {
        Self(types.into_iter().fold(0, |bits, kind| bits | Self::bit(kind)))
    }
}

/// A set of digits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DigitSet(u8);

impl DigitSet {
    /// True if the digit is in the set.
    pub fn contains(self, digit: Digit) -> bool {
        self.0 & Self::bit(digit) != 0
    }

    /// True if the set contains every digit of the other.
    pub(crate) fn contains_all(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// True if the sets share a digit.
    pub fn intersects(self, other: Self) -> bool {
        self.0 & other.0 != 0
    }

    fn bit(digit: Digit) -> u8 {
        1 << digit.index()
    }
}

impl FromIterator<Digit> for DigitSet {
    fn from_iter<I: IntoIterator<Item = Digit>>(digits: I) -> Self {
        Self(digits.into_iter().fold(0, |bits, digit| bits | Self::bit(digit)))
    }
}

/// A check of a grasp, or a limit that no grasp of a hand can pass. Each comes with a figure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Check {
    /// The angles are within the rig's limits; the largest excess in radians.
    JointLimits,
    /// The hand is no deeper in the object than flesh yields; the largest depth in metres.
    Penetration,
    /// Hand and forearm are clear of other people's hands; the least distance in metres, negative inside. As a limit: the room that
    /// the giver's hands leave above the freest touchable place, and the room that a finger needs.
    GiverClearance,
    /// The same for hands other than the giver's, where the two are distinguished.
    OtherHandsClearance,
    /// Hand and forearm are clear of obstacles; the least distance in metres, negative inside. As a limit: the share of known
    /// grips that obstacles block; no proof, since other grips may exist.
    ObstacleClearance,
    /// No part of the hand goes through another; the least distance in metres, negative where they overlap.
    SelfCollision,
    /// The hand touches the object; the number of contacts.
    Contacts,
    /// The hand keeps off forbidden surfaces; the least distance in metres. As a limit: the forbidden share of the surface's area,
    /// which leaves no two places that one hand can press against each other.
    Forbidden,
    /// The contacts have closure; their epsilon, and the required one unless the object could only hang in the fingers.
    Closure,
    /// The contacts carry the weight; its unbalanced share.
    Balance,
    /// The receiver's arm reaches the wrist, within the requirements. In a verdict, how much farther it would have to reach, in
    /// metres; in a failed check, the distance from the shoulder, if that decides; as a limit, the distance from the shoulder to
    /// the nearest touchable place, and the distance to the farthest contact within reach.
    Reach,
    /// The hand approaches from within the requirements' cone.
    Approach,
    /// The requirements admit the digits that touch.
    Digits,
    /// The requirements admit the grasp's type.
    GraspType,
    /// The forces are as comfortable as the requirements demand.
    Comfort,
    /// All requirements but reach are met: the last four together.
    Requirements,
    /// The hand is not near a banned grip.
    Banned,
    /// No known grip is better; the difference of the scores.
    Score,
    /// The object's mass, and the largest mass that all contacts of a hand can carry, in kilograms.
    Mass,
    /// The weight's torque about the nearest touchable place, and the largest torque of all contacts of a hand there, in newton
    /// metres.
    Torque,
    /// The distance between the closest places that can be pressed against each other, and how far apart a hand can press, in
    /// metres.
    Width,
    /// One hand can hold the object at all.
    Holdable,
    /// A longer search may find a grasp.
    Time,
}

impl Check {
    /// The checks of a posed hand.
    pub const OF_HAND: [Self; 12] = [
        Self::JointLimits,
        Self::Penetration,
        Self::GiverClearance,
        Self::ObstacleClearance,
        Self::SelfCollision,
        Self::Contacts,
        Self::Forbidden,
        Self::Closure,
        Self::Balance,
        Self::Reach,
        Self::Requirements,
        Self::Banned,
    ];
}
