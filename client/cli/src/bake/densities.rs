//! The mass of objects without a manifest: the volume of the mesh, and the density of the material that its parts are named after.

use grasp_import::ImportedMesh;
use serde::Serialize;

/// Density where no name says the material: between wood and plastic, with the hollows that everyday things have.
const OTHERWISE: f64 = 400.0;

/// Thickness in metres of what encloses no volume, such as a sheet.
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

/// What a mass was computed from.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Density {
    /// The word that says the material; `None` if no name does.
    pub material: Option<&'static str>,
    /// Density in kg/m³.
    pub kg_per_m3: f64,
}

/// The density that the names of a mesh's parts say; if they say several, that of the largest surface.
pub(super) fn density(read: &ImportedMesh) -> Density {
    let mut areas: Vec<(&'static str, f64, f64)> = Vec::new();
    for (name, triangles) in &read.groups {
        let Some((material, kg_per_m3)) = material_in(name) else {
            continue;
        };
        let all = triangles.iter().map(|&triangle| area(read, triangle as usize));
        areas.push((material, kg_per_m3, all.sum()));
    }
    let largest = areas.into_iter().max_by(|(_, _, a), (_, _, b)| a.total_cmp(b));
    Density {
        material: largest.map(|(material, ..)| material),
        kg_per_m3: largest.map_or(OTHERWISE, |(_, kg_per_m3, _)| kg_per_m3),
    }
}

/// The mass in kilograms of a mesh in metres.
pub(super) fn mass(read: &ImportedMesh, density: &Density) -> f32 {
    let mesh = &read.mesh;
    let volume = match mesh.volume_centroid() {
        Some(_) => mesh.signed_volume().abs(),
        None => mesh.area() * SHEET_THICKNESS,
    };
    (volume * density.kg_per_m3) as f32
}

/// The first material that a name contains as a word.
fn material_in(name: &str) -> Option<(&'static str, f64)> {
    let name = name.to_lowercase();
    let words: Vec<&str> = name.split(|c: char| !c.is_ascii_alphabetic()).collect();
    DENSITIES.iter().find_map(|(known, kg_per_m3)| {
        let word = known.iter().find(|word| words.contains(word))?;
        Some((*word, *kg_per_m3))
    })
}

fn area(read: &ImportedMesh, triangle: usize) -> f64 {
    let [a, b, c] = read.mesh.corners(triangle).map(glam::Vec3::as_dvec3);
    (b - a).cross(c - a).length() / 2.0
}

#[cfg(test)]
mod tests {
    use grasp_import::{Import, MeshLimits, read_mesh};

    use super::*;

    fn read(obj: &str) -> ImportedMesh {
        let limits = MeshLimits {
            bytes: 10_000,
            vertices: 100,
            triangles: 100,
        };
        read_mesh(obj.as_bytes(), Import::METRES, limits).unwrap()
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

    #[test]
    fn every_word_has_one_density() {
        let mut words: Vec<_> = DENSITIES.iter().flat_map(|(words, _)| *words).collect();
        let all = words.len();
        words.sort();
        words.dedup();
        assert_eq!(words.len(), all);
    }
}
