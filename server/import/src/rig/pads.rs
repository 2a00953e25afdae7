//! Fits the widths of a digit's links to its palmar side, where grasps touch.
//!
//! Bones of drawn hands often lie nearer to the back of a finger than to its pad, so that the median distance to the skin would
//! leave pads in the air.

use glam::Vec3;
use grasp_synthesis::physical::solids::link_solids;

/// Cosines to the pad's direction at which vertices start to count, and from which they count fully.
const PAD_COSINES: [f32; 2] = [-0.3, 0.7];

/// Shares of the first link's length before which the skin is that of the palm, and of the last link's beyond which it is that of
/// the tip.
const ENDS: [f32; 2] = [0.3, 0.85];

/// Share of its distance from the bones that the skin is on the pads' side of them, from which bones lie near the back: those of
/// the built-in hands have 0.1, and those of hands that this is for 0.3 to 0.6.
const NEAR_BACK: f32 = 0.2;

/// Most vertices that are compared.
const MAX_VERTICES: usize = 500;

/// Fewest vertices for a fit.
const FEWEST: usize = 12;

/// Distances in metres beyond which a vertex counts no more than at it: wrinkles and strays.
const FARTHEST: f32 = 0.004;

/// Smallest and largest radius as a multiple of the measured one.
const RANGE: [f32; 2] = [0.6, 1.8];

/// Steps of the search, as shares of a radius.
const STEPS: [f32; 5] = [0.2, 0.1, 0.05, 0.025, 0.0125];

/// Rounds over all radii at each step.
const ROUNDS: usize = 6;

/// The links of a digit: the joints and the tip, the radii there, and the directions that the links' pads face, across the bones.
#[derive(Clone, Copy, Debug)]
pub(super) struct Links {
    pub(super) points: [Vec3; 4],
    pub(super) radii: [f32; 4],
    pub(super) pads: [Vec3; 3],
}

impl Links {
    /// The radii of the three joints that fit the vertices on the palmar side best, if the bones lie near the back.
    pub(super) fn fitted(&self, vertices: &[Vec3]) -> [f32; 3] {
        let every = vertices.len().div_ceil(MAX_VERTICES).max(1);
        let weighted = vertices.iter().step_by(every);
        let weighted: Vec<(Vec3, f32)> = weighted
            .filter_map(|&vertex| Some((vertex, self.weight(vertex)?)))
            .collect();
        let [first, second, third, tip] = self.radii;
        let mut radii = [first, second, third];
        if weighted.len() < FEWEST || self.toward_pads(vertices) < NEAR_BACK {
            return radii;
        }
        let error = |[first, second, third]: [f32; 3]| {
            let solids = link_solids(self.points, [first, second, third, tip]);
            let of_vertex = |&(vertex, weight): &(Vec3, f32)| {
                let distances = solids.iter().map(|solid| solid.signed_distance(vertex));
                let distance = distances.fold(f32::INFINITY, f32::min);
                weight * distance.abs().min(FARTHEST).powi(2)
            };
            weighted.iter().map(of_vertex).sum::<f32>()
        };
        let mut least = error(radii);
        for step in STEPS {
            for _ in 0..ROUNDS {
                let before = least;
                for place in 0..3 {
                    for factor in [1.0 + step, 1.0 - step] {
                        let [min, max] = RANGE.map(|share| share * self.radii[place]);
                        let mut tried = radii;
                        tried[place] = (radii[place] * factor).clamp(min, max);
                        let tried_error = error(tried);
                        if tried_error < least {
                            (radii, least) = (tried, tried_error);
                        }
                    }
                }
                if least >= before {
                    break;
                }
            }
        }
        radii
    }

    /// How far the skin of the two outer links is on the pads' side of the bones, as a share of its distance from them.
    fn toward_pads(&self, vertices: &[Vec3]) -> f32 {
        let outer = vertices.iter().filter_map(|&vertex| self.nearest(vertex));
        let (toward, distance) =
            outer
                .filter(|&(_, link)| link > 0)
                .fold((0.0, 0.0), |(toward, distance), (across, link)| {
                    (toward + across.dot(self.pads[link]), distance + across.length())
                });
        toward / distance.max(f32::MIN_POSITIVE)
    }

    /// The offset of a vertex from the link that it is beside and nearest to; `None` if it is beyond the links.
    fn nearest(&self, vertex: Vec3) -> Option<(Vec3, usize)> {
        let of_link = |link: usize| {
            let (start, end) = (self.points[link], self.points[link + 1]);
            let (axis, length) = ((end - start).normalize_or(Vec3::Y), start.distance(end));
            let offset = vertex - start;
            let share = offset.dot(axis) / length;
            let from = if link == 0 { ENDS[0] } else { -0.1 };
            let to = if link == 2 { ENDS[1] } else { 1.1 };
            (from..to)
                .contains(&share)
                .then_some((offset.reject_from_normalized(axis), link))
        };
        let beside = (0..3).filter_map(of_link);
        beside.min_by(|a, b| a.0.length().total_cmp(&b.0.length()))
    }

    /// How much a vertex counts; `None` if it is beside the back of a link, or beyond the links.
    fn weight(&self, vertex: Vec3) -> Option<f32> {
        let (across, link) = self.nearest(vertex)?;
        let cosine = across.normalize_or_zero().dot(self.pads[link]);
        let [least, most] = PAD_COSINES;
        let weight = ((cosine - least) / (most - least)).clamp(0.0, 1.0);
        (weight > 0.0).then_some(weight)
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
}
