//! Which joints the named nodes of a hand's digits are.
//!
//! Words such as "proximal" say it. Numbers do not: the first of four may be the bone in the palm or the first that bends, and then
//! the fourth is the last bone or the tip. Where they lie says which.

use std::collections::BTreeMap;

use glam::DVec3;
use grasp_synthesis::model::hand::{
    Digit,
    joints::{JOINT_COUNT, index},
};

use super::{
    hand_nodes::{HandNodes, digit_name, is_required, joints_of, shortened},
    model::Model,
    names::Segment,
};
use crate::error::ImportError;

/// Distance from the wrist to a finger's first bone relative to that bone's length: below the first, the bone is in the palm, and
/// above the second, it bends. Hands have 0.4 to 0.6 and 1.9 to 2.6, and those of cartoons at least 1.3.
const IN_PALM: [f64; 2] = [0.9, 1.2];

/// The same for three bones, of which the first is hardly ever in the palm.
const THIRD_IN_PALM: f64 = 0.6;

/// Most numbered bones of a digit that are looked at.
const MAX_BONES: usize = 6;

/// Difference of two leaves' turns from the last bone, in radians, up to which both may continue it.
const ALMOST_STRAIGHT: f64 = 0.2;

/// Fewest vertices that show that a bone moves a fingertip.
const FEWEST: usize = 4;

/// The bones of a hand's digits by name.
#[derive(Debug, Default)]
pub(super) struct NamedDigits([Vec<(usize, Segment)>; 5]);

/// A finger with four bones, of which it is not clear whether the first is in the palm or the last is the tip.
#[derive(Debug)]
pub(super) struct UnclearFinger {
    pub(super) digit: usize,
    pub(super) violation: ImportError,
}

/// The numbered bones of a digit in their order, and others that names tell.
#[derive(Debug, Default)]
struct Numbered {
    metacarpal: Option<usize>,
    /// By number; `None` where a number is missing.
    bones: Vec<Option<usize>>,
    /// True if the first one has the number 0.
    from_zero: bool,
    tips: Vec<usize>,
}

impl NamedDigits {
    /// Adds a node. Of several with the same name, the first counts.
    pub(super) fn push(&mut self, digit: Digit, segment: Segment, node: usize) {
        self.0[digit.index()].push((node, segment));
    }

    /// All nodes.
    pub(super) fn nodes(&self) -> impl Iterator<Item = usize> {
        self.0.iter().flatten().map(|&(node, _)| node)
    }

    /// Adds the joints of digits that lack some, unless others are other nodes than names say. Gives the fingers that are unclear.
    pub(super) fn complete(
        &self,
        model: &Model,
        HandNodes { side, joints }: &mut HandNodes,
    ) -> Vec<UnclearFinger> {
        let wrist = joints[index::WRIST];
        let lacks =
            |digit: usize| joints_of(digit).any(|joint| is_required(joint) && joints[joint].is_none());
        let lacking = [0, 1, 2, 3, 4].map(lacks);
        let mut numbered: Vec<(usize, Numbered)> = Vec::new();
        let mut named = [None; JOINT_COUNT];
        for digit in (0..5).filter(|&digit| lacking[digit]) {
            if self.is_in_words(digit) {
                self.by_words(digit, &mut named);
            } else {
                numbered.push((digit, self.numbered(model, digit)));
            }
        }
        let fingers = numbered.iter().filter(|(digit, _)| *digit > 0);
        let starts_in_palm = starts_in_palm(model, wrist, fingers.map(|(_, bones)| bones));
        let mut unclear = Vec::new();
        for (digit, numbered) in &numbered {
            let bones = if *digit == 0 {
                numbered.of_thumb(model)
            } else if numbered.is_unclear() && starts_in_palm.is_none() {
                let bones = numbered.bones.iter().flatten();
                let names = bones.map(|&node| format!("{:?}", shortened(&model.names[node])));
                let what = format!(
                    "has four bones, {}, and neither their places nor the skin tell whether the first is in the palm or the last is \
                     the tip; say which joints they are in joint_map",
                    names.collect::<Vec<_>>().join(", ")
                );
                unclear.push(UnclearFinger {
                    digit: *digit,
                    violation: ImportError::at(digit_name(*side, *digit), what),
                });
                continue;
            } else {
                numbered.of_finger(model, wrist, starts_in_palm == Some(true))
            };
            let first = index::TIP_OF_DIGIT[*digit] - 4;
            for (place, node) in bones.into_iter().enumerate() {
                // The thumb has no bone before its metacarpal.
                if *digit > 0 || place > 0 {
                    named[first + place] = node;
                }
            }
        }
        for digit in (0..5).filter(|&digit| lacking[digit]) {
            let tip = index::TIP_OF_DIGIT[digit];
            if named[tip].is_none() {
                named[tip] = self.tip(model, digit, [named[tip - 2], named[tip - 1]]);
            }
            let agrees = |joint: usize| joints[joint].is_none() || joints[joint] == named[joint];
            let is_open = joints_of(digit).all(|joint| joints[joint].is_none());
            if joints_of(digit).all(agrees) {
                for joint in joints_of(digit).filter(|&joint| is_open || is_required(joint)) {
                    joints[joint] = named[joint];
                }
            }
        }
        unclear
    }

