//! Where object and givers will be when an answer is shown, by the velocity that they have; and how far off that was.

mod path;

use std::{collections::VecDeque, time::Duration};

use grasp_synthesis::{
    base::pose::Pose,
    model::hand::joints::{HandJoints, JOINT_COUNT},
};

use crate::validate::{FindQuery, GiverHand};
use path::{Body, Path};

/// Frames farther apart say nothing about what was between them.
const MAX_GAP: Duration = Duration::from_millis(250);

/// Most predictions that wait for their time: half a second at 90 Hz, and some more.
const MAX_PREDICTIONS: usize = 64;

/// What moves in a track.
#[derive(Debug)]
pub(crate) struct Motion {
    ahead: Duration,
    object: Path,
    /// The giver's hand, then the others.
    hands: Vec<Path>,
    /// The frame before.
    before: Option<State>,
    /// Oldest first.
    predictions: VecDeque<State>,
    last_error: Option<PredictionError>,
}

/// Object and hands at one time.
#[derive(Clone, Debug)]
struct State {
    at: Duration,
    client_from_object: Pose,
    /// The giver's hand, then the others.
    hands: Vec<Option<Body>>,
}

/// How far off a prediction was.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PredictionError {
    /// Distance of the object's origin, in metres.
    pub object_distance: f32,
    /// Angle between the object's orientations, in radians.
    pub object_angle: f32,
    /// Largest distance of a joint of the giver's hand, in metres; `None` unless its joints are known.
    pub giver_distance: Option<f32>,
}

impl Motion {
    /// Nothing was seen yet. Predictions are `ahead` of frames.
    pub(crate) fn new(ahead: Duration) -> Self {
        Self {
            ahead,
            object: Path::default(),
            hands: Vec::new(),
            before: None,
            predictions: VecDeque::new(),
            last_error: None,
        }
    }

    /// Adds a frame, and moves its query on to the predicted time. It stays as it is while no velocity is known.
    pub(crate) fn predict(&mut self, at: Duration, query: &mut FindQuery) {
        let now = State::of(at, query);
        let object = Body::Rigid(now.client_from_object);
        if self.object.add(at, &object) {
            // No prediction foresees a jump.
            self.predictions.clear();
        } else {
            self.compare(&now);
        }
        self.hands.resize_with(now.hands.len(), Path::default);
        let ahead = self.ahead;
        let hands = self.hands.iter_mut().zip(&now.hands);
        let predicted = State {
            at: at + ahead,
            client_from_object: self.object.ahead(at, &object, ahead).frame(),
            hands: hands
                .map(|(path, hand)| {
                    let Some(hand) = hand else {
                        *path = Path::default();
                        return None;
                    };
                    path.add(at, hand);
                    Some(path.ahead(at, hand, ahead))
                })
                .collect(),
        };
        predicted.clone().apply(&now, query);
        if self.object.is_known() {
            self.predictions.push_back(predicted);
        }
        self.before = Some(now);
        // A frame that comes no more leaves its prediction unanswered.
        if self.predictions.len() > MAX_PREDICTIONS {
            self.predictions.pop_front();
        }
    }

    /// How far off the last prediction was whose time has come.
    pub(crate) fn last_error(&self) -> Option<PredictionError> {
        self.last_error
    }

    /// Compares the predictions whose time has come with what is now and was before.
    fn compare(&mut self, now: &State) {
        while let Some(prediction) = self
            .predictions
            .pop_front_if(|prediction| prediction.at <= now.at)
        {
            let Some(before) = &self.before else { continue };
            let between = now.at.saturating_sub(before.at);
            if between.is_zero() || prediction.at < before.at || between > MAX_GAP {
                continue;
            }
            let share = prediction.at.saturating_sub(before.at).as_secs_f32() / between.as_secs_f32();
            self.last_error = Some(prediction.error(before, now, share));
        }
    }
}

/// A hand to keep clear of, as it moves.
fn body_of(hand: &GiverHand, client_from_object: Pose) -> Body {
    match hand {
        GiverHand::Jointed(hand) => Body::Joints(Box::new(hand.joints.clone())),
        // If its wrist is not known, with the object that it holds.
        GiverHand::Meshed(hand) => Body::Rigid(hand.client_from_wrist.unwrap_or(client_from_object)),
    }
}

/// Moves a hand that is as `now` to where `predicted` is.
fn apply(predicted: Body, now: &Body, hand: &mut GiverHand) {
    match (predicted, hand) {
        (Body::Joints(joints), GiverHand::Jointed(hand)) => hand.joints = *joints,
        (Body::Rigid(predicted), hand @ GiverHand::Meshed(_)) => {
            hand.move_by(predicted * now.frame().inverse());
        }
        _ => {}
    }
}

impl State {
    fn of(at: Duration, query: &FindQuery) -> Self {
        let object = query.client_from_object;
        let state = |hand| body_of(hand, object);
        let first = query.presenting_hand.as_ref().map(state);
        let others = query.other_hands.iter().map(|hand| Some(state(hand)));
        Self {
            at,
            client_from_object: object,
            hands: std::iter::once(first).chain(others).collect(),
        }
    }

    /// Moves a query that is as `now` to where this is.
    fn apply(self, now: &Self, query: &mut FindQuery) {
        query.client_from_object = self.client_from_object;
        let hands = query.presenting_hand.iter_mut().map(Some);
        // Without a presenting hand, its place in the states is empty.
        let hands = hands.chain(self.hands.first().is_some_and(Option::is_none).then_some(None));
        let hands = hands.chain(query.other_hands.iter_mut().map(Some));
        for ((hand, predicted), now) in hands.zip(self.hands).zip(&now.hands) {
            if let (Some(hand), Some(predicted), Some(now)) = (hand, predicted, now) {
                apply(predicted, now, hand);
            }
        }
    }

    /// The distance of this prediction from what was between two frames, `share` of the time after the first.
    fn error<'a>(&'a self, before: &'a Self, after: &'a Self, share: f32) -> PredictionError {
        let real = between(before.client_from_object, after.client_from_object, share);
        let joints = |state: &'a Self| match state.hands.first() {
            Some(Some(Body::Joints(joints))) => Some(joints),
            _ => None,
        };
        let giver_distance = match (joints(self), joints(before), joints(after)) {
            (Some(predicted), Some(before), Some(after)) => (0..JOINT_COUNT)
                .filter(|&joint| predicted.has(joint))
                .map(|joint| {
                    let of = |hand: &HandJoints| hand.joints[joint].pose.position;
                    of(predicted).distance(of(before).lerp(of(after), share))
                })
                .reduce(f32::max),
            _ => None,
        };
        let predicted = self.client_from_object;
        PredictionError {
            object_distance: predicted.position.distance(real.position),
            object_angle: predicted.orientation.angle_between(real.orientation),
            giver_distance,
        }
    }
}

fn between(before: Pose, after: Pose, share: f32) -> Pose {
    Pose {
        position: before.position.lerp(after.position, share),
        orientation: before.orientation.slerp(after.orientation, share),
    }
}

#[cfg(test)]
mod tests;
