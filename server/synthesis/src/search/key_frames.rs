//! The way to a grasp, for who animates it: the hand comes on a straight line, open, and closes.
//!
//! The thesis ends with the pose of the grasp. People open the hand beyond the object while they reach, and close it at
//! the end of the way (M. Jeannerod, "The timing of natural prehension movements", 1984). So do these frames: from
//! `APPROACH` to `PRE_GRASP` the open hand moves along a line, from `PRE_GRASP` to `CLOSE` its digits bend, all joints of
//! a digit by the same share at a time. Between two frames the wrist moves straight without turning and joint angles
//! change evenly; what is found free is that motion as a whole (`motion`), not points of it.

mod motion;

use std::cell::{Cell, OnceCell};

use glam::Vec3;

use crate::{
    base::pose::Pose,
    model::{
        constraints::{ApproachCone, approach_direction},
        grasp::{Grasp, KeyFrame, Stage},
        hand::{Digit, DigitAngles, HandPose, Handedness, kinematics::digit_frames, rig::Rig},
        holdout::Holdout,
    },
    physical::{
        flexing::Flexing,
        grip::{GIVER_CLEARANCE, MAX_PENETRATION},
        scene::{ObjectScene, Presented},
        solids::{HandSolids, TRACKED_SOLIDS, TrackedSolids, comes_within, self_clearance},
    },
};
use motion::{Keep, Motion, Obstacles};

/// How far the hand of `PRE_GRASP` is from the object at least, in metres: seen as not touching yet. More opens hands
/// wider and finds fewer ways.
pub const OPEN_CLEARANCE: f32 = 0.002;

/// How far `APPROACH` lies before `PRE_GRASP`, in metres: more than a finger's length, so that the hand is out of the
/// object. More looks more like reaching, and meets the giver more often.
pub const APPROACH_DISTANCE: f32 = 0.12;

/// How far fingertips open at least, where their joints allow it, in metres: the first that is free for all digits is taken,
/// and then for each digit the first that is free beside the others. Thumb and finger together open to some 4 cm more than
/// the object is thick, as people's do; the others are for hands that are not free of the object or the giver by then.
const OPENINGS: [f32; 5] = [0.025, 0.035, 0.05, 0.07, f32::INFINITY];

/// How far `PRE_GRASP` lies before `CLOSE`, in metres: nothing if the hand can open where it is, and some room for a palm
/// that lies on the object.
const DRAWN_BACK: [f32; 3] = [0.0, 0.01, 0.025];

/// Angles in degrees between the direction in which a hand comes by nature and those that are tried, and …
const TILTS: [f32; 4] = [20.0, 40.0, 60.0, 80.0];

/// … where around it, in degrees from the side of the fingertips toward the thumb's: first those that keep the hand
/// upright, straight ahead along the forearm or down on the palm.
const AZIMUTHS: [f32; 8] = [0.0, 180.0, 90.0, 270.0, 45.0, 315.0, 135.0, 225.0];

/// How often the hand is looked at, on all the ways that are tried, before there is none: some milliseconds. One in a
/// hundred grasps needs more than half of it. Less leaves more grasps without a way.
const MOST_LOOKS: u32 = 2000;

/// What the hand keeps to while it comes.
const COMING: Keep = Keep {
    object: 0.5 * OPEN_CLEARANCE,
    giver: 0.5 * GIVER_CLEARANCE,
};

/// What the hand keeps to while it closes: it may be as deep as in a grasp.
const CLOSING: Keep = Keep {
    object: -MAX_PENETRATION,
    giver: 0.5 * GIVER_CLEARANCE,
};

/// Plans the way to a grasp that is valid under `PHYSICAL`; to others, which know no solids, there is none. `approach` is
/// from where the hand may come, in the object's frame.
pub fn plan_way(
    holdout: &Holdout,
    rig: &Rig,
    friction: f32,
    approach: Option<ApproachCone>,
    grasp: &mut Grasp,
) {
    if grasp.margins.is_some() {
        let scene = ObjectScene::new(&holdout.object, friction);
        grasp.key_frames = key_frames(&scene, &Presented::of(holdout), rig, approach, grasp);
    }
}

/// The way to a grasp: `APPROACH`, `PRE_GRASP` and `CLOSE`, in this order.
///
/// `PRE_GRASP` is [`OPEN_CLEARANCE`] and more off the object and [`GIVER_CLEARANCE`] and more off the giver's hand, and
/// not through itself. On the way there the hand touches neither; closing, it sinks no deeper into the object than
/// [`MAX_PENETRATION`], to a tenth of a millimetre, and touches no forbidden surface. The hand moves in a direction of the cone
/// `approach`, which is in the object's frame as the rest is; none: in any.
///
/// None if no straight way in was found. The grasp is as valid as others then, but the hand would have to wind its way in.
pub fn key_frames(
    scene: &ObjectScene<'_>,
    presented: &Presented,
    rig: &Rig,
    approach: Option<ApproachCone>,
    grasp: &Grasp,
) -> Option<[KeyFrame; 3]> {
    let planner = Planner {
        rig,
        approach,
        close: grasp.pose,
        holding: grasp.bend_ratios.map(|ratio| ratio.is_some()),
        obstacles: Obstacles {
            object: scene.object,
            giver: presented.giver.as_ref(),
            looks_left: Cell::new(MOST_LOOKS),
        },
    };
    let (direction, pre_grasp) = planner.plan()?;
    let frame = |stage, pose| KeyFrame { stage, pose };
    Some([
        frame(Stage::Approach, moved(&pre_grasp, direction * -APPROACH_DISTANCE)),
        frame(Stage::PreGrasp, pre_grasp),
        frame(Stage::Close, grasp.pose),
    ])
}

