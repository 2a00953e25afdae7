//! Why people would not choose a grasp, by rules that read joints, contacts and named parts alone.

use std::f32::consts::FRAC_1_SQRT_2;

use glam::Vec3;
use grasp_synthesis::{
    geometry::aabb::Aabb,
    model::{
        grasp::Contact,
        hand::joints::{HandJoints, index},
    },
};

use super::{Label, LabelledObject};

/// Angles between both forearms, in degrees: within the first, the hands come from one side.
const FOREARMS: [f32; 2] = [60.0, 100.0];

/// Rise of a forearm, from wrist to elbow, up to which it clearly comes from where a receiver stands, as a sine: higher elbows
/// are above the shoulder.
const ELBOW_RISE: f32 = 0.7;

/// Shares of contacts on the handle.
const ON_HANDLE: [f32; 2] = [0.25, 0.66];

/// Share of the handle that the giver must leave free for people to be expected there.
const FREE_HANDLE: f32 = 0.5;

/// Shares of contacts on a blade.
const ON_BLADE: [f32; 2] = [0.25, 0.0];

/// Angles between approach and long axis, in degrees.
const ACROSS: [f32; 2] = [45.0, 65.0];

/// An object is long if its longest side is at least this many times the next, and in metres; a handle, by the first alone.
const LONG: (f32, f32) = (1.6, 0.12);

/// Rises of palm and of the way from wrist to contacts, in degrees over the horizontal.
const BENEATH: [f32; 2] = [45.0, 15.0];

/// Masses in kilograms from which so many digits are clearly enough, with the palm for all of them, and the number of digits
/// that are too few.
const HEAVY: (f32, [f32; 2]) = (1.0, [3.0, 4.0]);
const NOT_LIGHT: (f32, [f32; 2]) = (0.1, [0.0, 3.0]);

/// Offsets of the contacts' middle from the centre of mass, as shares of the object's length.
const OFFSETS: [f32; 2] = [0.35, 0.2];

/// Mass in kilograms from which it matters how far from the centre of mass a thing is held: cards and keys are pinched
/// anywhere.
const OFFSET_MATTERS: f32 = 0.1;

/// Distance in metres from a giver's skin at which a finger has room, and at which a hand has.
const FINGER_ROOM: f32 = 0.02;
const HAND_ROOM: f32 = 0.04;

/// Distance of the samples of a handle in metres.
const SAMPLING: f32 = 0.01;

/// Why people would not choose a grasp.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Reason {
    /// The forearm comes from where the giver's does.
    GiversSide,
    /// The hand holds something else than the handle, which is free.
    OffHandle,
    /// The hand touches a blade although it need not.
    OnBlade,
    /// Nobody holds the object, and the hand takes it from its end, not across its length.
    EndOn,
    /// Nobody holds the object, and the hand comes from beneath.
    FromBeneath,
    /// Few digits hold something heavy.
    TooFewDigits,
    /// The hand holds an object without a handle far from its centre of mass.
    FarEnd,
}

/// All of them.
pub(super) const REASONS: [Reason; 7] = [
    Reason::GiversSide,
    Reason::OffHandle,
    Reason::OnBlade,
    Reason::EndOn,
    Reason::FromBeneath,
    Reason::TooFewDigits,
    Reason::FarEnd,
];

/// The verdict of a rule that applies to a grasp's object and holdout.
#[derive(Clone, Copy, PartialEq)]
enum Verdict {
    /// The reason applies.
    Implausible,
    /// Neither the reason nor its opposite is clear.
    Undecided,
    /// The opposite of the reason is clear.
    Plausible,
}

/// The verdicts of all rules.
pub(super) struct Verdicts([Option<Verdict>; REASONS.len()]);

impl Verdicts {
    /// True if every rule that applies finds the opposite of its reason, and some rule applies.
    pub(super) fn are_plausible(&self) -> bool {
        let mut applying = self.0.iter().flatten().peekable();
        applying.peek().is_some() && applying.all(|verdict| *verdict == Verdict::Plausible)
    }

    /// The reason, if exactly one applies.
    pub(super) fn only_reason(&self) -> Option<Reason> {
        let verdicts = REASONS.into_iter().zip(self.0);
        let mut applying = verdicts.filter(|(_, verdict)| *verdict == Some(Verdict::Implausible));
        let (first, _) = applying.next()?;
        applying.next().is_none().then_some(first)
    }
}

