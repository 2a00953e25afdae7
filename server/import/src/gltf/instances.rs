//! The instances of a node's mesh (`EXT_mesh_gpu_instancing`).

use glam::{DMat4, DQuat, DVec3};
use gltf::{Accessor, Document};

use super::{accessors::Buffers, extensions::InstanceAttributes};
use crate::{error::ImportError, limits::MeshLimits, raw::check_counts};

/// What is wrong is in this extension.
const EXTENSION: &str = "EXT_mesh_gpu_instancing";

/// Where a mesh is drawn, relative to its node.
pub(super) fn instances(
    attributes: InstanceAttributes,
    document: &Document,
    buffers: &Buffers<'_>,
    limits: MeshLimits,
) -> Result<Vec<DMat4>, ImportError> {
    let InstanceAttributes {
        translation,
        rotation,
        scale,
    } = attributes;
    let accessor = |index: Option<usize>| -> Result<Option<Accessor<'_>>, ImportError> {
        let Some(index) = index else { return Ok(None) };
        let found = document.accessors().nth(index);
        let missing = || {
            ImportError::at(
                EXTENSION,
                format!("refers to accessors[{index}], which does not exist"),
            )
        };
        found.map(Some).ok_or_else(missing)
    };
    let (translation, rotation, scale) = (accessor(translation)?, accessor(rotation)?, accessor(scale)?);
    let counts = || {
        [&translation, &rotation, &scale]
            .into_iter()
            .flatten()
            .map(Accessor::count)
    };
    let Some(count) = counts().next() else {
        // Other attributes move nothing.
        return Ok(vec![DMat4::IDENTITY]);
    };
    if let Some(other) = counts().find(|&other| other != count) {
        return Err(ImportError::at(
            EXTENSION,
            format!("has attributes of {count} and of {other} instances; their numbers must be equal"),
        ));
    }
    // Each instance of a mesh has a triangle at least.
    check_counts(0, count as u64, limits)?;
    let vectors = |accessor: Option<Accessor<'_>>, default: DVec3| match accessor {
        Some(accessor) => buffers.converted(&accessor, count, DVec3::from_array),
        None => Ok(vec![default; count]),
    };
    let translations = vectors(translation, DVec3::ZERO)?;
    let scales = vectors(scale, DVec3::ONE)?;
    let rotations = match rotation {
        Some(accessor) => buffers.converted(&accessor, count, DQuat::from_array)?,
        None => vec![DQuat::IDENTITY; count],
    };
    let at = scales.into_iter().zip(rotations).zip(translations);
    Ok(at
        .map(|((scale, rotation), translation)| {
            DMat4::from_scale_rotation_translation(scale, rotation.normalize(), translation)
        })
        .collect())
}
