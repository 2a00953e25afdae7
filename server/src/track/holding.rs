//! The grasp that a track holds on to.

use std::time::Duration;

use grasp_proto::v1;
use grasp_synthesis::{model::hand::Handedness, search::standing::Grace};

use crate::{
    answer::wire_pose,
    convention::Convention,
    error::ServiceError,
    rigs::store::RigStore,
    validate::{Frame, TrackPolicy},
};

/// How much too close to a hand a grasp may be while its grace lasts, in metres: a headset's noise, and a sway where every other grasp would
/// be touched by it, too.
const GRACE: Grace = Grace {
    always: 0.001,
    alone: 0.012,
};

/// Longest time between frames of which a single one may be wrong: five at 90 Hz. What is still so after more is real.
const MAX_SINGLE_GAP: Duration = Duration::from_millis(50);

/// What a track remembers from one answer to the next.
#[derive(Debug, Default)]
pub(crate) struct Holding {
    /// The grasp of the last answer that had one, as it was found: repeating it from frame to frame would add up rounding.
    hand: Option<v1::HandAtObject>,
    /// When it was found.
    changed: Option<Duration>,
    /// When it was last valid without any grace.
    valid: Duration,
    /// Whether it was so in the answer before.
    was_valid: bool,
    /// From a committed grasp that fell until a frame says that the hand is no longer closing: how it fell.
    aborted: Option<v1::StandingReport>,
    /// Whether an answer has contained the whole grasp.
    is_sent: bool,
}

impl Holding {
    /// With a grasp to begin with.
    pub(crate) fn of(hand: Option<v1::HandAtObject>) -> Self {
        Self {
            hand,
            ..Self::default()
        }
    }

    /// Makes a frame of a time one with what stands.
    ///
    /// # Errors
    /// [`ServiceError::Invalid`] if it is another hand, as after a change of the rig.
    pub(crate) fn hold(
        &mut self,
        frame: &mut Frame,
        at: Duration,
        policy: &TrackPolicy,
        convention: Convention,
        rigs: &RigStore,
    ) -> Result<(), ServiceError> {
        if frame.restarts_clock {
            (self.changed, self.valid) = (Some(at), at);
        }
        let Some(standing) = self.standing(frame, at, policy, convention) else {
            return Ok(());
        };
        if !policy.may_change_hand
            && let Some(hand) = &self.hand
        {
            frame.query.keep_hand(match hand.handedness() {
                v1::Handedness::Left => Handedness::Left,
                v1::Handedness::Right | v1::Handedness::Unspecified => Handedness::Right,
            });
        }
        frame.query.hold_on_to(standing, rigs)?;
        if let Some(standing) = &mut frame.query.standing {
            standing.grasp.grace = self.grace(at, policy.grace);
        }
        Ok(())
    }

    /// What stands when a frame is answered; none before the first grasp.
    fn standing(
        &self,
        frame: &Frame,
        at: Duration,
        policy: &TrackPolicy,
        convention: Convention,
    ) -> Option<v1::StandingGrasp> {
        let hand = self.hand.clone()?;
        let least = policy.least_time_between_changes;
        let may_change = self
            .changed
            .is_none_or(|changed| at.saturating_sub(changed) >= least);
        let object_from_client = frame.query.client_from_object.inverse();
        // Distances from a hand of the other side say nothing.
        let present = frame
            .receiving_hand
            .as_ref()
            .filter(|present| present.hand.handedness == hand.handedness);
        Some(v1::StandingGrasp {
            present: present.map(|present| v1::HandAtObject {
                object_from_wrist: Some(wire_pose(
                    convention.joint_at_object_from_openxr(object_from_client * present.client_from_wrist),
                )),
                ..present.hand.clone()
            }),
            hand: Some(hand),
            better_by: policy.better_by.filter(|_| may_change),
            committed: frame.is_committed,
        })
    }

    /// How much too close to a hand the grasp may be now: anything in a single frame, then a little, in the end nothing.
    fn grace(&self, at: Duration, grace: Duration) -> Grace {
        let since = at.saturating_sub(self.valid);
        if grace.is_zero() {
            Grace::default()
        } else if self.was_valid && since <= MAX_SINGLE_GAP {
            Grace {
                always: f32::INFINITY,
                ..GRACE
            }
        } else if since <= grace {
            GRACE
        } else {
            Grace::default()
        }
    }

    /// True if the committed grasp fell, and the hand still goes on closing: it is not taken up again.
    pub(crate) fn is_aborted(&mut self, is_committed: bool) -> bool {
        if !is_committed {
            self.aborted = None;
        }
        self.aborted.is_some()
    }

    /// The report on an aborted grasp that was looked at again: what is in the way now.
    pub(crate) fn still_aborted(&self, report: v1::StandingReport) -> v1::StandingReport {
        let before = self.aborted.as_ref();
        v1::StandingReport {
            status: v1::StandingStatus::Aborted.into(),
            fall: report.fall,
            withdrawal: report
                .withdrawal
                .or_else(|| before.and_then(|before| before.withdrawal.clone())),
            ..Default::default()
        }
    }

    /// Learns what became of the grasp. `hand_scale` is that of the track's receiving hand. True if the client knows the grasp.
    pub(crate) fn learn(
        &mut self,
        report: &v1::StandingReport,
        grasp: Option<&v1::Grasp>,
        hand_scale: Option<f32>,
        at: Duration,
    ) -> bool {
        let is_known = self.is_sent && report.status() == v1::StandingStatus::Kept;
        self.was_valid =
            grasp.is_some() && !(report.status() == v1::StandingStatus::Kept && report.fall.is_some());
        if self.was_valid {
            self.valid = at;
        }
        match (report.status(), grasp) {
            (v1::StandingStatus::Adjusted | v1::StandingStatus::Replanned, Some(grasp)) => {
                self.hand = Some(v1::HandAtObject {
                    rig: grasp.rig.clone(),
                    handedness: grasp.handedness,
                    hand_scale,
                    object_from_wrist: grasp.object_from_wrist,
                    digits: grasp.digits.clone(),
                });
                if report.status() == v1::StandingStatus::Replanned {
                    self.changed = Some(at);
                }
            }
            (v1::StandingStatus::Aborted, _) => self.aborted = Some(report.clone()),
            _ => {}
        }
        self.is_sent |= grasp.is_some();
        is_known
    }
}
