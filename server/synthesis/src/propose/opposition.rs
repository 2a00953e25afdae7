//! Hand shapes whose thumb and finger pads oppose each other, sampled once per rig.

use glam::Vec3;

use crate::{
    base::{pose::Pose, random::AttemptStream},
    model::hand::{Digit, HandPose, kinematics::digit_frames, rig::Rig},
    physical::{
        shape::HandShape,
        solids::{FOREARM_SOLIDS, HandSolids, PALM_SOLIDS, SPHERES, Spheres, TaperedCapsule, link_radii},
    },
};

/// Minimum cosine between the line through two opposed pads and each pad's palmar direction: 53° for widths up to
/// [`PINCH_WIDTH`], 45° above.
const MIN_FACING_COS: [f32; 2] = [0.6, 0.7];

/// Range of the bend ratios of thumb and fingers: from nearly straight fingers that flex at the knuckles to curled ones.
const BEND_RATIO: [f32; 2] = [0.35, 1.6];

/// Oppositions sampled per rig. More are more varied, but each adds about 150 µs to the first use of a rig.
const OPPOSITIONS: usize = 1024;

/// Upper bound on the draws per rig; on a human-like hand, one in five succeeds.
const MAX_DRAWS: u64 = 16 * OPPOSITIONS as u64;

/// Range of distances between opposed pads, in metres: from a blade to the widest object a hand can grasp.
const WIDTH_RANGE: [f32; 2] = [0.003, 0.11];

/// Steps of the local search that brings a hand's pads into opposition.
const STEPS: usize = 96;

/// Random hands drawn per opposition; the local search starts from the best.
const INITIAL_HANDS: usize = 16;

/// Size of the first step, as a share of each parameter's range; later steps shrink linearly.
const FIRST_STEP: f32 = 0.3;

/// Tolerance of the pads' distance from the drawn width, in metres.
const WIDTH_TOLERANCE: f32 = 0.004;

/// Range of pad positions along a digit's last link: from its middle to its tip.
const PAD_POSITIONS: [f32; 2] = [0.5, 1.0];

/// Width in metres up to which an object counts as thin, in [`FINGER_SETS`] and [`MIN_FACING_COS`].
const PINCH_WIDTH: f32 = 0.015;

/// Share of hands for thin objects in which only the index finger opposes the thumb and the others lie next to it.
const INDEX_ALONE_SHARE: f32 = 0.7;

/// Seed of the draws: arbitrary, but fixed so that a rig always has the same oppositions.
const SEED: u64 = 0x4f50_504f;

/// Share of oppositions between the thumb and the fingers' distal pads; the others use the middle phalanges, deeper in the hand.
const DISTAL_SHARE: f32 = 0.8;

/// Positions of inner spheres along each solid of the palm and of the forearm: those that collide most often come first.
const INNER_SPHERE_POSITIONS: [[f32; 3]; 2] = [[0.6, 0.95, 0.2], [0.2, 0.6, 1.0]];

/// Groups of [`SPHERES`] inner spheres for palm and forearm.
const INNER_SPHERE_GROUPS: usize =
    (INNER_SPHERE_POSITIONS[0].len() * (PALM_SOLIDS + FOREARM_SOLIDS)).div_ceil(SPHERES);

/// Inner spheres of a closing digit: the link, and the position along it.
const LINK_SPHERE_POSITIONS: [(usize, f32); 3] = [(1, 0.5), (2, 0.2), (2, 1.0)];

/// Groups of [`SPHERES`] inner spheres for the links of five digits.
const LINK_SPHERE_GROUPS: usize = (5 * LINK_SPHERE_POSITIONS.len()).div_ceil(SPHERES);

/// A hand shape whose pads oppose each other, in the wrist's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Opposition {
    /// Its index among the rig's oppositions.
    pub index: u16,
    /// The hand's shape before it closes.
    pub shape: HandShape,
    /// How far thumb and fingers are closed when the pads oppose, as shares of their range.
    pub closed: [f32; 2],
    /// Point on the skin of the thumb's pad, in metres.
    pub thumb: Vec3,
    /// Point on the skin midway between the fingers' pads, in metres.
    pub fingers: Vec3,
    /// Inner spheres of the closing digits' links at the opposed pose, in the wrist's frame.
    pub links: [Spheres; LINK_SPHERE_GROUPS],
}

