//! The animation of a played track of a moving giver.

use std::collections::{BTreeMap, btree_map::Entry};

use grasp_client::v1::{self, Convention, CurrentGraspStatus};
use grasp_synthesis::{base::pose::Pose, model::hand::joints::HandJoints};

use crate::{
    glb::{MovingHand, MovingHandover, to_moving_glb},
    handover::CannotDraw,
    hands::{PosedHand, giver, synthesis_pose},
    moving::to_picture,
    parts::Part,
    people::Person,
    receiver::Receiver,
    render::ViewSize,
};

/// Seconds between frames without capture times: as a headset sends them, 90 per second.
const FRAME_SECONDS: f32 = 1.0 / 90.0;

/// The frames of a track, and the answers with the times when they were known.
#[derive(Clone, Debug)]
pub struct TrackRecording {
    convention: Convention,
    frames: Vec<v1::TrackFrame>,
    /// Answers, with the first frame for which each was known.
    answers: Vec<(usize, v1::TrackAnswer)>,
}

impl TrackRecording {
    /// An empty recording of a track.
    pub fn new(track: &v1::Track) -> Self {
        let output = track.output.as_ref();
        Self {
            convention: output.map(v1::OutputOptions::convention).unwrap_or_default(),
            frames: Vec::new(),
            answers: Vec::new(),
        }
    }

    /// Adds a frame that has been sent.
    pub fn sent(&mut self, frame: &v1::TrackFrame) {
        self.frames.push(frame.clone());
    }

    /// Adds an answer that has come. It is known from the next frame on.
    pub fn answered(&mut self, answer: &v1::TrackAnswer) {
        self.answers.push((self.frames.len(), answer.clone()));
    }

    /// The motion as a binary glTF file with an animation, a moment per frame: giver and object as they were sent, and a receiver
    /// who reaches for the answered grasps as soon as they are known, at the speed of a person.
    ///
    /// # Errors
    /// The convention is not that of `OpenXR`, a hand's rig is not built in, or a hand is given as a mesh.
    pub fn to_glb(&self, object: Part) -> Result<Vec<u8>, CannotDraw> {
        Ok(to_moving_glb(&self.handover(object)?))
    }

    /// The same motion as an animated PNG file, from a camera that sees all of it.
    ///
    /// # Errors
    /// As of [`Self::to_glb`].
    pub fn to_picture(&self, object: Part, size: ViewSize) -> Result<Vec<u8>, CannotDraw> {
        Ok(to_picture(&self.handover(object)?, size))
    }

    fn handover(&self, object: Part) -> Result<MovingHandover, CannotDraw> {
        if !matches!(self.convention, Convention::Unspecified | Convention::Openxr) {
            return Err(CannotDraw(
                "animations require a motion in the openxr convention".to_owned(),
            ));
        }
        let mut hands = self.givers()?;
        hands.extend(self.receivers()?);
        Ok(MovingHandover {
            object,
            times: self.times(),
            client_from_object: self.object_poses(),
            hands,
        })
    }

    fn times(&self) -> Vec<f32> {
        let captured: Option<Vec<_>> = self.frames.iter().map(v1::TrackFrame::capture_time).collect();
        let mut times: Vec<f32> = if let Some(captured) = captured {
            let since = captured.iter().map(|time| time.saturating_sub(captured[0]));
            since.map(|time| time.as_secs_f32()).collect()
        } else {
            let frames = 0..self.frames.len();
            frames.map(|frame| frame as f32 * FRAME_SECONDS).collect()
        };
        // Times of an animation must rise, but frames may have equal times.
        for i in 1..times.len() {
            times[i] = times[i].max(times[i - 1].next_up());
        }
        times
    }

    fn object_poses(&self) -> Vec<Pose> {
        let poses = self.frames.iter().map(v1::TrackFrame::client_from_object);
        poses.map(synthesis_pose).collect()
    }

