//! The file that an object was created from: clients name its triangles, by index and by group. Also the checks of its mesh's
//! size, and its centre of mass.

use std::ops::Range;

use glam::{DVec3, Vec3};
use grasp_import::{Import, ImportedMesh, UpAxis};
use grasp_synthesis::geometry::{boxes::Aabb, mesh::TriangleMesh};

use super::count;
use crate::validate::{Field, quoted};

/// Largest number of group names in an error.
const LISTED_GROUPS: usize = 12;

/// The data kept of a mesh's file: a few bytes per group, and four per triangle if the file had others that were dropped.
#[derive(Clone, Debug)]
pub(crate) struct MeshFile {
    /// The length of one unit of the file, in metres.
    pub unit_metres: f32,
    /// True if the file's +Z points up.
    pub z_up: bool,
    /// The names of the file's parts that are the object; empty for all visible parts.
    pub parts: Box<[String]>,
    /// The object's origin in the file, in the file's units and axes.
    pub origin: DVec3,
    /// Number of triangles in the file, dropped ones included.
    triangles: u32,
    /// For each triangle of the mesh, its index in the file, ascending. `None` if no triangle was dropped.
    indices: Option<Box<[u32]>>,
    /// The triangles of each name, sorted by name.
    groups: Box<[Group]>,
}

/// A named part of a mesh.
#[derive(Clone, Debug)]
struct Group {
    name: Box<str>,
    /// Runs of consecutive triangles.
    triangles: Box<[Range<u32>]>,
}

impl MeshFile {
    /// The file of a mesh without names whose triangles are those of its file.
    pub(super) fn plain(triangles: usize) -> Self {
        Self {
            unit_metres: 1.0,
            z_up: false,
            parts: Box::default(),
            origin: DVec3::ZERO,
            triangles: count(triangles),
            indices: None,
            groups: Box::default(),
        }
    }

    /// The file of a mesh that was read with this unit and these axes, from these parts.
    pub(super) fn of(read: &ImportedMesh, import: Import, parts: &[String]) -> Self {
        let is_complete = read.indices_in_file.len() == read.triangles_in_file;
        let groups = read.groups.iter();
        Self {
            unit_metres: import.unit_metres,
            z_up: import.up_axis == UpAxis::Z,
            parts: parts.into(),
            origin: read.origin_in_file,
            triangles: count(read.triangles_in_file),
            indices: (!is_complete).then(|| read.indices_in_file.clone().into()),
            groups: groups
                .map(|(name, triangles)| Group {
                    name: name.as_str().into(),
                    triangles: runs(triangles),
                })
                .collect(),
        }
    }

    /// The same file with another unit.
    pub(super) fn with_unit(&self, unit_metres: f32) -> Self {
        Self {
            unit_metres,
            ..self.clone()
        }
    }

    pub(super) fn bytes(&self) -> usize {
        let of_groups: usize = self
            .groups
            .iter()
            .map(|group| size_of_val(group) + group.name.len() + size_of_val(&*group.triangles))
            .sum();
        let of_parts: usize = self.parts.iter().map(|name| size_of_val(name) + name.len()).sum();
        self.indices.as_deref().map_or(0, size_of_val) + of_groups + of_parts
    }

    /// The triangles of the mesh that a client names, ascending. Adds a violation for each name and index that is not in the
    /// file to the fields `groups` and `triangles` of `field`.
    pub(super) fn named(&self, field: Field<'_>, groups: &[String], triangles: &[u32]) -> Vec<u32> {
        let mut named = Vec::new();
        for (place, name) in groups.iter().enumerate() {
            let known = self
                .groups
                .binary_search_by(|group| (*group.name).cmp(name.as_str()));
            if let Ok(group) = known {
                named.extend(self.groups[group].triangles.iter().cloned().flatten());
            } else {
                let field = field.child("groups").at(place);
                field.add(format_args!("is {}; {}", quoted(name), self.known_groups()));
            }
        }
        for (place, &triangle) in triangles.iter().enumerate() {
            if triangle >= self.triangles {
                let (field, all) = (field.child("triangles").at(place), self.triangles);
                field.add(format_args!(
                    "is {triangle}; the mesh has {all} triangles, counted from 0"
                ));
            } else {
                named.extend(self.index_in_mesh(triangle));
            }
        }
        named.sort_unstable();
        named.dedup();
        named
    }

