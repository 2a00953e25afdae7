//! The finger subsets recorded with known grips, against the closure of their contacts.

use grasp_synthesis::physical::immobility::EPSILON_TOLERANCE;

use crate::fixtures::{
    atlases::complete_atlas, grasps::relative_closure_of, objects::object, proposals::object_scene,
};

/// The sixteen subsets of fingers with the thumb, thumb first.
fn sets() -> impl Iterator<Item = [bool; 5]> {
    (0_u8..16).map(|set| std::array::from_fn(|digit| digit == 0 || set >> (digit - 1) & 1 == 1))
}

#[test]
fn recorded_finger_subsets_are_those_with_closure() {
    let scene = object_scene(object("scissors"));
    let known = complete_atlas("scissors");
    let (mut closing, mut open) = (0, 0);
    for (place, entry) in known.entries().iter().enumerate().step_by(173) {
        let holding = entry.grip.bend_ratios.map(|ratio| ratio.is_some());
        for kept in sets() {
            let is_of_holding =
                kept[1..].contains(&true) && kept.iter().zip(holding).all(|(kept, holds)| !kept || holds);
            let is_set = entry.finger_subsets.contains(kept);
            if !is_of_holding {
                assert!(!is_set, "grip {place}, {kept:?}");
                continue;
            }
            // Subsets of a set without closure are not tried.
            let is_tried = (1..5)
                .filter(|&digit| holding[digit] && !kept[digit])
                .all(|digit| {
                    let mut more = kept;
                    more[digit] = true;
                    entry.finger_subsets.contains(more)
                });
            // Epsilon is exact to its tolerance; within that, either answer is right.
            let bound = relative_closure_of(&entry.contacts, kept, &scene);
            if bound >= 1.0 && is_tried {
                closing += 1;
                assert!(is_set, "grip {place}, {kept:?}: {bound}");
            } else if bound < 1.0 - EPSILON_TOLERANCE || !is_tried {
                open += 1;
                assert!(!is_set, "grip {place}, {kept:?}: {bound}");
            }
        }
    }
    assert!(closing >= 60 && open >= 60, "{closing} sets close, {open} do not");
}
