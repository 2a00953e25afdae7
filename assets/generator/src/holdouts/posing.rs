//! Poses a giver's hand as its author describes it: a rough orientation of the hand, a rough angle for every joint, and
//! what should touch where. A descent refines all of it, keeps the hand out of the object and of itself, and stays within
//! the rig's limits.

use glam::{Mat3, Quat, Vec2, Vec3};
use grasp_assets::hands::Hand;
use grasp_synthesis::{
    base::pose::Pose,
    geometry::mesh_bvh::MeshBvh,
    model::hand::{
        Digit, DigitAngles, HandPose, Phalanx,
        kinematics::{HandFrames, hand_frames},
    },
};

use serde::Deserialize;

use super::{
    halton::halton,
    hand_capsules::{Capsule, Palm, links, signed_distance},
    least_squares::minimise,
};

/// A hold as its author describes it, in the object's frame.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct Intent {
    /// About where stretched fingers would point.
    pub(crate) fingers: [f32; 3],
    /// About where the palm faces.
    pub(crate) palm: [f32; 3],
    /// About how each digit is bent, thumb first.
    pub(crate) digits: [Bend; 5],
    /// Which links touch where.
    pub(crate) touches: Vec<Touch>,
    /// Where the palm touches.
    #[serde(default)]
    pub(crate) palm_touches: Vec<PalmTouch>,
}

/// Approximate angles of a digit, in degrees.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Bend {
    /// ψ1, toward the little finger's side.
    pub(crate) yaw: f32,
    /// θ1.
    pub(crate) pitch: f32,
    /// θ2; θ3 follows.
    pub(crate) second: f32,
    /// How strongly: 1 gives way to any contact, 5 hardly moves.
    #[serde(default = "one")]
    pub(crate) firmness: f32,
}

fn one() -> f32 {
    1.0
}

/// Which side of a link.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Side {
    /// The palm's side.
    Pad,
    /// The thumb's side of a finger.
    Thumbward,
    /// The little finger's side.
    Littleward,
    /// Between pad and the thumb's side.
    PadThumbward,
    /// Between pad and the little finger's side.
    PadLittleward,
}

impl Side {
    /// The side in the frame of a right hand's link: +z is the pad, +x the thumb's side.
    pub(crate) fn direction(self) -> Vec3 {
        let half = std::f32::consts::FRAC_1_SQRT_2;
        match self {
            Self::Pad => Vec3::Z,
            Self::Thumbward => Vec3::X,
            Self::Littleward => Vec3::NEG_X,
            Self::PadThumbward => Vec3::new(half, 0.0, half),
            Self::PadLittleward => Vec3::new(-half, 0.0, half),
        }
    }
}

/// A part of a digit's skin that should touch the object.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Touch {
    /// The digit.
    pub(crate) digit: Digit,
    /// Its link.
    pub(crate) phalanx: Phalanx,
    /// The share of the way along it.
    pub(crate) along: f32,
    /// The side.
    pub(crate) side: Side,
    /// About where, in millimetres; the surface point nearest to it is meant.
    pub(crate) at_mm: [f32; 3],
    /// How much the place matters compared with the touch itself: 0 anywhere, 1 only there.
    #[serde(default = "some_place")]
    pub(crate) place: f32,
}

fn some_place() -> f32 {
    0.3
}

/// A part of the palm's skin that should touch the object.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PalmTouch {
    /// The part: x and y in the wrist frame, in millimetres.
    pub(crate) palm_mm: [f32; 2],
    /// About where, in millimetres; the surface point nearest to it is meant.
    pub(crate) at_mm: [f32; 3],
    /// As for a [`Touch`].
    #[serde(default = "some_palm_place")]
    pub(crate) place: f32,
}

fn some_palm_place() -> f32 {
    0.1
}

/// How deep flesh may be pressed in without cost, in metres: about as much as skin gives.
const SOFTNESS: f32 = 0.0005;

