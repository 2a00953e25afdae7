//! Records as version 0.1 wrote them, which are read, but not written.

use std::collections::BTreeMap;

use grasp_proto::v1::{self, shape::Kind};
use prost::{Message, Oneof};

use crate::{objects::name_of, rigs};

/// The name of the region that was a list of its own.
const FORBIDDEN: &str = "forbidden";

/// The number of the axis z that points up.
const Z_UP: i32 = 2;

/// What hands do with a region, and with a grip, in the order of the numbers in records.
const REGION_USES: [v1::Preference; 4] = [
    v1::Preference::Unspecified,
    v1::Preference::Forbidden,
    v1::Preference::Avoided,
    v1::Preference::Preferred,
];
const GRIP_USES: [v1::Preference; 3] = [
    v1::Preference::Unspecified,
    v1::Preference::Preferred,
    v1::Preference::Forbidden,
];

fn preference_of(number: i32, uses: &[v1::Preference]) -> v1::Preference {
    let used = usize::try_from(number).ok().and_then(|number| uses.get(number));
    used.copied().unwrap_or_default()
}

/// The fields of a record that are others now.
#[derive(Clone, PartialEq, Message)]
pub(super) struct Record01 {
    #[prost(message, required, tag = "1")]
    fields: Fields,
    #[prost(string, tag = "6")]
    etag: String,
    #[prost(message, required, tag = "7")]
    created: prost_types::Timestamp,
    #[prost(message, required, tag = "8")]
    updated: prost_types::Timestamp,
    #[prost(message, required, tag = "9")]
    findings: Findings,
}

/// What was computed from the mesh.
#[derive(Clone, PartialEq, Message)]
struct Findings {
    #[prost(uint32, tag = "3")]
    triangle_count: u32,
    #[prost(message, optional, tag = "6")]
    centre_of_mass: Option<v1::Vector3>,
    #[prost(uint32, tag = "8")]
    forbidden_triangle_count: u32,
    #[prost(message, optional, tag = "9")]
    object_from_box: Option<v1::Pose>,
    #[prost(message, optional, tag = "10")]
    box_half_extents: Option<v1::Vector3>,
    #[prost(string, tag = "11")]
    content_hash: String,
    #[prost(string, repeated, tag = "12")]
    warnings: Vec<String>,
    #[prost(message, optional, tag = "14")]
    origin_in_file: Option<Origin>,
}

#[derive(Clone, Copy, PartialEq, Message)]
struct Origin {
    #[prost(double, tag = "1")]
    x: f64,
    #[prost(double, tag = "2")]
    y: f64,
    #[prost(double, tag = "3")]
    z: f64,
}

/// What a client gives an object.
#[derive(Clone, PartialEq, Message)]
struct Fields {
    #[prost(string, tag = "1")]
    id: String,
    #[prost(float, optional, tag = "3")]
    metres_per_unit: Option<f32>,
    #[prost(float, tag = "4")]
    mass: f32,
    #[prost(message, optional, tag = "5")]
    centre_of_mass: Option<v1::Vector3>,
    #[prost(float, optional, tag = "6")]
    friction: Option<f32>,
    #[prost(message, optional, tag = "7")]
    forbidden: Option<Forbidden>,
    #[prost(int32, tag = "9")]
    up_axis: i32,
    #[prost(btree_map = "string, string", tag = "10")]
    labels: BTreeMap<String, String>,
    #[prost(message, repeated, tag = "12")]
    regions: Vec<Region>,
    #[prost(message, repeated, tag = "13")]
    known_grips: Vec<Grip>,
    #[prost(string, repeated, tag = "14")]
    parts: Vec<String>,
}

#[derive(Clone, PartialEq, Message)]
struct Forbidden {
    #[prost(string, repeated, tag = "1")]
    groups: Vec<String>,
    #[prost(uint32, repeated, tag = "2")]
    triangles: Vec<u32>,
}

