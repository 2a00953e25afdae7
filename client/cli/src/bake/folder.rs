//! The folder's meshes with their manifests, or else with masses of the density of their material.

use std::{collections::BTreeMap, path::Path};

use glam::Vec3;
use grasp_client::v1;
use grasp_import::{Import, ImportedMesh, read_mesh};
use grasp_server::{FolderObject, objects_of_folder};
use serde::Serialize;

use crate::{
    Failure,
    input::{MESH_LIMITS, id_from_file},
    output::joined,
};

/// Density where no name says the material: between wood and plastic, with the hollows that everyday things have.
const OTHERWISE: f64 = 400.0;

/// Thickness in metres of meshes that enclose no volume, such as a sheet.
const SHEET_THICKNESS: f64 = 0.002;

/// Words in the names of parts, with densities in kg/m³: handbook values of solid materials.
const DENSITIES: [(&[&str], f64); 17] = [
    (&["foam", "sponge", "styrofoam"], 40.0),
    (&["cork"], 200.0),
    (&["cloth", "fabric", "textile", "wool", "cotton"], 300.0),
    (&["cardboard", "carton"], 650.0),
    (&["wood", "wooden", "oak", "pine", "beech", "bamboo"], 650.0),
    (&["paper", "book"], 800.0),
    (&["leather"], 900.0),
    (&["wax"], 930.0),
    (&["plastic", "polymer", "nylon", "abs"], 1050.0),
    (&["rubber", "silicone"], 1150.0),
    (&["brick", "clay", "terracotta"], 1900.0),
    (&["ceramic", "porcelain", "china", "concrete"], 2400.0),
    (&["glass"], 2500.0),
    (&["stone", "marble", "granite", "aluminium", "aluminum"], 2700.0),
    (&["steel", "iron", "metal", "chrome"], 7800.0),
    (&["brass", "bronze", "copper"], 8700.0),
    (&["silver"], 10_500.0),
];

/// The density behind a computed mass.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Density {
    /// The word that names the material; `None` if no part has one.
    pub material: Option<&'static str>,
    /// Density in kg/m³.
    pub kg_per_m3: f64,
}

/// Reads the manifests of a folder.
///
/// # Errors
/// All problems of the folder.
pub(super) fn read_folder(path: &Path) -> Result<Vec<FolderObject>, Failure> {
    let found = objects_of_folder(path).map_err(|problems| {
        let problems = joined("\n  ", problems);
        Failure::usage(format!("{} cannot be baked:\n  {problems}", path.display()))
    })?;
    if found.is_empty() {
        return Err(Failure::usage(format!("{} has no meshes", path.display())));
    }
    let mut names: BTreeMap<String, &Path> = BTreeMap::new();
    for FolderObject { mesh, .. } in &found {
        let id = id_from_file(mesh);
        if let Some(other) = names.insert(id.clone(), mesh) {
            return Err(Failure::usage(format!(
                "{} and {} would both be objects/{id}; rename one of them",
                other.display(),
                mesh.display()
            )));
        }
    }
    Ok(found)
}

pub(super) struct NewObject {
    pub request: v1::CreateObjectRequest,
    /// The density that its mass was computed with; `None` if a manifest has the mass.
    pub density: Option<Density>,
}

/// The object to create.
///
/// # Errors
/// Why the mesh is invalid, in words.
pub(super) fn new_object(file: FolderObject) -> Result<NewObject, String> {
    let id = id_from_file(&file.mesh);
    let mesh = std::fs::read(&file.mesh).map_err(|error| format!("cannot be read: {error}"))?;
    if let Some(manifest) = file.manifest {
        let mut request = v1::CreateObjectRequest::new(id, mesh, manifest.mass_kg);
        let name = std::mem::take(&mut request.object_mut().name);
        *request.object_mut() = v1::GraspObject { name, ..manifest };
        let density = None;
        return Ok(NewObject { request, density });
    }
    let read = read_mesh(&mesh, Import::METRES, MESH_LIMITS).map_err(|errors| joined("; ", errors))?;
    let density = density(&read);
    Ok(NewObject {
        request: v1::CreateObjectRequest::new(id, mesh, mass(&read, &density)),
        density: Some(density),
    })
}