    /// True if words name a digit's segments.
    fn is_in_words(&self, digit: usize) -> bool {
        let words = [Segment::Proximal, Segment::Intermediate, Segment::Distal];
        self.0[digit].iter().any(|(_, segment)| words.contains(segment))
    }

    /// The nodes of a digit that are a segment.
    fn with(&self, digit: usize, segment: Segment) -> impl Iterator<Item = usize> {
        let nodes = self.0[digit].iter().filter(move |(_, other)| *other == segment);
        nodes.map(|&(node, _)| node)
    }

    fn by_words(&self, digit: usize, joints: &mut [Option<usize>; JOINT_COUNT]) {
        let (first, tip) = (index::FIRST_OF_DIGIT[digit], index::TIP_OF_DIGIT[digit]);
        let node = |segment| self.with(digit, segment).next();
        // A thumb with the names of a finger is as in Unity's humanoid.
        let is_finger = node(Segment::Metacarpal).is_none() && node(Segment::Intermediate).is_some();
        let [metacarpal, proximal] = if digit > 0 || is_finger {
            [first, tip - 3]
        } else {
            [tip - 3, tip - 2]
        };
        for (segment, joint) in [
            (Segment::Metacarpal, metacarpal),
            (Segment::Intermediate, tip - 2),
            (Segment::Proximal, proximal),
            (Segment::Distal, tip - 1),
        ] {
            joints[joint] = node(segment).or(joints[joint]);
        }
    }

    /// The tip with a name: below the last bone or, where nodes are next to one another, not below another bone.
    fn tip(&self, model: &Model, digit: usize, last: [Option<usize>; 2]) -> Option<usize> {
        let distal = last[1];
        let places = last.map(|node| node.map_or(DVec3::NAN, |node| model.place(node)));
        let turn = |tip: usize| (places[1] - places[0]).angle_between(model.place(tip) - places[1]);
        let is_bone = |&node: &usize| {
            let is_own = |&(other, segment): &(usize, Segment)| other == node && segment != Segment::Tip;
            self.0[digit].iter().any(is_own)
        };
        let below_last = self.with(digit, Segment::Tip).filter(|&tip| {
            let above = model.with_ancestors(tip).find(is_bone);
            above.is_none() || above == distal
        });
        let tips: Vec<(usize, f64)> = below_last.map(|tip| (tip, turn(tip))).collect();
        // Of several leaves, one that continues the bone.
        let least = tips.iter().map(|&(_, turn)| turn).fold(f64::INFINITY, f64::min);
        let straight = tips
            .into_iter()
            .filter(|&(_, turn)| turn.is_nan() || turn <= least + ALMOST_STRAIGHT);
        straight.map(|(tip, _)| tip).min_by_key(|&tip| model.depth(tip))
    }

