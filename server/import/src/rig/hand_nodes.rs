//! Finds the nodes of a model that are the joints of its hands.

use std::collections::BTreeSet;

use grasp_synthesis::model::hand::{
    Handedness,
    joints::{JOINT_COUNT, JOINT_NAMES, index},
};

use super::{
    MappedJoint, RigSource,
    digits::{NamedDigits, UnclearFinger},
    model::Model,
    names::{self, NodeName},
};
use crate::error::Violations;

/// The nodes of a hand's joints.
#[derive(Clone, Debug)]
pub(super) struct HandNodes {
    pub(super) side: Handedness,
    /// By `OpenXR` index.
    pub(super) joints: [Option<usize>; JOINT_COUNT],
}

impl HandNodes {
    /// A left and a right hand without nodes.
    pub(super) const NONE: [Self; 2] = [Self::of(Handedness::Left), Self::of(Handedness::Right)];

    const fn of(side: Handedness) -> Self {
        let joints = [None; JOINT_COUNT];
        Self { side, joints }
    }

    /// The joint that a node is.
    pub(super) fn joint_of(&self, node: usize) -> Option<usize> {
        self.joints.iter().position(|&other| other == Some(node))
    }

    /// The joint that the nearest of a node and its ancestors is that is a joint.
    pub(super) fn nearest_joint(&self, model: &Model, node: usize) -> Option<usize> {
        model.with_ancestors(node).find_map(|node| self.joint_of(node))
    }
}

/// Joints without which a digit cannot be posed; tips and the fingers' metacarpals are derived, and the palm is no node.
pub(super) fn is_required(joint: usize) -> bool {
    let is_metacarpal = index::FIRST_OF_DIGIT[1..].contains(&joint);
    joint != index::PALM && !index::TIP_OF_DIGIT.contains(&joint) && !is_metacarpal
}

/// Names of the digits, thumb first.
const DIGIT_NAMES: [&str; 5] = [
    "thumb",
    "index finger",
    "middle finger",
    "ring finger",
    "little finger",
];

/// Fewest fingers of a hand.
const FEWEST_FINGERS: usize = 2;

/// The joints of a digit, from its metacarpal to its tip, as `OpenXR` indices.
pub(super) fn joints_of(digit: usize) -> std::ops::RangeInclusive<usize> {
    index::FIRST_OF_DIGIT[digit]..=index::TIP_OF_DIGIT[digit]
}

/// Adds a violation if a hand with these digits, thumb first, can hold nothing.
pub(super) fn check_digits(side: Handedness, has: [bool; 5], violations: &mut Violations) {
    if !has[0] {
        violations.add(
            digit_name(side, 0),
            "is missing; without a thumb, nothing opposes the fingers and no grasp holds. If it is there under other names, \
             give them in joint_map",
        );
    }
    let missing = missing_fingers(has);
    if missing.len() > 4 - FEWEST_FINGERS {
        let missing = missing.join(", ");
        let what = format!(
            "lacks the {missing}; a hand must have a thumb and at least {FEWEST_FINGERS} fingers, because objects turn between two \
             digits. If they are there under other names, give them in joint_map"
        );
        violations.add(hand_name(side), what);
    }
}

/// The names of the fingers that a hand with these digits lacks.
fn missing_fingers(has: [bool; 5]) -> Vec<&'static str> {
    let missing = (1..5).filter(|&digit| !has[digit]);
    missing.map(|digit| DIGIT_NAMES[digit]).collect()
}

/// A hand in words, for messages.
pub(super) fn hand_name(side: Handedness) -> &'static str {
    match side {
        Handedness::Left => "left hand",
        Handedness::Right => "right hand",
    }
}

/// A digit of a hand in words.
pub(super) fn digit_name(side: Handedness, digit: usize) -> String {
    format!("{}, {}", hand_name(side), DIGIT_NAMES[digit])
}

/// A joint of a hand in words.
pub(super) fn joint_name(side: Handedness, joint: usize) -> String {
    format!("{}, {}", hand_name(side), JOINT_NAMES[joint])
}

