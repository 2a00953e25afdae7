//! `NAME.toml`: the fields of a `GraspObject` that clients set, under the same names.
//!
//! Each function that reads a value adds its problems to the violations of its field, and returns `None` then.

use std::cell::RefCell;

use grasp_proto::v1::{self, shape::Kind};
use toml::{Table, Value};

use crate::{
    objects::name_of,
    validate::{Field, Labels, Violations, quoted},
};

/// The preferences that a region and a grip can have.
const REGION_PREFERENCES: &[&str] = &["preferred", "avoided", "forbidden"];
const GRIP_PREFERENCES: &[&str] = &["preferred", "forbidden"];

type ReadKind = fn(&Keys<'_>) -> Kind;

const SHAPES: [(&str, ReadKind); 3] = [
    ("tube", |keys| {
        Kind::Tube(v1::TubeShape {
            points: keys.list("points", vector),
            radii: keys.list("radii", number),
        })
    }),
    ("box", |keys| {
        Kind::Box(v1::BoxShape {
            pose: keys.optional("pose", pose),
            half_extents: keys.optional("half_extents", vector),
        })
    }),
    ("half_space", |keys| {
        Kind::HalfSpace(v1::HalfSpaceShape {
            point: keys.optional("point", vector),
            normal: keys.optional("normal", direction),
        })
    }),
];

/// The keys of a hand's digits, and of a digit's angles.
const DIGITS: [&str; 5] = ["thumb", "index", "middle", "ring", "little"];
const ANGLES: [&str; 4] = ["base_yaw", "base_pitch", "second_pitch", "third_pitch"];

const HANDS: &[&str] = &["left", "right"];

/// The conventions in which a wrist may be given.
const CONVENTIONS: &[&str] = &["openxr", "unity", "unreal", "godot", "unity_flip_x", "unreal_xzy"];

/// Mass in kilograms for further checks of a manifest without one; no object gets it.
const PLACEHOLDER_MASS: f32 = 1.0;

/// Reads the manifest of the object with this id key by key, to report all problems at once. Its values are not checked.
/// `None` if it is not TOML.
pub(crate) fn read_manifest(id: &str, bytes: &[u8], violations: &Violations) -> Option<v1::GraspObject> {
    let whole = violations.field("");
    let text = std::str::from_utf8(bytes);
    let text = text
        .map_err(|error| whole.add(format_args!("is not UTF-8: {error}")))
        .ok()?;
    let table = text.parse::<Table>().map_err(|error| {
        let line = error
            .span()
            .map_or(1, |span| 1 + text[..span.start].matches('\n').count());
        whole.add(format_args!("is not TOML: line {line}: {}", error.message()));
    });
    let table = table.ok()?;
    let keys = Keys::of(None, &table, violations);
    let mass = keys.required("mass_kg", "the mass in kilograms", number);
    let object = v1::GraspObject {
        name: name_of(id),
        // A missing or wrong mass was added to the violations.
        mass_kg: mass.unwrap_or(PLACEHOLDER_MASS),
        meters_per_unit: keys.optional("meters_per_unit", number),
        z_up: keys.optional("z_up", flag).unwrap_or_default(),
        center_of_mass: keys.optional("center_of_mass", vector),
        friction: keys.optional("friction", number),
        regions: keys.list("regions", region),
        known_grips: keys.list("known_grips", known_grip),
        labels: keys.optional("labels", labels).unwrap_or_default(),
        parts: keys.list("parts", group_name),
        ..Default::default()
    };
    keys.reject_others();
    Some(object)
}

/// A table, whose violations go to `parent` or, without one, to the manifest as a whole.
struct Keys<'a> {
    parent: Option<Field<'a>>,
    table: &'a Table,
    violations: &'a Violations,
    /// The keys that were looked up.
    known: RefCell<Vec<&'static str>>,
}

impl<'a> Keys<'a> {
    fn of(parent: Option<Field<'a>>, table: &'a Table, violations: &'a Violations) -> Self {
        Self {
            parent,
            table,
            violations,
            known: RefCell::default(),
        }
    }

    fn field<'b>(&'b self, key: &'b str) -> Field<'b> {
        match &self.parent {
            Some(parent) => parent.child(key),
            None => self.violations.field(key),
        }
    }

    /// Adds a violation for every key that was not looked up.
    fn reject_others(&self) {
        let known = self.known.borrow();
        let keys = known.join(", ");
        for key in self.table.keys().filter(|key| !known.contains(&key.as_str())) {
            let unknown = format_args!("is unknown; the keys are {keys}");
            self.field(key).add(unknown);
        }
    }

