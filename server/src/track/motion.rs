//! Predicts where object and givers will be when an answer is shown, from their velocities; and measures the errors.

use std::{collections::VecDeque, time::Duration};

use glam::{Quat, Vec3};
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::joints::{HandJoints, JOINT_COUNT, index},
};

use crate::validate::{FindQuery, GiverHand};

/// Largest gap between frames from which motion is derived.
const MAX_GAP: Duration = Duration::from_millis(250);

/// Most predictions that wait for their time: half a second at 90 Hz, and some more.
const MAX_PREDICTIONS: usize = 64;

/// Velocities are taken over this time: four frames at 90 Hz. Less turns a headset's noise of a millimetre into decimetres per
/// second, more lags behind a turning hand.
const VELOCITY_OVER: Duration = Duration::from_millis(45);

/// Shortest time between measurements for a velocity, because of noise.
const MIN_BASE: f32 = 0.01;

/// Shortest time between kept measurements.
const MIN_APART: Duration = Duration::from_millis(5);

/// Longest period of a tracker that is slower than the frames, which repeat its measurements.
const MAX_REPEAT: Duration = Duration::from_millis(50);

/// A body that repeats for this multiple of the longest time between measurements is at rest.
const LATE: f32 = 1.45;

/// Most measurements kept: [`MAX_GAP`] at 90 Hz.
const MAX_SEEN: usize = 24;

/// Limits of a hand per second and per second squared, and noise, in metres and in radians: a larger step is a jump.
const MAX_SPEED: [f32; 2] = [10.0, 40.0];
const MAX_ACCELERATION: [f32; 2] = [150.0, 1500.0];
const NOISE: [f32; 2] = [0.01, 0.1];

/// Least ratio of a velocity to its standard error: noise alone exceeds it in one of ten frames.
const SIGNIFICANT: f32 = 3.0;

/// Difference of coordinates due to rounding, up to which poses are repeated.
const ROUNDING: f32 = 1e-6;

/// The motion of a track's object and hands.
#[derive(Debug, Default)]
pub(crate) struct Motion {
    ahead: Duration,
    object: Path,
    /// The giver's hand, then the others.
    hands: Vec<Path>,
    before: Option<State>,
    /// Oldest first.
    predictions: VecDeque<State>,
    /// The error of the last prediction whose time has come.
    pub last_error: Option<PredictionError>,
}

#[derive(Clone, Debug)]
struct State {
    at: Duration,
    client_from_object: Pose,
    /// The giver's hand, then the others.
    hands: Vec<Option<Body>>,
}

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
    /// A track without frames. Predictions are `ahead` of frames.
    pub(crate) fn new(ahead: Duration) -> Self {
        Self {
            ahead,
            ..Self::default()
        }
    }

    /// Adds a frame, and moves its query to the predicted time. It stays as it is while no velocity is known.
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
        if self.object.0.len() > 1 {
            self.predictions.push_back(predicted);
        }
        self.before = Some(now);
        // A missing frame leaves its prediction unanswered.
        if self.predictions.len() > MAX_PREDICTIONS {
            self.predictions.pop_front();
        }
    }

    /// Compares predictions with the states around their time.
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

/// Moves a hand from its pose in `now` to that in `predicted`.
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

    /// Moves a query from the state `now` to this one.
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

    /// The distance of this prediction from the motion between two frames, `share` of the time after the first.
    fn error<'a>(&'a self, before: &'a Self, after: &'a Self, share: f32) -> PredictionError {
        let [from, to] = [before, after].map(|state| state.client_from_object);
        let position = from.position.lerp(to.position, share);
        let orientation = from.orientation.slerp(to.orientation, share);
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
            object_distance: predicted.position.distance(position),
            object_angle: predicted.orientation.angle_between(orientation),
            giver_distance,
        }
    }
}

#[derive(Clone, Debug)]
enum Body {
    Joints(Box<HandJoints>),
    /// An object, or a hand of a mesh: the frame that it moves with.
    Rigid(Pose),
}

/// Where a body was measured, oldest first.
#[derive(Debug, Default)]
struct Path(VecDeque<(Duration, Body)>);

