//! The methods of all services, with the descriptors of their messages.

use std::{collections::HashMap, sync::LazyLock};

use prost_reflect::{DescriptorPool, MethodDescriptor};

/// A method of a service.
pub(crate) type Method = MethodDescriptor;

/// The contract and the other services of this server, and the types of details of errors.
static POOL: LazyLock<DescriptorPool> = LazyLock::new(|| {
    let mut pool = DescriptorPool::new();
    for set in [
        grasp_proto::FILE_DESCRIPTOR_SET,
        tonic_health::pb::FILE_DESCRIPTOR_SET,
        tonic_reflection::pb::v1::FILE_DESCRIPTOR_SET,
        tonic_reflection::pb::v1alpha::FILE_DESCRIPTOR_SET,
        tonic_types::pb::FILE_DESCRIPTOR_SET,
    ] {
        pool.decode_file_descriptor_set(set)
            .expect("compiled descriptors are sound");
    }
    pool
});

static METHODS: LazyLock<HashMap<String, Method>> = LazyLock::new(|| {
    let methods = POOL
        .services()
        .flat_map(|service| service.methods().collect::<Vec<_>>());
    let by_path = methods.map(|method| {
        let path = format!("/{}/{}", method.parent_service().full_name(), method.name());
        (path, method)
    });
    by_path.collect()
});

/// The method of a path.
pub(crate) fn method(path: &str) -> Option<&'static Method> {
    METHODS.get(path)
}

/// Every method with its path, in the order of the paths.
pub(crate) fn methods() -> Vec<(&'static str, &'static Method)> {
    let mut all: Vec<_> = METHODS
        .iter()
        .map(|(path, method)| (path.as_str(), method))
        .collect();
    all.sort_unstable_by_key(|(path, _)| *path);
    all
}

/// The paths of methods with this name, in any letters, of any service.
pub(crate) fn named_like(path: &str) -> Vec<&'static str> {
    let name = |path: &str| path.rsplit('/').next().unwrap_or_default().to_ascii_lowercase();
    let wanted = name(path);
    let mut like: Vec<&str> = METHODS
        .keys()
        .map(String::as_str)
        .filter(|known| name(known) == wanted)
        .collect();
    like.sort_unstable();
    like
}

/// The message of this name.
pub(crate) fn message(name: &str) -> Option<prost_reflect::MessageDescriptor> {
    POOL.get_message_by_name(name)
}
