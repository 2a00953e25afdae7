//! Accessors of answers.

use std::time::Duration;

use glam::Vec3;

use crate::{
    v1,
    values::{std_duration, vector},
};

impl v1::FindGraspResponse {
    /// The grasp found: with both hands, the first one's.
    #[must_use]
    pub fn grasp(&self) -> Option<&v1::Grasp> {
        self.grasps.first()
    }

    /// The hand of that grasp.
    #[must_use]
    pub fn hand(&self) -> Option<&v1::HandPose> {
        self.grasp()?.hand.as_ref()
    }

    /// Status of the request's current grasp; unspecified if it has none.
    #[must_use]
    pub fn status(&self) -> v1::CurrentGraspStatus {
        let report = self.current.as_ref();
        report.map(v1::CurrentGraspReport::status).unwrap_or_default()
    }

    /// Attempts of the search.
    #[must_use]
    pub fn attempts(&self) -> u64 {
        self.report.as_ref().map_or(0, |report| report.attempts)
    }

    /// Time of the search; of a streamed grasp, until it was found.
    #[must_use]
    pub fn search_time(&self) -> Duration {
        let time = self.report.as_ref().and_then(|report| report.search_time);
        time.map(std_duration).unwrap_or_default()
    }

    /// The grasp's origin.
    #[must_use]
    pub fn source(&self) -> v1::GraspSource {
        let origin = self.origin.as_ref();
        origin.map(v1::GraspOrigin::source).unwrap_or_default()
    }
}

impl v1::Grasp {
    /// The wrist's joint in the client's frame.
    #[must_use]
    pub fn client_from_wrist(&self) -> Option<v1::Pose> {
        self.hand.as_ref()?.client_from_wrist
    }

    /// The wrist's joint in the object's frame.
    #[must_use]
    pub fn object_from_wrist(&self) -> Option<v1::Pose> {
        self.hand.as_ref()?.object_from_wrist
    }

    /// The contacts in the client's frame.
    #[must_use]
    pub fn client_contacts(&self) -> Vec<v1::Contact> {
        let hand = self.hand.as_ref();
        let client_from_object = hand.and_then(v1::HandPose::client_from_object);
        let client_from_object = client_from_object.unwrap_or_default();
        let turn = client_from_object.orientation();
        let moved = |contact: &v1::Contact| v1::Contact {
            position: Some(client_from_object.transform_point(contact.position()).into()),
            normal: Some((turn * contact.normal()).into()),
            force: Some((turn * contact.force()).into()),
            ..*contact
        };
        self.contacts.iter().map(moved).collect()
    }

    /// The margin by which the grasp passes a physical check, if that was measured.
    #[must_use]
    pub fn margin(&self, check: v1::Check) -> Option<f32> {
        let margin = self.margins.iter().find(|margin| margin.check() == check)?;
        margin.value
    }

    /// The grasp as one to hold on to in the next request.
    #[must_use]
    pub fn current(&self) -> v1::CurrentGrasp {
        v1::CurrentGrasp::new(self.hand.clone().unwrap_or_default())
    }
}

impl v1::Contact {
    /// The point on the surface.
    #[must_use]
    pub fn position(&self) -> Vec3 {
        vector(self.position)
    }

    /// The surface's outward unit normal.
    #[must_use]
    pub fn normal(&self) -> Vec3 {
        vector(self.normal)
    }

    /// The force that the hand applies.
    #[must_use]
    pub fn force(&self) -> Vec3 {
        vector(self.force)
    }
}

impl v1::TrackAnswer {
    /// Status of the grasp; unspecified for a frame that a later one overtook.
    #[must_use]
    pub fn status(&self) -> v1::CurrentGraspStatus {
        let report = self.current.as_ref();
        report.map(v1::CurrentGraspReport::status).unwrap_or_default()
    }

    /// From the frame's arrival to its answer.
    #[must_use]
    pub fn server_time(&self) -> Duration {
        self.server_time.map(std_duration).unwrap_or_default()
    }
}
