//! Checks names of rigs, and new rigs but for the model.

use std::{collections::BTreeMap, ops::RangeInclusive};

use grasp_import::MappedJoint;
use grasp_proto::v1;
use grasp_synthesis::model::hand::{
    Handedness,
    joints::{HandJoints, JOINT_COUNT, JOINT_NAMES},
    rig::{AngleRange, DigitLimits},
};

use super::{
    Field, Violations,
    hand::joints_at_rest,
    known,
    object::{LONGEST_ID, id_in, is_object_id},
    page::page_size,
    quoted,
};
use crate::{error::ServiceError, rigs::COLLECTION};

/// Most rigs on a page: a rig takes some ten kilobytes.
const LARGEST_PAGE_SIZE: usize = 100;

/// Prefix of tokens of this version, so that tokens of other versions are rejected.
const TOKEN_PREFIX: &str = "r1-";

/// Largest number of entries of a joint map: one for each joint of two hands.
const LARGEST_MAP: usize = 50;

/// Smallest and largest factor of widths: what differs more is another hand.
const WIDTH_SCALES: RangeInclusive<f32> = 0.5..=2.0;

/// Largest radius of a joint, in metres.
const LARGEST_RADIUS: f32 = 0.1;

/// Largest size of the texts of a joint map's entry, in bytes.
const LONGEST_NAME: usize = 1024;

/// The id of a name like `rigs/my-hand`.
pub(crate) fn rig_id_of(field: Field<'_>, name: &str, violations: &mut Violations) -> Option<String> {
    id_in(COLLECTION, "the rig's id", field, name, violations)
}

/// What a rig is made from.
#[derive(Debug)]
pub(crate) enum RigOrigin {
    /// The content of a file and, if each hand has a file, of the other hand's.
    Model(Vec<u8>, Option<Vec<u8>>),
    /// Joints at rest of one or both hands.
    Joints(Vec<HandJoints>),
}

/// The checked fields of a new rig.
#[derive(Debug)]
pub(crate) struct RigFields {
    /// The last part of its name.
    pub id: String,
    /// What it is made from; none if the request has none, or a wrong one.
    pub source: Option<RigOrigin>,
    /// Joints of the model by node.
    pub joint_map: Vec<MappedJoint>,
    /// The limits of the digits, if given.
    pub limits: Option<[DigitLimits; 5]>,
    /// The hand that a model shows if its names do not say.
    pub side: Option<Handedness>,
    /// What measured widths are multiplied by.
    pub width_scale: f32,
    /// Radii that go before measured ones, by `OpenXR` index, in metres.
    pub radii: [Option<f32>; JOINT_COUNT],
    /// What was repaired.
    pub warnings: Vec<String>,
}

/// A page of rigs to list.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct RigPageQuery {
    /// Number of rigs.
    pub size: usize,
    /// The last id of the previous page; none for the first page.
    pub after: Option<String>,
}

/// Checks a request for a page of rigs.
///
/// # Errors
/// [`ServiceError::Invalid`] with every violation.
pub(crate) fn rig_page_query(request: &v1::ListRigsRequest) -> Result<RigPageQuery, ServiceError> {
    let mut violations = Violations::default();
    let size = page_size(request.page_size, LARGEST_PAGE_SIZE, &mut violations);
    let after = request.page_token.strip_prefix(TOKEN_PREFIX);
    let after = after.filter(|id| is_object_id(id)).map(str::to_owned);
    if after.is_none() && !request.page_token.is_empty() {
        violations.add(
            Field::root("page_token"),
            format_args!(
                "is {}; it must be the next_page_token of an earlier response",
                quoted(&request.page_token)
            ),
        );
    }
    violations.finish(RigPageQuery { size, after })
}

/// The token of the page after the rig with this id.
pub(crate) fn rig_page_token(last_id: &str) -> String {
    format!("{TOKEN_PREFIX}{last_id}")
}

