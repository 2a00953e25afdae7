//! Scissors, scalpel and remote: the objects of thesis 5.1, with the thesis' masses and about its triangle counts.

mod remote;
mod scalpel;
mod scissors;

use glam::{Quat, Vec3};
use grasp_assets::objects::{Manifest, ManifestBox};
use grasp_mesh_builder::Shape;
use grasp_synthesis::{
    geometry::{mesh::TriangleMesh, oriented_box::OrientedBox},
    model::plain_object::THESIS_FRICTION,
};

use crate::AssetFile;

/// Properties that do not follow from a mesh.
struct About {
    name: &'static str,
    build: fn() -> Shape,
    description: &'static str,
    frame: &'static str,
    /// In kilograms; thesis Table 5.1.
    mass_kg: f32,
    /// In metres, with the origin at the centre of the mesh's bounding box.
    centre_of_mass_m: Vec3,
    forbidden_groups: &'static [&'static str],
}

const OBJECTS: [About; 3] = [
    About {
        name: "remote",
        build: remote::build,
        description: "A remote control: a rounded body, thicker at the batteries, with raised buttons.",
        frame: "Origin at the centre of the bounding box, +Y toward the end that sends, +Z out of the buttons' side.",
        mass_kg: 0.130,
        // Two AA cells are about 46 of the 130 g and lie 45 mm behind the middle and 2 mm below it; the rest is
        // spread like the mesh's volume, whose centre is 4.2 mm behind the middle and 0.5 mm above it.
        centre_of_mass_m: Vec3::new(0.0, -0.019, -0.0005),
        forbidden_groups: &["buttons"],
    },
    About {
        name: "scalpel",
        build: scalpel::build,
        description: "A scalpel: handle no. 3 with a blade no. 10.",
        frame: "Origin at the centre of the bounding box, +Y toward the blade's tip, +X toward its edge, +Z out of a flat.",
        mass_kg: 0.020,
        // The middle of the heft, which reaches from 61.0 mm behind its own origin to 61.5 mm before it, as the
        // blade does to 95 mm.
        centre_of_mass_m: Vec3::new(0.0, -0.01675, 0.0),
        forbidden_groups: &["blade_edge"],
    },
    About {
        name: "scissors",
        build: scissors::build,
        description: "Shut surgical scissors with two finger rings.",
        frame: "Origin at the centre of the bounding box, +Y toward the tip, +Z out of the flat side with the screw's head.",
        mass_kg: 0.050,
        centre_of_mass_m: Vec3::ZERO,
        forbidden_groups: &[],
    },
];

/// Meshes and manifests of the objects.
pub(crate) fn generate() -> Vec<AssetFile> {
    OBJECTS.iter().flat_map(files).collect()
}

fn files(about: &About) -> [AssetFile; 2] {
    let name = about.name;
    let shape = (about.build)();
    let manifest = Manifest {
        name: name.to_owned(),
        description: about.description.to_owned(),
        frame: about.frame.to_owned(),
        mass_kg: about.mass_kg,
        centre_of_mass_m: about.centre_of_mass_m,
        friction: THESIS_FRICTION,
        forbidden_groups: about.forbidden_groups.iter().map(|&group| group.to_owned()).collect(),
        oriented_box: oriented_box(&shape),
        triangles: shape.groups.iter().map(|(_, triangles)| triangles.len()).sum(),
        vertices: shape.micrometres.len(),
        source: "grasp-assets-generator; mass, friction and centre of mass after Table 5.1 and section 4.5 of the thesis"
            .to_owned(),
        licence: "MIT OR Apache-2.0".to_owned(),
    };
    let mut json = serde_json::to_vec_pretty(&manifest).expect("a manifest is plain data");
    json.push(b'\n');
    let comment = format!("{name}, in metres; made by grasp-assets-generator");
    [
        (format!("objects/{name}.obj"), shape.obj(&comment).into_bytes()),
        (format!("objects/{name}.json"), json),
    ]
}

/// The snug box, rounded like the mesh which hides the last bits of the fit.
fn oriented_box(shape: &Shape) -> ManifestBox {
    const PER_METRE: f32 = 1e6;
    // Adding zero turns −0 into 0.
    let rounded = |value: f32| (value * PER_METRE).round() / PER_METRE + 0.0;
    let OrientedBox {
        object_from_box,
        half_extents,
    } = OrientedBox::around(&mesh(shape));
    ManifestBox {
        centre_m: object_from_box.position.to_array().map(rounded).into(),
        orientation: Quat::from_array(object_from_box.orientation.to_array().map(rounded)),
        half_extents_m: half_extents.to_array().map(rounded).into(),
    }
}

/// The mesh as the synthesis takes it.
fn mesh(shape: &Shape) -> TriangleMesh {
    let metres = |vertex: &[i64; 3]| Vec3::from(vertex.map(|coordinate| (coordinate as f64 * 1e-6) as f32));
    let triangles = shape.groups.iter().flat_map(|(_, triangles)| triangles);
    TriangleMesh::new(
        shape.micrometres.iter().map(metres).collect(),
        triangles
            .map(|triangle| triangle.map(|vertex| vertex as u32))
            .collect(),
    )
    .expect("the shapes have sound triangles")
}
