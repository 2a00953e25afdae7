//! One attempt at a grasp under `PHYSICAL` validity: Algorithm 1 with the hand as solids.
//!
//! The checks come by cost: palm and forearm before any digit closes, solids before forces, balance before closure.

use super::{
    closing::{ClosedDigit, Closing},
    immobility::{Balance, Buffers, Load, SoftContact, balance, epsilon},
    solids::{
        HandSolids, clearance, closest, comes_within, giver_clearance, least_distance, link_radii,
        self_clearance,
    },
};
use crate::{
    grasp::{Contact, Grasp, PhysicalMargins},
    hand::{
        Digit, DigitAngles, HandPose, Phalanx,
        rig::{AngleRange, Rig},
    },
    holdout::Holdout,
    rejection::Rejection,
    strategy::BendRatioChoice,
    synthesis::{
        closing_motion::{BEND_RATIOS, allowed_ratios},
        comfort::comfort,
        random::AttemptStream,
        stopwatch::{Step, Stopwatch},
        wrist_placement::WristFrame,
    },
};

/// How deep any part of the hand may sink into the rigid object, in metres: soft flesh gives way by about as much under
/// a firm grip. More lets hands look sunken.
pub const DEEPEST: f32 = 0.002;

/// How far the receiving hand and forearm stay from the giver's, in metres. More is safer and finds fewer grasps.
pub const GIVER_CLEARANCE: f32 = 0.001;

/// How far the hand stays from forbidden surfaces, in metres: none of them is touched if flesh gives way.
pub const FORBIDDEN_CLEARANCE: f32 = 0.002;

/// Smallest Ferrari-Canny epsilon of a grasp on an object that fingers get round. In a simulation, grasps above 0.02 did
/// not fall under gravity and half of them held against pulls in all directions. A higher one gives firmer grasps and
/// finds fewer.
const LEAST_EPSILON: f32 = 0.02;

/// Of the epsilon that a thin object allows at best, the share that a grasp must have: a rod can only be kept from rolling
/// by friction at its radius, however it is held.
const LEAST_SHARE_OF_BEST: f32 = 0.25;

/// Metres by which friction is multiplied to give the torsion that a fingertip bears per newton of normal force: two
/// thirds of the radius of a disk that is pressed evenly, of 5 mm here. A larger one lets two fingers hold what would
/// twist out of them.
const TORSION_LEVER: f32 = 0.0033;

/// Flexion in radians, of all three joints together, with which a hand at rest holds its fingers: about 25° for the
/// first two and two thirds of it for the last.
const RESTING_FLEXION: f32 = 1.15;

/// Cosine of the angle up to which a contact's normal may differ from the direction to the bone: a touch, not a scrape.
const FACING_COS: f32 = 0.5;

/// What all attempts of a search share.
#[derive(Clone, Debug)]
pub struct PhysicalScene {
    giver: Option<HandSolids>,
    load: Load,
    friction: f32,
    least_epsilon: f32,
}

impl PhysicalScene {
    /// Prepares attempts at a holdout; `friction` is the coefficient between skin and object.
    pub fn new(holdout: &Holdout, friction: f32) -> Self {
        let object = &holdout.object;
        let giver = holdout.presenting_hand.as_ref();
        // Of the box: how far from the middle a force can act.
        let half_extents = object.bounding_box.half_extents;
        let characteristic_length = half_extents.length();
        // The mean of the two smaller ones: how far from its long axis the surface is.
        let thickness = 0.5 * (half_extents.element_sum() - half_extents.max_element());
        let best = friction * thickness / characteristic_length;
        Self {
            giver: giver.map(|hand| HandSolids::of_joints(&hand.joints)),
            load: Load {
                mass: object.mass,
                centre_of_mass: object.centre_of_mass,
                up: holdout.up,
                characteristic_length,
            },
            friction,
            least_epsilon: LEAST_EPSILON.min(LEAST_SHARE_OF_BEST * best),
        }
    }
}