/// How much two fingers may press into each other without cost, in metres: flesh between fingers gives more than pads.
const SELF_SOFTNESS: f32 = 0.0015;

/// Descents from slightly different starting points; the best one counts.
const STARTS: u32 = 10;

/// Upper bound on the iterations of a descent; most converge after 20 to 60.
const ITERATIONS: usize = 120;

/// Metres per unit of a position parameter: a unit then moves fingertips about as far as a radian does.
const POSITION_SCALE: f32 = 0.1;

/// Weights of the residuals, which are in millimetres. A touch 1 mm off its surface costs 1.
const WEIGHT_TOUCH: f32 = 1.0;
/// Skin that faces the surface at an angle, per unit of the sine.
const WEIGHT_FACING: f32 = 3.0;
/// Overlap with the object.
const WEIGHT_PENETRATION: f32 = 2.0;
/// Overlap of digits.
const WEIGHT_SELF: f32 = 1.5;
/// An angle's deviation in radians, times the digit's firmness.
const WEIGHT_ANGLE: f32 = 2.5;
/// The wrist's rotation off its guess, per radian.
const WEIGHT_WRIST_TURN: f32 = 4.0;
/// The wrist's shift off its guess, per metre.
const WEIGHT_WRIST_SHIFT: f32 = 60.0;

/// A touch on the mesh.
struct WantedContact {
    part: Part,
    /// On the surface, with its outward normal.
    target: (Vec3, Vec3),
    place: f32,
}

/// What touches.
#[derive(Clone, Copy)]
enum Part {
    /// A share of the way along a side of a link.
    Link(Digit, Phalanx, f32, Side),
    /// A point of the palm's skin in the wrist frame.
    Palm(Vec3),
}

/// The problem that a descent solves.
struct Problem<'a> {
    hand: &'a Hand,
    palm: &'a Palm,
    object: &'a MeshBvh,
    intent: &'a Intent,
    start: Pose,
    /// What should touch where.
    contacts: Vec<WantedContact>,
    /// How close two capsules of different digits may come.
    allowed: Vec<f32>,
}

/// The hand in the object's frame that comes closest to `intent`, and its cost.
pub(crate) fn pose_hand(hand: &Hand, object: &MeshBvh, intent: &Intent) -> (HandPose, f64) {
    let palm = Palm::of(hand);
    let problem = Problem::new(hand, &palm, object, intent);
    let bounds = problem.bounds();
    let residuals = |parameters: &[f64]| problem.residuals(parameters);
    let best = (0..STARTS)
        .map(|start| minimise(&problem.start(start), &bounds, ITERATIONS, &residuals))
        .reduce(|best, next| if next.cost < best.cost { next } else { best })
        .expect("there is at least one start");
    (problem.pose(&best.parameters), best.cost)
}

impl<'a> Problem<'a> {
    fn new(hand: &'a Hand, palm: &'a Palm, object: &'a MeshBvh, intent: &'a Intent) -> Self {
        let y = Vec3::from(intent.fingers).normalize_or(Vec3::Y);
        let z = Vec3::from(intent.palm);
        let z = (z - y * z.dot(y)).normalize_or(Vec3::Z);
        let start = Pose::from_orientation(Quat::from_mat3(&Mat3::from_cols(y.cross(z), y, z)).normalize());
        let target = |at_mm: [f32; 3]| {
            let closest = object
                .closest_point_within(Vec3::from(at_mm) * 1e-3, 1.0)
                .expect("targets are near the object");
            (closest.position, object.mesh().normal(closest.triangle as usize))
        };
        let links = intent.touches.iter().map(|touch| WantedContact {
            part: Part::Link(touch.digit, touch.phalanx, touch.along, touch.side),
            target: target(touch.at_mm),
            place: touch.place,
        });
        let palms = intent.palm_touches.iter().map(|touch| WantedContact {
            part: Part::Palm(palm_point(palm, Vec2::from(touch.palm_mm) * 1e-3)),
            target: target(touch.at_mm),
            place: touch.place,
        });
        let mut problem = Self {
            hand,
            palm,
            object,
            intent,
            start,
            contacts: links.chain(palms).collect(),
            allowed: Vec::new(),
        };
        // The position in which the parts that should touch are nearest to their targets on average.
        let posed = problem.pose(&problem.start(0));
        let frames = hand_frames(&hand.rig, &posed);
        let share = 1.0 / problem.contacts.len().max(1) as f32;
        problem.start.position = problem
            .contacts
            .iter()
            .map(|contact| (contact.target.0 - problem.skin(contact.part, &frames).0) * share)
            .sum();
        // Neighbouring digits overlap at their roots even when the hand is stretched.
        let stretched = HandPose {
            frame_from_wrist: start,
            digits: hand.rig.stretched(),
        };
        problem.allowed = problem
            .pairs(&stretched)
            .into_iter()
            .map(|(distance, touching)| distance.min(touching - SELF_SOFTNESS))
            .collect();
        problem
    }

