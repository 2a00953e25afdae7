//! Changes of an object's physical properties.

use std::sync::Arc;

use glam::Vec3;
use grasp_proto::v1;
use grasp_synthesis::{base::stop::unstopped, model::object::ObjectError};

use super::{StoredObject, centre_of_mass::centre_or_computed, given::OnMesh};
use crate::{
    answer::vector,
    error::ServiceError,
    validate::{Forbidden, ObjectChange, Setting, Violations},
};

/// The object after a change; none if the change leaves it as it is. Takes some ten milliseconds, more for large meshes.
///
/// # Errors
/// [`ServiceError::Invalid`] with every forbidden surface that its file does not have.
pub(crate) fn changed(
    stored: &StoredObject,
    change: &ObjectChange,
) -> Result<Option<StoredObject>, ServiceError> {
    let object = &stored.object;
    let mut violations = Violations::default();
    let mut warnings = stored.warnings.clone();
    let mass = change.mass.unwrap_or(object.mass);
    let friction = match change.friction {
        Setting::Kept => object.friction,
        Setting::Default => None,
        Setting::To(friction) => Some(friction),
    };
    let mesh = object.surface.mesh();
    let centre = match change.centre_of_mass {
        Setting::Kept => object.centre_of_mass,
        Setting::Default => centre_or_computed(mesh, None, &mut warnings),
        Setting::To(centre) => centre_or_computed(mesh, Some(centre), &mut warnings),
    };
    let mut given = stored.given.clone();
    if let Some(forbidden) = &change.forbidden {
        given.forbidden = Arc::new(forbidden.clone());
    }
    if let Some(regions) = &change.regions {
        given.regions = regions.as_slice().into();
    }
    if let Some(grips) = &change.known_grips {
        given.grips = grips.as_slice().into();
    }
    let OnMesh { forbidden, regions } =
        unstopped(|stop| given.on_mesh(mesh, &stored.file, &mut violations, stop));
    if !violations.is_empty() {
        return Err(violations.into_error());
    }
    let is_same = mass == object.mass
        && friction == object.friction
        && centre == object.centre_of_mass
        && warnings == stored.warnings
        && given.regions == stored.given.regions
        && given.grips == stored.given.grips
        && forbidden.len() == object.forbidden_count()
        && forbidden.iter().all(|&triangle| object.is_forbidden(triangle));
    if is_same {
        return Ok(None);
    }
    match object.with_properties(mass, centre, friction, &forbidden) {
        Ok(changed) => {
            let changed = changed.with_regions(regions).with_banned(given.banned());
            let changed = StoredObject::from_file(
                stored.id.clone(),
                Arc::new(changed),
                warnings,
                Arc::clone(&stored.file),
            );
            Ok(Some(StoredObject { given, ..changed }))
        }
        Err(errors) => {
            for error in errors {
                violations.add(field_of(&error), error);
            }
            Err(violations.into_error())
        }
    }
}

/// Changes the request that would create an object to one that would create the changed object.
pub(crate) fn change_request(request: &mut v1::CreateObjectRequest, change: &ObjectChange) {
    if let Some(mass) = change.mass {
        request.mass_kg = mass;
    }
    change.friction.apply(&mut request.friction);
    let mut centre_of_mass = request.centre_of_mass.map(|v| Vec3::new(v.x, v.y, v.z));
    change.centre_of_mass.apply(&mut centre_of_mass);
    request.centre_of_mass = centre_of_mass.map(vector);
    if let Some(Forbidden { groups, triangles }) = change.forbidden.clone() {
        request.forbidden = Some(v1::ForbiddenSurfaces { groups, triangles });
    }
    if let Some(regions) = &change.regions {
        request.regions = regions.iter().map(|region| region.given.clone()).collect();
    }
    if let Some(grips) = &change.known_grips {
        request.known_grips = grips.iter().map(|grip| grip.given.clone()).collect();
    }
}

/// The field that an error is about.
fn field_of(error: &ObjectError) -> &'static str {
    match error {
        ObjectError::Mass(_) => "mass_kg",
        ObjectError::Friction(_) => "friction",
        ObjectError::CentreOfMass(_) => "centre_of_mass",
        ObjectError::ForbiddenTriangle { .. } | ObjectError::MoreForbiddenTriangles { .. } => "forbidden",
    }
}

