//! The checks that grasps fail, and what keeps a hand from any: one list for all that explain why there is no grasp.

/// A check that a valid grasp passes, or what keeps a hand from all of them. Each comes with a figure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Check {
    /// The angles are within the rig's limits; the largest excess in radians.
    JointLimits,
    /// The hand is no deeper in the object than flesh yields; the largest depth in metres.
    Penetration,
    /// Hand and forearm are clear of other people's hands; the least distance in metres, negative inside. As a limit: the room that
    /// the giver's hands leave above the freest place that may be held, and the room that a finger needs.
    GiverClearance,
    /// The part of it that is about other hands than the giver's, where the two are distinguished.
    OtherHandsClearance,
    /// Hand and forearm are clear of obstacles; the least distance in metres, negative inside. As a limit: the share of the grips
    /// that would hold the object which obstacles are in the way of; no proof, as known grips are many, not all.
    ObstacleClearance,
    /// No part of the hand goes through another; the least distance in metres, negative where they overlap.
    SelfCollision,
    /// The hand touches the object; the number of contacts.
    Contacts,
    /// The hand keeps off forbidden surfaces; the least distance in metres. As a limit: the share of the surface's area that is
    /// forbidden, so that no two of the remaining places can be pressed against each other by one hand.
    Forbidden,
    /// The contacts have closure; their epsilon, and the required one unless the object could only hang in the fingers.
    Closure,
    /// The contacts carry the weight; the unbalanced share of it.
    Balance,
    /// The receiver's arm reaches the wrist, within the requirements. Of a verdict, how much farther it would have to reach, in
    /// metres; of a failed check, the distance from the shoulder, if that decides; as a limit, the distance from the shoulder to
    /// the nearest place that may be held, and that to the farthest contact within reach.
    Reach,
    /// The hand approaches from within the requirements' cone.
    Approach,
    /// The requirements admit the digits that touch.
    Digits,
    /// The requirements admit the grasp's type.
    GraspType,
    /// The forces are as comfortable as the requirements demand.
    Comfort,
    /// The requirements but for reach are met: the last four together.
    Requirements,
    /// The hand is not near a banned grip.
    Banned,
    /// No known grip is better; the difference of the scores.
    Score,
    /// The object's mass, and the largest mass that all contacts of a hand can carry, in kilograms.
    Mass,
    /// The weight's torque about the nearest place that may be held, and the largest torque of all contacts of a hand
    /// there, in newton metres.
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
    /// The checks of a hand that somebody posed.
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
