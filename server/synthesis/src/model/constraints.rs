//! What a client demands of a grasp beyond that it is valid: where the receiver stands, from where the hand comes, what
//! kind of grasp it is and which digits take part.
//!
//! The functions `admits_*` come in the order in which an attempt learns what they need: [`Constraints::admits_wrist`]
//! before the digits are posed, [`Constraints::admits_contacts`] and [`Constraints::admits_type`] once they are,
//! [`Constraints::admits_comfort`] once the forces are known, and [`Constraints::admits`] asks for all of it at the end.

use glam::Vec3;

use super::{
    grasp::{Contact, Grasp},
    grasp_type::GraspType,
    hand::Digit,
};
use crate::base::pose::Pose;

/// What is demanded of a grasp. The default demands nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Constraints {
    /// Where the receiver's arm gets.
    pub reach: Option<Reach>,
    /// From where the hand may come.
    pub approach: Option<ApproachCone>,
    /// The only types that are wanted; none: any, also grasps that cannot be classified.
    pub allowed_types: Option<TypeSet>,
    /// Types that are not wanted. It excludes no grasps that cannot be classified.
    pub excluded_types: TypeSet,
    /// Digits of which each must have a contact.
    pub must_touch: DigitSet,
    /// Digits of which none may have a contact.
    pub must_not_touch: DigitSet,
    /// The largest cost E of Eq. 4.6 that is comfortable enough; 0 is best. Lower demands more comfort.
    pub worst_comfort: Option<f32>,
}

/// The sphere around the shoulder in which the wrist must lie: an arm that bends freely.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reach {
    /// The receiver's shoulder in the object's frame, in metres.
    pub shoulder: Vec3,
    /// The greatest distance from the shoulder to the wrist, in metres, more than 0.
    pub distance: f32,
}

/// The directions from which the hand may come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ApproachCone {
    /// The direction in which the hand moves toward the object, in the object's frame: a unit vector.
    pub axis: Vec3,
    /// The largest angle between the axis and [`approach_direction`], in radians, more than 0; π and more admit all.
    pub half_angle: f32,
}

/// The direction in which a hand moves toward what it grasps: halfway between its fingers (+y of the wrist frame, along
/// the forearm) and out of its palm (+z), since a hand arrives with both. A unit vector in the frame that
/// `frame_from_wrist` leads to.
pub fn approach_direction(frame_from_wrist: Pose) -> Vec3 {
    const IN_WRIST: Vec3 = Vec3::new(
        0.0,
        std::f32::consts::FRAC_1_SQRT_2,
        std::f32::consts::FRAC_1_SQRT_2,
    );
    frame_from_wrist.transform_vector(IN_WRIST)
}

impl Constraints {
    /// True if nothing is demanded.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// The same demands seen from frame b.
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

    /// May the wrist be here? Asks for reach and approach.
    pub fn admits_wrist(&self, object_from_wrist: Pose) -> bool {
        self.reach.is_none_or(|reach| reach.admits(object_from_wrist))
            && self
                .approach
                .is_none_or(|cone| cone.contains(approach_direction(object_from_wrist)))
    }

    /// Do the right digits touch? The palm may.
    pub fn admits_contacts(&self, contacts: &[Contact]) -> bool {
        let digits = contacts.iter().filter_map(|contact| contact.part.digit());
        let touching: DigitSet = digits.collect();
        touching.contains_all(self.must_touch) && !touching.intersects(self.must_not_touch)
    }

    /// Is it the right type of grasp? None for one that cannot be classified.
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

    /// Is a grasp comfortable enough? `comfort` is E of Eq. 4.6.
    pub fn admits_comfort(&self, comfort: f32) -> bool {
        self.worst_comfort.is_none_or(|worst| comfort <= worst)
    }

    /// Does a finished grasp meet every demand?
    pub fn admits(&self, grasp: &Grasp) -> bool {
        self.admits_wrist(grasp.pose.frame_from_wrist)
            && self.admits_contacts(&grasp.contacts)
            && self.admits_type(grasp.classification.grasp_type)
            && self.admits_comfort(grasp.comfort)
    }
}

impl Reach {
    fn admits(&self, object_from_wrist: Pose) -> bool {
        self.shoulder.distance_squared(object_from_wrist.position) <= self.distance * self.distance
    }
}

impl ApproachCone {
    /// May the hand move toward the object in this direction? A unit vector in the object's frame.
    pub fn contains(&self, direction: Vec3) -> bool {
        // The cosine alone cannot tell angles below some 0.0003 rad apart, nor those as near to a half turn.
        let angle = f32::atan2(self.axis.cross(direction).length(), self.axis.dot(direction));
        angle <= self.half_angle
    }
}

/// A set of grasp types.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TypeSet(u64);

impl TypeSet {
    /// Is the type in the set?
    pub fn contains(self, grasp_type: GraspType) -> bool {
        self.0 & Self::bit(grasp_type) != 0
    }

    fn bit(grasp_type: GraspType) -> u64 {
        1 << grasp_type.number()
    }
}

impl FromIterator<GraspType> for TypeSet {
    fn from_iter<I: IntoIterator<Item = GraspType>>(types: I) -> Self {
        Self(types.into_iter().fold(0, |bits, one| bits | Self::bit(one)))
    }
}

/// A set of digits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DigitSet(u8);

impl DigitSet {
    /// Is the digit in the set?
    pub fn contains(self, digit: Digit) -> bool {
        self.0 & Self::bit(digit) != 0
    }

    /// Are all digits of the other set in this one?
    pub fn contains_all(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// Is any digit in both sets?
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
