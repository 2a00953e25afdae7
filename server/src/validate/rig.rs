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
    Field, Violations, check_count, check_within, factor,
    hand::{AllowedGaps, tracked_hand},
    handedness, known,
    lists::{page_size, reject_token},
    object::{ID_RULE, id_in, is_object_id},
    quoted, required,
};
use crate::{convention::Convention, error::ServiceError, rigs::COLLECTION};

/// Most rigs on a page: a rig takes some ten kilobytes.
const MAX_PAGE_SIZE: usize = 100;

/// Prefix of tokens of this version, so that tokens of other versions are rejected.
const TOKEN_PREFIX: &str = "r1-";

/// Largest number of entries of a joint map: one for each joint of two hands.
const MAX_MAP_ENTRIES: usize = 50;
const WIDTH_SCALES: RangeInclusive<f32> = 0.5..=2.0;

/// Largest angle of a limit, in radians.
const MAX_LIMIT: f32 = std::f32::consts::PI;

/// Largest radius of a joint, in metres.
const MAX_RADIUS: f32 = 0.1;

/// Largest size of the texts of a joint map's entry, in bytes.
const MAX_NAME: usize = 1024;

pub(crate) fn rig_id_of(field: Field<'_>, name: &str) -> Option<String> {
    id_in(COLLECTION, "the rig's id", field, name)
}

#[derive(Debug)]
pub(crate) enum RigOrigin {
    /// The content of a file and, if each hand has a file, of the other hand's.
    Model(Vec<u8>, Option<Vec<u8>>),
    /// Joints at rest of one or both hands.
    Joints(Vec<HandJoints>),
}