/// The hands of a model: by the map, by the extension of VRM if there is one, and where that names none of a digit's bones by
/// names. Adds a violation for every required joint that is missing.
pub(super) fn hand_nodes(
    model: &Model,
    vrm: Option<[HandNodes; 2]>,
    source: &RigSource<'_>,
    violations: &mut Violations,
) -> Vec<HandNodes> {
    let side = source.side;
    let has_vrm = vrm.is_some();
    let mut hands = vrm.unwrap_or(HandNodes::NONE);
    let unclear = by_names(model, side, &mut hands);
    for (place, mapped) in source.joint_map.iter().enumerate() {
        let is_of_other_file = source.is_of_pair && mapped.side.is_some() && mapped.side != side;
        if !is_of_other_file {
            apply(model, mapped, place, side, &mut hands, violations);
        }
    }
    for (hand, unclear) in hands.iter().zip(unclear) {
        for UnclearFinger { digit, violation } in unclear {
            let mut joints = joints_of(digit).filter(|&joint| is_required(joint));
            if joints.any(|joint| hand.joints[joint].is_none()) {
                violations.push(violation);
            }
        }
    }
    if violations.len() > 0 {
        return Vec::new();
    }
    for hand in &mut hands {
        if hand.joints[index::WRIST].is_none() {
            let above = ancestors_of_all(model, hand.joints.iter().flatten().copied());
            hand.joints[index::WRIST] = above.into_iter().max_by_key(|&node| model.depth(node));
        }
    }
    let has_digits = |hand: &HandNodes| {
        let count = hand.joints.iter().flatten().count();
        count > usize::from(hand.joints[index::WRIST].is_some())
    };
    let found: Vec<HandNodes> = hands.into_iter().filter(has_digits).collect();
    if found.is_empty() {
        let extension = ["", "names no fingers in its VRM extension, and "][usize::from(has_vrm)];
        violations.add(
            "the model",
            format!(
                "{extension}has no nodes with the names of a hand's joints (WebXR, OpenXR, VRM, Unity, Mixamo, Unreal, MANO and Quest \
                 are known); name them in joint_map, and the hand in handedness if the names do not say which it is"
            ),
        );
    }
    for hand in &found {
        check(model, hand, violations);
    }
    found
}

/// Adds the nodes with the names of joints, of digits that have none. Of several for a joint, those that move a skin come first,
/// then the shallowest. Gives the fingers of each hand of which names do not tell the joints.
fn by_names(model: &Model, side: Option<Handedness>, hands: &mut [HandNodes; 2]) -> [Vec<UnclearFinger>; 2] {
    let named = model.names.iter().enumerate();
    let read = named.filter_map(|(node, name)| Some((node, names::read(name)?)));
    let mut read: Vec<(usize, NodeName)> = read.collect();
    let is_sided = |name: NodeName| name.side.is_some() && name.segment.is_some();
    let has_sides = read.iter().any(|&(_, name)| is_sided(name));
    read.sort_by_cached_key(|&(node, _)| (!model.is_bound(node), model.depth(node), node));
    hands.each_mut().map(|hand| {
        let (mut digits, mut wrists) = (NamedDigits::default(), Vec::new());
        for &(node, name) in &read {
            if (if has_sides { name.side } else { side }) == Some(hand.side) {
                match name.segment {
                    None => wrists.push(node),
                    Some((digit, segment)) => digits.push(digit, segment, node),
                }
            }
        }
        let above = ancestors_of_all(model, digits.nodes());
        // The nearest one above the digits or, in a flat hierarchy, any.
        let named = wrists
            .into_iter()
            .max_by_key(|node| (above.contains(node), model.is_bound(*node), model.depth(*node)));
        hand.joints[index::WRIST] = hand.joints[index::WRIST].or(named);
        digits.complete(model, hand)
    })
}

/// Nodes above all of some others.
fn ancestors_of_all(model: &Model, nodes: impl Iterator<Item = usize>) -> BTreeSet<usize> {
    let above = nodes.map(|node| model.with_ancestors(node).skip(1).collect());
    let common = above.reduce(|common: BTreeSet<usize>, above| &common & &above);
    common.unwrap_or_default()
}

