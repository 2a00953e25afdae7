//! The built-in objects are closed, solid and of the right size, and agree with their manifests.

use std::collections::HashMap;

use glam::{DVec3, Vec3};
use grasp_assets::objects::{BuiltInObject, Manifest, object, objects};
use grasp_synthesis::{geometry::mesh::TriangleMesh, model::strategy::Validity};

/// Thesis Table 5.1: name, mass in kg, triangles.
const THESIS: [(&str, f32, usize); 3] = [
    ("remote", 0.130, 2203),
    ("scalpel", 0.020, 1453),
    ("scissors", 0.050, 572),
];

fn mesh(object: &BuiltInObject) -> &TriangleMesh {
    object.object.surface.mesh()
}

fn bounds(mesh: &TriangleMesh) -> (Vec3, Vec3) {
    let first = mesh.positions()[0];
    mesh.positions()
        .iter()
        .fold((first, first), |(low, high), &p| (low.min(p), high.max(p)))
}

/// How often each directed edge is used.
fn directed_edges(mesh: &TriangleMesh) -> HashMap<(u32, u32), usize> {
    let mut edges = HashMap::new();
    for &[a, b, c] in mesh.triangles() {
        for edge in [(a, b), (b, c), (c, a)] {
            *edges.entry(edge).or_default() += 1;
        }
    }
    edges
}

fn volume(mesh: &TriangleMesh) -> f64 {
    (0..mesh.triangles().len())
        .map(|triangle| {
            let [a, b, c] = mesh.corners(triangle).map(Vec3::as_dvec3);
            a.dot(b.cross(c)) / 6.0
        })
        .sum()
}

/// The winding number of the surface around a point: its solid angle over 4π (van Oosterom and Strackee, 1983).
fn winding_number(mesh: &TriangleMesh, point: DVec3) -> f64 {
    let solid_angle: f64 = (0..mesh.triangles().len())
        .map(|triangle| {
            let [a, b, c] = mesh.corners(triangle).map(|corner| corner.as_dvec3() - point);
            let (la, lb, lc) = (a.length(), b.length(), c.length());
            let numerator = a.dot(b.cross(c));
            let denominator = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
            2.0 * numerator.atan2(denominator)
        })
        .sum();
    solid_angle / (4.0 * std::f64::consts::PI)
}

#[test]
fn objects_are_the_three_of_the_thesis_sorted_by_name() {
    let names: Vec<_> = objects().iter().map(|object| object.name).collect();
    assert_eq!(names, THESIS.map(|(name, ..)| name));
    for name in names {
        assert_eq!(object(name).unwrap().name, name);
    }
    assert!(object("Scissors").is_none());
}

#[test]
fn surfaces_are_closed_and_consistently_wound() {
    for object in objects() {
        let edges = directed_edges(mesh(object));
        for (&(from, to), &count) in &edges {
            assert_eq!(count, 1, "{}: {from} to {to}", object.name);
            assert_eq!(
                edges.get(&(to, from)),
                Some(&1),
                "{}: {to} to {from}",
                object.name
            );
        }
    }
}

#[test]
fn surfaces_are_one_piece_with_the_expected_holes() {
    for (name, holes) in [("remote", 0), ("scalpel", 0), ("scissors", 2)] {
        let mesh = mesh(object(name).unwrap());
        let used: std::collections::HashSet<u32> = mesh.triangles().iter().flatten().copied().collect();
        assert_eq!(used.len(), mesh.positions().len(), "{name} has unused vertices");
        let edges = directed_edges(mesh).len() / 2;
        // Euler: vertices − edges + faces = 2 − 2 holes.
        let (vertices, faces) = (used.len(), mesh.triangles().len());
        assert_eq!(vertices + faces + 2 * holes, edges + 2, "{name}");
        // One component: everything can be reached over edges.
        let mut parts: HashMap<u32, u32> = used.iter().map(|&v| (v, v)).collect();
        let mut changed = true;
        while changed {
            changed = false;
            for triangle in mesh.triangles() {
                let least = triangle.iter().map(|v| parts[v]).min().unwrap();
                for v in triangle {
                    changed |= parts.insert(*v, least) != Some(least);
                }
            }
        }
        let least = *used.iter().min().unwrap();
        assert!(parts.values().all(|&part| part == least), "{name} falls apart");
    }
}