    fn bounds(&self) -> Vec<(f64, f64)> {
        let mut bounds = vec![(-1.0, 1.0); 3];
        bounds.extend([(-1.2, 1.2); 3]);
        for digit in &self.hand.rig.digits {
            for range in [
                digit.limits.base_yaw,
                digit.limits.base_pitch,
                digit.limits.second_pitch,
            ] {
                bounds.push((f64::from(range.min), f64::from(range.max)));
            }
        }
        bounds
    }

    /// The author's guess, moved by up to 15 mm and 0.25 rad along a Halton sequence (none for the first).
    fn start(&self, index: u32) -> Vec<f64> {
        let jitter = |base: u32, size: f64| {
            if index == 0 {
                0.0
            } else {
                (halton(index, base) - 0.5) * 2.0 * size
            }
        };
        let mut parameters = vec![
            jitter(2, 0.15),
            jitter(3, 0.15),
            jitter(5, 0.15),
            jitter(7, 0.25),
            jitter(11, 0.25),
            jitter(13, 0.25),
        ];
        for bend in self.intent.digits {
            for (angle, base) in [(bend.yaw, 17), (bend.pitch, 19), (bend.second, 23)] {
                parameters.push(f64::from(angle.to_radians()) + jitter(base, 0.1));
            }
        }
        parameters
    }

    fn pose(&self, parameters: &[f64]) -> HandPose {
        let p: Vec<f32> = parameters.iter().map(|&v| v as f32).collect();
        let turn = Quat::from_scaled_axis(Vec3::new(p[3], p[4], p[5]));
        HandPose {
            frame_from_wrist: Pose::new(
                self.start.position + Vec3::new(p[0], p[1], p[2]) * POSITION_SCALE,
                (turn * self.start.orientation).normalize(),
            ),
            digits: std::array::from_fn(|i| DigitAngles::coupled(p[6 + 3 * i], p[7 + 3 * i], p[8 + 3 * i])),
        }
    }

    fn residuals(&self, parameters: &[f64]) -> Vec<f64> {
        let pose = self.pose(parameters);
        let mut values = Vec::with_capacity(512);
        self.push_touches(&pose, &mut values);
        self.push_penetration(&pose, &mut values);
        for ((distance, _), allowed) in self.pairs(&pose).into_iter().zip(&self.allowed) {
            values.push(WEIGHT_SELF * 1e3 * (allowed - distance).max(0.0));
        }
        for (digit, bend) in pose.digits.iter().zip(self.intent.digits) {
            for (angle, wanted) in [
                (digit.base_yaw, bend.yaw),
                (digit.base_pitch, bend.pitch),
                (digit.second_pitch, bend.second),
            ] {
                values.push(WEIGHT_ANGLE * bend.firmness * (angle - wanted.to_radians()));
            }
        }
        for i in 0..3 {
            values.push(WEIGHT_WRIST_SHIFT * POSITION_SCALE * parameters[i] as f32);
            values.push(WEIGHT_WRIST_TURN * parameters[3 + i] as f32);
        }
        values.into_iter().map(f64::from).collect()
    }

