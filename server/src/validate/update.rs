//! Checks requests to change an object.

use glam::Vec3;
use grasp_proto::v1;

use super::{
    GripFields, Labels, RegionFields, Violations, check_positive, factor, friction,
    object::{MAX_MASS, UNIT_RANGE, centre_of_mass, labels, object_id_of},
    quoted,
    regions::{bounded_regions, known_grips, regions},
    required,
};
use crate::error::ServiceError;

const PATHS: [&str; 7] = [
    "labels",
    "mass_kg",
    "center_of_mass",
    "friction",
    "regions",
    "known_grips",
    "meters_per_unit",
];

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct UpdateQuery {
    pub id: String,
    /// The etag of the state to change; `None` for any.
    pub etag: Option<String>,
    pub change: ObjectChange,
    pub labels: Option<Labels>,
    /// Fields that never change, as they were sent without a mask.
    z_up: bool,
    parts: Vec<String>,
}

impl UpdateQuery {
    /// Compares the fields that never change with the object.
    pub(crate) fn check_immutable(&self, object: &v1::GraspObject) -> Result<(), ServiceError> {
        let violations = Violations::default();
        let field = violations.field("object");
        let text = "is true; that of an object never changes from false";
        field.child("z_up").check(!self.z_up || object.z_up, text);
        let text = "is not that of the object, which never changes; leave it out";
        field
            .child("parts")
            .check(self.parts.is_empty() || self.parts == object.parts, text);
        violations.finish(())
    }
}

#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct ObjectChange {
    /// Metres per unit of the mesh; `None` to keep it.
    pub unit_metres: Option<f32>,
    /// Mass in kilograms; `None` to keep it.
    pub mass: Option<f32>,
    /// Centre of mass in metres, in the object's frame; by default that of the mesh.
    pub centre_of_mass: Setting<Vec3>,
    pub friction: Setting<f32>,
    /// Parts of the surface that hands should take, leave, or not touch; `None` to keep them.
    pub regions: Option<Vec<RegionFields>>,
    /// Grips to try first, or not to answer; `None` to keep them.
    pub known_grips: Option<Vec<GripFields>>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) enum Setting<T> {
    #[default]
    Kept,
    Default,
    To(T),
}

impl<T> From<Option<T>> for Setting<T> {
    fn from(given: Option<T>) -> Self {
        given.map_or(Self::Default, Self::To)
    }
}

impl<T: Copy> Setting<T> {
    /// Changes a property that is absent if it has the default.
    pub(crate) fn apply(self, property: &mut Option<T>) {
        match self {
            Self::Kept => {}
            Self::Default => *property = None,
            Self::To(value) => *property = Some(value),
        }
    }
}