/// A presentation of an object, in the object's frame, as far as rules depend on it.
pub(super) struct Rules<'a> {
    object: &'a LabelledObject,
    up: Vec3,
    giver_forearm: Option<Vec3>,
    /// Whether people are expected to hold the handle.
    asks_for_handle: bool,
    asks_for_middle: bool,
    /// The long axis, if the object is long.
    long_axis: Option<Vec3>,
    /// The length of the object in metres.
    length: f32,
}

impl<'a> Rules<'a> {
    /// The rules for an object that `giver` holds, or nobody. `up` is a unit vector; both are in the object's frame.
    pub(super) fn new(object: &'a LabelledObject, giver: Option<&HandJoints>, up: Vec3) -> Self {
        let (axis, length, next) = longest_side(object.object.surface.mesh().positions().iter().copied());
        let centre = object.object.centre_of_mass;
        let has_handle = object.has(Label::Handle);
        Self {
            object,
            up,
            giver_forearm: giver.map(forearm),
            asks_for_handle: has_handle
                && giver.is_none_or(|giver| free_share(object, Label::Handle, giver) > FREE_HANDLE),
            asks_for_middle: !has_handle
                && object.object.mass >= OFFSET_MATTERS
                && giver.is_none_or(|giver| distance_from_skin(giver, centre) > HAND_ROOM),
            long_axis: (length >= LONG.0 * next && length >= LONG.1 && is_held_across(object, axis))
                .then_some(Vec3::AXES[axis]),
            length,
        }
    }

    /// What the rules say of a hand with these contacts, in the object's frame.
    pub(super) fn verdicts(&self, hand: &HandJoints, contacts: &[Contact]) -> Verdicts {
        Verdicts(REASONS.map(|reason| self.verdict(reason, hand, contacts)))
    }

    fn verdict(&self, reason: Reason, hand: &HandJoints, contacts: &[Contact]) -> Option<Verdict> {
        let measured = match reason {
            Reason::GiversSide => self.giver_forearm.map(|giver| {
                let angle = giver.angle_between(forearm(hand)).to_degrees();
                let is_high = forearm(hand).dot(self.up) > ELBOW_RISE;
                (
                    if is_high {
                        angle.min(FOREARMS[1] - 1.0)
                    } else {
                        angle
                    },
                    FOREARMS,
                )
            }),
            Reason::OffHandle => self
                .asks_for_handle
                // What is on the blade has a reason of its own.
                .then(|| self.share_on(Label::Handle, contacts) + self.share_on(Label::Blade, contacts))
                .map(|share| (share, ON_HANDLE)),
            Reason::OnBlade => (self.object.has(Label::Blade)
                && (self.asks_for_handle || !self.object.has(Label::Handle)))
            .then(|| (self.share_on(Label::Blade, contacts), ON_BLADE)),
            Reason::EndOn => self
                .long_axis
                .filter(|_| self.giver_forearm.is_none())
                .map(|axis| (angle_to_line(approach(hand), axis), ACROSS)),
            Reason::FromBeneath => self
                .giver_forearm
                .is_none()
                .then(|| (self.rise(hand, contacts), BENEATH)),
            Reason::TooFewDigits => [HEAVY, NOT_LIGHT]
                .into_iter()
                .find(|(mass, _)| self.object.object.mass > *mass)
                .map(|(_, limits)| (digits_and_palm(contacts), limits)),
            Reason::FarEnd => self.asks_for_middle.then(|| {
                let offset = middle(contacts).distance(self.object.object.centre_of_mass);
                (offset / self.length, OFFSETS)
            }),
        };
        measured.map(|(value, limits)| verdict(value, limits))
    }

    /// The share of contacts on a part.
    fn share_on(&self, part: Label, contacts: &[Contact]) -> f32 {
        let on = contacts
            .iter()
            .filter(|contact| self.object.labels[contact.triangle as usize] == part);
        on.count() as f32 / contacts.len().max(1) as f32
    }

    /// How steeply a hand comes from beneath, in degrees over the horizontal: the steeper of where its palm faces and of the
    /// way from its wrist to what it holds.
    fn rise(&self, hand: &HandJoints, contacts: &[Contact]) -> f32 {
        let wrist = hand.joints[index::WRIST].pose.position;
        let reaching = (middle(contacts) - wrist).normalize_or_zero();
        let palm = hand.joints[index::PALM].pose.transform_vector(Vec3::NEG_Y);
        let rise = reaching.dot(self.up).max(palm.dot(self.up));
        rise.clamp(-1.0, 1.0).asin().to_degrees()
    }
}