#[test]
fn triangle_counts_and_masses_are_near_those_of_the_thesis() {
    for (name, mass, triangles) in THESIS {
        let object = object(name).unwrap();
        let found = mesh(object).triangles().len();
        assert!(
            found.abs_diff(triangles) * 50 <= triangles,
            "{name}: {found} instead of {triangles}"
        );
        assert_eq!(object.object.mass, mass);
        assert_eq!(object.object.friction_under(Validity::Thesis), 0.34);
    }
}

#[test]
fn volumes_are_realistic() {
    // In cm³. Steel has 7.9 g/cm³, so 50 g of scissors are 6.3 cm³ and 20 g of scalpel 2.5 cm³; a remote of 130 g is
    // mostly air and plastic of about 1 g/cm³ on the whole.
    for (name, low, high) in [
        ("remote", 110.0, 150.0),
        ("scalpel", 2.2, 3.4),
        ("scissors", 5.5, 7.5),
    ] {
        let found = volume(mesh(object(name).unwrap())) * 1e6;
        assert!((low..high).contains(&found), "{name}: {found} cm³");
    }
}

#[test]
fn sizes_are_realistic_and_frames_as_documented() {
    // In millimetres along x, y, z.
    for (name, low, high) in [
        ("remote", [45.0, 165.0, 19.0], [52.0, 175.0, 23.0]),
        ("scalpel", [8.0, 140.0, 2.5], [12.0, 160.0, 4.5]),
        ("scissors", [55.0, 150.0, 3.0], [75.0, 170.0, 7.0]),
    ] {
        let (least, greatest) = bounds(mesh(object(name).unwrap()));
        let size = (greatest - least) * 1000.0;
        assert!(
            size.cmpge(low.into()).all() && size.cmple(high.into()).all(),
            "{name}: {size} mm"
        );
        assert!(
            (least + greatest).abs().max_element() < 2e-6,
            "{name} is not centred: {least} to {greatest}"
        );
    }
}

#[test]
fn centres_of_mass_match_the_thesis() {
    for object in objects() {
        let (low, high) = bounds(mesh(object));
        let com = object.object.centre_of_mass;
        assert!(
            com.cmpge(low).all() && com.cmple(high).all(),
            "{}: {com}",
            object.name
        );
    }
    assert_eq!(object("scissors").unwrap().object.centre_of_mass, Vec3::ZERO);
    // Off-centre, toward the batteries.
    let remote = object("remote").unwrap();
    assert!((-0.04..-0.01).contains(&remote.object.centre_of_mass.y));
    assert!((winding_number(mesh(remote), remote.object.centre_of_mass.as_dvec3()) - 1.0).abs() < 1e-6);
    // The centre of the heft, which is the part thicker than a blade.
    let scalpel = object("scalpel").unwrap();
    let heft = mesh(scalpel).positions().iter().filter(|p| p.z.abs() > 0.5e-3);
    let (low, high) = heft.fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), p| {
        (low.min(p.y), high.max(p.y))
    });
    assert!((scalpel.object.centre_of_mass.y - f32::midpoint(low, high)).abs() < 1e-3);
    assert!((winding_number(mesh(scalpel), scalpel.object.centre_of_mass.as_dvec3()) - 1.0).abs() < 1e-6);
}

/// 20 mm thick: no triangle comes near the axis of a ring.
#[test]
fn fingers_fit_through_the_scissors_rings() {
    let scissors = mesh(object("scissors").unwrap());
    let mut holes = Vec::new();
    for side in [-1.0_f32, 1.0] {
        // The middle of the hole: the point of a 1 mm grid, behind the middle, that is farthest from everything along
        // z.
        let best = (0..36)
            .flat_map(|i| (0..40).map(move |j| (i, j)))
            .map(|(i, j)| Vec3::new(side * 0.001 * i as f32, -0.0395 - 0.001 * j as f32, 0.0))
            .map(|point| {
                let clearance = (0..scissors.triangles().len())
                    .map(|t| distance_in_plane(scissors.corners(t), point))
                    .fold(f32::INFINITY, f32::min);
                (clearance, point)
            })
            .max_by(|a, b| a.0.total_cmp(&b.0))
            .unwrap();
        holes.push(best);
    }
    for (clearance, middle) in holes {
        assert!(clearance > 0.010, "only {clearance} m around {middle}");
        // Within the outline, so it is a hole and not space next to the scissors.
        let (low, high) = bounds(scissors);
        assert!(middle.x.abs() + clearance < high.x && middle.y - clearance > low.y);
    }
}

