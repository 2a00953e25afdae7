//! Proposals: a hand's shape and a wrist, drawn where grips are likely.

use std::f32::consts::TAU;

use glam::{Mat3, Quat, Vec3};

use super::{
    opposition::{Opposition, draw_shape},
    placement_cache::PlacementCache,
    prepared::PreparedRig,
    success_prior::{ObjectFeatures, TRAINED},
    surface_pairs::{SurfacePair, SurfacePairs, SurfacePoint},
};
use crate::{
    base::mechanisms::{Mechanism, Mechanisms},
    base::{pose::Pose, random::AttemptStream},
    model::object::GraspObject,
    physical::{
        grip::MAX_PENETRATION,
        shape::{HandShape, Proposal},
        solids::{PreparedHand, Spheres},
    },
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

/// Places of which those come first where a hand is likely to hold. With half as many, grasps of ten objects took a tenth
/// more of a processor's time in the mean; with twice as many, those of six of seven as well, of thin ones a quarter.
const COMPARED: usize = 64;

/// How much what is likely to hold is preferred: the power of that likelihood by which it comes first. Higher ones find
/// grasps sooner where the network is right, and more alike.
const PREFERENCE: f32 = 2.0;

/// Share of proposals for which nothing is preferred: what the network is wrong about must be found, too.
const EVEN_SHARE: f32 = 0.2;

/// Pairs and points that are drawn until one is off the giver's hand.
const MOST_DRAWS: usize = 64;

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
    /// Where it may be held: the object's, or what the giver's hand leaves of them.
    pub surface: &'a SurfacePairs,
    /// The giver's hand, if it is there already.
    pub giver: Option<&'a PreparedHand>,
    /// The hand that is to hold.
    pub rig: &'a PreparedRig,
    /// Where it is known that the hand has room at the object, if that is to be gone by.
    pub placements: Option<&'a PlacementCache>,
    /// The mechanisms by which hands are proposed.
    pub mechanisms: Mechanisms,
}

/// A hand whose opposed pads are at opposed points of the surface.
#[derive(Clone, Copy, Debug)]
pub struct Candidate<'a> {
    /// How the pads oppose each other.
    pub opposition: &'a Opposition,
    /// The points.
    pub pair: SurfacePair,
    /// The wrist frame in the object's.
    pub object_from_wrist: Pose,
}

impl<'a> Candidate<'a> {
    /// The hand turned anyhow about the line between the points.
    pub(super) fn drawn(opposition: &'a Opposition, pair: SurfacePair, stream: &mut AttemptStream) -> Self {
        let across = opposition.fingers - opposition.thumb;
        let target = (pair.end - pair.start).normalize_or(Vec3::X);
        let arc = Quat::from_rotation_arc(across.normalize_or(Vec3::X), target);
        let turn = Quat::from_axis_angle(target, stream.between(0.0, TAU));
        let orientation = (turn * arc).normalize();
        let middle = (pair.start + pair.end) * 0.5;
        let position = middle - orientation * ((opposition.thumb + opposition.fingers) * 0.5);
        Self {
            opposition,
            pair,
            object_from_wrist: Pose::new(position, orientation),
        }
    }

    /// The hand to be closed.
    pub fn proposal(&self) -> Proposal {
        Proposal {
            object_from_wrist: self.object_from_wrist,
            shape: self.opposition.shape,
            advance: 0.0,
        }
    }
}

/// Draws a proposal, of which likely ones are preferred; none where there was no room for the hands that were drawn, or if
/// interrupted.
pub fn propose(
    place: &Place<'_>,
    stream: &mut AttemptStream,
    interrupted: &impl Fn() -> bool,
) -> Option<Proposal> {
    if stream.unit() < EVEN_SHARE {
        propose_evenly(place, stream, interrupted)
    } else if stream.unit() < place.palm_share() {
        place.palm_on_surface(stream, interrupted)
    } else {
        let known = place.likely_of_cache(stream);
        known.or_else(|| place.likely_pads_on_pair(stream, interrupted))
    }
}

/// Draws a proposal, none preferred: an atlas is to know of all.
pub fn propose_evenly(
    place: &Place<'_>,
    stream: &mut AttemptStream,
    interrupted: &impl Fn() -> bool,
) -> Option<Proposal> {
    if stream.unit() < place.palm_share() {
        return place.palm_on_surface(stream, interrupted);
    }
    place.any_pads_on_pair(stream, interrupted)
}

