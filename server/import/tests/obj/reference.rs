//! A second, simple reader for well-formed text, which splits all polygons into fans, to compare with.

use std::collections::{BTreeMap, BTreeSet};

use glam::{DVec3, Vec3};

/// Triangles by position in file order, and the triangles of each name.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct Reference {
    pub(crate) triangles: Vec<[Vec3; 3]>,
    pub(crate) groups: BTreeMap<String, Vec<u32>>,
    /// Is some polygon not the fan of its first corner?
    has_concave: bool,
}

/// Reads text that the real reader accepted; leaves out triangles with two equal corners, without area, and those
/// that came before.
pub(crate) fn read(text: &str, unit_metres: f32) -> Reference {
    let text = text.replace("\\\r\n", " ").replace("\\\n", " ");
    let vertices: Vec<Vec3> = text
        .lines()
        .filter_map(|line| line.trim().strip_prefix("v "))
        .map(|numbers| {
            let n: Vec<f32> = numbers
                .split_whitespace()
                .take(3)
                .map(|number| number.parse().unwrap())
                .collect();
            Vec3::new(n[0], n[1], n[2]) * unit_metres
        })
        .collect();
    let mut reference = Reference::default();
    let mut seen: BTreeSet<[[u32; 3]; 3]> = BTreeSet::new();
    let (mut group, mut object, mut material) = (Vec::new(), Vec::new(), Vec::new());
    let mut before = 0_i64;
    for line in text.lines().map(str::trim) {
        let (keyword, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let rest = rest.trim();
        let whole = || {
            if rest.is_empty() {
                vec![]
            } else {
                vec![rest.to_owned()]
            }
        };
        match keyword {
            "v" => before += 1,
            "g" => group = rest.split_whitespace().map(str::to_owned).collect(),
            "o" => object = whole(),
            "usemtl" => material = whole(),
            "f" => {
                let corners: Vec<Vec3> = rest
                    .split_whitespace()
                    .map(|corner| {
                        let index: i64 = corner.split('/').next().unwrap().parse().unwrap();
                        vertices[if index < 0 { before + index } else { index - 1 } as usize]
                    })
                    .collect();
                reference.has_concave |= is_concave(&corners);
                for k in 2..corners.len() {
                    let triangle = [corners[0], corners[k - 1], corners[k]];
                    let [a, b, c] = triangle;
                    let area = (b - a).cross(c - a).length();
                    // Equal up to rotation; adding zero makes −0 equal to 0.
                    let bits = triangle.map(|p| (p + Vec3::ZERO).to_array().map(f32::to_bits));
                    let rotations = [bits, [bits[1], bits[2], bits[0]], [bits[2], bits[0], bits[1]]];
                    let fresh = seen.insert(*rotations.iter().min().unwrap());
                    if a == b || b == c || c == a || area == 0.0 || !fresh {
                        continue;
                    }
                    let names: BTreeSet<&String> = group.iter().chain(&object).chain(&material).collect();
                    for name in names {
                        reference
                            .groups
                            .entry(name.clone())
                            .or_default()
                            .push(reference.triangles.len() as u32);
                    }
                    reference.triangles.push(triangle);
                }
            }
            _ => {}
        }
    }
    reference
}

/// Compares the mesh of the real reader with that of this one.
pub(crate) fn compare(text: &str, unit_metres: f32) {
    let real = crate::read_mesh(
        text.as_bytes(),
        grasp_import::Import::with_unit(unit_metres),
        crate::LIMITS,
    )
    .unwrap();
    let reference = read(text, unit_metres);
    let turned = real.warnings.iter().any(|warning| warning.contains("turned"));
    let triangles: Vec<[Vec3; 3]> = (0..real.mesh.triangles().len())
        .map(|triangle| {
            let [a, b, c] = real.mesh.corners(triangle);
            if turned { [a, c, b] } else { [a, b, c] }
        })
        .collect();
    if reference.has_concave {
        // Whatever the triangles of a polygon, their area vectors have the same sum.
        let [ours, theirs] =
            [&triangles, &reference.triangles].map(|all| all.iter().map(area_vector).sum::<DVec3>());
        let size: f64 = triangles
            .iter()
            .map(|triangle| area_vector(triangle).length())
            .sum();
        assert!((ours - theirs).length() <= 1e-4 * size, "{ours}, {theirs}");
        return;
    }
    assert_eq!(triangles, reference.triangles);
    assert_eq!(real.groups, reference.groups.into_iter().collect::<Vec<_>>());
}

fn area_vector([a, b, c]: &[Vec3; 3]) -> DVec3 {
    (b.as_dvec3() - a.as_dvec3()).cross(c.as_dvec3() - a.as_dvec3())
}

/// True unless all triangles of the fan face the same side as the whole polygon.
fn is_concave(corners: &[Vec3]) -> bool {
    let fan = || (2..corners.len()).map(|k| area_vector(&[corners[0], corners[k - 1], corners[k]]));
    let whole: DVec3 = fan().sum();
    fan().any(|triangle| triangle.dot(whole) <= 0.0)
}
