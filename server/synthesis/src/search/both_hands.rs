//! One attempt at holding an object with both hands: a hand that holds one side of it, and tries for the other hand on the other
//! side.

use glam::Vec3;

use super::attempt::Course;
use crate::{
    base::{
        pose::Pose,
        rejection::{Failure, Rejection},
        stopwatch::Step,
    },
    model::grasp::Grasp,
    physical::{
        both_hands::{HalfGrip, are_clear, suits_one_body},
        grip::Gripper,
        immobility::Buffers,
        shape::Proposal,
        solids::PreparedHand,
    },
    propose::{
        both_hands::{Aim, Mirror},
        prepared::PreparedRig,
    },
    rating::{
        assessment::{GraspContext, assess_both},
        scoring::middle,
    },
};

/// Hands tried opposite a hand that holds its side. More find holds of lopsided objects sooner, those of others later.
const OTHER_HANDS: usize = 8;

/// Share of attempts whose first hand must have a mirror image that suits the same body. The others find holds without symmetry.
const SYMMETRIC_SHARE: f32 = 0.75;

/// The first hand of an attempt, as far as it got, and the buffers of both.
#[derive(Clone, Debug)]
pub(super) struct BothHands {
    /// Closes the first hand.
    pub first: Gripper,
    /// Where the first hand's wrist was placed; `None` if no placement fits.
    pub placed: Option<Pose>,
    other: Gripper,
    buffers: Buffers,
}

impl Default for BothHands {
    fn default() -> Self {
        Self {
            first: Gripper::sharing(),
            placed: None,
            other: Gripper::sharing(),
            buffers: Buffers::default(),
        }
    }
}

/// A first hand that holds its side, and what the other hand needs to know of it.
struct First<'a> {
    around: &'a GraspContext<'a>,
    proposal: Proposal,
    half: HalfGrip,
    /// Its solids as an obstacle.
    obstacle: PreparedHand,
    /// The middle of its contacts.
    place: Vec3,
}

impl BothHands {
    /// Draws and closes a hand, then up to [`OTHER_HANDS`] other hands until one holds together with it.
    ///
    /// # Errors
    /// The first failed check of the first hand, or of the last other hand; or the stop signal.
    pub(super) fn hold(
        &mut self,
        [around, around_other]: [&GraspContext<'_>; 2],
        other_rig: &PreparedRig,
        course: &mut Course<'_, '_>,
    ) -> Result<Box<Grasp>, Failure> {
        self.placed = None;
        self.first.posed.clear();
        let first = self.hold_first(around, around_other, course)?;
        let object = around.object.object;
        let up = around.presented.up;
        let mirrors: Vec<Mirror> = Mirror::facing(object, up, first.place)
            .into_iter()
            .chain(Mirror::of_object(object, up))
            .filter(|mirror| mirror.has_room(first.place))
            .collect();
        let admits = |wrist: Pose| {
            around.requirements.admits_wrist(wrist)
                && suits_one_body(
                    [
                        (around.rig, first.half.grip.pose.frame_from_wrist),
                        (around_other.rig, wrist),
                    ],
                    up,
                )
        };
        let place = course.scene.place_of(other_rig);
        let mut rejection = Rejection::NoContacts;
        for attempt in 0..OTHER_HANDS {
            let proposal = if let Some(mirror) = mirrors.get(attempt) {
                Some(mirror.proposal(&first.proposal))
            } else {
                let across = match mirrors.len() {
                    0 => 2.0 * object.centre_of_mass - first.place,
                    count => mirrors[course.stream.below(count)].point(first.place),
                };
                place.propose_half(Aim::Near(across), admits, course.stream, course.stop)
            };
            course.stopwatch.lap(Step::WristPlacement);
            course.stop.check()?;
            let Some(proposal) = proposal else { continue };
            match self.complete(&first, around_other, &proposal, admits, course) {
                Err(Failure::Rejected { rejection: other, .. }) => rejection = other,
                end => return end,
            }
        }
        Err(rejection.into())
    }

    /// Draws and closes the first hand.
    fn hold_first<'a>(
        &mut self,
        around: &'a GraspContext<'_>,
        around_other: &GraspContext<'_>,
        course: &mut Course<'_, '_>,
    ) -> Result<First<'a>, Failure> {
        let object = around.object.object;
        let up = around.presented.up;
        let is_symmetric = course.stream.unit() < SYMMETRIC_SHARE;
        let admits = |wrist: Pose| {
            let palm = wrist.transform_point(around.rig.palm);
            let suits = |mirror: Mirror| {
                mirror.has_room(palm)
                    && suits_one_body([(around.rig, wrist), (around_other.rig, mirror.wrist(wrist))], up)
            };
            around.requirements.admits_wrist(wrist)
                && (!is_symmetric
                    || Mirror::facing(object, up, palm)
                        .into_iter()
                        .chain(Mirror::of_object(object, up))
                        .any(suits))
        };
        let aim = Aim::Outside {
            centre: object.centre_of_mass,
            up,
        };
        let proposal = course.scene.place_of(course.scene.task.rig).propose_half(
            aim,
            admits,
            course.stream,
            course.stop,
        );
        course.stopwatch.lap(Step::WristPlacement);
        course.stop.check()?;
        let proposal = proposal.ok_or(Rejection::NoContacts)?;
        self.placed = Some(proposal.object_from_wrist);
        let half = close_half(&mut self.first, around, &proposal, course)?;
        Ok(First {
            around,
            proposal,
            obstacle: PreparedHand::new(&half.tracked(around.rig)),
            place: middle(half.contacts.iter()),
            half,
        })
    }

    /// Closes the other hand and checks that both hold together.
    fn complete(
        &mut self,
        first: &First<'_>,
        around: &GraspContext<'_>,
        proposal: &Proposal,
        admits: impl Fn(Pose) -> bool,
        course: &mut Course<'_, '_>,
    ) -> Result<Box<Grasp>, Failure> {
        let half = close_half(&mut self.other, around, proposal, course)?;
        // Closing may have moved either wrist since its placement.
        if !admits(half.grip.pose.frame_from_wrist) {
            return Err(Rejection::UnmetRequirement.into());
        }
        let is_clear = are_clear(&first.obstacle, &half.tracked(around.rig));
        course.stopwatch.lap(Step::CollisionValidation);
        if !is_clear {
            return Err(Rejection::FingerCollision.into());
        }
        Ok(assess_both(
            [first.around, around],
            [&first.half, &half],
            &mut self.buffers,
            course.stopwatch,
        )?)
    }
}

/// Closes one hand.
fn close_half(
    gripper: &mut Gripper,
    around: &GraspContext<'_>,
    proposal: &Proposal,
    course: &mut Course<'_, '_>,
) -> Result<HalfGrip, Failure> {
    let GraspContext {
        object,
        presented,
        rig,
        ..
    } = around;
    let (grip, solids) = gripper.grip(
        object,
        rig,
        proposal,
        Some(presented),
        course.stopwatch,
        course.stop,
    )?;
    Ok(HalfGrip {
        grip,
        solids,
        contacts: gripper.contacts.clone(),
    })
}
