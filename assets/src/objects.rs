//! The built-in objects: scissors, scalpel, remote. To come; the interface is fixed.

use std::sync::Arc;

use grasp_synthesis::object::GraspObject;

/// A built-in object.
#[derive(Clone, Debug)]
pub struct BuiltInObject {
    /// "scissors", "scalpel" or "remote".
    pub name: &'static str,
    /// Its mesh as OBJ text.
    pub obj: &'static str,
    /// Its manifest as JSON text.
    pub manifest: &'static str,
    /// Ready to be grasped.
    pub object: Arc<GraspObject>,
}

/// All built-in objects, sorted by name, parsed once.
pub fn objects() -> &'static [BuiltInObject] {
    &[]
}

/// A built-in object by name.
pub fn object(name: &str) -> Option<&'static BuiltInObject> {
    objects().iter().find(|object| object.name == name)
}