    fn optional<T>(&self, key: &'static str, read: impl FnOnce(At<'_>) -> Option<T>) -> Option<T> {
        self.known.borrow_mut().push(key);
        read(At {
            field: self.field(key),
            value: self.table.get(key)?,
        })
    }

    fn required<T>(
        &self,
        key: &'static str,
        needed: &str,
        read: impl FnOnce(At<'_>) -> Option<T>,
    ) -> Option<T> {
        let is_there = self.table.contains_key(key);
        self.field(key)
            .check(is_there, format_args!("is missing; it must be {needed}"));
        self.optional(key, read)
    }

    fn required_text(&self, key: &'static str) -> Option<String> {
        self.required(key, "a text", |at| at.text("a text"))
    }

    fn required_word(&self, key: &'static str, prefix: &str, words: &[&str]) -> String {
        let word = self.required(key, &listed(words), |at| at.word(prefix, words));
        word.unwrap_or_default()
    }

    fn preference(&self, words: &[&str]) -> v1::Preference {
        let name = self.required_word("preference", "PREFERENCE", words);
        v1::Preference::from_str_name(&name).unwrap_or_default()
    }

    /// The elements of an array; none of them if one is wrong, because later violations would give wrong indices for the
    /// others.
    fn list<T>(&self, key: &'static str, read: impl FnMut(At<'_>) -> Option<T>) -> Vec<T> {
        let elements = self.optional(key, |at| match at.value.as_array() {
            Some(values) => at.elements(values, read),
            None => at.reject("a list in brackets"),
        });
        elements.unwrap_or_default()
    }
}

/// A value and its field.
#[derive(Clone, Copy)]
struct At<'a> {
    field: Field<'a>,
    value: &'a Value,
}