    /// The hands of every frame: `giver`, and `other_giver`, `other_giver_2` … for the other hands, by their places and skins.
    fn givers(&self) -> Result<Vec<MovingHand>, CannotDraw> {
        let mut hands: Vec<MovingHand> = Vec::new();
        for (moment, frame) in self.frames.iter().enumerate() {
            let Some(holdout) = &frame.holdout else { continue };
            let presenting = holdout.presenting_hand.iter().map(|hand| ("giver", hand));
            let others = holdout.other_hands.iter().map(|hand| ("other_giver", hand));
            for (role, hand) in presenting.chain(others) {
                let PosedHand { skin, joints } = giver(hand, frame.client_from_object())?;
                let fits = |known: &MovingHand| {
                    std::ptr::eq(known.skin, skin)
                        && known.name.starts_with(role)
                        && known.joints[moment].is_none()
                };
                let place = hands.iter().position(fits).unwrap_or_else(|| {
                    let same_role = hands.iter().filter(|known| known.name.starts_with(role)).count();
                    hands.push(MovingHand {
                        name: numbered(role, same_role),
                        person: Person::Giver,
                        skin,
                        joints: vec![None; self.frames.len()],
                    });
                    hands.len() - 1
                });
                hands[place].joints[moment] = Some(joints);
            }
        }
        Ok(hands)
    }

    /// The receiver's hands: all that answers ever name. Of several, waiting ones are absent: without a body they would hang in the
    /// air next to each other.
    fn receivers(&self) -> Result<Vec<MovingHand>, CannotDraw> {
        let (times, poses) = (self.times(), self.object_poses());
        let Some(&first_pose) = poses.first() else {
            return Ok(Vec::new());
        };
        let mut receivers: BTreeMap<(bool, String), Receiver> = BTreeMap::new();
        let grasps = self
            .answers
            .iter()
            .filter_map(|(_, answer)| answer.grasp.as_ref());
        for grasp in grasps {
            if let Entry::Vacant(unknown) = receivers.entry(key(grasp)) {
                unknown.insert(Receiver::waiting_for(grasp, first_pose)?);
            }
        }
        let is_alone = receivers.len() == 1;
        let mut moved: Vec<Vec<Option<HandJoints>>> = vec![Vec::new(); receivers.len()];
        let mut answers = self.answers.iter().peekable();
        let mut before = 0.0;
        for (frame, (&time, &pose)) in times.iter().zip(&poses).enumerate() {
            while let Some((_, answer)) = answers.next_if(|(since, _)| *since <= frame) {
                apply(answer, &mut receivers);
            }
            for (receiver, moved) in receivers.values_mut().zip(&mut moved) {
                receiver.advance(time - before, pose);
                let is_there = is_alone || !receiver.is_waiting();
                moved.push(is_there.then(|| receiver.joints()));
            }
            before = time;
        }
        let hands = receivers.into_values().zip(moved).enumerate();
        let hands = hands.map(|(i, (receiver, joints))| MovingHand {
            name: match i {
                1 => "other_receiver".to_owned(),
                _ => numbered("receiver", i),
            },
            person: Person::Receiver,
            skin: receiver.skin,
            joints,
        });
        Ok(hands.collect())
    }
}

/// A role's name, with a number if others have the same role.
pub(crate) fn numbered(role: &str, others: usize) -> String {
    match others {
        0 => role.to_owned(),
        _ => format!("{role}_{}", others + 1),
    }
}

/// Moves every hand of the receiver as an answer says.
pub(crate) fn apply(answer: &v1::TrackAnswer, receivers: &mut BTreeMap<(bool, String), Receiver>) {
    let current = answer.current.as_ref();
    match (&answer.grasp, answer.status()) {
        // Only the wrist has moved, along with the object.
        (Some(grasp), CurrentGraspStatus::Kept) if is_wrist_only(grasp) => {}
        (Some(grasp), _) => {
            let motion = current.and_then(|current| current.motion.as_ref());
            let straight = motion.is_some_and(|motion| motion.free);
            for (hand, receiver) in receivers {
                if *hand == key(grasp) {
                    receiver.take(grasp, straight);
                } else {
                    receiver.leave(None);
                }
            }
        }
        (None, CurrentGraspStatus::None | CurrentGraspStatus::Aborted) => {
            let withdrawal = current.and_then(|current| current.withdrawal.as_ref());
            for receiver in receivers.values_mut() {
                receiver.leave(withdrawal);
            }
        }
        (None, _) => {}
    }
}

