//! The grasp that a track holds on to.

use std::time::Duration;

use grasp_proto::v1;

use crate::{
    answer::wire_pose,
    convention::Convention,
    validate::{Frame, TrackPolicy},
};

/// What a track remembers from one answer to the next.
#[derive(Debug, Default)]
pub(crate) struct Holding {
    /// The grasp of the last answer that had one, as it was found: repeating it from frame to frame would add up rounding.
    hand: Option<v1::HandAtObject>,
    /// When it was found, on the client's clock.
    changed: Option<Duration>,
    /// From a committed grasp that fell until a frame says that the hand is no longer closing: how it fell.
    aborted: Option<v1::StandingReport>,
}

impl Holding {
    /// What stands when a frame is answered; none before the first grasp.
    pub(crate) fn standing(
        &self,
        frame: &Frame,
        policy: &TrackPolicy,
        convention: Convention,
    ) -> Option<v1::StandingGrasp> {
        let hand = self.hand.clone()?;
        let may_change = match (frame.captured, self.changed) {
            (Some(now), Some(changed)) => now.saturating_sub(changed) >= policy.least_time_between_changes,
            _ => true,
        };
        let object_from_client = frame.query.client_from_object.inverse();
        // Distances from a hand of the other side say nothing.
        let present = frame
            .receiving_hand
            .as_ref()
            .filter(|present| present.hand.handedness == hand.handedness);
        Some(v1::StandingGrasp {
            present: present.map(|present| v1::HandAtObject {
                object_from_wrist: Some(wire_pose(
                    convention.joint_from_openxr(object_from_client * present.client_from_wrist),
                )),
                ..present.hand.clone()
            }),
            hand: Some(hand),
            better_by: policy.better_by.filter(|_| may_change),
            committed: frame.is_committed,
        })
    }

    /// How the committed grasp fell, if the hand still goes on closing: it is not taken up again.
    pub(crate) fn aborted(&mut self, is_committed: bool) -> Option<&v1::StandingReport> {
        if !is_committed {
            self.aborted = None;
        }
        self.aborted.as_ref()
    }

    /// Learns what became of the grasp. `hand_scale` is that of the track's receiving hand.
    pub(crate) fn learn(
        &mut self,
        report: &v1::StandingReport,
        grasp: Option<&v1::Grasp>,
        hand_scale: Option<f32>,
        captured: Option<Duration>,
    ) {
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
                    self.changed = captured;
                }
            }
            (v1::StandingStatus::Aborted, _) => self.aborted = Some(report.clone()),
            _ => {}
        }
    }
}
