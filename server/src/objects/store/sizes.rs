//! Objects at other sizes than their own, as requests ask for them. They share the bytes of created objects, for which they make
//! room first.

use std::sync::{Arc, OnceLock, Weak};

use super::{Created, ObjectStore, RETRY_AFTER};
use crate::{
    error::{Limit, ServiceError},
    objects::{StoredObject, resized::ObjectSize},
};

/// Largest number of kept sizes of an object. With more in turn, each call prepares the object again.
const SIZES_PER_OBJECT: usize = 8;

/// Where an object at another size is kept once it is prepared.
pub(crate) type SizeSlot = Arc<OnceLock<Arc<StoredObject>>>;

/// An object at another size.
#[derive(Debug)]
pub(super) struct Resized {
    /// The object at its own size.
    of: Weak<StoredObject>,
    id: String,
    size: ObjectSize,
    bytes: usize,
    slot: SizeSlot,
}

impl Resized {
    /// True if a call prepares or searches it: evicting it would free nothing.
    fn is_in_use(&self) -> bool {
        Arc::strong_count(&self.slot) > 1 || self.slot.get().is_some_and(|object| object.is_in_use())
    }
}

/// The kept sizes of all objects, the least recently used first.
#[derive(Debug, Default)]
pub(super) struct Sizes(Vec<Resized>);

impl ObjectStore {
    /// The place of an object at another size, which the caller fills if it is empty. It counts as that of the object itself,
    /// evicting others if necessary.
    ///
    /// # Errors
    /// - [`ServiceError::Invalid`] if both sizes are larger than the whole cache.
    /// - [`ServiceError::Overloaded`] if what would have to be evicted is in use.
    pub(crate) fn resized(
        &self,
        stored: &Arc<StoredObject>,
        size: ObjectSize,
    ) -> Result<SizeSlot, ServiceError> {
        let mut created = self.created();
        let sizes = &mut created.sizes.0;
        let is_same = |kept: &Resized| kept.size == size && kept.of.as_ptr() == Arc::as_ptr(stored);
        if let Some(place) = sizes.iter().position(is_same) {
            let kept = sizes.remove(place);
            let slot = Arc::clone(&kept.slot);
            sizes.push(kept);
            return Ok(slot);
        }
        let of_object = |kept: &Resized| kept.id == stored.id;
        if sizes.iter().filter(|kept| of_object(kept)).count() >= SIZES_PER_OBJECT
            && !created.evict_size(of_object)
        {
            return Err(self.every_size_is_in_use());
        }
        let bytes = stored.derived_and_own_bytes();
        let own = if created.objects.contains_key(&stored.id) {
            bytes
        } else {
            0
        };
        if own + bytes > self.limits.bytes {
            return Err(ServiceError::invalid(
                "holdout.scale",
                format!(
                    "takes about {bytes} bytes beside the object at its own size; the cache holds {}",
                    self.limits.bytes
                ),
            ));
        }
        while created.taken() + bytes > self.limits.bytes {
            if !created.evict_derived_or_size() && !created.evict_one(Some(&stored.id)) {
                return Err(self.every_size_is_in_use());
            }
        }
        let slot = SizeSlot::default();
        created.bytes += bytes;
        created.sizes.0.push(Resized {
            of: Arc::downgrade(stored),
            id: stored.id.clone(),
            size,
            bytes,
            slot: Arc::clone(&slot),
        });
        Ok(slot)
    }

    fn every_size_is_in_use(&self) -> ServiceError {
        ServiceError::Overloaded {
            limit: Limit::ObjectCache,
            maximum: self.limits.objects,
            retry_after: RETRY_AFTER,
        }
    }
}

impl Created {
    /// Evicts the least recently used size that no call uses, of those that `may_go` accepts. False if there is none.
    pub(super) fn evict_size(&mut self, may_go: impl Fn(&Resized) -> bool) -> bool {
        let place = self
            .sizes
            .0
            .iter()
            .position(|kept| !kept.is_in_use() && may_go(kept));
        if let Some(place) = place {
            self.bytes -= self.sizes.0.remove(place).bytes;
        }
        place.is_some()
    }

