//! Counts the parts of an encoded message before it is decoded: one of two bytes may take hundreds in memory.

use std::{
    collections::{HashMap, HashSet},
    sync::LazyLock,
};

use prost::{
    Message as _, Name,
    encoding::{WireType, decode_key, decode_varint},
};
use prost_types::{DescriptorProto, FileDescriptorSet};

use crate::FILE_DESCRIPTOR_SET;

/// Most messages, texts, byte strings and lists of numbers in a request. Those of the largest sensible one, an object with 32 known
/// grips, are some thousands.
pub const MAX_PARTS: usize = 16_384;

/// The contract's messages: which of a message's fields are messages, and which ones. None is inside itself, which bounds the nesting.
static MESSAGES: LazyLock<HashMap<String, HashMap<u32, String>>> = LazyLock::new(|| {
    let mut messages = HashMap::new();
    for file in &files().file {
        for message in &file.message_type {
            add(&mut messages, file.package(), message);
        }
    }
    messages
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

fn add(messages: &mut HashMap<String, HashMap<u32, String>>, scope: &str, message: &DescriptorProto) {
    let name = format!("{scope}.{}", message.name());
    for nested in &message.nested_type {
        add(messages, &name, nested);
    }
    let inner = message.field.iter().filter_map(|field| {
        let name = field.type_name().strip_prefix('.')?;
        Some((field.number().cast_unsigned(), name.to_owned()))
    });
    messages.insert(name, inner.collect());
}

/// True if a message has more parts than any sensible request. Malformed ones are left to decoding.
pub fn has_too_many_parts<M: Name>(message: &[u8]) -> bool {
    let mut left = MAX_PARTS + 1;
    count(message, MESSAGES.get(&M::full_name()), &mut left);
    left == 0
}

/// Takes the parts of a message off those left; `None` if it is malformed, or none are left.
fn count(mut message: &[u8], fields: Option<&HashMap<u32, String>>, left: &mut usize) -> Option<()> {
    while !message.is_empty() {
        let (number, wire_type) = decode_key(&mut message).ok()?;
        let skipped = match wire_type {
            WireType::Varint => {
                decode_varint(&mut message).ok()?;
                0
            }
            WireType::SixtyFourBit => 8,
            WireType::ThirtyTwoBit => 4,
            WireType::LengthDelimited => {
                let length = usize::try_from(decode_varint(&mut message).ok()?).ok()?;
                *left = left.checked_sub(1)?;
                let inner = fields.and_then(|fields| fields.get(&number));
                if let Some(inner) = inner.and_then(|name| MESSAGES.get(name)) {
                    count(message.get(..length).unwrap_or(message), Some(inner), left)?;
                }
                length
            }
            // Of unknown fields only: their content counts as outside.
            WireType::StartGroup | WireType::EndGroup => 0,
        };
        message = message.get(skipped..)?;
    }
    Some(())
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
        has_too_many_parts::<v1::CreateObjectRequest>(message)
    }

    #[test]
    fn parts_are_counted_where_the_contract_has_them_and_nowhere_else() {
        // The object and its name are parts as well.
        let most = (MAX_PARTS - 2) / 2;
        assert!(!is_refused(&request(most, Vec::new())));
        assert!(is_refused(&request(most, vec![0])));
        // Bytes that would be as many empty messages.
        assert!(!is_refused(&request(1, b"\x3a\0".repeat(MAX_PARTS))));
        // Parts count even if decoding fails after them.
        let cut = request(most + 10, Vec::new());
        assert!(is_refused(&[&cut[..cut.len() - 1], &[0xff; 11]].concat()));
    }

    #[test]
    fn no_request_has_a_message_inside_itself() {
        fn depth(message: &str) -> usize {
            let inner = MESSAGES.get(message).into_iter().flat_map(HashMap::values);
            1 + inner.map(|inner| depth(inner)).max().unwrap_or(0)
        }
        assert!(is_request::<v1::Track>() && is_request::<v1::FindGraspRequest>());
        assert!(!is_request::<v1::FindGraspResponse>());
        // A cycle would end in a stack overflow.
        let deepest = REQUESTS.iter().map(|name| depth(name)).max();
        assert!(deepest > Some(4), "{deepest:?}");
    }
}
