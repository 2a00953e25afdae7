//! Which parts of a file are the object.

use std::collections::{BTreeSet, HashMap, HashSet};

use crate::{
    ImportedMesh,
    error::{ImportError, Violations},
    names::{Aside, NameSets},
    part_names::{Role, plain},
    raw::RawMesh,
};

/// Largest number of names in a message, and of characters of each.
const LISTED_NAMES: usize = 8;
const SHOWN_CHARACTERS: usize = 64;

/// The triangles of a file that are left, where some are not.
#[derive(Debug)]
pub(crate) struct Left {
    /// Their indices in the file, ascending.
    indices: Vec<u32>,
    /// Number of triangles in the file.
    all: usize,
}

impl Left {
    /// Counts the triangles of a mesh that has only these as the file does.
    pub(crate) fn count_as_in_file(&self, read: &mut ImportedMesh) {
        for triangle in &mut read.indices_in_file {
            *triangle = self.indices[*triangle as usize];
        }
        read.triangles_in_file = self.all;
    }
}

/// Leaves out what is no part of the object: all that does not have one of the names in `requested` or, if there are none, what
/// is invisible, colliders and other helpers, and lower levels of detail. Returns what is left, if anything was left out.
///
/// # Errors
/// A requested name is none of the file, or nothing is left.
pub(crate) fn leave_out(raw: &mut RawMesh, requested: &[String]) -> Result<Option<Left>, Violations> {
    let mut triangles = vec![0; raw.names.len()];
    for face in raw.faces.iter() {
        triangles[face.names] += face.corners - 2;
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
        let is_wanted = |set| raw.names.all(set).iter().any(|name| wanted.contains(name));
        (0..raw.names.len()).map(|set| !is_wanted(set)).collect()
    };
    let is_needed = (0..is_out.len()).any(|set| is_out[set] && triangles[set] > 0);
    Ok(is_needed.then(|| keep(raw, &is_out)))
}

/// The indices of requested names.
fn wanted(names: &NameSets, requested: &[String]) -> Result<HashSet<u32>, Violations> {
    let known: HashSet<u32> = (0..names.len()).flat_map(|set| names.all(set)).copied().collect();
    let mut violations = Violations::default();
    let mut wanted = HashSet::new();
    for (place, name) in requested.iter().enumerate() {
        if let Some(index) = names.index(name).filter(|index| known.contains(index)) {
            wanted.insert(index);
            continue;
        }
        let all = names.names();
        let known = listed(known.iter().map(|&index| all[index as usize]).collect());
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

/// What a name tells, with the indices of the parts that it names.
#[derive(Clone, Copy, Debug)]
enum Told {
    Part(u32),
    Helper,
    HelperOf(u32),
    Level(u32, u32),
}

/// What each name tells, by index. Names may be long and shared by many sets: each is looked at once.
fn told(names: &[&str]) -> Vec<Told> {
    let mut parts = HashMap::new();
    let mut index = |part: String| {
        let next = parts.len() as u32;
        *parts.entry(part).or_insert(next)
    };
    let told = names.iter().map(|name| match Role::of(name) {
        Role::Part => Told::Part(index(plain(name))),
        Role::Helper => Told::Helper,
        Role::HelperOf(part) => Told::HelperOf(index(part)),
        Role::Level(part, level) => Told::Level(index(part), level),
    });
    told.collect()
}

/// Why each set of faces is no part of the object, if it is none.
fn asides(names: &NameSets, triangles: &[usize]) -> Vec<Option<Aside>> {
    let told = told(&names.names());
    let telling = |set: usize| names.telling(set).iter().map(|&name| told[name as usize]);
    let mut asides: Vec<Option<Aside>> = (0..names.len()).map(|set| names.aside(set)).collect();
    let used: Vec<usize> = (0..names.len()).filter(|&set| triangles[set] > 0).collect();
    // The finest level of each part that is there.
    let mut finest = HashMap::<u32, u32>::new();
    for &set in used.iter().filter(|&&set| asides[set].is_none()) {
        let has_level = telling(set).any(|told| matches!(told, Told::Level(..)));
        for told in telling(set) {
            let (part, level) = match told {
                Told::Level(part, level) => (part, level),
                Told::Part(part) if !has_level => (part, 0),
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
        let why = telling(set).filter_map(|told| match told {
            Told::Part(_) => None,
            Told::Helper => Some(Aside::Helper),
            Told::HelperOf(part) => finest.contains_key(&part).then_some(Aside::Helper),
            Told::Level(part, level) => {
                let is_lower = finest.get(&part).is_some_and(|&finest| finest < level);
                is_lower.then_some(Aside::LowerLevel)
            }
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
    let all = names.names();
    let mut warnings = Vec::new();
    for (aside, what) in [
        (Aside::Invisible, "that the file hides"),
        (Aside::Transparent, "whose material is transparent throughout"),
        (Aside::Helper, "for collisions or other work of programs"),
        (Aside::LowerLevel, "in lower levels of detail"),
    ] {
        let mut found = BTreeSet::new();
        let mut count = 0;
        for set in (0..names.len()).filter(|&set| asides[set] == Some(aside) && triangles[set] > 0) {
            count += triangles[set];
            let own = names.telling(set).iter();
            found.extend(own.filter(|name| names.all(set).contains(name)).copied());
        }
        if count > 0 {
            let found: Vec<&str> = found.into_iter().map(|name| all[name as usize]).collect();
            let found = if found.is_empty() {
                "without names".to_owned()
            } else {
                listed(found)
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
    let more = names.len().saturating_sub(LISTED_NAMES);
    let more = if more > 0 {
        format!(" and {more} more")
    } else {
        String::new()
    };
    format!("{}{more}", shown.join(", "))
}

/// A name in quotes, cut short.
pub(crate) fn quoted(name: &str) -> String {
    match name.char_indices().nth(SHOWN_CHARACTERS) {
        None => format!("{name:?}"),
        Some((end, _)) => format!("{:?}…", &name[..end]),
    }
}

/// Keeps the faces of other sets, and their vertices.
fn keep(raw: &mut RawMesh, is_out: &[bool]) -> Left {
    let mut left = Left {
        indices: Vec::new(),
        all: raw.faces.triangles(),
    };
    let all = std::mem::take(&mut raw.faces);
    let corners = std::mem::take(&mut raw.corners);
    let mut rest = corners.as_slice();
    let mut triangle = 0;
    for face in all.iter() {
        let (own, others) = rest.split_at(face.corners);
        rest = others;
        let triangles = triangle..triangle + face.corners as u32 - 2;
        triangle = triangles.end;
        if !is_out[face.names] {
            left.indices.extend(triangles);
            raw.faces.push(face);
            raw.corners.extend(own);
        }
    }
    raw.keep_used_vertices();
    left
}
