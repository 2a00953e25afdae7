//! The violations of a request, the paths of its fields, and checks of the values that are in many of them.

use std::{cell::RefCell, fmt, fmt::Display, ops::RangeInclusive, time::Duration};

use glam::{Quat, Vec3};
use grasp_proto::v1;
use grasp_synthesis::{base::pose::Pose, model::hand::Handedness};

use crate::{
    convention::Convention,
    error::{ServiceError, Violation},
};

/// Largest number of listed violations; the others are only counted. Four hands whose joints are wrong in every way have fewer.
const MAX_LISTED: usize = 512;
const QUATERNION_TOLERANCE: f32 = 0.01;

/// Largest distance from the client's origin along an axis, in metres, beyond which floats are coarser than 0.1 mm.
pub(super) const FARTHEST: f32 = 1000.0;

/// Largest coefficient of static friction; silicone rubber on itself stays below 2.
const MAX_FRICTION: f32 = 5.0;

/// Largest number of seconds in a `google.protobuf.Duration`: 10,000 years.
const MAX_DURATION_SECONDS: u64 = 315_576_000_000;

#[derive(Debug, Default)]
pub(crate) struct Violations(RefCell<FoundViolations>);

#[derive(Debug, Default)]
struct FoundViolations {
    listed: Vec<Violation>,
    unlisted: usize,
    /// Name of a rig whose record is damaged: not a violation, and answered before any.
    damaged_rig: Option<String>,
}

impl Violations {
    pub(crate) const fn field<'a>(&'a self, name: &'a str) -> Field<'a> {
        Field {
            violations: self,
            parent: None,
            name,
            index: None,
        }
    }

    /// Adds a violation. The texts are formatted only if it is listed.
    pub(crate) fn add(&self, field: impl Display, description: impl Display) {
        let mut found = self.0.borrow_mut();
        if found.listed.len() < MAX_LISTED {
            found
                .listed
                .push(Violation::new(field.to_string(), description.to_string()));
        } else {
            found.unlisted += 1;
        }
    }

    pub(super) fn truncate(&self, count: usize) {
        let mut found = self.0.borrow_mut();
        found.listed.truncate(count);
        found.unlisted = 0;
    }

    /// Renames the field `path`, and with it those inside, to `new_path`.
    pub(super) fn move_path(&self, path: &str, new_path: &str) {
        for Violation { field, .. } in &mut self.0.borrow_mut().listed {
            if let Some(inside) = field.strip_prefix(path) {
                *field = format!("{new_path}{inside}");
            }
        }
    }

    /// True if all but the first violations are of a field of this name, or inside one.
    pub(super) fn are_all_of(&self, name: &str, first: usize) -> bool {
        let found = self.0.borrow();
        let is_of = |violation: &Violation| violation.field.split('.').any(|part| part == name);
        found.unlisted == 0 && found.listed.iter().skip(first).all(is_of)
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.len() == 0
    }

    pub(crate) fn len(&self) -> usize {
        let found = self.0.borrow();
        found.listed.len() + found.unlisted
    }

    pub(super) fn take_listed(&self) -> Vec<Violation> {
        self.0.take().listed
    }

    pub(crate) fn finish<T>(&self, value: T) -> Result<T, ServiceError> {
        self.finish_some(Some(value))
    }

    /// The value if there are no violations. It may be `None` only with violations.
    pub(super) fn finish_some<T>(&self, value: Option<T>) -> Result<T, ServiceError> {
        let taken = || Self(RefCell::new(self.0.take()));
        value
            .filter(|_| self.is_empty())
            .ok_or_else(|| taken().into_error())
    }

    pub(crate) fn into_error(self) -> ServiceError {
        let mut found = self.0.into_inner();
        if let Some(name) = found.damaged_rig {
            return ServiceError::RigDamaged { name };
        }
        if let Some(last) = found.listed.last_mut() {
            last.unlisted = found.unlisted;
        }
        ServiceError::Invalid(found.listed)
    }
}

/// A field of a request, whose path is formatted only when it is needed, and where its violations go.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Field<'a> {
    violations: &'a Violations,
    parent: Option<&'a Field<'a>>,
    name: &'a str,
    index: Option<usize>,
}

impl<'a> Field<'a> {
    pub(crate) const fn child(&'a self, name: &'a str) -> Self {
        Self {
            parent: Some(self),
            name,
            index: None,
            ..*self
        }
    }

    pub(crate) const fn at(self, index: usize) -> Self {
        Self {
            index: Some(index),
            ..self
        }
    }

    pub(crate) fn add(self, description: impl Display) {
        self.violations.add(self, description);
    }

