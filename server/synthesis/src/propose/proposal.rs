//! Draws proposals: a hand shape and a wrist pose where a grasp is likely.

use std::f32::consts::TAU;

use glam::{Mat3, Quat, Vec3};

use super::{
    opposition::{Opposition, draw_shape},
    prepared::{PlacementCache, PreparedRig},
    success_prior::{ObjectFeatures, TRAINED},
    surface_pairs::{SurfacePair, SurfacePairs, SurfacePoint},
};
use crate::{
    base::{pose::Pose, random::AttemptStream, stop::Stop},
    model::{hand::rig::Rig, object::GraspObject},
    physical::{
        barriers::Barriers,
        grip::{GIVER_CLEARANCE, MAX_PENETRATION},
        presented::Presented,
        shape::{HandShape, Proposal},
        solids::Spheres,
    },
    rating::scoring::{across_long_axis, from_side_or_above},
};

/// Share of proposals that place the palm on the object instead of pads on opposed points.
const PALM_SHARE: f32 = 0.15;

/// How much closer together or farther apart than the object's thickness pads may be, in metres: closing digits still meet it
/// near the same points.
const THICKNESS_TOLERANCE: [f32; 2] = [0.006, 0.012];

/// Largest tilt of the palm from the surface's tangent plane, as a tangent per axis.
const MAX_PALM_TILT: f32 = 0.35;

/// Largest number of locations (surface pairs or points) tried per proposal until the hand fits at one.
pub(super) const MAX_LOCATIONS: usize = 12;

/// Largest number of rotations of the hand tried at a location.
const MAX_ROTATIONS: usize = 10;

/// Largest number of rotations drawn until [`MAX_ROTATIONS`] are admitted. An admission is cheap compared with a fit.
const MAX_DRAWN_ROTATIONS: usize = 48;

/// Candidates sampled per proposal and ordered by the success prior. With half or twice as many, searches take longer.
const COMPARED: usize = 64;

/// Exponent of the success prior when ordering candidates.
const PREFERENCE: f32 = 2.0;

/// Share of proposals drawn without the success prior, so that grasps it misjudges are found too.
const EVEN_SHARE: f32 = 0.2;

/// Largest number of pairs or points drawn until one is clear of the barriers.
const MAX_DRAWS: usize = 64;

/// Largest distance, in metres, by which a hand placed in an obstacle is moved out of it: about a fingertip's thickness.
const MAX_WAY_OUT: f32 = 0.015;

/// How deep inner spheres of the digits may be in the object at the opposed pose, in metres, where it is thin (up to [`THIN`])
/// and thicker. Closing stops earlier, so smaller values reject hands that would fit.
const MAX_DIGIT_DEPTHS: [f32; 2] = [0.0075, 0.005];

/// Thickness in metres up to which an object is thin: that of a finger.
const THIN: f32 = 0.015;

/// Range of the contact point's offset from the palm's centre, in metres: across the palm, and along the fingers.
const PALM_OFFSETS: [[f32; 2]; 2] = [[-0.02, 0.02], [-0.02, 0.03]];

/// Height above the surface from which the palm approaches, in metres.
pub(super) const PALM_START_HEIGHT: f32 = 0.03;

/// Smallest weight of a hand that does not come from a natural side: some must be tried, because only they may fit.
const MIN_CHOICE_WEIGHT: f32 = 0.03;

/// Attempts at multiples of this number place hands wherever they fit, for the same reason.
pub const ANYWHERE_EVERY: u64 = 8;

/// The object, hands and settings for which proposals are drawn.
#[derive(Clone, Copy, Debug)]
pub struct ProposalContext<'a> {
    /// The object to be held.
    pub object: &'a GraspObject,
    /// The parts that hands may touch: the object's pairs and points, or those that the barriers leave free.
    pub surface: &'a SurfacePairs,
    /// The barriers of the hand.
    pub barriers: Barriers<'a>,
    /// The presentation, if natural hands are preferred.
    pub chooses: Option<&'a Presented>,
    /// The receiving hand.
    pub rig: &'a PreparedRig,
    /// Cached placements to choose from, if used.
    pub placements: Option<&'a PlacementCache>,
}

