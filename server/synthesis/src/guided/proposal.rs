//! Proposals: a hand's shape and a wrist, drawn where grips are likely.

use std::f32::consts::TAU;

use glam::{Mat3, Quat, Vec3};

use super::{opposition::draw_shape, surface_pairs::SurfacePairs};
use crate::{
    hand::rig::Rig,
    object::GraspObject,
    physical::{
        grip::DEEPEST,
        shape::{HandShape, Proposal},
        solids::PreparedHand,
    },
    pose::Pose,
    synthesis::random::AttemptStream,
};

/// Share of proposals that lay the palm on the object instead of bringing pads to opposed points.
const PALM_SHARE: f32 = 0.15;

/// Pads may be this much nearer to each other or farther apart than the object is thick, in metres: digits that
/// close less or more still meet it near the same places.
const THICKNESS_ROOM: [f32; 2] = [0.006, 0.012];

/// Largest tilt of a palm that is laid on the surface, as a tangent.
const PALM_TILT: f32 = 0.35;

/// Places that are drawn for a proposal until one has room, and …
const MOST_PLACES: usize = 12;

/// … turns of a hand at a place.
const MOST_TURNS: usize = 10;

/// How deep in the object digits may be where they are expected to end, in metres: they stop before. Where the object is
/// thin, as thick as a finger ([`THIN`]), a digit is deep in it wherever it touches. Less refuses hands that would do.
const PAD_DEPTHS: [f32; 2] = [0.0075, 0.005];

/// The thickness below which an object is thin, in metres.
const THIN: f32 = 0.015;

/// Where on the palm it is laid on, from its middle, in metres: across, and along to the fingers.
const PALM_SPOT: [[f32; 2]; 2] = [[-0.02, 0.02], [-0.02, 0.03]];

/// How a palm that is laid on the surface starts above it, in metres.
const PALM_START: f32 = 0.03;

/// Where proposals are to fit in.
#[derive(Clone, Copy, Debug)]
pub struct Place<'a> {
    /// What is to be held.
    pub object: &'a GraspObject,
    /// Where it may be held: what the giver's hand leaves of the object's.
    pub surface: &'a SurfacePairs,
    /// The giver's hand, if it is there already.
    pub giver: Option<&'a PreparedHand>,
    /// The hand that is to hold.
    pub rig: &'a Rig,
}

/// Draws a proposal; none where there was no room for the hands that were drawn.
pub fn propose(place: &Place<'_>, stream: &mut AttemptStream) -> Option<Proposal> {
    let from_palm = stream.unit() < PALM_SHARE;
    (0..MOST_PLACES).find_map(|_| {
        if from_palm {
            place.palm_on_surface(stream)
        } else {
            place.pads_on_pair(stream)
        }
    })
}

impl Place<'_> {
    /// Brings opposed pads to opposed points of the surface, and turns the hand about the line between them until palm
    /// and forearm have room.
    fn pads_on_pair(&self, stream: &mut AttemptStream) -> Option<Proposal> {
        let pair = self.surface.pair(stream)?;
        let room = [
            pair.thickness - THICKNESS_ROOM[0],
            pair.thickness + THICKNESS_ROOM[1],
        ];
        let opposition = self.rig.oppositions().draw(room, stream)?;
        let across = opposition.fingers - opposition.thumb;
        let target = (pair.end - pair.start).normalize_or(Vec3::X);
        let arc = Quat::from_rotation_arc(across.normalize_or(Vec3::X), target);
        let middle = (pair.start + pair.end) * 0.5;
        let links = opposition.link_balls(self.rig);
        let pad_depth = PAD_DEPTHS[usize::from(pair.thickness > THIN)];
        (0..MOST_TURNS).find_map(|_| {
            let turn = Quat::from_axis_angle(target, stream.between(0.0, TAU));
            let orientation = (turn * arc).normalize();
            let position = middle - orientation * ((opposition.thumb + opposition.fingers) * 0.5);
            let object_from_wrist = Pose::new(position, orientation);
            let has_room =
                self.has_room(object_from_wrist) && self.have_room(object_from_wrist, &links, pad_depth);
            has_room.then_some(Proposal {
                object_from_wrist,
                shape: opposition.shape,
                advance: 0.0,
            })
        })
    }

    /// Holds the palm over a point of the surface, facing it, turned until the forearm has room.
    fn palm_on_surface(&self, stream: &mut AttemptStream) -> Option<Proposal> {
        let shape = HandShape {
            closing: [true; 5],
            ..draw_shape(f32::INFINITY, stream)
        };
        let point = self.surface.point(stream)?;
        let (a, b) = point.normal.any_orthonormal_pair();
        let tilted = point.normal
            + a * stream.between(-PALM_TILT, PALM_TILT)
            + b * stream.between(-PALM_TILT, PALM_TILT);
        // The palm's +z goes into the surface.
        let z = -tilted.normalize_or(point.normal);
        let (a, b) = z.any_orthonormal_pair();
        // Any part of the palm, not only its middle.
        let across = stream.between(PALM_SPOT[0][0], PALM_SPOT[0][1]);
        let along = stream.between(PALM_SPOT[1][0], PALM_SPOT[1][1]);
        let spot = self.rig.palm + Vec3::new(across, along, 0.0);
        (0..MOST_TURNS).find_map(|_| {
            let turn = stream.between(0.0, TAU);
            let y = a * turn.cos() + b * turn.sin();
            let orientation = Quat::from_mat3(&Mat3::from_cols(y.cross(z), y, z)).normalize();
            let touching = Pose::new(point.position - orientation * spot, orientation);
            self.has_room(touching).then_some(Proposal {
                object_from_wrist: Pose::new(touching.position - z * PALM_START, orientation),
                shape,
                advance: 2.0 * PALM_START,
            })
        })
    }

    fn is_free_of_giver(&self, point: Vec3, room: f32) -> bool {
        self.giver
            .is_none_or(|giver| !giver.surely_nears(point, 0.0, room))
    }

    /// True if balls inside palm and forearm are off the object and the giver's hand: a hundred times sooner known than
    /// the whole hand's clearance, which decides in the end.
    fn has_room(&self, object_from_wrist: Pose) -> bool {
        self.have_room(object_from_wrist, self.rig.oppositions().cores(), DEEPEST)
    }

    /// True if balls, in the wrist's frame, are off the giver's hand and at most `depth` metres in the object.
    fn have_room(&self, object_from_wrist: Pose, balls: &[(Vec3, f32)], depth: f32) -> bool {
        balls.iter().all(|&(middle, radius)| {
            let middle = object_from_wrist.transform_point(middle);
            self.is_free_of_giver(middle, radius)
                && (radius <= depth
                    || self
                        .object
                        .surface
                        .closest_point_within(middle, radius - depth)
                        .is_none())
        })
    }
}