impl Path {
    /// Adds a measurement. True if the track restarts with it: earlier ones say nothing about the body's velocity.
    fn add(&mut self, at: Duration, body: &Body) -> bool {
        let begins = match self.0.back() {
            None => true,
            Some((last_at, _)) if *last_at > at || at.saturating_sub(*last_at) > MAX_GAP => true,
            Some((last_at, last)) if last.repeats(body) => {
                if *last_at == at || self.is_awaited(at) {
                    return false;
                }
                // At rest, from the first of these measurements to the last.
                let is_resting = |(_, before): &(Duration, Body)| before.repeats(body);
                let moving = self.0.iter().rposition(|before| !is_resting(before));
                self.0.drain(..moving.map_or(0, |place| place + 1));
                self.0.truncate(1);
                false
            }
            Some((last_at, last)) => {
                let time = at.saturating_sub(*last_at);
                let begins = self.is_jump(time, last, body);
                if !begins && time < MIN_APART {
                    return false;
                }
                begins
            }
        };
        if begins {
            self.0.clear();
        }
        self.0.push_back((at, body.clone()));
        if self.0.len() > MAX_SEEN {
            self.0.pop_front();
        }
        begins
    }

    /// Where a body, added last, will be after a time.
    fn ahead(&self, at: Duration, body: &Body, ahead: Duration) -> Body {
        let Some((last_at, last)) = self.0.back() else {
            return body.clone();
        };
        // A repeated measurement is older than its frame.
        let is_repeated = last.repeats(body) && self.is_awaited(at);
        let (measured, body) = if is_repeated { (*last_at, last) } else { (at, body) };
        let before = self.0.iter().rev().filter(|(seen, _)| *seen < measured);
        let (recent, older): (Vec<_>, Vec<_>) =
            before.partition(|(seen, _)| measured.saturating_sub(*seen) <= VELOCITY_OVER);
        let before = if recent.is_empty() {
            older.into_iter().take(1).collect()
        } else {
            recent
        };
        let before: Vec<(f32, &Body)> = before
            .into_iter()
            .map(|(seen, body)| (-measured.saturating_sub(*seen).as_secs_f32(), body))
            .collect();
        if before.last().is_none_or(|(time, _)| *time > -MIN_BASE) {
            return body.clone();
        }
        body.moved_on(&before, (at.saturating_sub(measured) + ahead).as_secs_f32())
    }

    /// True if a measurement equal to the last may be a repeat of it: little more than the longest time between earlier ones has
    /// passed.
    fn is_awaited(&self, at: Duration) -> bool {
        let mut longest = Duration::ZERO;
        let mut begin: Option<&(Duration, Body)> = None;
        for measured in &self.0 {
            match begin {
                Some((_, body)) if body.repeats(&measured.1) => continue,
                Some((begun, _)) if measured.0.saturating_sub(*begun) <= MAX_REPEAT => {
                    longest = longest.max(measured.0.saturating_sub(*begun));
                }
                _ => {}
            }
            begin = Some(measured);
        }
        self.0
            .back()
            .is_some_and(|(last, _)| at.saturating_sub(*last) < longest.mul_f32(LATE))
    }

    /// True if `body` is too far from `last` for a motion in this time.
    fn is_jump(&self, time: Duration, last: &Body, body: &Body) -> bool {
        let seconds = time.as_secs_f32();
        let before = self.0.iter().rev().nth(1);
        let limits = |measure: usize| {
            if before.is_some() {
                0.5 * MAX_ACCELERATION[measure] * seconds * seconds + NOISE[measure]
            } else {
                MAX_SPEED[measure] * seconds + NOISE[measure]
            }
        };
        let (mut expected, real) = (last.frame(), body.frame());
        if let (Some((before_at, before)), Some((last_at, _))) = (before, self.0.back()) {
            // As in the last step, which lags less behind a throw than a velocity over several.
            let share = seconds / last_at.saturating_sub(*before_at).as_secs_f32();
            let (from, to) = (before.frame(), expected);
            let turned = Quat::from_scaled_axis(turn(from.orientation, to.orientation) * share);
            expected = Pose {
                position: to.position + (to.position - from.position) * share,
                orientation: (turned * to.orientation).normalize(),
            };
        }
        !last.is_like(body)
            || expected.position.distance(real.position) > limits(0)
            || expected.orientation.angle_between(real.orientation) > limits(1)
    }
}

