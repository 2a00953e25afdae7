//! Which parts of a file are the object.

use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};

use indexmap::IndexSet;

use crate::{
    error::{ImportError, Violations},
    part_names::Role,
    raw::RawMesh,
};

/// Largest number of names in a message, and of characters of each.
const LISTED_NAMES: usize = 8;
const SHOWN_CHARACTERS: usize = 64;

/// Leaves out faces that are not of the object: all that do not have one of the names in `requested` or, if there are none,
/// invisible ones, colliders and other helpers, and lower levels of detail.
pub(crate) fn leave_out(raw: &mut RawMesh, requested: &[String]) -> Result<(), Violations> {
    let mut triangles = vec![0; raw.names.sets.len()];
    for face in raw.faces.iter() {
        triangles[face.names as usize] += face.corners as usize - 2;
    }
    let is_out: Vec<bool> = if requested.is_empty() {
        let asides = asides(&raw.names, &triangles);
        let warnings = warnings(&raw.names, &triangles, &asides);
        let is_left = (0..asides.len()).any(|set| triangles[set] > 0 && asides[set].is_none());
        if !is_left && let Some(warning) = warnings.first() {
            return Err(ImportError::at("the mesh", format!("has nothing else: {warning}")).into());
        }
        raw.warnings.extend(warnings);
        asides.iter().map(Option::is_some).collect()
    } else {
        let wanted = wanted(&raw.names, requested)?;
        let is_wanted = |set| raw.names.all(set).any(|name| wanted.contains(&name));
        (0..raw.names.sets.len()).map(|set| !is_wanted(set)).collect()
    };
    if (0..is_out.len()).any(|set| is_out[set] && triangles[set] > 0) {
        raw.keep(|face| !is_out[face.names as usize]);
    }
    Ok(())
}

/// The indices of requested names.
fn wanted(names: &NameSets, requested: &[String]) -> Result<HashSet<u32>, Violations> {
    let known: HashSet<u32> = (0..names.sets.len()).flat_map(|set| names.all(set)).collect();
    let mut violations = Violations::default();
    let mut wanted = HashSet::new();
    for (place, name) in requested.iter().enumerate() {
        let index = names.names.get_index_of(name).map(|index| index as u32);
        if let Some(index) = index.filter(|index| known.contains(index)) {
            wanted.insert(index);
            continue;
        }
        let known = listed(known.iter().map(|&index| names.name(index)).collect());
        violations.push(ImportError::NoSuchPart {
            place,
            name: name.clone(),
            what: if known.is_empty() {
                "but the file names no parts".to_owned()
            } else {
                format!("but the file has {known}")
            },
        });
    }
    violations.into_result()?;
    Ok(wanted)
}

/// Why each set of faces is no part of the object, if it is none.
fn asides(names: &NameSets, triangles: &[usize]) -> Vec<Option<Aside>> {
    // Names may be long and shared by many sets: each is looked at once.
    let mut parts = HashMap::new();
    let mut index = |part: &str| {
        let next = parts.len() as u32;
        *parts.entry(part.to_owned()).or_insert(next)
    };
    let roles = names.names.iter().map(|name| Role::of(name, &mut index));
    let roles: Vec<Role> = roles.collect();
    let telling = |set: usize| {
        let own = names.sets[set].parts.iter().chain(&names.sets[set].role);
        own.map(|&name| roles[name as usize])
    };
    let mut asides: Vec<Option<Aside>> = names.sets.iter().map(|set| set.aside).collect();
    let used: Vec<usize> = (0..names.sets.len()).filter(|&set| triangles[set] > 0).collect();
    // The finest level of each part that is there.
    let mut finest = HashMap::<u32, u32>::new();
    for &set in used.iter().filter(|&&set| asides[set].is_none()) {
        let has_level = telling(set).any(|role| matches!(role, Role::Level(..)));
        for role in telling(set) {
            let (part, level) = match role {
                Role::Level(part, level) => (part, level),
                Role::Part(part) if !has_level => (part, 0),
                _ => continue,
            };
            let known = finest.entry(part).or_insert(level);
            *known = level.min(*known);
        }
    }
    for &set in &used {
        if asides[set].is_some() {
            continue;
        }
        let why = telling(set).filter_map(|role| match role {
            Role::Helper => Some(Aside::Helper),
            Role::HelperOf(part) if finest.contains_key(&part) => Some(Aside::Helper),
            Role::Level(part, level) if finest.get(&part).is_some_and(|&finest| finest < level) => {
                Some(Aside::LowerLevel)
            }
            _ => None,
        });
        asides[set] = why.min();
    }
    // A file of nothing but colliders has been made to be read, and transparency is often a mistake.
    for may_be_all in [Aside::Transparent, Aside::Helper] {
        let is_left = used.iter().any(|&set| asides[set].is_none());
        if !is_left {
            for aside in asides.iter_mut().filter(|aside| **aside == Some(may_be_all)) {
                *aside = None;
            }
        }
    }
    asides
}

