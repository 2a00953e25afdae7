//! Fits the links of a digit to its palmar side, where grasps touch.
//!
//! Bones of drawn hands often lie nearer to the back of a finger than to its pad, so that the median distance to the skin would
//! leave pads in the air: the widths of all links are fitted. Fingertips are flatter on the nail's side and fuller at the pad: the
//! last link is tilted toward the pad, and the bone keeps its place in it.

use glam::Vec3;
use grasp_synthesis::physical::solids::{TaperedCapsule, link_solids};

/// Fewest vertices for a fit.
const FEWEST: usize = 12;

/// How the vertices of a skin count.
struct PadVertices {
    /// Cosines to the pad's direction at which they start to count, and from which they count fully.
    cosines: [f32; 2],
    /// Most vertices that are compared.
    most: usize,
    /// Distances in metres beyond which a vertex counts no more than at it: wrinkles and strays.
    farthest: f32,
}

const OF_LINKS: PadVertices = PadVertices {
    cosines: [-0.3, 0.7],
    most: 500,
    farthest: 0.004,
};

const OF_TIP: PadVertices = PadVertices {
    cosines: [-0.5, 0.6],
    most: 400,
    farthest: 0.003,
};

impl PadVertices {
    /// The vertices that count, and how much; `across` gives the unit vector to a vertex across its bone, and the pad's direction.
    fn weighted(&self, vertices: &[Vec3], across: impl Fn(Vec3) -> Option<(Vec3, Vec3)>) -> Vec<(Vec3, f32)> {
        let every = vertices.len().div_ceil(self.most).max(1);
        let [least, most] = self.cosines;
        let sample = vertices.iter().step_by(every);
        let weighted = sample.filter_map(|&vertex| {
            let (across, pad) = across(vertex)?;
            let weight = ((across.dot(pad) - least) / (most - least)).clamp(0.0, 1.0);
            (weight > 0.0).then_some((vertex, weight))
        });
        weighted.collect()
    }

    /// The sum of the squared distances of vertices from the surface of solids.
    fn error(&self, weighted: &[(Vec3, f32)], solids: &[TaperedCapsule]) -> f32 {
        let of_vertex = |&(vertex, weight): &(Vec3, f32)| {
            let distances = solids.iter().map(|solid| solid.signed_distance(vertex));
            let distance = distances.fold(f32::INFINITY, f32::min);
            weight * distance.abs().min(self.farthest).powi(2)
        };
        weighted.iter().map(of_vertex).sum()
    }
}

/// Shares of the first link before which the skin is the palm's, and of the last link beyond which it is the tip's.
const ENDS: [f32; 2] = [0.3, 0.85];

/// Share of its distance from the bones that the skin is on the pads' side: the built-in hands have 0.1, others 0.3 to 0.6.
const NEAR_BACK: f32 = 0.2;

/// Smallest and largest radius as a multiple of the measured one.
const RADII: [f32; 2] = [0.6, 1.8];

/// Steps of the search, as shares of a radius.
const STEPS: [f32; 5] = [0.2, 0.1, 0.05, 0.025, 0.0125];

/// Rounds over all radii at each step.
const ROUNDS: usize = 6;

/// Values that are being fitted, with their ranges and the error that is left.
struct Fit {
    values: [f32; 3],
    ranges: [[f32; 2]; 3],
    least: f32,
}

impl Fit {
    /// Changes each value by turns, up and down by a step, if that lessens the error; false if nothing did.
    fn improve(
        &mut self,
        step: f32,
        changed: impl Fn(usize, &Self, f32) -> f32,
        error: impl Fn([f32; 3]) -> f32,
    ) -> bool {
        let before = self.least;
        for place in 0..3 {
            for step in [step, -step] {
                let [min, max] = self.ranges[place];
                let mut tried = self.values;
                tried[place] = changed(place, self, step).clamp(min, max);
                let tried_error = error(tried);
                if tried_error < self.least {
                    (self.values, self.least) = (tried, tried_error);
                }
            }
        }
        self.least < before
    }
}

/// The links of a digit: the joints and the tip, the radii there, and the directions that the links' pads face, across the bones.
#[derive(Clone, Copy, Debug)]
pub(super) struct Links {
    pub(super) points: [Vec3; 4],
    pub(super) radii: [f32; 4],
    pub(super) pads: [Vec3; 3],
}

/// Where a vertex is beside a link.
struct Beside {
    link: usize,
    /// From the bone.
    across: Vec3,
}

