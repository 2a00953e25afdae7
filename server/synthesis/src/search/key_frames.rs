//! Key frames for animation: the open hand approaches on a straight line, then closes.
//!
//! The thesis ends with the pose of the grasp. People open the hand wider than the object while they reach, and close it at the
//! end of the motion (M. Jeannerod, "The timing of natural prehension movements", 1984). So do these frames: from `APPROACH` to
//! `PRE_GRASP` the open hand moves along a line; from `PRE_GRASP` to `CLOSE` its digits bend, all joints of a digit in
//! proportion. Between two frames the wrist moves straight without turning, and joint angles change linearly. This motion is
//! checked continuously, not at samples.

mod motion;

use std::cell::{Cell, OnceCell};

use glam::Vec3;

use motion::{Motion, Obstacles};

use crate::{
    base::pose::Pose,
    model::{
        grasp::{Grasp, KeyFrame, Stage},
        hand::{Digit, DigitAngles, HandPose, Handedness, kinematics::digit_frames, rig::Rig},
        holdout::Holdout,
        requirements::{ApproachCone, approach_direction},
    },
    physical::{
        grip::{GIVER_CLEARANCE, MAX_PENETRATION},
        presented::{ObjectScene, Presented},
        shape::Flexing,
        solids::{HandSolids, TRACKED_SOLIDS, TrackedSolids, comes_within, self_clearance},
    },
    rating::assessment::GraspContext,
};

/// Least distance of the hand of `PRE_GRASP` from the object, in metres: visibly apart. More opens hands wider and finds fewer
/// motions.
pub const OPEN_CLEARANCE: f32 = 0.002;

/// Distance from `APPROACH` to `PRE_GRASP`, in metres: more than a finger's length, so that the hand is clear of the object. More
/// looks more like reaching, and collides with barriers more often.
pub const APPROACH_DISTANCE: f32 = 0.12;

/// Distances by which fingertips open, in metres, or as far as the joints allow.
const OPENINGS: [f32; 5] = [0.025, 0.035, 0.05, 0.07, f32::INFINITY];

/// Distances from `PRE_GRASP` to `CLOSE`, in metres: zero for a hand that opens in place, more for a palm that rests on the object.
const BACK_OFFS: [f32; 3] = [0.0, 0.01, 0.025];

/// Angles, in degrees, by which alternative approach directions deviate from the natural one.
const TILTS: [f32; 4] = [20.0, 40.0, 60.0, 80.0];

/// Directions of these deviations, in degrees from the fingertips' side toward the thumb's: first those that keep the hand upright,
/// straight ahead along the forearm or down on the palm.
const AZIMUTHS: [f32; 8] = [0.0, 180.0, 90.0, 270.0, 45.0, 315.0, 135.0, 225.0];

/// Largest number of hand poses checked per grasp, in some milliseconds. One grasp in a hundred needs more than half of them.
const MAX_POSES_CHECKED: u32 = 2000;

/// Largest number of hand poses checked for a withdrawal: a tenth, in some hundred microseconds.
const MAX_POSES_OF_WITHDRAWAL: u32 = 200;

/// Least distance from the barriers on the way, in metres: a little less than in a grasp, so that the accuracy of the check does
/// not reject the grasp itself.
const BARRIER_CLEARANCE: f32 = 0.9 * GIVER_CLEARANCE;

/// Least distance from the object during the approach, and while closing: the hand may sink in as deep as in a grasp.
const APPROACH_CLEARANCE: f32 = 0.5 * OPEN_CLEARANCE;
const CLOSING_CLEARANCE: f32 = -MAX_PENETRATION;

/// Plans the key frames of a grasp that is valid under `PHYSICAL`; others have none. `approach` limits the approach direction, in
/// the object's frame.
pub fn plan_key_frames(
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

/// The key frames of a grasp: `APPROACH`, `PRE_GRASP` and `CLOSE`, in this order.
///
/// `PRE_GRASP` is at least [`OPEN_CLEARANCE`] off the object and [`GIVER_CLEARANCE`] off other hands, and free of self-collision.
/// On the approach the hand touches none of them and no obstacle; closing, it sinks no deeper into the object than
/// [`MAX_PENETRATION`], to a tenth of a millimetre, and touches no forbidden surface. The approach direction lies in the cone
/// `approach`, in the object's frame like everything else; without a cone it is unrestricted.
///
/// `None` if no straight approach was found. The grasp is still valid, but only a curved motion could reach it.
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
            barriers: presented.barriers(),
            poses_left: Cell::new(MAX_POSES_CHECKED),
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

fn moved(pose: &HandPose, displacement: Vec3) -> HandPose {
    let mut moved = *pose;
    moved.frame_from_wrist.position += displacement;
    moved
}

struct Planner<'a> {
    rig: &'a Rig,
    approach: Option<ApproachCone>,
    close: HandPose,
    /// The digits that hold the object, thumb first.
    holding: [bool; 5],
    obstacles: Obstacles<'a>,
}

