//! Rigs and objects together with the data that proposals derive from them once.

use std::{
    ops::Deref,
    sync::{Arc, OnceLock},
};

use glam::Vec3;
use sha2::{Digest as _, Sha256};

use super::{
    opposition::Oppositions,
    placement_cache::{PlacementCache, PlacementCaches},
    surface_pairs::{HoldableSurface, SurfacePairs},
};
use crate::{
    base::{
        pose::Pose,
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
    physical::solids::{HandSolids, link_radii},
};

/// Angles tried per joint range for a hand's span, and the factor that covers those between them: cos(7°) for a digit's
/// widest range, and then some.
const ANGLES: usize = 5;
const BETWEEN_ANGLES: f32 = 1.03;

/// A rig and its oppositions, which are sampled on first use. Clones share both. Two are equal if their rigs make the same
/// grips, whatever their names.
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
    surface_pairs: SurfacePairs,
    wanted: SurfacePairs,
    holdable: HoldableSurface,
    placements: PlacementCaches,
}

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
        let wanted = if object.regions().require_contacts() {
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
            wanted,
            holdable,
            placements: PlacementCaches::default(),
        })
    }

    /// Memory use in bytes of what is derived from the plain object, placement caches of two hands included.
    pub fn derived_bytes(&self) -> usize {
        let of_pairs = self.surface_pairs.bytes() + self.wanted.bytes();
        self.object.derived_bytes() + of_pairs + 2 * PlacementCaches::BYTES_PER_RIG
    }

    /// The object itself.
    pub fn object(&self) -> &Arc<GraspObject> {
        &self.object
    }

    /// The points where opposed digits or the palm may press.
    pub fn surface_pairs(&self) -> &SurfacePairs {
        &self.surface_pairs
    }

    /// Those of them where the object's owner wants hands; `None` if that is everywhere.
    pub fn wanted_pairs(&self) -> &SurfacePairs {
        &self.wanted
    }

    /// Bounds on where it may be held.
    pub fn holdable(&self) -> &HoldableSurface {
        &self.holdable
    }

    /// The placements at which a hand fits at the object and is likely to hold it. The first call for a rig takes about five
    /// milliseconds.
    pub fn placement_cache(&self, rig: &PreparedRig) -> Arc<PlacementCache> {
        self.placements.of(self, rig)
    }

    /// Builds what [`Self::placement_cache`] returns, unless it is stopped.
    ///
    /// # Errors
    /// [`Stopped`].
    pub fn build_placement_cache(&self, rig: &PreparedRig, stop: Stop<'_>) -> Result<(), Stopped> {
        self.placements.build_until(self, rig, stop)
    }

    /// True if [`Self::placement_cache`] need not build it.
    pub fn has_placement_cache(&self, rig: &PreparedRig) -> bool {
        self.placements.has(rig)
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