impl<'a> Place<'a> {
    /// How often the palm is laid on the object.
    fn palm_share(&self) -> f32 {
        if self.mechanisms.has(Mechanism::PalmPlacement) {
            PALM_SHARE
        } else {
            0.0
        }
    }

    /// The first of some places that has room.
    fn any_pads_on_pair(
        &self,
        stream: &mut AttemptStream,
        interrupted: &impl Fn() -> bool,
    ) -> Option<Proposal> {
        (0..MOST_PLACES)
            .take_while(|_| !interrupted())
            .find_map(|_| Some(self.pads_on_pair(stream)?.proposal()))
    }

    /// Brings opposed pads to opposed points of the surface, and turns the hand about the line between them until palm,
    /// forearm and digits have room.
    pub fn pads_on_pair(&self, stream: &mut AttemptStream) -> Option<Candidate<'a>> {
        let pair = self.free_pair(stream)?;
        let opposition = self.opposing(&pair, stream)?;
        (0..MOST_TURNS)
            .map(|_| Candidate::drawn(opposition, pair, stream))
            .find(|candidate| self.fits(candidate))
    }

    /// One of those that are known to have room at the object, where it has room beside the giver and is likely to hold.
    fn likely_of_cache(&self, stream: &mut AttemptStream) -> Option<Proposal> {
        let row = self.placements?.row(stream.attempt(), self.rig);
        let free = row.filter(|candidate| self.giver.is_none_or(|giver| candidate.pair.is_free_of(giver)));
        let likely = self.by_success_prior(
            &ObjectFeatures::of(self.object),
            PREFERENCE,
            free.collect(),
            stream,
        );
        let clear = likely
            .iter()
            .find(|candidate| self.is_clear_of_giver(candidate))?;
        Some(clear.proposal())
    }

    /// The same where hands are likely to hold, turned so that they are.
    fn likely_pads_on_pair(
        &self,
        stream: &mut AttemptStream,
        interrupted: &impl Fn() -> bool,
    ) -> Option<Proposal> {
        if !self.mechanisms.has(Mechanism::SuccessPrior) {
            return self.any_pads_on_pair(stream, interrupted);
        }
        let bulk = ObjectFeatures::of(self.object);
        let places = self.drawn(COMPARED, stream);
        self.by_success_prior(&bulk, PREFERENCE, places, stream)
            .iter()
            .take(MOST_PLACES)
            .take_while(|_| !interrupted())
            .find_map(|place| {
                let turned = (0..MOST_TURNS).map(|_| Candidate::drawn(place.opposition, place.pair, stream));
                let turned = self.by_success_prior(&bulk, PREFERENCE, turned.collect(), stream);
                let fitting = turned.iter().find(|candidate| self.fits(candidate))?;
                Some(fitting.proposal())
            })
    }

    /// As many hands at places off the giver's hand, or fewer where there are none.
    pub(super) fn drawn(&self, count: usize, stream: &mut AttemptStream) -> Vec<Candidate<'a>> {
        let mut drawn = Vec::with_capacity(count);
        for _ in 0..count {
            let Some(pair) = self.free_pair(stream) else { break };
            if let Some(opposition) = self.opposing(&pair, stream) {
                drawn.push(Candidate::drawn(opposition, pair, stream));
            }
        }
        drawn
    }

    /// In an order by chance, in which those come early that are likely to hold, by that power of the likelihood.
    pub(super) fn by_success_prior(
        &self,
        bulk: &ObjectFeatures,
        preference: f32,
        candidates: Vec<Candidate<'a>>,
        stream: &mut AttemptStream,
    ) -> Vec<Candidate<'a>> {
        let is_rated = self.mechanisms.has(Mechanism::SuccessPrior);
        let mut keyed: Vec<(f32, Candidate<'_>)> = candidates
            .into_iter()
            .map(|candidate| {
                let Candidate {
                    opposition,
                    object_from_wrist,
                    ..
                } = candidate;
                let log_prospect = if is_rated {
                    let inputs = bulk.inputs(self.rig, opposition, object_from_wrist, self.giver);
                    -(-TRAINED.log_odds(&inputs)).exp().ln_1p()
                } else {
                    0.0
                };
                // Gumbel's trick: by these keys, they are drawn without replacement by their weights.
                let chance = -(-stream.unit().max(f32::MIN_POSITIVE).ln()).ln();
                (preference * log_prospect + chance, candidate)
            })
            .collect();
        keyed.sort_by(|(a, _), (b, _)| b.total_cmp(a));
        keyed.into_iter().map(|(_, candidate)| candidate).collect()
    }

    /// How a hand can oppose its pads at the pair's ends; none if it cannot.
    fn opposing(&self, pair: &SurfacePair, stream: &mut AttemptStream) -> Option<&'a Opposition> {
        let room = [
            pair.thickness - THICKNESS_ROOM[0],
            pair.thickness + THICKNESS_ROOM[1],
        ];
        self.rig.oppositions().draw(room, stream)
    }

    /// A pair off the giver's hand; none if none of [`MOST_DRAWS`] is.
    fn free_pair(&self, stream: &mut AttemptStream) -> Option<SurfacePair> {
        (0..MOST_DRAWS)
            .map_while(|_| self.surface.pair(stream))
            .find(|pair| self.giver.is_none_or(|giver| pair.is_free_of(giver)))
    }

    /// A point off the giver's hand; none if none of [`MOST_DRAWS`] is.
    fn free_point(&self, stream: &mut AttemptStream) -> Option<SurfacePoint> {
        (0..MOST_DRAWS)
            .map_while(|_| self.surface.point(stream))
            .find(|point| self.giver.is_none_or(|giver| point.is_free_of(giver)))
    }

    /// True if palm, forearm and digits have room there.
    pub(super) fn fits(&self, candidate: &Candidate<'_>) -> bool {
        let pad_depth = PAD_DEPTHS[usize::from(candidate.pair.thickness > THIN)];
        self.has_room(candidate.object_from_wrist)
            && self.have_room(
                candidate.object_from_wrist,
                &candidate.opposition.links,
                pad_depth,
            )
    }

    /// True if palm, forearm and digits are off the giver's hand there.
    fn is_clear_of_giver(&self, candidate: &Candidate<'_>) -> bool {
        let spheres = [
            self.rig.oppositions().inner_spheres(),
            &candidate.opposition.links,
        ];
        !self.mechanisms.has(Mechanism::RoomScreen)
            || spheres
                .iter()
                .all(|spheres| !self.meet_giver(candidate.object_from_wrist, spheres))
    }

    /// Lays the palm on the surface where there is room.
    fn palm_on_surface(
        &self,
        stream: &mut AttemptStream,
        interrupted: &impl Fn() -> bool,
    ) -> Option<Proposal> {
        (0..MOST_PLACES)
            .take_while(|_| !interrupted())
            .find_map(|_| self.palm_on_point(stream))
    }

    /// Holds the palm over a point of the surface, facing it, turned until the forearm has room.
    fn palm_on_point(&self, stream: &mut AttemptStream) -> Option<Proposal> {
        let shape = HandShape {
            closing: [true; 5],
            ..draw_shape(f32::INFINITY, stream)
        };
        let point = self.free_point(stream)?;
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

    /// True if balls inside palm and forearm are off the object and the giver's hand: a hundred times sooner known than
    /// the whole hand's clearance, which decides in the end.
    fn has_room(&self, object_from_wrist: Pose) -> bool {
        self.have_room(
            object_from_wrist,
            self.rig.oppositions().inner_spheres(),
            MAX_PENETRATION,
        )
    }

    /// True if balls, in the wrist's frame, are off the giver's hand and at most `depth` metres in the object.
    fn have_room(&self, object_from_wrist: Pose, spheres: &[Spheres], depth: f32) -> bool {
        if !self.mechanisms.has(Mechanism::RoomScreen) {
            return true;
        }
        !self.meet_giver(object_from_wrist, spheres)
            && spheres.iter().all(|spheres| {
                spheres
                    .transformed(object_from_wrist)
                    .iter()
                    .all(|(middle, radius)| {
                        let surface = &self.object.surface;
                        radius <= depth || surface.closest_point_within(middle, radius - depth).is_none()
                    })
            })
    }

    /// True if one of these balls, in the wrist's frame, certainly meets the giver's hand.
    fn meet_giver(&self, object_from_wrist: Pose, spheres: &[Spheres]) -> bool {
        self.giver.is_some_and(|giver| {
            spheres
                .iter()
                .any(|spheres| giver.any_certainly_within(&spheres.transformed(object_from_wrist), 0.0))
        })
    }
}
