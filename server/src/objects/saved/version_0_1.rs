//! Records of version 0.1, which are read, but not written: most of their fields have other numbers.

use grasp_proto::{is_too_large_decoded, v1};
use prost::Message;

use crate::{
    objects::name_of,
    rigs,
    saved::{FieldMove, field, message, move_fields},
};

/// The name of the region that was a list of its own.
const FORBIDDEN: &str = "forbidden";

/// The number of the axis z that points up.
const Z_UP: i32 = 2;

const OBJECT: &[FieldMove] = &[
    message(1, &[], GIVEN),
    field(6, &[2]),
    field(7, &[19]),
    field(8, &[20]),
    message(9, &[], FOUND),
];

const GIVEN: &[FieldMove] = &[
    field(1, &[1]),
    field(3, &[9]),
    field(4, &[4]),
    field(6, &[6]),
    message(7, &[7], FORBIDDEN_LIST),
    field(10, &[3]),
    message(12, &[7], REGION),
    message(13, &[8], GRIP),
    field(14, &[11]),
];

const FOUND: &[FieldMove] = &[
    field(3, &[13]),
    field(6, &[5]),
    field(8, &[14]),
    field(9, &[15, 1]),
    field(10, &[15, 2]),
    field(11, &[16]),
    field(12, &[17]),
];

const FORBIDDEN_LIST: &[FieldMove] = &[field(1, &[4]), field(2, &[5])];

const REGION: &[FieldMove] = &[
    field(1, &[1]),
    field(2, &[2]),
    field(3, &[3]),
    field(4, &[4]),
    field(5, &[5]),
    message(6, &[6], SHAPE),
];

/// A ball, a box, a half-space or a tube. A ball's centre and radius had the numbers of the points and radii of a tube.
const SHAPE: &[FieldMove] = &[
    field(1, &[1]),
    field(2, &[2]),
    field(3, &[3]),
    message(4, &[1], &[field(1, &[1]), field(2, &[2]), field(3, &[2])]),
];

/// The digits, thumb first, were a list before each had a field.
const GRIP: &[FieldMove] = &[
    field(1, &[1]),
    field(2, &[2]),
    field(3, &[3, 1]),
    field(4, &[3, 2]),
    field(5, &[3, 3]),
    field(6, &[3, 5]),
    field(7, &[3, 6]),
    field(7, &[3, 7]),
    field(7, &[3, 8]),
    field(7, &[3, 9]),
    field(7, &[3, 10]),
    field(8, &[4]),
    field(9, &[5]),
    field(10, &[3, 11]),
    field(11, &[3, 6]),
    field(12, &[3, 7]),
    field(13, &[3, 8]),
    field(14, &[3, 9]),
    field(15, &[3, 10]),
];

/// The fields without an equivalent in present records.
#[derive(Clone, PartialEq, Message)]
struct OldRecord {
    #[prost(message, required, tag = "1")]
    given: OldFields,
    #[prost(message, required, tag = "9")]
    found: OldFindings,
}

#[derive(Clone, Copy, PartialEq, Message)]
struct OldFields {
    #[prost(message, optional, tag = "5")]
    centre_of_mass: Option<v1::Vector3>,
    #[prost(int32, tag = "9")]
    up_axis: i32,
}

#[derive(Clone, Copy, PartialEq, Message)]
struct OldFindings {
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

/// The object of an old record, and the centre of mass that its client gave.
pub(super) fn read(record: &[u8]) -> Option<(v1::GraspObject, Option<v1::Vector3>)> {
    let OldRecord { given, found } = OldRecord::decode(record).ok()?;
    let object =
        move_fields(record, OBJECT).filter(|object| !is_too_large_decoded::<v1::GraspObject>(object))?;
    let mut object = v1::GraspObject::decode(&*object).ok()?;
    object.name = name_of(&object.name);
    object.meters_per_unit.get_or_insert(1.0);
    object.z_up = given.up_axis == Z_UP;
    let origin = found.origin_in_file.map(|Origin { x, y, z }| vec![x, y, z]);
    object.origin_in_file = origin.unwrap_or_default();
    for region in &mut object.regions {
        // `PREFERRED` and `FORBIDDEN` had each other's numbers.
        region.preference = if region.preference == 0 {
            0
        } else {
            4 - region.preference
        };
    }
    let forbidden = object.regions.iter().position(|region| region.name.is_empty());
    if let Some(place) = forbidden {
        let mut list = object.regions.remove(place);
        let mut numbers = 2..;
        FORBIDDEN.clone_into(&mut list.name);
        while object.regions.iter().any(|region| region.name == list.name) {
            list.name = format!("{FORBIDDEN} {}", numbers.next().unwrap_or_default());
        }
        list.set_preference(v1::Preference::Forbidden);
        if !list.groups.is_empty() || !list.triangles.is_empty() {
            object.regions.push(list);
        }
    }
    for grip in &mut object.known_grips {
        if grip.preference == 2 {
            grip.set_preference(v1::Preference::Forbidden);
        }
        let hand = grip.hand.get_or_insert_default();
        hand.object_from_wrist.get_or_insert_default();
        if hand.convention == 0 {
            hand.set_convention(v1::Convention::Openxr);
        }
        // Built-in rigs had no prefix.
        if !hand.rig.is_empty() && !hand.rig.starts_with(rigs::COLLECTION) {
            hand.rig = rigs::name_of(&hand.rig);
        }
    }
    Some((object, given.centre_of_mass))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A field of a message, or a text.
    fn bytes(number: u8, content: &[u8]) -> Vec<u8> {
        [&[(number << 3) | 2, content.len() as u8], content].concat()
    }

    #[test]
    fn a_list_of_forbidden_surfaces_becomes_a_region_of_a_free_name() {
        let named = |name: &str| bytes(12, &bytes(1, name.as_bytes()));
        let list = bytes(7, &[bytes(1, b"rim"), bytes(2, &[7])].concat());
        let given = [list, named("forbidden"), named("forbidden 2")].concat();
        let regions = read(&bytes(1, &given)).unwrap().0.regions;
        let region = v1::Region {
            groups: vec!["rim".to_owned()],
            triangles: vec![7],
            ..v1::Region::new("forbidden 3", v1::Preference::Forbidden)
        };
        assert_eq!((regions.len(), &regions[2]), (3, &region));
        let empty = read(&bytes(1, &bytes(7, b""))).unwrap();
        assert!(empty.0.regions.is_empty());
    }
}
