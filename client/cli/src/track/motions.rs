//! Built-in motions of givers.

use std::{f32::consts::TAU, time::Duration};

use clap::ValueEnum;
use glam::{Quat, Vec3};
use grasp_client::v1::{DigitAngles, Holdout, Pose, TrackFrame, presenting_hand::Form};

/// Gravity, in metres per second squared.
const GRAVITY: f32 = 9.81;

/// How a giver moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Moving {
    /// Holds the object out with a slight tremor.
    Still,
    /// Walks up and down.
    Walk,
    /// Turns the object over.
    Turn,
    /// Shakes.
    Shake,
    /// Slides the hand along the object.
    Slide,
    /// Opens and closes the fingers.
    Fingers,
    /// Drops the object after two seconds.
    Drop,
}

/// The frames of a motion, `rate` per second.
pub(super) fn frames(moving: Moving, holdout: &Holdout, rate: f32, length: Duration) -> Vec<TrackFrame> {
    let count = (length.as_secs_f32() * rate).ceil() as u64;
    let frame = |sequence| {
        let time = sequence as f32 / rate;
        TrackFrame::of(sequence, moved(moving, holdout, time)).captured_at(Duration::from_secs_f32(time))
    };
    (0..count).map(frame).collect()
}

/// A holdout at a time in seconds.
fn moved(moving: Moving, holdout: &Holdout, time: f32) -> Holdout {
    let mut moved = holdout.clone();
    let origin = holdout.client_from_object().position();
    let wave = |per_second: f32, phase: f32| (TAU * (per_second * time + phase)).sin();
    let waves = |per_second: f32| {
        let axes = [(1.0, 0.0), (1.3, 0.3), (0.8, 0.7)];
        Vec3::from_array(axes.map(|(factor, phase)| wave(factor * per_second, phase)))
    };
    let shift = |by: Vec3| Pose::new(by, Quat::IDENTITY);
    let about_object = |turn: Quat| Pose::new(origin - turn * origin, turn);
    match moving {
        Moving::Still => together(&mut moved, shift(0.002 * waves(0.7))),
        Moving::Walk => {
            let way = Vec3::new(0.4 * wave(0.1, 0.0), 0.015 * wave(1.8, 0.0), 0.1 * wave(0.2, 0.0));
            let turn = Quat::from_rotation_y(0.4 * wave(0.1, 0.25));
            together(&mut moved, shift(way) * about_object(turn));
        }
        Moving::Turn => {
            let turn = Quat::from_rotation_z(1.5 * wave(0.12, 0.0));
            together(&mut moved, about_object(turn));
        }
        Moving::Shake => {
            let turn = Quat::from_scaled_axis(0.03 * waves(7.0));
            together(&mut moved, shift(0.006 * waves(8.0)) * about_object(turn));
        }
        Moving::Slide => {
            let along = holdout.client_from_object().orientation() * Vec3::X;
            hand(&mut moved, shift(along * 0.04 * wave(0.2, 0.0)));
        }
        Moving::Fingers => {
            if let Some(Form::Pose(hand)) = form(&mut moved) {
                let open = 0.5 + 0.5 * wave(0.4, 0.25);
                let digits = hand.digits().map(|digit| digit.map(|digit| opened(*digit, open)));
                *hand = hand.clone().with_digits(digits);
            }
        }
        Moving::Drop => {
            let fallen = (time - 2.0).max(0.0);
            let down = Vec3::NEG_Y * 0.5 * GRAVITY * fallen * fallen;
            moved.client_from_object = Some(shift(down) * moved.client_from_object());
        }
    }
    moved
}

fn together(holdout: &mut Holdout, by: Pose) {
    holdout.client_from_object = Some(by * holdout.client_from_object());
    hand(holdout, by);
}

fn hand(holdout: &mut Holdout, by: Pose) {
    match form(holdout) {
        Some(Form::Pose(hand)) => {
            hand.client_from_wrist = hand.client_from_wrist.map(|wrist| by * wrist);
        }
        Some(Form::Joints(hand)) => {
            for joint in &mut hand.joints {
                joint.pose = joint.pose.map(|pose| by * pose);
            }
        }
        Some(Form::Mesh(_)) | None => {}
    }
}

fn form(holdout: &mut Holdout) -> Option<&mut Form> {
    holdout.presenting_hand.as_mut()?.form.as_mut()
}

/// A digit opened by a share of the way to straight.
fn opened(digit: DigitAngles, share: f32) -> DigitAngles {
    let bent = |angle: f32| angle - 0.6 * share * angle.max(0.0);
    DigitAngles {
        base_pitch: bent(digit.base_pitch),
        second_pitch: bent(digit.second_pitch),
        third_pitch: digit.third_pitch.map(bent),
        ..digit
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use grasp_client::built_in::request_for;

    fn holdout() -> Holdout {
        let all = grasp_assets::holdouts::holdouts();
        let request = request_for(all.first().expect("there are built-in holdouts"));
        request.holdout.expect("it is held out")
    }

    #[test]
    fn giver_and_object_move_together_unless_one_of_them_moves_alone() {
        let holdout = holdout();
        for moving in Moving::value_variants() {
            let relative = |mut moved: Holdout| {
                let client_from_object = moved.client_from_object();
                let Some(Form::Pose(hand)) = form(&mut moved) else {
                    panic!("the giver is given by angles");
                };
                (client_from_object.inverse() * hand.client_from_wrist.unwrap()).position()
            };
            let at_rest = relative(holdout.clone());
            let farthest = (0..50)
                .map(|frame| relative(moved(*moving, &holdout, 0.1 * frame as f32)))
                .map(|wrist| wrist.distance(at_rest))
                .fold(0.0, f32::max);
            let moves_alone = matches!(moving, Moving::Slide | Moving::Drop);
            assert_eq!(farthest > 0.01, moves_alone, "{moving:?}: {farthest}");
        }
    }
}
