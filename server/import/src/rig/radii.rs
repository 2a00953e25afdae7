//! How far the skin is from the joints, measured on the vertices that follow each bone.
//!
//! Medians are used throughout, so that nails, rings, seams and single stray vertices do not count.

use glam::{Quat, Vec3};
use grasp_synthesis::model::hand::{
    joints::{JOINT_COUNT, index},
    rig::Rig,
};

use super::{
    RigSource,
    fit::{LastLink, Links, Tip},
    rest::Skeleton,
};

/// The part of a bone's length on either side of a joint in which vertices count to the joint.
const NEAR_JOINT: f32 = 0.3;

/// The part of the last bone that shows the width of a fingertip.
const TIP_BAND: [f32; 2] = [0.35, 0.85];

/// Width of a fingertip relative to its last joint, as in the built-in rigs: where the search for it starts.
const TIP_SHARE: f32 = 0.84;

/// Largest width of a finger at its knuckle relative to its second joint; the built-in rigs have 1.1 to 1.2.
const KNUCKLE_SHARE: f32 = 1.3;

/// Distances from the middle of the palm within which vertices show its depth, as multiples of the reference's depth.
const PALM_AROUND: [f32; 3] = [0.5, 0.8, 1.2];

/// Fewest vertices for a width.
const FEWEST: usize = 4;

/// How much longer than expected a last bone may be; vertices farther out are strays, or long nails.
const MAX_TIP_RATIO: f32 = 1.5;

/// The largest radius that counts, as a multiple of the reference's in a hand of the same size, and the smallest.
const RADIUS_RANGE: [f32; 2] = [0.25, 3.0];

/// A vertex in the wrist's frame of a right hand, with the joint that moves it most, as an `OpenXR` index.
#[derive(Clone, Copy, Debug)]
pub(super) struct SkinVertex {
    pub(super) joint: usize,
    pub(super) position: Vec3,
}

/// Distances from joints to the skin, and fingertips on the skin.
#[derive(Clone, Debug)]
pub(super) struct Widths {
    /// By `OpenXR` index, in metres.
    pub(super) radii: [f32; JOINT_COUNT],
    /// Where the skin ends; `None` where no skin shows it.
    pub(super) tips: [Option<Vec3>; 5],
    /// False for radii that no skin shows, which are the reference's.
    pub(super) is_shown: [bool; JOINT_COUNT],
}

impl Widths {
    /// Of a hand whose radii are known.
    pub(super) fn given(radii: [f32; JOINT_COUNT]) -> Self {
        Self {
            radii,
            tips: [None; 5],
            is_shown: [true; JOINT_COUNT],
        }
    }

    /// Scaled, and then as given, for a rig with this source.
    pub(super) fn changed(mut self, source: &RigSource<'_>) -> Self {
        for (radius, given) in self.radii.iter_mut().zip(source.radii) {
            *radius = given.unwrap_or(*radius * source.width_scale);
        }
        self
    }

    /// Measures a skin. Where it has too few vertices, the reference's widths count, scaled like the rest of the digit.
    pub(super) fn of(skin: &[SkinVertex], skeleton: &Skeleton, reference: &Rig) -> Self {
        let mut widths = Self {
            is_shown: [false; JOINT_COUNT],
            ..Self::given(reference.joint_radii.map(|radius| radius * skeleton.size))
        };
        if skin.is_empty() {
            return widths;
        }
        for digit in (0..5).filter(|&digit| skeleton.has[digit]) {
            widths.measure_digit(digit, skin, skeleton, reference);
        }
        widths.measure_palm(skin, skeleton);
        widths
    }

