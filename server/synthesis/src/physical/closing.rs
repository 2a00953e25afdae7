//! Step 2 under `PHYSICAL` validity: one digit closes until its flesh touches, at joint angles that are solved for.
//!
//! The thesis closes in steps of 5° and tests a line on the front of each link (Algorithm 4). Here a digit's links are
//! tapered capsules that close by conservative advancement (after B. Mirtich, "Timewarp Rigid Body Simulation", 2000,
//! for rotations): a clearance divided by the highest speed of any point on the links is an angle that is certainly
//! free. A link that touches stops, and with it the joints that carry it; the outer joints continue, as the deep flexor
//! bends the last joint of a finger whose other joints are held. A hooking finger bends the last joint only then.

use std::f32::consts::PI;

use super::{
    closer::Obstacle,
    shape::{Flexing, Sweep},
    solids::{Bounded, TaperedCapsule, clearance, comes_within, link_solids},
};
use crate::{
    geometry::mesh_bvh::MeshBvh,
    model::hand::{DigitAngles, kinematics::DigitPlane, rig::LinkOverlaps},
};

/// How deep a touching link's capsule lies in the surface, in metres: soft pads yield that much under a light touch.
/// Larger values look sunken, smaller ones look like hovering.
pub const TOUCH_DEPTH: f32 = 0.0005;

/// Tolerance of [`TOUCH_DEPTH`], in metres: a tenth of a millimetre is invisible. Smaller values take more steps.
pub(super) const TOUCH_TOLERANCE: f32 = 0.0001;

/// A part of the hand touches below this clearance, in metres.
pub(super) const TOUCHING: f32 = -TOUCH_DEPTH + 2.0 * TOUCH_TOLERANCE;

/// Depth in metres beyond which a link starts inside a surface.
const INSIDE_DEPTH: f32 = TOUCH_DEPTH + 0.0005;

/// A link below this clearance, in metres, is certainly deeper than [`INSIDE_DEPTH`]: a cheap early exit.
const CERTAINLY_INSIDE: f32 = -INSIDE_DEPTH - TOUCH_TOLERANCE;

/// Clearance between a relaxed digit and the object, in metres: just enough to be visible.
const RELAXED_CLEARANCE: f32 = 0.001;

/// Fractions of full closure tried as starts for relaxing a digit that cannot be opened.
const CURLED: [f32; 3] = [0.35, 0.7, 1.0];

/// Shares of the preshape tried as starts for hooking: straighter fingers hit parts below the handle.
const HOOKED: &[f32] = &[1.0, 0.92, 0.84, 0.76, 0.65];

/// Shares of a posed digit's bend tried as starts, and the share up to which it bends to touch.
const LESS_BENT: [f32; 5] = [1.0, 0.93, 0.85, 0.7, 0.5];
const MORE_BENT: f32 = 1.15;

/// Above this gap, in metres, a lower bound replaces the exact gap.
pub(super) const COARSE_GAP: f32 = 0.004;

/// Largest distance of a closest-point query on the mesh, in metres. Shorter queries are faster.
pub(super) const SEARCH_DISTANCE: f32 = 0.015;

/// Limit on the steps of one advancement.
pub(super) const MAX_STEPS: usize = 120;

/// A digit after closing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ClosedDigit {
    /// Its joint angles.
    pub angles: DigitAngles,
    /// Its links as solids, in the object's frame.
    pub links: [TaperedCapsule; 3],
    /// Which of the links touch the object.
    pub touches: [bool; 3],
}

impl ClosedDigit {
    /// True if a link touches the object.
    pub(crate) fn touches_object(&self) -> bool {
        self.touches.contains(&true)
    }

    /// A digit that keeps its pose.
    pub(super) fn as_posed(angles: DigitAngles, links: [TaperedCapsule; 3], surface: &MeshBvh) -> Self {
        Self {
            angles,
            touches: std::array::from_fn(|link| touches(&links[link], surface)),
            links,
        }
    }

    /// Sum of the three joints' flexion, in radians.
    pub fn flexion(&self) -> f32 {
        self.angles.pitches().iter().sum()
    }
}

/// One digit about to close on an object, with its wrist fixed.
#[derive(Clone, Copy, Debug)]
pub struct Closing<'a> {
    /// The object's surface.
    pub surface: &'a MeshBvh,
    /// The digit and how it bends.
    pub flexing: Flexing<'a>,
    /// Radii at the digit's joints and tip, in metres.
    pub radii: [f32; 4],
    /// The plane it bends in, in the object's frame.
    pub plane: DigitPlane,
    /// Fraction of full closure, from 0 to 1, that closing starts from. If the digit would start inside something, half of
    /// it is tried, then the opened digit.
    pub preshape: f32,
    /// Other parts of the hand that stop the digit.
    pub obstacles: &'a [Obstacle],
    /// Depths at which the digit's links overlap these parts at rest.
    pub rest_overlaps: Option<&'a [LinkOverlaps; 3]>,
    /// Whether the last joint stays straight until the others are stopped, so that the fingertip does not meet a hanging load
    /// before the finger supports it.
    pub curls_last: bool,
}

