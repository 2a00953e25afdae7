//! Data derived from objects for searches: built when first needed, and dropped first when memory is short.

use std::{
    sync::{Arc, OnceLock},
    thread,
    time::Instant,
};

use grasp_assets::{
    atlases::held_primitives,
    hands::{Hand, hand, is_built_in},
};
use grasp_synthesis::{
    base::stop::{Stop, Stopped},
    known::primitives::{HeldPrimitive, TransferredGrips},
    model::{
        hand::{Handedness, rig::Rig},
        object::GraspObject,
        plain_object::{PlainObject, ResizeError},
    },
    propose::prepared::PreparedObject,
};
use tokio::sync::Semaphore;

use super::{StoredObject, mesh_file::check_resized, store::SizeSlot};
use crate::{
    error::ServiceError,
    executor::{before, run_stoppable},
    rigs::store::RigStore,
    sync::{Mutex, locked},
    validate::RequestedSize,
};

/// Estimated bytes of derived data before it is built: per triangle, and besides.
const BYTES_PER_TRIANGLE: usize = 160;
const BYTES_BESIDES: usize = 480 << 10;

type GripsSlot = OnceLock<Arc<TransferredGrips>>;

/// An object in the form that searches use, with the grips that they start from. Clones share both.
#[derive(Clone, Debug)]
pub(crate) struct Derived {
    pub object: Arc<PreparedObject>,
    /// Its transferred grips for each of [`held_primitives`], made when they are first needed.
    transferred_grips: Arc<[GripsSlot]>,
    /// Held while hands are prepared, so that this is done once.
    preparing: Arc<Mutex<()>>,
}

impl Derived {
    /// Derives the data of an object that has its search structures.
    pub(super) fn of(object: Arc<GraspObject>, stop: Stop<'_>) -> Result<Arc<Self>, Stopped> {
        Ok(Arc::new(Self {
            object: Arc::new(PreparedObject::new_until(object, stop)?),
            transferred_grips: held_primitives().iter().map(|_| OnceLock::new()).collect(),
            preparing: Arc::default(),
        }))
    }

    /// Fills the placement cache and transfers grips for both hands of a rig, which otherwise the first search with
    /// each hand would have to do. Takes some ten milliseconds per hand the first time, in parallel if the system has a thread for
    /// it.
    pub(crate) fn prepare(&self, rig: &str, stop: Stop<'_>) -> Result<(), Stopped> {
        let _preparing = locked(&self.preparing);
        if self.is_prepared(rig) {
            return Ok(());
        }
        let prepare_hand = |handedness| -> Result<(), Stopped> {
            let Some(hand) = hand(rig, handedness) else {
                return Ok(());
            };
            self.object.build_placement_cache(&hand.rig, stop)?;
            if let Some((held, grips)) = self.transferred_grips_of(hand)
                && grips.get().is_none()
            {
                let transferred = TransferredGrips::of_until(&self.object, held, stop)?;
                grips.get_or_init(|| Arc::new(transferred));
            }
            Ok(())
        };
        thread::scope(|scope| {
            let left = thread::Builder::new().spawn_scoped(scope, || prepare_hand(Handedness::Left));
            let right = prepare_hand(Handedness::Right);
            let left = left.ok().and_then(|thread| thread.join().ok());
            left.unwrap_or_else(|| prepare_hand(Handedness::Left)).and(right)
        })
    }

    /// True if [`Self::prepare`] has nothing to do.
    pub(crate) fn is_prepared(&self, rig: &str) -> bool {
        let hands = [Handedness::Left, Handedness::Right].map(|handedness| hand(rig, handedness));
        hands.into_iter().flatten().all(|hand| {
            let grips = self.transferred_grips_of(hand);
            self.object.has_placement_cache(&hand.rig) && grips.is_none_or(|(_, grips)| grips.get().is_some())
        })
    }

    /// Grips of primitives transferred to this object, from which searches start while it has no atlas. `None` if none fits.
    /// There are such grips for one rig; hands of the clients' own rigs start from those, too.
    pub(crate) fn transferred_grips(&self, hand: &Hand) -> Option<Arc<TransferredGrips>> {
        let (held, grips) = self.transferred_grips_of(hand)?;
        let grips = grips.get_or_init(|| Arc::new(TransferredGrips::of(&self.object, held)));
        (!grips.is_empty()).then(|| Arc::clone(grips))
    }

    /// The primitives' grips for a hand, and the slot of the grips transferred from them.
    fn transferred_grips_of(&self, hand: &Hand) -> Option<(&'static Arc<[HeldPrimitive]>, &GripsSlot)> {
        let all = || held_primitives().iter().zip(&*self.transferred_grips);
        let is_side = |of: &Hand| of.rig.handedness == hand.rig.handedness;
        let own = all().find(|((of, _), _)| **of == *hand);
        let of_other = || all().find(|((of, _), _)| !is_built_in(hand) && is_side(of));
        let ((_, held), grips) = own.or_else(of_other)?;
        Some((held, grips))
    }

