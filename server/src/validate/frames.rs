//! What the poses and hands of a request are read with, and the form of its answer.

use glam::Vec3;
use grasp_proto::v1;
use grasp_synthesis::base::pose::Pose;

use super::{Field, FindQuery, Violations, known, pose};
use crate::{convention::Convention, rigs::store::RigStore};

/// How the poses and hands of a request are to be read.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frames<'a> {
    /// Axes, units and joint order.
    pub convention: Convention,
    /// The object in the client's frame, in `OpenXR` axes.
    pub client_from_object: Pose,
    /// The rigs that hands can be of.
    pub rigs: &'a RigStore,
}

impl<'a> Frames<'a> {
    /// Those of a request; what is wrong with them is not said here.
    pub(super) fn of(
        holdout: Option<&v1::Holdout>,
        sent: Option<v1::OutputOptions>,
        rigs: &'a RigStore,
    ) -> Self {
        let unsaid = Violations::default();
        let field = unsaid.field("output");
        let convention = output(field, sent).convention;
        let sent = holdout.and_then(|holdout| holdout.client_from_object);
        Self {
            convention,
            client_from_object: object_pose(field, sent, convention).0,
            rigs,
        }
    }

    /// Those of a checked request.
    pub(super) fn of_query(query: &FindQuery, rigs: &'a RigStore) -> Self {
        Self {
            convention: query.convention,
            client_from_object: query.client_from_object,
            rigs,
        }
    }
}

/// An object's pose in `OpenXR` axes, and its origin unless the pose is wrong.
pub(super) fn object_pose(
    field: Field<'_>,
    sent: Option<v1::Pose>,
    convention: Convention,
) -> (Pose, Option<Vec3>) {
    let before = field.violations().len();
    let sent = pose(field, sent, convention);
    let client_from_object = convention.object_to_openxr(sent);
    let origin = (field.violations().len() == before).then_some(client_from_object.position);
    (client_from_object, origin)
}

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