#[derive(Clone, PartialEq, Message)]
struct Region {
    #[prost(string, tag = "1")]
    name: String,
    #[prost(int32, tag = "2")]
    used: i32,
    #[prost(float, optional, tag = "3")]
    weight: Option<f32>,
    #[prost(string, repeated, tag = "4")]
    groups: Vec<String>,
    #[prost(uint32, repeated, tag = "5")]
    triangles: Vec<u32>,
    #[prost(message, repeated, tag = "6")]
    shapes: Vec<Shape>,
}

#[derive(Clone, PartialEq, Message)]
struct Shape {
    #[prost(oneof = "ShapeKind", tags = "1, 2, 3, 4")]
    kind: Option<ShapeKind>,
}

#[derive(Clone, PartialEq, Oneof)]
enum ShapeKind {
    /// A ball, whose centre and radius are numbered as the point and the radius of a tube.
    #[prost(message, tag = "1")]
    Ball(v1::TubeShape),
    #[prost(message, tag = "2")]
    Box(v1::BoxShape),
    #[prost(message, tag = "3")]
    HalfSpace(v1::HalfSpaceShape),
    #[prost(message, tag = "4")]
    Tube(Tube),
}

#[derive(Clone, PartialEq, Message)]
struct Tube {
    #[prost(message, repeated, tag = "1")]
    points: Vec<v1::Vector3>,
    #[prost(float, tag = "2")]
    radius: f32,
    #[prost(float, repeated, tag = "3")]
    radii: Vec<f32>,
}

#[derive(Clone, PartialEq, Message)]
struct Grip {
    #[prost(string, tag = "1")]
    name: String,
    #[prost(int32, tag = "2")]
    used: i32,
    #[prost(string, tag = "3")]
    rig: String,
    #[prost(enumeration = "v1::Handedness", tag = "4")]
    side: i32,
    #[prost(float, optional, tag = "5")]
    scale: Option<f32>,
    /// Absent: the identity.
    #[prost(message, optional, tag = "6")]
    object_from_wrist: Option<v1::Pose>,
    /// All digits, thumb first, or none.
    #[prost(message, repeated, tag = "7")]
    digits: Vec<v1::DigitAngles>,
    #[prost(float, optional, tag = "8")]
    near_distance: Option<f32>,
    #[prost(float, optional, tag = "9")]
    near_angle: Option<f32>,
    #[prost(enumeration = "v1::Convention", tag = "10")]
    convention: i32,
    #[prost(message, optional, tag = "11")]
    thumb: Option<v1::DigitAngles>,
    #[prost(message, optional, tag = "12")]
    index: Option<v1::DigitAngles>,
    #[prost(message, optional, tag = "13")]
    middle: Option<v1::DigitAngles>,
    #[prost(message, optional, tag = "14")]
    ring: Option<v1::DigitAngles>,
    #[prost(message, optional, tag = "15")]
    little: Option<v1::DigitAngles>,
}

impl Record01 {
    /// The centre of mass that the client gave.
    pub(super) fn given_centre_of_mass(&self) -> Option<v1::Vector3> {
        self.fields.centre_of_mass
    }
}

impl From<Record01> for v1::GraspObject {
    fn from(record: Record01) -> Self {
        let (given, found) = (record.fields, record.findings);
        let mut regions: Vec<v1::Region> = given.regions.into_iter().map(Into::into).collect();
        if let Some(forbidden) = given.forbidden.filter(|list| *list != Forbidden::default()) {
            let mut name = FORBIDDEN.to_owned();
            for number in 2.. {
                if regions.iter().all(|region| region.name != name) {
                    break;
                }
                name = format!("{FORBIDDEN} {number}");
            }
            regions.push(v1::Region {
                groups: forbidden.groups,
                triangles: forbidden.triangles,
                ..v1::Region::new(name, v1::Preference::Forbidden)
            });
        }
        let origin = found.origin_in_file.map(|Origin { x, y, z }| vec![x, y, z]);
        Self {
            name: name_of(&given.id),
            etag: record.etag,
            create_time: Some(record.created),
            update_time: Some(record.updated),
            labels: given.labels,
            mass_kg: given.mass,
            friction: given.friction,
            regions,
            known_grips: given.known_grips.into_iter().map(Into::into).collect(),
            meters_per_unit: given.metres_per_unit.or(Some(1.0)),
            z_up: given.up_axis == Z_UP,
            parts: given.parts,
            center_of_mass: found.centre_of_mass,
            triangle_count: found.triangle_count,
            forbidden_triangle_count: found.forbidden_triangle_count,
            bounding_box: Some(v1::BoxShape {
                pose: found.object_from_box,
                half_extents: found.box_half_extents,
            }),
            content_hash: found.content_hash,
            warnings: found.warnings,
            origin_in_file: origin.unwrap_or_default(),
            ..Self::default()
        }
    }
}

