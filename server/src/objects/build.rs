//! Builds objects from meshes, and changes their physical properties.

use std::sync::Arc;

use glam::DVec3;
use grasp_import::{ImportError, MeshLimits, keeps_origin, read_mesh_until};
use grasp_proto::v1;
use grasp_synthesis::{
    base::stop::{Stop, unstopped},
    model::{
        plain_object::{ObjectError, PlainObject},
        regions::Regions,
    },
};

use super::{
    StoredObject,
    given::{Given, OnMesh},
    mesh_file::{MeshFile, centre_or_computed, check_extent},
};
use crate::{
    error::ServiceError,
    validate::{ObjectChange, ObjectFields, Setting, Violations},
};

/// Reads and checks the mesh. Takes up to seconds for the largest meshes.
pub(crate) fn build_object(
    fields: &ObjectFields,
    limits: MeshLimits,
    violations: Violations,
    stop: Stop<'_>,
) -> Result<StoredObject, ServiceError> {
    if fields.mesh.is_empty() || fields.mesh.len() > limits.bytes {
        // `object_fields` has added the violation.
        return Err(violations.into_error());
    }
    let mesh_field = violations.field("mesh");
    let read = match read_mesh_until(&fields.mesh, fields.import, &fields.parts, limits, stop) {
        Ok(read) => read,
        Err(errors) => {
            stop.check()?;
            for error in errors {
                if let ImportError::NoSuchPart { place, .. } = error {
                    violations.field("object").child("parts").at(place).add(error);
                } else {
                    mesh_field.add(error);
                }
            }
            return Err(violations.into_error());
        }
    };
    let mut warnings = read.warnings.clone();
    if let Err(wrong) = check_extent(&read.mesh, &mut warnings) {
        mesh_field.add(wrong);
    }
    // Clients count the triangles of their file, some of which may have been dropped.
    let file = MeshFile::of(&read, fields.import, &fields.parts);
    let given = Given {
        centre_of_mass: fields.centre_of_mass,
        regions: fields.regions.as_slice().into(),
        grips: fields.known_grips.as_slice().into(),
    };
    let OnMesh { forbidden, regions } = given.on_mesh(&read.mesh, &file, &violations, stop)?;
    if !violations.is_empty() {
        return Err(violations.into_error());
    }
    let centre = centre_or_computed(&read.mesh, given.centre_of_mass, &mut warnings);
    let object = PlainObject::new_until(read.mesh, fields.mass, centre, fields.friction, &forbidden, stop)?;
    let object = with_given(object, &given, regions, violations)?;
    Ok(StoredObject::new(
        fields.id.clone(),
        object,
        given,
        warnings,
        Arc::new(file),
    ))
}

/// The object with its client's knowledge of it.
fn with_given(
    object: Result<PlainObject, Vec<ObjectError>>,
    given: &Given,
    regions: Regions,
    violations: Violations,
) -> Result<PlainObject, ServiceError> {
    match object {
        Ok(object) => Ok(object.with_regions(regions).with_banned(given.banned())),
        Err(errors) => {
            for error in errors {
                let field = match error {
                    ObjectError::Mass(_) => "mass_kg",
                    ObjectError::Friction(_) => "friction",
                    ObjectError::CentreOfMass(_) => "center_of_mass",
                    ObjectError::ForbiddenTriangle { .. } | ObjectError::MoreForbiddenTriangles { .. } => {
                        "regions"
                    }
                };
                violations.field("object").child(field).add(error);
            }
            Err(violations.into_error())
        }
    }
}

/// The object after a change. `None` if the change leaves it as it is.
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
    let mut given = stored.given.clone();
    change.centre_of_mass.apply(&mut given.centre_of_mass);
    let centre = centre_or_computed(&object.mesh, given.centre_of_mass, &mut warnings);
    if let Some(regions) = &change.regions {
        given.regions = regions.as_slice().into();
    }
    if let Some(grips) = &change.known_grips {
        given.grips = grips.as_slice().into();
    }
    let on_mesh = unstopped(|stop| given.on_mesh(&object.mesh, file, &violations, stop));
    let OnMesh { forbidden, regions } = on_mesh;
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
    let changed = object.with_properties(mass, centre, friction, &forbidden);
    let changed = with_given(changed, &given, regions, violations)?;
    Ok(Some(StoredObject::new(
        stored.id.clone(),
        changed,
        given,
        warnings,
        Arc::clone(file),
    )))
}