    fn numbered(&self, model: &Model, digit: usize) -> Numbered {
        let mut by_number = BTreeMap::new();
        for &(node, segment) in &self.0[digit] {
            if let Segment::Number(number) = segment {
                by_number.entry(number).or_insert(node);
            }
        }
        let lowest = by_number.keys().next().copied();
        let highest = by_number.keys().last().copied().unwrap_or(0);
        let numbers = (lowest.unwrap_or(0)..=highest).take(MAX_BONES);
        let mut bones: Vec<Option<usize>> = numbers.map(|number| by_number.get(&number).copied()).collect();
        // The one without a number comes before the others, if it is a bone and not what holds them together.
        let unnumbered = self.with(digit, Segment::Unnumbered).find(|&node| {
            let is_above = |&first: &usize| model.with_ancestors(first).any(|above| above == node);
            model.is_bound(node) && bones.iter().flatten().next().is_some_and(is_above)
        });
        if unnumbered.is_some() {
            bones.insert(0, unnumbered);
        }
        Numbered {
            metacarpal: self.with(digit, Segment::Metacarpal).next(),
            bones,
            from_zero: lowest == Some(0) && unnumbered.is_none(),
            tips: self.with(digit, Segment::Tip).collect(),
        }
    }
}

impl Numbered {
    /// True if its four bones may start in the palm or with the first that bends.
    fn is_unclear(&self) -> bool {
        self.metacarpal.is_none() && self.bones.len() == 4 && !self.from_zero
    }

    /// Metacarpal, the three bones that bend, and tip of a finger.
    fn of_finger(&self, model: &Model, wrist: Option<usize>, starts_in_palm: bool) -> [Option<usize>; 5] {
        let starts_in_palm = match self.bones.len() {
            _ if self.metacarpal.is_some() => false,
            0..=2 => false,
            3 => wrist
                .and_then(|wrist| from_wrist(model, wrist, &self.bones))
                .is_some_and(|distance| distance < THIRD_IN_PALM),
            4 => self.from_zero || starts_in_palm,
            _ => true,
        };
        let mut bones = self.bones.iter().copied();
        let mut next = || bones.next().flatten();
        let metacarpal = if starts_in_palm { next() } else { self.metacarpal };
        [metacarpal, next(), next(), next(), next()]
    }

    /// Bone of the wrist, metacarpal, the two bones that bend, and tip of a thumb.
    fn of_thumb(&self, model: &Model) -> [Option<usize>; 5] {
        let own = self.metacarpal.map(Some);
        let bones: Vec<Option<usize>> = own.into_iter().chain(self.bones.iter().copied()).collect();
        // Quest's thumb has a bone of the wrist, and counts it as 0.
        let moves_tip = |node: usize| !self.tips.is_empty() && model.moved_by(node) >= FEWEST;
        let has_carpal = match bones[..] {
            [_, _, _, last] => self.from_zero || last.is_some_and(moves_tip),
            _ => bones.len() > 4,
        };
        let mut bones = bones.into_iter();
        let mut next = || bones.next().flatten();
        let carpal = if has_carpal { next() } else { None };
        [carpal, next(), next(), next(), next()]
    }
}

/// Whether the first of four numbered bones is in the palm; `None` if that is ambiguous.
fn starts_in_palm<'a>(
    model: &Model,
    wrist: Option<usize>,
    fingers: impl Iterator<Item = &'a Numbered>,
) -> Option<bool> {
    let fingers: Vec<&Numbered> = fingers.filter(|finger| finger.is_unclear()).collect();
    let distances = fingers
        .iter()
        .filter_map(|finger| from_wrist(model, wrist?, &finger.bones));
    let distances: Vec<f64> = distances.collect();
    let mean = distances.iter().sum::<f64>() / distances.len() as f64;
    if mean < IN_PALM[0] {
        return Some(true);
    } else if mean > IN_PALM[1] {
        return Some(false);
    }
    let moves_tip = |finger: &&Numbered| finger.bones[3].is_some_and(|last| model.moved_by(last) >= FEWEST);
    let count = fingers.iter().copied().filter(|finger| moves_tip(finger)).count();
    if count == fingers.len() {
        Some(true)
    } else if count == 0 && fingers.iter().all(|finger| finger.tips.is_empty()) {
        Some(false)
    } else {
        None
    }
}

/// The distance of a finger's first bone from the wrist, as a multiple of the bone's length.
fn from_wrist(model: &Model, wrist: usize, bones: &[Option<usize>]) -> Option<f64> {
    let [first, second] = [0, 1].map(|bone| bones.get(bone).copied().flatten());
    let [first, second] = [model.place(first?), model.place(second?)];
    let length = first.distance(second);
    let distance = model.place(wrist).distance(first) / length;
    let is_place = |place: DVec3| place.is_finite();
    (is_place(first) && is_place(second) && length > 0.0 && distance.is_finite()).then_some(distance)
}
