//! The embedded grips of primitives.

use glam::Vec3;
use grasp_assets::atlases::{grips, held_primitives};
use grasp_synthesis::known::primitives::Primitive;

/// Distance of a point from the surface of a centred box.
fn from_box(half: Vec3, point: Vec3) -> f32 {
    let beyond = point.abs() - half;
    let outside = beyond.max(Vec3::ZERO).length();
    (outside + beyond.max_element().min(0.0)).abs()
}

#[test]
fn both_hands_have_many_touching_grips_of_every_primitive() {
    assert_eq!(held_primitives().len(), 2);
    for (hand, held) in held_primitives() {
        let primitives: Vec<Primitive> = held.iter().map(|held| held.primitive).collect();
        assert_eq!(primitives, Primitive::ALL);
        for held in held.iter() {
            let name = held.primitive.name();
            assert!(grips(held.primitive, &hand.rig).is_some());
            let entries = held.grips.entries();
            assert!((50..1000).contains(&entries.len()), "{name}: {}", entries.len());
            for contact in entries.iter().flat_map(|entry| &entry.contacts) {
                let off = from_box(held.primitive.half_extents, contact.position);
                assert!(off < 1e-5, "{name}: a contact is {off} m off the surface");
            }
        }
    }
}
