//! A cheap test of whether a transferred grip can hold an object, from where its contacts land and before the
//! hand is closed.

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

/// Distance within which a contact is projected onto the surface, in metres: closing the digits makes up for
/// it. Less loses grips that hold; more gains none.
const SNAP_DISTANCE: f32 = 0.004;

/// Cosine of the largest angle between a contact's normal and the surface's: 45°. Stricter and looser limits
/// both pass worse seeds for thin objects.
const FACING_COS: f32 = 0.7;

/// Screens transferred grips, reusing its buffers.
#[derive(Debug)]
pub(super) struct ClosureScreen<'a> {
    scene: ObjectScene<'a>,
    on_surface: Vec<Contact>,
    soft_contacts: Vec<SoftContact>,
    buffers: Buffers,
}

impl<'a> ClosureScreen<'a> {
    /// A screen for an object under its own friction.
    pub(super) fn new(object: &'a GraspObject) -> Self {
        Self {
            scene: ObjectScene::new(object, object.friction_under(Validity::Physical)),
            on_surface: Vec::new(),
            soft_contacts: Vec::new(),
            buffers: Buffers::default(),
        }
    }

    /// True if no contact is near a forbidden surface, and an upper bound of the closure of those that land
    /// on the surface and face it is sufficient. Takes about two microseconds.
    pub(super) fn passes(&mut self, contacts: &[Contact], object_from_primitive: Pose) -> bool {
        let object = self.scene.object;
        self.on_surface.clear();
        for contact in contacts {
            let position = object_from_primitive.transform_point(contact.position);
            let forbidden = object.forbidden_surface();
            if forbidden.is_some_and(|surface| {
                surface
                    .closest_point_within(position, FORBIDDEN_CLEARANCE)
                    .is_some()
            }) {
                return false;
            }
            let Some(closest) = object.surface.closest_point_within(position, SNAP_DISTANCE) else {
                continue;
            };
            // At an edge, a contact may press along many directions; the grip's own normal decides which.
            let normal = object_from_primitive.transform_vector(contact.normal);
            let triangle_normal = object.surface.mesh().normal(closest.triangle as usize);
            if normal.dot(triangle_normal) > FACING_COS {
                self.on_surface.push(Contact {
                    position: closest.position,
                    normal,
                    triangle: closest.triangle,
                    part: contact.part,
                });
            }
        }
        soften(&self.on_surface, self.scene.friction, &mut self.soft_contacts);
        // Closure does not depend on gravity.
        let load = self.scene.load(&self.soft_contacts, Vec3::Y);
        let bound = epsilon_upper_bound(&self.soft_contacts, &load, &mut self.buffers);
        bound > 0.0 && bound >= self.scene.required_epsilon(&load.torque_scale)
    }
}