/// Compares a value with where a reason applies and where its opposite does; either may be the larger.
fn verdict(value: f32, [reason, opposite]: [f32; 2]) -> Verdict {
    let sign = (opposite - reason).signum();
    if sign * value <= sign * reason {
        Verdict::Implausible
    } else if sign * value >= sign * opposite {
        Verdict::Plausible
    } else {
        Verdict::Undecided
    }
}

/// The axis along which points extend most, by number, their extent along it, and the larger of the others.
fn longest_side(points: impl IntoIterator<Item = Vec3>) -> (usize, f32, f32) {
    let extents = Aabb::around(points).extents();
    let axis = extents.max_position();
    (
        axis,
        extents[axis],
        extents[(axis + 1) % 3].max(extents[(axis + 2) % 3]),
    )
}

/// Whether a hand across this axis fits the handle, if the object has one: a saw's handle is across the saw.
fn is_held_across(object: &LabelledObject, axis: usize) -> bool {
    let corners: Vec<Vec3> = object.triangles_of(Label::Handle).flatten().collect();
    let (along, length, next) = longest_side(corners.iter().copied());
    corners.is_empty() || along == axis && length >= LONG.0 * next
}

/// The direction of a forearm, from the wrist.
fn forearm(hand: &HandJoints) -> Vec3 {
    hand.joints[index::WRIST].pose.transform_vector(Vec3::Z)
}

/// Where a hand moves to take something: between where its fingers point and where its palm faces.
fn approach(hand: &HandJoints) -> Vec3 {
    let wrist = hand.joints[index::WRIST].pose;
    wrist.transform_vector(Vec3::new(0.0, -FRAC_1_SQRT_2, -FRAC_1_SQRT_2))
}

/// The angle between a direction and a line, both unit vectors, in degrees: at most 90.
fn angle_to_line(direction: Vec3, line: Vec3) -> f32 {
    direction.dot(line).abs().min(1.0).acos().to_degrees()
}

/// How many digits touch; all, if the palm does.
fn digits_and_palm(contacts: &[Contact]) -> f32 {
    let mut touching = [false; 5];
    for contact in contacts {
        match contact.part.digit() {
            Some(digit) => touching[digit.index()] = true,
            None => return touching.len() as f32,
        }
    }
    touching.into_iter().filter(|touches| *touches).count() as f32
}

/// The mean of the contacts' positions.
fn middle(contacts: &[Contact]) -> Vec3 {
    let sum: Vec3 = contacts.iter().map(|contact| contact.position).sum();
    sum / contacts.len().max(1) as f32
}

/// The share of a part's surface where a giver leaves room for a finger.
fn free_share(object: &LabelledObject, part: Label, giver: &HandJoints) -> f32 {
    let (mut free, mut whole) = (0.0, 0.0);
    for [a, b, c] in object.triangles_of(part) {
        let [along, across] = [b - a, c - a];
        let steps = (along.length().max(across.length()) / SAMPLING).ceil().max(1.0);
        let area = along.cross(across).length() / (steps * steps);
        let steps = steps as usize;
        // The middles of the halves of a grid of parallelograms that are within the triangle.
        for i in 0..steps {
            for j in 0..steps - i {
                let at = |shift: f32| {
                    a + ((i as f32 + shift) * along + (j as f32 + shift) * across) / steps as f32
                };
                let upper = (i + j + 1 < steps).then(|| at(2.0 / 3.0));
                for point in [Some(at(1.0 / 3.0)), upper].into_iter().flatten() {
                    whole += area;
                    if distance_from_skin(giver, point) > FINGER_ROOM {
                        free += area;
                    }
                }
            }
        }
    }
    if whole > 0.0 { free / whole } else { 1.0 }
}

/// Distance of a point from a hand's bones less their thickness, in metres; negative inside.
fn distance_from_skin(hand: &HandJoints, point: Vec3) -> f32 {
    let digits = index::FIRST_OF_DIGIT.into_iter().zip(index::TIP_OF_DIGIT);
    let bones = digits.flat_map(|(first, tip)| {
        let to_first = [(index::WRIST, first)];
        to_first
            .into_iter()
            .chain((first..tip).map(|joint| (joint, joint + 1)))
    });
    bones
        .map(|(from, to)| {
            let [from, to] = [from, to].map(|joint| hand.joints[joint]);
            let bone = to.pose.position - from.pose.position;
            let along = (point - from.pose.position).dot(bone) / bone.length_squared().max(f32::MIN_POSITIVE);
            let along = along.clamp(0.0, 1.0);
            let nearest = from.pose.position + along * bone;
            point.distance(nearest) - (from.radius + along * (to.radius - from.radius))
        })
        .fold(f32::MAX, f32::min)
}
