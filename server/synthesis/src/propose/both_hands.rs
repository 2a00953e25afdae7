//! Proposals for two hands that hold an object together: each a part of it that one hand can hold or press, on both sides
//! of its centre of mass.
//!
//! Most objects that take two hands are symmetric about an upright plane, and people hold them symmetrically. The mirror
//! image of a hand is the same person's other hand, so one that fits on one side has a fitting partner on the other.

use glam::Vec3;

use super::{
    proposal::{MAX_LOCATIONS, ProposalContext, palm_shape},
    surface_pairs::{SurfacePair, SurfacePoint},
};
use crate::{
    base::{pose::Pose, random::AttemptStream, stop::Stop},
    model::hand::rig::Rig,
    physical::shape::{HandShape, Proposal},
};

/// Locations drawn per proposal, of which the best is used. More find holds of plain objects sooner, but less varied ones.
const COMPARED: usize = 4;

/// Share of proposals with the palm on the object where all of it is within a hand's span. Elsewhere, only palms can
/// hold it.
const MIN_PALM_SHARE: f32 = 0.3;

/// Where one of two hands should be.
#[derive(Clone, Copy, Debug)]
pub enum Aim {
    /// Far from the line along `up`, a unit vector, through `centre`, with palms facing it.
    Outside {
        /// The object's centre of mass, in metres.
        centre: Vec3,
        /// Against gravity.
        up: Vec3,
    },
    /// Near a point, in metres.
    Near(Vec3),
}

impl Aim {
    /// The better, the higher, for opposed pads.
    fn merit_of_pair(&self, pair: &SurfacePair) -> f32 {
        let middle = (pair.start + pair.end) * 0.5;
        match *self {
            Self::Outside { centre, up } => (middle - centre).reject_from_normalized(up).length(),
            Self::Near(target) => -middle.distance(target),
        }
    }

    /// The better, the higher, for a palm.
    fn merit_of_point(&self, point: &SurfacePoint) -> f32 {
        match *self {
            Self::Outside { centre, up } => {
                let outward = (point.position - centre).reject_from_normalized(up);
                outward.normalize_or_zero().dot(point.normal)
            }
            Self::Near(target) => -point.position.distance(target),
        }
    }
}

impl ProposalContext<'_> {
    /// Proposes one of two hands, with pads or palm on the best of some locations and a wrist pose that `admits` accepts.
    /// Returns `None` if no sampled hand fits, or if stopped.
    pub fn propose_half(
        &self,
        aim: Aim,
        admits: impl Fn(Pose) -> bool,
        stream: &mut AttemptStream,
        stop: Stop<'_>,
    ) -> Option<Proposal> {
        let palm_share = 1.0 - (1.0 - MIN_PALM_SHARE) * self.surface.spanned_share();
        let in_palm = stream.unit() < palm_share;
        (0..MAX_LOCATIONS).take_while(|_| !stop.is_over()).find_map(|_| {
            if in_palm {
                let shape = flat_palm_shape(self.rig, stream);
                let point = best_of(|| self.free_point(stream), |point| aim.merit_of_point(point))?;
                self.palm_on(point, shape, &admits, stream)
            } else {
                let pair = best_of(|| self.free_pair(stream), |pair| aim.merit_of_pair(pair))?;
                Some(self.candidate_on(pair, &admits, stream)?.proposal())
            }
        })
    }
}

/// Draws the shape of a hand with the palm on what is too wide for one hand: nearly flat under it, so that a thumb far out
/// of the palm's plane would start inside.
fn flat_palm_shape(rig: &Rig, stream: &mut AttemptStream) -> HandShape {
    let shape = palm_shape(rig, stream);
    HandShape {
        thumb_yaw: shape.thumb_yaw * stream.unit(),
        ..shape
    }
}

/// The one with the highest merit of [`COMPARED`] draws.
fn best_of<T>(mut draw: impl FnMut() -> Option<T>, merit: impl Fn(&T) -> f32) -> Option<T> {
    (0..COMPARED)
        .map_while(|_| draw())
        .max_by(|a, b| merit(a).total_cmp(&merit(b)))
}
