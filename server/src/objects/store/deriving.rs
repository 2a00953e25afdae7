//! What is derived from created objects, within the bounds of the cache: it takes what objects at rest leave, and makes room before
//! any of them.

use std::sync::{Arc, Weak};

use grasp_synthesis::base::stop::Stop;

use super::{Created, ObjectStore, RETRY_AFTER};
use crate::{
    error::{Limit, ServiceError},
    objects::{Derived, StoredObject, name_of},
};

/// Largest number of objects for which it is kept although no call asked for it: the newest ones, whose first calls are likely
/// soon. More make those calls faster when thousands of objects are created at once, and take their memory.
const KEPT_AHEAD: usize = 32;

/// Why something is derived.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Need {
    /// A call waits for it.
    Call,
    /// A call may ask for it soon, or an atlas grows from it.
    Ahead,
}

/// What is derived from one created object.
#[derive(Debug)]
struct Kept {
    of: Weak<StoredObject>,
    /// Its size in bytes when it was built.
    bytes: usize,
}

/// What is derived from created objects, in the order in which it was built.
#[derive(Debug, Default)]
pub(super) struct Kepts {
    list: Vec<Kept>,
    /// The sum of its sizes in bytes.
    bytes: usize,
}

impl ObjectStore {
    /// What is derived from an object, built if necessary, in which case less needed makes room. An object that the server started
    /// with keeps it outside of the cache.
    ///
    /// # Errors
    /// - [`ServiceError::ObjectUnloadable`] if it takes more than the whole cache.
    /// - [`ServiceError::Overloaded`] if what would have to make room is in use.
    /// - [`ServiceError::Cancelled`] if it was stopped.
    pub(crate) fn derived(
        &self,
        object: &Arc<StoredObject>,
        need: Need,
        stop: Stop<'_>,
    ) -> Result<Arc<Derived>, ServiceError> {
        if let Some(kept) = self.kept(object, need) {
            return Ok(kept);
        }
        let twin = self.created().derived_of_twin(object);
        let derived = match twin {
            Some(twin) => object.share(&twin),
            None => object.derived_until(stop)?,
        };
        let mut created = self.created();
        created.note_use(object, need);
        let is_created = created
            .objects
            .get(&object.id)
            .and_then(|entry| entry.state.object())
            .is_some_and(|of| Arc::ptr_eq(of, object));
        if is_created && !created.derived.has(object) {
            let fits = self.keep(&mut created, object, derived.bytes());
            fits.inspect_err(|_| object.derived.forget())?;
        }
        Ok(derived)
    }

    /// Checks that a new object fits in the cache with what will be derived from it.
    ///
    /// # Errors
    /// [`ServiceError::Invalid`].
    pub(crate) fn check_size(&self, object: &StoredObject) -> Result<(), ServiceError> {
        let whole = object.derived_and_own_bytes();
        if whole <= self.limits.bytes {
            return Ok(());
        }
        Err(ServiceError::invalid(
            "mesh",
            format!(
                "takes about {whole} bytes with the object's search structures; the cache holds {}",
                self.limits.bytes
            ),
        ))
    }

    /// What was derived from an object, if it is kept.
    pub(crate) fn kept(&self, object: &Arc<StoredObject>, need: Need) -> Option<Arc<Derived>> {
        let kept = object.derived.get()?;
        self.created().note_use(object, need);
        Some(kept)
    }

    /// Number of created objects for which it is kept.
    pub(crate) fn prepared(&self) -> usize {
        self.created().derived.list.len()
    }

    /// Counts what was derived, and drops what is needed less until it fits.
    fn keep(
        &self,
        created: &mut Created,
        object: &Arc<StoredObject>,
        bytes: usize,
    ) -> Result<(), ServiceError> {
        let whole = object.bytes() + bytes;
        if whole > self.limits.bytes {
            return Err(ServiceError::ObjectUnloadable {
                name: name_of(&object.id),
                reason: format!(
                    "it takes about {whole} bytes with its search structures; the cache holds {}",
                    self.limits.bytes
                ),
            });
        }
        while created.taken() + bytes > self.limits.bytes {
            if !created.evict_derived_or_size() && !created.evict_one(Some(&object.id)) {
                return Err(ServiceError::Overloaded {
                    limit: Limit::ObjectCache,
                    maximum: self.limits.objects,
                    retry_after: RETRY_AFTER,
                });
            }
        }
        created.derived.bytes += bytes;
        created.derived.list.push(Kept {
            of: Arc::downgrade(object),
            bytes,
        });
        created.derived.drop_oldest_ahead();
        Ok(())
    }