/// Sets of closing digits, with the shares of hands that use them on thin and on thicker objects.
const FINGER_SETS: [([bool; 5], [f32; 2]); 4] = [
    ([true, true, false, false, false], [0.05, 0.1]),
    ([true, true, true, false, false], [0.1, 0.25]),
    ([true, true, true, true, false], [0.3, 0.2]),
    ([true, true, true, true, true], [0.55, 0.45]),
];

/// Share of hands that tuck their idle fingers into the palm, as people do when pinching; tucked fingers stay clear of the giver.
const TUCKED_SHARE: f32 = 0.4;

/// How much wider than the opposed pose a hand is preshaped, as a share of the digits' range.
const PRESHAPE_OPENING: f32 = 0.22;

/// Draws a hand shape of a rig for an object of a width in metres.
pub fn draw_shape(rig: &Rig, width: f32, stream: &mut AttemptStream) -> HandShape {
    let is_thick = usize::from(width > PINCH_WIDTH);
    let sets = FINGER_SETS.map(|(set, shares)| (set, shares[is_thick]));
    let closing = drawn_set(sets, stream.unit());
    HandShape {
        thumb_yaw: stream.unit(),
        // The product makes wide spreads rare.
        spread: stream.unit() * stream.unit(),
        bend_ratios: [
            stream.between(BEND_RATIO[0], BEND_RATIO[1]),
            stream.between(BEND_RATIO[0], BEND_RATIO[1]),
        ],
        closing: rig.own_digits(closing),
        preshape: [0.0; 2],
        tucks: stream.unit() < TUCKED_SHARE,
    }
}

/// The set of digits that a number from 0 to 1 selects by their shares; the last if they sum to less.
pub(super) fn drawn_set<const N: usize>(sets: [([bool; 5], f32); N], mut height: f32) -> [bool; 5] {
    let drawn = sets.iter().find(|(_, share)| {
        height -= share;
        height < 0.0
    });
    drawn.unwrap_or(&sets[N - 1]).0
}

fn min_facing_cos(width: f32) -> f32 {
    MIN_FACING_COS[usize::from(width > PINCH_WIDTH)]
}

/// The sampled oppositions of a rig.
#[derive(Clone, Debug, Default)]
pub struct Oppositions {
    pub(super) by_width: Vec<Opposition>,
    /// Their widths in metres, contiguous for binary search.
    widths: Vec<f32>,
    /// Inner spheres of palm and forearm, in the wrist's frame.
    pub(super) inner_spheres: [Spheres; INNER_SPHERE_GROUPS],
}

impl Oppositions {
    /// Samples a rig's oppositions: shapes and widths for which the pads can be brought to oppose each other.
    pub fn of(rig: &Rig) -> Self {
        let mut by_width: Vec<Opposition> = (0..MAX_DRAWS)
            .filter_map(|draw| OpposingHand::draw(rig, &mut AttemptStream::new(SEED, draw)))
            .take(OPPOSITIONS)
            .collect();
        by_width.sort_by(|a, b| a.width().total_cmp(&b.width()));
        for (index, opposition) in by_width.iter_mut().enumerate() {
            opposition.index = index as u16;
        }
        let stretched = HandPose {
            frame_from_wrist: Pose::IDENTITY,
            digits: rig.stretched(),
        };
        let solids = HandSolids::of_pose(rig, &stretched);
        let sphere = |solid: &TaperedCapsule, along: f32| (solid.at(along), solid.radius_at(along));
        let [palm_positions, forearm_positions] = INNER_SPHERE_POSITIONS;
        let of_forearm = forearm_positions.map(|along| solids.forearm.map(|solid| sphere(&solid, along)));
        let of_palm = palm_positions.map(|along| solids.palm.map(|solid| sphere(&solid, along)));
        Self {
            widths: by_width.iter().map(Opposition::width).collect(),
            by_width,
            inner_spheres: Spheres::of_all(&[of_palm.as_flattened(), of_forearm.as_flattened()].concat()),
        }
    }

    /// Draws an opposition whose width in metres is between `min` and `max`; `None` if the rig has none.
    pub fn draw(&self, [min, max]: [f32; 2], stream: &mut AttemptStream) -> Option<&Opposition> {
        let first = self.widths.partition_point(|&width| width < min);
        let end = self.widths.partition_point(|&width| width <= max);
        (first < end).then(|| &self.by_width[first + stream.below(end - first)])
    }

    /// The largest distance between opposed pads, in metres; 0 if the rig has no oppositions.
    pub fn widest(&self) -> f32 {
        self.widths.last().copied().unwrap_or_default()
    }
}