/// One warning for each reason why parts were left out.
fn warnings(names: &NameSets, triangles: &[usize], asides: &[Option<Aside>]) -> Vec<String> {
    let mut warnings = Vec::new();
    for (aside, what) in [
        (Aside::Invisible, "that the file hides"),
        (Aside::Transparent, "whose material is transparent throughout"),
        (Aside::Helper, "for collisions or other work of programs"),
        (Aside::LowerLevel, "in lower levels of detail"),
    ] {
        let mut found = BTreeSet::new();
        let mut count = 0;
        for set in (0..names.sets.len()).filter(|&set| asides[set] == Some(aside) && triangles[set] > 0) {
            count += triangles[set];
            found.extend(names.sets[set].parts.iter().map(|&name| names.name(name)));
        }
        if count > 0 {
            let found = if found.is_empty() {
                "without names".to_owned()
            } else {
                listed(found.into_iter().collect())
            };
            warnings.push(format!(
                "{count} triangles of parts {what} were left out: {found}; name parts to have them"
            ));
        }
    }
    warnings
}

/// Names in alphabetical order, up to a number.
pub(crate) fn listed(mut names: Vec<&str>) -> String {
    names.sort_unstable();
    let shown: Vec<String> = names.iter().take(LISTED_NAMES).map(|name| quoted(name)).collect();
    let all = shown.join(", ");
    match names.len() - shown.len() {
        0 => all,
        more => format!("{all} and {more} more"),
    }
}

/// A name in quotes, cut short.
pub(crate) fn quoted(name: &str) -> String {
    match name.char_indices().nth(SHOWN_CHARACTERS) {
        None => format!("{name:?}"),
        Some((end, _)) => format!("{:?}…", &name[..end]),
    }
}

/// Why a part of a file is no part of the object.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
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

/// The names of faces, as indices, and their purpose in the file.
#[derive(Debug, Default, PartialEq, Eq, Hash)]
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

/// Sets of names that faces share.
#[derive(Debug, Default)]
pub(crate) struct NameSets {
    names: IndexSet<String>,
    sets: IndexSet<FaceNames>,
}

impl NameSets {
    /// The index of a name.
    pub(crate) fn intern(&mut self, name: &str) -> u32 {
        let known = self.names.get_index_of(name);
        known.unwrap_or_else(|| self.names.insert_full(name.to_owned()).0) as u32
    }

    fn name(&self, index: u32) -> &str {
        &self.names[index as usize]
    }

    /// The index of a set.
    pub(crate) fn add(&mut self, mut names: FaceNames) -> u32 {
        names.parts.sort_unstable();
        names.parts.dedup();
        self.sets.insert_full(names).0 as u32
    }

    /// The index of the set of a part with a name, which may be empty.
    pub(crate) fn add_part(&mut self, name: &str) -> u32 {
        let named = (!name.is_empty()).then(|| self.intern(name));
        self.add(FaceNames {
            parts: named.into_iter().collect(),
            ..FaceNames::default()
        })
    }

    /// All names of a set, as indices, each once.
    fn all(&self, set: usize) -> impl Iterator<Item = u32> {
        let FaceNames { parts, material, .. } = &self.sets[set];
        let material = material.filter(|material| !parts.contains(material));
        parts.iter().copied().chain(material)
    }

    /// The triangles of each name, sorted by name; `sets` are those of the triangles.
    pub(crate) fn groups(&self, sets: impl Iterator<Item = usize>) -> Vec<(String, Vec<u32>)> {
        let mut groups = BTreeMap::<&str, Vec<u32>>::new();
        for (triangle, set) in sets.enumerate() {
            for name in self.all(set) {
                let triangles = groups.entry(self.name(name)).or_default();
                triangles.push(triangle as u32);
            }
        }
        let groups = groups.into_iter();
        groups
            .map(|(name, triangles)| (name.to_owned(), triangles))
            .collect()
    }
}