    /// Its estimated size in bytes, with the placements and grips of two hands.
    pub(crate) fn bytes(&self) -> usize {
        self.object.derived_bytes() + 2 * TransferredGrips::MAX_BYTES
    }
}

/// Holds the data derived from an object.
#[derive(Debug, Default)]
pub(super) struct DerivedCell {
    kept: Mutex<Option<Arc<Derived>>>,
    /// Held while it is built, so that this is done once.
    building: Mutex<()>,
}

impl DerivedCell {
    /// The data, if kept.
    pub(super) fn get(&self) -> Option<Arc<Derived>> {
        locked(&self.kept).clone()
    }

    /// The data. Calls `build` unless it is kept, or another call builds it meanwhile.
    pub(super) fn get_or_build(
        &self,
        build: impl FnOnce() -> Result<Arc<Derived>, Stopped>,
    ) -> Result<Arc<Derived>, Stopped> {
        let _building = locked(&self.building);
        if let Some(kept) = self.get() {
            return Ok(kept);
        }
        let built = build()?;
        Ok(self.keep(built))
    }

    /// Keeps the data, unless there is some. The kept data.
    pub(super) fn keep(&self, derived: Arc<Derived>) -> Arc<Derived> {
        Arc::clone(locked(&self.kept).get_or_insert(derived))
    }

    /// Drops the data. Calls that use it are not disturbed.
    pub(super) fn forget(&self) {
        *locked(&self.kept) = None;
    }

    /// True if a call uses the data.
    pub(super) fn is_in_use(&self) -> bool {
        let kept = locked(&self.kept);
        kept.as_ref().is_some_and(|kept| Arc::strong_count(kept) > 1)
    }
}

/// Upper bound on the size of an object's derived data in bytes, for all but the oddest surfaces.
pub(super) fn expected_bytes(object: &PlainObject) -> usize {
    BYTES_BESIDES + BYTES_PER_TRIANGLE * object.mesh.triangles().len()
}

/// Size and mass of an object that differs from a stored one in nothing else.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ObjectSize {
    hundredths: u16,
    /// In kilograms.
    mass: f32,
}

impl ObjectSize {
    /// The requested size. `None` for the object as it is stored.
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

/// Prepares objects at other sizes, as many at a time as there are permits: each takes as much memory as building an object.
#[derive(Debug)]
pub(crate) struct Resizer(pub Arc<Semaphore>);

impl Resizer {
    /// The object in a slot, prepared unless it is kept; `rigs` has those of its grips. It stops when `due` or when the future is
    /// dropped. [`ServiceError::Invalid`] if the object cannot have this size.
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
fn resized(
    stored: &StoredObject,
    size: ObjectSize,
    rigs: &[Option<Rig>],
    stop: Stop<'_>,
) -> Result<StoredObject, ServiceError> {
    let base = stored.derived_until(stop)?;
    let object = match base.object.resized_until(size.scale(), size.mass, stop)? {
        Ok(object) => object,
        Err(error @ ResizeError::Mass(_)) => {
            return Err(ServiceError::invalid("holdout.mass_kg", error.to_string()));
        }
        Err(error @ ResizeError::Mesh(_)) => {
            return Err(ServiceError::invalid("holdout.scale", error.to_string()));
        }
    };
    check_resized(&object.mesh).map_err(|wrong| ServiceError::invalid("holdout.scale", wrong))?;
    let sizes = [base.object.object(), &object];
    let resized = StoredObject::new(
        stored.id.clone(),
        object.plain().clone(),
        stored.given.at_scale(size.scale(), sizes, rigs),
        Vec::new(),
        Arc::clone(&stored.file),
    );
    resized.fill(Arc::new(object), stop)?;
    Ok(resized)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::objects::tests::tetrahedron;

    #[test]
    fn a_prepared_hand_is_not_prepared_again() {
        let object = tetrahedron("any", 0.05, &[]);
        let derived = object.derived_until(Stop::NEVER).expect("nothing stops it");
        assert!(!derived.is_prepared("adult"));
        // Work that checks for a stop ends at once.
        let no_work = Stop::when(&|| true);
        assert_eq!(derived.prepare("adult", no_work), Err(Stopped));
        derived.prepare("adult", Stop::NEVER).expect("nothing stops it");
        assert!(derived.is_prepared("adult"));
        assert_eq!(derived.prepare("adult", no_work), Ok(()));
    }
}
