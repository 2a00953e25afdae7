//! Where the pads of a hand oppose each other while it closes.

use glam::Vec3;

use crate::{
    base::{pose::Pose, random::AttemptStream},
    model::hand::{Digit, HandPose, kinematics::digit_frames, rig::Rig},
    physical::{
        shape::HandShape,
        solids::{FOREARM_SOLIDS, HandSolids, PALM_SOLIDS, SPHERES, Spheres, TaperedCapsule, link_radii},
    },
};

/// Least cosine between the line through two opposed pads and each of their palmar directions, around thin and around
/// thicker things: 53° and 45°. A thumb whose base does not turn about its length meets a finger with the side of its
/// pad; on what is thick, such a pad slips.
const LEAST_COS: [f32; 2] = [0.6, 0.7];

/// Smallest and largest bend ratio of thumb and fingers: from nearly straight fingers that bend at the knuckles to
/// curled ones, around those of the thesis' Algorithm 4.
const BEND_RATIO: [f32; 2] = [0.35, 1.6];

/// Oppositions that a hand knows. More are more varied, and take more time when a rig is first used: about 150 µs each.
const KNOWN: usize = 1024;

/// How many it looks for at most; one in five is there for a hand like a person's.
const DRAWN: u64 = 16 * KNOWN as u64;

/// The thinnest and thickest that pads are brought to, in metres: from a blade to what a hand just gets round. Drawn so
/// that halves and doubles are as frequent: among thin things, a millimetre more or less is another grip.
const WIDTHS: [f32; 2] = [0.003, 0.11];

/// Steps in which a hand that is drawn is brought to oppose its pads at a width.
const STEPS: usize = 96;

/// Hands that are drawn for each opposition; the best is stepped on.
const SEEDS: usize = 16;

/// How far a step goes at first: a share of the thumb's range of yaw and of the digits' ways to closed.
const FIRST_STEP: f32 = 0.3;

/// Pads that are this much nearer or farther than they were to be, in metres, do as well.
const WIDTH_ROOM: f32 = 0.004;

/// Where along a digit's last link it may press: from the middle of its pad to the tip.
const PAD_SPOTS: [f32; 2] = [0.5, 1.0];

/// Up to this width in metres, hands draw their fingers from the first row of [`FINGER_SETS`]' shares.
const PINCHED_WIDTH: f32 = 0.015;

/// Share of hands of several fingers whose index finger alone meets the thumb: the others lie beside it, along a thing
/// that is too thin to be between two of them. With 0.8, hands of a sure type are found a seventh sooner than with 0.4, on six
/// objects of which most are thin; with 0, they take half as long again.
const INDEX_SHARE: f32 = 0.7;

/// Seed of the draws: any will do, and every hand knows the same forever.
const SEED: u64 = 0x4f50_504f;

/// Share of oppositions between the thumb and the fingers' outer pads; the others are with the middle links, deeper in
/// the hand. With 0.9, hands of a sure type are found a tenth sooner than with 0.65, on the same six objects.
const OUTER_SHARE: f32 = 0.8;

/// Where along each solid of palm and forearm balls are: those that meet something most often come first.
const CORE_SPOTS: [[f32; 3]; 2] = [[0.6, 0.95, 0.2], [0.2, 0.6, 1.0]];

/// Eights of balls that palm and forearm take.
const CORE_SPHERES: usize = (CORE_SPOTS[0].len() * (PALM_SOLIDS + FOREARM_SOLIDS)).div_ceil(SPHERES);

/// Where in the links of a digit that closes balls are: the link, and how far along it. The first of the links are within
/// the palm's reach and left out.
const LINK_SPOTS: [(usize, f32); 3] = [(1, 0.5), (2, 0.2), (2, 1.0)];

/// Eights of balls that five digits' links take.
const LINK_SPHERES: usize = (5 * LINK_SPOTS.len()).div_ceil(SPHERES);