    fn measure_digit(&mut self, digit: usize, skin: &[SkinVertex], skeleton: &Skeleton, reference: &Rig) {
        let tip = index::TIP_OF_DIGIT[digit];
        let base = tip - 3;
        let of_joint = |joint: usize| {
            let is_own = move |own: usize| own == joint || joint + 1 == tip && own == tip;
            skin.iter()
                .filter(move |vertex| is_own(vertex.joint))
                .map(|vertex| vertex.position)
        };
        let end = skin_end(of_joint(tip - 1), skeleton.joints[tip - 1], skeleton.joints[tip]);
        self.tips[digit] = end;
        let mut points = [0, 1, 2, 3].map(|place| skeleton.joints[base + place]);
        points[3] = end.unwrap_or(points[3]);
        let mut measured = [None; 4];
        for place in 0..3_usize {
            // The thumb's first joint is deep in the palm.
            if digit == 0 && place == 0 {
                continue;
            }
            // The ball of the thumb is no part of the finger that bends at its second joint.
            let first = usize::from(digit == 0);
            let links = place.saturating_sub(1).max(first)..=place;
            let distances = links.flat_map(|link| {
                let (start, end) = (points[link], points[link + 1]);
                let length = start.distance(end);
                let window = NEAR_JOINT * length;
                let joint = points[place];
                of_joint(base + link).filter_map(move |vertex| {
                    let axis = (end - start).normalize_or(Vec3::Y);
                    let along = (vertex - joint).dot(axis);
                    (along.abs() < window).then(|| (vertex - start).reject_from_normalized(axis).length())
                })
            });
            measured[place] = median(distances.collect(), FEWEST);
        }
        let around = measured[2].unwrap_or(self.radii[tip - 1]);
        measured[3] = tip_radius(of_joint(tip - 1), [points[2], points[3]], around);
        let expected = [0, 1, 2, 3].map(|place| self.radii[base + place]);
        for place in 0..4 {
            let [least, most] = RADIUS_RANGE.map(|share| share * expected[place]);
            measured[place] = measured[place].filter(|radius| (least..=most).contains(radius));
        }
        // Flesh of the palm that follows a finger is no part of it.
        if let [Some(knuckle), Some(second), ..] = &mut measured {
            *knuckle = knuckle.min(KNUCKLE_SHARE * *second);
        }
        // Segments without skin are as thick, relative to the reference, as those with skin.
        let ratios = measured.iter().zip(expected);
        let ratios = ratios.filter_map(|(radius, expected)| Some((*radius)? / expected));
        let ratio = median(ratios.collect(), 1).unwrap_or(1.0);
        for place in 0..4 {
            self.radii[base + place] = measured[place].unwrap_or(ratio * expected[place]);
            self.is_shown[base + place] = measured[place].is_some();
        }
        let at_base = reference.digits[digit].wrist_from_base.orientation;
        let pad = |along: Vec3| Quat::from_rotation_arc(at_base * Vec3::Y, along) * (at_base * Vec3::Z);
        let outer: Vec<Vec3> = of_joint(tip - 1).collect();
        let all: Vec<Vec3> = (base..tip).flat_map(of_joint).collect();
        let links = Links {
            points,
            radii: [0, 1, 2, 3].map(|place| self.radii[base + place]),
            pads: [0, 1, 2].map(|link| pad((points[link + 1] - points[link]).normalize_or(Vec3::Y))),
        };
        let fitted = links.fitted(&all);
        self.radii[base] = fitted[0].min(KNUCKLE_SHARE * fitted[1]);
        self.radii[base + 1..tip].copy_from_slice(&fitted[1..]);
        // Once along the bone, and once along the link that fits, which ends elsewhere.
        for _ in 0..2 {
            let Some(end) = self.tips[digit] else { break };
            let along = (end - points[2]).normalize_or(Vec3::Y);
            let link = LastLink {
                start: points[2],
                start_radius: self.radii[tip - 1],
                tip: Tip {
                    end,
                    radius: self.radii[tip],
                },
                pad: pad(along),
            };
            let fitted = link.fitted(&outer);
            self.is_shown[tip] |= fitted != link.tip;
            self.radii[tip] = fitted.radius;
            let end = skin_end(outer.iter().copied(), points[2], fitted.end);
            self.tips[digit] = Some(end.unwrap_or(fitted.end));
        }
    }