/// What an attempt works with.
#[derive(Clone, Copy, Debug)]
pub struct Surroundings<'a> {
    /// What is held out.
    pub holdout: &'a Holdout,
    /// The receiving hand.
    pub rig: &'a Rig,
    /// What all attempts share.
    pub scene: &'a PhysicalScene,
    /// Which bend ratios a digit may take.
    pub bend_ratios: BendRatioChoice,
}

/// How an attempt ended after its wrist was placed.
#[derive(Clone, Debug, PartialEq)]
pub enum PhysicalEnd {
    /// With a valid grasp.
    Valid(Box<Grasp>),
    /// With a failed check.
    Rejected(Rejection),
    /// The stop signal came before it was over.
    Interrupted,
}

/// What an attempt draws of the hand: how the thumb stands, how far the fingers are spread, and how the digits bend. The
/// fingers share a spread and a bend ratio, as those of a person do; drawn one by one, half of the hands have fingers
/// that cross.
#[derive(Clone, Copy, Debug)]
struct HandShape {
    /// Where in its range the thumb's yaw is.
    thumb_yaw: f32,
    /// 0: fingers beside each other or as close as they go, 1: as far apart as they go.
    spread: f32,
    /// Of the thumb and of the fingers, as indices into [`BEND_RATIOS`].
    bend_ratios: [usize; 2],
}

impl HandShape {
    fn draw(choice: BendRatioChoice, stream: &mut AttemptStream) -> Self {
        let mut draw_ratio = |digit: Digit| {
            let allowed = allowed_ratios(choice, digit.index());
            allowed[stream.below(allowed.len())]
        };
        let bend_ratios = [draw_ratio(Digit::Thumb), draw_ratio(Digit::Index)];
        Self {
            thumb_yaw: stream.unit(),
            spread: stream.unit(),
            bend_ratios,
        }
    }

    /// Where in its range a digit's yaw is: spread fingers fan out from between middle and ring finger.
    fn yaw_share(&self, digit: Digit) -> f32 {
        let fan = match digit {
            Digit::Thumb => return self.thumb_yaw,
            Digit::Index => -0.5,
            Digit::Middle => -1.0 / 6.0,
            Digit::Ring => 1.0 / 6.0,
            Digit::Little => 0.5,
        };
        0.5 + fan * self.spread
    }
}

/// The hand of an attempt, as far as it came, and its buffers.
#[derive(Clone, Debug, Default)]
pub struct PhysicalAttempt {
    /// Joint angles of the digits that were posed, thumb first.
    pub posed: Vec<DigitAngles>,
    contacts: Vec<Contact>,
    soft_contacts: Vec<SoftContact>,
    buffers: Buffers,
}