#[derive(Debug)]
pub(crate) struct RigFields {
    pub id: String,
    pub source: Option<RigOrigin>,
    pub joint_map: Vec<MappedJoint>,
    /// The limits of the digits, thumb first; `None` for those of the reference.
    pub limits: [Option<DigitLimits>; 5],
    /// The hand that a model shows if its names do not say.
    pub side: Option<Handedness>,
    pub width_scale: f32,
    /// Radii that go before measured ones, by `OpenXR` index, in metres.
    pub radii: [Option<f32>; JOINT_COUNT],
    pub warnings: Vec<String>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct RigPageQuery {
    pub size: usize,
    pub after: Option<String>,
}

pub(crate) fn rig_page_query(request: &v1::ListRigsRequest) -> Result<RigPageQuery, ServiceError> {
    let violations = Violations::default();
    let size = page_size(request.page_size, MAX_PAGE_SIZE, &violations);
    let token = request.page_token.as_str();
    let id = token.strip_prefix(TOKEN_PREFIX).filter(|id| is_object_id(id));
    if id.is_none() && !token.is_empty() {
        reject_token::<()>(violations.field("page_token"), token);
    }
    violations.finish(RigPageQuery {
        size,
        after: id.map(str::to_owned),
    })
}

pub(crate) fn rig_page_token(last_id: &str) -> String {
    format!("{TOKEN_PREFIX}{last_id}")
}

/// Checks the fields of a new rig. Reading the model adds its own violations later.
pub(crate) fn rig_fields(
    request: v1::CreateRigRequest,
    maximum_bytes: usize,
    violations: &Violations,
) -> RigFields {
    let text = format_args!("is {}; it must be {ID_RULE}", quoted(&request.rig_id));
    violations
        .field("rig_id")
        .check(is_object_id(&request.rig_id), text);
    let mut warnings = Vec::new();
    let (models, map) = (request.models.len(), request.joint_map);
    let source = match (models, request.joints.len()) {
        (0, 1..) => joints_of_hands(&request.joints, &mut warnings, violations).map(RigOrigin::Joints),
        (_, 0) => models_within(violations.field("models"), request.models, maximum_bytes),
        _ => violations
            .field("models")
            .reject("is given with joints; give one of them"),
    };
    let map_field = violations.field("joint_map");
    let side_field = violations.field("handedness");
    let text = "is given without a model, whose nodes it names";
    map_field.check(map.is_empty() || models > 0, text);
    check_count(map_field, map.len(), MAX_MAP_ENTRIES, "entries");
    let text = "has entries without handedness; with two models, all of them need it";
    map_field.check(
        models != 2 || map.iter().all(|mapped| mapped.handedness != 0),
        text,
    );
    let text = "is required with two models and joint_map: the hand that the first model shows";
    side_field.check(models != 2 || request.handedness != 0 || map.is_empty(), text);
    let joint_map = map_field.each(map.into_iter().take(MAX_MAP_ENTRIES), mapped_joint);
    let joint_map = joint_map.collect();
    let limits = limits(&request.limits, violations);
    let side = handedness(side_field, request.handedness);
    RigFields {
        id: request.rig_id,
        source,
        joint_map,
        limits,
        side,
        width_scale: factor(violations.field("width_scale"), request.width_scale, WIDTH_SCALES),
        radii: radii(&request.radii, violations),
        warnings,
    }
}

fn radii(sent: &BTreeMap<String, f32>, violations: &Violations) -> [Option<f32>; JOINT_COUNT] {
    let field = violations.field("radii");
    let mut radii = [None; JOINT_COUNT];
    for (name, &radius) in sent.iter().take(MAX_MAP_ENTRIES) {
        match JOINT_NAMES.iter().position(|joint| joint == name) {
            Some(joint) => radii[joint] = Some(radius),
            None => field.add(format_args!(
                "has {}, which is no joint; the joints are {}",
                quoted(name),
                JOINT_NAMES.join(", ")
            )),
        }
        // NaN fails every comparison.
        if !(radius > 0.0 && radius <= MAX_RADIUS) {
            field.add(format_args!(
                "has {radius} m for {}; it must be more than 0 and at most {MAX_RADIUS} m",
                quoted(name)
            ));
        }
    }
    radii
}

fn check_bytes(field: Field<'_>, bytes: usize, most: usize) -> bool {
    let text = format_args!("has {bytes} bytes; it must have 1 to {most}");
    field.check((1..=most).contains(&bytes), text)
}

/// One model or two that have no more bytes together than a rig may have.
fn models_within(field: Field<'_>, models: Vec<Vec<u8>>, maximum_bytes: usize) -> Option<RigOrigin> {
    match models.len() {
        0 => return field.reject("is required, or joints"),
        1 | 2 => {}
        count => {
            return field.reject(format_args!(
                "has {count} files; it must have one, or one per hand"
            ));
        }
    }
    let mut left = maximum_bytes;
    for (place, model) in models.iter().enumerate() {
        if !check_bytes(field.at(place), model.len(), left) {
            return None;
        }
        left -= model.len();
    }
    let mut models = models.into_iter();
    Some(RigOrigin::Model(models.next()?, models.next()))
}

fn joints_of_hands(
    sent: &[v1::HandJoints],
    warnings: &mut Vec<String>,
    violations: &Violations,
) -> Option<Vec<HandJoints>> {
    let field = violations.field("joints");
    let are_sound = match sent {
        [_] => true,
        [one, other] => one.handedness != other.handedness,
        _ => false,
    };
    if !are_sound {
        return field.reject("must be of one hand, or of a left and a right one");
    }
    let hands = field.each(sent, |field, sent| {
        let hand = tracked_hand(field, sent, Convention::OpenXr, AllowedGaps::Fingers)?;
        warnings.extend(hand.warnings);
        Some(hand.joints)
    });
    hands.collect()
}

fn mapped_joint(field: Field<'_>, mapped: v1::RigNode) -> MappedJoint {
    for (name, text) in [("node", &mapped.node), ("joint", &mapped.joint)] {
        check_bytes(field.child(name), text.len(), MAX_NAME);
    }
    MappedJoint {
        side: handedness(field.child("handedness"), mapped.handedness),
        node: mapped.node,
        joint: mapped.joint,
    }
}

fn limits(sent: &[v1::DigitLimits], violations: &Violations) -> [Option<DigitLimits>; 5] {
    let mut limits = [None; 5];
    // More than five repeat a digit.
    for (place, sent) in sent.iter().take(6).enumerate() {
        let field = violations.field("limits").at(place);
        let given = digit_limits(field, sent);
        let digit = field.child("digit");
        match known(digit, sent.digit) {
            v1::Digit::Unspecified => digit.add("is required"),
            named => {
                // Thumb first, as in the contract.
                let of = &mut limits[named as usize - 1];
                let text = format_args!("is {} again; give each digit once", named.as_str_name());
                digit.check(of.is_none(), text);
                *of = given;
            }
        }
    }
    limits
}

/// `None` if a bound is missing.
fn digit_limits(field: Field<'_>, sent: &v1::DigitLimits) -> Option<DigitLimits> {
    let [min_field, max_field] = [field.child("min"), field.child("max")];
    let bound = |field: Field<'_>, sent: Option<v1::DigitAngles>| {
        let sent = required(field, sent)?;
        required(field.child("third_pitch"), sent.third_pitch)?;
        Some(sent)
    };
    let [Some(min), Some(max)] = [bound(min_field, sent.min), bound(max_field, sent.max)] else {
        return None;
    };
    let range = |name, min: f32, max: f32| {
        for (field, angle) in [(min_field, min), (max_field, max)] {
            check_within(field.child(name), angle, -MAX_LIMIT..=MAX_LIMIT);
        }
        if min > max {
            let text = format_args!("is {max} rad; it must be at least the min, {min}");
            max_field.child(name).add(text);
        }
        AngleRange { min, max }
    };
    let third = |angles: v1::DigitAngles| angles.third_pitch.unwrap_or_default();
    Some(DigitLimits {
        base_yaw: range("base_yaw", min.base_yaw, max.base_yaw),
        base_pitch: range("base_pitch", min.base_pitch, max.base_pitch),
        second_pitch: range("second_pitch", min.second_pitch, max.second_pitch),
        third_pitch: range("third_pitch", third(min), third(max)),
    })
}
