//! Objects at another size than that of their meshes, or of another mass.

use std::{sync::Arc, time::Instant};

use grasp_synthesis::{
    base::stop::Stop,
    model::{hand::rig::Rig, plain_object::ResizeError},
};
use tokio::sync::Semaphore;

use super::{StoredObject, extent::check_resized, store::SizeSlot};
use crate::{
    error::ServiceError,
    executor::{before, run_stoppable},
    rigs::store::RigStore,
    validate::RequestedSize,
};

/// Size and mass of an object that differs from a stored one in nothing else.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ObjectSize {
    hundredths: u16,
    /// In kilograms.
    mass: f32,
}

impl ObjectSize {
    /// The size that a request asks for. `None` for the object as it is stored.
    pub(crate) fn of(requested: RequestedSize, stored: &StoredObject) -> Option<Self> {
        let own = stored.object.mass;
        let mut size = Self {
            hundredths: requested.hundredths,
            mass: own,
        };
        size.mass = requested.mass.unwrap_or(own * size.scale().powi(3));
        (size.hundredths != 100 || size.mass != own).then_some(size)
    }

    /// How many times as large the object is.
    pub(crate) fn scale(self) -> f32 {
        f32::from(self.hundredths) / 100.0
    }
}

/// Prepares objects at other sizes.
#[derive(Debug)]
pub(crate) struct Resizer(Arc<Semaphore>);

impl Resizer {
    /// Prepares as many at a time as there are permits. Each takes as much memory as building an object.
    pub(crate) fn new(permits: Arc<Semaphore>) -> Self {
        Self(permits)
    }

    /// The object in a slot, prepared unless it is kept; `rigs` has those of its grips. It stops when `due` or when the future is dropped.
    ///
    /// # Errors
    /// - [`ServiceError::DeadlineExceeded`] when it is due.
    /// - [`ServiceError::Invalid`] if the object cannot have this size.
    /// - [`ServiceError::Panicked`] or [`ServiceError::Cancelled`] if it was cut short.
    pub(crate) async fn fill(
        &self,
        slot: SizeSlot,
        stored: &Arc<StoredObject>,
        size: ObjectSize,
        rigs: &RigStore,
        due: Option<Instant>,
    ) -> Result<Arc<StoredObject>, ServiceError> {
        if let Some(kept) = slot.get() {
            return Ok(Arc::clone(kept));
        }
        let permit = before(due, Arc::clone(&self.0).acquire_owned()).await?;
        // Nothing closes the semaphore.
        let permit = permit.map_err(|_| ServiceError::Cancelled)?;
        let stored = Arc::clone(stored);
        let rigs = stored.given.rigs(|name, handedness| rigs.rig(name, handedness));
        run_stoppable(due, move |stop| {
            let _permit = permit;
            // Another call may have prepared the same meanwhile.
            if let Some(kept) = slot.get() {
                return Ok(Arc::clone(kept));
            }
            let prepared = Arc::new(resized(&stored, size, &rigs, stop)?);
            Ok(Arc::clone(slot.get_or_init(|| prepared)))
        })
        .await?
    }
}

/// A stored object at another size. Takes some ten milliseconds, up to seconds for the largest meshes.
///
/// # Errors
/// - [`ServiceError::Invalid`] if the object cannot have this size.
/// - [`ServiceError::Cancelled`] if it was stopped.
fn resized(
    stored: &StoredObject,
    size: ObjectSize,
    rigs: &[Option<Rig>],
    stop: Stop<'_>,
) -> Result<StoredObject, ServiceError> {
    let base = stored.derived_until(stop)?;
    let object = match base.object.resized_until(size.scale(), size.mass, stop)? {
        Ok(object) => object,
        Err(error) => {
            let field = match error {
                ResizeError::Mass(_) => "holdout.mass_kg",
                ResizeError::Mesh(_) => "holdout.scale",
            };
            return Err(ServiceError::invalid(field, error.to_string()));
        }
    };
    check_resized(&object.mesh).map_err(|wrong| ServiceError::invalid("holdout.scale", wrong))?;
    let resized = StoredObject {
        given: stored
            .given
            .at_scale(size.scale(), [base.object.object(), &object], rigs),
        ..StoredObject::from_file(
            stored.id.clone(),
            object.plain().clone(),
            Vec::new(),
            Arc::clone(&stored.file),
        )
    };
    resized.fill(Arc::new(object), stop)?;
    Ok(resized)
}