/// The distance of a point from a triangle, both projected along z.
fn distance_in_plane(corners: [Vec3; 3], point: Vec3) -> f32 {
    let p = point.truncate();
    let [a, b, c] = corners.map(Vec3::truncate);
    let sides = [(a, b), (b, c), (c, a)].map(|(from, to)| (to - from).perp_dot(p - from));
    if sides.iter().all(|&s| s > 0.0) || sides.iter().all(|&s| s < 0.0) {
        return 0.0;
    }
    [(a, b), (b, c), (c, a)]
        .map(|(from, to)| {
            let along = to - from;
            let t = ((p - from).dot(along) / along.length_squared()).clamp(0.0, 1.0);
            p.distance(from + along * t)
        })
        .into_iter()
        .fold(f32::INFINITY, f32::min)
}

#[test]
fn forbidden_surfaces_are_buttons_and_the_blade() {
    assert_eq!(object("scissors").unwrap().object.forbidden_count(), 0);

    let remote = object("remote").unwrap();
    let count = remote.object.forbidden_count();
    assert!(count > 500, "{count}");
    for triangle in forbidden(remote) {
        let centre = centroid(mesh(remote), triangle);
        assert!(centre.z > 0.008, "a button at {centre} is not on the upper side");
        assert!(
            mesh(remote).normal(triangle).z > -0.01,
            "a button faces down at {centre}"
        );
        assert!(centre.y > -0.07, "there is no button at {centre}");
    }

    let scalpel = object("scalpel").unwrap();
    assert!(scalpel.object.forbidden_count() > 50);
    let (_, high) = bounds(mesh(scalpel));
    for triangle in forbidden(scalpel) {
        let centre = centroid(mesh(scalpel), triangle);
        assert!(centre.y > high.y - 0.035, "not on the blade: {centre}");
        assert!(centre.z.abs() < 0.0004, "too thick for a blade: {centre}");
    }
    // The part of the blade farthest toward +X is its edge.
    for triangle in 0..mesh(scalpel).triangles().len() {
        let centre = centroid(mesh(scalpel), triangle);
        if centre.y > high.y - 0.031 && centre.x > 0.0025 {
            assert!(
                scalpel.object.is_forbidden(triangle as u32),
                "the edge at {centre} may be touched"
            );
        }
    }
}

fn forbidden(object: &BuiltInObject) -> impl Iterator<Item = usize> {
    (0..mesh(object).triangles().len()).filter(|&t| object.object.is_forbidden(t as u32))
}

fn centroid(mesh: &TriangleMesh, triangle: usize) -> Vec3 {
    mesh.corners(triangle).into_iter().sum::<Vec3>() / 3.0
}

#[test]
fn surfaces_do_not_intersect_themselves() {
    // A closed surface that overlaps itself has a winding number other than 0 or 1 somewhere, most likely just below or
    // above its own triangles.
    for object in objects() {
        let mesh = mesh(object);
        for triangle in 0..mesh.triangles().len() {
            let normal = mesh.normal(triangle).as_dvec3();
            let centre = centroid(mesh, triangle).as_dvec3();
            // Less than half of the edge's thickness of 0.08 mm.
            for (offset, expected) in [(3e-5, 0.0), (-3e-5, 1.0)] {
                let found = winding_number(mesh, centre + normal * offset);
                assert!(
                    (found - expected).abs() < 1e-3,
                    "{}: triangle {triangle} at {centre}: {found} on the side of {expected}",
                    object.name
                );
            }
        }
    }
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
        for group in &manifest.forbidden_groups {
            assert!(
                object.groups.iter().any(|(name, _)| name == group),
                "{}: {group}",
                object.name
            );
        }
        let in_groups: usize = object.groups.iter().map(|(_, triangles)| triangles.len()).sum();
        assert_eq!(
            in_groups, manifest.triangles,
            "{}: groups overlap or leave gaps",
            object.name
        );
    }
}

#[test]
fn manifests_with_unknown_fields_are_rejected() {
    let json = objects()[0].manifest.replacen('{', "{\"weight\": 1,", 1);
    assert!(Manifest::parse(&json).unwrap_err().to_string().contains("weight"));
}
