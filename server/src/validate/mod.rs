//! Turns requests into checked values, or into a list of everything that is wrong with them.
//!
//! Every function takes the field's path and the violations so far, and returns a usable value even for wrong input, so
//! that all violations are found; [`Violations::finish`] decides in the end. A valid request without further hands and
//! obstacles causes no allocations here.

mod current_grasp;
mod evaluate_holdout;
mod find_grasp;
mod frames;
mod given_names;
mod hand;
mod holdout;
mod known_grips;
mod labels;
mod object;
mod object_size;
mod obstacles;
mod output;
mod page;
mod receiver;
mod regions;
mod requirements;
mod rig;
mod search_limits;
mod search_options;
mod stream_grasps;
mod track;
mod update;
mod upload;
mod validate_grasp;
mod watch;

use std::fmt;

use glam::{Quat, Vec3};
use grasp_proto::v1;
use grasp_synthesis::base::pose::Pose;

pub(crate) use evaluate_holdout::{EvaluateQuery, evaluate_query};
pub(crate) use find_grasp::{FindQuery, find_query};
#[cfg(test)]
pub(crate) use hand::fixtures;
pub(crate) use hand::{GivenGrasp, GiverHand, MeshedHand};
pub(crate) use known_grips::{GripFields, GripKind, PreferredGrip};
pub(crate) use labels::{LabelFilter, Labels};
pub(crate) use object::{
    COLLECTION, ID_RULE, OBJECT, ObjectFields, RequestKey, object_fields, object_id_of, saved_object_fields,
};
pub(crate) use object_size::RequestedSize;
#[cfg(test)]
pub(crate) use obstacles::tests::any_obstacles;
pub(crate) use page::{PageQuery, Place, page_query, page_token};
pub(crate) use regions::{RegionFields, RegionKind};
pub(crate) use rig::{RigFields, RigOrigin, rig_fields, rig_id_of, rig_page_query, rig_page_token};
pub(crate) use stream_grasps::{Sent, StreamQuery, stream_query};
pub(crate) use track::{
    Frame, Latest, TrackIntake, TrackPolicy, TrackQuery, WrongFrame, sentences, track_query,
};
pub(crate) use update::{ObjectChange, Setting, UpdateQuery, given_etag, update_query};
pub(crate) use upload::{UploadQuery, upload_query};
pub(crate) use validate_grasp::{ValidateQuery, validate_query};
pub(crate) use watch::{WatchQuery, watch_query};

use crate::error::{ServiceError, Violation};

/// Largest number of listed violations; the others are only counted. Four hands whose joints are wrong in every way have fewer.
const MAXIMUM_LISTED: usize = 512;

/// Largest number of characters that an error quotes of a client's text.
const MAXIMUM_QUOTED: usize = 80;

/// Largest deviation of a quaternion's norm from 1.
const QUATERNION_TOLERANCE: f32 = 0.01;

/// Largest distance from the client's origin along an axis, in metres. Beyond it, the resolution of a float is worse
/// than 0.1 mm.
const FARTHEST: f32 = 1000.0;

/// Largest coefficient of static friction; silicone rubber on itself stays below 2.
pub(crate) const MAXIMUM_FRICTION: f32 = 5.0;

/// The violations found so far.
#[derive(Debug, Default)]
pub(crate) struct Violations {
    listed: Vec<Violation>,
    unlisted: usize,
    /// Name of a rig whose record is damaged: no fault of the request, and answered before all that are.
    damaged_rig: Option<String>,
}

impl Violations {
    /// Adds a violation. The texts are formatted only if it is listed.
    pub(crate) fn add(&mut self, field: impl fmt::Display, description: impl fmt::Display) {
        if self.listed.len() < MAXIMUM_LISTED {
            self.listed
                .push(Violation::new(field.to_string(), description.to_string()));
        } else {
            self.unlisted += 1;
        }
    }

    /// Notes that the request needs a rig whose record is damaged.
    fn add_damaged_rig(&mut self, field: impl fmt::Display, name: &str) {
        self.damaged_rig = Some(name.to_owned());
        self.add(field, "names a rig whose record is damaged");
    }

    /// Adds violations of the same message.
    fn add_all(&mut self, others: Self) {
        for Violation {
            field, description, ..
        } in others.listed
        {
            self.add(field, description);
        }
        self.unlisted += others.unlisted;
        self.damaged_rig = self.damaged_rig.take().or(others.damaged_rig);
    }

    /// True if all of them are of a field of this name, whatever it is in.
    fn are_all_of(&self, name: &str) -> bool {
        self.unlisted == 0
            && self
                .listed
                .iter()
                .all(|violation| violation.field.split('.').any(|part| part == name))
    }