#[cfg(test)]
mod tests {
    use grasp_import::{Import, MeshLimits};
    use grasp_synthesis::base::stop::Stop;

    use super::*;
    use crate::{objects::build::build_object, validate::ObjectFields};

    const LIMITS: MeshLimits = MeshLimits {
        bytes: 1000,
        vertices: 10,
        triangles: 10,
    };

    fn object(obj: &str) -> StoredObject {
        let fields = ObjectFields {
            mesh: obj.as_bytes().to_vec(),
            import: Import::with_unit(0.1),
            ..ObjectFields::named("tetrahedron", 0.1)
        };
        build_object(&fields, LIMITS, Violations::default(), Stop::NEVER).unwrap()
    }

    /// Its second face is dropped, and all later ones are the group "lid".
    const TETRAHEDRON: &str =
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 1 2\ng lid\nf 1 2 4\nf 2 3 4\nf 3 1 4\n";

    fn forbid(groups: &[&str], triangles: &[u32]) -> ObjectChange {
        ObjectChange {
            forbidden: Some(Forbidden {
                groups: groups.iter().map(|&name| name.to_owned()).collect(),
                triangles: triangles.to_vec(),
            }),
            ..ObjectChange::default()
        }
    }

    #[test]
    fn shares_the_search_structure_and_changes_what_is_asked_for() {
        let before = object(TETRAHEDRON);
        let change = ObjectChange {
            mass: Some(0.4),
            friction: Setting::To(0.8),
            centre_of_mass: Setting::To(Vec3::splat(0.02)),
            ..forbid(&["lid"], &[0, 1])
        };
        let after = changed(&before, &change).unwrap().unwrap();
        assert!(Arc::ptr_eq(&before.object.surface, &after.object.surface));
        assert_eq!((after.object.mass, after.object.friction), (0.4, Some(0.8)));
        assert_eq!(after.object.centre_of_mass, Vec3::splat(0.02));
        // Every triangle but the dropped one, which is none of the mesh.
        assert_eq!(after.object.forbidden_count(), 4);
        assert_ne!(after.content_hash, before.content_hash);
        // As if it had been created like this.
        let fields = ObjectFields {
            mesh: TETRAHEDRON.as_bytes().to_vec(),
            import: Import::with_unit(0.1),
            forbidden: Forbidden {
                groups: vec!["lid".to_owned()],
                triangles: vec![0],
            },
            ..ObjectFields::named("other", 0.4)
        };
        let created = build_object(&fields, LIMITS, Violations::default(), Stop::NEVER).unwrap();
        assert_eq!(created.content_hash, after.content_hash);
    }

    #[test]
    fn equal_values_change_nothing() {
        let before = object(TETRAHEDRON);
        let same = ObjectChange {
            mass: Some(before.object.mass),
            friction: Setting::Default,
            centre_of_mass: Setting::Default,
            ..forbid(&[], &[1])
        };
        assert!(changed(&before, &same).unwrap().is_none());
        assert!(changed(&before, &ObjectChange::default()).unwrap().is_none());
    }

    #[test]
    fn the_warning_about_a_computed_centre_comes_and_goes() {
        let sheet = object("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
        assert_eq!(
            sheet
                .warnings
                .iter()
                .filter(|w| w.contains("centre of mass"))
                .count(),
            1
        );
        let centre = |given| ObjectChange {
            centre_of_mass: given,
            ..ObjectChange::default()
        };
        let given = changed(&sheet, &centre(Setting::To(Vec3::ZERO)))
            .unwrap()
            .unwrap();
        assert!(!given.warnings.iter().any(|w| w.contains("centre of mass")));
        let computed = changed(&given, &centre(Setting::Default)).unwrap().unwrap();
        assert_eq!(computed.warnings, sheet.warnings);
        assert_eq!(computed.object.centre_of_mass, sheet.object.centre_of_mass);
    }

    #[test]
    fn names_what_the_file_does_not_have() {
        let Err(ServiceError::Invalid(violations)) = changed(&object(TETRAHEDRON), &forbid(&["rim"], &[5]))
        else {
            panic!("neither exists");
        };
        let fields: Vec<&str> = violations.iter().map(|v| v.field.as_str()).collect();
        assert_eq!(fields, ["forbidden.groups[0]", "forbidden.triangles[0]"]);
    }
}
