//! The names of the parts that faces belong to.

use std::{
    collections::{BTreeMap, HashMap},
    ops::Range,
};

/// Why a part of a file is no part of the object.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Aside {
    /// The file says that it is not drawn.
    Invisible,
    /// Its material lets everything through.
    Transparent,
    /// It is there for programs: a collider, for instance.
    Helper,
    /// It stands in at a distance for a part that is there as well.
    LowerLevel,
}

/// The names of faces, as indices, and what their file says of them.
#[derive(Debug, Default)]
pub(crate) struct FaceNames {
    /// Of groups, objects, solids, nodes and meshes.
    pub(crate) parts: Vec<u32>,
    /// Of the material.
    pub(crate) material: Option<u32>,
    /// A name that is not theirs, but says what they are for.
    pub(crate) role: Option<u32>,
    /// Why they are no part of the object, if the file says so.
    pub(crate) aside: Option<Aside>,
}

/// A set of names that faces share.
#[derive(Clone, Debug)]
struct NameSet {
    /// All names, as a range of [`NameSets::listed`].
    all: Range<u32>,
    /// Those that say what faces are for.
    telling: Range<u32>,
    aside: Option<Aside>,
}

/// Sets of names that faces share.
#[derive(Debug, Default)]
pub(crate) struct NameSets {
    /// The index of each name.
    indices: HashMap<String, u32>,
    sets: Vec<NameSet>,
    /// Indices of names, set after set.
    listed: Vec<u32>,
}

impl NameSets {
    /// The index of a name.
    pub(crate) fn intern(&mut self, name: &str) -> u32 {
        if let Some(&index) = self.indices.get(name) {
            return index;
        }
        let index = self.indices.len() as u32;
        self.indices.insert(name.to_owned(), index);
        index
    }

    /// Adds a set; returns its index.
    pub(crate) fn add(&mut self, names: FaceNames) -> usize {
        let FaceNames {
            mut parts,
            material,
            role,
            aside,
        } = names;
        let mut list = |names: &mut Vec<u32>| {
            names.sort_unstable();
            names.dedup();
            let start = self.listed.len() as u32;
            self.listed.extend_from_slice(names);
            start..self.listed.len() as u32
        };
        let mut telling: Vec<u32> = parts.iter().copied().chain(role).collect();
        let telling = list(&mut telling);
        let all = if material.is_none() && role.is_none() {
            telling.clone()
        } else {
            parts.extend(material);
            list(&mut parts)
        };
        self.sets.push(NameSet { all, telling, aside });
        self.sets.len() - 1
    }

    /// Adds the set of a part with a name, which may be empty. Returns its index.
    pub(crate) fn add_part(&mut self, name: &str) -> usize {
        let named = (!name.is_empty()).then(|| self.intern(name));
        self.add(FaceNames {
            parts: named.into_iter().collect(),
            ..FaceNames::default()
        })
    }

    /// Number of sets.
    pub(crate) fn len(&self) -> usize {
        self.sets.len()
    }

    /// Why the faces of a set are no part of the object, if the file says so.
    pub(crate) fn aside(&self, set: usize) -> Option<Aside> {
        self.sets[set].aside
    }

    /// All names of a set, as indices.
    pub(crate) fn all(&self, set: usize) -> &[u32] {
        let Range { start, end } = self.sets[set].all;
        &self.listed[start as usize..end as usize]
    }

    /// The names of a set that say what its faces are for, as indices.
    pub(crate) fn telling(&self, set: usize) -> &[u32] {
        let Range { start, end } = self.sets[set].telling;
        &self.listed[start as usize..end as usize]
    }

    /// The index of a name that some set may have.
    pub(crate) fn index(&self, name: &str) -> Option<u32> {
        self.indices.get(name).copied()
    }

    /// All names, by index.
    pub(crate) fn names(&self) -> Vec<&str> {
        let mut names = vec![""; self.indices.len()];
        for (name, &index) in &self.indices {
            names[index as usize] = name;
        }
        names
    }

    /// The triangles of each name, sorted by name; `sets` are those of the triangles.
    pub(crate) fn groups(&self, sets: impl Iterator<Item = usize>) -> Vec<(String, Vec<u32>)> {
        let names = self.names();
        let mut groups = BTreeMap::<&str, Vec<u32>>::new();
        for (triangle, set) in sets.enumerate() {
            for &name in self.all(set) {
                let triangles = groups.entry(names[name as usize]).or_default();
                triangles.push(triangle as u32);
            }
        }
        groups
            .into_iter()
            .map(|(name, triangles)| (name.to_owned(), triangles))
            .collect()
    }
}
