//! Changes of an object's physical properties.

use std::sync::Arc;

use glam::DVec3;
use grasp_import::keeps_origin;
use grasp_proto::v1;
use grasp_synthesis::{
    base::stop::unstopped,
    model::plain_object::{ObjectError, PlainObject},
};

use super::{
    StoredObject, centre_of_mass::centre_or_computed, extent::check_extent, given::OnMesh,
    mesh_file::MeshFile,
};
use crate::{
    error::ServiceError,
    validate::{ObjectChange, Setting, Violations},
};

/// The object after a change. `None` if the change leaves it as it is.
///
/// # Errors
/// [`ServiceError::Invalid`] with every surface that its file does not have, or because of a unit that it cannot have.
pub(crate) fn changed(
    stored: &StoredObject,
    change: &ObjectChange,
) -> Result<Option<StoredObject>, ServiceError> {
    let violations = Violations::default();
    let mut warnings = stored.warnings.clone();
    let mass = change.mass.unwrap_or(stored.object.mass);
    let resized = match change.unit_metres {
        Some(unit) if unit != stored.file.unit_metres => Some(with_unit(stored, unit, mass, &mut warnings)?),
        _ => None,
    };
    let (object, file) = match &resized {
        Some((object, file)) => (object, file),
        None => (&stored.object, &stored.file),
    };
    let friction = match change.friction {
        Setting::Kept => object.friction,
        Setting::Default => None,
        Setting::To(friction) => Some(friction),
    };
    let mesh = &object.mesh;
    let mut given = stored.given.clone();
    change.centre_of_mass.apply(&mut given.centre_of_mass);
    let centre = centre_or_computed(mesh, given.centre_of_mass, &mut warnings);
    if let Some(regions) = &change.regions {
        given.regions = regions.as_slice().into();
    }
    if let Some(grips) = &change.known_grips {
        given.grips = grips.as_slice().into();
    }
    let OnMesh { forbidden, regions } = unstopped(|stop| given.on_mesh(mesh, file, &violations, stop));
    if !violations.is_empty() {
        return Err(violations.into_error());
    }
    let is_same = resized.is_none()
        && mass == object.mass
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
            let changed = StoredObject::from_file(stored.id.clone(), changed, warnings, Arc::clone(file));
            Ok(Some(StoredObject { given, ..changed }))
        }
        Err(errors) => {
            for error in errors {
                violations.field("object").child(field_of(&error)).add(error);
            }
            Err(violations.into_error())
        }
    }
}

/// The object as its mesh makes it with another unit, and what is then kept of its file.
///
/// # Errors
/// [`ServiceError::Invalid`] if it would be too large or too small, or have another origin.
fn with_unit(
    stored: &StoredObject,
    unit_metres: f32,
    mass: f32,
    warnings: &mut Vec<String>,
) -> Result<(PlainObject, Arc<MeshFile>), ServiceError> {
    let invalid = |wrong: String| ServiceError::invalid("object.meters_per_unit", wrong);
    let scale = unit_metres / stored.file.unit_metres;
    let resized = stored.object.scaled(scale, mass);
    let resized = resized.map_err(|error| invalid(format!("is {unit_metres}: {error}")))?;
    let mesh = &resized.mesh;
    check_extent(mesh, warnings).map_err(invalid)?;
    let centre = mesh.aabb().centre().as_dvec3();
    if stored.file.origin != DVec3::ZERO || !keeps_origin(centre) {
        return Err(invalid(format!(
            "is {unit_metres}; with it, the object's origin would be elsewhere in the mesh: delete the object, and create it again"
        )));
    }
    let file = stored.file.with_unit(unit_metres);
    Ok((resized, Arc::new(file)))
}

/// Changes the object that a client would create to the changed one.
pub(crate) fn change_given(object: &mut v1::GraspObject, change: &ObjectChange) {
    if change.unit_metres.is_some() {
        object.meters_per_unit = change.unit_metres;
    }
    if let Some(mass) = change.mass {
        object.mass_kg = mass;
    }
    change.friction.apply(&mut object.friction);
    let mut centre_of_mass = object.center_of_mass.map(Into::into);
    change.centre_of_mass.apply(&mut centre_of_mass);
    object.center_of_mass = centre_of_mass.map(Into::into);
    if let Some(regions) = &change.regions {
        object.regions = regions.iter().map(|region| region.given.clone()).collect();
    }
    if let Some(grips) = &change.known_grips {
        object.known_grips = grips.iter().map(|grip| grip.given.clone()).collect();
    }
}

