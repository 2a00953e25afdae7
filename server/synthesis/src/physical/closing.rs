//! Step 2 under `PHYSICAL` validity: digits close until their flesh touches, at angles that are solved for.
//!
//! The thesis closes in steps of 5° and tests a line on the front of each link (Algorithm 4). Here a digit's links are
//! tapered capsules. They close as far as they certainly can, by conservative advancement: a clearance divided by the
//! fastest that any point of the links can move is an angle through which nothing is reached (after B. Mirtich,
//! "Timewarp Rigid Body Simulation", 2000, for rotations). A link that touches stays, and so do the joints that carry
//! it; the joints beyond go on, as a finger's deep flexor bends the last joint when the others are held.

use std::f32::consts::PI;

use super::{
    flexing::{Flexing, Sweep},
    obstacle::Obstacle,
    solids::{Bounded, TaperedCapsule, clearance, comes_within, link_solids},
};
use crate::{
    geometry::mesh_bvh::MeshBvh,
    model::hand::{DigitAngles, kinematics::DigitPlane},
};

/// How deep a link's capsule is in the surface when it is said to touch, in metres: soft pads give way that much under a
/// light touch. More looks sunken, less looks hovering.
pub const TOUCH_DEPTH: f32 = 0.0005;

/// How near to that depth is near enough, in metres: nobody sees a tenth of a millimetre. Less takes more steps.
pub(super) const TOUCH_TOLERANCE: f32 = 0.0001;

/// The clearance below which a part of the hand touches, in metres.
pub(super) const TOUCHING: f32 = -TOUCH_DEPTH + 2.0 * TOUCH_TOLERANCE;

/// A link that starts deeper than this in a surface is inside from the start, in metres.
const INSIDE_DEPTH: f32 = TOUCH_DEPTH + 0.0005;

/// The clearance below which a link is surely that deep, in metres, however it is rounded. Most of those that are inside are
/// known by it, without a look at how deep they are: that saves a fifth of the time of an attempt on a mug, a tenth on a
/// wineglass and nothing on scissors. A lower one leaves more to be looked at.
const SURELY_INSIDE: f32 = -INSIDE_DEPTH - TOUCH_TOLERANCE;

/// Room that a relaxed digit leaves between itself and the object, in metres: enough to be seen.
const RELAXED_CLEARANCE: f32 = 0.001;

/// Shares of its way to closed from which a digit that cannot be opened is relaxed.
const CURLED: [f32; 3] = [0.35, 0.7, 1.0];

/// From a gap of this many metres on, one that is sure is as good as the true one. A smaller one takes more steps of a
/// few nanoseconds each, a larger one more looks at the mesh.
pub(super) const SURE_GAP: f32 = 0.004;

/// The farthest that the mesh is looked at, in metres: what is nearer is found sooner.
pub(super) const NEAR: f32 = 0.015;

/// Steps of advancement at most. Each covers what is certainly free, so that surfaces that a link glides along need
/// many; where it still has not arrived, it stops where it is, which is free.
pub(super) const MOST_STEPS: usize = 120;

/// A digit after it was closed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ClosedDigit {
    /// Its joint angles.
    pub angles: DigitAngles,
    /// Its links as solids, in the object's frame.
    pub links: [TaperedCapsule; 3],
    /// Which links touch.
    pub touches: [bool; 3],
}

impl ClosedDigit {
    /// True if a link touches the object.
    pub fn touches_object(&self) -> bool {
        self.touches.contains(&true)
    }

    /// Sum of the three joints' flexion in radians.
    pub fn flexion(&self) -> f32 {
        self.angles.base_pitch + self.angles.second_pitch + self.angles.third_pitch
    }
}

/// What closes: one digit at a wrist, toward an object.
#[derive(Clone, Copy, Debug)]
pub struct Closing<'a> {
    /// The object's surface.
    pub surface: &'a MeshBvh,
    /// The digit and how it bends.
    pub flexing: Flexing<'a>,
    /// Radii of the digit's joints and tip, in metres.
    pub radii: [f32; 4],
    /// Where it bends, in the object's frame.
    pub plane: DigitPlane,
    /// The share of its way from opened to closed that the digit is shaped by before it closes, from 0 to 1; where it
    /// would start inside of something then, by half of it or opened.
    pub preshape: f32,
    /// What else of the hand is in the digit's way.
    pub obstacles: &'a [Obstacle],
}

