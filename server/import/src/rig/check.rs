//! Whether the bones of a hand lie in the skin that they move, and which parts have no skin.

use glam::Vec3;
use grasp_synthesis::model::hand::{
    Handedness,
    joints::{JOINT_COUNT, JOINT_NAMES, index},
};

use super::{
    RigSource,
    hand_nodes::{digit_name, hand_name, joint_name},
    radii::{SkinVertex, Widths, median},
    rest::{Skeleton, base_of},
};
use crate::error::Violations;

/// Mean distances of the knuckles from the wrist relative to the bones after them (hands have 1.9 to 2.6, those of cartoons at
/// least 1.2): below the first, they are joints in the palm; beyond the second and third, they may be others.
const KNUCKLES: [f32; 3] = [0.6, 0.9, 4.0];

/// Sums of a finger's bends in the bind pose, in radians, from which widths are less certain, and from which they are not shown.
const BENDS: [f32; 2] = [1.4, 2.6];

/// Fewest vertices around a bone that tell where its skin is.
const FEWEST: usize = 12;

/// Distance of a bone from the middle of its skin, as a multiple of the skin's median radius, from which it is outside, …
const OUTSIDE: f32 = 1.0;

/// … and from which it is the bone of something else.
const ELSEWHERE: f32 = 2.5;

/// A hand that was read.
pub(super) struct HandCheck<'a> {
    pub(super) side: Handedness,
    /// Which joints the model has.
    pub(super) has: [bool; JOINT_COUNT],
    pub(super) skeleton: &'a Skeleton,
    pub(super) widths: &'a Widths,
    pub(super) skin: &'a [SkinVertex],
    pub(super) source: &'a RigSource<'a>,
}