/// Checks the fields of a new rig. Reading the model adds its own violations later.
pub(crate) fn rig_fields(
    request: v1::CreateRigRequest,
    maximum_bytes: usize,
    violations: &mut Violations,
) -> RigFields {
    if !is_object_id(&request.rig_id) {
        violations.add(
            Field::root("rig_id"),
            format_args!(
                "is {}; it must be 1 to {LONGEST_ID} of a-z, 0-9 and -, starting with a letter",
                quoted(&request.rig_id)
            ),
        );
    }
    let mut warnings = Vec::new();
    let is_model = matches!(request.source, Some(v1::create_rig_request::Source::Model(_)));
    let has_other = !request.other_model.is_empty();
    let source = source(
        request.source,
        request.other_model,
        maximum_bytes,
        &mut warnings,
        violations,
    );
    let map_field = Field::root("joint_map");
    if !request.joint_map.is_empty() && !is_model {
        violations.add(map_field, "is given without a model, whose nodes it names");
    }
    if request.joint_map.len() > LARGEST_MAP {
        violations.add(
            map_field,
            format_args!(
                "has {} entries; at most {LARGEST_MAP} are allowed",
                request.joint_map.len()
            ),
        );
    }
    if has_other && request.joint_map.iter().any(|mapped| mapped.handedness == 0) {
        violations.add(
            map_field,
            "has entries without handedness; with other_model, all of them need it",
        );
    }
    if has_other && request.handedness == 0 && !request.joint_map.is_empty() {
        violations.add(
            Field::root("handedness"),
            "is required with other_model and joint_map: the hand that model shows",
        );
    }
    let joint_map = request.joint_map.into_iter().take(LARGEST_MAP).enumerate();
    let joint_map = joint_map.map(|(place, mapped)| mapped_joint(map_field.at(place), mapped, violations));
    let joint_map = joint_map.collect();
    let limits = limits(&request.limits, violations);
    let side = side(Field::root("handedness"), request.handedness, violations);
    let width_scale = request.width_scale;
    if width_scale != 0.0 && !WIDTH_SCALES.contains(&width_scale) {
        violations.add(
            Field::root("width_scale"),
            format_args!(
                "is {width_scale}; it must be {} to {}, or 0 for 1",
                WIDTH_SCALES.start(),
                WIDTH_SCALES.end()
            ),
        );
    }
    RigFields {
        id: request.rig_id,
        source,
        joint_map,
        limits,
        side,
        width_scale: if width_scale == 0.0 { 1.0 } else { width_scale },
        radii: radii(&request.radii, violations),
        warnings,
    }
}

/// The radii that are given, by `OpenXR` index.
fn radii(sent: &BTreeMap<String, f32>, violations: &mut Violations) -> [Option<f32>; JOINT_COUNT] {
    let field = Field::root("radii");
    let mut radii = [None; JOINT_COUNT];
    for (name, &radius) in sent.iter().take(LARGEST_MAP) {
        match JOINT_NAMES.iter().position(|joint| joint == name) {
            Some(joint) => radii[joint] = Some(radius),
            None => violations.add(
                field,
                format_args!(
                    "has {}, which is no joint; the joints are {}",
                    quoted(name),
                    JOINT_NAMES.join(", ")
                ),
            ),
        }
        // NaN fails every comparison.
        if !(radius > 0.0 && radius <= LARGEST_RADIUS) {
            violations.add(
                field,
                format_args!(
                    "has {radius} m for {}; it must be more than 0 and at most {LARGEST_RADIUS} m",
                    quoted(name)
                ),
            );
        }
    }
    radii
}

