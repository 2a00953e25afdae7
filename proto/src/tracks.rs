//! Tracks of givers who move.

use std::time::Duration;

use crate::{
    v1,
    values::{std_duration, wire_duration},
};

/// The same holdout and current grasp, without what comes with frames.
impl From<v1::FindGraspRequest> for v1::Track {
    fn from(request: v1::FindGraspRequest) -> Self {
        let current = request.current.unwrap_or_default();
        Self {
            holdout: request.holdout.map(|holdout| v1::Holdout {
                client_from_object: None,
                presenting_hand: None,
                other_hands: Vec::new(),
                obstacles: Vec::new(),
                ..holdout
            }),
            receiver: request.receiver,
            requirements: request.requirements,
            search: request.search,
            output: request.output,
            current: current.grasp,
            min_score_gain: current.min_score_gain,
            ..Self::default()
        }
    }
}

impl v1::TrackFrame {
    /// A frame of a holdout, without what is the track's.
    #[must_use]
    pub fn of(sequence: u64, holdout: v1::Holdout) -> Self {
        Self {
            sequence,
            holdout: Some(v1::Holdout {
                scale: None,
                mass_kg: None,
                ..holdout
            }),
            ..Self::default()
        }
    }

    /// The same frame captured then, since any moment.
    #[must_use]
    pub fn captured_at(self, time: Duration) -> Self {
        Self {
            capture_time: Some(wire_duration(time)),
            ..self
        }
    }

    /// When it was captured, since any moment.
    #[must_use]
    pub fn capture_time(&self) -> Option<Duration> {
        self.capture_time.map(std_duration)
    }

    /// The object's frame in the client's frame.
    #[must_use]
    pub fn client_from_object(&self) -> v1::Pose {
        let pose = self
            .holdout
            .as_ref()
            .and_then(|holdout| holdout.client_from_object);
        pose.unwrap_or_default()
    }
}

impl v1::TrackAnswer {
    /// What became of the grasp; unspecified for a frame that a later one overtook.
    #[must_use]
    pub fn status(&self) -> v1::CurrentGraspStatus {
        self.current
            .as_ref()
            .map(v1::CurrentGraspReport::status)
            .unwrap_or_default()
    }

    /// From the frame's arrival to its answer.
    #[must_use]
    pub fn server_time(&self) -> Duration {
        self.server_time.map(std_duration).unwrap_or_default()
    }
}
