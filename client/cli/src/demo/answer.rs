//! Requests of the demo, and their answers.

use std::time::{Duration, Instant};

use grasp_assets::holdouts::BuiltInHoldout;
use grasp_client::{GraspClient, Outcome, v1};
use grasp_scene::client::ObjectLook;
use serde_json::{Value, json};

use super::draw::Files;
use crate::{
    Failure,
    format::{comfort, grasp_type_name, human_time},
    output::message_json,
    picture::Picture,
};

/// A holdout of the demo, with the answer to its request.
#[derive(Clone, Debug)]
pub(super) struct AnsweredHoldout {
    pub(super) holdout: &'static BuiltInHoldout,
    pub(super) picture: Picture,
    pub(super) answer: v1::FindGraspResponse,
    round_trip: Duration,
}

impl AnsweredHoldout {
    /// Asks for a grasp.
    pub(super) async fn ask(
        client: &GraspClient,
        holdout: &'static BuiltInHoldout,
        look: ObjectLook,
        request: &v1::FindGraspRequest,
    ) -> Result<Self, Failure> {
        let picture = Picture::new(look, request)?;
        let start = Instant::now();
        let answer = client.find_grasp(request).await?;
        let round_trip = start.elapsed();
        Ok(Self {
            holdout,
            picture: picture.with_grasps(answer.grasps.clone()),
            answer,
            round_trip,
        })
    }

    pub(super) fn is_found(&self) -> bool {
        self.answer.outcome() == Outcome::Found
    }

    /// The line below its picture in the overview.
    pub(super) fn caption(&self) -> String {
        let missing = if self.is_found() { "" } else { ": no grasp" };
        format!("{}{missing}", self.holdout.name)
    }

    /// The cells that tables have of a grasp: its type and comfort.
    pub(super) fn type_and_comfort(&self) -> [String; 2] {
        let grasp = self.answer.grasp();
        let cells = grasp.map(|grasp| [grasp_type_name(grasp), comfort(grasp)]);
        cells.unwrap_or_else(|| ["-".to_owned(), "-".to_owned()])
    }

    /// The cells that tables have of times: the server's, and the round trip's.
    pub(super) fn times(&self) -> [String; 2] {
        [self.answer.search_time(), self.round_trip].map(|time| human_time(time.as_secs_f64()))
    }

    /// What the output of `--json` has of all.
    pub(super) fn to_json(&self, files: &Files) -> Result<Value, Failure> {
        Ok(json!({
            "picture": files.picture,
            "scene": files.scene,
            "answer": message_json(&self.answer)?,
            "round_trip_seconds": self.round_trip.as_secs_f64(),
        }))
    }
}
