//! Step 2 under `PHYSICAL` validity: digits close until their flesh touches, at angles that are solved for.
//!
//! The thesis closes in steps of 5° and tests a line on the front of each link (Algorithm 4). Here a digit's links are
//! tapered capsules. They close as far as they certainly can, by conservative advancement: a clearance divided by the
//! fastest that any point of the links can move is an angle through which nothing is reached (after B. Mirtich,
//! "Timewarp Rigid Body Simulation", 2000, for rotations). A link that touches stays, and so do the joints that carry
//! it; the joints beyond go on, as a finger's deep flexor bends the last joint when the others are held.

use super::solids::{TaperedCapsule, clearance, link_solids};
use crate::{
    geometry::mesh_bvh::MeshBvh,
    hand::{
        DigitAngles,
        kinematics::digit_frames,
        rig::{AngleRange, DigitRig},
    },
    pose::Pose,
};

/// How deep a link's capsule is in the surface when it is said to touch, in metres: soft pads give way that much under a
/// light touch. More looks sunken, less looks hovering.
pub const TOUCH_DEPTH: f32 = 0.0005;

/// How near to that depth is near enough, in metres: nobody sees a tenth of a millimetre. Less takes more steps.
const TOUCH_TOLERANCE: f32 = 0.0001;

/// A link that starts deeper than this in a surface is inside from the start, in metres.
const INSIDE_DEPTH: f32 = TOUCH_DEPTH + 0.0005;

/// Room that a relaxed digit leaves between itself and the object, in metres: enough to be seen.
const RELAXED_CLEARANCE: f32 = 0.001;

/// Steps of advancement at most. Each covers what is certainly free, so that surfaces that a link glides along need
/// many; where it still has not arrived, it stops where it is, which is free.
const MOST_STEPS: usize = 40;

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

/// Which of the three joints still close, and where they start.
#[derive(Clone, Copy, Debug)]
struct Sweep {
    start: DigitAngles,
    /// Radians of each joint for a radian of the sweep.
    rates: [f32; 3],
}

/// What closes: one digit at a wrist, toward an object.
#[derive(Clone, Copy, Debug)]
pub struct Closing<'a> {
    /// The object's surface.
    pub surface: &'a MeshBvh,
    /// The digit.
    pub digit: &'a DigitRig,
    /// Radii of the digit's joints and tip, in metres.
    pub radii: [f32; 4],
    /// The wrist in the object's frame.
    pub object_from_wrist: Pose,
    /// ψ1 in radians.
    pub base_yaw: f32,
    /// Degrees of the second joint for a degree of the first.
    pub bend_ratio: f32,
}

