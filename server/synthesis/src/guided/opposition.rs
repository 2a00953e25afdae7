//! Where the pads of a hand oppose each other while it closes.

use glam::Vec3;

use crate::{
    hand::{Digit, HandPose, kinematics::digit_frames, rig::Rig},
    physical::{
        shape::HandShape,
        solids::{HandSolids, TaperedCapsule, link_radii},
    },
    pose::Pose,
    synthesis::random::AttemptStream,
};

/// Least cosine between the line through two opposed pads and each of their palmar directions: 45°.
const LEAST_COS: f32 = 0.7;

/// Smallest and largest bend ratio of thumb and fingers: from nearly straight fingers that bend at the knuckles to
/// curled ones, around those of the thesis' Algorithm 4.
const BEND_RATIO: [f32; 2] = [0.35, 1.6];

/// Oppositions that a hand knows. More are more varied, and take more time when a rig is first used: about 150 µs each.
const KNOWN: usize = 1024;

/// Draws at most for each opposition that a hand knows; one in thirty or so is one.
const MOST_DRAWS_PER_KNOWN: u64 = 400;

/// Seed of the draws: any will do, and every hand knows the same forever.
const SEED: u64 = 0x4f50_504f;

/// Share of oppositions between the thumb and the fingers' outer pads; the others are with the middle links, deeper in
/// the hand.
const OUTER_SHARE: f32 = 0.65;

/// Pads that oppose each other, in the wrist's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Opposition {
    /// How the hand is held.
    pub shape: HandShape,
    /// How far thumb and fingers are closed: shares of their ways.
    pub closed: [f32; 2],
    /// The thumb's pad on the skin, in metres.
    pub thumb: Vec3,
    /// The middle of the fingers' pads on the skin, in metres.
    pub fingers: Vec3,
}

/// Which fingers close, with the share of proposals that take them: pinches of the index finger are rare among people's
/// grasps (Feix et al. 2016), and whole hands hold best.
const FINGER_SETS: [([bool; 5], f32); 4] = [
    ([true, true, false, false, false], 0.1),
    ([true, true, true, false, false], 0.25),
    ([true, true, true, true, false], 0.2),
    ([true, true, true, true, true], 0.45),
];

/// Share of hands that tuck their idle fingers away: people do when they pinch something small, and fingers that are
/// tucked away are out of a giver's way.
const TUCKED_SHARE: f32 = 0.4;

/// How much less a hand is closed, when it comes to a place that it fits, than it is going to be there: a share of the
/// digits' ways. More meets with more of the object and the giver's hand on the way, less finds thicker parts too thick.
const PRESHAPE_ROOM: f32 = 0.22;

/// A hand's shape, before anything is closed.
pub fn draw_shape(stream: &mut AttemptStream) -> HandShape {
    let mut height = stream.unit();
    let closing = FINGER_SETS
        .iter()
        .find(|(_, share)| {
            height -= share;
            height < 0.0
        })
        .map_or(FINGER_SETS[3].0, |(set, _)| *set);
    HandShape {
        thumb_yaw: stream.unit(),
        // Fingers are rarely spread far.
        spread: stream.unit() * stream.unit(),
        bend_ratios: [
            stream.between(BEND_RATIO[0], BEND_RATIO[1]),
            stream.between(BEND_RATIO[0], BEND_RATIO[1]),
        ],
        closing,
        preshape: [0.0; 2],
        tucks: stream.unit() < TUCKED_SHARE,
    }
}

/// How a hand can oppose its thumb and its fingers.
#[derive(Clone, Debug, Default)]
pub struct Oppositions {
    /// By width, ascending.
    known: Vec<Opposition>,
    /// Balls inside palm and forearm, in the wrist's frame: middles and radii in metres.
    cores: Vec<(Vec3, f32)>,
}

impl Oppositions {
    /// Draws shapes and how far they have closed, and keeps those whose thumb and fingers oppose each other.
    pub fn of(rig: &Rig) -> Self {
        let mut known = Vec::with_capacity(KNOWN);
        for draw in 0..KNOWN as u64 * MOST_DRAWS_PER_KNOWN {
            if known.len() == KNOWN {
                break;
            }
            let mut stream = AttemptStream::new(SEED, draw);
            let shape = draw_shape(&mut stream);
            let finger_link = if stream.unit() < OUTER_SHARE { 2 } else { 1 };
            let closed = [stream.unit(), stream.unit()];
            known.extend(opposition(rig, &shape, finger_link, closed));
        }
        known.sort_by(|a, b| a.width().total_cmp(&b.width()));
        let stretched = HandPose {
            frame_from_wrist: Pose::IDENTITY,
            digits: rig.stretched(),
        };
        let solids = HandSolids::of_pose(rig, &stretched);
        let inside = |solid: &TaperedCapsule, along: f32| (solid.at(along), solid.radius_at(along));
        // Those that meet something most often come first.
        let of_forearm = [0.2, 0.6, 1.0].map(|along| solids.forearm.map(|solid| inside(&solid, along)));
        let of_palm = [0.6, 0.95, 0.2].map(|along| solids.palm.map(|solid| inside(&solid, along)));
        let cores = of_palm.as_flattened().iter().chain(of_forearm.as_flattened());
        Self {
            known,
            cores: cores.copied().collect(),
        }
    }

