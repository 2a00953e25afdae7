//! Counts the memory of an encoded message before it is decoded: a part of two bytes may take hundreds in memory.

use std::{
    collections::{HashMap, HashSet},
    sync::LazyLock,
};

use prost::{
    Message as _, Name,
    encoding::{WireType, decode_key, decode_varint},
};
use prost_types::{
    DescriptorProto, FieldDescriptorProto, FileDescriptorSet,
    field_descriptor_proto::{Label, Type},
};

use crate::FILE_DESCRIPTOR_SET;

/// Memory that the parts of a request may take besides twice its own bytes; meshes count as neither. Those of the largest sensible
/// one, an object with 20,000 triangles in regions and 32 known grips, take half as much.
pub const MAX_DECODED_BESIDES: usize = 512 << 10;

/// Decoded bytes per encoded one, besides.
const BYTES_PER_BYTE: usize = 2;

/// Memory of a text or list, without its content.
const LIST_BYTES: usize = 24;

/// Elements of a list of one for which memory is taken, and at most those per element of longer ones.
const FIRST_ELEMENTS: usize = 4;
const GROWTH: usize = 2;

/// A field of a message.
struct Field {
    content: Content,
    /// Memory of one value in a list; `None` if it is not a list, whose value is in its message's own memory.
    element: Option<usize>,
}

enum Content {
    /// The message's name.
    Message(String),
    Text,
    Bytes,
    /// Numbers, whose encoded length is that in memory.
    Fixed,
    Varint,
}

type Fields = HashMap<u32, Field>;

/// The contract's messages by name. None of a request is inside itself, which bounds the nesting.
static MESSAGES: LazyLock<HashMap<String, Fields>> = LazyLock::new(|| {
    let files = files();
    let mut messages = HashMap::new();
    for file in &files.file {
        for message in &file.message_type {
            add(&mut messages, file.package(), message);
        }
    }
    let all = messages.iter();
    let fields = |message: &DescriptorProto| {
        let fields = message.field.iter();
        fields
            .map(|field| (field.number().cast_unsigned(), Field::of(field, &messages)))
            .collect()
    };
    all.map(|(name, message)| (name.clone(), fields(message)))
        .collect()
});

/// The messages that methods take; not all of them have names that say so.
static REQUESTS: LazyLock<HashSet<String>> = LazyLock::new(|| {
    let files = files();
    let services = files.file.iter().flat_map(|file| &file.service);
    let methods = services.flat_map(|service| &service.method);
    let inputs = methods.map(|method| method.input_type().trim_start_matches('.').to_owned());
    inputs.collect()
});

fn files() -> FileDescriptorSet {
    FileDescriptorSet::decode(FILE_DESCRIPTOR_SET).expect("the compiled contract is sound")
}

/// True if a method takes this message.
pub(crate) fn is_request<M: Name>() -> bool {
    REQUESTS.contains(&M::full_name())
}

type Descriptors<'d> = HashMap<String, &'d DescriptorProto>;

fn add<'d>(messages: &mut Descriptors<'d>, scope: &str, message: &'d DescriptorProto) {
    let name = format!("{scope}.{}", message.name());
    for nested in &message.nested_type {
        add(messages, &name, nested);
    }
    messages.insert(name, message);
}

impl Field {
    fn of(field: &FieldDescriptorProto, messages: &Descriptors<'_>) -> Self {
        let content = match field.r#type() {
            Type::Message | Type::Group => Content::Message(message_name(field).to_owned()),
            Type::String => Content::Text,
            Type::Bytes => Content::Bytes,
            Type::Float | Type::Double | Type::Fixed32 | Type::Fixed64 | Type::Sfixed32 | Type::Sfixed64 => {
                Content::Fixed
            }
            _ => Content::Varint,
        };
        let is_list = field.label() == Label::Repeated;
        Self {
            content,
            element: is_list.then(|| value_bytes(field, messages)),
        }
    }
}