impl Closing<'_> {
    /// Closes until every joint is held or at its limit. None if a link is inside a surface from the start.
    pub fn close(&self) -> Option<ClosedDigit> {
        let opened = self.opened();
        if self.smallest_clearance(&self.links(&opened), INSIDE_DEPTH) < -INSIDE_DEPTH {
            return None;
        }
        let mut angles = opened;
        let mut touches = [false; 3];
        // The first joint that is not held.
        let mut free = 0;
        while free < 3 {
            let sweep = Sweep {
                start: angles,
                rates: std::array::from_fn(|joint| if joint < free { 0.0 } else { self.rate(joint) }),
            };
            angles = self.advance(&sweep, -TOUCH_DEPTH, f32::INFINITY);
            let links = self.links(&angles);
            // Of the links that touch now, the outermost holds all joints below it.
            let touching = (free..3).rev().find(|&link| self.link_touches(&links[link]));
            let Some(link) = touching else { break };
            touches[link] = true;
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

    /// A relaxed pose for a digit that touches nothing: bent by `flexion` radians in all, or less if the object is in
    /// the way.
    pub fn relax(&self, flexion: f32) -> ClosedDigit {
        let start = self.opened();
        let rates: [f32; 3] = std::array::from_fn(|joint| self.rate(joint));
        let sweep = Sweep { start, rates };
        let opened = start.base_pitch + start.second_pitch + start.third_pitch;
        let most = (flexion - opened).max(0.0) / rates.iter().sum::<f32>();
        let angles = self.advance(&sweep, RELAXED_CLEARANCE, most);
        ClosedDigit {
            angles,
            links: self.links(&angles),
            touches: [false; 3],
        }
    }

    /// The opened pose: every joint at the lower end of its range, but not bent backward.
    fn opened(&self) -> DigitAngles {
        let limits = &self.digit.limits;
        let straight = |range: AngleRange| range.min.max(0.0_f32.min(range.max));
        DigitAngles {
            base_yaw: self.base_yaw,
            base_pitch: limits.base_pitch.min,
            second_pitch: straight(limits.second_pitch),
            third_pitch: straight(limits.third_pitch),
        }
    }

    /// Radians of a joint for a radian of the sweep.
    fn rate(&self, joint: usize) -> f32 {
        match joint {
            0 => 1.0,
            1 => self.bend_ratio,
            _ => self.bend_ratio * DigitAngles::THIRD_PITCH_SHARE,
        }
    }

    /// The angles after a sweep, none beyond its limit.
    fn angles_at(&self, sweep: &Sweep, way: f32) -> DigitAngles {
        let limits = &self.digit.limits;
        DigitAngles {
            base_yaw: self.base_yaw,
            base_pitch: (sweep.start.base_pitch + sweep.rates[0] * way).min(limits.base_pitch.max),
            second_pitch: (sweep.start.second_pitch + sweep.rates[1] * way).min(limits.second_pitch.max),
            third_pitch: (sweep.start.third_pitch + sweep.rates[2] * way).min(limits.third_pitch.max),
        }
    }

    /// The way after which all joints that move are at their limits.
    fn whole_way(&self, sweep: &Sweep) -> f32 {
        let limits = &self.digit.limits;
        let way = |rate: f32, start: f32, max: f32| {
            if rate > 0.0 {
                ((max - start) / rate).max(0.0)
            } else {
                0.0
            }
        };
        way(sweep.rates[0], sweep.start.base_pitch, limits.base_pitch.max)
            .max(way(
                sweep.rates[1],
                sweep.start.second_pitch,
                limits.second_pitch.max,
            ))
            .max(way(
                sweep.rates[2],
                sweep.start.third_pitch,
                limits.third_pitch.max,
            ))
    }

    /// Sweeps until a moving link's clearance is down to `target`, or `most` radians.
    fn advance(&self, sweep: &Sweep, target: f32, most: f32) -> DigitAngles {
        let most = most.min(self.whole_way(sweep));
        let speed = self.fastest(sweep);
        let first_moving = sweep.rates.iter().position(|rate| *rate > 0.0).unwrap_or(3);
        let mut way = 0.0;
        for _ in 0..MOST_STEPS {
            let links = self.links(&self.angles_at(sweep, way));
            // Beyond what the rest of the way can reach, nothing needs to be known.
            let reachable = target + speed * (most - way) + TOUCH_TOLERANCE;
            let free = self.smallest_gap(&links[first_moving..], reachable) - target;
            if free <= TOUCH_TOLERANCE || way >= most {
                break;
            }
            way = (way + free / speed).min(most);
        }
        self.angles_at(sweep, way)
    }

    /// Metres that the fastest point of the links can move for a radian of the sweep.
    fn fastest(&self, sweep: &Sweep) -> f32 {
        let [first, second, third] = self.digit.lengths;
        let thickest = self.radii.iter().copied().fold(0.0, f32::max);
        // The farthest point from a joint, with the digit stretched.
        let reach = [first + second + third, second + third, third].map(|length| length + thickest);
        sweep
            .rates
            .iter()
            .zip(reach)
            .map(|(rate, reach)| rate * reach)
            .sum::<f32>()
            .max(f32::EPSILON)
    }

    fn links(&self, angles: &DigitAngles) -> [TaperedCapsule; 3] {
        let frames = digit_frames(self.digit, self.object_from_wrist, *angles);
        let [first, second, third] = frames.links.map(|link| link.position);
        link_solids([first, second, third, frames.tip], self.radii)
    }

    /// The smallest clearance of some links, up to `enough`.
    fn smallest_clearance(&self, links: &[TaperedCapsule], enough: f32) -> f32 {
        let smallest = |least: f32, link| clearance(link, self.surface, least).min(least);
        links.iter().fold(enough, smallest)
    }

    /// The smallest gap between links and surface, up to `enough`. Only for links that are outside of the object's
    /// volume: of others it says how far the surface is.
    fn smallest_gap(&self, links: &[TaperedCapsule], enough: f32) -> f32 {
        links.iter().fold(enough, |least, link| {
            let gap = self.surface.closest_to_capsule(link, least);
            gap.map_or(least, |gap| gap.gap)
        })
    }

    fn link_touches(&self, link: &TaperedCapsule) -> bool {
        let near = -TOUCH_DEPTH + 2.0 * TOUCH_TOLERANCE;
        clearance(link, self.surface, near) < near
    }
}
