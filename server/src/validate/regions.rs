//! Checks the regions of an object, as far as its file is not needed, and the grips that a client knows of it.

use std::collections::HashSet;

use grasp_assets::hands;
use grasp_proto::v1;
use grasp_synthesis::{
    base::pose::Pose,
    geometry::{tapered_capsule::TaperedCapsule, zone::Zone},
    model::{
        hand::{DigitAngles, HandPose, Handedness, rig::Rig},
        plain_object::BannedGrip,
        regions::Wish,
    },
};

use super::{
    Field, Violations, check_count, check_positive, check_unset, factor,
    hand::{AngleBounds, HAND_SCALES, checked_digits, convention_of, wrist_at_object},
    holdout::{Shape, parts, shape},
    quoted, required, required_handedness,
    rig::rig_id_of,
};
use crate::convention::Convention;

const MAX_NAME: usize = 63;
const MAX_REGIONS: usize = 32;

/// Largest number of shapes in all of them, where each segment of a tube counts: contacts are compared with each.
const MAX_SHAPES: usize = 64;

/// Largest number of triangles listed in all of them. Descriptions of the object repeat them.
const MAX_TRIANGLES: usize = 20_000;

/// Largest number of groups named in all of them, likewise.
const MAX_GROUPS: usize = 256;

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct RegionFields {
    pub given: v1::Region,
    pub kind: RegionKind,
    pub zones: Vec<Zone>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum RegionKind {
    Forbidden,
    /// They take or leave it, by a weight of more than 0 and at most 1.
    Weighted(Wish, f32),
}

/// The regions; empty if they are more, or mark more, than those of a request may.
pub(super) fn bounded_regions(field: Field<'_>, given: Vec<v1::Region>) -> Vec<v1::Region> {
    let triangles = given.iter().map(|region| region.triangles.len()).sum();
    let groups = given.iter().map(|region| region.groups.len()).sum();
    let shapes = given.iter().flat_map(|region| &region.shapes).map(parts).sum();
    let shapes_text = "shapes, segments of tubes counted each, in all";
    let are_few = check_count(field, given.len(), MAX_REGIONS, "regions in all")
        && check_count(field, triangles, MAX_TRIANGLES, "triangles in all")
        && check_count(field, groups, MAX_GROUPS, "groups in all")
        && check_count(field, shapes, MAX_SHAPES, shapes_text);
    if are_few { given } else { Vec::new() }
}

pub(super) fn regions(field: Field<'_>, given: Vec<v1::Region>) -> Vec<RegionFields> {
    let mut names = HashSet::new();
    let checked = field.each(given, |field, given| {
        check_name(field.child("name"), &given.name, "region", &mut names);
        let kind = region_kind(field, &given).unwrap_or(RegionKind::Forbidden);
        let zones = field
            .child("shapes")
            .each(&given.shapes, zone)
            .flatten()
            .collect();
        field.check(
            !(given.groups.is_empty() && given.triangles.is_empty() && given.shapes.is_empty()),
            "marks nothing; it must have groups, triangles or shapes",
        );
        RegionFields { given, kind, zones }
    });
    checked.collect()
}

fn region_kind(field: Field<'_>, given: &v1::Region) -> Option<RegionKind> {
    let wish = match v1::Preference::try_from(given.preference) {
        Ok(v1::Preference::Forbidden) => None,
        Ok(v1::Preference::Avoided) => Some(Wish::Avoid),
        Ok(v1::Preference::Preferred) => Some(Wish::Prefer),
        Ok(v1::Preference::Unspecified) | Err(_) => {
            return field.child("preference").reject(format_args!(
                "is {}; it must be PREFERENCE_PREFERRED, PREFERENCE_AVOIDED or PREFERENCE_FORBIDDEN",
                given.preference
            ));
        }
    };
    match (wish, given.weight) {
        (None, None) => Some(RegionKind::Forbidden),
        (None, Some(weight)) => field.child("weight").reject(format_args!(
            "is {weight}; leave it out, because a forbidden region is never touched"
        )),
        (Some(wish), weight) => {
            let weight = weight.unwrap_or(1.0);
            let is_right = check_positive(field.child("weight"), weight, 1.0);
            is_right.then_some(RegionKind::Weighted(wish, weight))
        }
    }
}

fn zone(field: Field<'_>, sent: &v1::Shape) -> Option<Zone> {
    match shape(field, sent, Convention::OpenXr)? {
        Shape::Tube(parts) => tube_zone(parts),
        Shape::Box(solid) => Some(Zone::Box(solid)),
        Shape::HalfSpace { point, normal } => Some(Zone::HalfSpace { point, normal }),
    }
}

fn tube_zone(parts: Vec<TaperedCapsule>) -> Option<Zone> {
    let first = *parts.first()?;
    let radius = first.start_radius;
    let is_even = |part: &TaperedCapsule| part.start_radius == radius && part.end_radius == radius;
    let starts = std::iter::once(first.start);
    Some(if !parts.iter().all(is_even) {
        Zone::TaperedTube(parts)
    } else if parts.len() == 1 && first.start == first.end {
        let centre = first.start;
        Zone::Ball { centre, radius }
    } else {
        let points = starts.chain(parts.iter().map(|part| part.end)).collect();
        Zone::Tube { points, radius }
    })
}

/// Largest number of grips of an object. Each preferred one takes some tens of microseconds of every search.
const MAX_GRIPS: usize = 32;

/// Largest and default distance of grips near a forbidden one, in metres.
const MAX_NEAR_DISTANCE: f32 = 1.0;
const NEAR_DISTANCE: f32 = 0.03;

/// Largest and default angle of the same, in radians.
const MAX_NEAR_ANGLE: f32 = 3.2;
const NEAR_ANGLE: f32 = 0.5;

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct GripFields {
    pub given: v1::KnownGrip,
    /// Its use; `None` if it is wrong.
    pub kind: Option<GripKind>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum GripKind {
    Preferred(PreferredGrip),
    Banned(BannedGrip),
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PreferredGrip {
    pub handedness: Handedness,
    /// Its size, in hundredths of its rig's.
    pub hundredths: u16,
    pub object_from_wrist: Pose,
    /// Its joint angles, thumb first. Those of a created rig may be beyond its limits.
    pub digits: [DigitAngles; 5],
}

impl PreferredGrip {
    /// The hand in the object's frame, within the limits of its rig.
    pub(crate) fn pose(&self, rig: &Rig) -> HandPose {
        HandPose {
            frame_from_wrist: self.object_from_wrist,
            digits: std::array::from_fn(|place| rig.digits[place].limits.clamped(self.digits[place])),
        }
    }
}

impl GripFields {
    pub(crate) fn rig(&self) -> &str {
        self.given.hand.as_ref().map_or("", |hand| &hand.rig)
    }

    /// The wrist in the object's frame, if its numbers are in this convention.
    pub(crate) fn wrist_in(&self, convention: Convention) -> Pose {
        let sent = self.given.hand.as_ref().and_then(|hand| hand.object_from_wrist);
        // Its violations were added before.
        let unsaid = Violations::default();
        let field = unsaid.field("object_from_wrist");
        wrist_at_object(field, sent.unwrap_or_default(), convention)
    }
}

pub(super) fn known_grips(field: Field<'_>, given: Vec<v1::KnownGrip>) -> Vec<GripFields> {
    if !check_count(field, given.len(), MAX_GRIPS, "grips") {
        return Vec::new();
    }
    let mut names = HashSet::new();
    let checked = field.each(given, |field, given| {
        check_name(field.child("name"), &given.name, "grip", &mut names);
        GripFields {
            kind: grip_kind(field, &given),
            given: kept(given),
        }
    });
    checked.collect()
}

/// The grip to keep: only the relevant fields of its hand, in a convention that is named.
fn kept(given: v1::KnownGrip) -> v1::KnownGrip {
    let hand = given.hand.map(|hand| {
        let convention = match hand.convention() {
            v1::Convention::Unspecified => v1::Convention::Openxr,
            named => named,
        };
        v1::HandPose {
            client_from_wrist: None,
            convention: convention.into(),
            joints: Vec::new(),
            model: Vec::new(),
            ..hand
        }
    });
    v1::KnownGrip { hand, ..given }
}

fn grip_kind(field: Field<'_>, given: &v1::KnownGrip) -> Option<GripKind> {
    let preference = given.preference;
    let [is_preferred, is_forbidden] =
        [v1::Preference::Preferred, v1::Preference::Forbidden].map(|one| preference == i32::from(one));
    let text = format_args!("is {preference}; it must be PREFERENCE_PREFERRED or PREFERENCE_FORBIDDEN");
    field
        .child("preference")
        .check(is_preferred || is_forbidden, text);
    let hand_field = field.child("hand");
    let hand = required(hand_field, given.hand.as_ref())?;
    let handedness = required_handedness(hand_field.child("handedness"), hand.handedness);
    let convention = convention_of(hand_field, hand, Convention::OpenXr);
    let wrist_field = hand_field.child("object_from_wrist");
    let object_from_wrist = required(wrist_field, hand.object_from_wrist)
        .map(|wrist| wrist_at_object(wrist_field, wrist, convention));
    if is_forbidden {
        let distance = given.near_distance.unwrap_or(NEAR_DISTANCE);
        check_positive(field.child("near_distance"), distance, MAX_NEAR_DISTANCE);
        let angle = given.near_angle.unwrap_or(NEAR_ANGLE);
        check_positive(field.child("near_angle"), angle, MAX_NEAR_ANGLE);
        return Some(GripKind::Banned(BannedGrip {
            handedness: handedness?,
            object_from_wrist: object_from_wrist?,
            distance,
            angle,
        }));
    }
    // A created rig may be gone by the time that the object is used.
    let rig = rig_id_of(hand_field.child("rig"), &hand.rig);
    let known = rig.and_then(|id| hands::hand(&id, Handedness::Right));
    let scale = factor(hand_field.child("scale"), hand.scale, HAND_SCALES);
    let rig = known.map(|hand| &*hand.rig);
    let digits = checked_digits(hand_field, hand, rig, AngleBounds::Rig);
    if !is_preferred {
        return None;
    }
    let near = [
        ("near_distance", given.near_distance.is_some()),
        ("near_angle", given.near_angle.is_some()),
    ];
    check_unset(field, near, "only forbidden grips have neighbours: leave it out");
    Some(GripKind::Preferred(PreferredGrip {
        handedness: handedness?,
        hundredths: (100.0 * scale).round() as u16,
        object_from_wrist: object_from_wrist?,
        digits,
    }))
}

/// Checks the name of `what`, in the singular, which must differ from `earlier` ones of its list.
pub(super) fn check_name(field: Field<'_>, name: &str, what: &str, earlier: &mut HashSet<String>) {
    if !(1..=MAX_NAME).contains(&name.chars().count()) || name.chars().any(char::is_control) {
        field.add(format_args!(
            "is {}; it must be 1 to {MAX_NAME} characters, without control characters",
            quoted(name)
        ));
    }
    if !earlier.insert(name.to_owned()) {
        field.add(format_args!(
            "is {} again; every {what} needs a name of its own",
            quoted(name)
        ));
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use grasp_proto::v1::shape::Kind;

    use super::*;
    use crate::validate::fixtures::{Change, assert_blamed, read_at, table, violations_of};

    fn tube(points: usize) -> v1::Shape {
        v1::Shape::tube((0..points).map(|x| Vec3::X * x as f32), 0.01)
    }

    fn tapered(points: usize, radii: &[f32]) -> v1::Shape {
        v1::Shape {
            kind: Some(Kind::Tube(v1::TubeShape {
                points: vec![v1::Vector3::default(); points],
                radii: radii.to_vec(),
            })),
        }
    }

    fn preferred(name: &str, shapes: Vec<v1::Shape>) -> v1::Region {
        v1::Region {
            shapes,
            ..v1::Region::new(name, v1::Preference::Preferred)
        }
    }

    fn violations(given: Vec<v1::Region>) -> Vec<(String, String)> {
        let violations = Violations::default();
        let field = violations.field("regions");
        regions(field, bounded_regions(field, given));
        violations_of(violations.finish(()))
    }

    #[test]
    fn every_kind_of_shape_becomes_a_zone() {
        let given = preferred(
            "all",
            vec![
                v1::Shape::ball(Vec3::X, 0.5),
                v1::Shape::solid_box(v1::Pose::default(), Vec3::ONE),
                v1::Shape::half_space(Vec3::ZERO, 2.0 * Vec3::Z),
                tube(3),
                tapered(3, &[0.1; 3]),
                tapered(3, &[0.1, 0.2, 0.1]),
            ],
        );
        let (checked, blamed) = read_at("regions", |field| regions(field, vec![given.clone()]));
        assert!(blamed.is_empty());
        let [region] = checked.as_slice() else {
            panic!("{checked:?}");
        };
        assert_eq!(
            (&region.given, region.kind),
            (&given, RegionKind::Weighted(Wish::Prefer, 1.0))
        );
        let [
            Zone::Ball { centre: Vec3::X, .. },
            Zone::Box(_),
            Zone::HalfSpace { normal: Vec3::Z, .. },
            Zone::Tube { points, .. },
            Zone::Tube { .. },
            Zone::TaperedTube(parts),
        ] = region.zones.as_slice()
        else {
            panic!("{region:?}");
        };
        assert_eq!(points, &[Vec3::ZERO, Vec3::X, 2.0 * Vec3::X]);
        assert_eq!((parts.len(), parts[0].end_radius), (2, 0.2));
    }

    const CHANGES: &[Change<v1::Region>] = table! {
        "regions[1].name", "it must be 1 to 63" => |r| r.name.clear();
        "regions[1].name", "is \"rim\" again" => |r| r.name = "rim".into();
        "regions[1].preference", "is 9" => |r| r.preference = 9;
        "regions[1].weight", "leave it out" => |r| r.weight = Some(0.5);
        "regions[1]", "marks nothing" => |r| r.triangles.clear();
        "regions[1].weight", "and at most 1" => |r| {
            r.set_preference(v1::Preference::Preferred);
            r.weight = Some(1.5);
        };
        "regions[1].shapes[0]", "is empty" => |r| r.shapes = vec![v1::Shape::default()];
        "regions[1].shapes[0].tube.points", "has 0 points" => |r| r.shapes = vec![tapered(0, &[0.1])];
        "regions", "has 20001 triangles" => |r| r.triangles = vec![0; MAX_TRIANGLES + 1];
        "regions", "has 257 groups" => |r| r.groups = vec!["g".into(); MAX_GROUPS + 1];
        "regions", "has 66 shapes" => |r| r.shapes = vec![tube(MAX_SHAPES), tube(3)];
    };

    #[test]
    fn every_field_of_a_region_is_checked() {
        let rim = || preferred("rim", vec![tapered(1, &[0.1])]);
        let mut marked = v1::Region {
            triangles: vec![1],
            ..v1::Region::new("b", v1::Preference::Forbidden)
        };
        assert_blamed(&marked, &[], CHANGES, |region| violations(vec![rim(), region]));
        marked.shapes = vec![tube(MAX_SHAPES)];
        assert_eq!(violations(vec![rim(), marked]), []);
        let many = |count: usize| (0..count).map(|n| preferred(&n.to_string(), vec![tube(2)]));
        assert_eq!(violations(many(MAX_REGIONS).collect()), []);
        assert_eq!(violations(many(MAX_REGIONS + 1).collect())[0].0, "regions");
    }
}