fn message_name(field: &FieldDescriptorProto) -> &str {
    field.type_name().trim_start_matches('.')
}

/// Memory of a message without that of its texts and lists. Only lists can be of messages around them.
fn message_bytes(message: &DescriptorProto, messages: &Descriptors<'_>) -> usize {
    let bytes = |field: &FieldDescriptorProto| match field.label() {
        Label::Repeated => LIST_BYTES,
        _ => value_bytes(field, messages),
    };
    message.field.iter().map(bytes).sum()
}

fn value_bytes(field: &FieldDescriptorProto, messages: &Descriptors<'_>) -> usize {
    let is_optional = field.proto3_optional();
    match field.r#type() {
        Type::Message | Type::Group => {
            // With whether it is present.
            let message = messages.get(message_name(field));
            size_of::<u32>() + message.map_or(0, |message| message_bytes(message, messages))
        }
        Type::String | Type::Bytes => LIST_BYTES,
        Type::Double | Type::Int64 | Type::Uint64 | Type::Sint64 | Type::Fixed64 | Type::Sfixed64 => {
            size_of::<u64>() << u32::from(is_optional)
        }
        _ => size_of::<u32>() << u32::from(is_optional),
    }
}

/// True if a message takes more memory than any sensible request. Malformed ones are left to decoding.
pub fn is_too_large_decoded<M: Name>(message: &[u8]) -> bool {
    let mut left = MAX_DECODED_BESIDES + BYTES_PER_BYTE * message.len();
    count(message, MESSAGES.get(&M::full_name()), &mut left) == Err(TooLarge)
}

/// A message takes too much memory.
#[derive(PartialEq)]
struct TooLarge;

/// Takes the memory of a message off what is left, up to where it is malformed.
fn count(message: &[u8], fields: Option<&Fields>, left: &mut usize) -> Result<(), TooLarge> {
    let mut rest = message;
    let mut listed = Vec::new();
    while let Some((number, wire_type, content)) = next_field(&mut rest) {
        let Some(field) = fields.and_then(|fields| fields.get(&number)) else {
            continue;
        };
        let is_packed = wire_type == WireType::LengthDelimited;
        let mut elements = 1;
        match &field.content {
            Content::Message(name) => count(content, MESSAGES.get(name), left)?,
            Content::Text => take(left, content.len())?,
            Content::Bytes => take(left, BYTES_PER_BYTE * content.len())?,
            Content::Fixed if is_packed => {
                elements = content.len() / field.element.unwrap_or(size_of::<u32>());
            }
            Content::Varint if is_packed => {
                elements = content.iter().filter(|&&byte| byte < 0x80).count();
            }
            Content::Fixed | Content::Varint => {}
        }
        let Some(bytes) = field.element.filter(|_| elements > 0) else {
            continue;
        };
        let mut taken = GROWTH * elements;
        if !listed.contains(&number) {
            listed.push(number);
            taken += FIRST_ELEMENTS - GROWTH;
        }
        take(left, taken * bytes)?;
    }
    Ok(())
}

fn take(left: &mut usize, bytes: usize) -> Result<(), TooLarge> {
    *left = left.checked_sub(bytes).ok_or(TooLarge)?;
    Ok(())
}