impl Links {
    /// The radii of the three joints that fit the vertices on the palmar side best, if the bones lie near the back.
    pub(super) fn fitted(&self, vertices: &[Vec3]) -> [f32; 3] {
        let weighted = OF_LINKS.weighted(vertices, |vertex| {
            let Beside { link, across } = self.nearest(vertex)?;
            Some((across.normalize_or_zero(), self.pads[link]))
        });
        let [first, second, third, tip] = self.radii;
        if weighted.len() < FEWEST || self.toward_pads(vertices) < NEAR_BACK {
            return [first, second, third];
        }
        let error = |[first, second, third]: [f32; 3]| {
            OF_LINKS.error(&weighted, &link_solids(self.points, [first, second, third, tip]))
        };
        let mut fit = Fit {
            values: [first, second, third],
            ranges: [first, second, third].map(|radius| RADII.map(|share| share * radius)),
            least: error([first, second, third]),
        };
        for step in STEPS {
            for _ in 0..ROUNDS {
                if !fit.improve(step, |place, fit, step| fit.values[place] * (1.0 + step), error) {
                    break;
                }
            }
        }
        fit.values
    }

    /// How far the skin of the two outer links is on the pads' side of the bones, as a share of its distance from them.
    fn toward_pads(&self, vertices: &[Vec3]) -> f32 {
        let (mut toward, mut distance) = (0.0, 0.0);
        for Beside { link, across } in vertices.iter().filter_map(|&vertex| self.nearest(vertex)) {
            if link > 0 {
                toward += across.dot(self.pads[link]);
                distance += across.length();
            }
        }
        toward / distance.max(f32::MIN_POSITIVE)
    }

    /// The link that a vertex is beside and nearest to; `None` if it is beyond the links.
    fn nearest(&self, vertex: Vec3) -> Option<Beside> {
        let of_link = |link: usize| {
            let (start, end) = (self.points[link], self.points[link + 1]);
            let (axis, length) = ((end - start).normalize_or(Vec3::Y), start.distance(end));
            let offset = vertex - start;
            let share = offset.dot(axis) / length;
            let from = if link == 0 { ENDS[0] } else { -0.1 };
            let to = if link == 2 { ENDS[1] } else { 1.1 };
            let across = offset.reject_from_normalized(axis);
            (from..to).contains(&share).then_some(Beside { link, across })
        };
        let beside = (0..3).filter_map(of_link);
        beside.min_by(|a, b| a.across.length().total_cmp(&b.across.length()))
    }
}

/// Ranges of a last link's slopes toward the pad and to the side, and of the tip's radius as a multiple of the measured one.
const TIP_RANGES: [[f32; 2]; 3] = [[-0.3, 0.3], [-0.15, 0.15], [0.6, 1.4]];

/// Share of the link's length from which vertices count: nearer to the joint, the skin is also that of the link before.
const OUTER: f32 = 0.3;

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
        let weighted = OF_TIP.weighted(vertices, |vertex| {
            let offset = vertex - self.start;
            let to_side = offset.reject_from_normalized(along).normalize_or_zero();
            (offset.dot(along) > OUTER * length).then_some((to_side, self.pad))
        });
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
        let error = |fit: [f32; 3]| OF_TIP.error(&weighted, &[self.solid(tip(fit))]);
        let mut fit = Fit {
            values: [0.0, 0.0, 1.0],
            ranges: TIP_RANGES,
            least: error([0.0, 0.0, 1.0]),
        };
        let mut step = 0.5;
        while step > 0.01 {
            let changed = |place: usize, fit: &Fit, step: f32| {
                let [min, max] = fit.ranges[place];
                fit.values[place] + 0.5 * step * (max - min)
            };
            if !fit.improve(step, changed, error) {
                step *= 0.5;
            }
        }
        tip(fit.values)
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

    #[test]
    fn the_pads_count_where_bones_lie_near_the_back() {
        let points = [0.0, 0.04, 0.065, 0.088].map(|y| Vec3::new(0.0, y, 0.0));
        let links = Links {
            points,
            radii: [0.009, 0.008, 0.007, 0.006],
            pads: [Vec3::Z; 3],
        };
        // A tube of 8 mm around a line that is 3 mm on the pads' side of the bones.
        let vertices: Vec<Vec3> = (0..60)
            .flat_map(|ring| {
                (0..24).map(move |turn| {
                    let angle = std::f32::consts::TAU * turn as f32 / 24.0;
                    Vec3::new(
                        0.008 * angle.sin(),
                        0.0013 * ring as f32,
                        0.003 + 0.008 * angle.cos(),
                    )
                })
            })
            .collect();
        let fitted = links.fitted(&vertices);
        for radius in fitted {
            assert!((0.0095..0.0115).contains(&radius), "{fitted:?}");
        }
        let centred: Vec<Vec3> = vertices.iter().map(|vertex| vertex - 0.003 * Vec3::Z).collect();
        for skin in [&centred[..], &[]] {
            assert_eq!(links.fitted(skin), [0.009, 0.008, 0.007]);
        }
    }

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
