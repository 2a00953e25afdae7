//! Distances of tapered capsules to points, capsules and meshes, against brute force over their spheres.

use grasp_synthesis::physical::solids::{closest, comes_within};

use crate::prelude::*;

/// Number of spheres along the axis that brute force tries.
const SAMPLES: u16 = 1000;

const ROUNDING: f32 = 2e-6;

/// Accuracy of gaps to meshes, in metres, with rounding.
const ACCURACY: f32 = 1e-5 + ROUNDING;

/// Error of brute force: half a step along the axis, and the change of the radius over it.
fn brute_slack(capsule: &TaperedCapsule) -> f32 {
    let change = capsule.length() + (capsule.end_radius - capsule.start_radius).abs();
    0.5 * change / f32::from(SAMPLES) + ROUNDING
}

fn capsule(random: &mut Random, near: Vec3) -> TaperedCapsule {
    let start = near + random.direction() * random.between(0.0, 0.03);
    random.capsule(start)
}

/// Asserts that a distance is the least one found by brute force, within its error.
fn assert_least(distance: f32, sampled: impl Iterator<Item = f32>, accuracy: f32, slack: f32, what: &str) {
    let least = sampled.fold(f32::INFINITY, f32::min);
    let is_least = distance <= least + accuracy && distance >= least - slack;
    assert!(is_least, "{what}: {distance}, brute force says {least}");
}

#[test]
fn point_distances_match_nearest_sphere() {
    let mut random = Random::new(11);
    for i in 0..2000 {
        let capsule = capsule(&mut random, Vec3::ZERO);
        let point = random.in_cube() * 0.08;
        let sampled = balls(&capsule, SAMPLES).map(|(at, radius)| at.distance(point) - radius);
        let distance = capsule.signed_distance(point);
        let what = format!("{i}: {capsule:?} {point}");
        assert_least(distance, sampled, ROUNDING, brute_slack(&capsule), &what);
    }
}

#[test]
fn capsule_distances_match_nearest_spheres() {
    let mut random = Random::new(12);
    for i in 0..3000 {
        let a = capsule(&mut random, Vec3::ZERO);
        let near = random.in_cube() * 0.03;
        let b = match random.index(4) {
            // Parallel and collinear ones have many nearest points.
            0 => TaperedCapsule::new(a.start + near, a.end + near, 0.008, 0.006),
            1 => TaperedCapsule::new(a.end, a.end + (a.end - a.start), 0.008, 0.008),
            _ => capsule(&mut random, near),
        };
        let sampled = balls(&a, SAMPLES).map(|(at, radius)| b.signed_distance(at) - radius);
        let distance = a.distance(&b);
        let what = format!("{i}: {a:?} {b:?}");
        assert_least(distance, sampled, ROUNDING, brute_slack(&a), &what);
        assert!((b.distance(&a) - distance).abs() <= ROUNDING, "{i}");
        let frame = Pose::new(random.in_cube(), random.rotation());
        let moved = a.transformed(frame).distance(&b.transformed(frame));
        assert!((moved - distance).abs() <= ROUNDING, "{i} {distance} {moved}");
    }
}