/// The object with another unit, and its file.
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

/// Applies a change to an object as a client would create it.
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

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use proptest::{
        prelude::*,
        test_runner::{Config, RngSeed, TestRunner},
    };

    use grasp_import::Import;

    use super::*;
    use crate::objects::tests::forbidden;
    use glam::Vec3;

    const LIMITS: MeshLimits = MeshLimits {
        bytes: 1 << 16,
        vertices: 1000,
        triangles: 1000,
    };

    fn fields(obj: &str, unit_metres: f32) -> ObjectFields {
        ObjectFields {
            mesh: obj.as_bytes().to_vec(),
            import: Import::with_unit(unit_metres),
            ..ObjectFields::named("tetrahedron", 0.1)
        }
    }

    fn build(fields: &ObjectFields) -> Result<StoredObject, ServiceError> {
        build_object(fields, LIMITS, Violations::default(), Stop::NEVER)
    }

    #[test]
    fn every_text_becomes_an_object_or_an_invalid_argument() {
        let lines = "((v|f|g|o|usemtl|vn|l|#)( -?[1-4](\\.[0-9])?){0,5}\\\\?\n){0,12}";
        let units = prop_oneof![6 => Just(0.01_f32), 1 => Just(1e-6), 1 => Just(1e3)];
        let config = Config {
            cases: 1000,
            rng_seed: RngSeed::Fixed(5),
            failure_persistence: None,
            ..Config::default()
        };
        let built = Cell::new(0);
        let outcome = TestRunner::new(config).run(&(lines, units), |(lines, unit_metres)| {
            let start = "v 0 0 0\nv 9 0 0\nv 0 9 0\nv 0 0 9\ng lid\nf 1 2 3\n";
            // The group "lid" is there, and so is a first triangle.
            let with_region = ObjectFields {
                regions: vec![forbidden(&["lid"], &[0])],
                ..fields(&format!("{start}{lines}"), unit_metres)
            };
            match build(&with_region) {
                Ok(stored) => {
                    built.set(built.get() + 1);
                    prop_assert!(stored.object.centre_of_mass.is_finite());
                    prop_assert!(stored.object.forbidden_count() >= 1);
                }
                Err(error) => prop_assert!(matches!(error, ServiceError::Invalid(_)), "{}", error),
            }
            Ok(())
        });
        outcome.unwrap_or_else(|failure| panic!("{failure}"));
        // The test is meaningful only if it tried texts of both kinds.
        assert!((100..900).contains(&built.get()), "{built:?}");
    }

    fn object(obj: &str) -> StoredObject {
        build(&fields(obj, 0.1)).unwrap()
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
    fn a_change_shares_the_mesh_and_equals_a_new_object() {
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
        let with_region = ObjectFields {
            regions: vec![forbidden(&["lid"], &[0])],
            ..fields(TETRAHEDRON, 0.1)
        };
        let created = build(&with_region).unwrap();
        assert_eq!(created.content_hash, after.content_hash);
    }

    #[test]
    fn another_unit_makes_the_object_that_its_file_makes_with_it() {
        // 600 m long: the unit should have been a millimetre.
        let obj = "v 0 0 0\nv 600 0 0\nv 0 600 0\nv 0 0 600\nf 1 3 2\ng lid\nf 1 2 4\nf 2 3 4\nf 3 1 4\n";
        let of = |unit_metres| build(&fields(obj, unit_metres)).unwrap();
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
        for unit_metres in [1.0, 0.000_001] {
            let refused = changed(&of(0.1), &unit(unit_metres)).unwrap_err();
            assert!(refused.to_string().contains("elsewhere"), "{refused}");
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
        let about_centre = |of: &StoredObject| {
            of.warnings
                .iter()
                .filter(|w| w.contains("centre of mass"))
                .count()
        };
        assert_eq!(about_centre(&sheet), 1);
        let centre = |given| ObjectChange {
            centre_of_mass: given,
            ..ObjectChange::default()
        };
        let given = changed(&sheet, &centre(Setting::To(Vec3::ZERO)))
            .unwrap()
            .unwrap();
        assert_eq!(about_centre(&given), 0);
        let computed = changed(&given, &centre(Setting::Default)).unwrap().unwrap();
        assert_eq!(computed.warnings, sheet.warnings);
        assert_eq!(computed.object.centre_of_mass, sheet.object.centre_of_mass);
    }
}