impl PhysicalAttempt {
    /// Everything after the wrist was placed.
    pub fn hold(
        &mut self,
        around: &Surroundings<'_>,
        wrist: &WristFrame,
        stream: &mut AttemptStream,
        stopwatch: &mut impl Stopwatch,
        interrupted: &impl Fn() -> bool,
    ) -> PhysicalEnd {
        self.posed.clear();
        let object = &around.holdout.object;

        // Step 3 for what does not move: palm and forearm.
        let opened = HandPose {
            frame_from_wrist: wrist.object_from_wrist,
            digits: around.rig.stretched(),
        };
        let still = HandSolids::of_pose(around.rig, &opened);
        let collides = around.collides_without_digits(&still);
        stopwatch.lap(Step::CollisionValidation);
        if collides {
            return PhysicalEnd::Rejected(Rejection::PalmCollision);
        }

        // Step 2, Finger Posing.
        let shape = HandShape::draw(around.bend_ratios, stream);
        let closings = Digit::ALL.map(|digit| around.closing(digit, wrist, &shape));
        let mut closed = [ClosedDigit::default(); 5];
        for digit in Digit::ALL {
            if interrupted() {
                return PhysicalEnd::Interrupted;
            }
            let Some(ended) = closings[digit.index()].close() else {
                stopwatch.lap(Step::FingerPosing);
                return PhysicalEnd::Rejected(Rejection::FingerCollision);
            };
            if digit == Digit::Thumb && !ended.touches_object() {
                stopwatch.lap(Step::FingerPosing);
                return PhysicalEnd::Rejected(Rejection::NoThumbEarlyStop);
            }
            closed[digit.index()] = ended;
        }
        if !closed[1..].iter().any(ClosedDigit::touches_object) {
            stopwatch.lap(Step::FingerPosing);
            return PhysicalEnd::Rejected(Rejection::NoFingers);
        }
        let digits: [ClosedDigit; 5] = std::array::from_fn(|digit| {
            if closed[digit].touches_object() {
                closed[digit]
            } else {
                closings[digit].relax(resting_flexion(&closed, digit))
            }
        });
        stopwatch.lap(Step::FingerPosing);
        self.posed.extend(digits.iter().map(|digit| digit.angles));
        if interrupted() {
            return PhysicalEnd::Interrupted;
        }

        // Step 3, Collision Validation.
        let pose = HandPose {
            frame_from_wrist: wrist.object_from_wrist,
            digits: digits.map(|digit| digit.angles),
        };
        let solids = HandSolids::of_pose(around.rig, &pose);
        let checked = around.check_digits(&solids);
        stopwatch.lap(Step::CollisionValidation);
        let Some((penetration, giver_distance)) = checked else {
            return PhysicalEnd::Rejected(Rejection::FingerCollision);
        };

        // Step 4, Contact Validation.
        self.collect_contacts(around, &digits);
        let nears_forbidden = |part| {
            object
                .surface
                .comes_within_of(part, FORBIDDEN_CLEARANCE, |triangle| {
                    object.is_forbidden(triangle)
                })
        };
        let is_unwanted = solids.iter().any(nears_forbidden);
        stopwatch.lap(Step::ContactValidation);
        if is_unwanted {
            return PhysicalEnd::Rejected(Rejection::UnwantedContact);
        }

        // Step 5, Immobility Validation. Closure takes up to some 250 µs for grasps that have it, and they are few.
        if interrupted() {
            return PhysicalEnd::Interrupted;
        }
        let held = self.immobilize(around);
        stopwatch.lap(Step::ImmobilityValidation);
        let Some((balance, epsilon)) = held else {
            return PhysicalEnd::Rejected(Rejection::NotImmobilizing);
        };
        let margins = PhysicalMargins {
            residual: balance.residual,
            epsilon,
            penetration,
            giver_clearance: giver_distance,
        };
        let ratios = std::array::from_fn(|digit| {
            digits[digit]
                .touches_object()
                .then_some(closings[digit].bend_ratio)
        });
        PhysicalEnd::Valid(Box::new(self.grasp(around, pose, ratios, &balance, margins)))
    }

    /// Where the links touch: for every link that does, its deepest point, if the surface faces the bone there.
    fn collect_contacts(&mut self, around: &Surroundings<'_>, digits: &[ClosedDigit; 5]) {
        self.contacts.clear();
        self.soft_contacts.clear();
        let surface = &around.holdout.object.surface;
        for (digit, closed) in Digit::ALL.into_iter().zip(digits) {
            for (phalanx, link) in Phalanx::ALL.into_iter().zip(&closed.links) {
                if !closed.touches[phalanx.index()] {
                    continue;
                }
                let Some(touch) = closest(link, surface, 0.0) else {
                    continue;
                };
                let outward = (link.at(touch.along) - touch.point).normalize_or_zero();
                if outward.dot(touch.normal) < FACING_COS {
                    continue;
                }
                self.contacts.push(Contact {
                    position: touch.point,
                    normal: touch.normal,
                    triangle: touch.triangle,
                    digit,
                    phalanx,
                });
                self.soft_contacts.push(SoftContact {
                    position: touch.point,
                    normal: touch.normal,
                    digit: Some(digit),
                    friction: around.scene.friction,
                    torsion_radius: around.scene.friction * TORSION_LEVER,
                });
            }
        }
    }

