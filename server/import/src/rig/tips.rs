//! Fits the solid of a last link to the pad of its fingertip, where grasps touch.
//!
//! Drawn fingertips are flatter on the nail's side and fuller at the pad, so a solid around the bone would be in the air at the
//! pad. The link is tilted toward the pad instead, and the bone keeps its place in it.

use glam::Vec3;
use grasp_synthesis::physical::solids::TaperedCapsule;

/// What is fitted, with its ranges: the slopes of the link toward the pad and to the side, and the radius of the tip as a multiple
/// of the measured one.
const RANGES: [[f32; 2]; 3] = [[-0.3, 0.3], [-0.15, 0.15], [0.6, 1.4]];

/// Share of the link's length from which vertices count: nearer to the joint, the skin is also that of the link before.
const OUTER: f32 = 0.3;

/// Cosines to the pad's direction at which vertices start to count, and from which they count fully: the sides touch less often,
/// the nail hardly ever.
const PAD_COSINES: [f32; 2] = [-0.5, 0.6];

/// Most vertices that are compared.
const MAX_VERTICES: usize = 400;

/// Fewest vertices for a fit.
const FEWEST: usize = 12;

/// Distances in metres beyond which a vertex counts no more than at it: wrinkles and strays.
const FARTHEST: f32 = 0.003;

/// A fingertip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Tip {
    /// Where the link ends on the skin.
    pub(super) end: Vec3,
    /// The radius of the sphere that ends it, in metres.
    pub(super) radius: f32,
}

/// The last link of a digit before it is fitted.
#[derive(Clone, Copy, Debug)]
pub(super) struct LastLink {
    /// Its joint.
    pub(super) start: Vec3,
    /// The radius there, in metres.
    pub(super) start_radius: f32,
    /// Its tip along the bone.
    pub(super) tip: Tip,
    /// Unit vector that the pad faces, across the bone.
    pub(super) pad: Vec3,
}

impl LastLink {
    /// The tip that fits the vertices at the pad best, as far from the joint as before.
    pub(super) fn fitted(&self, vertices: &[Vec3]) -> Tip {
        let bone = self.tip.end - self.start;
        let (length, along) = (bone.length(), bone.normalize_or(Vec3::Y));
        let every = vertices.len().div_ceil(MAX_VERTICES).max(1);
        let weighted: Vec<(Vec3, f32)> = vertices
            .iter()
            .step_by(every)
            .filter_map(|&vertex| {
                let offset = vertex - self.start;
                let to_side = offset.reject_from_normalized(along).normalize_or_zero();
                let [least, most] = PAD_COSINES;
                let weight = ((to_side.dot(self.pad) - least) / (most - least)).clamp(0.0, 1.0);
                (offset.dot(along) > OUTER * length && weight > 0.0).then_some((vertex, weight))
            })
            .collect();
        if weighted.len() < FEWEST {
            return self.tip;
        }
        let side = along.cross(self.pad);
        let tip = |[tilt, turn, share]: [f32; 3]| {
            let direction = along + self.pad * tilt + side * turn;
            Tip {
                end: self.start + length * direction.normalize_or(along),
                radius: share * self.tip.radius,
            }
        };
        let error = |fit: [f32; 3]| {
            let solid = self.solid(tip(fit));
            let of_vertex = |&(vertex, weight): &(Vec3, f32)| {
                weight * solid.signed_distance(vertex).abs().min(FARTHEST).powi(2)
            };
            weighted.iter().map(of_vertex).sum::<f32>()
        };
        // By turns along each parameter, in ever smaller steps.
        let mut fit = [0.0, 0.0, 1.0];
        let mut least = error(fit);
        let mut step = 0.5;
        while step > 0.01 {
            let before = least;
            for parameter in 0..RANGES.len() {
                let [min, max] = RANGES[parameter];
                for change in [step, -step] {
                    let mut tried = fit;
                    tried[parameter] = (fit[parameter] + 0.5 * change * (max - min)).clamp(min, max);
                    let tried_error = error(tried);
                    if tried_error < least {
                        (fit, least) = (tried, tried_error);
                    }
                }
            }
            if least >= before {
                step *= 0.5;
            }
        }
        tip(fit)
    }

    /// The solid of the link, whose last sphere ends at the tip.
    fn solid(&self, tip: Tip) -> TaperedCapsule {
        let bone = tip.end - self.start;
        let inset = tip.radius.min(bone.length());
        let centre = tip.end - inset * bone.normalize_or_zero();
        TaperedCapsule::new(self.start, centre, self.start_radius, tip.radius)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Vertices on a solid around a link that is tilted toward the pad.
    fn vertices(link: &LastLink, tilt: f32, radius: f32) -> Vec<Vec3> {
        let length = link.tip.end.distance(link.start);
        let tip = Tip {
            end: link.start + length * Vec3::new(0.0, tilt.cos(), tilt.sin()),
            radius,
        };
        let solid = link.solid(tip);
        let mut on_skin = Vec::new();
        for ring in 0..30 {
            for turn in 0..24 {
                let direction = std::f32::consts::TAU * turn as f32 / 24.0;
                let axis = (solid.end - solid.start).normalize_or(Vec3::Y);
                let across = (Vec3::X * direction.cos() + Vec3::Z * direction.sin())
                    .reject_from_normalized(axis)
                    .normalize_or(Vec3::X);
                // Where a ray from the axis, or from the middle of the tip's sphere, leaves the solid.
                let share = (ring as f32 / 20.0).min(1.0);
                let beyond = (ring as f32 / 20.0 - share) * std::f32::consts::PI;
                let ray = across * beyond.cos() + axis * beyond.sin();
                let [mut inside, mut outside] = [0.0, 0.03];
                for _ in 0..30 {
                    let middle = 0.5 * (inside + outside);
                    if solid.signed_distance(solid.at(share) + middle * ray) < 0.0 {
                        inside = middle;
                    } else {
                        outside = middle;
                    }
                }
                on_skin.push(solid.at(share) + inside * ray);
            }
        }
        on_skin
    }

    #[test]
    fn a_tilted_tip_is_found_from_its_skin() {
        let link = LastLink {
            start: Vec3::new(0.01, 0.15, -0.02),
            start_radius: 0.008,
            tip: Tip {
                end: Vec3::new(0.01, 0.175, -0.02),
                radius: 0.007,
            },
            pad: Vec3::Z,
        };
        for (tilt, radius) in [(0.0, 0.007), (0.1, 0.0065), (-0.08, 0.008), (0.15, 0.0055)] {
            let fitted = link.fitted(&vertices(&link, tilt, radius));
            let expected = link.start + 0.025 * Vec3::new(0.0, f32::cos(tilt), f32::sin(tilt));
            assert!(
                fitted.end.distance(expected) < 3e-4,
                "{tilt}: {} for {expected}",
                fitted.end
            );
            assert!((fitted.radius - radius).abs() < 2e-4, "{tilt}: {}", fitted.radius);
        }
        assert_eq!(link.fitted(&[]), link.tip);
    }
}
