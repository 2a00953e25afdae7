//! Rigs and objects together with the data that proposals derive from them once.

use std::{
    ops::Deref,
    sync::{Arc, Mutex, OnceLock, PoisonError},
};

use glam::{Quat, Vec3};
use sha2::{Digest as _, Sha256};

use super::{
    opposition::Oppositions,
    proposal::{Candidate, ProposalContext},
    success_prior::ObjectFeatures,
    surface_pairs::{HoldableSurface, SurfacePair, SurfacePairs},
};
use crate::{
    base::{
        pose::Pose,
        random::AttemptStream,
        stop::{Stop, Stopped, unstopped},
    },
    model::{
        hand::{
            Digit, DigitAngles, HandPose,
            kinematics::DigitPlane,
            rig::{AngleRange, Rig},
        },
        object::GraspObject,
        regions::MAX_MISSED,
    },
    physical::{
        barriers::Barriers,
        solids::{HandSolids, link_radii},
    },
};

/// Angles tried per joint range for a hand's span, and the factor that covers those between them: cos(7°) for a digit's widest
/// range, with a margin.
const ANGLES: usize = 5;
const BETWEEN_ANGLES: f32 = 1.03;

/// A rig and its oppositions, which are sampled on first use. Clones share both. Two are equal if their rigs make the same grips,
/// whatever their names.
#[derive(Clone, Debug)]
pub struct PreparedRig(Arc<RigParts>);

#[derive(Debug)]
struct RigParts {
    rig: Rig,
    /// SHA-256 of the rig's content.
    hash: [u8; 32],
    oppositions: OnceLock<Oppositions>,
    span: OnceLock<f32>,
}

impl PreparedRig {
    /// Wraps a rig; its oppositions are sampled on first use.
    pub fn new(rig: Rig) -> Self {
        Self(Arc::new(RigParts {
            hash: Sha256::digest(rig.content()).into(),
            rig,
            oppositions: OnceLock::new(),
            span: OnceLock::new(),
        }))
    }

    /// The rig's oppositions of thumb and fingers. The first call takes 0.1 to 0.2 s.
    pub fn oppositions(&self) -> &Oppositions {
        self.0.oppositions.get_or_init(|| Oppositions::of(&self.0.rig))
    }

    /// An upper bound on the distance of two contacts of the hand, in metres. The first call takes a millisecond.
    pub fn span(&self) -> f32 {
        *self.0.span.get_or_init(|| hand_span(&self.0.rig))
    }

    /// True once the oppositions have been sampled, so that [`Self::oppositions`] returns at once.
    pub fn is_derived(&self) -> bool {
        self.0.oppositions.get().is_some()
    }
}

impl PartialEq for PreparedRig {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0) || self.0.hash == other.0.hash
    }
}

impl Eq for PreparedRig {}

impl Deref for PreparedRig {
    type Target = Rig;

    fn deref(&self) -> &Rig {
        &self.0.rig
    }
}

/// An object, the surface points where hands may press, and its placement caches.
#[derive(Debug)]
pub struct PreparedObject {
    object: Arc<GraspObject>,
    /// The points where opposed digits or the palm may press.
    pub surface_pairs: SurfacePairs,
    /// The points where the object's owner wants hands; empty if that is everywhere.
    pub wanted_pairs: SurfacePairs,
    /// Bounds on where it may be held.
    pub holdable: HoldableSurface,
    placements: Mutex<Vec<CacheSlot>>,
}

type CacheSlot = (PreparedRig, Arc<OnceLock<Arc<PlacementCache>>>);

impl PreparedObject {
    /// Samples the object's surface for opposed points and handles, which takes some milliseconds.
    pub fn new(object: Arc<GraspObject>) -> Self {
        unstopped(|stop| Self::new_until(object, stop))
    }

    /// As [`Self::new`], unless it is stopped.
    ///
    /// # Errors
    /// [`Stopped`].
    pub fn new_until(object: Arc<GraspObject>, stop: Stop<'_>) -> Result<Self, Stopped> {
        let surface_pairs = SurfacePairs::of(&object, stop)?;
        let wanted_pairs = if object.regions().require_contacts() {
            surface_pairs.wanted(MAX_MISSED)
        } else {
            SurfacePairs::default()
        };
        let holdable = HoldableSurface::of(&object, &surface_pairs, stop)?;
        // Found here rather than by the first search.
        object.parts_until(stop)?;
        Ok(Self {
            object,
            surface_pairs,
            wanted_pairs,
            holdable,
            placements: Mutex::default(),
        })
    }