impl Opposition {
    /// Distance between the opposed pads, in metres.
    pub fn width(&self) -> f32 {
        self.fingers.distance(self.thumb)
    }
}

/// A hand in the local search for an opposition.
#[derive(Clone, Copy, Debug)]
struct OpposingHand {
    shape: HandShape,
    /// How far thumb and fingers are closed, as shares of their range.
    closed: [f32; 2],
    /// The link of the fingers that opposes the thumb's last link.
    finger_link: usize,
    /// Pad positions along the links of thumb and fingers, 0 to 1.
    positions: [f32; 2],
    /// Only the finger next to the thumb opposes it, whichever others close.
    index_alone: bool,
}

/// The search parameters that move the thumb's pad; the others move the fingers'.
const MOVES_THUMB: [bool; 5] = [true, true, false, true, false];

/// The opposed pads of a hand.
#[derive(Clone, Copy, Debug)]
struct Pads {
    thumb: Pad,
    fingers: Pad,
}

/// A point on a pad's skin in metres and the direction it faces, in the wrist's frame.
#[derive(Clone, Copy, Debug)]
struct Pad {
    skin: Vec3,
    facing: Vec3,
}

impl OpposingHand {
    /// Draws a hand and a width, and searches for a pose with pads opposed at that width; `None` if the search fails.
    fn draw(rig: &Rig, stream: &mut AttemptStream) -> Option<Opposition> {
        let [min, max] = WIDTH_RANGE;
        let width = min * (max / min).powf(stream.unit());
        let shape = draw_shape(rig, width, stream);
        let distal = stream.unit() < DISTAL_SHARE;
        let mut position = || stream.between(PAD_POSITIONS[0], PAD_POSITIONS[1]);
        let positions = [position(), if distal { position() } else { 0.5 }];
        let mut hand = Self {
            shape,
            closed: [stream.unit(), stream.unit()],
            finger_link: if distal { 2 } else { 1 },
            positions,
            index_alone: stream.unit() < INDEX_ALONE_SHARE && width <= PINCH_WIDTH,
        };
        let mut error = hand.pads(rig).error(width);
        for _ in 0..INITIAL_HANDS {
            let drawn = hand.with_parameters(std::array::from_fn(|_| stream.unit()));
            let drawn_error = drawn.pads(rig).error(width);
            if drawn_error < error {
                (hand, error) = (drawn, drawn_error);
            }
        }
        let mut pads = hand.pads(rig);
        for step in 0..STEPS {
            let size = FIRST_STEP * (1.0 - step as f32 / STEPS as f32);
            let (stepped, stepped_pads) = hand.stepped(rig, &pads, size, stream);
            let stepped_error = stepped_pads.error(width);
            if stepped_error < error {
                (hand, pads, error) = (stepped, stepped_pads, stepped_error);
            }
        }
        hand.opposition(rig, &pads, width)
    }

    /// The hand with one parameter perturbed by up to `size`, and its pads. Only the affected pad is recomputed.
    fn stepped(&self, rig: &Rig, pads: &Pads, size: f32, stream: &mut AttemptStream) -> (Self, Pads) {
        let mut parameters = self.parameters();
        let changed = stream.below(parameters.len());
        parameters[changed] = (parameters[changed] + stream.between(-size, size)).clamp(0.0, 1.0);
        let stepped = self.with_parameters(parameters);
        let mut pads = *pads;
        if MOVES_THUMB[changed] {
            pads.thumb = stepped.pad(rig, Digit::Thumb);
        } else {
            pads.fingers = stepped.fingers_pad(rig);
        }
        (stepped, pads)
    }

    /// The search parameters, normalized to 0 to 1: the thumb's yaw, how far thumb and fingers are closed, and their bend ratios.
    fn parameters(&self) -> [f32; 5] {
        let [min, max] = BEND_RATIO;
        let [thumb, fingers] = self.shape.bend_ratios.map(|ratio| (ratio - min) / (max - min));
        [
            self.shape.thumb_yaw,
            self.closed[0],
            self.closed[1],
            thumb,
            fingers,
        ]
    }

    fn with_parameters(&self, [thumb_yaw, thumb_closed, fingers_closed, thumb, fingers]: [f32; 5]) -> Self {
        let [min, max] = BEND_RATIO;
        Self {
            shape: HandShape {
                thumb_yaw,
                bend_ratios: [thumb, fingers].map(|share| min + (max - min) * share),
                ..self.shape
            },
            closed: [thumb_closed, fingers_closed],
            ..*self
        }
    }