impl Closing<'_> {
    /// Closes until every joint is stopped or at its limit. `None` if a link starts inside a surface.
    pub fn close(&self) -> Option<ClosedDigit> {
        let mut angles = self.starts().find(|angles| self.is_free(angles))?;
        let mut touches = [false; 3];
        // The first joint that still moves.
        let mut free = 0;
        while free < 3 {
            let mut rates = self.flexing.rates();
            rates[..free].fill(0.0);
            if self.curls_last && free < 2 {
                rates[2] = 0.0;
            }
            let sweep = Sweep { start: angles, rates };
            angles = self.advance(&sweep, -TOUCH_DEPTH, f32::INFINITY);
            let links = self.links(&angles);
            // The outermost touching link stops all joints below it.
            let held = (free..3).rev().find_map(|link| {
                let touches = self::touches(&links[link], self.surface);
                (touches || self.gap_to_obstacles(link, &links[link], TOUCHING) < TOUCHING)
                    .then_some((link, touches))
            });
            let Some((link, is_touch)) = held else {
                if self.curls_last && free < 2 {
                    free = 2;
                    continue;
                }
                break;
            };
            touches[link] = is_touch;
            free = link + 1;
        }
        let links = self.links(&angles);
        // Links that met the surface while others were closing touch too.
        for (touched, link) in touches.iter_mut().zip(&links) {
            *touched = *touched || self::touches(link, self.surface);
        }
        Some(ClosedDigit {
            angles,
            links,
            touches,
        })
    }

    /// Closes a posed digit, each joint in proportion to its angle, until its first touch. Starts at its pose, or less bent if that
    /// is inside something, and stays there if nothing is near. `None` if every start is inside.
    pub(super) fn settle(&self, posed: DigitAngles) -> Option<ClosedDigit> {
        let [base_yaw, first, second, third] = posed.to_array();
        let bent_by =
            |share: f32| DigitAngles::from_array([base_yaw, first * share, second * share, third * share]);
        let starts = LESS_BENT.map(|share| (share, bent_by(share)));
        let (share, start) = starts.into_iter().find(|(_, start)| self.is_free(start))?;
        let rates = posed.pitches().map(|bend| bend.max(0.0));
        let touched = |angles: DigitAngles| ClosedDigit::as_posed(angles, self.links(&angles), self.surface);
        let at_start = touched(start);
        if at_start.touches_object() {
            return Some(at_start);
        }
        let sweep = Sweep { start, rates };
        let bent = touched(self.advance(&sweep, -TOUCH_DEPTH, MORE_BENT - share));
        Some(if bent.touches_object() { bent } else { at_start })
    }

    /// The poses to close from, in order of preference.
    fn starts(&self) -> impl Iterator<Item = DigitAngles> {
        let straight = self.flexing.opened().third_pitch;
        let shares = if self.curls_last { HOOKED } else { &[1.0, 0.5, 0.0] };
        shares.iter().map(move |share| {
            let mut start = self.flexing.closed_by(share * self.preshape);
            if self.curls_last {
                start.third_pitch = straight;
            }
            start
        })
    }

    /// A relaxed pose for a digit that touches nothing: bent by `flexion` radians in total, or less if something
    /// stops it. If the opened digit is inside the object, it bends from the first partly closed pose that is free.
    pub fn relax(&self, flexion: f32) -> ClosedDigit {
        let opened = self.flexing.opened();
        let start = std::iter::once(0.0)
            .chain(CURLED)
            .map(|share| self.flexing.closed_by(share))
            .find(|angles| self.is_free(angles))
            .unwrap_or(opened);
        let sweep = Sweep {
            start,
            rates: self.flexing.rates(),
        };
        // The sweep to that total flexion, ignoring joint limits.
        let bent: f32 = start.pitches().iter().sum();
        let way = (flexion - bent).max(0.0) / sweep.rates.iter().sum::<f32>();
        let angles = self.advance(&sweep, RELAXED_CLEARANCE, way);
        ClosedDigit {
            angles,
            links: self.links(&angles),
            touches: [false; 3],
        }
    }

    /// Sweeps until a moving link's clearance drops to `target` metres, or for `max_sweep` radians. Links must start outside.
    fn advance(&self, sweep: &Sweep, target: f32, max_sweep: f32) -> DigitAngles {
        let max_sweep = max_sweep.min(self.flexing.full_sweep(sweep));
        let mut swept = 0.0;
        // Each link is free up to this angle and is not checked again before it.
        let mut clear_until = [0.0; 3];
        for _ in 0..MAX_STEPS {
            if swept >= max_sweep {
                break;
            }
            let angles = self.flexing.angles_at(sweep, swept);
            let links = self.links(&angles);
            let speeds = self.speeds(sweep, &angles, &links);
            // The outermost links move fastest and end max_sweep sweeps.
            for link in (0..3).rev() {
                let speed = speeds[link];
                if speed <= 0.0 {
                    clear_until[link] = f32::INFINITY;
                }
                if clear_until[link] > swept {
                    continue;
                }
                // Gaps that the rest of the sweep cannot close do not matter.
                let reachable = target + 2.0 * TOUCH_TOLERANCE + speed * (max_sweep - swept);
                let free = self.gap(link, &links[link], reachable) - target;
                if free <= TOUCH_TOLERANCE {
                    return angles;
                }
                clear_until[link] = swept + free / speed;
            }
            swept = clear_until.into_iter().fold(max_sweep, f32::min);
        }
        self.flexing.angles_at(sweep, swept)
    }

    /// A lower bound, in metres, on the gap to the surface or obstacles; exact below [`COARSE_GAP`] and `reachable`.
    fn gap(&self, index: usize, link: &TaperedCapsule, reachable: f32) -> f32 {
        let obstructed = self.gap_to_obstacles(index, link, reachable);
        let lower_bound = self.surface.gap_lower_bound(link);
        if lower_bound > COARSE_GAP {
            return lower_bound.min(obstructed);
        }
        let within = obstructed.min(SEARCH_DISTANCE);
        let gap = self.surface.closest_to_capsule(link, within);
        gap.map_or(within, |gap| gap.gap)
    }

    /// The gap to the obstacles alone, or `reachable` if none is closer.
    fn gap_to_obstacles(&self, index: usize, link: &TaperedCapsule, reachable: f32) -> f32 {
        let link = Bounded::new(*link);
        let ahead = self.obstacles.iter().filter(|obstacle| obstacle.stops(index));
        ahead.fold(reachable, |least, obstacle| {
            let overlap = self
                .rest_overlaps
                .map_or(0.0, |links| links[index][obstacle.part]);
            least.min(obstacle.gap(&link, overlap, least))
        })
    }

    /// True if no link is inside the object or an obstacle.
    fn is_free(&self, angles: &DigitAngles) -> bool {
        let links = self.links(angles);
        // The smallest clearance, or a larger one if it is enough.
        let smallest = |least: f32, link| clearance(link, self.surface, least).min(least);
        let is_free = |(index, link): (usize, _)| self.gap_to_obstacles(index, link, 0.0) >= -INSIDE_DEPTH;
        links.iter().enumerate().all(is_free)
            && !links
                .iter()
                .any(|link| comes_within(link, self.surface, CERTAINLY_INSIDE))
            && links.iter().fold(INSIDE_DEPTH, smallest) >= -INSIDE_DEPTH
    }

    /// Upper bounds on how fast each link's gap can shrink, in metres per radian of the rest of a sweep. A link is a union of
    /// spheres, of which only the centres move, fastest at an end. As the digit bends, its parts approach the joints behind them.
    fn speeds(&self, sweep: &Sweep, angles: &DigitAngles, links: &[TaperedCapsule; 3]) -> [f32; 3] {
        let (pitches, max) = (angles.pitches(), self.flexing.digit.limits.max_pitches());
        let rate = |joint: usize| {
            if pitches[joint] < max[joint] {
                sweep.rates[joint]
            } else {
                0.0
            }
        };
        let rates = [rate(0), rate(1), rate(2)];
        // A digit bent backward, or by more than half a turn, may still straighten.
        let bends_inward = pitches[1].min(pitches[2]) >= 0.0 && max[1] + max[2] <= PI;
        std::array::from_fn(|link| {
            (0..=link)
                .map(|joint| {
                    let reach = if bends_inward {
                        let joint = links[joint].start;
                        let TaperedCapsule { start, end, .. } = links[link];
                        joint
                            .distance_squared(start)
                            .max(joint.distance_squared(end))
                            .sqrt()
                    } else {
                        self.flexing.digit.lengths[joint..=link].iter().sum()
                    };
                    rates[joint] * reach
                })
                .sum()
        })
    }

    fn links(&self, angles: &DigitAngles) -> [TaperedCapsule; 3] {
        link_solids(self.plane.joints(angles), self.radii)
    }
}

/// True if a link touches the object, or is deeper.
fn touches(link: &TaperedCapsule, surface: &MeshBvh) -> bool {
    clearance(link, surface, TOUCHING) < TOUCHING
}