    /// Memory use in bytes of the data derived from the plain object, placement caches of two hands included.
    pub fn derived_bytes(&self) -> usize {
        let of_pairs = self.surface_pairs.bytes() + self.wanted_pairs.bytes();
        self.object.derived_bytes() + of_pairs + 2 * PlacementCache::MAX_BYTES
    }

    /// The object itself.
    pub fn object(&self) -> &Arc<GraspObject> {
        &self.object
    }

    /// The placements at which a hand fits at the object and is likely to hold it. The first call for a rig takes about five
    /// milliseconds.
    pub fn placement_cache(&self, rig: &PreparedRig) -> Arc<PlacementCache> {
        // Built outside the lock, so that searches with other hands are not blocked.
        let slot = self.cache_slot(rig);
        Arc::clone(slot.get_or_init(|| Arc::new(unstopped(|stop| PlacementCache::of_until(self, rig, stop)))))
    }

    /// Builds the result of [`Self::placement_cache`], unless stopped. Meanwhile, others may build it, too.
    ///
    /// # Errors
    /// [`Stopped`].
    pub fn build_placement_cache(&self, rig: &PreparedRig, stop: Stop<'_>) -> Result<(), Stopped> {
        let slot = self.cache_slot(rig);
        if slot.get().is_none() {
            let cache = PlacementCache::of_until(self, rig, stop)?;
            slot.get_or_init(|| Arc::new(cache));
        }
        Ok(())
    }

    /// True if [`Self::placement_cache`] need not build it.
    pub fn has_placement_cache(&self, rig: &PreparedRig) -> bool {
        self.cache_slot(rig).get().is_some()
    }

    /// The place of the cache of a rig. Beyond [`MAX_RIGS`], the oldest is evicted.
    fn cache_slot(&self, rig: &PreparedRig) -> Arc<OnceLock<Arc<PlacementCache>>> {
        let mut slots = self.placements.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, slot)) = slots.iter().find(|(slot_rig, _)| slot_rig == rig) {
            return Arc::clone(slot);
        }
        if slots.len() == MAX_RIGS {
            slots.remove(0);
        }
        let slot = Arc::default();
        slots.push((rig.clone(), Arc::clone(&slot)));
        slot
    }
}

impl Deref for PreparedObject {
    type Target = GraspObject;

    fn deref(&self) -> &GraspObject {
        &self.object
    }
}

/// An upper bound on the distance of two contacts of a hand, in metres: from fingertip to fingertip or palm, over all poses.
pub fn hand_span(rig: &Rig) -> f32 {
    let stretched = HandPose {
        frame_from_wrist: Pose::IDENTITY,
        digits: rig.stretched(),
    };
    let palm = HandSolids::of_pose(rig, &stretched).palm;
    let palm: Vec<(Vec3, f32)> = palm
        .iter()
        .flat_map(|solid| [(solid.start, solid.start_radius), (solid.end, solid.end_radius)])
        .collect();
    let tips = Digit::ALL.map(|digit| fingertips(rig, digit));
    let mut span = 0.0_f32;
    for (i, tips_of_digit) in tips.iter().enumerate() {
        for &(tip, radius) in tips_of_digit {
            let others = tips[i + 1..].iter().flatten().chain(&palm);
            for &(other, other_radius) in others {
                span = span.max(tip.distance(other) + radius + other_radius);
            }
        }
    }
    span * BETWEEN_ANGLES
}

/// The spheres at the tip of a digit over its range of poses, its outer joints straight or bent back, in the wrist's frame.
fn fingertips(rig: &Rig, digit: Digit) -> Vec<(Vec3, f32)> {
    let digit_rig = rig.digit(digit);
    let [.., tip_radius] = link_radii(rig, digit);
    let limits = &digit_rig.limits;
    let over = |range: AngleRange| {
        (0..ANGLES).map(move |i| range.min + (range.max - range.min) * i as f32 / (ANGLES - 1) as f32)
    };
    let straight = |range: AngleRange| [range.min, 0.0_f32.clamp(range.min, range.max)];
    let mut tips = Vec::new();
    for base_yaw in over(limits.base_yaw) {
        let plane = DigitPlane::new(digit_rig, Pose::IDENTITY, base_yaw);
        for base_pitch in over(limits.base_pitch) {
            for second_pitch in straight(limits.second_pitch) {
                for third_pitch in straight(limits.third_pitch) {
                    let [.., joint, tip] = plane.joints(&DigitAngles {
                        base_yaw,
                        base_pitch,
                        second_pitch,
                        third_pitch,
                    });
                    // The tip lies on the skin.
                    let inset = (joint - tip).normalize_or_zero() * tip_radius;
                    tips.push((tip + inset, tip_radius));
                }
            }
        }
    }
    tips
}