    /// Forces that balance gravity, and closure.
    fn immobilize(&mut self, around: &Surroundings<'_>) -> Option<(Balance, f32)> {
        let load = &around.scene.load;
        let balance = balance(&self.soft_contacts, load, &mut self.buffers)?;
        let epsilon = epsilon(
            &self.soft_contacts,
            load,
            around.scene.least_epsilon,
            &mut self.buffers,
        );
        (epsilon >= around.scene.least_epsilon).then_some((balance, epsilon))
    }

    fn grasp(
        &self,
        around: &Surroundings<'_>,
        pose: HandPose,
        bend_ratios: [Option<f32>; 5],
        balance: &Balance,
        margins: PhysicalMargins,
    ) -> Grasp {
        let mut totals = [0.0; 5];
        for (contact, force) in self.contacts.iter().zip(&balance.forces) {
            totals[contact.digit.index()] += force.length();
        }
        let sum: glam::Vec3 = balance.forces.iter().sum();
        Grasp {
            pose,
            bend_ratios,
            contacts: self.contacts.clone(),
            forces: balance.forces.clone(),
            torsions: balance.torsions.clone(),
            wrench_angle: sum.angle_between(around.holdout.up),
            comfort: comfort(totals),
            margins: Some(margins),
        }
    }
}

impl<'a> Surroundings<'a> {
    /// One digit, ready to close.
    fn closing(&self, digit: Digit, wrist: &WristFrame, shape: &HandShape) -> Closing<'a> {
        let rig = self.rig.digit(digit);
        let AngleRange { min, max } = rig.limits.base_yaw;
        Closing {
            surface: &self.holdout.object.surface,
            digit: rig,
            radii: link_radii(self.rig, digit),
            object_from_wrist: wrist.object_from_wrist,
            base_yaw: min + (max - min) * shape.yaw_share(digit),
            bend_ratio: BEND_RATIOS[shape.bend_ratios[usize::from(digit != Digit::Thumb)]],
        }
    }

    /// True if palm or forearm sink into the object or come too near to the giver.
    fn collides_without_digits(&self, still: &HandSolids) -> bool {
        let parts = || still.palm.iter().chain(&still.forearm);
        let surface = &self.holdout.object.surface;
        let giver = self.scene.giver.as_ref();
        parts().any(|part| comes_within(part, surface, -DEEPEST))
            || giver.is_some_and(|giver| least_distance(parts(), giver, GIVER_CLEARANCE) < GIVER_CLEARANCE)
    }

    /// How deep the hand is in the object and how far from the giver's, if that and the digits' own distances are in
    /// order.
    fn check_digits(&self, solids: &HandSolids) -> Option<(f32, Option<f32>)> {
        if self_clearance(solids) < 0.0 {
            return None;
        }
        let giver_distance = self
            .scene
            .giver
            .as_ref()
            .map(|giver| giver_clearance(solids, giver));
        if giver_distance.is_some_and(|distance| distance < GIVER_CLEARANCE) {
            return None;
        }
        let surface = &self.holdout.object.surface;
        let least = solids
            .iter()
            .fold(0.0, |least: f32, part| clearance(part, surface, least).min(least));
        (least >= -DEEPEST).then_some((-least, giver_distance))
    }
}

/// The flexion of a digit that touches nothing: that of the digits beside it that touch, at most a relaxed hand's and a
/// half more; that of a relaxed hand if none does.
fn resting_flexion(closed: &[ClosedDigit; 5], digit: usize) -> f32 {
    let neighbours = [digit.checked_sub(1).filter(|&other| other > 0), Some(digit + 1)];
    let mut sum = 0.0;
    let mut count = 0.0;
    for neighbour in neighbours
        .into_iter()
        .flatten()
        .filter_map(|other| closed.get(other))
    {
        if neighbour.touches_object() {
            sum += neighbour.flexion();
            count += 1.0;
        }
    }
    if count == 0.0 {
        RESTING_FLEXION
    } else {
        (sum / count).clamp(0.5 * RESTING_FLEXION, 1.5 * RESTING_FLEXION)
    }
}