/// Pads that oppose each other, in the wrist's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Opposition {
    /// Which of those that the hand knows it is.
    pub place: u16,
    /// How the hand is held.
    pub shape: HandShape,
    /// How far thumb and fingers are closed: shares of their ways.
    pub closed: [f32; 2],
    /// The thumb's pad on the skin, in metres.
    pub thumb: Vec3,
    /// The middle of the fingers' pads on the skin, in metres.
    pub fingers: Vec3,
    /// Balls inside the links of the digits where they are when the pads meet what is between them, fingers that do not
    /// close left out.
    pub links: [Spheres; LINK_SPHERES],
}

/// Which fingers close, with the shares of hands that close them on thin and on thicker things. What is thin turns between
/// two digits: of hands that touch scissors with one finger and the thumb, one in three hundred has closure, with three
/// fingers one in five. So most bring all of their fingers there, and those that find nothing rest.
const FINGER_SETS: [([bool; 5], [f32; 2]); 4] = [
    ([true, true, false, false, false], [0.05, 0.1]),
    ([true, true, true, false, false], [0.1, 0.25]),
    ([true, true, true, true, false], [0.3, 0.2]),
    ([true, true, true, true, true], [0.55, 0.45]),
];

/// Share of hands that tuck their idle fingers away: people do when they pinch something small, and fingers that are
/// tucked away are out of a giver's way.
const TUCKED_SHARE: f32 = 0.4;

/// How much less a hand is closed, when it comes to a place that it fits, than it is going to be there: a share of the
/// digits' ways. More meets with more of the object and the giver's hand on the way, less finds thicker parts too thick.
const PRESHAPE_ROOM: f32 = 0.22;