    pub(crate) fn reject<T>(self, description: impl Display) -> Option<T> {
        self.add(description);
        None
    }

    /// Adds a violation unless the field is right. Returns whether it is.
    pub(crate) fn check(self, is_right: bool, description: impl Display) -> bool {
        if !is_right {
            self.add(description);
        }
        is_right
    }

    pub(super) fn if_right<T>(self, read: impl FnOnce() -> T) -> Option<T> {
        let before = self.violations.len();
        let value = read();
        (self.violations.len() == before).then_some(value)
    }

    pub(super) fn each<T, R>(
        self,
        elements: impl IntoIterator<Item = T>,
        mut read: impl FnMut(Self, T) -> R,
    ) -> impl Iterator<Item = R> {
        let elements = elements.into_iter().enumerate();
        elements.map(move |(index, element)| read(self.at(index), element))
    }

    /// Notes that this field needs a rig whose record is damaged.
    pub(super) fn add_damaged_rig(self, name: &str) {
        self.violations.0.borrow_mut().damaged_rig = Some(name.to_owned());
        self.add("names a rig whose record is damaged");
    }

    pub(crate) const fn violations(self) -> &'a Violations {
        self.violations
    }
}

impl Display for Field<'_> {
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

pub(super) fn required<T>(field: Field<'_>, sent: Option<T>) -> Option<T> {
    sent.or_else(|| field.reject("is absent; it is required"))
}

pub(super) fn check_unset<const N: usize>(parent: Field<'_>, fields: [(&str, bool); N], why_not: &str) {
    for (name, is_set) in fields {
        parent
            .child(name)
            .check(!is_set, format_args!("is set; {why_not}"));
    }
}

/// True if a list has at most `most` elements, called `what` in the violation.
pub(super) fn check_count(field: Field<'_>, count: usize, most: usize, what: &str) -> bool {
    let text = format_args!("has {count} {what}; it may have up to {most}");
    field.check(count <= most, text)
}

/// True if a number is more than 0 and at most `most`.
pub(super) fn check_positive(field: Field<'_>, value: f32, most: f32) -> bool {
    let text = format_args!("is {value}; it must be more than 0 and at most {most}");
    field.check(value > 0.0 && value <= most, text)
}

pub(super) fn check_within<T: Copy + PartialOrd + Display>(
    field: Field<'_>,
    value: T,
    range: RangeInclusive<T>,
) -> bool {
    let (least, most) = (range.start(), range.end());
    let text = format_args!("is {value}; it must be {least} to {most}");
    field.check(range.contains(&value), text)
}

/// A factor in its range; 1 if it is absent or wrong.
pub(super) fn factor(field: Field<'_>, given: Option<f32>, range: RangeInclusive<f32>) -> f32 {
    given
        .filter(|&factor| check_within(field, factor, range))
        .unwrap_or(1.0)
}

pub(super) fn positive_duration(field: Field<'_>, sent: prost_types::Duration) -> Option<Duration> {
    let duration = duration(field, sent)?;
    let is_right = field.check(!duration.is_zero(), "is 0 s and 0 ns; it must be more than 0");
    is_right.then_some(duration)
}

/// A duration of at least 0.
pub(super) fn duration(field: Field<'_>, sent: prost_types::Duration) -> Option<Duration> {
    let prost_types::Duration { seconds, nanos } = sent;
    let in_range = seconds.unsigned_abs() <= MAX_DURATION_SECONDS && nanos.unsigned_abs() < 1_000_000_000;
    if !in_range || i64::from(nanos.signum()) * seconds.signum() < 0 {
        return field.reject(format_args!(
            "is {seconds} s and {nanos} ns, which is not a valid google.protobuf.Duration"
        ));
    }
    match (u64::try_from(seconds), u32::try_from(nanos)) {
        (Ok(seconds), Ok(nanos)) => Some(Duration::new(seconds, nanos)),
        _ => field.reject(format_args!(
            "is {seconds} s and {nanos} ns; it must not be negative"
        )),
    }
}

pub(super) fn friction(field: Field<'_>, sent: Option<f32>) -> Option<f32> {
    sent.inspect(|&value| {
        check_positive(field, value, MAX_FRICTION);
    })
}

pub(super) fn finite(field: Field<'_>, sent: v1::Vector3) -> Vec3 {
    let vector = Vec3::from(sent);
    let text = format_args!("is {vector}; every number must be finite");
    if field.check(vector.is_finite(), text) {
        vector
    } else {
        Vec3::ZERO
    }
}

