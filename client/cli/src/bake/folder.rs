//! The folder's meshes with their manifests, or with what stands in for these.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use grasp_client::v1;
use grasp_import::{Import, MeshLimits, read_mesh};
use grasp_server::{FolderObject, objects_of_folder};

use super::densities::{Density, density, mass};
use crate::{Failure, format::joined, objects::id_from_file};

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
    pub manifest: Option<v1::GraspObject>,
}

/// Reads the manifests of a folder.
///
/// # Errors
/// Everything that is wrong with it.
pub(super) fn read_folder(path: &Path) -> Result<Vec<Baked>, Failure> {
    let found = objects_of_folder(path).map_err(|problems| {
        let problems = joined("\n  ", problems);
        Failure::Usage(format!("{} cannot be baked:\n  {problems}", path.display()))
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
pub(super) fn new_object(baked: Baked) -> Result<(v1::CreateObjectRequest, Option<Density>), String> {
    let mesh = std::fs::read(&baked.mesh).map_err(|error| format!("cannot be read: {error}"))?;
    let Some(manifest) = baked.manifest else {
        let read = read_mesh(&mesh, Import::METRES, LIMITS).map_err(|errors| joined("; ", errors))?;
        let density = density(&read);
        let mass = mass(&read, &density);
        return Ok((v1::CreateObjectRequest::new(baked.id, mesh, mass), Some(density)));
    };
    let object = v1::GraspObject {
        name: format!("objects/{}", baked.id),
        ..manifest
    };
    let request = v1::CreateObjectRequest {
        object: Some(object),
        mesh,
        request_id: String::new(),
    };
    Ok((request, None))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        input::example_of,
        objects::marks::{KNOWN_GRIPS, REGIONS},
    };

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
                    "mass_kg = 0.2\nz_up = true\nlabels.level = \"hall\"\n",
                ),
                ("plain.obj", TETRAHEDRON),
                ("notes.txt", "of no interest"),
            ],
        );
        let objects = read_folder(&path).unwrap();
        let [(tin, of_tin), (plain, of_plain)] =
            [0, 1].map(|place| new_object(objects[place].clone()).unwrap());
        let [tin, plain] = [tin, plain].map(|request| request.object.unwrap());
        assert_eq!(
            (tin.name.as_str(), tin.mass_kg, tin.z_up),
            ("objects/tea-tin", 0.2, true)
        );
        assert_eq!((tin.labels["level"].as_str(), of_tin), ("hall", None));
        // A sixth of a litre at 400 kg/m³.
        assert!((plain.mass_kg - 0.4 / 6.0).abs() < 1e-6, "{}", plain.mass_kg);
        assert_eq!(of_plain.unwrap().kg_per_m3, 400.0);
        std::fs::remove_dir_all(path).unwrap();
    }

    /// As the documentation of `grasp objects create` writes them, in TOML.
    const MANIFEST: &str = r#"
mass_kg = 0.2
regions = [
    { name = "handle", preference = "preferred", weight = 0.8, groups = ["grip"], triangles = [7], shapes = [{ tube = { points = [[0.04, 0, 0], [0.07, 0.03, 0]], radii = [0.012] } }] },
    { name = "rim", preference = "avoided", shapes = [{ half_space = { point = [0, 0.09, 0], normal = [0, 1, 0] } }] },
    { name = "blade", preference = "forbidden", shapes = [{ tube = { points = [[0, 0, 0]], radii = [0.03] } },
        { box = { pose = { position = [0, 0.1, 0] }, half_extents = [0.01, 0.05, 0.02] } }] },
]

[[known_grips]]
name = "by the handle"
preference = "preferred"
hand.rig = "rigs/adult"
hand.handedness = "right"
hand.scale = 1
hand.object_from_wrist = { position = [0.1, 0, 0], orientation = [0, 0, 0, 1] }
hand.thumb = { base_yaw = 0, base_pitch = 0.3, second_pitch = 0.4, third_pitch = 0.3 }
hand.index = {}
hand.middle = {}
hand.ring = {}
hand.little = {}

[[known_grips]]
name = "through the cup"
preference = "forbidden"
near_distance = 0.03
near_angle = 0.5
hand = { rig = "rigs/adult", handedness = "left", object_from_wrist = { position = [0, 0.1, 0] } }
"#;

    #[test]
    fn manifests_have_the_regions_and_grips_that_files_of_them_have() {
        let path = folder("regions", &[("mug.obj", TETRAHEDRON), ("mug.toml", MANIFEST)]);
        let (request, _) = new_object(read_folder(&path).unwrap()[0].clone()).unwrap();
        let mug = request.object.unwrap();
        assert_eq!(
            (mug.regions, mug.known_grips),
            (example_of(REGIONS), example_of(KNOWN_GRIPS))
        );
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
