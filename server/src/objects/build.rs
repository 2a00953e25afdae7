//! Builds objects from meshes.

use std::sync::Arc;

use grasp_import::{ImportError, MeshLimits, read_mesh_until};
use grasp_synthesis::{base::stop::Stop, model::plain_object::PlainObject};

use super::{
    StoredObject,
    centre_of_mass::centre_or_computed,
    extent::check_extent,
    given::{Given, OnMesh},
    mesh_file::MeshFile,
};
use crate::{
    error::ServiceError,
    validate::{ObjectFields, Violations},
};

/// Reads and checks the mesh. Takes up to seconds for the largest meshes.
///
/// # Errors
/// [`ServiceError::Invalid`] with `violations` and everything else that is wrong, [`ServiceError::Cancelled`] if it was stopped.
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
    let centre_of_mass = centre_or_computed(&read.mesh, given.centre_of_mass, &mut warnings);
    let object = PlainObject::new_until(
        read.mesh,
        fields.mass,
        centre_of_mass,
        fields.friction,
        &forbidden,
        stop,
    )?;
    match object {
        Ok(object) => {
            let object = object.with_regions(regions).with_banned(given.banned());
            let stored = StoredObject::from_file(fields.id.clone(), object, warnings, Arc::new(file));
            Ok(StoredObject { given, ..stored })
        }
        Err(errors) => {
            for error in errors {
                mesh_field.add(error);
            }
            Err(violations.into_error())
        }
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
    use crate::objects::given::tests::forbidden;

    const LIMITS: MeshLimits = MeshLimits {
        bytes: 1000,
        vertices: 10,
        triangles: 10,
    };

    /// A tetrahedron of 10 cm whose second face has no area and is dropped.
    fn fields(forbidden_triangles: &[u32]) -> ObjectFields {
        ObjectFields {
            mesh: b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 1 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"
                .to_vec(),
            import: Import::with_unit(0.1),
            regions: vec![forbidden(&[], forbidden_triangles)],
            ..ObjectFields::named("tetrahedron", 0.1)
        }
    }

    #[test]
    fn counts_forbidden_triangles_as_in_the_file() {
        let stored = build_object(&fields(&[1, 2, 4]), LIMITS, Violations::default(), Stop::NEVER).unwrap();
        let forbidden: Vec<bool> = (0..4).map(|t| stored.object.is_forbidden(t)).collect();
        assert_eq!(forbidden, [false, true, false, true]);
    }

    #[test]
    fn rejects_triangles_beyond_the_file() {
        assert!(build_object(&fields(&[5]), LIMITS, Violations::default(), Stop::NEVER).is_err());
    }

    const ROOMY: MeshLimits = MeshLimits {
        bytes: 1 << 16,
        vertices: 1000,
        triangles: 1000,
    };

    /// A mesh that has a group "lid", with its first triangle forbidden as well.
    fn text_fields(obj: String, unit_metres: f32) -> ObjectFields {
        ObjectFields {
            mesh: obj.into_bytes(),
            import: Import::with_unit(unit_metres),
            regions: vec![forbidden(&["lid"], &[0])],
            ..fields(&[])
        }
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
            match build_object(
                &text_fields(format!("{start}{lines}"), unit_metres),
                ROOMY,
                Violations::default(),
                Stop::NEVER,
            ) {
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

    #[test]
    fn warns_about_a_mesh_without_volume() {
        let sheet = "g lid\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n".to_owned();
        let stored = build_object(
            &text_fields(sheet, 0.1),
            ROOMY,
            Violations::default(),
            Stop::NEVER,
        )
        .expect("a sheet is an object");
        assert!(
            stored
                .warnings
                .iter()
                .any(|warning| warning.contains("centre of mass")),
            "{:?}",
            stored.warnings
        );
    }
}
