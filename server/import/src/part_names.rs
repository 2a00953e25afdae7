//! Purposes of a file's parts, inferred from their names by the habits of engines and modelling tools.

use crate::text::name_words;

/// First parts of names of colliders in Unreal.
const COLLIDER_PREFIXES: [&str; 5] = ["ubx_", "ucp_", "ucx_", "usp_", "mcdcx_"];

/// Last parts of names that Godot imports as something other than a mesh, after one of the characters `-`, `_` and `$`.
const HELPER_SUFFIXES: [&str; 5] = ["colonly", "convcolonly", "navmesh", "noimp", "occonly"];

/// Words, or parts of them, that name colliders.
const COLLIDER_WORDS: [&str; 3] = ["collider", "collision", "hitbox"];

/// Words that turn these into the opposite.
const DENIALS: [&str; 3] = ["no", "non", "without"];

/// Last words that name colliders if the rest is the name of another part.
const WEAK_WORDS: [&str; 5] = ["col", "coll", "phys", "physics", "proxy"];

/// The purpose of a part by its name; indices keep parts apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Role {
    /// This part, to be seen for all that its name says.
    Part(u32),
    /// For a program: a collider, for instance.
    Helper,
    /// A collider if there is this part.
    HelperOf(u32),
    /// This part in this level of detail: 0 is the finest.
    Level(u32, u32),
}

impl Role {
    /// By a name; `index` gives the index of a part by its name in lower case.
    pub(crate) fn of(name: &str, index: &mut impl FnMut(&str) -> u32) -> Self {
        if let Some((base, level)) = level(name) {
            return Self::Level(index(&base), level);
        }
        let lower = plain(name);
        let is_helper = |suffix: &&str| {
            let rest = lower.strip_suffix(*suffix);
            rest.is_some_and(|rest| rest.ends_with(['-', '_', '$']))
        };
        if COLLIDER_PREFIXES.iter().any(|prefix| lower.starts_with(prefix))
            || HELPER_SUFFIXES.iter().any(is_helper)
        {
            return Self::Helper;
        }
        let mut words = name_words(&name[..lower.len()]);
        words.retain(|word| !word.starts_with(|first: char| first.is_ascii_digit()));
        let mut before = "";
        for word in &words {
            let found = COLLIDER_WORDS.iter().find_map(|collider| word.find(collider));
            if found.is_some_and(|start| ![before, &word[..start]].iter().any(|word| DENIALS.contains(word)))
            {
                return Self::Helper;
            }
            before = word;
        }
        let weak = words.last().filter(|last| WEAK_WORDS.contains(&last.as_str()));
        match weak.and_then(|last| lower.strip_suffix(last.as_str())) {
            Some(base) => Self::HelperOf(index(base.trim_end_matches(is_separator))),
            None => Self::Part(index(&lower)),
        }
    }
}

/// A name in lower case, without the number by which Blender tells copies apart.
fn plain(name: &str) -> String {
    let lower = name.to_ascii_lowercase();
    let copy = lower
        .rsplit_once('.')
        .filter(|(_, number)| number.len() == 3 && number.bytes().all(|digit| digit.is_ascii_digit()));
    copy.map_or(lower.as_str(), |(name, _)| name).to_owned()
}

fn is_separator(character: char) -> bool {
    matches!(character, '_' | '-' | '.' | ' ' | '$' | ':')
}

/// The level of detail in a name, such as `Mug_LOD1`, and the name without it.
fn level(name: &str) -> Option<(String, u32)> {
    let lower = plain(name);
    let bytes = name.as_bytes();
    lower.match_indices("lod").find_map(|(start, lod)| {
        let begins_word = match start.checked_sub(1).map(|before| bytes[before]) {
            None => true,
            // A capital letter begins a word within a word.
            Some(before) => {
                !before.is_ascii_alphabetic() || (before.is_ascii_lowercase() && bytes[start] == b'L')
            }
        };
        let rest = &lower[start + lod.len()..];
        let number = rest.strip_prefix(is_separator).unwrap_or(rest);
        let digits = number.bytes().take_while(u8::is_ascii_digit).count();
        let after = &number[digits..];
        let ends_word = !after.starts_with(|next: char| next.is_alphanumeric());
        if !(begins_word && ends_word && (1..=2).contains(&digits)) {
            return None;
        }
        let before = lower[..start].trim_end_matches(is_separator);
        let base = format!("{before}{after}");
        Some((
            base.trim_matches(is_separator).to_owned(),
            number[..digits].parse().ok()?,
        ))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A purpose inferred from a name, and its part.
    fn role(name: &str) -> (Role, String) {
        let mut part = String::new();
        let role = Role::of(name, &mut |name| {
            name.clone_into(&mut part);
            0
        });
        (role, part)
    }

    #[test]
    fn names_of_colliders_are_known() {
        for name in "UCX_Mug_01|ubx_table|MCDCX_Mug|Mug-colonly|Mug_convcolonly|Mug-convcolonly.001|Collider|\
             MugCollider|mug_collider_2|mugcollider|Mug Collision Mesh|CollisionMesh|OMI_collider|\
             head-hitbox|Floor-navmesh"
            .split('|')
        {
            assert_eq!(role(name).0, Role::Helper, "{name}");
        }
    }

    #[test]
    fn names_of_parts_say_nothing_else() {
        for name in
            "|Mug|Mug-col.x|Column|colander|Mug_NoCollision|no collider|NonCollisionMesh|UCX|Lode|melody1|\
             LOD|Mug_LOD|explode2|Mug-noimport|collie|Größe"
                .split('|')
        {
            assert_eq!(role(name).0, Role::Part(0), "{name}");
        }
    }

    #[test]
    fn ambiguous_names_of_colliders_name_their_part() {
        for (name, part) in [
            ("Mug_col", "mug"),
            ("Mug-Phys", "mug"),
            ("mug_proxy.001", "mug"),
            ("MugPhysics", "mug"),
        ] {
            assert_eq!(role(name), (Role::HelperOf(0), part.to_owned()), "{name}");
        }
    }

    #[test]
    fn levels_of_detail_are_told_from_their_part() {
        for (name, part, level) in [
            ("Mug_LOD0", "mug", 0),
            ("Mug_LOD1", "mug", 1),
            ("mug.lod02", "mug", 2),
            ("MugLOD3", "mug", 3),
            ("Mug_LOD_1", "mug", 1),
            ("LOD1", "", 1),
            ("LOD1_Mug", "mug", 1),
            ("Mug_LOD1_Handle", "mug_handle", 1),
            ("Mug_LOD1.001", "mug", 1),
        ] {
            assert_eq!(role(name), (Role::Level(0, level), part.to_owned()), "{name}");
        }
    }
}