/// The density of the material that a mesh's parts are named after; of several, the one with the largest surface.
fn density(read: &ImportedMesh) -> Density {
    let mut largest = (0.0, None);
    for (name, triangles) in &read.groups {
        let area = triangles.iter().map(|&triangle| area(read, triangle)).sum();
        if let Some(known) = density_of_name(name)
            && area >= largest.0
        {
            largest = (area, Some(known));
        }
    }
    largest.1.unwrap_or(Density {
        material: None,
        kg_per_m3: OTHERWISE,
    })
}

fn mass(read: &ImportedMesh, density: &Density) -> f32 {
    let mesh = &read.mesh;
    let volume = match mesh.volume_centroid() {
        Some(_) => mesh.signed_volume().abs(),
        None => mesh.area() * SHEET_THICKNESS,
    };
    (volume * density.kg_per_m3) as f32
}

/// The density of the first material that a name contains as a word.
fn density_of_name(name: &str) -> Option<Density> {
    let name = name.to_lowercase();
    let words: Vec<&str> = name.split(|c: char| !c.is_ascii_alphabetic()).collect();
    DENSITIES.iter().find_map(|&(known, kg_per_m3)| {
        let material = known.iter().copied().find(|word| words.contains(word));
        material.map(|_| Density { material, kg_per_m3 })
    })
}

fn area(read: &ImportedMesh, triangle: u32) -> f64 {
    let [a, b, c] = read.mesh.corners(triangle as usize).map(Vec3::as_dvec3);
    (b - a).cross(c - a).length() / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_files_of_one_name_are_refused() {
        let path = std::env::temp_dir().join(format!("grasp-bake-twice-{}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        for name in ["Mug 1.obj", "mug-1.stl"] {
            std::fs::write(path.join(name), "").unwrap();
        }
        let failure = read_folder(&path).unwrap_err();
        assert!(failure.message.contains("objects/mug-1"), "{failure:?}");
        std::fs::remove_dir_all(path).unwrap();
    }

    fn read(obj: &str) -> ImportedMesh {
        read_mesh(obj.as_bytes(), Import::METRES, MESH_LIMITS).unwrap()
    }

    /// A box of 10, 20 and 30 cm whose four sides and two ends have these materials.
    fn boxed(sides: &str, ends: &str) -> ImportedMesh {
        read(&format!(
            "v 0 0 0\nv .1 0 0\nv .1 .2 0\nv 0 .2 0\nv 0 0 .3\nv .1 0 .3\nv .1 .2 .3\nv 0 .2 .3\n\
             usemtl {ends}\nf 1 4 3 2\nf 5 6 7 8\n\
             usemtl {sides}\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n"
        ))
    }

    #[test]
    fn the_material_of_the_largest_surface_decides() {
        let wood = density(&boxed("Oak_wood.001", "steel"));
        assert_eq!((wood.material, wood.kg_per_m3), (Some("wood"), 650.0));
        let steel = density(&boxed("painted", "Brushed-Steel"));
        assert_eq!(steel.material, Some("steel"));
        let none = density(&boxed("woodpecker", "painted"));
        assert_eq!((none.material, none.kg_per_m3), (None, 400.0));
    }

    #[test]
    fn the_mass_is_that_of_the_volume_or_of_a_sheet() {
        let sheet = read("usemtl paper\nv 0 0 0\nv .2 0 0\nv .2 .1 0\nv 0 .1 0\nf 1 2 3 4\n");
        for (mesh, expected) in [(boxed("painted", "painted"), 2400.0), (sheet, 32.0)] {
            let grams = 1000.0 * mass(&mesh, &density(&mesh));
            assert!((grams - expected).abs() < 0.01, "{grams}");
        }
    }
}