/// The same hand elsewhere.
fn moved(pose: &HandPose, way: Vec3) -> HandPose {
    let Pose {
        position,
        orientation,
    } = pose.frame_from_wrist;
    HandPose {
        frame_from_wrist: Pose::new(position + way, orientation),
        digits: pose.digits,
    }
}

struct Planner<'a> {
    rig: &'a Rig,
    approach: Option<ApproachCone>,
    close: HandPose,
    /// Which digits hold the object, thumb first.
    holding: [bool; 5],
    obstacles: Obstacles<'a>,
}

impl Planner<'_> {
    /// The direction in which the hand comes, and the hand of `PRE_GRASP`.
    fn plan(&self) -> Option<(Vec3, HandPose)> {
        // Digits that hold nothing open with the others, or stay out of the way where they are.
        let opens_of = |i: usize| {
            if i < OPENINGS.len() {
                [true; 5]
            } else {
                self.holding
            }
        };
        let opened: [_; 2 * OPENINGS.len()] = std::array::from_fn(|i| {
            let pose = self.opened(OPENINGS[i % OPENINGS.len()], opens_of(i));
            (pose, self.solids(&pose))
        });
        // Where the hand opens in its place, that does not depend on the direction.
        let in_place: [OnceCell<bool>; 2 * OPENINGS.len()] = Default::default();
        for direction in self.directions() {
            for back in DRAWN_BACK {
                for (i, ((pose, solids), in_place)) in opened.iter().zip(&in_place).enumerate() {
                    let opens = if back == 0.0 {
                        *in_place.get_or_init(|| self.is_clear(solids) && self.closes_from(pose, 0.0))
                    } else {
                        self.is_clear(&solids.moved(direction * -back))
                    };
                    if !opens || !self.comes(&solids.moved(direction * -back), direction) {
                        continue;
                    }
                    let pose = moved(pose, direction * -back);
                    if back == 0.0 || self.closes_from(&pose, back) {
                        let narrower = &OPENINGS[..i % OPENINGS.len()];
                        return Some((
                            direction,
                            self.narrowed(pose, narrower, opens_of(i), direction, back),
                        ));
                    }
                }
            }
        }
        None
    }

    /// The hand with the digits that `opens` says opened in their place, until the tips are `opening` metres from where
    /// they were, or as far as the joints go.
    fn opened(&self, opening: f32, opens: [bool; 5]) -> HandPose {
        let digits = Digit::ALL.map(|digit| {
            if opens[digit.index()] {
                self.opened_digit(digit, opening)
            } else {
                self.close.digits[digit.index()]
            }
        });
        HandPose {
            frame_from_wrist: self.close.frame_from_wrist,
            digits,
        }
    }

    fn opened_digit(&self, digit: Digit, opening: f32) -> DigitAngles {
        let rig = self.rig.digit(digit);
        let closed = self.close.digits[digit.index()];
        let flexing = Flexing {
            digit: rig,
            base_yaw: closed.base_yaw,
            // How it bends does not matter to how it is when it is open.
            bend_ratio: 1.0,
        };
        let open = flexing.opened();
        let tip = |angles| digit_frames(rig, self.close.frame_from_wrist, angles).tip;
        let whole = tip(closed).distance(tip(open));
        between(&closed, &open, (opening / whole).min(1.0))
    }

    /// An open hand, `back` metres before the grasp, whose digits open no farther than they must: one that lies on the object
    /// with its first link opens far, and the others need not.
    fn narrowed(
        &self,
        mut pose: HandPose,
        narrower: &[f32],
        opens: [bool; 5],
        direction: Vec3,
        back: f32,
    ) -> HandPose {
        for digit in Digit::ALL.into_iter().filter(|digit| opens[digit.index()]) {
            for &opening in narrower {
                let mut tried = pose;
                tried.digits[digit.index()] = self.opened_digit(digit, opening);
                let solids = self.solids(&tried);
                if self.is_clear(&solids) && self.comes(&solids, direction) && self.closes_from(&tried, back)
                {
                    pose = tried;
                    break;
                }
            }
        }
        pose
    }

    /// The directions in which the hand may come, in the object's frame: first as hands do by nature, then more and more
    /// from aside; of those, the ones in which it may.
    fn directions(&self) -> impl Iterator<Item = Vec3> {
        let wrist = self.close.frame_from_wrist;
        let natural = approach_direction(wrist);
        let thumb_side = wrist.transform_vector(match self.rig.handedness {
            Handedness::Right => Vec3::X,
            Handedness::Left => Vec3::NEG_X,
        });
        let ahead = wrist.transform_vector(Vec3::Y).reject_from_normalized(natural);
        let ahead = ahead.normalize_or(thumb_side);
        let aside = TILTS.into_iter().flat_map(move |tilt| {
            AZIMUTHS.into_iter().map(move |azimuth| {
                let (sin, cos) = azimuth.to_radians().sin_cos();
                let (across, along) = tilt.to_radians().sin_cos();
                natural * along + (ahead * cos + thumb_side * sin) * across
            })
        });
        std::iter::once(natural)
            .chain(aside)
            .filter(|&direction| self.approach.is_none_or(|cone| cone.contains(direction)))
    }

    /// A hand as it is beside the object, and beside the giver's.
    fn solids(&self, pose: &HandPose) -> TrackedSolids {
        TrackedSolids::of_rig(
            self.rig,
            pose.frame_from_wrist,
            &HandSolids::of_pose(self.rig, pose),
        )
    }

    /// True if an open hand is off the object and the giver's hand, and not through itself.
    fn is_clear(&self, solids: &TrackedSolids) -> bool {
        let surface = &self.obstacles.object.surface;
        let giver = self.obstacles.giver;
        !solids
            .hand
            .iter()
            .any(|solid| comes_within(solid, surface, OPEN_CLEARANCE))
            && giver.is_none_or(|giver| !giver.comes_within(solids.iter(), GIVER_CLEARANCE))
            && self_clearance(&solids.hand) >= 0.0
    }

    /// True if the straight way to an open hand is free.
    fn comes(&self, pre_grasp: &TrackedSolids, direction: Vec3) -> bool {
        let motion = Motion {
            solids_at: |share: f32| pre_grasp.moved(direction * (APPROACH_DISTANCE * (share - 1.0))),
            travels: pre_grasp.iter().map(|_| APPROACH_DISTANCE).collect(),
        };
        motion.is_free(&self.obstacles, COMING)
    }

    /// True if the hand can close from an open one whose wrist is `back` metres before it.
    fn closes_from(&self, open: &HandPose, back: f32) -> bool {
        let from = open.frame_from_wrist.position;
        let to = self.close.frame_from_wrist.position;
        let motion = Motion {
            solids_at: |share: f32| {
                let pose = HandPose {
                    frame_from_wrist: Pose::new(
                        from.lerp(to, share),
                        self.close.frame_from_wrist.orientation,
                    ),
                    digits: std::array::from_fn(|digit| {
                        between(&open.digits[digit], &self.close.digits[digit], share)
                    }),
                };
                self.solids(&pose)
            },
            travels: self.closing_travels(open, back),
        };
        motion.is_free(&self.obstacles, CLOSING)
    }

    /// Metres that any point of each of the hand's solids travels at most while it closes.
    fn closing_travels(&self, open: &HandPose, back: f32) -> Vec<f32> {
        let mut travels = Vec::new();
        let turns = |digit: usize| {
            let (from, to) = (open.digits[digit], self.close.digits[digit]);
            [
                (to.base_pitch - from.base_pitch).abs(),
                (to.second_pitch - from.second_pitch).abs(),
                (to.third_pitch - from.third_pitch).abs(),
            ]
        };
        let solids = HandSolids::of_pose(self.rig, open);
        for (digit, links) in solids.phalanges.iter().enumerate() {
            let turns = turns(digit);
            let lengths = self.rig.digits[digit].lengths;
            let thickest = links.iter().fold(0.0, |thickest: f32, link| {
                thickest.max(link.start_radius).max(link.end_radius)
            });
            travels.extend((0..3).map(|link| {
                // The farthest point of the link from each joint that carries it, with the digit stretched.
                let turned = (0..=link).map(|joint| {
                    let reach: f32 = lengths[joint..=link].iter().sum();
                    turns[joint] * (reach + thickest)
                });
                back + turned.sum::<f32>()
            }));
        }
        travels.extend(solids.palm.iter().map(|_| back));
        // The ball of the thumb turns with its metacarpal.
        let base = solids.phalanges[0][0].start;
        let turn = turns(Digit::Thumb.index())[0];
        travels.extend(solids.thenar.iter().map(|solid| {
            let reach = (solid.start.distance(base) + solid.start_radius)
                .max(solid.end.distance(base) + solid.end_radius);
            back + turn * reach
        }));
        travels.extend(solids.forearm.iter().map(|_| back));
        travels.extend([back; TRACKED_SOLIDS]);
        travels
    }
}

/// A digit at a share of the way between two poses.
fn between(from: &DigitAngles, to: &DigitAngles, share: f32) -> DigitAngles {
    let lerp = |from: f32, to: f32| from + (to - from) * share;
    DigitAngles {
        base_yaw: lerp(from.base_yaw, to.base_yaw),
        base_pitch: lerp(from.base_pitch, to.base_pitch),
        second_pitch: lerp(from.second_pitch, to.second_pitch),
        third_pitch: lerp(from.third_pitch, to.third_pitch),
    }
}
