//! A moving giver: frames come, the latest is answered, and the grasp of the previous answer is kept as long as it is valid.
//!
//! Nothing queues here. Frames go to an [`Inbox`], where a later one replaces an untaken one. On a stream, an answer is computed
//! when the transport requests it and, if the frames say how many answers were read, when few are unread: the transport holds many
//! more. A created track, one of [`OpenTracks`], has a task that answers the calls which push its frames. Each frame is a request
//! to find a grasp with a current one, which is in [`HeldGrasp`]; [`RecentHands`] are the places of hands to keep clear of.

mod inbox;
mod motion;
#[cfg(all(test, shuttle))]
mod orders;

use std::{collections::VecDeque, sync::Arc, time::Duration};

use grasp_proto::v1;
use grasp_synthesis::{
    model::hand::{Handedness, joints::HandJoints},
    search::current::Grace,
};

pub(crate) use inbox::{Inbox, OpenTracks, PendingFrame, Reply, not_found};
pub(crate) use motion::{Motion, PredictionError};

use crate::{
    error::ServiceError,
    rigs::store::RigStore,
    validate::{FindQuery, Frame, GiverHand, TrackPolicy},
};

/// Tolerance of clearance from hands while the grace lasts, in metres: a headset's noise, and a sway where every other grasp would
/// be touched by it, too.
const GRACE: Grace = Grace {
    always: 0.001,
    alone: 0.012,
};

/// Longest time between frames of which a single one may be wrong: five at 90 Hz.
const MAX_SINGLE_GAP: Duration = Duration::from_millis(50);

/// The state of a track between answers.
#[derive(Debug, Default)]
pub(crate) struct HeldGrasp {
    /// The grasp of the last answer that had one, as found: repeating it from frame to frame would add up rounding.
    hand: Option<v1::HandPose>,
    /// When it was found.
    changed: Option<Duration>,
    /// When it was last valid without any grace.
    valid: Duration,
    /// Whether it was valid without grace in the previous answer.
    was_valid: bool,
    /// How a committed grasp failed a check, until a frame says that the hand is not closing.
    aborted: Option<v1::CurrentGraspReport>,
    /// Whether the client has an answer with the whole grasp.
    pub is_sent: bool,
}

impl HeldGrasp {
    pub(crate) fn of(hand: Option<v1::HandPose>) -> Self {
        Self {
            hand,
            ..Self::default()
        }
    }

    /// Makes a frame of a time one with a current grasp.
    pub(crate) fn hold(
        &mut self,
        frame: &mut Frame,
        at: Duration,
        policy: &TrackPolicy,
        rigs: &RigStore,
    ) -> Result<(), ServiceError> {
        if frame.restarts_clock {
            (self.changed, self.valid) = (Some(at), at);
        }
        let grace = self.grace(at, policy.grace);
        let Frame { query, .. } = frame;
        query.changes_only &= self.is_sent;
        let Some(hand) = &mut self.hand else {
            return Ok(());
        };
        if !policy.may_change_hand {
            query.keep_hand(match hand.handedness() {
                v1::Handedness::Left => Handedness::Left,
                v1::Handedness::Right | v1::Handedness::Unspecified => Handedness::Right,
            });
        }
        let may_change = self
            .changed
            .is_none_or(|changed| at.saturating_sub(changed) >= policy.min_dwell);
        // Distances from the other hand mean nothing.
        let present = frame.receiving_hand.take();
        let current = v1::CurrentGrasp {
            grasp: Some(hand.clone()),
            hand: present.filter(|present| present.handedness == hand.handedness),
            min_score_gain: policy.min_score_gain.filter(|_| may_change),
            committed: frame.is_committed,
        };
        query.hold_on_to(current, rigs)?;
        if let Some(current) = &mut query.current {
            current.grasp.grace = grace;
            if hand.object_from_wrist.is_none() {
                // Its place at the object of the first frame.
                hand.object_from_wrist = Some(current.object_from_wrist);
                hand.convention = v1::Convention::Unspecified.into();
            }
        }
        Ok(())
    }

    /// The tolerance of the grasp's clearance: any in a single frame, then a little, in the end none.
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

    /// True if the committed grasp failed a check and the hand is still closing: it is not resumed.
    pub(crate) fn is_aborted(&mut self, is_committed: bool) -> bool {
        if !is_committed {
            self.aborted = None;
        }
        self.aborted.is_some()
    }

    /// The report on an aborted grasp after another check: the check that it fails.
    pub(crate) fn still_aborted(&self, report: v1::CurrentGraspReport) -> v1::CurrentGraspReport {
        let before = self.aborted.as_ref();
        v1::CurrentGraspReport {
            status: v1::CurrentGraspStatus::Aborted.into(),
            failed_check: report.failed_check,
            withdrawal: report
                .withdrawal
                .or_else(|| before.and_then(|before| before.withdrawal.clone())),
            ..Default::default()
        }
    }

    pub(crate) fn learn(&mut self, report: &v1::CurrentGraspReport, grasp: Option<&v1::Grasp>, at: Duration) {
        let status = report.status();
        self.was_valid =
            grasp.is_some() && !(status == v1::CurrentGraspStatus::Kept && report.failed_check.is_some());
        if self.was_valid {
            self.valid = at;
        }
        match (status, grasp) {
            (v1::CurrentGraspStatus::Adjusted | v1::CurrentGraspStatus::Replanned, Some(grasp)) => {
                self.hand = grasp.hand.clone().map(|hand| v1::HandPose {
                    joints: Vec::new(),
                    model: Vec::new(),
                    ..hand
                });
                if status == v1::CurrentGraspStatus::Replanned {
                    self.changed = Some(at);
                }
            }
            (v1::CurrentGraspStatus::Aborted, _) => self.aborted = Some(report.clone()),
            _ => {}
        }
        self.is_sent |= grasp.is_some();
    }
}

/// How long hands are remembered: some periods of a sway.
const REMEMBERED: Duration = Duration::from_secs(1);

/// Time between two remembered frames: a hand that sways five times a second is seen at its turning points.
const APART: Duration = Duration::from_millis(20);

/// The hands of the last second, oldest first.
#[derive(Debug, Default)]
pub(crate) struct RecentHands {
    seen: VecDeque<(Duration, Arc<HandJoints>)>,
}

impl RecentHands {
    /// Adds the hands of a frame, and gives its query their past places. Meshes are not remembered.
    pub(crate) fn add(&mut self, at: Duration, query: &mut FindQuery) {
        // After a restart of the clock, hands seen before are later than this frame.
        let is_recent = |&(seen, _): &(Duration, _)| seen <= at && at.saturating_sub(seen) <= REMEMBERED;
        self.seen.retain(is_recent);
        let object_from_client = query.client_from_object.inverse();
        let hands = query.presenting_hand.iter().chain(&query.other_hands);
        let now: Vec<Arc<HandJoints>> = hands
            .filter_map(|hand| match hand {
                GiverHand::Jointed(hand) => Some(Arc::new(hand.joints.transformed(object_from_client))),
                GiverHand::Meshed(_) => None,
            })
            .collect();
        if now.is_empty() {
            self.seen.clear();
            return;
        }
        let before = self.seen.iter().map(|(_, hand)| hand);
        query.search.recent_hands = before.chain(&now).cloned().collect();
        if self
            .seen
            .back()
            .is_none_or(|&(last, _)| at.saturating_sub(last) >= APART)
        {
            self.seen.extend(now.into_iter().map(|hand| (at, hand)));
        }
    }
}