impl Body {
    /// The frame that all of it moves with.
    fn frame(&self) -> Pose {
        match self {
            Self::Joints(hand) => hand.joints[index::WRIST].pose,
            Self::Rigid(pose) => *pose,
        }
    }

    fn is_like(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Joints(a), Self::Joints(b)) => a.handedness == b.handedness,
            (Self::Rigid(_), Self::Rigid(_)) => true,
            _ => false,
        }
    }

    fn repeats(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Joints(a), Self::Joints(b)) => {
                (0..JOINT_COUNT).all(|joint| is_same(a.joints[joint].pose, b.joints[joint].pose))
            }
            (Self::Rigid(a), Self::Rigid(b)) => is_same(*a, *b),
            _ => false,
        }
    }

    /// This body `seconds` later, by its earlier states at negative times. A hand's wrist moves like a rigid body and each joint
    /// turns in its parent, so that bones keep their lengths.
    fn moved_on(&self, before: &[(f32, &Self)], seconds: f32) -> Self {
        let frames = before.iter().map(|(time, body)| (*time, body.frame()));
        let frame = moved(frames, self.frame(), seconds);
        let Self::Joints(now) = self else {
            return Self::Rigid(frame);
        };
        let pose = |hand: &HandJoints, joint: usize| hand.joints[joint].pose;
        let mut predicted = now.clone();
        predicted.joints[index::WRIST].pose = frame;
        let mut turn_on = |joint: usize, parent: usize| {
            let local = |hand: &HandJoints| pose(hand, parent).inverse() * pose(hand, joint);
            let turns = before.iter().filter_map(|(time, body)| match body {
                Self::Joints(hand) => Some((*time, local(hand))),
                Self::Rigid(_) => None,
            });
            let now = local(now);
            let local = Pose {
                position: now.position,
                ..moved(turns, now, seconds)
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
        Self::Joints(predicted)
    }
}

fn is_same(a: Pose, b: Pose) -> bool {
    let (a_turn, b_turn) = (a.orientation, b.orientation);
    let b_turn = if a_turn.dot(b_turn) < 0.0 { -b_turn } else { b_turn };
    a.position.abs_diff_eq(b.position, ROUNDING) && a_turn.abs_diff_eq(b_turn, ROUNDING)
}

/// A frame `seconds` later, by its earlier poses at negative times.
fn moved(before: impl Iterator<Item = (f32, Pose)> + Clone, now: Pose, seconds: f32) -> Pose {
    let ways = before
        .clone()
        .map(|(time, pose)| (time, pose.position - now.position));
    let turns = before.map(|(time, pose)| (time, turn(now.orientation, pose.orientation)));
    let turned = Quat::from_scaled_axis(velocity(turns) * seconds) * now.orientation;
    Pose {
        position: now.position + velocity(ways) * seconds,
        orientation: turned.normalize(),
    }
}

/// The shorter rotation from one orientation to another, as its axis times its angle.
fn turn(from: Quat, to: Quat) -> Vec3 {
    let turn = to * from.conjugate();
    let turn = if turn.w < 0.0 { -turn } else { turn };
    turn.to_scaled_axis()
}

/// The slope of the line through values at times, the last of which is 0 at 0; shrunk as far as noise explains it.
fn velocity(before: impl Iterator<Item = (f32, Vec3)> + Clone) -> Vec3 {
    let all = before.chain([(0.0, Vec3::ZERO)]);
    let count = all.clone().count() as f32;
    let (times, values) = all
        .clone()
        .fold((0.0, Vec3::ZERO), |(times, values), (time, value)| {
            (times + time, values + value)
        });
    let (time, value) = (times / count, values / count);
    let mut spread = 0.0;
    let mut product = Vec3::ZERO;
    for (t, v) in all.clone() {
        spread += (t - time) * (t - time);
        product += (t - time) * (v - value);
    }
    let slope = product / spread;
    let degrees = count - 2.0;
    if degrees < 1.0 || slope == Vec3::ZERO {
        return slope;
    }
    let off = |(t, v): (f32, Vec3)| (v - value - slope * (t - time)).length_squared();
    let variance = all.map(off).sum::<f32>() / degrees / spread;
    slope * (1.0 - SIGNIFICANT * variance / slope.length_squared()).max(0.0)
}

#[cfg(test)]
mod tests;