/// A hand placed with its opposed pads at opposed points of the surface.
#[derive(Clone, Copy, Debug)]
pub struct Candidate<'a> {
    /// The hand's opposition.
    pub opposition: &'a Opposition,
    /// The opposed points.
    pub pair: SurfacePair,
    /// The wrist's pose in the object's frame, in metres.
    pub object_from_wrist: Pose,
}

impl<'a> Candidate<'a> {
    /// Places the hand on the pair, randomly rotated about the line through the points.
    pub(super) fn draw(opposition: &'a Opposition, pair: SurfacePair, stream: &mut AttemptStream) -> Self {
        let across = opposition.fingers - opposition.thumb;
        let target = (pair.end - pair.start).normalize_or(Vec3::X);
        let arc = Quat::from_rotation_arc(across.normalize_or(Vec3::X), target);
        let turn = Quat::from_axis_angle(target, stream.between(0.0, TAU));
        let orientation = (turn * arc).normalize();
        let midpoint = (pair.start + pair.end) * 0.5;
        let position = midpoint - orientation * ((opposition.thumb + opposition.fingers) * 0.5);
        Self {
            opposition,
            pair,
            object_from_wrist: Pose::new(position, orientation),
        }
    }

    /// The proposal to close this hand.
    pub fn proposal(&self) -> Proposal {
        Proposal {
            object_from_wrist: self.object_from_wrist,
            shape: self.opposition.shape,
            advance: 0.0,
        }
    }
}

/// Draws the shape of a hand that holds in the palm: all digits close.
pub(super) fn palm_shape(rig: &Rig, stream: &mut AttemptStream) -> HandShape {
    HandShape {
        closing: rig.own_digits([true; 5]),
        ..draw_shape(rig, f32::INFINITY, stream)
    }
}

/// Draws a proposal, preferring hands that are likely to hold. Returns `None` if no sampled hand fits, or if stopped.
pub fn propose(
    context: &ProposalContext<'_>,
    stream: &mut AttemptStream,
    stop: Stop<'_>,
) -> Option<Proposal> {
    if stream.unit() < EVEN_SHARE {
        propose_evenly(context, stream, stop)
    } else if stream.unit() < PALM_SHARE {
        context.propose_palm(stream, stop)
    } else {
        let cached = context.propose_from_cache(stream);
        cached.or_else(|| context.propose_likely_pads(stream, stop))
    }
}

/// Draws a proposal without the success prior, as atlases need grips of every kind. Otherwise like [`propose`].
pub fn propose_evenly(
    context: &ProposalContext<'_>,
    stream: &mut AttemptStream,
    stop: Stop<'_>,
) -> Option<Proposal> {
    if stream.unit() < PALM_SHARE {
        return context.propose_palm(stream, stop);
    }
    // Opposed pads at the first of some locations where the hand fits.
    (0..MAX_LOCATIONS)
        .take_while(|_| !stop.is_over())
        .find_map(|_| Some(context.fitting_candidate(stream)?.proposal()))
}

impl<'a> ProposalContext<'a> {
    /// How natural a hand is, 0 to 1: it comes from the receiver's position, not from beneath, and not from an end.
    pub(super) fn choice(&self, object_from_wrist: Pose) -> f32 {
        let Some(presented) = self.chooses else { return 1.0 };
        presented.receiver.suits(self.rig, object_from_wrist)
            * (0.2 + 0.8 * across_long_axis(self.object.parts(), object_from_wrist))
            * (0.2 + 0.8 * from_side_or_above(object_from_wrist, presented.up))
    }

    /// True if a hand is to be tried, at random by how natural it is; always in every [`ANYWHERE_EVERY`]th attempt.
    pub fn is_chosen(&self, object_from_wrist: Pose, stream: &mut AttemptStream) -> bool {
        self.chooses.is_none()
            || stream.attempt().is_multiple_of(ANYWHERE_EVERY)
            || stream.unit() < self.choice(object_from_wrist).max(MIN_CHOICE_WEIGHT)
    }

