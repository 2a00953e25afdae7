//! What is kept in the cache, and what is dropped first.

use super::*;
use crate::{
    limits::StoreLimits,
    objects::{store::Origin, tests::tetrahedron},
    validate::{Labels, RequestedSize},
};

impl ObjectStore {
    /// True if the sum of bytes is that of the objects in memory, however they came and went.
    pub(crate) fn counts_rightly(&self) -> bool {
        let created = self.created();
        let states = created.objects.values().map(|entry| &entry.state);
        let (bytes, loaded) = states.fold((0, 0), |(bytes, loaded), state| {
            (
                bytes + state.bytes(),
                loaded + usize::from(state.object().is_some()),
            )
        });
        (created.bytes, created.loaded) == (bytes, loaded)
    }

    /// Drops what can be made again until no more than `bytes` are taken.
    pub(crate) fn shrink_to(&self, bytes: usize) {
        let mut created = self.created();
        created.cache.retain(Item::is_there);
        while created.taken() > bytes && created.cache.evict(|_| true) {}
    }
}

fn store_of(bytes: usize) -> ObjectStore {
    ObjectStore::new(StoreLimits { objects: 100, bytes }, Vec::new(), None)
}

/// A store with room for so many tetrahedra, with what is derived from them.
fn store(tetrahedra: usize) -> ObjectStore {
    store_of(tetrahedra * tetrahedron("any", 1.0, &[]).derived_and_own_bytes())
}

fn insert(store: &ObjectStore, object: StoredObject) -> Arc<StoredObject> {
    let created = store.insert(object, Origin::default()).expect("it fits");
    Arc::clone(created.object().expect("it is loaded"))
}

/// A created object whose content is its own.
fn insert_numbered(store: &ObjectStore, number: u16) -> Arc<StoredObject> {
    let edge = 0.02 + 1e-4 * f32::from(number);
    insert(store, tetrahedron(&format!("o{number}"), edge, &[]))
}

fn derive(store: &ObjectStore, object: &Arc<StoredObject>, need: Need) -> Arc<Derived> {
    store.derived(object, need, Stop::NEVER).expect("it fits")
}

fn is_kept(object: &StoredObject) -> bool {
    object.derived.get().is_some()
}

fn size(of: &StoredObject, hundredths: u16) -> ObjectSize {
    let requested = RequestedSize {
        hundredths,
        mass: None,
    };
    ObjectSize::of(requested, of).expect("it is another size")
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
    let a = insert_numbered(&store, 0);
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
    let any = Arc::new(tetrahedron("any", 0.02, &[]));
    let bytes = derive(&store_of(1 << 30), &any, Need::Call).bytes();
    let store = store_of(5 * bytes / 2);
    let [a, b, c, d] = [0, 1, 2, 3].map(|number| insert_numbered(&store, number));
    drop(derive(&store, &a, Need::Call));
    drop(derive(&store, &b, Need::Call));
    // What nobody requested goes first.
    drop(derive(&store, &a, Need::Call));
    drop(derive(&store, &c, Need::Ahead));
    assert_eq!([&a, &b, &c].map(|object| is_kept(object)), [true, false, true]);
    let used = derive(&store, &d, Need::Call);
    assert_eq!([&a, &c, &d].map(|object| is_kept(object)), [true, false, true]);
    store.shrink_to(0);
    assert_eq!([&a, &d].map(|object| is_kept(object)), [false, true]);
    assert!([&a, &b, &c, &d].iter().all(|object| store.contains(&object.id)));
    drop(used);
}

#[test]
fn only_the_newest_are_kept_that_nobody_asked_for() {
    let store = store_of(1 << 30);
    let numbers = 0..KEPT_AHEAD as u16 + 3;
    let objects: Vec<_> = numbers.map(|number| insert_numbered(&store, number)).collect();
    drop(derive(&store, &objects[0], Need::Call));
    for object in &objects {
        drop(derive(&store, object, Need::Ahead));
    }
    let places = 0..objects.len();
    let dropped: Vec<usize> = places.filter(|&place| !is_kept(&objects[place])).collect();
    assert_eq!(dropped, [1, 2]);
}

#[test]
fn objects_of_one_content_share_what_is_derived() {
    let store = store_of(1 << 30);
    let [a, b] = ["a", "b"].map(|id| insert(&store, tetrahedron(id, 0.05, &[])));
    let [of_a, of_b] = [&a, &b].map(|object| derive(&store, object, Need::Call));
    assert!(Arc::ptr_eq(&of_a.object, &of_b.object));
    let other = insert(&store, tetrahedron("c", 0.05, &[1]));
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

#[test]
fn the_same_size_is_kept_once_and_belongs_to_one_state_of_its_object() {
    let store = store(10);
    let a = insert(&store, tetrahedron("a", 1.0, &[]));
    let first = store.resized(&a, size(&a, 50)).unwrap();
    assert!(Arc::ptr_eq(&first, &store.resized(&a, size(&a, 50)).unwrap()));
    assert!(!Arc::ptr_eq(&first, &store.resized(&a, size(&a, 200)).unwrap()));
    let base = store.changeable("a", None).unwrap();
    let changed = tetrahedron("a", 1.0, &[1]);
    let changed = store.replace(&base, Labels::new(), Some(changed)).unwrap();
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
    let taken = || store.created().taken();
    let a = insert(&store, tetrahedron("a", 1.0, &[]));
    for (hundredths, sizes) in [(50, 1), (200, 2)] {
        drop(store.resized(&a, size(&a, hundredths)).unwrap());
        assert_eq!(taken(), at_rest + sizes * sized);
    }
    insert(&store, tetrahedron("b", 1.0, &[]));
    assert!(store.contains("a") && store.contains("b"));
    assert_eq!(taken(), 2 * at_rest + sized);
    // Whatever is of an object goes with it.
    store.remove("a", None).unwrap();
    assert_eq!(taken(), at_rest);
}

#[test]
fn sizes_in_use_stay_and_are_bounded_by_bytes_and_number() {
    let small = store(2);
    let a = insert(&small, tetrahedron("a", 1.0, &[]));
    let used = small.resized(&a, size(&a, 50)).unwrap();
    let refused = small.resized(&a, size(&a, 200)).unwrap_err();
    assert!(matches!(refused, ServiceError::Overloaded { .. }), "{refused}");
    drop(used);
    assert!(small.resized(&a, size(&a, 200)).is_ok());

    let ample = store(100);
    let a = insert(&ample, tetrahedron("a", 1.0, &[]));
    for hundredths in 101..150 {
        drop(ample.resized(&a, size(&a, hundredths)).unwrap());
    }
    let of_sizes = SIZES_PER_OBJECT * a.derived_and_own_bytes();
    assert_eq!(ample.created().taken(), a.bytes() + of_sizes);
}

#[test]
fn an_object_that_fills_the_cache_has_one_size() {
    let store = store(1);
    let a = insert(&store, tetrahedron("a", 1.0, &[]));
    let refused = store.resized(&a, size(&a, 50)).unwrap_err();
    assert!(matches!(refused, ServiceError::Invalid(_)), "{refused}");
    assert!(store.contains("a"));
}
