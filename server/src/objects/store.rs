//! Objects by name. Built-in ones and those of the objects directory stay; created ones stay while they fit.
//!
//! When a new object does not fit, created objects that no call uses are evicted, the least recently used first. The
//! error for an evicted object says that it was evicted, so that its client creates it again.

use std::{
    collections::{BTreeMap, VecDeque},
    ops::Bound,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::Duration,
};

use grasp_assets::objects::{object, objects};

use super::{StoredObject, name_of};
use crate::{
    error::{Limit, ServiceError},
    limits::StoreLimits,
};

/// Number of evicted ids that are remembered for error messages.
const REMEMBERED_EVICTIONS: usize = 1024;

/// When to retry if every object in the full cache is in use: searches end within seconds.
const RETRY_AFTER: Duration = Duration::from_secs(1);

/// All objects.
#[derive(Debug)]
pub(crate) struct ObjectStore {
    /// Objects that the server started with; never evicted.
    pinned: BTreeMap<String, Arc<StoredObject>>,
    created: Mutex<Created>,
    limits: StoreLimits,
}

#[derive(Debug, Default)]
struct Created {
    objects: BTreeMap<String, Entry>,
    bytes: usize,
    /// Number of uses so far: the clock of `last_used`.
    uses: u64,
    evicted: VecDeque<String>,
}

#[derive(Debug)]
struct Entry {
    object: Arc<StoredObject>,
    last_used: u64,
}

/// True if a built-in object has this id.
pub(crate) fn is_built_in(id: &str) -> bool {
    object(id).is_some()
}

impl ObjectStore {
    /// A store of the built-in objects and those of the objects directory, whose ids must all differ.
    pub(crate) fn new(limits: StoreLimits, directory: Vec<StoredObject>) -> Self {
        let built_in = objects().iter().map(|built_in| {
            let id = built_in.name.to_owned();
            StoredObject::new(id, true, Arc::clone(&built_in.object), Vec::new())
        });
        Self {
            pinned: built_in
                .chain(directory)
                .map(|object| (object.id.clone(), Arc::new(object)))
                .collect(),
            created: Mutex::default(),
            limits,
        }
    }

    /// The objects that the server started with.
    pub(crate) fn pinned(&self) -> impl Iterator<Item = &Arc<StoredObject>> {
        self.pinned.values()
    }

    /// Bytes of the limit that created objects do not use.
    pub(crate) fn room(&self) -> usize {
        self.limits.bytes.saturating_sub(self.created().bytes)
    }

    /// True if an object has this id.
    pub(crate) fn contains(&self, id: &str) -> bool {
        self.pinned.contains_key(id) || self.created().objects.contains_key(id)
    }

    /// The object with this id. It is not evicted while its `object` is held.
    ///
    /// # Errors
    /// [`ServiceError::ObjectNotFound`].
    pub(crate) fn get(&self, id: &str) -> Result<Arc<StoredObject>, ServiceError> {
        if let Some(object) = self.pinned.get(id) {
            return Ok(Arc::clone(object));
        }
        let mut created = self.created();
        created.uses += 1;
        let now = created.uses;
        match created.objects.get_mut(id) {
            Some(entry) => {
                entry.last_used = now;
                Ok(Arc::clone(&entry.object))
            }
            None => Err(ServiceError::ObjectNotFound {
                name: name_of(id),
                evicted: created.evicted.iter().any(|evicted| evicted == id),
            }),
        }
    }

    /// Adds an object, evicting others if necessary.
    ///
    /// # Errors
    /// - [`ServiceError::ObjectExists`] if the id is taken.
    /// - [`ServiceError::Invalid`] if it is larger than the whole cache.
    /// - [`ServiceError::Overloaded`] if the objects that would have to be evicted are in use.
    pub(crate) fn insert(&self, object: StoredObject) -> Result<Arc<StoredObject>, ServiceError> {
        let bytes = object.bytes();
        if bytes > self.limits.bytes {
            return Err(ServiceError::invalid(
                "mesh",
                format!(
                    "takes about {bytes} bytes with its search structures; the cache holds {}",
                    self.limits.bytes
                ),
            ));
        }
        let mut created = self.created();
        if self.pinned.contains_key(&object.id) || created.objects.contains_key(&object.id) {
            return Err(ServiceError::ObjectExists { name: object.name() });
        }
        while created.objects.len() >= self.limits.objects || created.bytes + bytes > self.limits.bytes {
            if !created.evict_one() {
                return Err(ServiceError::Overloaded {
                    limit: Limit::ObjectCache,
                    maximum: self.limits.objects,
                    retry_after: RETRY_AFTER,
                });
            }
        }
        let object = Arc::new(object);
        created.uses += 1;
        created.bytes += bytes;
        let entry = Entry {
            object: Arc::clone(&object),
            last_used: created.uses,
        };
        created.evicted.retain(|id| *id != object.id);
        created.objects.insert(object.id.clone(), entry);
        Ok(object)
    }

    /// Up to `size` objects ordered by name, starting after `after`, and whether there are more.
    pub(crate) fn page(&self, after: Option<&str>, size: usize) -> (Vec<Arc<StoredObject>>, bool) {
        let from = (after.map_or(Bound::Unbounded, Bound::Excluded), Bound::Unbounded);
        let created = self.created();
        // One more than fits on the page shows whether there is another page.
        let mut objects: Vec<_> = self
            .pinned
            .range::<str, _>(from)
            .map(|(_, object)| object)
            .take(size + 1)
            .chain(
                created
                    .objects
                    .range::<str, _>(from)
                    .map(|(_, entry)| &entry.object)
                    .take(size + 1),
            )
            .map(Arc::clone)
            .collect();
        objects.sort_by(|a, b| a.id.cmp(&b.id));
        let more = objects.len() > size;
        objects.truncate(size);
        (objects, more)
    }