    /// Drops the sizes of an object that is changed or gone.
    pub(super) fn drop_sizes(&mut self, id: &str) {
        let bytes = &mut self.bytes;
        self.sizes.0.retain(|kept| {
            let stays = kept.id != id;
            if !stays {
                *bytes -= kept.bytes;
            }
            stays
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        limits::StoreLimits,
        objects::{store::Origin, tests::tetrahedron},
        validate::{Labels, ObjectChange, RequestedSize},
    };

    /// A store with room for so many tetrahedra, with what is derived from them.
    fn store(tetrahedra: usize) -> ObjectStore {
        store_of(tetrahedra * tetrahedron("any", 1.0, &[]).derived_and_own_bytes())
    }

    fn store_of(bytes: usize) -> ObjectStore {
        ObjectStore::new(StoreLimits { objects: 100, bytes }, Vec::new(), None)
    }

    fn insert(store: &ObjectStore, id: &str) -> Arc<StoredObject> {
        let created = store.insert(tetrahedron(id, 1.0, &[]), Origin::default());
        let created = created.expect("it fits");
        Arc::clone(created.object().expect("it is loaded"))
    }

    fn size(of: &StoredObject, hundredths: u16) -> ObjectSize {
        let requested = RequestedSize {
            hundredths,
            mass: None,
        };
        ObjectSize::of(requested, of).expect("it is another size")
    }

    #[test]
    fn the_same_size_is_kept_once_and_belongs_to_one_state_of_its_object() {
        let store = store(10);
        let a = insert(&store, "a");
        let first = store.resized(&a, size(&a, 50)).unwrap();
        assert!(Arc::ptr_eq(&first, &store.resized(&a, size(&a, 50)).unwrap()));
        assert!(!Arc::ptr_eq(&first, &store.resized(&a, size(&a, 200)).unwrap()));
        let base = store.changeable("a", None).unwrap();
        let changed = store
            .replace(
                &base,
                Labels::new(),
                Some((tetrahedron("a", 1.0, &[1]), &ObjectChange::default())),
            )
            .unwrap();
        let changed = changed.object().expect("it is loaded");
        assert!(!Arc::ptr_eq(
            &first,
            &store.resized(changed, size(&a, 50)).unwrap()
        ));
    }

    #[test]
    fn sizes_count_and_make_room_before_objects_do() {
        let one = tetrahedron("any", 1.0, &[]);
        let (at_rest, sized) = (one.bytes(), one.derived_and_own_bytes());
        let store = store_of(at_rest + 2 * sized);
        let a = insert(&store, "a");
        drop(store.resized(&a, size(&a, 50)).unwrap());
        assert_eq!(store.room(), sized);
        drop(store.resized(&a, size(&a, 200)).unwrap());
        assert_eq!(store.room(), 0);
        insert(&store, "b");
        assert!(store.contains("a") && store.contains("b"));
        assert_eq!(store.room(), sized - at_rest);
        // Whatever is of an object goes with it.
        store.remove("a", None).unwrap();
        assert_eq!(store.room(), 2 * sized);
    }

    #[test]
    fn sizes_in_use_stay_and_are_bounded_by_bytes_and_number() {
        let small = store(2);
        let a = insert(&small, "a");
        let used = small.resized(&a, size(&a, 50)).unwrap();
        let refused = small.resized(&a, size(&a, 200)).unwrap_err();
        assert!(matches!(refused, ServiceError::Overloaded { .. }), "{refused}");
        drop(used);
        assert!(small.resized(&a, size(&a, 200)).is_ok());

        let ample = store(100);
        let a = insert(&ample, "a");
        let whole = ample.room();
        for hundredths in 101..150 {
            drop(ample.resized(&a, size(&a, hundredths)).unwrap());
        }
        assert_eq!(ample.room(), whole - SIZES_PER_OBJECT * a.derived_and_own_bytes());
    }

    #[test]
    fn an_object_that_fills_the_cache_has_one_size() {
        let store = store(1);
        let a = insert(&store, "a");
        let refused = store.resized(&a, size(&a, 50)).unwrap_err();
        assert!(matches!(refused, ServiceError::Invalid(_)), "{refused}");
        assert!(store.contains("a"));
    }
}
