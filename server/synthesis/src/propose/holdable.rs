//! Where an object may be held at all, as outer bounds: what lies beyond them is impossible.

use crate::{
    base::stop::{Stop, Stopped},
    geometry::{
        opposed::{OPPOSED_ACCURACY, OpposedDistance, opposed_distance},
        oriented_box::OrientedBox,
        topology::Topology,
    },
    model::object::GraspObject,
};

use super::surface_pairs::SurfacePairs;

/// Opposed places closer than this, in metres, are within any hand's reach and not compared further: most of an adult's
/// span. Smaller values take longer to prepare large objects.
const CLOSE: f32 = 0.12;

/// Opposed places farther apart than this, in metres, are beyond any hand.
const FAR: f32 = 0.5;

/// Bounds on the places where an object may be held, in its frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HoldableSurface {
    /// A box around the surface that may be touched; none if all of it is forbidden.
    pub region: Option<OrientedBox>,
    /// Lower bound on the distance, in metres, between two places that may be touched and whose normals are more than a
    /// right angle apart. None if some are close, or if unknown.
    pub width: Option<f32>,
    /// The same for the whole surface, forbidden or not.
    pub width_of_all: Option<f32>,
    /// Share of the surface's area that is forbidden, from 0 to 1.
    pub forbidden_share: f32,
}

impl HoldableSurface {
    /// The bounds of an object with these pairs. Objects that a hand spans take microseconds, others some milliseconds;
    /// forbidden surfaces add the time of a bounding box.
    ///
    /// # Errors
    /// [`Stopped`].
    pub fn of(object: &GraspObject, pairs: &SurfacePairs, stop: Stop<'_>) -> Result<Self, Stopped> {
        let mesh = object.surface.mesh();
        let is_allowed = |triangle: u32| !object.is_forbidden(triangle);
        let forbidden_area = object
            .forbidden_surface()
            .map_or(0.0, |surface| surface.mesh().area());
        let region = if object.forbidden_count() == 0 {
            Some(object.bounding_box)
        } else {
            mesh.submesh(|triangle| is_allowed(triangle as u32))
                .map(|allowed| OrientedBox::around_until(&allowed, stop))
                .transpose()?
        };
        let mut holdable = Self {
            region,
            width: None,
            width_of_all: None,
            forbidden_share: (forbidden_area / mesh.area()) as f32,
        };
        // Every pair of surface points opposes, and most objects have close ones.
        if pairs.pairs().is_empty() && is_oriented(object) {
            holdable.width = lower_bound(opposed_distance(mesh, is_allowed, CLOSE, FAR, stop)?);
            holdable.width_of_all = if object.forbidden_count() == 0 {
                holdable.width
            } else {
                lower_bound(opposed_distance(mesh, |_| true, CLOSE, FAR, stop)?)
            };
        }
        Ok(holdable)
    }
}

/// True if all normals point to the same side of the surface: it is closed, wound consistently and in one piece.
fn is_oriented(object: &GraspObject) -> bool {
    let topology = Topology::of(object.surface.mesh());
    topology.is_closed()
        && topology.is_consistently_wound()
        && topology.non_manifold_edges == 0
        && topology.components == 1
}

fn lower_bound(distance: OpposedDistance) -> Option<f32> {
    match distance {
        OpposedDistance::CloseOrUnknown => None,
        OpposedDistance::Apart(metres) => Some(metres * (1.0 - OPPOSED_ACCURACY)),
        OpposedDistance::BeyondLimit => Some(FAR),
    }
}
