//! Makes rigs from checked requests.

use std::sync::Arc;

use grasp_assets::hands::{self, Hand};
use grasp_import::{ImportError, ImportedHand, MappedJoint, MeshLimits, RigSource, read_rig, rig_at_rest};
use grasp_synthesis::{
    model::hand::{Handedness, joints::HandJoints, rig::DigitLimits},
    propose::prepared::PreparedRig,
};

use super::{RigHand, StoredRig, name_of};
use crate::{
    error::ServiceError,
    validate::{Field, Violations},
};

/// The built-in rig that gives others their axes, limits and, where nothing else is known, widths.
const REFERENCE: &str = "adult";

/// What a rig is made from.
#[derive(Debug)]
pub(crate) enum Source {
    /// The content of a file.
    Model(Vec<u8>),
    /// Joints at rest of one or both hands.
    Joints(Vec<HandJoints>),
}

/// The checked fields of a new rig.
#[derive(Debug)]
pub(crate) struct RigFields {
    /// The last part of its name.
    pub id: String,
    /// What it is made from; none if the request has none, or a wrong one.
    pub source: Option<Source>,
    /// Joints of the model by node.
    pub joint_map: Vec<MappedJoint>,
    /// The limits of the digits, if given.
    pub limits: Option<[DigitLimits; 5]>,
    /// The hand that a model shows if its names do not say.
    pub side: Option<Handedness>,
    /// What was repaired.
    pub warnings: Vec<String>,
}

/// Makes a rig and derives what searches need. Takes some tenths of a second.
///
/// # Errors
/// [`ServiceError::Invalid`] with `violations` and everything else that is wrong.
pub(crate) fn build_rig(
    fields: RigFields,
    limits: MeshLimits,
    mut violations: Violations,
) -> Result<StoredRig, ServiceError> {
    let reference = hands::hand(REFERENCE, Handedness::Right);
    let (Some(source), Some(reference)) = (&fields.source, reference) else {
        return Err(violations.into_error());
    };
    let name = name_of(&fields.id);
    let about = RigSource {
        name: &name,
        reference: &reference.rig,
        side: fields.side,
        joint_map: &fields.joint_map,
        limits: fields.limits,
    };
    let (field, made) = match source {
        Source::Model(bytes) => ("model", read_rig(bytes, about, limits)),
        Source::Joints(joints) => ("joints", rig_at_rest(joints, about)),
    };
    let made = match made {
        Ok(made) => made,
        Err(errors) => {
            for error in errors {
                match error {
                    // Entries of the map are fields of their own.
                    ImportError::At { place, what } if place.starts_with("joint_map[") => {
                        violations.add(place, what);
                    }
                    other => violations.add(Field::root(field), other),
                }
            }
            return Err(violations.into_error());
        }
    };
    let mirrored = [made.left.is_mirrored, made.right.is_mirrored];
    violations.finish(StoredRig {
        id: fields.id,
        built_in: false,
        hands: [made.left, made.right].map(rig_hand),
        mirrored,
        warnings: fields.warnings,
    })
}

/// The hand with what searches need. Its skin, which only a giver under THESIS validity shows, is the reference's, stretched.
fn rig_hand(made: ImportedHand) -> RigHand {
    let reference = hands::hand(REFERENCE, made.rig.handedness).expect("the rig is built in");
    let rig = PreparedRig::new(made.rig);
    // The first search would do it, outside its budget.
    rig.oppositions();
    RigHand {
        hand: Arc::new(Hand {
            rig,
            skin: Arc::clone(&reference.skin),
        }),
        binding: made.binding.map(Arc::new),
        scale: 1.0,
    }
}