    /// Adds the violations of a message inside this one.
    fn add_all_within(&mut self, parent: Field<'_>, inner: Self) {
        for Violation {
            field, description, ..
        } in inner.listed
        {
            self.add(parent.child(&field), description);
        }
        self.unlisted += inner.unlisted;
        self.damaged_rig = self.damaged_rig.take().or(inner.damaged_rig);
    }

    /// True if there are none.
    pub(crate) fn is_empty(&self) -> bool {
        self.listed.is_empty()
    }

    /// Number of violations.
    pub(crate) fn len(&self) -> usize {
        self.listed.len() + self.unlisted
    }

    /// `value` if there are no violations.
    ///
    /// # Errors
    /// [`ServiceError::Invalid`] with the violations.
    pub(crate) fn finish<T>(self, value: T) -> Result<T, ServiceError> {
        if self.is_empty() {
            Ok(value)
        } else {
            Err(self.into_error())
        }
    }

    /// The error that lists the violations.
    pub(crate) fn into_error(mut self) -> ServiceError {
        if let Some(name) = self.damaged_rig {
            return ServiceError::RigDamaged { name };
        }
        if let Some(last) = self.listed.last_mut() {
            last.unlisted = self.unlisted;
        }
        ServiceError::Invalid(self.listed)
    }
}

/// The path of a field, formatted only when it is needed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Field<'a> {
    parent: Option<&'a Field<'a>>,
    name: &'a str,
    index: Option<usize>,
}

impl<'a> Field<'a> {
    /// A field of the request itself.
    pub(crate) const fn root(name: &'a str) -> Self {
        Self {
            parent: None,
            name,
            index: None,
        }
    }

    /// A field of this message.
    pub(crate) const fn child(&'a self, name: &'a str) -> Self {
        Self {
            parent: Some(self),
            name,
            index: None,
        }
    }

    /// An element of this repeated field.
    pub(crate) const fn at(self, index: usize) -> Self {
        Self {
            index: Some(index),
            ..self
        }
    }
}

impl fmt::Display for Field<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(parent) = self.parent {
            write!(f, "{parent}.")?;
        }
        f.write_str(self.name)?;
        match self.index {
            Some(index) => write!(f, "[{index}]"),
            None => Ok(()),
        }
    }
}

/// A client's text in quotes, shortened if it is long.
pub(crate) fn quoted(text: &str) -> String {
    let mut characters = text.chars();
    let start: String = characters.by_ref().take(MAXIMUM_QUOTED).collect();
    let ellipsis = if characters.next().is_some() { "…" } else { "" };
    format!("{start:?}{ellipsis}")
}

/// An unchecked vector.
fn raw(v: v1::Vector3) -> Vec3 {
    Vec3::new(v.x, v.y, v.z)
}

/// A finite vector; zero if it is not finite.
fn finite(field: Field<'_>, v: v1::Vector3, violations: &mut Violations) -> Vec3 {
    let vector = raw(v);
    if vector.is_finite() {
        vector
    } else {
        violations.add(field, format_args!("is {vector}; every number must be finite"));
        Vec3::ZERO
    }
}

/// A point in the client's convention, whose unit is `metres_per_unit` long.
fn point(field: Field<'_>, v: v1::Vector3, metres_per_unit: f32, violations: &mut Violations) -> Vec3 {
    let point = finite(field, v, violations);
    let farthest = FARTHEST / metres_per_unit;
    if point.abs().max_element() > farthest {
        violations.add(
            field,
            format_args!("is {point}; no coordinate may be more than {farthest} from 0 (1 km)"),
        );
        return Vec3::ZERO;
    }
    point
}

/// A vector of any length but 0, in the client's axes, as a unit vector; none if it is wrong.
fn direction(field: Field<'_>, v: v1::Vector3, violations: &mut Violations) -> Option<Vec3> {
    let direction = raw(v);
    // Scaled first: the squares of huge or tiny numbers overflow or vanish.
    let unit = (direction / direction.abs().max_element())
        .try_normalize()
        .filter(|_| direction.is_finite());
    if unit.is_none() {
        violations.add(field, format_args!("is {direction}; it must be finite and not 0"));
    }
    unit
}

/// A unit quaternion, renormalised.
fn orientation(field: Field<'_>, q: v1::Quaternion, violations: &mut Violations) -> Quat {
    let quaternion = Quat::from_xyzw(q.x, q.y, q.z, q.w);
    let norm = quaternion.length();
    if (norm - 1.0).abs() <= QUATERNION_TOLERANCE {
        return quaternion.normalize();
    }
    // NaN and infinity come here too: the comparison is false for them.
    violations.add(
        field,
        format_args!("is {quaternion}, of norm {norm}; it must be a unit quaternion, within 1 %"),
    );
    Quat::IDENTITY
}