impl Planner<'_> {
    fn plan(&self) -> Option<(Vec3, HandPose)> {
        // Digits that hold nothing open with the others, or else keep their pose.
        let opening_digits = |i: usize| {
            if i < OPENINGS.len() {
                [true; 5]
            } else {
                self.holding
            }
        };
        let opened: [_; 2 * OPENINGS.len()] = std::array::from_fn(|i| {
            let pose = self.opened(OPENINGS[i % OPENINGS.len()], opening_digits(i));
            (pose, self.solids(&pose))
        });
        // Opening in place does not depend on the direction.
        let in_place: [OnceCell<bool>; 2 * OPENINGS.len()] = Default::default();
        for direction in self.directions() {
            for back in BACK_OFFS {
                for (i, ((pose, solids), in_place)) in opened.iter().zip(&in_place).enumerate() {
                    let opens = if back == 0.0 {
                        *in_place.get_or_init(|| self.is_clear(solids) && self.closes_from(pose, 0.0))
                    } else {
                        self.is_clear(&solids.moved(direction * -back))
                    };
                    if !opens || !self.approach_is_free(&solids.moved(direction * -back), direction) {
                        continue;
                    }
                    let pose = moved(pose, direction * -back);
                    if back == 0.0 || self.closes_from(&pose, back) {
                        let smaller_openings = &OPENINGS[..i % OPENINGS.len()];
                        return Some((
                            direction,
                            self.narrowed(pose, smaller_openings, opening_digits(i), direction, back),
                        ));
                    }
                }
            }
        }
        None
    }

    /// The hand in place with the digits in `opens` opened, until the tips have moved `opening` metres or the joints reach their
    /// limits.
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
            // The bend ratio does not affect the open digit.
            bend_ratio: 1.0,
        };
        let open = flexing.opened();
        let tip = |angles| digit_frames(rig, self.close.frame_from_wrist, angles).tip;
        let whole = tip(closed).distance(tip(open));
        closed.toward(&open, (opening / whole).min(1.0))
    }

    /// An open hand, `back` metres before the grasp. Each digit opens as little as possible: only one whose first link lies on the
    /// object has to open far.
    fn narrowed(
        &self,
        mut pose: HandPose,
        smaller_openings: &[f32],
        opens: [bool; 5],
        direction: Vec3,
        back: f32,
    ) -> HandPose {
        for digit in Digit::ALL.into_iter().filter(|digit| opens[digit.index()]) {
            for &opening in smaller_openings {
                let mut tried = pose;
                tried.digits[digit.index()] = self.opened_digit(digit, opening);
                let solids = self.solids(&tried);
                if self.is_clear(&solids)
                    && self.approach_is_free(&solids, direction)
                    && self.closes_from(&tried, back)
                {
                    pose = tried;
                    break;
                }
            }
        }
        pose
    }

    /// The directions of approach to try, in the object's frame: the natural one first, then those that deviate more and more.
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

    /// The solids of the hand for comparison with the object and the barriers.
    fn solids(&self, pose: &HandPose) -> TrackedSolids {
        TrackedSolids::of_rig(
            self.rig,
            pose.frame_from_wrist,
            &HandSolids::of_pose(self.rig, pose),
        )
    }

    /// True if an open hand is clear of the object, the barriers and itself.
    fn is_clear(&self, solids: &TrackedSolids) -> bool {
        let surface = &self.obstacles.object.surface;
        !solids
            .hand
            .iter()
            .any(|solid| comes_within(solid, surface, OPEN_CLEARANCE))
            && !self
                .obstacles
                .barriers
                .comes_within(solids.iter(), GIVER_CLEARANCE)
            && self_clearance(self.rig, &solids.hand) >= 0.0
    }

    fn approach_is_free(&self, pre_grasp: &TrackedSolids, direction: Vec3) -> bool {
        let motion = Motion {
            solids_at: |share: f32| pre_grasp.moved(direction * (APPROACH_DISTANCE * (share - 1.0))),
            travels: pre_grasp.iter().map(|_| APPROACH_DISTANCE).collect(),
        };
        motion.is_free(&self.obstacles, APPROACH_CLEARANCE)
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
                        open.digits[digit].toward(&self.close.digits[digit], share)
                    }),
                };
                self.solids(&pose)
            },
            travels: self.closing_travels(open, back),
        };
        motion.is_free(&self.obstacles, CLOSING_CLEARANCE)
    }

    /// An upper bound, in metres, of the travel of any point of each of the hand's solids while it closes.
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
                // The farthest point of the link from each joint that moves it, with the digit stretched.
                let turned = (0..=link).map(|joint| {
                    let reach: f32 = lengths[joint..=link].iter().sum();
                    turns[joint] * (reach + thickest)
                });
                back + turned.sum::<f32>()
            }));
        }
        travels.extend(solids.palm.iter().map(|_| back));
        // The thenar turns with the thumb's metacarpal.
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

/// The pose to which a hand withdraws from an invalid grasp, in the object's frame: opened, and drawn back by [`APPROACH_DISTANCE`]
/// against a direction of approach.
pub(super) fn withdrawal(around: &GraspContext<'_>, hand: &HandPose) -> HandPose {
    let planner = Planner {
        rig: around.rig,
        approach: around.requirements.approach,
        close: *hand,
        holding: [true; 5],
        obstacles: Obstacles {
            object: around.object.object,
            barriers: around.presented.barriers(),
            poses_left: Cell::new(MAX_POSES_OF_WITHDRAWAL),
        },
    };
    let opened = planner.opened(OPENINGS[1], [true; 5]);
    let solids = planner.solids(&opened);
    let ends_clear = |back: Vec3| {
        let away = solids.moved(back);
        let surface = &around.object.object.surface;
        !planner
            .obstacles
            .barriers
            .comes_within(away.iter(), GIVER_CLEARANCE)
            && !away.hand.iter().any(|solid| comes_within(solid, surface, 0.0))
    };
    let mut end: Option<Vec3> = None;
    let mut natural: Option<Vec3> = None;
    for direction in planner.directions() {
        let back = direction * -APPROACH_DISTANCE;
        natural.get_or_insert(back);
        if ends_clear(back) {
            if planner.approach_is_free(&solids, direction) {
                return moved(&opened, back);
            }
            end.get_or_insert(back);
        }
    }
    moved(&opened, end.or(natural).unwrap_or_default())
}