fn source(
    source: Option<v1::create_rig_request::Source>,
    other_model: Vec<u8>,
    maximum_bytes: usize,
    warnings: &mut Vec<String>,
    violations: &mut Violations,
) -> Option<RigOrigin> {
    let is_model = matches!(source, Some(v1::create_rig_request::Source::Model(_)));
    if !other_model.is_empty() && !is_model {
        violations.add(Field::root("other_model"), "is given without model");
    }
    match source {
        None => {
            violations.add(Field::root("source"), "is required: model or joints");
            None
        }
        Some(v1::create_rig_request::Source::Model(model)) => {
            if model.is_empty() || model.len() > maximum_bytes {
                violations.add(
                    Field::root("model"),
                    format_args!("has {} bytes; it must have 1 to {maximum_bytes}", model.len()),
                );
                return None;
            }
            if model.len() + other_model.len() > maximum_bytes {
                violations.add(
                    Field::root("other_model"),
                    format_args!(
                        "has {} bytes; with those of model, there may be {maximum_bytes}",
                        other_model.len()
                    ),
                );
                return None;
            }
            Some(RigOrigin::Model(
                model,
                Some(other_model).filter(|other| !other.is_empty()),
            ))
        }
        Some(v1::create_rig_request::Source::Joints(joints)) => {
            let root = Field::root("joints");
            let field = root.child("hands");
            let sides: Vec<i32> = joints.hands.iter().map(|hand| hand.handedness).collect();
            let are_two = matches!(sides[..], [_]) || matches!(sides[..], [a, b] if a != b);
            if !are_two {
                violations.add(field, "must be one hand, or a left and a right one");
                return None;
            }
            let hands: Option<Vec<HandJoints>> = joints
                .hands
                .iter()
                .enumerate()
                .map(|(place, hand)| joints_at_rest(field.at(place), hand, warnings, violations))
                .collect();
            hands.map(RigOrigin::Joints)
        }
    }
}

fn mapped_joint(field: Field<'_>, mapped: v1::RigNode, violations: &mut Violations) -> MappedJoint {
    for (name, text) in [("node", &mapped.node), ("joint", &mapped.joint)] {
        if text.is_empty() || text.len() > LONGEST_NAME {
            violations.add(
                field.child(name),
                format_args!("has {} bytes; it must have 1 to {LONGEST_NAME}", text.len()),
            );
        }
    }
    MappedJoint {
        side: side(field.child("handedness"), mapped.handedness, violations),
        node: mapped.node,
        joint: mapped.joint,
    }
}

/// A handedness; none if it is unspecified.
fn side(field: Field<'_>, value: i32, violations: &mut Violations) -> Option<Handedness> {
    match known(field, value, violations) {
        v1::Handedness::Left => Some(Handedness::Left),
        v1::Handedness::Right => Some(Handedness::Right),
        v1::Handedness::Unspecified => None,
    }
}

/// The limits of five digits; none if there are none.
fn limits(sent: &[v1::DigitLimits], violations: &mut Violations) -> Option<[DigitLimits; 5]> {
    let field = Field::root("limits");
    if sent.is_empty() {
        return None;
    }
    if sent.len() != 5 {
        violations.add(
            field,
            format_args!("has {} digits; it must have 5, thumb first, or none", sent.len()),
        );
    }
    let mut digits = sent.iter().take(5).enumerate().map(|(place, digit)| {
        let field = field.at(place);
        let mut range =
            |name, range: Option<v1::AngleRange>| angle_range(field.child(name), range, violations);
        DigitLimits {
            base_yaw: range("base_yaw", digit.base_yaw),
            base_pitch: range("base_pitch", digit.base_pitch),
            second_pitch: range("second_pitch", digit.second_pitch),
            third_pitch: range("third_pitch", digit.third_pitch),
        }
    });
    let all = [
        digits.next()?,
        digits.next()?,
        digits.next()?,
        digits.next()?,
        digits.next()?,
    ];
    Some(all)
}

fn angle_range(field: Field<'_>, range: Option<v1::AngleRange>, violations: &mut Violations) -> AngleRange {
    const LARGEST: f32 = std::f32::consts::PI;
    let Some(v1::AngleRange { min, max }) = range else {
        violations.add(field, "is required");
        return AngleRange { min: 0.0, max: 0.0 };
    };
    // NaN fails every comparison.
    if !(min >= -LARGEST && min <= max && max <= LARGEST) {
        violations.add(
            field,
            format_args!("is {min} to {max} rad; it must ascend and be within -{LARGEST} to {LARGEST}"),
        );
    }
    AngleRange { min, max }
}