    /// The index in the mesh of a triangle of the file. `None` if it was dropped.
    fn index_in_mesh(&self, in_file: u32) -> Option<u32> {
        match &self.indices {
            None => Some(in_file),
            Some(indices) => indices.binary_search(&in_file).ok().map(|index| index as u32),
        }
    }

    fn known_groups(&self) -> String {
        if self.groups.is_empty() {
            return "the mesh names no groups, objects or materials".to_owned();
        }
        let names = self.groups.iter().take(LISTED_GROUPS);
        let names: Vec<String> = names.map(|group| quoted(&group.name)).collect();
        let more = self.groups.len().saturating_sub(LISTED_GROUPS);
        let more = (more > 0).then(|| format!(" and {more} more"));
        format!("the mesh has {}{}", names.join(", "), more.unwrap_or_default())
    }
}

/// The runs of ascending indices.
fn runs(triangles: &[u32]) -> Box<[Range<u32>]> {
    let consecutive = triangles.chunk_by(|a, b| a + 1 == *b);
    consecutive.map(|run| run[0]..run[0] + count(run.len())).collect()
}

/// Longest edges of a bounding box without a warning, in metres: from a bead to a long pole.
const USUAL: [f32; 2] = [0.002, 5.0];

/// Longest edges of usable bounding boxes, in metres: squares of areas and volumes stay normal numbers in single precision.
const USABLE: [f32; 2] = [1e-6, 1e6];

/// Longest edges of most things that are held, in metres.
const PLAUSIBLE: [f32; 2] = [0.03, 1.0];

/// Factors of the usual errors of units, units converted twice included, and their inverses.
const USUAL_ERRORS: [f32; 9] = [1e-6, 0.001, 0.01, 0.0254, 0.1, 10.0, 100.0, 1000.0, 1e6];

/// The text after the number in the warning about an unusual size.
const UNUSUAL: &str = "m long, which is unusual";

/// Checks the size, and replaces the warning about an unusual one.
pub(super) fn check_extent(mesh: &TriangleMesh, warnings: &mut Vec<String>) -> Result<(), String> {
    warnings.retain(|warning| !warning.contains(UNUSUAL));
    let extent = usable_extent(mesh)
        .map_err(|wrong| format!("is {wrong}: multiply meters_per_unit by what makes it so"))?;
    if !within(USUAL, extent) {
        let factor = likely_factor(extent);
        warnings.push(format!(
            "the object is {} {UNUSUAL}: is meters_per_unit right? Multiplied by {factor}, it would make the object {} m long",
            rounded(extent),
            rounded(extent * factor)
        ));
    }
    Ok(())
}

/// Checks the size of an object that was created at a usable one.
pub(super) fn check_resized(mesh: &TriangleMesh) -> Result<(), String> {
    let usable = usable_extent(mesh).map(|_| ());
    usable.map_err(|wrong| format!("makes the object {wrong}"))
}

/// The longest edge of a mesh's bounding box, or why it is not usable.
fn usable_extent(mesh: &TriangleMesh) -> Result<f32, String> {
    let extent = mesh.aabb().extents().max_element();
    // The negation also rejects an extent that overflowed.
    if !within(USABLE, extent) {
        let ([smallest, largest], extent) = (USABLE, rounded(extent));
        return Err(format!("{extent} m long; it must be {smallest} m to {largest} m"));
    }
    Ok(extent)
}

/// A length to four digits.
fn rounded(metres: f32) -> f64 {
    let metres = f64::from(metres);
    let scale = 10_f64.powf(3.0 - metres.log10().floor());
    (metres * scale).round() / scale
}

fn within([low, high]: [f32; 2], extent: f32) -> bool {
    (low..=high).contains(&extent)
}

/// The usual error whose correction brings a length nearest to the middle of the plausible ones.
fn likely_factor(extent: f32) -> f32 {
    let middle = (PLAUSIBLE[0] * PLAUSIBLE[1]).sqrt();
    let off = |factor: f32| (extent * factor / middle).ln().abs();
    USUAL_ERRORS
        .into_iter()
        .min_by(|&a, &b| off(a).total_cmp(&off(b)))
        .unwrap_or(1.0)
}

/// Smallest enclosed share of the bounding box for which the volume is used: sheets and many open meshes enclose less.
const MIN_VOLUME_SHARE: f64 = 1e-4;

/// The warning about a centre of mass that was computed from the surface.
const SURFACE_WARNING: &str = "the mesh encloses no volume: the centre of mass is that of its surface";

