//! The objects are sound meshes of the stated sizes, masses and names.

use std::collections::HashSet;

use crate::{EverydayObject, everyday_objects, table};
use glam::{DVec3, Vec3};
use grasp_import::{Import, ImportedMesh, MeshLimits, read_mesh};
use grasp_synthesis::geometry::{mesh::TriangleMesh, topology::Topology};

/// Most triangles of an object: as many as a detailed scan has, and quick to search.
const MAX_TRIANGLES: usize = 6000;

/// How far an edge of the bounding box may be from the stated one: in millimetres, and relative to it.
const SIZE_TOLERANCE_MM: f64 = 0.6;
const SIZE_TOLERANCE: f64 = 0.02;

/// Names that no created object may have.
const BUILT_IN: [&str; 3] = ["remote", "scalpel", "scissors"];

fn read(object: &EverydayObject) -> ImportedMesh {
    let limits = MeshLimits {
        bytes: 8 << 20,
        vertices: 200_000,
        triangles: 200_000,
    };
    read_mesh(object.obj().as_bytes(), Import::METRES, limits)
        .unwrap_or_else(|errors| panic!("{}: {errors:?}", object.name))
}

fn object(name: &str) -> EverydayObject {
    let found = everyday_objects().into_iter().find(|object| object.name == name);
    found.unwrap_or_else(|| panic!("there is no {name}"))
}

/// The part of a mesh that belongs to a group.
fn part(read: &ImportedMesh, name: &str) -> TriangleMesh {
    let (_, triangles) = read.groups.iter().find(|(group, _)| group == name).unwrap();
    let triangles: HashSet<usize> = triangles.iter().map(|&triangle| triangle as usize).collect();
    read.mesh
        .submesh(|triangle| triangles.contains(&triangle))
        .unwrap()
}

#[test]
fn there_are_sixty_objects_with_unique_ids() {
    let objects = everyday_objects();
    let names: HashSet<_> = objects.iter().map(|object| object.name).collect();
    assert!(names.len() >= 60, "{} names", names.len());
    assert_eq!(names.len(), objects.len(), "names are not unique");
    for name in names {
        let is_allowed = |c: char| c.is_ascii_lowercase() || c == '-';
        assert!(name.chars().all(is_allowed) && name.len() <= 63, "{name}");
        assert!(!BUILT_IN.contains(&name), "{name} is built in");
    }
}

#[test]
fn meshes_are_sound_face_outward_and_have_the_stated_sizes() {
    for object in everyday_objects() {
        let what = object.name;
        let read = read(&object);
        assert!(
            read.triangles_in_file <= MAX_TRIANGLES,
            "{what}: {}",
            read.triangles_in_file
        );
        assert_eq!(read.triangles_in_file, object.triangle_count());
        assert_eq!(
            read.mesh.triangles().len(),
            read.triangles_in_file,
            "{what}: {:?}",
            read.warnings
        );
        let topology = Topology::of(&read.mesh);
        assert_eq!(
            topology.is_closed(),
            object.is_closed,
            "{what}: {:?}",
            read.warnings
        );
        assert!(topology.is_consistently_wound(), "{what}");
        // Parts of one thing may overlap without sharing vertices.
        let is_defect = |warning: &&String| !warning.contains("parts are disconnected");
        assert!(
            !object.is_closed || !read.warnings.iter().any(|warning| is_defect(&warning)),
            "{what}"
        );
        for name in object.parts.iter().map(|part| part.name) {
            let part = part(&read, name);
            if Topology::of(&part).is_closed() {
                assert!(part.signed_volume() > 0.0, "{what}: {name} is inside out");
            } else {
                assert!(!object.is_closed, "{what}: {name} is open");
            }
        }
        let aabb = read.mesh.aabb();
        for (size, stated) in (aabb.extents() * 1000.0)
            .to_array()
            .into_iter()
            .zip(object.size_mm)
        {
            let tolerance = SIZE_TOLERANCE_MM + SIZE_TOLERANCE * stated;
            assert!(
                (f64::from(size) - stated).abs() <= tolerance,
                "{what}: {size} mm, not {stated}"
            );
        }
        assert!(aabb.centre().length() < 1e-5, "{what}");
        let mass = object.mass_kg();
        assert!((1e-4..10.0).contains(&mass), "{what}: {mass} kg");
        let centre = object.centre_of_mass().unwrap_or(DVec3::ZERO).as_vec3();
        let half = aabb.extents() / 2.0 + Vec3::splat(1e-4);
        assert!(centre.abs().cmple(half).all(), "{what}: {centre}");
    }
}