/// Takes the first field off a message, with what follows its length, if it has one; that of a message cut off is what there is.
/// `None` at the end, and where the message is malformed.
fn next_field<'m>(rest: &mut &'m [u8]) -> Option<(u32, WireType, &'m [u8])> {
    if rest.is_empty() {
        return None;
    }
    let (number, wire_type) = decode_key(rest).ok()?;
    let length = match wire_type {
        WireType::Varint => {
            decode_varint(rest).ok()?;
            0
        }
        WireType::SixtyFourBit => 8,
        WireType::ThirtyTwoBit => 4,
        WireType::LengthDelimited => usize::try_from(decode_varint(rest).ok()?).ok()?,
        // Of unknown fields only: what is inside counts as outside.
        WireType::StartGroup | WireType::EndGroup => 0,
    };
    let (content, after) = rest.split_at_checked(length).unwrap_or((rest, &[]));
    *rest = after;
    Some((number, wire_type, content))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::v1;

    /// A request with regions that each have one shape, and a mesh.
    fn request(regions: usize, mesh: Vec<u8>) -> Vec<u8> {
        let region = v1::Region {
            shapes: vec![v1::Shape::default()],
            ..v1::Region::default()
        };
        let mut request = v1::CreateObjectRequest::new("many", mesh, 0.1);
        request.object.get_or_insert_default().regions = vec![region; regions];
        request.encode_to_vec()
    }

    fn is_refused(message: &[u8]) -> bool {
        is_too_large_decoded::<v1::CreateObjectRequest>(message)
    }

    #[test]
    fn memory_is_counted_where_the_contract_has_parts_and_nowhere_else() {
        assert!(!is_refused(&request(500, Vec::new())));
        assert!(is_refused(&request(3000, Vec::new())));
        // A mesh makes no room.
        assert!(is_refused(&request(3000, vec![0; 1 << 20])));
        // Bytes that would be as many empty messages.
        assert!(!is_refused(&request(1, b"\x3a\0".repeat(3000))));
        // What decoding refuses in the end has been counted before.
        let cut = request(3000, Vec::new());
        assert!(is_refused(&[&cut[..cut.len() - 1], &[0xff; 11]].concat()));
    }

    #[test]
    fn a_list_of_one_takes_the_memory_of_four() {
        let mut request = v1::CreateObjectRequest::new("a", Vec::new(), 0.1);
        let region = v1::Region {
            shapes: vec![v1::Shape::default()],
            ..v1::Region::default()
        };
        request.object_mut().regions = vec![region; 1];
        let mut left = 1 << 20;
        count(
            &request.encode_to_vec(),
            MESSAGES.get("grasp.v1.CreateObjectRequest"),
            &mut left,
        )
        .ok();
        let counted = (1 << 20) - left;
        let least = 4 * (size_of::<v1::Region>() + size_of::<v1::Shape>());
        assert!((least..2 * least).contains(&counted), "{counted} of {least}");
    }

    #[test]
    fn the_largest_sensible_request_is_decoded() {
        let mut request = v1::CreateObjectRequest::new("a", Vec::new(), 0.1);
        let object = request.object_mut();
        object.regions = vec![v1::Region {
            triangles: vec![1; 20_000],
            ..v1::Region::default()
        }];
        let pose = v1::Pose::new(glam::Vec3::ONE, glam::Quat::IDENTITY);
        let grip = v1::HandPose::new("rigs/adult", v1::Handedness::Left)
            .with_client_from_wrist(pose)
            .with_digits([Some(v1::DigitAngles::default()); 5]);
        let grip = v1::KnownGrip::new("a", v1::Preference::Preferred, grip);
        object.known_grips = vec![grip; 32];
        assert!(!is_refused(&request.encode_to_vec()));
    }

    #[test]
    fn no_request_has_a_message_inside_itself() {
        fn depth(message: &str) -> usize {
            let fields = MESSAGES.get(message).into_iter().flat_map(HashMap::values);
            let inner = fields.filter_map(|field| match &field.content {
                Content::Message(name) => Some(name),
                _ => None,
            });
            1 + inner.map(|inner| depth(inner)).max().unwrap_or(0)
        }
        assert!(is_request::<v1::Track>() && is_request::<v1::FindGraspRequest>());
        assert!(!is_request::<v1::FindGraspResponse>());
        // A cycle would end in a stack overflow.
        let deepest = REQUESTS.iter().map(|name| depth(name)).max();
        assert!(deepest > Some(4), "{deepest:?}");
    }
}