    /// Drops what is derived and not in use until `bytes` more fit in the cache, or nothing is left.
    pub(crate) fn leave(&self, bytes: usize) {
        let mut created = self.created();
        while created.taken() + bytes > self.limits.bytes && created.derived.evict() {}
    }
}

impl Created {
    /// Bytes of the cache in use.
    pub(super) fn taken(&self) -> usize {
        self.bytes + self.derived.bytes
    }

    /// Makes room by what is derived from an object and was asked for least recently, or by an object at another size. False if
    /// all of them are in use.
    pub(super) fn evict_derived_or_size(&mut self) -> bool {
        self.derived.evict() || self.evict_size(|_| true)
    }

    fn note_use(&mut self, object: &StoredObject, need: Need) {
        if need == Need::Call {
            self.uses += 1;
            object.derived.use_at(self.uses);
        }
    }

    fn derived_of_twin(&self, object: &StoredObject) -> Option<Arc<Derived>> {
        let mut kept = self.derived.list.iter().filter_map(|kept| kept.of.upgrade());
        kept.find(|other| other.derives_as(object))?.derived.get()
    }
}

impl Kepts {
    /// Bytes of what no call uses.
    pub(super) fn unused_bytes(&self) -> usize {
        let unused = self.list.iter().filter(|kept| kept.is_unused());
        unused.map(|kept| kept.bytes).sum()
    }

    /// Forgets what belongs to an object that is gone.
    pub(super) fn forget(&mut self, object: &Arc<StoredObject>) {
        if let Some(place) = self.place_of(object) {
            self.bytes -= self.list.remove(place).bytes;
        }
    }

    fn has(&self, object: &Arc<StoredObject>) -> bool {
        self.place_of(object).is_some()
    }

    fn place_of(&self, object: &Arc<StoredObject>) -> Option<usize> {
        self.list
            .iter()
            .position(|kept| kept.of.as_ptr() == Arc::as_ptr(object))
    }

    /// Drops what was asked for least recently, the oldest first of what nobody asked for. False if all is in use.
    fn evict(&mut self) -> bool {
        let unused = self.list.iter().enumerate().filter(|(_, kept)| kept.is_unused());
        let first = unused.min_by_key(|(_, kept)| kept.last_used());
        let Some((place, _)) = first else { return false };
        self.drop_at(place);
        true
    }

    /// Drops the oldest of what nobody asked for if there is too much of it.
    fn drop_oldest_ahead(&mut self) {
        let ahead = self
            .list
            .iter()
            .enumerate()
            .filter(|(_, kept)| kept.last_used() == 0);
        let ahead: Vec<usize> = ahead.map(|(place, _)| place).collect();
        let surplus = ahead.len().saturating_sub(KEPT_AHEAD);
        for &place in ahead[..surplus].iter().rev() {
            if self.list[place].is_unused() {
                self.drop_at(place);
            }
        }
    }

    fn drop_at(&mut self, place: usize) {
        let dropped = self.list.remove(place);
        self.bytes -= dropped.bytes;
        if let Some(object) = dropped.of.upgrade() {
            object.derived.forget();
        }
    }
}

impl Kept {
    fn is_unused(&self) -> bool {
        self.of.upgrade().is_none_or(|object| !object.is_in_use())
    }

    fn last_used(&self) -> u64 {
        self.of.upgrade().map_or(0, |object| object.derived.last_used())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        limits::StoreLimits,
        objects::{store::Origin, tests::tetrahedron},
    };

    fn store_of(bytes: usize) -> ObjectStore {
        ObjectStore::new(StoreLimits { objects: 100, bytes }, Vec::new(), None)
    }

    /// A created object whose content is its own.
    fn insert(store: &ObjectStore, number: u16) -> Arc<StoredObject> {
        let object = tetrahedron(&format!("o{number}"), 0.02 + 1e-4 * f32::from(number), &[]);
        let created = store.insert(object, Origin::default()).expect("it fits");
        Arc::clone(created.object().expect("it is loaded"))
    }