impl At<'_> {
    /// Adds the violation of a value of the wrong type.
    fn reject<T>(self, needed: &str) -> Option<T> {
        let text = match self.value {
            Value::String(text) => quoted(text),
            Value::Table(_) => "a table".to_owned(),
            Value::Array(values) => format!("a list of {}", values.len()),
            other => other.to_string(),
        };
        self.field.reject(format_args!("is {text}; it must be {needed}"))
    }

    fn text(self, needed: &str) -> Option<String> {
        let text = self.value.as_str().map(str::to_owned);
        text.or_else(|| self.reject(needed))
    }

    /// One of the words, as the contract has it: in capitals after a prefix.
    fn word(self, prefix: &str, words: &[&str]) -> Option<String> {
        let word = words.iter().find(|word| self.value.as_str() == Some(word));
        let name = word.map(|word| format!("{prefix}_{}", word.to_uppercase()));
        name.or_else(|| self.reject(&listed(words)))
    }

    /// A table with only keys that `read` looks up, and only valid values.
    fn table<T>(self, read: impl FnOnce(&Keys<'_>) -> T) -> Option<T> {
        let Some(table) = self.value.as_table() else {
            // An empty table shows which keys `read` looks up.
            let (table, ignored) = (Table::new(), Violations::default());
            let keys = Keys::of(None, &table, &ignored);
            read(&keys);
            return self.reject(&format!("a table with {}", keys.known.into_inner().join(", ")));
        };
        let violations = self.field.violations();
        let before = violations.len();
        let keys = Keys::of(Some(self.field), table, violations);
        let read = read(&keys);
        keys.reject_others();
        (violations.len() == before).then_some(read)
    }

    /// All elements, if all are valid.
    fn elements<T>(self, values: &[Value], mut read: impl FnMut(At<'_>) -> Option<T>) -> Option<Vec<T>> {
        let elements = values.iter().enumerate().filter_map(|(place, value)| {
            read(At {
                field: self.field.at(place),
                value,
            })
        });
        let elements: Vec<T> = elements.collect();
        (elements.len() == values.len()).then_some(elements)
    }

    fn numbers<const N: usize>(self, needed: &str) -> Option<[f32; N]> {
        match self.value.as_array() {
            Some(values) if values.len() == N => self.elements(values, number)?.try_into().ok(),
            _ => self.reject(needed),
        }
    }
}

/// The words in quotes: `"a", "b" or "c"`.
fn listed(words: &[&str]) -> String {
    let quoted: Vec<String> = words.iter().map(|word| format!("{word:?}")).collect();
    match quoted.as_slice() {
        [first @ .., last] if !first.is_empty() => format!("{} or {last}", first.join(", ")),
        all => all.concat(),
    }
}

fn number(at: At<'_>) -> Option<f32> {
    match at.value {
        Value::Float(number) => Some(*number as f32),
        Value::Integer(number) => Some(*number as f32),
        _ => at.reject("a number"),
    }
}

fn flag(at: At<'_>) -> Option<bool> {
    at.value.as_bool().or_else(|| at.reject("true or false"))
}

fn group_name(at: At<'_>) -> Option<String> {
    at.text("a name in quotes")
}

fn triangle_index(at: At<'_>) -> Option<u32> {
    let number = at.value.as_integer();
    let index = number.and_then(|number| u32::try_from(number).ok());
    index.or_else(|| at.reject("a triangle's number, counted from 0"))
}

fn vector(at: At<'_>) -> Option<v1::Vector3> {
    let [x, y, z] = at.numbers("three numbers in meters, as in [0, 0.1, 0]")?;
    Some(v1::Vector3 { x, y, z })
}

/// A direction of any length.
fn direction(at: At<'_>) -> Option<v1::Vector3> {
    let [x, y, z] = at.numbers("three numbers, as in [0, 1, 0]")?;
    Some(v1::Vector3 { x, y, z })
}

fn quaternion(at: At<'_>) -> Option<v1::Quaternion> {
    let [x, y, z, w] = at.numbers("a quaternion x, y, z, w, as in [0, 0, 0, 1]")?;
    Some(v1::Quaternion { x, y, z, w })
}

/// A pose; absent parts are those of the identity.
fn pose(at: At<'_>) -> Option<v1::Pose> {
    at.table(|keys| v1::Pose {
        position: keys.optional("position", vector),
        orientation: keys.optional("orientation", quaternion),
    })
}

fn labels(at: At<'_>) -> Option<Labels> {
    let Some(table) = at.value.as_table() else {
        return at.reject("a table of texts");
    };
    let label = |(key, value): (&String, &Value)| {
        let field = at.field.child(key);
        Some((key.clone(), At { field, value }.text("a text")?))
    };
    Some(table.iter().filter_map(label).collect())
}

fn region(at: At<'_>) -> Option<v1::Region> {
    at.table(|keys| v1::Region {
        name: keys.required_text("name").unwrap_or_default(),
        preference: keys.preference(REGION_PREFERENCES).into(),
        weight: keys.optional("weight", number),
        groups: keys.list("groups", group_name),
        triangles: keys.list("triangles", triangle_index),
        shapes: keys.list("shapes", shape),
    })
}

fn shape(at: At<'_>) -> Option<v1::Shape> {
    let given = at.value.as_table().filter(|table| table.len() == 1);
    let given = given.and_then(|table| table.iter().next());
    let known = given.and_then(|(key, _)| SHAPES.iter().find(|(name, _)| name == key));
    let (Some((_, value)), Some((name, kind))) = (given, known) else {
        let kinds = SHAPES.map(|(name, _)| name);
        return at.reject(&format!("a table with one of {}", listed(&kinds)));
    };
    let field = at.field.child(name);
    // Missing fields are reported with the checks of the request.
    At { field, value }.table(|keys| v1::Shape {
        kind: Some(kind(keys)),
    })
}

fn known_grip(at: At<'_>) -> Option<v1::KnownGrip> {
    at.table(|keys| v1::KnownGrip {
        name: keys.required_text("name").unwrap_or_default(),
        preference: keys.preference(GRIP_PREFERENCES).into(),
        hand: keys.required("hand", "a table with a hand", hand),
        near_distance: keys.optional("near_distance", number),
        near_angle: keys.optional("near_angle", number),
    })
}

fn hand(at: At<'_>) -> Option<v1::HandPose> {
    at.table(|keys| {
        let rig = keys.optional("rig", |at| at.text("the name of a rig"));
        let handedness =
            v1::Handedness::from_str_name(&keys.required_word("handedness", "HANDEDNESS", HANDS));
        let hand = v1::HandPose {
            scale: keys.optional("scale", number),
            object_from_wrist: keys.optional("object_from_wrist", pose),
            ..v1::HandPose::new(rig.unwrap_or_default(), handedness.unwrap_or_default())
        };
        let hand = hand.with_digits(DIGITS.map(|key| keys.optional(key, digit)));
        let convention = keys.optional("convention", |at| at.word("CONVENTION", CONVENTIONS));
        let convention = convention.and_then(|name| v1::Convention::from_str_name(&name));
        v1::HandPose {
            convention: convention.unwrap_or_default().into(),
            ..hand
        }
    })
}

/// The angles of a digit; 0 if absent.
fn digit(at: At<'_>) -> Option<v1::DigitAngles> {
    at.table(|keys| {
        let [base_yaw, base_pitch, second_pitch, third_pitch] = ANGLES.map(|key| keys.optional(key, number));
        v1::DigitAngles {
            base_yaw: base_yaw.unwrap_or_default(),
            base_pitch: base_pitch.unwrap_or_default(),
            second_pitch: second_pitch.unwrap_or_default(),
            third_pitch,
        }
    })
}