impl ObjectChange {
    pub(crate) fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

/// An etag to compare; `None` if it is empty.
pub(crate) fn given_etag(etag: String) -> Option<String> {
    Some(etag).filter(|etag| !etag.is_empty())
}

/// Checks a request to change an object. Regions are compared with the object's file later.
pub(crate) fn update_query(request: v1::UpdateObjectRequest) -> Result<UpdateQuery, ServiceError> {
    let violations = Violations::default();
    let object_field = violations.field("object");
    let Some(object) = required(object_field, request.object) else {
        return Err(violations.into_error());
    };
    let id = object_id_of(object_field.child("name"), &object.name);
    let mask = request.update_mask.unwrap_or_default().paths;
    let field = violations.field("update_mask");
    for (place, path) in mask.iter().enumerate() {
        if !PATHS.contains(&path.as_str()) {
            field.child("paths").at(place).add(format_args!(
                "is {}; it must be {}",
                quoted(path),
                PATHS.join(", ")
            ));
        }
    }
    let is_changed = |path: &str, is_present: bool| {
        (mask.is_empty() && is_present) || mask.iter().any(|listed| listed == path)
    };
    let mut change = ObjectChange::default();
    if is_changed("meters_per_unit", object.meters_per_unit.is_some()) {
        let field = object_field.child("meters_per_unit");
        change.unit_metres = Some(factor(field, object.meters_per_unit, UNIT_RANGE));
    }
    // Like a new object, a changed one must have a mass. NaN is present.
    if is_changed("mass_kg", object.mass_kg != 0.0) {
        check_positive(object_field.child("mass_kg"), object.mass_kg, MAX_MASS);
        change.mass = Some(object.mass_kg);
    }
    if is_changed("center_of_mass", object.center_of_mass.is_some()) {
        change.centre_of_mass = centre_of_mass(object_field, object.center_of_mass).into();
    }
    if is_changed("friction", object.friction.is_some()) {
        change.friction = friction(object_field.child("friction"), object.friction).into();
    }
    if is_changed("regions", !object.regions.is_empty()) {
        let field = object_field.child("regions");
        change.regions = Some(regions(field, bounded_regions(field, object.regions)));
    }
    if is_changed("known_grips", !object.known_grips.is_empty()) {
        let field = object_field.child("known_grips");
        change.known_grips = Some(known_grips(field, object.known_grips));
    }
    let new_labels = is_changed("labels", !object.labels.is_empty()).then_some(object.labels);
    if let Some(new_labels) = &new_labels {
        labels(object_field.child("labels"), new_labels);
    }
    violations.finish(UpdateQuery {
        id: id.unwrap_or_default(),
        etag: given_etag(object.etag),
        change,
        labels: new_labels,
        z_up: mask.is_empty() && object.z_up,
        parts: if mask.is_empty() { object.parts } else { Vec::new() },
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::validate::fixtures::blamed;

    fn request(paths: &[&'static str]) -> v1::UpdateObjectRequest {
        let object = v1::GraspObject {
            name: "objects/mug".to_owned(),
            mass_kg: 0.2,
            labels: [("a".to_owned(), "b".to_owned())].into(),
            ..Default::default()
        };
        v1::UpdateObjectRequest::new(object, paths.iter().copied())
    }

    #[test]
    fn without_a_mask_present_fields_change() {
        let query = update_query(request(&[])).unwrap();
        let expected = ObjectChange {
            mass: Some(0.2),
            ..ObjectChange::default()
        };
        assert_eq!((query.change, query.labels.map(|l| l.len())), (expected, Some(1)));
        let mut nothing = request(&[]);
        let object = nothing.object.as_mut().unwrap();
        (object.mass_kg, object.labels) = (0.0, Labels::new());
        let query = update_query(nothing).unwrap();
        assert!(query.change.is_empty() && query.labels.is_none() && query.etag.is_none());
    }

    #[test]
    fn a_mask_selects_and_resets() {
        let paths = ["meters_per_unit", "friction", "center_of_mass", "regions"];
        let query = update_query(request(&paths)).unwrap();
        let expected = ObjectChange {
            unit_metres: Some(1.0),
            centre_of_mass: Setting::Default,
            friction: Setting::Default,
            regions: Some(Vec::new()),
            ..ObjectChange::default()
        };
        assert_eq!((query.change, query.labels), (expected, None));
        let mut cleared = request(&["labels"]);
        cleared.object.as_mut().unwrap().labels.clear();
        assert_eq!(update_query(cleared).unwrap().labels, Some(Labels::new()));
    }

    #[test]
    fn reports_every_violation_by_field() {
        let mut wrong = request(&["mass_kg", "z_up", "friction", "labels.a", "meters_per_unit"]);
        let object = wrong.object.as_mut().unwrap();
        object.name = "mug".to_owned();
        object.mass_kg = 0.0;
        (object.friction, object.meters_per_unit) = (Some(9.0), Some(0.0));
        let fields = [
            "object.name",
            "update_mask.paths[1]",
            "update_mask.paths[3]",
            "object.meters_per_unit",
            "object.mass_kg",
            "object.friction",
        ];
        assert_eq!(blamed(update_query(wrong)), fields);
        assert_eq!(
            blamed(update_query(v1::UpdateObjectRequest::default())),
            ["object"]
        );
    }
}