/// The field that an error is about.
fn field_of(error: &ObjectError) -> &'static str {
    match error {
        ObjectError::Mass(_) => "mass_kg",
        ObjectError::Friction(_) => "friction",
        ObjectError::CentreOfMass(_) => "center_of_mass",
        ObjectError::ForbiddenTriangle { .. } | ObjectError::MoreForbiddenTriangles { .. } => "regions",
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use grasp_import::{Import, MeshLimits};
    use grasp_synthesis::base::stop::Stop;

    use super::*;
    use crate::{
        objects::{build::build_object, given::tests::forbidden},
        validate::ObjectFields,
    };

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
            regions: Some(vec![forbidden(groups, triangles)]),
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
        assert!(Arc::ptr_eq(&before.object.mesh, &after.object.mesh));
        assert_eq!((after.object.mass, after.object.friction), (0.4, Some(0.8)));
        assert_eq!(after.object.centre_of_mass, Vec3::splat(0.02));
        // Every triangle but the dropped one, which is none of the mesh.
        assert_eq!(after.object.forbidden_count(), 4);
        assert_ne!(after.content_hash, before.content_hash);
        // As if it had been created like this.
        let fields = ObjectFields {
            mesh: TETRAHEDRON.as_bytes().to_vec(),
            import: Import::with_unit(0.1),
            regions: vec![forbidden(&["lid"], &[0])],
            ..ObjectFields::named("other", 0.4)
        };
        let created = build_object(&fields, LIMITS, Violations::default(), Stop::NEVER).unwrap();
        assert_eq!(created.content_hash, after.content_hash);
    }

    #[test]
    fn another_unit_makes_the_object_that_its_file_makes_with_it() {
        // 600 m long: the unit should have been a millimetre.
        let of = |unit_metres| {
            let fields = ObjectFields {
                mesh:
                    b"v 0 0 0\nv 600 0 0\nv 0 600 0\nv 0 0 600\nf 1 3 2\ng lid\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"
                        .to_vec(),
                import: Import::with_unit(unit_metres),
                ..ObjectFields::named("tetrahedron", 0.1)
            };
            build_object(&fields, LIMITS, Violations::default(), Stop::NEVER).unwrap()
        };
        let before = of(0.01);
        assert_eq!(before.warnings.len(), 1, "{:?}", before.warnings);
        let unit = |unit_metres| ObjectChange {
            unit_metres: Some(unit_metres),
            ..forbid(&["lid"], &[])
        };
        let after = changed(&before, &unit(0.0005)).unwrap().unwrap();
        let expected = of(0.0005);
        assert_eq!(
            (&after.warnings, after.file.unit_metres),
            (&expected.warnings, 0.0005)
        );
        assert!((after.object.centre_of_mass - expected.object.centre_of_mass).length() < 1e-6);
        let [one, other] = [&after, &expected].map(|of| of.object.mesh.positions());
        assert!(one.iter().zip(other).all(|(a, b)| (a - b).length() < 1e-6));
        assert_eq!((after.object.mass, after.object.forbidden_count()), (0.1, 3));
        // A centre that was given stays where it is.
        let given = ObjectChange {
            centre_of_mass: Setting::To(Vec3::splat(0.02)),
            ..ObjectChange::default()
        };
        let given = changed(&before, &given).unwrap().unwrap();
        let after = changed(&given, &unit(0.0005)).unwrap().unwrap();
        assert_eq!(after.object.centre_of_mass, Vec3::splat(0.02));
        for (unit_metres, part) in [(1.0, "elsewhere"), (0.000_001, "elsewhere")] {
            let Err(ServiceError::Invalid(violations)) = changed(&of(0.1), &unit(unit_metres)) else {
                panic!("its origin would be another");
            };
            assert!(violations[0].description.contains(part), "{violations:?}");
        }
    }

    #[test]
    fn equal_values_change_nothing() {
        let before = changed(&object(TETRAHEDRON), &forbid(&[], &[1]));
        let before = before.unwrap().expect("it has a region now");
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
        assert_eq!(
            fields,
            ["object.regions[0].groups[0]", "object.regions[0].triangles[0]"]
        );
    }
}
