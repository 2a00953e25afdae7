//! Makes rigs from checked requests.

use std::sync::Arc;

use grasp_assets::hands::{self, Hand};
use grasp_import::{ImportError, ImportedHand, MeshLimits, RigSource, read_rig, rig_at_rest};
use grasp_synthesis::{model::hand::Handedness, propose::prepared::PreparedRig};

use crate::{
    error::ServiceError,
    rigs::{RigHand, StoredRig, name_of},
    validate::{Field, RigFields, RigOrigin, Violations},
};

/// The built-in rig that gives others their axes, limits and, where nothing else is known, widths.
const REFERENCE: &str = "adult";

/// Makes a rig and derives what searches need. Takes some tenths of a second.
///
/// # Errors
/// [`ServiceError::Invalid`] with `violations` and everything else that is wrong.
pub(super) fn build_rig(
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
        RigOrigin::Model(bytes) => ("model", read_rig(bytes, about, limits)),
        RigOrigin::Joints(joints) => ("joints", rig_at_rest(joints, about)),
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