    /// Where a part of the skin is, and its outward direction.
    fn skin(&self, part: Part, frames: &HandFrames) -> (Vec3, Vec3) {
        match part {
            Part::Link(digit, phalanx, along, side) => {
                let rig = self.hand.rig.digit(digit);
                let frame = frames.digits[digit.index()].links[phalanx.index()];
                let outward = side.direction();
                let radius = 0.5 * rig.diameters[phalanx.index()];
                let axis = Vec3::Y * (along * rig.lengths[phalanx.index()]);
                (
                    frame.transform_point(axis + outward * radius),
                    frame.transform_vector(outward),
                )
            }
            Part::Palm(point) => (
                frames.wrist.transform_point(point),
                frames.wrist.transform_vector(Vec3::Z),
            ),
        }
    }

    fn push_touches(&self, pose: &HandPose, values: &mut Vec<f32>) {
        let frames = hand_frames(&self.hand.rig, pose);
        for contact in &self.contacts {
            let (skin, outward) = self.skin(contact.part, &frames);
            let (target, normal) = contact.target;
            let above = signed_distance(self.object, skin, 0.1) * 1e3;
            values.push(WEIGHT_TOUCH * above);
            let place = (skin - target) * (1e3 * WEIGHT_TOUCH * contact.place);
            values.extend(place.to_array());
            values.push(WEIGHT_FACING * (1.0 + outward.dot(normal)).max(0.0));
        }
    }

    fn push_penetration(&self, pose: &HandPose, values: &mut Vec<f32>) {
        for chain in links(self.hand, pose) {
            for capsule in chain {
                for point in capsule.axis_samples() {
                    let distance = signed_distance(self.object, point, capsule.radius);
                    let depth = (capsule.radius - SOFTNESS - distance).max(0.0);
                    values.push(WEIGHT_PENETRATION * 1e3 * depth);
                }
            }
        }
        for &point in &self.palm.points {
            let point = pose.frame_from_wrist.transform_point(point);
            // Only points inside the object count.
            let depth = if self.object.contains(point) {
                -signed_distance(self.object, point, 0.05)
            } else {
                0.0
            };
            values.push(WEIGHT_PENETRATION * 1e3 * (depth - SOFTNESS).max(0.0));
        }
    }

    /// Distance of the axes, and the sum of the radii, of every two capsules that should not overlap: the links of
    /// different digits, and outer links and metacarpals.
    fn pairs(&self, pose: &HandPose) -> Vec<(f32, f32)> {
        let links = links(self.hand, pose);
        let mut pairs = Vec::with_capacity(128);
        let mut push = |a: &Capsule, b: &Capsule| pairs.push((a.axis_distance(b), a.radius + b.radius));
        for first in 0..5 {
            for second in first + 1..5 {
                for a in &links[first] {
                    for b in &links[second] {
                        push(a, b);
                    }
                }
            }
        }
        let place = |v: Vec3| pose.frame_from_wrist.transform_point(v);
        for metacarpal in &self.palm.metacarpals {
            let metacarpal = Capsule {
                start: place(metacarpal.start),
                end: place(metacarpal.end),
                radius: metacarpal.radius,
            };
            for chain in &links {
                push(&chain[2], &metacarpal);
            }
            push(&links[0][1], &metacarpal);
        }
        pairs
    }
}

/// The point of the palm's side of the skin nearest to (x, y).
fn palm_point(palm: &Palm, at: Vec2) -> Vec3 {
    palm.points
        .iter()
        .copied()
        .filter(|point| point.z > 0.0)
        .min_by(|a, b| {
            let distance = |p: &Vec3| p.truncate().distance_squared(at);
            distance(a).total_cmp(&distance(b))
        })
        .expect("the palm has skin")
}
