//! The folder's meshes with their manifests, or with what stands in for these.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use grasp_client::{ForbiddenSurfaces, NewObject, UpAxis};
use grasp_import::{Import, MeshLimits, read_mesh};
use grasp_proto::v1;
use grasp_server::{FolderObject, objects_of_folder};

use super::densities::{Density, density, mass};
use crate::{failure::Failure, objects::id_from_file};

/// Bounds on meshes whose mass has to be computed: the largest that a server can be configured to take.
const LIMITS: MeshLimits = MeshLimits {
    bytes: 1 << 30,
    vertices: 10_000_000,
    triangles: 10_000_000,
};

/// A mesh to register.
#[derive(Clone, Debug)]
pub(super) struct Baked {
    /// The object's id.
    pub id: String,
    /// The mesh file.
    pub mesh: PathBuf,
    /// What its manifest says.
    pub manifest: Option<v1::CreateObjectRequest>,
}

/// Reads the manifests of a folder.
///
/// # Errors
/// Everything that is wrong with it.
pub(super) fn read_folder(path: &Path) -> Result<Vec<Baked>, Failure> {
    let found = objects_of_folder(path).map_err(|problems| {
        let lines: Vec<String> = problems.iter().map(|problem| format!("\n  {problem}")).collect();
        Failure::Usage(format!("{} cannot be baked:{}", path.display(), lines.concat()))
    })?;
    if found.is_empty() {
        return Err(Failure::Usage(format!("{} has no meshes", path.display())));
    }
    let mut names: BTreeMap<String, PathBuf> = BTreeMap::new();
    let mut objects = Vec::new();
    for FolderObject { mesh, manifest } in found {
        let id = id_from_file(&mesh);
        if let Some(other) = names.insert(id.clone(), mesh.clone()) {
            return Err(Failure::Usage(format!(
                "{} and {} would both be objects/{id}; rename one of them",
                other.display(),
                mesh.display()
            )));
        }
        objects.push(Baked { id, mesh, manifest });
    }
    Ok(objects)
}

/// The object to create and, if its mass had to be computed, the density.
///
/// # Errors
/// What is wrong with the mesh, in words.
pub(super) fn new_object(baked: Baked) -> Result<(NewObject, Option<Density>), String> {
    let mesh = std::fs::read(&baked.mesh).map_err(|error| format!("cannot be read: {error}"))?;
    let Some(manifest) = baked.manifest else {
        let read = read_mesh(&mesh, Import::METRES, LIMITS).map_err(|errors| {
            let all: Vec<String> = errors.iter().map(ToString::to_string).collect();
            all.join("; ")
        })?;
        let density = density(&read);
        let mass = mass(&read, &density);
        return Ok((NewObject::new(baked.id, mesh, mass), Some(density)));
    };
    // Every field, so that none that manifests get is forgotten here.
    let v1::CreateObjectRequest {
        object_id: _,
        mesh: _,
        obj: _,
        up_axis,
        unit_metres,
        mass_kg,
        centre_of_mass,
        friction,
        forbidden,
        labels,
        request_id: _,
        // Manifests have neither.
        regions: _,
        known_grips: _,
    } = manifest;
    let v1::ForbiddenSurfaces { groups, triangles } = forbidden.unwrap_or_default();
    let object = NewObject {
        up_axis: if up_axis == i32::from(v1::UpAxis::Z) {
            UpAxis::Z
        } else {
            UpAxis::Y
        },
        unit_metres,
        centre_of_mass: centre_of_mass.map(|v| glam::Vec3::new(v.x, v.y, v.z)),
        friction,
        forbidden: ForbiddenSurfaces { groups, triangles },
        labels,
        ..NewObject::new(baked.id, mesh, mass_kg)
    };
    Ok((object, None))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder(name: &str, files: &[(&str, &str)]) -> PathBuf {
        let path = std::env::temp_dir().join(format!("grasp-bake-{name}-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&path);
        std::fs::create_dir_all(&path).unwrap();
        for (file, content) in files {
            std::fs::write(path.join(file), content).unwrap();
        }
        path
    }

    const TETRAHEDRON: &str = "v 0 0 0\nv .1 0 0\nv 0 .1 0\nv 0 0 .1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n";

    #[test]
    fn a_manifest_decides_and_a_density_stands_in_for_one() {
        let path = folder(
            "both",
            &[
                ("Tea Tin.obj", TETRAHEDRON),
                (
                    "Tea Tin.toml",
                    "mass_kg = 0.2\nup_axis = \"z\"\n[labels]\nlevel = \"hall\"\n",
                ),
                ("plain.obj", TETRAHEDRON),
                ("notes.txt", "of no interest"),
            ],
        );
        let objects = read_folder(&path).unwrap();
        let [(tin, of_tin), (plain, of_plain)] =
            [0, 1].map(|place| new_object(objects[place].clone()).unwrap());
        assert_eq!(
            (tin.id.as_str(), tin.mass_kg, tin.up_axis),
            ("tea-tin", 0.2, UpAxis::Z)
        );
        assert_eq!((tin.labels["level"].as_str(), of_tin), ("hall", None));
        // A sixth of a litre at 400 kg/m³.
        assert!((plain.mass_kg - 0.4 / 6.0).abs() < 1e-6, "{}", plain.mass_kg);
        assert_eq!(of_plain.unwrap().kg_per_m3, 400.0);
        std::fs::remove_dir_all(path).unwrap();
    }

    #[test]
    fn everything_wrong_with_manifests_is_reported_at_once() {
        let path = folder(
            "wrong",
            &[
                ("a.obj", TETRAHEDRON),
                ("a.toml", "mass_kg = \"heavy\"\ncolour = 1\n"),
                ("b.toml", "mass_kg = 1\n"),
            ],
        );
        let Err(Failure::Usage(text)) = read_folder(&path) else {
            panic!("it is wrong");
        };
        for part in [
            "a.toml: mass_kg: is \"heavy\"",
            "a.toml: colour: is unknown",
            "b.toml: has no mesh",
        ] {
            assert!(text.contains(part), "{part} in {text}");
        }
        std::fs::remove_dir_all(path).unwrap();
    }

    #[test]
    fn two_files_of_one_name_are_refused() {
        let path = folder("twice", &[("Mug 1.obj", TETRAHEDRON), ("mug-1.stl", "solid")]);
        assert!(matches!(read_folder(&path), Err(Failure::Usage(text)) if text.contains("objects/mug-1")));
        std::fs::remove_dir_all(path).unwrap();
    }
}