    fn derive(store: &ObjectStore, object: &Arc<StoredObject>, need: Need) -> Arc<Derived> {
        store.derived(object, need, Stop::NEVER).expect("it fits")
    }

    fn is_kept(object: &StoredObject) -> bool {
        object.derived.get().is_some()
    }

    #[test]
    fn an_object_at_rest_takes_little_more_than_its_mesh() {
        let object = tetrahedron("any", 0.05, &[]);
        let mesh = &object.object.mesh;
        let of_mesh = size_of_val(mesh.positions()) + size_of_val(mesh.triangles());
        assert!(object.bytes() <= 3 * of_mesh + (64 << 10), "{}", object.bytes());
        assert!(!is_kept(&object));
    }

    #[test]
    fn what_is_derived_is_built_once_and_counts_until_it_is_dropped() {
        let store = store_of(1 << 30);
        let a = insert(&store, 0);
        let at_rest = store.created().taken();
        let (first, second) = (derive(&store, &a, Need::Call), derive(&store, &a, Need::Call));
        assert!(Arc::ptr_eq(&first, &second));
        assert_eq!(store.created().taken(), at_rest + first.bytes());
        drop((first, second));
        store.remove(&a.id, None).expect("it is there");
        assert_eq!(store.created().taken(), 0);
    }

    #[test]
    fn what_was_asked_for_least_recently_is_dropped_before_any_object() {
        let bytes = derive(
            &store_of(1 << 30),
            &Arc::new(tetrahedron("any", 0.02, &[])),
            Need::Call,
        )
        .bytes();
        let store = store_of(5 * bytes / 2);
        let [a, b, c, d] = [0, 1, 2, 3].map(|number| insert(&store, number));
        drop(derive(&store, &a, Need::Call));
        drop(derive(&store, &b, Need::Call));
        // What nobody asked for goes first.
        drop(derive(&store, &a, Need::Call));
        drop(derive(&store, &c, Need::Ahead));
        assert_eq!([&a, &b, &c].map(|object| is_kept(object)), [true, false, true]);
        let used = derive(&store, &d, Need::Call);
        assert_eq!([&a, &c, &d].map(|object| is_kept(object)), [true, false, true]);
        store.leave(2 * bytes);
        assert_eq!([&a, &d].map(|object| is_kept(object)), [false, true]);
        assert!([&a, &b, &c, &d].iter().all(|object| store.contains(&object.id)));
        drop(used);
    }

    #[test]
    fn only_the_newest_are_kept_that_nobody_asked_for() {
        let store = store_of(1 << 30);
        let objects: Vec<_> = (0..KEPT_AHEAD as u16 + 3)
            .map(|number| insert(&store, number))
            .collect();
        drop(derive(&store, &objects[0], Need::Call));
        for object in &objects {
            drop(derive(&store, object, Need::Ahead));
        }
        let dropped: Vec<usize> = (0..objects.len())
            .filter(|&place| !is_kept(&objects[place]))
            .collect();
        assert_eq!(dropped, [1, 2]);
    }

    #[test]
    fn objects_of_one_content_share_it() {
        let store = store_of(1 << 30);
        let [a, b] = ["a", "b"].map(|id| {
            let created = store.insert(tetrahedron(id, 0.05, &[]), Origin::default());
            Arc::clone(created.expect("it fits").object().expect("it is loaded"))
        });
        let [of_a, of_b] = [&a, &b].map(|object| derive(&store, object, Need::Call));
        assert!(Arc::ptr_eq(&of_a.object, &of_b.object));
        let other = store.insert(tetrahedron("c", 0.05, &[1]), Origin::default());
        let other = Arc::clone(other.expect("it fits").object().expect("it is loaded"));
        let of_other = derive(&store, &other, Need::Call);
        assert!(!Arc::ptr_eq(&of_a.object, &of_other.object));
    }

    #[test]
    fn an_object_too_large_for_the_cache_is_refused_at_once() {
        let object = tetrahedron("any", 0.05, &[]);
        let refused = store_of(1 << 12).check_size(&object);
        assert!(matches!(refused, Err(ServiceError::Invalid(_))), "{refused:?}");
        assert_eq!(store_of(1 << 30).check_size(&object), Ok(()));
    }
}