#[test]
fn forbidden_groups_exist_and_leave_something_to_hold() {
    for object in everyday_objects() {
        for group in &object.forbidden {
            assert!(
                object.parts.iter().any(|part| part.name == *group),
                "{}: {group}",
                object.name
            );
        }
        assert!(object.forbidden.len() < object.parts.len(), "{}", object.name);
    }
}

/// A regular polygon of `corners` has this share of its circle's area.
fn polygon_share(corners: f64) -> f64 {
    let angle = std::f64::consts::TAU / corners;
    angle.sin() / angle
}

#[test]
fn volumes_are_those_of_closed_forms() {
    use std::f64::consts::PI;
    let volume = |name: &str| read(&object(name)).mesh.signed_volume() * 1e9;
    let close = |found: f64, expected: f64, tolerance: f64| {
        assert!(
            (found / expected - 1.0).abs() < tolerance,
            "{found} mm³, not {expected}"
        );
    };
    close(volume("brick"), 240.0 * 71.0 * 115.0, 1e-4);
    close(volume("moving-box"), 400.0_f64.powi(3), 1e-4);
    // A torus of a polygon of 12 corners, around a polygon of 72.
    let section = PI * 100.0 * polygon_share(12.0);
    close(
        volume("hoop"),
        section * 2.0 * 440.0 * 72.0 * (PI / 72.0).sin(),
        2e-3,
    );
    // A ball's inscribed rings lose little more than 2 %.
    close(volume("golf-ball"), 4.0 / 3.0 * PI * 21.35_f64.powi(3), 0.025);
    // A prism of six sides with a pyramid's frustum as its point.
    let hexagon = |radius: f64| 1.5 * 3.0_f64.sqrt() * radius * radius;
    let [thin, thick] = [hexagon(0.4), hexagon(3.9)];
    close(
        volume("pencil"),
        thick * 154.5 + 20.5 / 3.0 * (thin + thick + (thin * thick).sqrt()),
        1e-3,
    );
}

#[test]
fn centres_of_mass_are_those_of_closed_forms() {
    // A bar of 0.1 kg at 1280 mm on a stick of 0.7 kg and 1300 mm, whose middle is the origin.
    let centre = object("stick-with-bar").centre_of_mass().unwrap();
    assert!(
        (centre - DVec3::Y * (0.1 * 0.63 / 0.8)).length() < 1e-5,
        "{centre}"
    );
    // A sheet's is on its surface: a third of a parabola's depth below its top.
    let centre = object("letter").centre_of_mass().unwrap();
    assert!(
        (centre.z * 1000.0 - 15.0 * (2.0 / 3.0 - 0.5)).abs() < 0.3,
        "{centre}"
    );
    assert_eq!(object("brick").centre_of_mass(), None);
}

#[test]
fn manifests_have_the_format_of_a_folder_of_objects() {
    assert_eq!(
        object("sword")
            .manifest()
            .lines()
            .skip(1)
            .filter(|line| !line.starts_with("centre"))
            .collect::<Vec<_>>(),
        [
            "mass_kg = 1.2",
            "friction = 0.52",
            "",
            "[forbidden]",
            "groups = [\"blade\", \"guard\"]"
        ]
    );
    assert_eq!(
        object("brick").manifest().lines().skip(1).collect::<Vec<_>>(),
        ["mass_kg = 3.4", "friction = 0.61"]
    );
}

#[test]
fn readme_lists_every_object() {
    let readme = include_str!("../README.md");
    let expected: Vec<String> = table(&everyday_objects())
        .lines()
        .skip(1)
        .map(|line| {
            let [name, what, size, mass, surface, _, source, beyond] =
                line.split('\t').collect::<Vec<_>>()[..]
            else {
                panic!("{line}");
            };
            let hands = if beyond.is_empty() { "one" } else { "two" };
            format!("| {name} | {what} | {size} | {mass} | {surface} | {source} | {hands} |")
        })
        .collect();
    let listed: Vec<&str> = readme
        .lines()
        .filter(|line| line.ends_with("| one |") || line.ends_with("| two |"))
        .collect();
    assert_eq!(listed, expected, "the table should be:\n{}", expected.join("\n"));
}