/// The given centre of mass, or else that of the mesh, in metres. Adds or removes the warning about a centre of the surface.
pub(super) fn centre_or_computed(
    mesh: &TriangleMesh,
    given: Option<Vec3>,
    warnings: &mut Vec<String>,
) -> Vec3 {
    warnings.retain(|warning| warning != SURFACE_WARNING);
    given.or_else(|| centre_of_volume(mesh)).unwrap_or_else(|| {
        warnings.push(SURFACE_WARNING.to_owned());
        centre_of_surface(mesh)
    })
}

/// The centre of the enclosed volume, by the divergence theorem. `None` without a volume, or if it is outside the bounding box.
fn centre_of_volume(mesh: &TriangleMesh) -> Option<Vec3> {
    let Aabb { min, max } = Aabb::around(mesh.positions().iter().copied());
    let (low, high) = (min.as_dvec3(), max.as_dvec3());
    let (volume, centre) = weighted_centre(mesh, 4.0, |[a, b, c]| a.dot(b.cross(c)) / 6.0);
    let is_inside = centre.cmpge(low).all() && centre.cmple(high).all();
    let has_volume = volume.abs() > MIN_VOLUME_SHARE * (high - low).element_product();
    (has_volume && is_inside).then(|| centre.as_vec3())
}

/// The centre of the surface at uniform thickness.
fn centre_of_surface(mesh: &TriangleMesh) -> Vec3 {
    // Every triangle of a mesh has an area: no division by 0.
    let (_, centre) = weighted_centre(mesh, 3.0, |[a, b, c]| (b - a).cross(c - a).length() / 2.0);
    centre.as_vec3()
}