    fn measure_palm(&mut self, skin: &[SkinVertex], skeleton: &Skeleton) {
        for joint in index::FIRST_OF_DIGIT.into_iter().chain([index::WRIST]) {
            let distances = skin
                .iter()
                .map(|vertex| vertex.position.distance(skeleton.joints[joint]));
            let mut distances: Vec<f32> = distances.collect();
            // A few stray vertices inside do not count.
            let place = FEWEST.min(distances.len()) - 1;
            let (_, &mut nearest, _) = distances.select_nth_unstable_by(place, f32::total_cmp);
            self.set_palm_radius(joint, nearest);
        }
        let middle = index::FIRST_OF_DIGIT[2];
        let palm = skeleton.joints[middle].midpoint(skeleton.joints[middle + 1]);
        // Coarse skins have few vertices there.
        let depth = PALM_AROUND.iter().find_map(|around| {
            let around = around * self.radii[index::PALM];
            let offsets = skin.iter().map(|vertex| vertex.position - palm);
            let depths = offsets.filter(|offset| offset.truncate().length() < around && offset.z > 0.0);
            median(depths.map(|offset| offset.z).collect(), FEWEST)
        });
        if let Some(depth) = depth {
            self.set_palm_radius(index::PALM, depth);
        }
    }

    fn set_palm_radius(&mut self, joint: usize, radius: f32) {
        let [least, most] = RADIUS_RANGE.map(|share| share * self.radii[joint]);
        if (least..=most).contains(&radius) {
            self.radii[joint] = radius;
            self.is_shown[joint] = true;
        }
    }
}

/// The radius of the sphere that ends a last bone: the solid between it and the joint lies on the skin in the median.
fn tip_radius(vertices: impl Iterator<Item = Vec3>, [start, end]: [Vec3; 2], at_joint: f32) -> Option<f32> {
    let axis = (end - start).normalize_or(Vec3::Y);
    let length = start.distance(end);
    let band = TIP_BAND.map(|share| share * length);
    let around = vertices.map(|vertex| {
        let offset = vertex - start;
        (offset.dot(axis), offset.reject_from_normalized(axis).length())
    });
    let around: Vec<(f32, f32)> = around
        .filter(|(along, _)| (band[0]..band[1]).contains(along))
        .collect();
    let mut radius = TIP_SHARE * at_joint;
    for _ in 0..4 {
        let axis_length = (length - radius).max(0.3 * length);
        let cylinder = around.iter().filter(|(along, _)| *along < axis_length);
        let of_vertex =
            |&(along, distance): &(f32, f32)| at_joint + (distance - at_joint) * axis_length / along;
        radius = median(cylinder.map(of_vertex).collect(), FEWEST)?;
    }
    Some(radius)
}

/// Where the skin of the last bone ends toward the expected end; `None` if too few vertices follow it.
fn skin_end(vertices: impl Iterator<Item = Vec3>, start: Vec3, expected: Vec3) -> Option<Vec3> {
    let bone = expected - start;
    let (direction, length) = (bone.normalize_or(Vec3::Y), bone.length());
    let outer: Vec<f32> = vertices
        .filter(|vertex| (vertex - start).reject_from_normalized(direction).length() < length)
        .map(|vertex| (vertex - start).dot(direction))
        .filter(|along| (0.4 * length..MAX_TIP_RATIO * length).contains(along))
        .collect();
    if outer.len() < FEWEST {
        return None;
    }
    let end = outer.into_iter().fold(0.0, f32::max);
    Some(start + end * direction)
}

/// The median of numbers, if there are at least as many as a number that is not zero.
pub(super) fn median(mut numbers: Vec<f32>, fewest: usize) -> Option<f32> {
    let middle = numbers.len() / 2;
    (numbers.len() >= fewest).then(|| *numbers.select_nth_unstable_by(middle, f32::total_cmp).1)
}
