//! Whether a grip that is laid on an object may hold it: found out from where its contacts come to be, before a hand is closed.

use glam::Vec3;

use crate::{
    base::pose::Pose,
    model::{grasp::Contact, object::GraspObject, strategy::Validity},
    physical::{
        contacts::soften,
        grip::FORBIDDEN_CLEARANCE,
        immobility::{Buffers, SoftContact, epsilon_upper_bound},
        scene::ObjectScene,
    },
};

/// How far from the surface a contact may come to be that is put onto it, in metres: digits that close a little more or less
/// still touch there. With 3 mm, a scalpel of a hundred fewer is answered in 33 ms; with 6 mm, as many are.
const WITHIN_REACH: f32 = 0.004;

/// The cosine of how much the surface may be turned there from where the contact presses: 45°. Of scalpels and scissors held out
/// by 360 recorded givers, two workers answer 96.5 and 97.1 % in 33 ms with it, 96.1 and 96.2 with 90°, 96.4 and 96.1 with 37°,
/// and 94.4 and 95.8 where nothing is asked of contacts.
const FACING_COS: f32 = 0.7;

/// Looks at laid grips, and keeps its buffers from one to the next.
#[derive(Debug)]
pub(super) struct ClosureScreen<'a> {
    scene: ObjectScene<'a>,
    on_surface: Vec<Contact>,
    soft_contacts: Vec<SoftContact>,
    buffers: Buffers,
}

impl<'a> ClosureScreen<'a> {
    /// For an object under its own friction.
    pub(super) fn new(object: &'a GraspObject) -> Self {
        Self {
            scene: ObjectScene::new(object, object.friction_under(Validity::Physical)),
            on_surface: Vec::new(),
            soft_contacts: Vec::new(),
            buffers: Buffers::default(),
        }
    }

    /// True if the contacts, put onto the surface where they come near to it and face it, are off what is forbidden and may have
    /// enough closure, by a bound from above: some two microseconds of work.
    pub(super) fn passes(&mut self, contacts: &[Contact], object_from_primitive: Pose) -> bool {
        let object = self.scene.object;
        self.on_surface.clear();
        for contact in contacts {
            let place = object_from_primitive.transform_point(contact.position);
            let forbidden = object.forbidden_surface();
            if forbidden
                .is_some_and(|surface| surface.closest_point_within(place, FORBIDDEN_CLEARANCE).is_some())
            {
                return false;
            }
            let Some(closest) = object.surface.closest_point_within(place, WITHIN_REACH) else {
                continue;
            };
            // At an edge, flesh presses along one of many directions: it is told which.
            let normal = object_from_primitive.transform_vector(contact.normal);
            let of_triangle = object.surface.mesh().normal(closest.triangle as usize);
            if normal.dot(of_triangle) > FACING_COS {
                self.on_surface.push(Contact {
                    position: closest.position,
                    normal,
                    triangle: closest.triangle,
                    part: contact.part,
                });
            }
        }
        soften(&self.on_surface, self.scene.friction, &mut self.soft_contacts);
        // Closure is the same wherever gravity pulls.
        let load = self.scene.load(Vec3::Y);
        epsilon_upper_bound(&self.soft_contacts, &load, &mut self.buffers) >= self.scene.required_epsilon
    }
}
