//! The built-in objects are closed and of the right size, and agree with the thesis and with their manifests.

use glam::Vec3;
use grasp_assets::{
    atlases::{grips, held_primitives},
    objects::{BuiltInObject, Manifest, object, objects},
};
use grasp_synthesis::{
    geometry::{mesh::TriangleMesh, topology::Topology},
    known::primitives::Primitive,
    model::strategy::Validity,
};

/// What is known of an object: name, mass in kg and triangles in Table 5.1 of the thesis; least and greatest size along x, y, z in
/// mm; least and greatest volume in cm³. Steel has 7.9 g/cm³, so 50 g of scissors are 6.3 cm³ and 20 g of scalpel 2.5 cm³; a remote
/// of 130 g is mostly air and plastic of about 1 g/cm³ on the whole.
struct About {
    name: &'static str,
    mass: f32,
    triangles: usize,
    sizes: [[f32; 3]; 2],
    volumes: [f64; 2],
}

const ALL: [About; 3] = [
    About {
        name: "remote",
        mass: 0.130,
        triangles: 2203,
        sizes: [[45.0, 165.0, 19.0], [52.0, 175.0, 23.0]],
        volumes: [110.0, 150.0],
    },
    About {
        name: "scalpel",
        mass: 0.020,
        triangles: 1453,
        sizes: [[8.0, 140.0, 2.5], [12.0, 160.0, 4.5]],
        volumes: [2.2, 3.4],
    },
    About {
        name: "scissors",
        mass: 0.050,
        triangles: 572,
        sizes: [[55.0, 150.0, 3.0], [75.0, 170.0, 7.0]],
        volumes: [5.5, 7.5],
    },
];

fn mesh(object: &BuiltInObject) -> &TriangleMesh {
    object.object.surface.mesh()
}

#[test]
fn objects_are_closed_and_as_the_thesis_describes_them() {
    let names: Vec<_> = objects().iter().map(|object| object.name).collect();
    assert_eq!(names, ALL.map(|about| about.name));
    assert!(object("Scissors").is_none());
    for about in ALL {
        let name = about.name;
        let object = object(name).expect("it is built in");
        let mesh = mesh(object);
        let topology = Topology::of(mesh);
        assert!(topology.is_closed() && topology.is_consistently_wound(), "{name}");
        let triangles = mesh.triangles().len();
        assert!(
            triangles.abs_diff(about.triangles) * 50 <= about.triangles,
            "{name}: {triangles}"
        );
        assert_eq!(object.object.mass, about.mass);
        assert_eq!(object.object.friction_under(Validity::Thesis), 0.34);
        let volume = mesh.signed_volume() * 1e6;
        assert!(
            (about.volumes[0]..about.volumes[1]).contains(&volume),
            "{name}: {volume} cm³"
        );
        let [least, greatest] = about.sizes.map(Vec3::from);
        let size = mesh.aabb().extents() * 1000.0;
        assert!(
            size.cmpge(least).all() && size.cmple(greatest).all(),
            "{name}: {size} mm"
        );
        assert!(
            mesh.aabb().centre().abs().max_element() < 1e-6,
            "{name} is not centred"
        );
        assert!(mesh.aabb().contains(object.object.centre_of_mass), "{name}");
    }
}

#[test]
fn forbidden_surfaces_are_buttons_and_the_blade() {
    assert_eq!(object("scissors").unwrap().object.forbidden_count(), 0);

    let remote = object("remote").unwrap();
    assert!(remote.object.forbidden_count() > 500);
    for triangle in forbidden(remote) {
        let centre = centroid(mesh(remote), triangle);
        let faces_up = mesh(remote).normal(triangle).z > -0.01;
        assert!(
            centre.z > 0.008 && centre.y > -0.07 && faces_up,
            "no button is at {centre}"
        );
    }

    let scalpel = object("scalpel").unwrap();
    assert!(scalpel.object.forbidden_count() > 50);
    let high = mesh(scalpel).aabb().max;
    for triangle in forbidden(scalpel) {
        let centre = centroid(mesh(scalpel), triangle);
        let is_thin = centre.z.abs() < 0.0004;
        assert!(centre.y > high.y - 0.035 && is_thin, "not on the blade: {centre}");
    }
}

fn forbidden(object: &BuiltInObject) -> impl Iterator<Item = usize> {
    (0..mesh(object).triangles().len()).filter(|&t| object.object.is_forbidden(t as u32))
}

fn centroid(mesh: &TriangleMesh, triangle: usize) -> Vec3 {
    mesh.corners(triangle).into_iter().sum::<Vec3>() / 3.0
}

#[test]
fn manifests_agree_with_the_meshes() {
    for object in objects() {
        let manifest = Manifest::parse(object.manifest).unwrap();
        assert_eq!(manifest.name, object.name);
        assert_eq!(manifest.triangles, mesh(object).triangles().len());
        assert_eq!(manifest.vertices, mesh(object).positions().len());
        assert_eq!(manifest.mass_kg, object.object.mass);
        assert_eq!(manifest.centre_of_mass_m, object.object.centre_of_mass);
        let stated = manifest.oriented_box;
        let fitted = object.object.bounding_box;
        let difference = (stated.centre_m - fitted.object_from_box.position)
            .abs()
            .max((stated.half_extents_m - fitted.half_extents).abs());
        assert!(difference.max_element() < 2e-6, "{}: {stated:?}", object.name);
        assert!(stated.orientation.is_normalized());
        assert!(
            stated
                .orientation
                .angle_between(fitted.object_from_box.orientation)
                < 1e-3
        );
    }
}

/// Distance of a point from the surface of a centred box.
fn from_box(half: Vec3, point: Vec3) -> f32 {
    let beyond = point.abs() - half;
    let outside = beyond.max(Vec3::ZERO).length();
    (outside + beyond.max_element().min(0.0)).abs()
}

#[test]
fn both_hands_have_many_touching_grips_of_every_primitive() {
    assert_eq!(held_primitives().len(), 2);
    for (hand, held) in held_primitives() {
        let primitives: Vec<Primitive> = held.iter().map(|held| held.primitive).collect();
        assert_eq!(primitives, Primitive::ALL);
        for held in held.iter() {
            let name = held.primitive.name();
            assert!(grips(held.primitive, &hand.rig).is_some());
            let entries = held.grips.entries();
            assert!((50..1000).contains(&entries.len()), "{name}: {}", entries.len());
            for contact in entries.iter().flat_map(|entry| &entry.contacts) {
                let off = from_box(held.primitive.half_extents, contact.position);
                assert!(off < 1e-5, "{name}: a contact is {off} m off the surface");
            }
        }
    }
}