    /// True if a hand is to be tried at a place, at random by how much the object's owner wants hands there; always in every
    /// [`ANYWHERE_EVERY`]th attempt.
    pub(super) fn is_wanted(&self, wish: f32, stream: &mut AttemptStream) -> bool {
        wish >= 1.0
            || self.chooses.is_none()
            || stream.attempt().is_multiple_of(ANYWHERE_EVERY)
            || stream.unit() < wish.max(MIN_CHOICE_WEIGHT)
    }

    /// Draws a surface pair and an opposition of its width, and rotates the hand about the line through the pair until it fits.
    /// Returns `None` if no rotation does.
    pub fn fitting_candidate(&self, stream: &mut AttemptStream) -> Option<Candidate<'a>> {
        let pair = self.free_pair(stream)?;
        self.candidate_on(pair, |_| true, stream)
    }

    /// Places a hand on a pair as [`Self::fitting_candidate`] does, at a wrist pose that `admits` accepts.
    pub(super) fn candidate_on(
        &self,
        pair: SurfacePair,
        admits: impl Fn(Pose) -> bool,
        stream: &mut AttemptStream,
    ) -> Option<Candidate<'a>> {
        let opposition = self.opposition_for(&pair, stream)?;
        (0..MAX_DRAWN_ROTATIONS)
            .filter_map(|_| {
                let candidate = Candidate::draw(opposition, pair, stream);
                let wrist = candidate.object_from_wrist;
                let is_tried = admits(wrist) && self.is_chosen(wrist, stream);
                is_tried.then(|| self.settled(candidate, stream))
            })
            .take(MAX_ROTATIONS)
            .find(|candidate| self.fits(candidate))
    }

    /// In every other attempt, the hand moved out of obstacles that it is slightly in, as far as its digits show.
    fn settled(&self, candidate: Candidate<'a>, stream: &AttemptStream) -> Candidate<'a> {
        if self.barriers.obstacles.is_empty() || stream.attempt().is_multiple_of(2) {
            return candidate;
        }
        let placed = candidate.object_from_wrist;
        let links = candidate.opposition.links.map(|links| links.transformed(placed));
        let way = self.barriers.way_out_of_obstacles(&links, GIVER_CLEARANCE);
        if way.length() > MAX_WAY_OUT {
            return candidate;
        }
        Candidate {
            object_from_wrist: Pose::new(placed.position + way, placed.orientation),
            ..candidate
        }
    }

    /// Chooses a cached placement that is clear of the barriers, preferring likely ones.
    fn propose_from_cache(&self, stream: &mut AttemptStream) -> Option<Proposal> {
        let row = self.placements?.row(stream.attempt(), self.rig);
        let free = row
            .filter(|candidate| {
                candidate.pair.is_free_of(self.barriers) && self.is_wanted(candidate.pair.wish, stream)
            })
            .collect::<Vec<_>>();
        let free = free.into_iter().map(|candidate| self.settled(candidate, stream));
        let ordered = self.order_by_success_prior(
            &ObjectFeatures::of(self.object),
            PREFERENCE,
            free.collect(),
            stream,
        );
        let clear = ordered
            .iter()
            .find(|candidate| self.is_clear_of_barriers(candidate))?;
        Some(clear.proposal())
    }

    /// Tries locations and rotations in the order of the success prior.
    fn propose_likely_pads(&self, stream: &mut AttemptStream, stop: Stop<'_>) -> Option<Proposal> {
        let features = ObjectFeatures::of(self.object);
        let locations = self.sample_candidates(COMPARED, stream);
        self.order_by_success_prior(&features, PREFERENCE, locations, stream)
            .iter()
            .take(MAX_LOCATIONS)
            .take_while(|_| !stop.is_over())
            .find_map(|&Candidate { opposition, pair, .. }| {
                let rotated = (0..MAX_ROTATIONS)
                    .map(|_| self.settled(Candidate::draw(opposition, pair, stream), stream));
                let rotated = self.order_by_success_prior(&features, PREFERENCE, rotated.collect(), stream);
                let fitting = rotated.iter().find(|candidate| self.fits(candidate))?;
                Some(fitting.proposal())
            })
    }

    /// Samples up to `count` candidates whose pads are clear of the barriers, without testing whether they fit.
    pub(super) fn sample_candidates(&self, count: usize, stream: &mut AttemptStream) -> Vec<Candidate<'a>> {
        let mut candidates = Vec::with_capacity(count);
        for _ in 0..count {
            let Some(pair) = self.free_pair(stream) else { break };
            if let Some(opposition) = self.opposition_for(&pair, stream) {
                candidates.push(Candidate::draw(opposition, pair, stream));
            }
        }
        candidates
    }

    /// Orders candidates at random, weighted by the success prior to the power of `preference`.
    pub(super) fn order_by_success_prior(
        &self,
        features: &ObjectFeatures,
        preference: f32,
        candidates: Vec<Candidate<'a>>,
        stream: &mut AttemptStream,
    ) -> Vec<Candidate<'a>> {
        let chooses = !stream.attempt().is_multiple_of(ANYWHERE_EVERY);
        let mut keyed: Vec<(f32, Candidate<'_>)> = candidates
            .into_iter()
            .map(|candidate| {
                let wrist = candidate.object_from_wrist;
                let inputs = features.inputs(self.rig, candidate.opposition, wrist, self.barriers);
                let log_probability = -(-TRAINED.log_odds(&inputs)).exp().ln_1p();
                let log_choice = if chooses {
                    self.choice(wrist).max(MIN_CHOICE_WEIGHT).ln()
                } else {
                    0.0
                };
                // Gumbel-max trick: sorting by these keys draws without replacement in proportion to the weights.
                let gumbel = -(-stream.unit().max(f32::MIN_POSITIVE).ln()).ln();
                (preference * log_probability + log_choice + gumbel, candidate)
            })
            .collect();
        keyed.sort_by(|(a, _), (b, _)| b.total_cmp(a));
        keyed.into_iter().map(|(_, candidate)| candidate).collect()
    }

    /// Draws an opposition about as wide as the pair is thick; `None` if the rig has none.
    fn opposition_for(&self, pair: &SurfacePair, stream: &mut AttemptStream) -> Option<&'a Opposition> {
        let widths = [
            pair.thickness - THICKNESS_TOLERANCE[0],
            pair.thickness + THICKNESS_TOLERANCE[1],
        ];
        self.rig.oppositions().draw(widths, stream)
    }

    /// A pair clear of the barriers; `None` if [`MAX_DRAWS`] draws find none.
    pub(super) fn free_pair(&self, stream: &mut AttemptStream) -> Option<SurfacePair> {
        self.free(stream, SurfacePairs::pair, |pair| {
            (pair.is_free_of(self.barriers), pair.wish)
        })
    }

    /// The first draw that is clear of the barriers and to be tried, by its wish; `None` if [`MAX_DRAWS`] draws find none.
    fn free<T>(
        &self,
        stream: &mut AttemptStream,
        draw: impl Fn(&SurfacePairs, &mut AttemptStream) -> Option<T>,
        is_free_with_wish: impl Fn(&T) -> (bool, f32),
    ) -> Option<T> {
        for _ in 0..MAX_DRAWS {
            let drawn = draw(self.surface, stream)?;
            let (is_free, wish) = is_free_with_wish(&drawn);
            if is_free && self.is_wanted(wish, stream) {
                return Some(drawn);
            }
        }
        None
    }

    /// A point clear of the barriers; `None` if [`MAX_DRAWS`] draws find none.
    pub(super) fn free_point(&self, stream: &mut AttemptStream) -> Option<SurfacePoint> {
        self.free(stream, SurfacePairs::point, |point| {
            (point.is_free_of(self.barriers), point.wish)
        })
    }

    /// True if palm, forearm and digits collide with neither object nor barriers, as far as inner spheres show.
    pub(super) fn fits(&self, candidate: &Candidate<'_>) -> bool {
        let max_depth = MAX_DIGIT_DEPTHS[usize::from(candidate.pair.thickness > THIN)];
        self.palm_fits(candidate.object_from_wrist)
            && self.spheres_fit(
                candidate.object_from_wrist,
                &candidate.opposition.links,
                max_depth,
            )
    }

    /// True if palm, forearm and digits are clear of the barriers, as far as inner spheres show.
    fn is_clear_of_barriers(&self, candidate: &Candidate<'_>) -> bool {
        let wrist = candidate.object_from_wrist;
        !self.spheres_meet_barrier(wrist, &self.rig.oppositions().inner_spheres)
            && !self.spheres_meet_barrier(wrist, &candidate.opposition.links)
    }

    /// Places the palm on the surface at the first of some free points where it fits.
    fn propose_palm(&self, stream: &mut AttemptStream, stop: Stop<'_>) -> Option<Proposal> {
        let mut locations = (0..MAX_LOCATIONS).take_while(|_| !stop.is_over());
        locations.find_map(|_| {
            let shape = palm_shape(self.rig, stream);
            let point = self.free_point(stream)?;
            self.palm_on(point, shape, |_| true, stream)
        })
    }

    /// Places the palm over a point of the surface, facing it, and rotates it until palm and forearm fit and `admits` accepts the
    /// wrist pose at which it touches.
    pub(super) fn palm_on(
        &self,
        point: SurfacePoint,
        shape: HandShape,
        admits: impl Fn(Pose) -> bool,
        stream: &mut AttemptStream,
    ) -> Option<Proposal> {
        let (a, b) = point.normal.any_orthonormal_pair();
        let tilted = point.normal
            + a * stream.between(-MAX_PALM_TILT, MAX_PALM_TILT)
            + b * stream.between(-MAX_PALM_TILT, MAX_PALM_TILT);
        // The palm's +z points into the surface.
        let z = -tilted.normalize_or(point.normal);
        let (a, b) = z.any_orthonormal_pair();
        // Any part of the palm may touch, not only its centre.
        let across = stream.between(PALM_OFFSETS[0][0], PALM_OFFSETS[0][1]);
        let along = stream.between(PALM_OFFSETS[1][0], PALM_OFFSETS[1][1]);
        let contact = self.rig.palm + Vec3::new(across, along, 0.0);
        let rotated = |_| {
            let turn = stream.between(0.0, TAU);
            let y = a * turn.cos() + b * turn.sin();
            let orientation = Quat::from_mat3(&Mat3::from_cols(y.cross(z), y, z)).normalize();
            let touching = Pose::new(point.position - orientation * contact, orientation);
            (admits(touching) && self.is_chosen(touching, stream)).then_some(touching)
        };
        let touching = (0..MAX_DRAWN_ROTATIONS)
            .filter_map(rotated)
            .take(MAX_ROTATIONS)
            .find(|touching| self.palm_fits(*touching))?;
        let position = touching.position - z * PALM_START_HEIGHT;
        Some(Proposal {
            object_from_wrist: Pose::new(position, touching.orientation),
            shape,
            advance: 2.0 * PALM_START_HEIGHT,
        })
    }

    /// True if inner spheres of palm and forearm are clear of object and barriers. This is a hundred times cheaper than the whole
    /// hand's clearance, which is checked later.
    pub fn palm_fits(&self, object_from_wrist: Pose) -> bool {
        let spheres = &self.rig.oppositions().inner_spheres;
        self.spheres_fit(object_from_wrist, spheres, MAX_PENETRATION)
    }

    /// True if spheres, given in the wrist's frame, are clear of the barriers and at most `depth` metres deep in the object.
    fn spheres_fit(&self, object_from_wrist: Pose, spheres: &[Spheres], depth: f32) -> bool {
        !self.spheres_meet_barrier(object_from_wrist, spheres)
            && spheres.iter().all(|spheres| {
                spheres
                    .transformed(object_from_wrist)
                    .iter()
                    .all(|(centre, radius)| {
                        let surface = &self.object.surface;
                        radius <= depth || surface.closest_point_within(centre, radius - depth).is_none()
                    })
            })
    }

    /// True if one of the spheres, given in the wrist's frame, certainly meets a barrier.
    fn spheres_meet_barrier(&self, object_from_wrist: Pose, spheres: &[Spheres]) -> bool {
        let meets = |spheres: &Spheres| {
            let placed = spheres.transformed(object_from_wrist);
            self.barriers.any_certainly_within(&placed, 0.0)
        };
        !self.barriers.is_empty() && spheres.iter().any(meets)
    }
}