impl From<Region> for v1::Region {
    fn from(region: Region) -> Self {
        let preference = preference_of(region.used, &REGION_USES);
        Self {
            name: region.name,
            preference: preference.into(),
            weight: region.weight,
            groups: region.groups,
            triangles: region.triangles,
            shapes: region.shapes.into_iter().map(Into::into).collect(),
        }
    }
}

impl From<Shape> for v1::Shape {
    fn from(shape: Shape) -> Self {
        let kind = shape.kind.map(|kind| match kind {
            ShapeKind::Ball(ball) => Kind::Tube(ball),
            ShapeKind::Box(solid) => Kind::Box(solid),
            ShapeKind::HalfSpace(half) => Kind::HalfSpace(half),
            ShapeKind::Tube(tube) => Kind::Tube(v1::TubeShape {
                points: tube.points,
                radii: if tube.radii.is_empty() {
                    vec![tube.radius]
                } else {
                    tube.radii
                },
            }),
        });
        Self { kind }
    }
}

impl From<Grip> for v1::KnownGrip {
    fn from(grip: Grip) -> Self {
        let preference = preference_of(grip.used, &GRIP_USES);
        let convention = match grip.convention() {
            v1::Convention::Unspecified => v1::Convention::Openxr,
            given => given,
        };
        let listed = |place: usize| grip.digits.get(place).copied();
        let digits = [grip.thumb, grip.index, grip.middle, grip.ring, grip.little];
        let digits = std::array::from_fn(|place| digits[place].or(listed(place)));
        // Built-in rigs had no prefix.
        let rig = match grip.rig.as_str() {
            "" => String::new(),
            rig if rig.starts_with(rigs::COLLECTION) => rig.to_owned(),
            rig => rigs::name_of(rig),
        };
        let hand = v1::HandPose {
            scale: grip.scale,
            object_from_wrist: Some(grip.object_from_wrist.unwrap_or_default()),
            convention: convention.into(),
            ..v1::HandPose::new(rig, grip.side())
        };
        Self {
            near_distance: grip.near_distance,
            near_angle: grip.near_angle,
            ..Self::new(grip.name, preference, hand.with_digits(digits))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(fields: Fields) -> v1::GraspObject {
        let record = Record01 {
            fields,
            ..Default::default()
        };
        record.into()
    }

    #[test]
    fn a_list_of_forbidden_surfaces_becomes_a_region_of_a_free_name() {
        let named = |name: &str| Region {
            name: name.to_owned(),
            ..Default::default()
        };
        let fields = Fields {
            forbidden: Some(Forbidden {
                groups: vec!["rim".to_owned()],
                triangles: vec![7],
            }),
            regions: vec![named("forbidden"), named("forbidden 2")],
            ..Default::default()
        };
        let regions = read(fields).regions;
        let region = v1::Region {
            groups: vec!["rim".to_owned()],
            triangles: vec![7],
            ..v1::Region::new("forbidden 3", v1::Preference::Forbidden)
        };
        assert_eq!((regions.len(), &regions[2]), (3, &region));
        let none = Fields {
            forbidden: Some(Forbidden::default()),
            ..Default::default()
        };
        assert!(read(none).regions.is_empty());
    }
}
