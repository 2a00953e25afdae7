//! What is saved of what a client gives an object, but for its mesh.
//!
//! Its messages are its own where those of the contract are not the same since version 0.1, some of whose fields are read, but not
//! written. Points, poses, angles and shapes are the contract's, whose numbers never change.

use std::collections::{BTreeMap, HashSet};

use grasp_proto::v1::{self, shape::Kind};
use prost::{Message, Oneof};

use crate::{
    objects::{id_of, name_of},
    rigs,
};

/// The name of the region that was a list of its own.
const FORBIDDEN: &str = "forbidden";

/// The numbers of axes that point up.
const Y_UP: i32 = 1;
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

fn number_of(preference: v1::Preference, uses: &[v1::Preference]) -> i32 {
    let numbered = (0..).zip(uses).find(|(_, used)| **used == preference);
    numbered.map_or(0, |(number, _)| number)
}

fn preference_of(number: i32, uses: &[v1::Preference]) -> v1::Preference {
    let used = usize::try_from(number).ok().and_then(|number| uses.get(number));
    used.copied().unwrap_or_default()
}

/// What a client gives an object.
#[derive(Clone, PartialEq, Message)]
pub(super) struct Fields {
    #[prost(string, tag = "1")]
    pub id: String,
    #[prost(float, optional, tag = "3")]
    metres_per_unit: Option<f32>,
    #[prost(float, tag = "4")]
    mass: f32,
    #[prost(message, optional, tag = "5")]
    centre_of_mass: Option<v1::Vector3>,
    #[prost(float, optional, tag = "6")]
    friction: Option<f32>,
    /// Read, not written.
    #[prost(message, optional, tag = "7")]
    forbidden: Option<Forbidden>,
    #[prost(int32, tag = "9")]
    up_axis: i32,
    #[prost(btree_map = "string, string", tag = "10")]
    pub labels: BTreeMap<String, String>,
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
    /// Read, not written: a tube of one point.
    #[prost(message, tag = "1")]
    Sphere(Sphere),
    #[prost(message, tag = "2")]
    Box(v1::BoxShape),
    #[prost(message, tag = "3")]
    HalfSpace(v1::HalfSpaceShape),
    #[prost(message, tag = "4")]
    Tube(Tube),
}

#[derive(Clone, Copy, PartialEq, Message)]
struct Sphere {
    #[prost(message, optional, tag = "1")]
    centre: Option<v1::Vector3>,
    #[prost(float, tag = "2")]
    radius: f32,
}

#[derive(Clone, PartialEq, Message)]
struct Tube {
    #[prost(message, repeated, tag = "1")]
    points: Vec<v1::Vector3>,
    /// Read, not written: that of all points.
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
    /// Read, not written: all digits, thumb first, or none.
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

impl Fields {
    /// Drops what may be long.
    pub(super) fn drop_lists(&mut self) {
        self.forbidden = None;
        self.regions = Vec::new();
        self.known_grips = Vec::new();
    }
}

impl From<v1::GraspObject> for Fields {
    fn from(object: v1::GraspObject) -> Self {
        Self {
            id: id_of(&object.name).to_owned(),
            metres_per_unit: object.meters_per_unit,
            mass: object.mass_kg,
            centre_of_mass: object.center_of_mass,
            friction: object.friction,
            forbidden: None,
            up_axis: if object.z_up { Z_UP } else { Y_UP },
            labels: object.labels,
            regions: object.regions.into_iter().map(Into::into).collect(),
            known_grips: object.known_grips.into_iter().map(Into::into).collect(),
            parts: object.parts,
        }
    }
}

impl From<Fields> for v1::GraspObject {
    fn from(fields: Fields) -> Self {
        let mut regions: Vec<v1::Region> = fields.regions.into_iter().map(Into::into).collect();
        let forbidden = fields.forbidden.unwrap_or_default();
        if forbidden != Forbidden::default() {
            let taken: HashSet<&str> = regions.iter().map(|region| region.name.as_str()).collect();
            let names = std::iter::once(FORBIDDEN.to_owned())
                .chain((2_u32..).map(|number| format!("{FORBIDDEN} {number}")));
            let name = names.into_iter().find(|name| !taken.contains(name.as_str()));
            let region = v1::Region {
                groups: forbidden.groups,
                triangles: forbidden.triangles,
                ..v1::Region::new(name.unwrap_or_default(), v1::Preference::Forbidden)
            };
            regions.push(region);
        }
        Self {
            name: name_of(&fields.id),
            labels: fields.labels,
            mass_kg: fields.mass,
            center_of_mass: fields.centre_of_mass,
            friction: fields.friction,
            regions,
            known_grips: fields.known_grips.into_iter().map(Into::into).collect(),
            meters_per_unit: fields.metres_per_unit,
            z_up: fields.up_axis == Z_UP,
            parts: fields.parts,
            ..Self::default()
        }
    }
}

impl From<v1::Region> for Region {
    fn from(region: v1::Region) -> Self {
        let used = number_of(region.preference(), &REGION_USES);
        Self {
            name: region.name,
            used,
            weight: region.weight,
            groups: region.groups,
            triangles: region.triangles,
            shapes: region.shapes.into_iter().map(Into::into).collect(),
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

impl From<v1::Shape> for Shape {
    fn from(shape: v1::Shape) -> Self {
        let kind = shape.kind.map(|kind| match kind {
            Kind::Tube(tube) => ShapeKind::Tube(Tube {
                points: tube.points,
                radius: 0.0,
                radii: tube.radii,
            }),
            Kind::Box(solid) => ShapeKind::Box(solid),
            Kind::HalfSpace(half) => ShapeKind::HalfSpace(half),
        });
        Self { kind }
    }
}

impl From<Shape> for v1::Shape {
    fn from(shape: Shape) -> Self {
        let kind = shape.kind.map(|kind| match kind {
            ShapeKind::Sphere(sphere) => Kind::Tube(v1::TubeShape {
                points: vec![sphere.centre.unwrap_or_default()],
                radii: vec![sphere.radius],
            }),
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

/// `Openxr` if none is given.
fn convention_of(given: v1::Convention) -> v1::Convention {
    match given {
        v1::Convention::Unspecified => v1::Convention::Openxr,
        given => given,
    }
}

impl From<v1::KnownGrip> for Grip {
    fn from(grip: v1::KnownGrip) -> Self {
        let used = number_of(grip.preference(), &GRIP_USES);
        let hand = grip.hand.unwrap_or_default();
        let convention = convention_of(hand.convention());
        let [thumb, index, middle, ring, little] = hand.digits().map(Option::<&v1::DigitAngles>::copied);
        Self {
            name: grip.name,
            used,
            side: hand.handedness,
            rig: hand.rig,
            scale: hand.scale,
            object_from_wrist: hand.object_from_wrist,
            digits: Vec::new(),
            near_distance: grip.near_distance,
            near_angle: grip.near_angle,
            convention: convention.into(),
            thumb,
            index,
            middle,
            ring,
            little,
        }
    }
}

impl From<Grip> for v1::KnownGrip {
    fn from(grip: Grip) -> Self {
        let preference = preference_of(grip.used, &GRIP_USES);
        let convention = convention_of(grip.convention());
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
mod tests;
