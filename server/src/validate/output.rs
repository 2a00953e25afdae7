//! Checks `OutputOptions`.

use grasp_proto::v1;

use super::{Field, known};
use crate::convention::Convention;

/// The answer's form.
#[derive(Clone, Copy, Debug)]
pub(super) struct Output {
    pub convention: Convention,
    pub plan_key_frames: bool,
    pub changes_only: bool,
}

pub(super) fn output(field: Field<'_>, sent: Option<v1::OutputOptions>) -> Output {
    let v1::OutputOptions {
        convention,
        key_frames,
        changes_only,
    } = sent.unwrap_or_default();
    Output {
        convention: Convention::from_wire(known(field.child("convention"), convention)),
        plan_key_frames: key_frames,
        changes_only,
    }
}