/// A pose in the client's convention. An absent pose, or an absent part, is the identity.
fn pose(field: Field<'_>, pose: Option<v1::Pose>, metres_per_unit: f32, violations: &mut Violations) -> Pose {
    let Some(pose) = pose else {
        return Pose::IDENTITY;
    };
    Pose {
        position: pose.position.map_or(Vec3::ZERO, |v| {
            point(field.child("position"), v, metres_per_unit, violations)
        }),
        orientation: pose.orientation.map_or(Quat::IDENTITY, |q| {
            orientation(field.child("orientation"), q, violations)
        }),
    }
}

/// A coefficient of friction.
fn friction(field: Field<'_>, value: f32, violations: &mut Violations) -> f32 {
    if !(value > 0.0 && value <= MAXIMUM_FRICTION) {
        violations.add(
            field,
            format_args!("is {value}; it must be more than 0 and at most {MAXIMUM_FRICTION}"),
        );
    }
    value
}

/// A value of an enum of the contract; its default if the contract does not define the number.
fn known<E: TryFrom<i32> + Default>(field: Field<'_>, value: i32, violations: &mut Violations) -> E {
    E::try_from(value).unwrap_or_else(|_| {
        violations.add(
            field,
            format_args!("is {value}, which the contract does not define"),
        );
        E::default()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn field_paths_name_every_level() {
        let holdout = Field::root("holdout");
        let hands = holdout.child("other_hands").at(2);
        let pose = hands.child("pose");
        let digit = pose.child("index");
        assert_eq!(
            digit.child("base_pitch").to_string(),
            "holdout.other_hands[2].pose.index.base_pitch"
        );
    }

    #[test]
    fn normalises_quaternions_of_norm_near_1_and_rejects_others() {
        let field = Field::root("q");
        let mut violations = Violations::default();
        let q = orientation(
            field,
            v1::Quaternion {
                x: 0.0,
                y: 0.0,
                z: 0.0,
                w: 1.009,
            },
            &mut violations,
        );
        assert!(violations.is_empty());
        assert!((q.length() - 1.0).abs() < 1e-6);
        for w in [0.0, 0.98, 1.02, f32::NAN, f32::INFINITY, -f32::INFINITY, 1e30] {
            let mut violations = Violations::default();
            let q = orientation(
                field,
                v1::Quaternion {
                    x: 0.0,
                    y: 0.0,
                    z: 0.0,
                    w,
                },
                &mut violations,
            );
            assert_eq!(violations.listed.len(), 1, "{w}");
            assert_eq!(q, Quat::IDENTITY);
        }
    }

    #[test]
    fn rejects_points_beyond_a_kilometre_and_non_finite_ones() {
        let field = Field::root("p");
        for (x, unit, right) in [
            (999.0, 1.0, true),
            (1001.0, 1.0, false),
            (1001.0, 0.01, true),
            (f32::NAN, 1.0, false),
            (f32::NEG_INFINITY, 1.0, false),
        ] {
            let mut violations = Violations::default();
            let v = point(field, v1::Vector3 { x, y: 0.0, z: 0.0 }, unit, &mut violations);
            assert_eq!(violations.is_empty(), right, "{x} {unit}");
            assert!(v.is_finite());
        }
    }

    #[test]
    fn lists_some_violations_and_counts_the_others() {
        let mut violations = Violations::default();
        for i in 0..1000 {
            violations.add(Field::root("f").at(i), "is wrong");
        }
        let Err(ServiceError::Invalid(listed)) = violations.finish(()) else {
            panic!("violations must not pass");
        };
        assert_eq!(listed.len(), MAXIMUM_LISTED);
        assert_eq!(
            listed.iter().map(|violation| violation.unlisted).sum::<usize>(),
            1000 - MAXIMUM_LISTED
        );
    }

    #[test]
    fn shortens_long_quotes() {
        assert_eq!(quoted("a\nb"), "\"a\\nb\"");
        assert_eq!(quoted(&"é".repeat(500)).chars().count(), MAXIMUM_QUOTED + 3);
    }

    #[test]
    fn rejects_undefined_enum_values() {
        let mut violations = Violations::default();
        let strategy: v1::Strategy = known(Field::root("strategy"), 77, &mut violations);
        assert_eq!(strategy, v1::Strategy::Unspecified);
        assert_eq!(
            violations.listed[0].description,
            "is 77, which the contract does not define"
        );
    }
}
