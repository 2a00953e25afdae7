//! Objects whose physical properties change.

use crate::prelude::*;

/// The object is the one that would have been built with these properties, but for what it shares.
#[test]
fn changed_properties_make_the_object_that_would_be_built_with_them() {
    for name in ["remote", "scalpel", "scissors"] {
        let before = object(name);
        let forbidden = [3, 4, 50];
        let changed = before
            .with_properties(0.7, Vec3::splat(0.01), Some(0.5), &forbidden)
            .expect("the properties are right");
        let mesh = before.surface.mesh().clone();
        let built = GraspObject::new(mesh, 0.7, Vec3::splat(0.01), Some(0.5), &forbidden)
            .expect("the properties are right");
        assert!(Arc::ptr_eq(&changed.surface, &before.surface));
        assert_eq!((changed.mass, changed.friction), (built.mass, built.friction));
        assert_eq!(changed.centre_of_mass, built.centre_of_mass);
        assert_eq!(changed.bounding_box, built.bounding_box);
        assert_eq!(changed.local_thickness.bytes(), built.local_thickness.bytes());
        assert_eq!(changed.forbidden_count(), 3);
        let triangles = 0..changed.surface.mesh().triangles().len() as u32;
        for triangle in triangles {
            assert_eq!(changed.is_forbidden(triangle), built.is_forbidden(triangle));
        }
    }
}
