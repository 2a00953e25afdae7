//! The store on its own; [`saved`](crate::objects::saved) compares it with a plain map.

use grasp_proto::v1;
use grasp_synthesis::base::stop::Stop;
use uuid::Uuid;

use super::{
    cache::{Item, KEPT_AHEAD, SIZES_PER_OBJECT},
    *,
};
use crate::{
    access::Caller,
    objects::{Derived, derived::ObjectSize, tests::tetrahedron},
    validate::{RequestedSize, page_query},
};

fn store(objects: usize, tetrahedra: usize) -> ObjectStore {
    let bytes = tetrahedra * tetrahedron("any", 1.0, &[]).bytes();
    ObjectStore::new(StoreLimits { objects, bytes }, Vec::new(), None)
}

fn list(size: i32, order_by: &str) -> PageQuery {
    let request = v1::ListObjectsRequest {
        page_size: size,
        order_by: order_by.to_owned(),
        ..Default::default()
    };
    page_query(&request).unwrap()
}

fn all_ids(store: &ObjectStore) -> Vec<String> {
    let (page, more) = store.page(&list(1000, ""));
    assert!(!more);
    page.iter().map(|state| state.id().to_owned()).collect()
}

fn insert(store: &ObjectStore, id: &str) -> Result<(), ServiceError> {
    store
        .insert(tetrahedron(id, 1.0, &[]), Origin::default())
        .map(|_| ())
}

