//! Where object and givers will be when an answer is shown, by the velocity that they have; and how far off that was.

use std::{collections::VecDeque, time::Duration};

use glam::Quat;
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::joints::{HandJoints, JOINT_COUNT, index},
};

use crate::validate::{FindQuery, GiverHand};

/// Velocities are taken over at least this time: two frames at 90 Hz. Over less, a headset's noise of a millimetre becomes one of
/// decimetres per second.
const VELOCITY_OVER: Duration = Duration::from_millis(20);

/// Frames farther apart say nothing about a velocity.
const LONGEST_GAP: Duration = Duration::from_millis(250);

/// Most frames kept to take velocities from: 20 ms at 1000 Hz, and some more.
const MOST_SEEN: usize = 32;

/// Most predictions that wait for their time: half a second at 90 Hz, and some more.
const MOST_PREDICTIONS: usize = 64;

/// What moves in a track.
#[derive(Debug)]
pub(crate) struct Motion {
    ahead: Duration,
    /// The latest frames, oldest first.
    seen: VecDeque<State>,
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
    hands: Vec<Option<HandState>>,
}

/// A hand at one time.
#[derive(Clone, Debug)]
enum HandState {
    /// Of known joints.
    Joints(Box<HandJoints>),
    /// Of a mesh: the frame that it moves with, as one body. That is its wrist or, if that is not known, the object that it holds.
    Body(Pose),
}

/// How far off a prediction was.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PredictionError {
    /// The first frame at or after the predicted time.
    pub sequence: u64,
    /// Distance of the object's origin, in metres.
    pub object_distance: f32,
    /// Angle between the object's orientations, in radians.
    pub object_angle: f32,
    /// Largest distance of a joint of the giver's hand, in metres; none unless its joints are known.
    pub giver_distance: Option<f32>,
}

impl Motion {
    /// Nothing was seen yet. Predictions are `ahead` of frames.
    pub(crate) fn new(ahead: Duration) -> Self {
        Self {
            ahead,
            seen: VecDeque::new(),
            predictions: VecDeque::new(),
            last_error: None,
        }
    }

    /// Adds a frame, and moves its query on to the predicted time. It stays as it is while no velocity is known.
    pub(crate) fn predict(&mut self, sequence: u64, at: Duration, query: &mut FindQuery) {
        let now = State::of(at, query);
        self.compare(sequence, &now);
        let is_recent = |seen: &&State| now.at.saturating_sub(seen.at) <= LONGEST_GAP && seen.at < now.at;
        let recent = || self.seen.iter().filter(is_recent);
        // The latest that is long enough ago, or else the earliest.
        let base = recent()
            .rfind(|seen| now.at.saturating_sub(seen.at) >= VELOCITY_OVER)
            .or_else(|| recent().next());
        if let Some(base) = base {
            let times = self.ahead.as_secs_f32() / now.at.saturating_sub(base.at).as_secs_f32();
            let predicted = now.moved_on(base, times, self.ahead);
            predicted.clone().apply(&now, query);
            self.predictions.push_back(predicted);
        }
        self.seen.push_back(now);
        // A frame that comes no more leaves its prediction unanswered.
        if self.seen.len() > MOST_SEEN {
            self.seen.pop_front();
        }
        if self.predictions.len() > MOST_PREDICTIONS {
            self.predictions.pop_front();
        }
    }

    /// How far off the last prediction was whose time has come.
    pub(crate) fn last_error(&self) -> Option<PredictionError> {
        self.last_error
    }

    /// Compares the predictions whose time has come with what is now and was before.
    fn compare(&mut self, sequence: u64, now: &State) {
        while let Some(prediction) = self
            .predictions
            .pop_front_if(|prediction| prediction.at <= now.at)
        {
            let Some(before) = self.seen.back() else { continue };
            let between = now.at.saturating_sub(before.at);
            if between.is_zero() || prediction.at < before.at || between > LONGEST_GAP {
                continue;
            }
            let share = prediction.at.saturating_sub(before.at).as_secs_f32() / between.as_secs_f32();
            self.last_error = Some(prediction.error(sequence, before, now, share));
        }
    }
}

impl HandState {
    fn of(hand: &GiverHand, client_from_object: Pose) -> Self {
        match hand {
            GiverHand::Jointed(hand) => Self::Joints(Box::new(hand.joints.clone())),
            GiverHand::Meshed(hand) => Self::Body(hand.client_from_wrist.unwrap_or(client_from_object)),
        }
    }