/// True if the answer has only the new wrist pose of the previous grasp.
fn is_wrist_only(grasp: &v1::Grasp) -> bool {
    let hand = grasp.hand.as_ref();
    hand.is_none_or(|hand| hand.digits().iter().all(Option::is_none))
}

/// Key of a character's hands: right or left, and the rig.
pub(crate) fn key(grasp: &v1::Grasp) -> (bool, String) {
    let hand = grasp.hand.as_ref();
    let is_left = hand.is_some_and(|hand| hand.handedness() == v1::Handedness::Left);
    (is_left, hand.map(|hand| hand.rig.clone()).unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use glam::{Quat, Vec3};
    use grasp_synthesis::model::hand::joints::index::WRIST;

    use super::*;

    #[test]
    fn times_rise_even_if_frames_are_of_the_same_time_and_other_conventions_are_refused() {
        let track = v1::Track::new("objects/remote").with_convention(Convention::Unreal);
        let mut recording = TrackRecording::new(&track);
        for milliseconds in [700, 800, 800, 950] {
            let frame = v1::TrackFrame::of(0, v1::Holdout::default());
            recording.sent(&frame.captured_at(Duration::from_millis(milliseconds)));
        }
        let times = recording.times();
        assert!(times.is_sorted_by(|a, b| a < b));
        assert_eq!((times[0], times[3]), (0.0, 0.25));
        let object = Part::built_in_object("remote").unwrap();
        let refused = recording.to_glb(object).unwrap_err();
        assert!(refused.to_string().contains("openxr"), "{refused}");
    }

    #[test]
    fn the_hand_goes_to_the_answered_grasp_without_a_jump() {
        let mut recording = TrackRecording::new(&v1::Track::new("objects/remote"));
        let object = |frame: u64| v1::Pose::new(Vec3::X * 0.002 * frame as f32, Quat::IDENTITY);
        let wrist = v1::Pose::new(Vec3::new(0.0, 0.02, 0.09), Quat::from_rotation_z(0.2));
        let hand = v1::HandPose::new("rigs/adult", v1::Handedness::Right);
        let giver = hand.clone().with_object_from_wrist(v1::Pose::default());
        for sequence in 0..90 {
            let holdout = v1::Holdout {
                client_from_object: Some(object(sequence)),
                presenting_hand: Some(giver.clone().into()),
                ..v1::Holdout::default()
            };
            recording.sent(&v1::TrackFrame::of(sequence, holdout));
            if sequence == 10 {
                let hand = hand.clone().with_object_from_wrist(wrist);
                recording.answered(&v1::TrackAnswer {
                    grasp: Some(v1::Grasp {
                        hand: Some(hand.with_client_from_wrist(object(10) * wrist)),
                        ..v1::Grasp::default()
                    }),
                    ..v1::TrackAnswer::default()
                });
            }
        }
        let at = |hand: &MovingHand, frame: usize| {
            hand.joints[frame].as_ref().unwrap().joints[WRIST].pose.position
        };
        let [giver] = &recording.givers().unwrap()[..] else {
            panic!("one giver")
        };
        let [receiver] = &recording.receivers().unwrap()[..] else {
            panic!("one hand")
        };
        for frame in 0..90 {
            let expected = object(frame as u64).position();
            assert!(at(giver, frame).distance(expected) < 1e-5);
            let step = at(receiver, frame).distance(at(receiver, frame.max(1) - 1));
            // At most 1.1 m/s, and the object's own motion.
            assert!(step < 1.1 * FRAME_SECONDS + 0.0021, "{step} m in a frame");
        }
        let grasped = (object(89) * wrist).position();
        assert!(at(receiver, 10).distance(grasped) > 0.1 && at(receiver, 89).distance(grasped) < 1e-3);
    }
}
