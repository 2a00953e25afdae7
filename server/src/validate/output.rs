//! Checks `OutputOptions`.

use grasp_proto::v1;

use super::{Field, Violations, known};
use crate::convention::Convention;

/// The answer's form.
#[derive(Clone, Copy, Debug)]
pub(super) struct Output {
    pub convention: Convention,
    pub plan_key_frames: bool,
    pub changes_only: bool,
}

pub(super) fn output(field: Field<'_>, sent: Option<v1::OutputOptions>, v: &mut Violations) -> Output {
    let v1::OutputOptions {
        convention,
        key_frames,
        changes_only,
    } = sent.unwrap_or_default();
    Output {
        convention: Convention::from_wire(known(field.child("convention"), convention, v)),
        plan_key_frames: key_frames,
        changes_only,
    }
}
