//! What is kept of the file that an object was created from: how clients name its triangles, by index and by group.

use std::ops::Range;

use glam::DVec3;
use grasp_import::{Import, ImportedMesh, UpAxis};

use super::count;
use crate::validate::{Field, Violations, quoted};

/// Largest number of group names in an error.
const LISTED_GROUPS: usize = 12;

/// What is kept of a mesh's file: a few bytes per group, and four per triangle if the file had others that were dropped.
#[derive(Clone, Debug)]
pub(crate) struct MeshFile {
    /// The length of one unit of the file, in metres.
    pub unit_metres: f32,
    /// True if the file's +Z points up.
    pub z_up: bool,
    /// The names of the file's parts that are the object; empty for those that are seen.
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
    /// Of a mesh without names whose triangles are those of its file.
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

    /// Of a mesh that was read with this unit and these axes, from these parts.
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

    /// Its size in bytes.
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
    pub(super) fn named(
        &self,
        field: Field<'_>,
        groups: &[String],
        triangles: &[u32],
        violations: &Violations,
    ) -> Vec<u32> {
        let mut named = Vec::new();
        for (place, name) in groups.iter().enumerate() {
            let known = self
                .groups
                .binary_search_by(|group| (*group.name).cmp(name.as_str()));
            match known {
                Ok(group) => {
                    named.extend(self.groups[group].triangles.iter().cloned().flatten());
                }
                Err(_) => violations.add(
                    field.child("groups").at(place),
                    format_args!("is {}; {}", quoted(name), self.known_groups()),
                ),
            }
        }
        for (place, &triangle) in triangles.iter().enumerate() {
            if triangle >= self.triangles {
                let all = self.triangles;
                violations.add(
                    field.child("triangles").at(place),
                    format_args!("is {triangle}; the mesh has {all} triangles, counted from 0"),
                );
            } else if let Some(index) = self.index_in_mesh(triangle) {
                named.push(index);
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
        let more = if more > 0 {
            format!(" and {more} more")
        } else {
            String::new()
        };
        format!("the mesh has {}{more}", names.join(", "))
    }
}

/// The runs of ascending indices.
fn runs(triangles: &[u32]) -> Box<[Range<u32>]> {
    let consecutive = triangles.chunk_by(|a, b| a + 1 == *b);
    consecutive.map(|run| run[0]..run[0] + count(run.len())).collect()
}

#[cfg(test)]
mod tests {
    use grasp_synthesis::geometry::mesh::TriangleMesh;
    use proptest::prelude::*;

    use super::*;

    fn imported(
        indices_in_file: Vec<u32>,
        triangles_in_file: usize,
        groups: Vec<(String, Vec<u32>)>,
    ) -> ImportedMesh {
        let positions = vec![glam::Vec3::ZERO, glam::Vec3::X, glam::Vec3::Y];
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
        /// The compact form forbids what a search through the file's lists forbids.
        #[test]
        fn forbids_the_triangles_of_the_file(
            kept in prop::collection::btree_set(0_u32..40, 1..30),
            members in prop::collection::vec(prop::collection::btree_set(0_u32..30, 0..20), 0..4),
            asked in prop::collection::vec(0_u32..40, 0..10),
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
            let forbidden = file.named(violations.field("forbidden"), &names, &asked, &violations);
            prop_assert!(violations.is_empty());
            for (index, in_file) in kept.iter().enumerate() {
                let index = index as u32;
                let expected = asked.contains(in_file) || groups.iter().any(|(_, group)| group.contains(&index));
                prop_assert_eq!(forbidden.contains(&index), expected);
            }
            prop_assert!(forbidden.is_sorted());
        }
    }

    #[test]
    fn unknown_names_and_indices_are_violations() {
        let file = MeshFile::of(
            &imported(vec![0], 2, vec![("lid".to_owned(), vec![0])]),
            Import::METRES,
            &[],
        );
        let violations = Violations::default();
        let field = violations.field("forbidden");
        let forbidden = file.named(field, &["rim".to_owned(), "lid".to_owned()], &[1, 2], &violations);
        assert_eq!(forbidden, [0]);
        assert_eq!(violations.len(), 2);
        assert!(MeshFile::plain(3).named(field, &[], &[2], &violations) == [2]);
    }

    #[test]
    fn a_complete_file_keeps_no_indices() {
        let complete = MeshFile::of(
            &imported((0..1000).collect(), 1000, Vec::new()),
            Import::METRES,
            &[],
        );
        assert_eq!(complete.bytes(), 0);
        let dropped = MeshFile::of(
            &imported((1..1000).collect(), 1000, Vec::new()),
            Import::METRES,
            &[],
        );
        assert_eq!(dropped.bytes(), 4 * 999);
    }
}
