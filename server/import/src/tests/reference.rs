//! A second, simple reader for well-formed text, which splits all polygons into fans, to compare with.

use std::collections::{BTreeMap, BTreeSet, HashSet};

use glam::{DVec3, Vec3};

use crate::{
    Import, read_mesh,
    tests::{LIMITS, corners},
};

/// Triangles by position in file order, and the triangles of each name.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct Reference {
    pub(crate) triangles: Vec<[Vec3; 3]>,
    pub(crate) groups: BTreeMap<String, Vec<u32>>,
    /// Is some polygon not the fan of its first corner?
    has_concave: bool,
}

/// Reads text that the real reader accepted; leaves out triangles with two equal corners, without area, and those
/// that came before. The mesh's origin is at a place of the file.
pub(crate) fn read(text: &str, unit_metres: f32, origin_in_file: DVec3) -> Reference {
    let text = text.replace("\\\r\n", " ").replace("\\\n", " ");
    let vertices: Vec<Vec3> = text
        .lines()
        .filter_map(|line| line.trim().strip_prefix("v "))
        .map(|numbers| {
            let numbers = numbers
                .split_whitespace()
                .take(3)
                .map(|number| number.parse().unwrap());
            let position = DVec3::from_slice(&numbers.collect::<Vec<f64>>());
            ((position - origin_in_file) * f64::from(unit_metres)).as_vec3()
        })
        .collect();
    let mut reference = Reference::default();
    let mut seen: BTreeSet<[[u32; 3]; 3]> = BTreeSet::new();
    let (mut group, mut object, mut material) = (Vec::new(), Vec::new(), Vec::new());
    let mut faces: BTreeMap<Vec<[u32; 3]>, Vec<Vec3>> = BTreeMap::new();
    let mut before = 0_i64;
    for line in text.lines().map(str::trim) {
        let (keyword, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let rest = rest.trim();
        let whole = || {
            (!rest.is_empty())
                .then(|| rest.to_owned())
                .into_iter()
                .collect::<Vec<_>>()
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
                // A polygon that repeats an earlier one is split like that one.
                let first = faces
                    .entry(unordered(&corners))
                    .or_insert_with(|| corners.clone());
                let (corners, is_backward) = match turns_back(first, &corners) {
                    Some(is_backward) => (first.clone(), is_backward),
                    None => (corners, false),
                };
                for k in 2..corners.len() {
                    let (second, third) = if is_backward { (k, k - 1) } else { (k - 1, k) };
                    let triangle = [corners[0], corners[second], corners[third]];
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
                        let triangles = reference.groups.entry(name.clone()).or_default();
                        triangles.push(reference.triangles.len() as u32);
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
    let real = read_mesh(text.as_bytes(), Import::with_unit(unit_metres), LIMITS).unwrap();
    let reference = read(text, unit_metres, real.origin_in_file);
    let turned = real.warnings.iter().any(|warning| warning.contains("turned"));
    let triangles = corners(&real);
    if reference.has_concave {
        let is_repaired = |warning: &String| warning.contains("opposite winding");
        if turned || real.warnings.iter().any(is_repaired) {
            return;
        }
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
    // One side of a two-sided face may be missing, and triangles may be turned.
    let mut found = triangles.iter().peekable();
    let mut sides = HashSet::new();
    for &[a, b, c] in &reference.triangles {
        if let Some(&&same) = found.peek()
            && (same == [a, b, c] || (turned && same == [a, c, b]))
        {
            found.next();
            sides.insert(unordered(&[a, b, c]));
        } else {
            assert!(sides.contains(&unordered(&[a, b, c])), "{a}, {b}, {c} is missing");
        }
    }
    assert_eq!(found.next(), None);
    if triangles.len() == reference.triangles.len() {
        assert_eq!(real.groups, reference.groups.into_iter().collect::<Vec<_>>());
    }
}

/// Whether two polygons of the same corners run in opposite directions; `None` if they are not the same from any corner.
fn turns_back(first: &[Vec3], second: &[Vec3]) -> Option<bool> {
    let matches = |second: &[Vec3]| {
        let start = second.iter().position(|corner| Some(corner) == first.first());
        first.len() == second.len()
            && start.is_some_and(|start| [&second[start..], &second[..start]].concat() == first)
    };
    let reversed: Vec<Vec3> = second.iter().rev().copied().collect();
    (matches(second) || matches(&reversed)).then(|| !matches(second))
}

/// The corners of a polygon, in whatever order they are given.
fn unordered(corners: &[Vec3]) -> Vec<[u32; 3]> {
    // Adding zero makes −0 equal to 0.
    let bits = corners
        .iter()
        .map(|&corner| (corner + Vec3::ZERO).to_array().map(f32::to_bits));
    let mut bits: Vec<[u32; 3]> = bits.collect();
    bits.sort_unstable();
    bits
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