impl Closing<'_> {
    /// Closes until every joint is held or at its limit. None if a link is inside a surface from the start.
    pub fn close(&self) -> Option<ClosedDigit> {
        let mut angles = [self.preshape, 0.5 * self.preshape, 0.0]
            .map(|share| self.flexing.closed_by(share))
            .into_iter()
            .find(|angles| self.is_free(angles))?;
        let mut touches = [false; 3];
        // The first joint that is not held.
        let mut free = 0;
        while free < 3 {
            let sweep = Sweep {
                start: angles,
                rates: std::array::from_fn(|joint| {
                    if joint < free {
                        0.0
                    } else {
                        self.flexing.rate(joint)
                    }
                }),
            };
            angles = self.advance(&sweep, -TOUCH_DEPTH, f32::INFINITY);
            let links = self.links(&angles);
            // Of the links that touch now, the outermost holds all joints below it.
            let held = (free..3).rev().find_map(|link| {
                let touches = self.link_touches(&links[link]);
                (touches || self.is_obstructed(link, &links[link])).then_some((link, touches))
            });
            let Some((link, is_touch)) = held else { break };
            touches[link] = is_touch;
            free = link + 1;
        }
        let links = self.links(&angles);
        // What came to lie against the surface while other links were closing touches too.
        for (touches, link) in touches.iter_mut().zip(&links) {
            *touches = *touches || self.link_touches(link);
        }
        Some(ClosedDigit {
            angles,
            links,
            touches,
        })
    }

    /// The digit bent by `flexion` radians in all, whatever is in the way.
    pub fn bent(&self, flexion: f32) -> ClosedDigit {
        let sweep = self.flexing.sweep();
        let angles = self.flexing.angles_at(&sweep, way_to(flexion, &sweep));
        ClosedDigit {
            angles,
            links: self.links(&angles),
            touches: [false; 3],
        }
    }

    /// A relaxed pose for a digit that touches nothing: bent by `flexion` radians in all, or less if something is in
    /// the way. Where the opened digit is inside the object, it is bent from the first of the curled poses that is not.
    pub fn relax(&self, flexion: f32) -> ClosedDigit {
        let opened = self.flexing.opened();
        let start = std::iter::once(0.0)
            .chain(CURLED)
            .map(|share| self.flexing.closed_by(share))
            .find(|angles| self.is_free(angles))
            .unwrap_or(opened);
        let rates = std::array::from_fn(|joint| self.flexing.rate(joint));
        let sweep = Sweep { start, rates };
        let angles = self.advance(&sweep, RELAXED_CLEARANCE, way_to(flexion, &sweep));
        ClosedDigit {
            angles,
            links: self.links(&angles),
            touches: [false; 3],
        }
    }

    /// Sweeps until a moving link's clearance is down to `target`, or `most` radians. Only for links that are outside of
    /// the object's volume: of others it asks how far the surface is.
    fn advance(&self, sweep: &Sweep, target: f32, most: f32) -> DigitAngles {
        let most = most.min(self.flexing.whole_way(sweep));
        let mut way = 0.0;
        // Up to where each link is free; it is not looked at again before.
        let mut free_until = [0.0; 3];
        for _ in 0..MOST_STEPS {
            if way >= most {
                break;
            }
            let angles = self.flexing.angles_at(sweep, way);
            let links = self.links(&angles);
            let speeds = self.speeds(sweep, &angles, &links);
            // The outermost links move fastest and stop most sweeps.
            for link in (0..3).rev() {
                let speed = speeds[link];
                if speed <= 0.0 {
                    free_until[link] = f32::INFINITY;
                }
                if free_until[link] > way {
                    continue;
                }
                // Beyond what the rest of the way can reach, nothing needs to be known.
                let reachable = target + 2.0 * TOUCH_TOLERANCE + speed * (most - way);
                let free = self.gap(link, &links[link], reachable) - target;
                if free <= TOUCH_TOLERANCE {
                    return angles;
                }
                free_until[link] = way + free / speed;
            }
            way = free_until.into_iter().fold(most, f32::min);
        }
        self.flexing.angles_at(sweep, way)
    }

    /// A gap that the surface and the obstacles keep from a link, in metres: the smallest if that is small and less than
    /// `reachable`.
    fn gap(&self, index: usize, link: &TaperedCapsule, reachable: f32) -> f32 {
        let obstructed = self.gap_to_obstacles(index, link, reachable);
        let sure = self.surface.gap_lower_bound(link);
        if sure > SURE_GAP {
            return sure.min(obstructed);
        }
        let within = obstructed.min(NEAR);
        let gap = self.surface.closest_to_capsule(link, within);
        gap.map_or(within, |gap| gap.gap)
    }

    /// The same for the obstacles alone: `reachable` if none is nearer.
    fn gap_to_obstacles(&self, index: usize, link: &TaperedCapsule, reachable: f32) -> f32 {
        let link = Bounded::new(*link);
        let ahead = self.obstacles.iter().filter(|obstacle| obstacle.stops(index));
        ahead.fold(reachable, |least, obstacle| least.min(obstacle.gap(&link, least)))
    }

    /// True if no link is inside the object or an obstacle.
    fn is_free(&self, angles: &DigitAngles) -> bool {
        let links = self.links(angles);
        let is_free = |(index, link): (usize, _)| self.gap_to_obstacles(index, link, 0.0) >= -INSIDE_DEPTH;
        links.iter().enumerate().all(is_free)
            && !links
                .iter()
                .any(|link| comes_within(link, self.surface, SURELY_INSIDE))
            && self.smallest_clearance(&links, INSIDE_DEPTH) >= -INSIDE_DEPTH
    }

    fn is_obstructed(&self, index: usize, link: &TaperedCapsule) -> bool {
        self.gap_to_obstacles(index, link, TOUCHING) < TOUCHING
    }

    /// Metres by which the gap of each link can shrink for a radian of the rest of a sweep.
    ///
    /// A link is made of balls, which turn within themselves, so that their middles' speeds count; the fastest is at an
    /// end. A joint at its limit turns no more. As the digit bends, everything comes nearer to the joints that carry it.
    fn speeds(&self, sweep: &Sweep, angles: &DigitAngles, links: &[TaperedCapsule; 3]) -> [f32; 3] {
        let limits = &self.flexing.digit.limits;
        let rate = |joint: usize, angle: f32, max: f32| if angle < max { sweep.rates[joint] } else { 0.0 };
        let rates = [
            rate(0, angles.base_pitch, limits.base_pitch.max),
            rate(1, angles.second_pitch, limits.second_pitch.max),
            rate(2, angles.third_pitch, limits.third_pitch.max),
        ];
        // Bent backward, or by more than half a turn, a digit may yet stretch.
        let comes_nearer = angles.second_pitch.min(angles.third_pitch) >= 0.0
            && limits.second_pitch.max + limits.third_pitch.max <= PI;
        std::array::from_fn(|link| {
            (0..=link)
                .map(|joint| {
                    let reach = if comes_nearer {
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

    /// The smallest clearance of some links, up to `enough`.
    fn smallest_clearance(&self, links: &[TaperedCapsule], enough: f32) -> f32 {
        let smallest = |least: f32, link| clearance(link, self.surface, least).min(least);
        links.iter().fold(enough, smallest)
    }

    fn link_touches(&self, link: &TaperedCapsule) -> bool {
        clearance(link, self.surface, TOUCHING) < TOUCHING
    }
}

/// The way of a sweep to a flexion in radians, if no joint comes to its limit before.
fn way_to(flexion: f32, sweep: &Sweep) -> f32 {
    let start = &sweep.start;
    let bent = start.base_pitch + start.second_pitch + start.third_pitch;
    (flexion - bent).max(0.0) / sweep.rates.iter().sum::<f32>()
}