fn client_point(field: Field<'_>, sent: v1::Vector3, convention: Convention) -> Vec3 {
    let point = finite(field, sent);
    let farthest = convention.length_from_openxr(FARTHEST);
    let text = format_args!("is {point}; no coordinate may be more than {farthest} from 0 (1 km)");
    let is_near = field.check(point.abs().max_element() <= farthest, text);
    if is_near { point } else { Vec3::ZERO }
}

/// A point, in metres and `OpenXR` axes.
pub(super) fn point(field: Field<'_>, sent: v1::Vector3, convention: Convention) -> Vec3 {
    convention.point_to_openxr(client_point(field, sent, convention))
}

/// A vector of any length but 0, in `OpenXR` axes, as a unit vector; `None` if it is wrong.
pub(super) fn direction(field: Field<'_>, sent: v1::Vector3, convention: Convention) -> Option<Vec3> {
    let direction = Vec3::from(sent);
    // Scaled first: the squares of huge or tiny numbers overflow or vanish.
    (direction / direction.abs().max_element())
        .try_normalize()
        .filter(|_| direction.is_finite())
        .map(|unit| convention.direction_to_openxr(unit))
        .or_else(|| field.reject(format_args!("is {direction}; it must be finite and not 0")))
}

fn orientation(field: Field<'_>, sent: v1::Quaternion) -> Quat {
    let quaternion = Quat::from(sent);
    let norm = quaternion.length();
    // NaN and infinity fail the comparison.
    let text = format_args!("is {quaternion}, of norm {norm}; it must be a unit quaternion, within 1 %");
    let is_unit = field.check((norm - 1.0).abs() <= QUATERNION_TOLERANCE, text);
    if is_unit {
        quaternion.normalize()
    } else {
        Quat::IDENTITY
    }
}

/// A pose in the client's axes and unit. An absent pose, or an absent part, is the identity.
pub(super) fn pose(field: Field<'_>, sent: Option<v1::Pose>, convention: Convention) -> Pose {
    let v1::Pose {
        position,
        orientation: turn,
    } = sent.unwrap_or_default();
    let position = position.map(|sent| client_point(field.child("position"), sent, convention));
    let turn = turn.map(|sent| orientation(field.child("orientation"), sent));
    Pose::new(position.unwrap_or(Vec3::ZERO), turn.unwrap_or(Quat::IDENTITY))
}

/// A value of an enum of the contract; its default if the contract does not define the number.
pub(super) fn known<E: TryFrom<i32> + Default>(field: Field<'_>, value: i32) -> E {
    E::try_from(value).unwrap_or_else(|_| {
        field.add(format_args!("is {value}, which the contract does not define"));
        E::default()
    })
}

/// A handedness; `None` if it is unspecified or wrong.
pub(super) fn handedness(field: Field<'_>, value: i32) -> Option<Handedness> {
    match known(field, value) {
        v1::Handedness::Left => Some(Handedness::Left),
        v1::Handedness::Right => Some(Handedness::Right),
        v1::Handedness::Unspecified => None,
    }
}

/// A handedness without a default.
pub(super) fn required_handedness(field: Field<'_>, value: i32) -> Option<Handedness> {
    if value == i32::from(v1::Handedness::Unspecified) {
        return field.reject("is required: HANDEDNESS_LEFT or HANDEDNESS_RIGHT");
    }
    handedness(field, value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_some_violations_and_counts_the_others() {
        let violations = Violations::default();
        for i in 0..1000 {
            violations.field("f").at(i).add("is wrong");
        }
        let ServiceError::Invalid(listed) = violations.into_error() else {
            panic!("violations must not pass");
        };
        assert_eq!((listed.len(), listed[7].field.as_str()), (MAX_LISTED, "f[7]"));
        let unlisted: usize = listed.iter().map(|violation| violation.unlisted).sum();
        assert_eq!(unlisted, 1000 - MAX_LISTED);
    }

    #[test]
    fn normalises_quaternions_of_norm_near_1() {
        let violations = Violations::default();
        let read = orientation(violations.field("q"), (Quat::IDENTITY * 1.009).into());
        assert!((read.length() - 1.0).abs() < 1e-6 && violations.is_empty());
    }

    #[test]
    fn a_kilometre_is_one_in_every_unit() {
        for (x, convention, count) in [
            (999.0, Convention::OpenXr, 0),
            (1001.0, Convention::OpenXr, 1),
            (1001.0, Convention::Unreal, 0),
            (100_001.0, Convention::Unreal, 1),
        ] {
            let violations = Violations::default();
            point(violations.field("p"), (Vec3::X * x).into(), convention);
            assert_eq!(violations.len(), count, "{x} {convention:?}");
        }
    }
}