    fn created(&self) -> MutexGuard<'_, Created> {
        // No code panics while it holds the lock; if some did, the map would still be consistent.
        self.created.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Created {
    /// Evicts the least recently used object that no call uses. False if there is none.
    fn evict_one(&mut self) -> bool {
        let oldest = self
            .objects
            .iter()
            .filter(|(_, entry)| !entry.object.is_in_use())
            .min_by_key(|(_, entry)| entry.last_used)
            .map(|(id, _)| id.clone());
        let Some((id, entry)) = oldest.and_then(|id| self.objects.remove_entry(&id)) else {
            return false;
        };
        self.bytes -= entry.object.bytes();
        if self.evicted.len() == REMEMBERED_EVICTIONS {
            self.evicted.pop_front();
        }
        self.evicted.push_back(id);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::objects::tests::tetrahedron;

    fn store(objects: usize, tetrahedra: usize) -> ObjectStore {
        let bytes = tetrahedra * tetrahedron("any", 1.0, &[]).bytes();
        ObjectStore::new(StoreLimits { objects, bytes }, Vec::new())
    }

    fn insert(store: &ObjectStore, id: &str) -> Result<(), ServiceError> {
        store.insert(tetrahedron(id, 1.0, &[])).map(|_| ())
    }

    #[test]
    fn evicts_least_recently_used_by_count_and_by_bytes() {
        for store in [store(2, 100), store(100, 2)] {
            insert(&store, "a").unwrap();
            insert(&store, "b").unwrap();
            store.get("a").unwrap();
            insert(&store, "c").unwrap();
            assert!(store.contains("a") && store.contains("c"));
            assert_eq!(
                store.get("b").unwrap_err(),
                ServiceError::ObjectNotFound {
                    name: "objects/b".into(),
                    evicted: true
                }
            );
            assert_eq!(
                store.get("z").unwrap_err(),
                ServiceError::ObjectNotFound {
                    name: "objects/z".into(),
                    evicted: false
                }
            );
            // An evicted object can be created again.
            insert(&store, "b").unwrap();
            store.get("b").unwrap();
        }
    }

    #[test]
    fn keeps_objects_in_use() {
        let store = store(2, 100);
        insert(&store, "a").unwrap();
        insert(&store, "b").unwrap();
        let a = Arc::clone(&store.get("a").unwrap().object);
        let b = Arc::clone(&store.get("b").unwrap().object);
        // Listing an object does not use it.
        let looked_at = store.page(None, 10);
        assert!(matches!(
            insert(&store, "c"),
            Err(ServiceError::Overloaded {
                limit: Limit::ObjectCache,
                ..
            })
        ));
        drop(b);
        insert(&store, "c").unwrap();
        drop(looked_at);
        assert!(store.contains("a") && !store.contains("b"));
        drop(a);
    }

    #[test]
    fn rejects_objects_larger_than_the_cache() {
        let limits = StoreLimits {
            objects: 10,
            bytes: 10,
        };
        let store = ObjectStore::new(limits, Vec::new());
        assert!(matches!(insert(&store, "a"), Err(ServiceError::Invalid(_))));
    }

    #[test]
    fn directory_objects_stay_and_do_not_count() {
        let limits = StoreLimits {
            objects: 1,
            bytes: tetrahedron("any", 1.0, &[]).bytes(),
        };
        let store = ObjectStore::new(limits, vec![tetrahedron("stay", 1.0, &[])]);
        for id in ["a", "b"] {
            insert(&store, id).unwrap();
        }
        assert!(store.contains("stay") && store.contains("b") && !store.contains("a"));
        assert!(matches!(
            insert(&store, "stay"),
            Err(ServiceError::ObjectExists { .. })
        ));
        let listed: Vec<String> = store.page(None, 100).0.iter().map(|o| o.id.clone()).collect();
        assert_eq!(listed, ["b", "remote", "scalpel", "scissors", "stay"]);
    }

    #[test]
    fn rejects_a_taken_id() {
        let store = store(10, 10);
        insert(&store, "a").unwrap();
        assert_eq!(
            insert(&store, "a"),
            Err(ServiceError::ObjectExists {
                name: "objects/a".into()
            })
        );
    }

    #[test]
    fn pages_list_every_object_once() {
        let store = store(10, 10);
        for id in ["e", "a", "d", "b", "c"] {
            insert(&store, id).unwrap();
        }
        let everything: Vec<String> = store.page(None, 1000).0.iter().map(|o| o.id.clone()).collect();
        for size in 1..=everything.len() + 1 {
            let mut seen: Vec<String> = Vec::new();
            loop {
                let (objects, more) = store.page(seen.last().map(String::as_str), size);
                assert!(objects.len() <= size && (objects.len() == size || !more));
                seen.extend(objects.iter().map(|o| o.id.clone()));
                if !more {
                    break;
                }
            }
            assert_eq!(seen, everything);
        }
        assert!(everything.is_sorted() && everything.len() >= 5);
    }
}