    /// Balls inside palm and forearm, in the wrist's frame: middles and radii in metres.
    pub fn cores(&self) -> &[(Vec3, f32)] {
        &self.cores
    }

    /// One whose pads are between `least` and `most` metres apart; none if there is none.
    pub fn draw(&self, [least, most]: [f32; 2], stream: &mut AttemptStream) -> Option<&Opposition> {
        let first = self.known.partition_point(|known| known.width() < least);
        let end = self.known.partition_point(|known| known.width() <= most);
        (first < end).then(|| &self.known[first + stream.below(end - first)])
    }
}

impl Opposition {
    /// Balls inside the links of the digits where they are when the pads meet what is between them, fingers that do not
    /// close left out: middles and radii in metres, in the wrist's frame. The first of the links are within the palm's
    /// reach and left out too.
    pub fn link_balls(&self, rig: &Rig) -> [(Vec3, f32); 15] {
        let pose = HandPose {
            frame_from_wrist: Pose::IDENTITY,
            digits: Digit::ALL.map(|digit| {
                let closed = self.closed[usize::from(digit != Digit::Thumb)];
                self.shape.flexing(rig, digit).closed_by(closed)
            }),
        };
        let links = HandSolids::of_pose(rig, &pose).phalanges;
        std::array::from_fn(|i| {
            let (digit, (link, along)) = (i / 3, [(1, 0.5), (2, 0.2), (2, 1.0)][i % 3]);
            // A finger that rests may be anywhere: its neighbour's ball stands for it.
            let digit = (0..=digit)
                .rfind(|&digit| self.shape.closing[digit])
                .unwrap_or_default();
            let solid = links[digit][link];
            (solid.at(along), solid.radius_at(along))
        })
    }

    /// Distance between the pads in metres.
    pub fn width(&self) -> f32 {
        self.fingers.distance(self.thumb)
    }
}

/// The opposition of a shape whose thumb and fingers have closed by shares of their ways, between the thumb's tip
/// and a link of the fingers, if there is one.
fn opposition(rig: &Rig, shape: &HandShape, finger_link: usize, closed: [f32; 2]) -> Option<Opposition> {
    let (thumb, thumb_facing) = pad(rig, Digit::Thumb, shape, 2, closed[0]);
    // The two fingers next to the thumb decide: the others follow.
    let index = pad(rig, Digit::Index, shape, finger_link, closed[1]);
    let (fingers, fingers_facing) = if shape.closing[Digit::Middle.index()] {
        let middle = pad(rig, Digit::Middle, shape, finger_link, closed[1]);
        (
            (index.0 + middle.0) * 0.5,
            (index.1 + middle.1).normalize_or_zero(),
        )
    } else {
        index
    };
    let across = (fingers - thumb).normalize_or_zero();
    (across.dot(thumb_facing) >= LEAST_COS && -across.dot(fingers_facing) >= LEAST_COS).then_some(
        Opposition {
            shape: HandShape {
                preshape: closed.map(|closed| (closed - PRESHAPE_ROOM).max(0.0)),
                ..*shape
            },
            closed,
            thumb,
            fingers,
        },
    )
}

/// The middle of a link's pad on the skin and the direction it faces, in the wrist's frame.
fn pad(rig: &Rig, digit: Digit, shape: &HandShape, link: usize, closed: f32) -> (Vec3, Vec3) {
    let digit_rig = rig.digit(digit);
    let radii = link_radii(rig, digit);
    let angles = shape.flexing(rig, digit).closed_by(closed);
    let frames = digit_frames(digit_rig, Pose::IDENTITY, angles);
    let frame = frames.links[link];
    let radius = 0.5 * (radii[link] + radii[link + 1]);
    let middle = Vec3::new(0.0, 0.5 * digit_rig.lengths[link], radius);
    (frame.transform_point(middle), frame.transform_vector(Vec3::Z))
}