    /// What it becomes when it moves on as since `before`; the same if that is another form or side.
    fn moved_on(&self, before: &Self, times: f32) -> Self {
        match (before, self) {
            (Self::Joints(before), Self::Joints(now)) if before.handedness == now.handedness => {
                Self::Joints(Box::new(moved_joints(before, now, times)))
            }
            (Self::Body(before), Self::Body(now)) => Self::Body(moved(*before, *now, times)),
            _ => self.clone(),
        }
    }

    /// Moves a hand that is as `now` to where this is.
    fn apply(self, now: Self, hand: &mut GiverHand) {
        match (self, now, hand) {
            (Self::Joints(joints), _, GiverHand::Jointed(hand)) => hand.joints = *joints,
            (Self::Body(predicted), Self::Body(now), GiverHand::Meshed(hand)) => {
                let moved = predicted * now.inverse();
                for position in &mut hand.positions {
                    *position = moved.transform_point(*position);
                }
                if let Some(wrist) = &mut hand.client_from_wrist {
                    *wrist = moved * *wrist;
                }
            }
            _ => {}
        }
    }
}

impl State {
    fn of(at: Duration, query: &FindQuery) -> Self {
        let object = query.client_from_object;
        let state = |hand| HandState::of(hand, object);
        let first = query.presenting_hand.as_ref().map(state);
        let others = query.other_hands.iter().map(|hand| Some(state(hand)));
        Self {
            at,
            client_from_object: object,
            hands: std::iter::once(first).chain(others).collect(),
        }
    }

    /// What this becomes when it moves on as since `base`, `times` as far.
    fn moved_on(&self, base: &Self, times: f32, ahead: Duration) -> Self {
        let hands = self.hands.iter().enumerate().map(|(place, hand)| {
            let before = base.hands.get(place).and_then(Option::as_ref);
            let now = hand.as_ref()?;
            Some(before.map_or_else(|| now.clone(), |before| now.moved_on(before, times)))
        });
        Self {
            at: self.at + ahead,
            client_from_object: moved(base.client_from_object, self.client_from_object, times),
            hands: hands.collect(),
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
            if let (Some(hand), Some(predicted), Some(now)) = (hand, predicted, now.clone()) {
                predicted.apply(now, hand);
            }
        }
    }

    /// The distance of this prediction from what was between two frames, `share` of the time after the first.
    fn error<'a>(&'a self, sequence: u64, before: &'a Self, after: &'a Self, share: f32) -> PredictionError {
        let real = between(before.client_from_object, after.client_from_object, share);
        let joints = |state: &'a Self| match state.hands.first() {
            Some(Some(HandState::Joints(joints))) => Some(joints),
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
            sequence,
            object_distance: predicted.position.distance(real.position),
            object_angle: predicted.orientation.angle_between(real.orientation),
            giver_distance,
        }
    }
}

/// `now` after it has moved on as from `before`, `times` as far.
fn moved(before: Pose, now: Pose, times: f32) -> Pose {
    Pose {
        position: now.position + (now.position - before.position) * times,
        orientation: (turn(before.orientation, now.orientation, times) * now.orientation).normalize(),
    }
}

/// The shorter rotation from one orientation to another, `times` as far.
fn turn(before: Quat, now: Quat, times: f32) -> Quat {
    let turn = now * before.conjugate();
    let turn = if turn.w < 0.0 { -turn } else { turn };
    Quat::from_scaled_axis(turn.to_scaled_axis() * times)
}

fn between(before: Pose, after: Pose, share: f32) -> Pose {
    Pose {
        position: before.position.lerp(after.position, share),
        orientation: before.orientation.slerp(after.orientation, share),
    }
}

/// The wrist moves on as a body; each joint turns on in its parent, so that bones keep their lengths.
fn moved_joints(before: &HandJoints, now: &HandJoints, times: f32) -> HandJoints {
    let mut predicted = now.clone();
    let pose = |hand: &HandJoints, joint: usize| hand.joints[joint].pose;
    predicted.joints[index::WRIST].pose = moved(pose(before, index::WRIST), pose(now, index::WRIST), times);
    let mut turn_on = |joint: usize, parent: usize| {
        let [local_before, local_now] =
            [before, now].map(|hand| pose(hand, parent).inverse() * pose(hand, joint));
        let turned = turn(local_before.orientation, local_now.orientation, times) * local_now.orientation;
        let local = Pose {
            orientation: turned.normalize(),
            ..local_now
        };
        predicted.joints[joint].pose = predicted.joints[parent].pose * local;
    };
    turn_on(index::PALM, index::WRIST);
    for (first, tip) in index::FIRST_OF_DIGIT.into_iter().zip(index::TIP_OF_DIGIT) {
        turn_on(first, index::WRIST);
        for joint in first + 1..=tip {
            turn_on(joint, joint - 1);
        }
    }
    predicted
}

#[cfg(test)]
mod tests;