#[test]
fn evicts_least_recently_used_by_count_and_by_bytes() {
    for store in [store(2, 100), store(100, 2)] {
        insert(&store, "a").unwrap();
        insert(&store, "b").unwrap();
        store.get("a").unwrap();
        insert(&store, "c").unwrap();
        assert!(store.contains("a") && store.contains("c"));
        for (id, evicted) in [("b", true), ("z", false)] {
            let name = name_of(id);
            let expected = ServiceError::ObjectNotFound { name, evicted };
            assert_eq!(store.get(id).unwrap_err(), expected);
        }
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
    let [a, b] = ["a", "b"].map(|id| store.get(id).unwrap().object().unwrap().hold());
    // Listing an object does not use it.
    let looked_at = store.page(&list(10, ""));
    let full = insert(&store, "c").unwrap_err();
    assert!(matches!(full, ServiceError::Overloaded { .. }), "{full}");
    drop(b);
    insert(&store, "c").unwrap();
    drop(looked_at);
    assert!(store.contains("a") && !store.contains("b"));
    drop(a);
}

#[test]
fn pages_list_every_object_once_in_any_order() {
    let store = store(10, 10);
    for id in ["e", "a", "d", "b", "c"] {
        insert(&store, id).unwrap();
    }
    let everything = all_ids(&store);
    assert!(everything.is_sorted() && everything.len() == 8);
    for order_by in ["", "name desc", "create_time", "create_time desc"] {
        for size in 1..=everything.len() + 1 {
            let mut query = list(i32::try_from(size).unwrap(), order_by);
            let mut seen: Vec<Listed> = Vec::new();
            loop {
                query.after = seen.last().map(Listed::place);
                let (page, more) = store.page(&query);
                assert!(page.len() <= size && (page.len() == size || !more));
                seen.extend(page);
                if !more {
                    break;
                }
            }
            let mut places: Vec<_> = seen.iter().map(Listed::place).collect();
            assert!(
                places.is_sorted_by(|a, b| query.order.compare(a, b).is_lt()),
                "{order_by}"
            );
            places.sort_by(|a, b| a.id.cmp(&b.id));
            assert!(places.iter().map(|place| &place.id).eq(&everything), "{order_by}");
        }
    }
}

#[test]
fn a_repeated_request_finds_its_object() {
    let store = store(2, 10);
    let create = |id: &str, request: u128, content: u8| {
        let origin = Origin {
            request: Some(RequestKey {
                id: Uuid::from_u128(request),
                content: [content; 32],
            }),
            ..Origin::default()
        };
        store.insert(tetrahedron(id, 1.0, &[]), origin)
    };
    let first = create("a", 1, 1).unwrap();
    let again = create("a", 1, 1).unwrap();
    assert!(Arc::ptr_eq(&first.record, &again.record));
    for id in ["a", "b"] {
        let reused = create(id, 1, 2).unwrap_err();
        assert!(matches!(reused, ServiceError::RequestIdReused { .. }), "{reused}");
    }
    let exists = create("a", 2, 1).unwrap_err();
    assert!(matches!(exists, ServiceError::ObjectExists { .. }), "{exists}");
    // Forgotten with the object, whether that is deleted or evicted.
    store.remove("a", None, &Caller::default()).unwrap();
    create("a", 1, 3).unwrap();
    for id in ["b", "c"] {
        insert(&store, id).unwrap();
    }
    create("d", 1, 4).unwrap();
    assert_eq!(store.created().requests.len(), 1);
}

#[test]
fn a_larger_state_evicts_others_but_not_its_own_object() {
    let store = store(10, 2);
    insert(&store, "a").unwrap();
    insert(&store, "b").unwrap();
    let base = store.changeable("a", None).unwrap();
    let larger = StoredObject {
        warnings: vec!["long".repeat(5)],
        ..tetrahedron("a", 1.0, &[])
    };
    store.replace(&base, Labels::new(), Some(larger)).unwrap();
    assert!(store.contains("a") && !store.contains("b") && store.counts_rightly());
}

impl ObjectStore {
    /// True if the sum of bytes is that of the objects in memory, however they came and went.
    pub(crate) fn counts_rightly(&self) -> bool {
        let created = self.created();
        let states = created.objects.values().map(|entry| &entry.state);
        let bytes: usize = states.clone().map(Listed::bytes).sum();
        let loaded = states.filter(|state| state.object().is_some()).count();
        (created.bytes, created.loaded) == (bytes, loaded)
    }

    /// Drops data that can be made again until no more than `bytes` are taken.
    pub(crate) fn shrink_to(&self, bytes: usize) {
        let mut created = self.created();
        created.cache.retain(Item::is_there);
        while created.taken() > bytes && created.cache.evict(|_| true) {}
    }
}

fn store_of(bytes: usize) -> ObjectStore {
    ObjectStore::new(StoreLimits { objects: 100, bytes }, Vec::new(), None)
}

/// A store with room for so many tetrahedra, with their derived data.
fn roomy(tetrahedra: usize) -> ObjectStore {
    store_of(tetrahedra * tetrahedron("any", 1.0, &[]).derived_and_own_bytes())
}

fn inserted(store: &ObjectStore, object: StoredObject) -> Arc<StoredObject> {
    let created = store.insert(object, Origin::default()).expect("it fits");
    Arc::clone(created.object().expect("it is loaded"))
}

/// A created object with unique content.
fn insert_numbered(store: &ObjectStore, number: u16) -> Arc<StoredObject> {
    let edge = 0.02 + 1e-4 * f32::from(number);
    inserted(store, tetrahedron(&format!("o{number}"), edge, &[]))
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
fn derived_data_is_built_once_and_counts_until_it_is_dropped() {
    let store = store_of(1 << 30);
    let a = insert_numbered(&store, 0);
    let at_rest = store.created().taken();
    let (first, second) = (derive(&store, &a, Need::Call), derive(&store, &a, Need::Call));
    assert!(Arc::ptr_eq(&first, &second));
    assert_eq!(store.created().taken(), at_rest + first.bytes());
    drop((first, second));
    store
        .remove(&a.id, None, &Caller::default())
        .expect("it is there");
    assert_eq!(store.created().taken(), 0);
}

#[test]
fn the_least_recently_used_data_is_dropped_before_any_object() {
    let any = Arc::new(tetrahedron("any", 0.02, &[]));
    let bytes = derive(&store_of(1 << 30), &any, Need::Call).bytes();
    let store = store_of(5 * bytes / 2);
    let [a, b, c, d] = [0, 1, 2, 3].map(|number| insert_numbered(&store, number));
    drop(derive(&store, &a, Need::Call));
    drop(derive(&store, &b, Need::Call));
    // Data that no call requested goes first.
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
fn of_unrequested_data_only_the_newest_is_kept() {
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
fn objects_of_one_content_share_derived_data() {
    let store = store_of(1 << 30);
    let [a, b] = ["a", "b"].map(|id| inserted(&store, tetrahedron(id, 0.05, &[])));
    let [of_a, of_b] = [&a, &b].map(|object| derive(&store, object, Need::Call));
    assert!(Arc::ptr_eq(&of_a.object, &of_b.object));
    let other = inserted(&store, tetrahedron("c", 0.05, &[1]));
    let of_other = derive(&store, &other, Need::Call);
    assert!(!Arc::ptr_eq(&of_a.object, &of_other.object));
}

#[test]
fn the_same_size_is_kept_once_and_belongs_to_one_state_of_its_object() {
    let store = roomy(10);
    let a = inserted(&store, tetrahedron("a", 1.0, &[]));
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
    let a = inserted(&store, tetrahedron("a", 1.0, &[]));
    for (hundredths, sizes) in [(50, 1), (200, 2)] {
        drop(store.resized(&a, size(&a, hundredths)).unwrap());
        assert_eq!(taken(), at_rest + sizes * sized);
    }
    inserted(&store, tetrahedron("b", 1.0, &[]));
    assert!(store.contains("a") && store.contains("b"));
    assert_eq!(taken(), 2 * at_rest + sized);
    // All data of an object goes with it.
    store.remove("a", None, &Caller::default()).unwrap();
    assert_eq!(taken(), at_rest);
}

#[test]
fn sizes_in_use_stay_and_are_bounded_by_bytes_and_number() {
    let small = roomy(2);
    let a = inserted(&small, tetrahedron("a", 1.0, &[]));
    let used = small.resized(&a, size(&a, 50)).unwrap();
    let refused = small.resized(&a, size(&a, 200)).unwrap_err();
    assert!(matches!(refused, ServiceError::Overloaded { .. }), "{refused}");
    drop(used);
    assert!(small.resized(&a, size(&a, 200)).is_ok());

    let ample = roomy(100);
    let a = inserted(&ample, tetrahedron("a", 1.0, &[]));
    for hundredths in 101..150 {
        drop(ample.resized(&a, size(&a, hundredths)).unwrap());
    }
    let of_sizes = SIZES_PER_OBJECT * a.derived_and_own_bytes();
    assert_eq!(ample.created().taken(), a.bytes() + of_sizes);
}

#[test]
fn an_object_that_fills_the_cache_has_one_size() {
    let small = store_of(1 << 4);
    let refused = small.check_size(&tetrahedron("a", 1.0, &[])).unwrap_err();
    assert!(matches!(refused, ServiceError::Invalid(_)), "{refused}");
    let refused = insert(&small, "a").unwrap_err();
    assert!(matches!(refused, ServiceError::Invalid(_)), "{refused}");

    let store = roomy(1);
    let a = inserted(&store, tetrahedron("a", 1.0, &[]));
    let refused = store.resized(&a, size(&a, 50)).unwrap_err();
    assert!(matches!(refused, ServiceError::Invalid(_)), "{refused}");
    assert!(store.contains("a"));
}