    fn pads(&self, rig: &Rig) -> Pads {
        Pads {
            thumb: self.pad(rig, Digit::Thumb),
            fingers: self.fingers_pad(rig),
        }
    }

    fn fingers_pad(&self, rig: &Rig) -> Pad {
        // The two fingers next to the thumb decide; the others follow.
        let mut fingers = rig.fingers();
        let first = self.pad(rig, fingers.next().unwrap_or(Digit::Index));
        match fingers.next().filter(|second| self.shape.closing[second.index()]) {
            Some(second) if !self.index_alone => {
                let second = self.pad(rig, second);
                Pad {
                    skin: (first.skin + second.skin) * 0.5,
                    facing: (first.facing + second.facing).normalize_or_zero(),
                }
            }
            _ => first,
        }
    }

    fn pad(&self, rig: &Rig, digit: Digit) -> Pad {
        let of_thumb = digit == Digit::Thumb;
        let link = if of_thumb { 2 } else { self.finger_link };
        let along = self.positions[usize::from(!of_thumb)];
        let digit_rig = rig.digit(digit);
        let radii = link_radii(rig, digit);
        let angles = self
            .shape
            .flexing(rig, digit)
            .closed_by(self.closed[usize::from(!of_thumb)]);
        let frame = digit_frames(digit_rig, Pose::IDENTITY, angles).links[link];
        let radius = radii[link] + (radii[link + 1] - radii[link]) * along;
        // The last link's solid ends at the centre of the tip's sphere.
        let beyond = if link == 2 { radii[3] } else { 0.0 };
        let on_skin = Vec3::new(0.0, along * (digit_rig.lengths[link] - beyond), radius);
        Pad {
            skin: frame.transform_point(on_skin),
            facing: frame.transform_vector(Vec3::Z),
        }
    }

    fn opposition(&self, rig: &Rig, pads: &Pads, width: f32) -> Option<Opposition> {
        let [thumb_cos, fingers_cos] = pads.facing();
        let fits = (pads.width() - width).abs() <= WIDTH_TOLERANCE;
        (fits && thumb_cos.min(fingers_cos) >= min_facing_cos(width)).then(|| Opposition {
            index: 0,
            shape: HandShape {
                preshape: self.closed.map(|closed| (closed - PRESHAPE_OPENING).max(0.0)),
                ..self.shape
            },
            closed: self.closed,
            thumb: pads.thumb.skin,
            fingers: pads.fingers.skin,
            links: self.links(rig),
        })
    }

    /// Inner spheres of the closing digits' links, in the wrist's frame.
    fn links(&self, rig: &Rig) -> [Spheres; LINK_SPHERE_GROUPS] {
        let pose = HandPose {
            frame_from_wrist: Pose::IDENTITY,
            digits: Digit::ALL.map(|digit| {
                let closed = self.closed[usize::from(digit != Digit::Thumb)];
                self.shape.flexing(rig, digit).closed_by(closed)
            }),
        };
        let links = HandSolids::of_pose(rig, &pose).phalanges;
        let closing = (0..5).filter(|&digit| self.shape.closing[digit]);
        let spheres: Vec<_> = closing
            .flat_map(|digit| {
                let links = &links[digit];
                LINK_SPHERE_POSITIONS
                    .map(|(link, along)| (links[link].at(along), links[link].radius_at(along)))
            })
            .collect();
        Spheres::of_all(&spheres)
    }
}

impl Pads {
    fn width(&self) -> f32 {
        self.thumb.skin.distance(self.fingers.skin)
    }

    /// Cosines between the line through the pads and the directions they face: 1 if they face each other.
    fn facing(&self) -> [f32; 2] {
        let across = (self.fingers.skin - self.thumb.skin).normalize_or_zero();
        [across.dot(self.thumb.facing), -across.dot(self.fingers.facing)]
    }

    /// How far the pads are from opposing each other at a width; 0 once they do with some margin.
    fn error(&self, width: f32) -> f32 {
        let width_error = ((self.width() - width).abs() - 0.5 * WIDTH_TOLERANCE).max(0.0) / 0.01;
        let facing_errors = self
            .facing()
            .map(|cos| (1.1 * min_facing_cos(width) - cos).max(0.0));
        width_error + 2.0 * (facing_errors[0] + facing_errors[1])
    }
}