/// The sum of the weights of all triangles, and their centre, each being at the sum of its corners over `count`.
fn weighted_centre(mesh: &TriangleMesh, count: f64, weight: impl Fn([DVec3; 3]) -> f64) -> (f64, DVec3) {
    let Aabb { min, max } = Aabb::around(mesh.positions().iter().copied());
    // Relative to the middle of the box: far from the origin, the products would lose precision.
    let middle = (min.as_dvec3() + max.as_dvec3()) * 0.5;
    let (mut sum, mut moment) = (0.0, DVec3::ZERO);
    for triangle in 0..mesh.triangles().len() {
        let corners = mesh.corners(triangle).map(|corner| corner.as_dvec3() - middle);
        let weight = weight(corners);
        let [a, b, c] = corners;
        sum += weight;
        moment += weight * (a + b + c) / count;
    }
    (sum, moment / sum + middle)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::validate::Violations;

    fn imported(
        indices_in_file: Vec<u32>,
        triangles_in_file: usize,
        groups: Vec<(String, Vec<u32>)>,
    ) -> ImportedMesh {
        let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
        ImportedMesh {
            mesh: TriangleMesh::new(positions, vec![[0, 1, 2]]).unwrap(),
            indices_in_file,
            triangles_in_file,
            groups,
            origin_in_file: DVec3::ZERO,
            warnings: Vec::new(),
        }
    }

    proptest! {
        /// The compact form forbids the same triangles as a search through the file's lists.
        #[test]
        fn forbids_the_triangles_of_the_file(
            kept in prop::collection::btree_set(0_u32..40, 1..30),
            members in prop::collection::vec(prop::collection::btree_set(0_u32..30, 0..20), 0..4),
            given in prop::collection::vec(0_u32..40, 0..10),
        ) {
            let kept: Vec<u32> = kept.into_iter().collect();
            let in_mesh = |set: &std::collections::BTreeSet<u32>| -> Vec<u32> {
                set.iter().copied().filter(|&index| (index as usize) < kept.len()).collect()
            };
            let groups: Vec<(String, Vec<u32>)> =
                members.iter().enumerate().map(|(n, set)| (format!("g{n}"), in_mesh(set))).collect();
            let names: Vec<String> = groups.iter().map(|(name, _)| name.clone()).collect();
            let file = MeshFile::of(&imported(kept.clone(), 40, groups.clone()), Import::METRES, &[]);
            let violations = Violations::default();
            let forbidden = file.named(violations.field("forbidden"), &names, &given);
            prop_assert!(violations.is_empty());
            for (index, in_file) in kept.iter().enumerate() {
                let index = index as u32;
                let expected = given.contains(in_file) || groups.iter().any(|(_, group)| group.contains(&index));
                prop_assert_eq!(forbidden.contains(&index), expected);
            }
            prop_assert!(forbidden.is_sorted());
        }
    }

    fn long(extent: f32) -> Result<Option<String>, String> {
        let corners = vec![Vec3::ZERO, Vec3::X * extent, Vec3::Y * extent];
        let mesh = TriangleMesh::new(corners, vec![[0, 1, 2]]).unwrap();
        let mut warnings = vec!["another".to_owned()];
        // The second check replaces the warning of the first.
        check_extent(&mesh, &mut warnings)?;
        check_extent(&mesh, &mut warnings)?;
        assert!(warnings.len() <= 2 && warnings[0] == "another", "{warnings:?}");
        Ok(warnings.into_iter().nth(1))
    }

    #[test]
    fn warning_names_the_factor_of_the_likely_unit() {
        for usual in [0.002, 0.17, 5.0] {
            assert_eq!(long(usual), Ok(None), "{usual}");
        }
        for (extent, factor, right) in [
            (240.0, 0.001, 0.24),
            (24.0, 0.01, 0.24),
            (7.0, 0.0254, 0.1778),
            (150_000.0, 1e-6, 0.15),
            (0.000_24, 1000.0, 0.24),
            (0.001_5, 100.0, 0.15),
        ] {
            let warning = long(extent).unwrap().unwrap();
            let expected = format!("Multiplied by {factor}, it would make the object {right} m long");
            assert!(warning.contains(&expected), "{warning}");
        }
    }

    #[test]
    fn factor_makes_any_length_plausible_that_a_usual_error_explains() {
        for error in USUAL_ERRORS {
            for true_length in [0.05, 0.1, 0.3] {
                let extent = true_length / error;
                if !within(USUAL, extent) {
                    let right = extent * likely_factor(extent);
                    assert!(within(PLAUSIBLE, right), "{extent}: {right}");
                }
            }
        }
    }

    #[test]
    fn refuses_sizes_at_which_numbers_end() {
        for extent in [9e-7, 1.1e6] {
            let wrong = long(extent).unwrap_err();
            assert!(wrong.contains("it must be 0.000001 m to 1000000 m"), "{wrong}");
        }
    }

    /// The centre of mass, and whether it is that of the surface.
    fn measured(mesh: &TriangleMesh) -> (Vec3, bool) {
        let mut warnings = Vec::new();
        let centre = centre_or_computed(mesh, None, &mut warnings);
        (centre, warnings == [SURFACE_WARNING])
    }

    fn boxed(low: Vec3, high: Vec3, without_lid: bool) -> TriangleMesh {
        let corner = |i: usize| Vec3::select(glam::BVec3::new(i & 1 > 0, i & 2 > 0, i & 4 > 0), high, low);
        let sides = [
            0, 2, 3, 1, 0, 1, 5, 4, 0, 4, 6, 2, 1, 3, 7, 5, 2, 6, 7, 3, 4, 5, 7, 6,
        ];
        let sides = sides.chunks(4).take(if without_lid { 5 } else { 6 });
        let triangles = sides.flat_map(|side| [[side[0], side[1], side[2]], [side[0], side[2], side[3]]]);
        TriangleMesh::new((0..8).map(corner).collect(), triangles.collect()).unwrap()
    }

    #[test]
    fn centre_of_a_box_far_from_the_origin_is_its_middle() {
        let low = Vec3::new(10.0, -3.0, 7.0);
        let (centre, is_of_surface) = measured(&boxed(low, low + Vec3::new(0.1, 0.2, 0.3), false));
        assert!(!is_of_surface);
        assert!(
            centre.distance(low + Vec3::new(0.05, 0.1, 0.15)) < 1e-5,
            "{centre}"
        );
    }

    #[test]
    fn centre_of_a_sheet_is_that_of_its_surface() {
        let corners = vec![Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y];
        let mesh = TriangleMesh::new(corners, vec![[0, 1, 2], [0, 2, 3]]).unwrap();
        let (centre, is_of_surface) = measured(&mesh);
        assert!(is_of_surface);
        assert!((centre - Vec3::new(0.5, 0.5, 0.0)).length() < 1e-6);
    }

    #[test]
    fn centre_of_an_open_box_is_inside() {
        let (centre, _) = measured(&boxed(Vec3::ZERO, Vec3::ONE, true));
        assert_eq!(centre, centre.clamp(Vec3::ZERO, Vec3::ONE));
    }
}