/// Compares the gap to a mesh's surface with the gaps of the capsule's spheres.
fn compare(name: &str, surface: &MeshBvh, count: usize) {
    let mut random = Random::new(13);
    let part = |odd: usize| surface.mesh().submesh(|triangle| triangle % 2 == odd);
    let parts = [part(0), part(1)].into_iter().flatten();
    let parts: Vec<MeshBvh> = parts.map(MeshBvh::build_quick).collect();
    for i in 0..count {
        let (near, _) = random.on_surface(surface.mesh());
        let capsule = capsule(&mut random, near);
        let what = format!("{name} {i}: {capsule:?}");
        let within = [f32::INFINITY, 0.005, -0.001][random.index(3)];
        let gaps = balls(&capsule, SAMPLES).map(|(at, radius)| {
            let closest = surface.closest_point_within(at, f32::INFINITY);
            closest.expect("there is a surface").distance - radius
        });
        let expected = gaps.fold(f32::INFINITY, f32::min);
        if (expected - within).abs() > brute_slack(&capsule) {
            let comes_within = surface.comes_within(&capsule, within);
            // The smaller of the gaps to two complementary submeshes is the gap to the whole.
            let of_parts = parts.iter().any(|part| part.comes_within(&capsule, within));
            assert_eq!(of_parts, comes_within, "{what}");
            assert_eq!(comes_within, expected < within, "{what} {expected} {within}");
        }
        let Some(gap) = surface.closest_to_capsule(&capsule, within) else {
            assert!(expected > within - ROUNDING, "{what} {expected} {within}");
            continue;
        };
        assert!(gap.gap <= within, "{what}: {gap:?} is not within {within}");
        let sampled = std::iter::once(expected);
        assert_least(gap.gap, sampled, ACCURACY, brute_slack(&capsule), &what);
        let way = capsule.at(gap.along).distance(gap.position) - capsule.radius_at(gap.along);
        assert!((way - gap.gap).abs() <= ROUNDING, "{what} {gap:?} {way}");
    }
}

#[test]
fn gaps_to_meshes_match_nearest_spheres() {
    for (name, mesh) in meshes::all_and_real() {
        let count = if name.contains('/') { 30 } else { 300 };
        compare(&name, &MeshBvh::build(mesh), count);
    }
}

/// Compares the clearance with the smallest signed distance of a point of the axis minus its radius.
#[test]
fn clearances_from_solids_match_nearest_or_deepest_spheres() {
    for (name, mesh) in meshes::solids() {
        let surface = MeshBvh::build(mesh);
        let mut random = Random::new(14);
        let mut deep = 0;
        for i in 0..300 {
            let (near, _) = random.on_surface(surface.mesh());
            let capsule = capsule(&mut random, near);
            let (mut expected, mut is_inside) = (f32::INFINITY, false);
            for (at, radius) in balls(&capsule, SAMPLES) {
                let closest = surface.closest_point_within(at, f32::INFINITY);
                let distance = closest.expect("there is a surface").distance;
                let inside = surface.contains(at);
                is_inside |= inside;
                expected = expected.min(if inside { -distance } else { distance } - radius);
            }
            deep += usize::from(is_inside);
            let what =
                format!("{name} {i}: brute force says {expected} for {capsule:?}, inside: {is_inside}");
            let tolerance = brute_slack(&capsule) + if is_inside { 1e-3 } else { ACCURACY };
            let found = clearance(&capsule, &surface, 0.1);
            assert!((found - expected.min(0.1)).abs() <= tolerance, "{what} {found}");
            if let Some(touch) = closest(&capsule, &surface, 0.1) {
                assert_eq!(touch.gap, found, "{what}");
            }
            if (expected + 0.002).abs() > brute_slack(&capsule) {
                let sinks = comes_within(&capsule, &surface, -0.002);
                assert_eq!(sinks, expected < -0.002, "{what}");
            }
        }
        let is_thin = name == "needle" || name == "plate";
        assert!(
            is_thin || (10..290).contains(&deep),
            "{name}: {deep} axes enter it"
        );
    }
}

#[test]
fn gap_lower_bounds_never_exceed_gaps() {
    let mut random = Random::new(17);
    let mut positive = 0;
    for (name, mesh) in meshes::all()
        .into_iter()
        .chain([("crowded needles", meshes::needles(4_000))])
    {
        let prepared = MeshBvh::build(mesh.clone());
        // Without a distance field, every answer comes from the triangles.
        let exact = MeshBvh::build_quick(mesh.clone());
        for i in 0..400 {
            let near = random.near(&mesh, 0.1);
            let capsule = capsule(&mut random, near);
            let bound = prepared.gap_lower_bound(&capsule);
            let gap = exact.closest_to_capsule(&capsule, 1.0).map_or(1.0, |gap| gap.gap);
            assert!(bound <= gap + ACCURACY, "{name} {i} {bound} {gap} {capsule:?}");
            positive += u32::from(bound > 0.0);
        }
    }
    assert!(positive > 500, "{positive} positive bounds");
}