impl HandCheck<'_> {
    /// Adds a warning for what is odd and for what was taken from the reference, and a violation for what is wrong.
    pub(super) fn check(&self, warnings: &mut Vec<String>, violations: &mut Violations) -> Option<()> {
        let before = violations.len();
        self.check_knuckles(warnings, violations);
        self.check_bends(warnings, violations);
        for digit in self.digits() {
            self.check_bones(digit, warnings, violations);
        }
        self.tell_what_is_taken(warnings);
        (violations.len() == before).then_some(())
    }

    fn digits(&self) -> impl Iterator<Item = usize> {
        (0..5).filter(|&digit| self.skeleton.has[digit])
    }

    fn joint(&self, joint: usize) -> Vec3 {
        self.skeleton.joints[joint]
    }

    /// The bone that starts at a joint.
    fn bone(&self, joint: usize) -> Vec3 {
        self.joint(joint + 1) - self.joint(joint)
    }

    /// Bones in the palm that were taken for those that bend, or the converse.
    fn check_knuckles(&self, warnings: &mut Vec<String>, violations: &mut Violations) {
        let knuckles: Vec<usize> = self.digits().skip(1).map(base_of).collect();
        let ratio = |&knuckle: &usize| self.joint(knuckle).length() / self.bone(knuckle).length();
        let mean = knuckles.iter().map(ratio).sum::<f32>() / knuckles.len().max(1) as f32;
        let Some(first) = knuckles.first().copied() else {
            return;
        };
        let [from_wrist, length] = [self.joint(first), self.bone(first)].map(|way| millimetres(way.length()));
        let described = format!(
            "is {from_wrist} from the wrist and {length} from {}",
            JOINT_NAMES[first + 1]
        );
        let place = joint_name(self.side, first);
        let [refused, warned, far] = KNUCKLES;
        if mean < refused {
            let what = format!(
                "{described}, and the other fingers are alike: these are bones in the palm, which do not bend; say which nodes the \
                 joints are in joint_map"
            );
            violations.add(place, what);
        } else if mean < warned || mean > far {
            let other = ["in the palm", "the second ones"][usize::from(mean > far)];
            warnings.push(format!(
                "{place}: {described}, and the other fingers are alike; if these bones are {other}, say which nodes the joints are in \
                 joint_map"
            ));
        }
    }

    /// Fingers that are bent where the skin is bound.
    fn check_bends(&self, warnings: &mut Vec<String>, violations: &mut Violations) {
        for digit in self.digits() {
            let base = base_of(digit);
            let links = [0, 1, 2].map(|link| self.bone(base + link).normalize_or(Vec3::Y));
            // The thumb's first joint is not at the palm.
            let first = if digit == 0 { Vec3::Y } else { links[0] };
            let bend = first.z.atan2(first.y).abs()
                + links[0].angle_between(links[1])
                + links[1].angle_between(links[2]);
            let place = digit_name(self.side, digit);
            let [degrees, most] = [bend, BENDS[1]].map(f32::to_degrees);
            if bend > BENDS[1] && !self.skin.is_empty() {
                let what = format!(
                    "is bent by {degrees:.0}° where the skin is bound, at most {most:.0}° can be measured; bind the skin with the \
                     hand open"
                );
                violations.add(place, what);
            } else if bend > BENDS[0] {
                warnings.push(format!(
                    "{place}: is bent by {degrees:.0}° where the skin is bound, so its widths are less certain"
                ));
            }
        }
    }

    /// Digits without a skin, and bones outside of theirs.
    fn check_bones(&self, digit: usize, warnings: &mut Vec<String>, violations: &mut Violations) {
        let base = base_of(digit);
        let of_digit = |vertex: &&SkinVertex| (base..=base + 3).contains(&vertex.joint);
        if !self.skin.is_empty() && self.skin.iter().filter(of_digit).count() < FEWEST {
            warnings.push(format!(
                "{}: has bones, but they move no skin; what it touches will look untouched",
                digit_name(self.side, digit)
            ));
            return;
        }
        // The thumb's first bone is deep in the palm.
        for link in usize::from(digit == 0)..3 {
            let joint = base + link;
            let (start, bone) = (self.joint(joint), self.bone(joint));
            let (length, axis) = (bone.length(), bone.normalize_or(Vec3::Y));
            let own = self.skin.iter().filter(|vertex| vertex.joint == joint);
            let offsets = own.clone().map(|vertex| vertex.position - start);
            let beside = offsets.filter(|offset| (0.0..length).contains(&offset.dot(axis)));
            let around: Vec<Vec3> = beside.map(|offset| offset.reject_from_normalized(axis)).collect();
            let place = joint_name(self.side, joint);
            let count = own.clone().count();
            // Most of the skin of an outer link is beside it.
            if link > 0 && count >= FEWEST && 4 * around.len() < count {
                let middle = own.map(|vertex| vertex.position).sum::<Vec3>() / count as f32;
                let what = format!(
                    "is {} from the middle of the skin that it moves, nearly all of which is beyond the bone; a bone must lie in its \
                     skin, where the skin is bound",
                    millimetres(middle.distance(start))
                );
                violations.add(place, what);
                continue;
            }
            if around.len() < FEWEST {
                continue;
            }
            let low = around.iter().copied().fold(Vec3::INFINITY, Vec3::min);
            let high = around.iter().copied().fold(Vec3::NEG_INFINITY, Vec3::max);
            let middle = low.midpoint(high);
            let radii = around.iter().map(|offset| offset.distance(middle));
            let radius = median(radii.collect(), 1).unwrap_or(0.0);
            let described = format!(
                "is {} from the middle of the skin that it moves, which is {} thick",
                millimetres(middle.length()),
                millimetres(2.0 * radius)
            );
            if middle.length() > ELSEWHERE * radius {
                let what = format!("{described}; a bone must lie in its skin, where the skin is bound");
                violations.add(place, what);
            } else if middle.length() > OUTSIDE * radius {
                warnings.push(format!("{place}: {described}, so contacts will look as far off"));
            }
        }
    }

    /// Warns of parts that the model does not show.
    fn tell_what_is_taken(&self, warnings: &mut Vec<String>) {
        let (name, reference) = (hand_name(self.side), &self.source.reference.name);
        if self.skin.is_empty() {
            warnings.push(format!(
                "{name}: has no skin, so its widths are those of the rig {reference} at its size"
            ));
        }
        let named = |joints: &mut dyn Iterator<Item = usize>| {
            let names: Vec<&str> = joints.map(|joint| JOINT_NAMES[joint]).collect();
            names.join(", ")
        };
        let metacarpals = self.digits().filter(|&digit| digit > 0);
        let metacarpals = metacarpals.map(|digit| index::FIRST_OF_DIGIT[digit]);
        let absent = named(&mut metacarpals.filter(|&joint| !self.has[joint]));
        if !absent.is_empty() {
            warnings.push(format!(
                "{name}: has no {absent}; placed as in the rig {reference}"
            ));
        }
        let tips = self.digits().map(|digit| (digit, index::TIP_OF_DIGIT[digit]));
        let endless = tips.filter(|&(digit, tip)| !self.has[tip] && self.widths.tips[digit].is_none());
        let endless = named(&mut endless.map(|(_, tip)| tip));
        if !endless.is_empty() {
            warnings.push(format!(
                "{name}: has no {endless}, and no skin that ends there; the last links are as long as those of the rig {reference}, \
                 for the links before them"
            ));
        }
        let of_digits = self.digits().flat_map(|digit| {
            let base = base_of(digit);
            base + usize::from(digit == 0)..=base + 3
        });
        let of_hand = of_digits.chain([index::PALM, index::WRIST]);
        let unknown = |joint: &usize| !self.widths.is_shown[*joint] && self.source.radii[*joint].is_none();
        let unknown = named(&mut of_hand.filter(unknown));
        if !unknown.is_empty() && !self.skin.is_empty() {
            warnings.push(format!(
                "{name}: the skin does not show the width at {unknown}; it is that of the rig {reference}, as much wider as the rest \
                 of the digit or hand"
            ));
        }
    }
}

/// A length in metres, in words.
fn millimetres(metres: f32) -> String {
    format!("{:.1} mm", 1000.0 * metres)
}