/// Applies one entry of a client's map.
fn apply(
    model: &Model,
    mapped: &MappedJoint,
    place: usize,
    side: Option<Handedness>,
    hands: &mut [HandNodes; 2],
    violations: &mut Violations,
) {
    let place = format!("joint_map[{place}]");
    let shown = shortened(&mapped.node);
    let joint = names::joint_named(&mapped.joint).filter(|&joint| joint != index::PALM);
    let node = model.names.iter().position(|name| *name == mapped.node);
    let named_side = names::read(&mapped.node).and_then(|name| name.side);
    let side = mapped.side.or(side).or(named_side);
    if joint.is_none() {
        let (joint, joints) = (shortened(&mapped.joint), JOINT_NAMES[1..].join(", "));
        let what = format!("maps to {joint:?}, which is no joint; the joints are {joints}");
        violations.add(place.as_str(), what);
    }
    if node.is_none() {
        let what = format!("names the node {shown:?}, which the model does not have");
        violations.add(place.as_str(), what);
    }
    if side.is_none() {
        let what = format!("does not say of which hand {shown:?} is; set its handedness");
        violations.add(place, what);
    }
    if let (Some(joint), Some(node), Some(side)) = (joint, node, side) {
        hands[side as usize].joints[joint] = Some(node);
    }
}

/// The start of a text, for messages.
pub(super) fn shortened(text: &str) -> String {
    text.chars().take(80).collect()
}

/// Adds a violation for every required joint that is missing, and for nodes that are two joints or not below one another.
fn check(model: &Model, hand: &HandNodes, violations: &mut Violations) {
    let name = |joint| joint_name(hand.side, joint);
    let has = [0, 1, 2, 3, 4].map(|digit| hand.joints[joints_of(digit)].iter().any(Option::is_some));
    check_digits(hand.side, has, violations);
    for (joint, node) in hand.joints.iter().enumerate() {
        let is_of_missing = (0..5).any(|digit| !has[digit] && joints_of(digit).contains(&joint));
        if node.is_none() && is_required(joint) && !is_of_missing {
            violations.add(
                name(joint),
                "is missing: no node has its name, although others of the hand or the digit are there. Fingers may be missing \
                 as a whole; if it is there under another name, give that in joint_map",
            );
        }
    }
    check_unknown_fingers(model, hand, has, violations);
    for (place, node) in hand.joints.iter().enumerate() {
        let Some(node) = *node else { continue };
        if let Some(other) = hand.joints[..place].iter().position(|&other| other == Some(node)) {
            let (node, other) = (shortened(&model.names[node]), JOINT_NAMES[other]);
            let what =
                format!("is the node {node:?}, which is {other}, too; each joint needs a node of its own");
            violations.add(name(place), what);
            continue;
        }
        // Of the joints of one digit, none may be below one that is farther out. Flat hierarchies are allowed.
        let above = model.parents[node].and_then(|parent| hand.nearest_joint(model, parent));
        if let Some(above) = above.filter(|&above| !may_be_above(above, place)) {
            let above = JOINT_NAMES[above];
            let what = format!(
                "is below {above}; the joints must form a tree from the wrist to the tips, as in a hand"
            );
            violations.add(name(place), what);
        }
    }
}

/// Adds a violation if fingers are missing and unknown bones below the wrist may be theirs: they would stay stretched, and the
/// drawn finger would go through what the others hold.
fn check_unknown_fingers(model: &Model, hand: &HandNodes, has: [bool; 5], violations: &mut Violations) {
    let missing = missing_fingers(has);
    if missing.is_empty() {
        return;
    }
    let is_unknown = |node: usize| hand.joint_of(node).is_none() && model.is_bound(node);
    // A single bone is a twist or what holds a prop, two in a row are a finger.
    let unknown = (0..model.names.len()).filter(|&node| {
        let is_second = is_unknown(node) && model.parents[node].is_some_and(is_unknown);
        is_second && hand.nearest_joint(model, node) == Some(index::WRIST)
    });
    let unknown = unknown.map(|node| format!("{:?}", shortened(&model.names[node])));
    let unknown: Vec<String> = unknown.take(8).collect();
    if !unknown.is_empty() {
        let place = format!("{}, {}", hand_name(hand.side), missing.join(" and "));
        let what = format!(
            "has no nodes with its names, but there are unknown bones below the wrist: {}; if they are its joints, say which in \
             joint_map, and if not, take them out of the skin",
            unknown.join(", ")
        );
        violations.add(place, what);
    }
}

/// True if a joint may hang below another: on the wrist, on the same digit nearer to the wrist, or on the palm's bones.
fn may_be_above(above: usize, joint: usize) -> bool {
    let digit = |joint: usize| (0..5).find(|&digit| joints_of(digit).contains(&joint));
    if joint == index::WRIST {
        return false;
    }
    above == index::WRIST
        || digit(above) == digit(joint) && above < joint
        || index::FIRST_OF_DIGIT[1..].contains(&above) && digit(above) != digit(joint)
}