/// A hand's shape, before anything is closed, for a thing of a width in metres.
pub fn draw_shape(width: f32, stream: &mut AttemptStream) -> HandShape {
    let mut height = stream.unit();
    let closing = FINGER_SETS
        .iter()
        .find(|(_, shares)| {
            height -= shares[usize::from(width > PINCHED_WIDTH)];
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

fn least_cos(width: f32) -> f32 {
    LEAST_COS[usize::from(width > PINCHED_WIDTH)]
}

/// How a hand can oppose its thumb and its fingers.
#[derive(Clone, Debug, Default)]
pub struct Oppositions {
    /// By width, ascending.
    known: Vec<Opposition>,
    /// Their widths in metres, side by side.
    widths: Vec<f32>,
    /// Balls inside palm and forearm, in the wrist's frame.
    inner_spheres: [Spheres; CORE_SPHERES],
}

impl Oppositions {
    /// Draws shapes and widths, and keeps those whose thumb and fingers can be brought to oppose each other.
    pub fn of(rig: &Rig) -> Self {
        let mut known: Vec<Opposition> = (0..DRAWN)
            .filter_map(|draw| Meeting::draw(rig, &mut AttemptStream::new(SEED, draw)))
            .take(KNOWN)
            .collect();
        known.sort_by(|a, b| a.width().total_cmp(&b.width()));
        for (place, opposition) in known.iter_mut().enumerate() {
            opposition.place = place as u16;
        }
        let stretched = HandPose {
            frame_from_wrist: Pose::IDENTITY,
            digits: rig.stretched(),
        };
        let solids = HandSolids::of_pose(rig, &stretched);
        let inside = |solid: &TaperedCapsule, along: f32| (solid.at(along), solid.radius_at(along));
        let of_forearm = CORE_SPOTS[1].map(|along| solids.forearm.map(|solid| inside(&solid, along)));
        let of_palm = CORE_SPOTS[0].map(|along| solids.palm.map(|solid| inside(&solid, along)));
        Self {
            widths: known.iter().map(Opposition::width).collect(),
            known,
            inner_spheres: Spheres::of_all(&[of_palm.as_flattened(), of_forearm.as_flattened()].concat()),
        }
    }

    /// Balls inside palm and forearm, in the wrist's frame.
    pub fn inner_spheres(&self) -> &[Spheres] {
        &self.inner_spheres
    }

    /// One whose pads are between `least` and `most` metres apart; none if there is none.
    pub fn draw(&self, [least, most]: [f32; 2], stream: &mut AttemptStream) -> Option<&Opposition> {
        let first = self.widths.partition_point(|&width| width < least);
        let end = self.widths.partition_point(|&width| width <= most);
        (first < end).then(|| &self.known[first + stream.below(end - first)])
    }

    /// That of a place.
    pub fn at(&self, place: u16) -> &Opposition {
        &self.known[usize::from(place)]
    }
}

impl Opposition {
    /// Distance between the pads in metres.
    pub fn width(&self) -> f32 {
        self.fingers.distance(self.thumb)
    }
}

/// A hand that is brought to oppose its thumb and its fingers.
#[derive(Clone, Copy, Debug)]
struct Meeting {
    shape: HandShape,
    /// How far thumb and fingers are closed: shares of their ways.
    closed: [f32; 2],
    /// Which link of the fingers meets the thumb's last one.
    finger_link: usize,
    /// Where along the links, thumb and fingers.
    spots: [f32; 2],
    /// Does the index finger alone meet the thumb, whatever others close?
    index_alone: bool,
}

/// Which of the shares that steps change move the thumb's pad; the others move the fingers'.
const OF_THUMB: [bool; 5] = [true, true, false, true, false];

/// Pads of a hand.
#[derive(Clone, Copy, Debug)]
struct Pads {
    /// Thumb and fingers: a point on the skin in the wrist's frame, in metres, and the direction that it faces.
    thumb: (Vec3, Vec3),
    fingers: (Vec3, Vec3),
}

impl Meeting {
    /// Draws a hand and a width, and steps to where its pads oppose each other at that width; none if they never do.
    fn draw(rig: &Rig, stream: &mut AttemptStream) -> Option<Opposition> {
        let [least, most] = WIDTHS;
        let width = least * (most / least).powf(stream.unit());
        let shape = draw_shape(width, stream);
        let outer = stream.unit() < OUTER_SHARE;
        let mut spot = || stream.between(PAD_SPOTS[0], PAD_SPOTS[1]);
        let spots = [spot(), if outer { spot() } else { 0.5 }];
        let mut meeting = Self {
            shape,
            closed: [stream.unit(), stream.unit()],
            finger_link: if outer { 2 } else { 1 },
            spots,
            index_alone: stream.unit() < INDEX_SHARE && width <= PINCHED_WIDTH,
        };
        let mut miss = meeting.pads(rig).miss(width);
        for _ in 0..SEEDS {
            let start = meeting.with_shares(std::array::from_fn(|_| stream.unit()));
            let its_miss = start.pads(rig).miss(width);
            if its_miss < miss {
                (meeting, miss) = (start, its_miss);
            }
        }
        let mut pads = meeting.pads(rig);
        for step in 0..STEPS {
            let size = FIRST_STEP * (1.0 - step as f32 / STEPS as f32);
            let (stepped, its_pads) = meeting.stepped(rig, &pads, size, stream);
            let its_miss = its_pads.miss(width);
            if its_miss < miss {
                (meeting, pads, miss) = (stepped, its_pads, its_miss);
            }
        }
        meeting.opposition(rig, &pads, width)
    }

    /// A hand that is a little different, and its pads: what is not of the digits that move stays where it is.
    fn stepped(&self, rig: &Rig, pads: &Pads, size: f32, stream: &mut AttemptStream) -> (Self, Pads) {
        let mut moved = self.shares();
        let which = stream.below(moved.len());
        moved[which] = (moved[which] + stream.between(-size, size)).clamp(0.0, 1.0);
        let stepped = self.with_shares(moved);
        let pads = if OF_THUMB[which] {
            Pads {
                thumb: stepped.thumb_pad(rig),
                ..*pads
            }
        } else {
            Pads {
                fingers: stepped.fingers_pad(rig),
                ..*pads
            }
        };
        (stepped, pads)
    }

    /// What the steps change, each from 0 to 1: the thumb's yaw, how far thumb and fingers are closed, and how they bend.
    /// Which are the thumb's is said by [`OF_THUMB`].
    fn shares(&self) -> [f32; 5] {
        let [least, most] = BEND_RATIO;
        let [thumb, fingers] = self
            .shape
            .bend_ratios
            .map(|ratio| (ratio - least) / (most - least));
        [
            self.shape.thumb_yaw,
            self.closed[0],
            self.closed[1],
            thumb,
            fingers,
        ]
    }

    fn with_shares(&self, [thumb_yaw, thumb_closed, fingers_closed, thumb, fingers]: [f32; 5]) -> Self {
        let [least, most] = BEND_RATIO;
        Self {
            shape: HandShape {
                thumb_yaw,
                bend_ratios: [thumb, fingers].map(|share| least + (most - least) * share),
                ..self.shape
            },
            closed: [thumb_closed, fingers_closed],
            ..*self
        }
    }

    fn pads(&self, rig: &Rig) -> Pads {
        Pads {
            thumb: self.thumb_pad(rig),
            fingers: self.fingers_pad(rig),
        }
    }

    fn thumb_pad(&self, rig: &Rig) -> (Vec3, Vec3) {
        pad(rig, Digit::Thumb, &self.shape, 2, self.closed[0], self.spots[0])
    }

    fn fingers_pad(&self, rig: &Rig) -> (Vec3, Vec3) {
        let finger = |digit| {
            pad(
                rig,
                digit,
                &self.shape,
                self.finger_link,
                self.closed[1],
                self.spots[1],
            )
        };
        let index = finger(Digit::Index);
        // The two fingers next to the thumb decide: the others follow.
        if self.shape.closing[Digit::Middle.index()] && !self.index_alone {
            let middle = finger(Digit::Middle);
            (
                (index.0 + middle.0) * 0.5,
                (index.1 + middle.1).normalize_or_zero(),
            )
        } else {
            index
        }
    }

    fn opposition(&self, rig: &Rig, pads: &Pads, width: f32) -> Option<Opposition> {
        let [thumb_cos, fingers_cos] = pads.facing();
        let fits = (pads.width() - width).abs() <= WIDTH_ROOM;
        (fits && thumb_cos.min(fingers_cos) >= least_cos(width)).then(|| Opposition {
            place: 0,
            shape: HandShape {
                preshape: self.closed.map(|closed| (closed - PRESHAPE_ROOM).max(0.0)),
                ..self.shape
            },
            closed: self.closed,
            thumb: pads.thumb.0,
            fingers: pads.fingers.0,
            links: self.links(rig),
        })
    }

    fn links(&self, rig: &Rig) -> [Spheres; LINK_SPHERES] {
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
                LINK_SPOTS.map(|(link, along)| (links[link].at(along), links[link].radius_at(along)))
            })
            .collect();
        Spheres::of_all(&spheres)
    }
}

impl Pads {
    fn width(&self) -> f32 {
        self.thumb.0.distance(self.fingers.0)
    }

    /// Cosines between the line through the pads and the directions that they face: 1 where they face each other.
    fn facing(&self) -> [f32; 2] {
        let across = (self.fingers.0 - self.thumb.0).normalize_or_zero();
        [across.dot(self.thumb.1), -across.dot(self.fingers.1)]
    }

    /// How far the pads are from opposing each other at a width: a centimetre counts as much as a right angle. What is
    /// good enough does not count.
    fn miss(&self, width: f32) -> f32 {
        let off = ((self.width() - width).abs() - 0.5 * WIDTH_ROOM).max(0.0) / 0.01;
        let turned = self.facing().map(|cos| (1.1 * least_cos(width) - cos).max(0.0));
        off + 2.0 * (turned[0] + turned[1])
    }
}

/// A point of a link's pad on the skin and the direction it faces, in the wrist's frame.
fn pad(rig: &Rig, digit: Digit, shape: &HandShape, link: usize, closed: f32, along: f32) -> (Vec3, Vec3) {
    let digit_rig = rig.digit(digit);
    let radii = link_radii(rig, digit);
    let angles = shape.flexing(rig, digit).closed_by(closed);
    let frames = digit_frames(digit_rig, Pose::IDENTITY, angles);
    let frame = frames.links[link];
    let radius = radii[link] + (radii[link + 1] - radii[link]) * along;
    // The last link's solid ends where the ball of its tip has its middle.
    let beyond = if link == 2 { radii[3] } else { 0.0 };
    let on_skin = Vec3::new(0.0, along * (digit_rig.lengths[link] - beyond), radius);
    (frame.transform_point(on_skin), frame.transform_vector(Vec3::Z))
}