/// Number of leading attempts of a search that choose from the cache, each from its own row. Most searches end within them; later
/// attempts sample freely, so that the cache does not limit what they can find.
pub const ROWS: u64 = 32;

/// Candidates sampled per row. More let a row be choosier, and take longer to build.
const SAMPLED: usize = 512;

/// Largest number of placements kept per row. More leave more that are clear of a giver, and take longer to choose from.
const KEPT: usize = 24;

/// Exponent of the success prior when filling a row. Choosing from a row applies the prior again, with the giver known.
const PREFERENCE: f32 = 1.0;

/// Seed of the samples: arbitrary, but fixed so that an object always has the same placements.
const SEED: u64 = 0x5245_5045;

/// Largest number of caches per object: one each for the left and right hands of the built-in rigs.
const MAX_RIGS: usize = 4;

/// A hand that fits at the object, in a form that wastes no bytes on alignment.
#[derive(Clone, Copy, Debug, PartialEq)]
struct CachedPlacement {
    opposition: u16,
    pair: SurfacePair,
    position: Vec3,
    orientation: [f32; 4],
}

impl CachedPlacement {
    fn of(candidate: &Candidate<'_>) -> Self {
        let wrist = candidate.object_from_wrist;
        Self {
            opposition: candidate.opposition.index,
            pair: candidate.pair,
            position: wrist.position,
            orientation: wrist.orientation.to_array(),
        }
    }

    fn object_from_wrist(&self) -> Pose {
        Pose {
            position: self.position,
            orientation: Quat::from_array(self.orientation),
        }
    }
}

/// The placements at which a rig's hand fits at an object and is likely to hold it, whoever presents it.
#[derive(Clone, Debug, PartialEq)]
pub struct PlacementCache {
    rows: Vec<Vec<CachedPlacement>>,
}

impl PlacementCache {
    /// Upper bound on the size of one cache, in bytes.
    pub const MAX_BYTES: usize = ROWS as usize * KEPT * size_of::<CachedPlacement>();

    /// Samples the placements, in about five milliseconds. None on a crowded surface.
    fn of_until(object: &PreparedObject, rig: &PreparedRig, stop: Stop<'_>) -> Result<Self, Stopped> {
        let context = ProposalContext {
            object,
            surface: &object.surface_pairs,
            barriers: Barriers::NONE,
            chooses: None,
            rig,
            placements: None,
        };
        // Searches sample freely where filling the cache would take seconds.
        let rows = if object.surface.is_crowded() { 0 } else { ROWS };
        let features = ObjectFeatures::of(object);
        let row = |row| {
            stop.check()?;
            let mut stream = AttemptStream::new(SEED, row);
            let sampled = context.sample_candidates(SAMPLED, &mut stream);
            let ordered = context.order_by_success_prior(&features, PREFERENCE, sampled, &mut stream);
            let fitting = ordered.iter().filter(|candidate| context.fits(candidate));
            let kept = fitting.take(KEPT).map(CachedPlacement::of);
            let mut kept: Vec<CachedPlacement> = kept.collect();
            kept.shrink_to_fit();
            Ok(kept)
        };
        Ok(Self {
            rows: (0..rows).map(row).collect::<Result<_, Stopped>>()?,
        })
    }

    /// The candidates for an attempt; none from attempt [`ROWS`] on. `rig` must be the one the cache was built for.
    pub fn row<'a>(&'a self, attempt: u64, rig: &'a PreparedRig) -> impl Iterator<Item = Candidate<'a>> {
        let row = usize::try_from(attempt).ok().and_then(|row| self.rows.get(row));
        row.into_iter().flatten().map(|placement| Candidate {
            opposition: &rig.oppositions().by_width[usize::from(placement.opposition)],
            pair: placement.pair,
            object_from_wrist: placement.object_from_wrist(),
        })
    }
}
