//! The store on its own; [`saved`](crate::objects::saved) compares it with a plain map.

use grasp_proto::v1;
use uuid::Uuid;

use super::*;
use crate::{error::Limit, objects::tests::tetrahedron, validate::page_query};

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

fn labels(value: u8) -> Labels {
    [("value".to_owned(), value.to_string())].into()
}

fn request_key(id: u128, content: u8) -> RequestKey {
    RequestKey {
        id: Uuid::from_u128(id),
        content: [content; 32],
    }
}

/// An object of the objects directory.
fn stay() -> PinnedObject {
    PinnedObject {
        object: tetrahedron("stay", 1.0, &[]),
        labels: labels(0),
    }
}

fn same_object(a: &Listed, b: &Listed) -> bool {
    Arc::ptr_eq(a.object().unwrap(), b.object().unwrap())
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
    let a = store.get("a").unwrap().loaded().unwrap().object.hold();
    let b = store.get("b").unwrap().loaded().unwrap().object.hold();
    // Listing an object does not use it.
    let looked_at = store.page(&list(10, ""));
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
    let store = ObjectStore::new(limits, Vec::new(), None);
    assert!(matches!(insert(&store, "a"), Err(ServiceError::Invalid(_))));
}

#[test]
fn directory_objects_stay_and_do_not_count() {
    let limits = StoreLimits {
        objects: 1,
        bytes: tetrahedron("any", 1.0, &[]).bytes(),
    };
    let store = ObjectStore::new(limits, vec![stay()], None);
    for id in ["a", "b"] {
        insert(&store, id).unwrap();
    }
    assert!(store.contains("stay") && store.contains("b") && !store.contains("a"));
    assert!(matches!(
        insert(&store, "stay"),
        Err(ServiceError::ObjectExists { .. })
    ));
    assert_eq!(all_ids(&store), ["b", "remote", "scalpel", "scissors", "stay"]);
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
fn pages_go_on_after_an_object_that_was_deleted() {
    let store = store(10, 10);
    for id in ["a", "b", "c"] {
        insert(&store, id).unwrap();
    }
    let mut query = list(2, "");
    let (first, _) = store.page(&query);
    query.after = first.last().map(Listed::place);
    store.remove("b", None).unwrap();
    let (second, _) = store.page(&query);
    assert_eq!(second[0].id(), "c");
}

#[test]
fn a_repeated_request_finds_its_object() {
    let store = store(2, 10);
    let create = |id: &str, request| {
        let origin = Origin {
            labels: labels(1),
            request: Some(request),
            mesh: Bytes::new(),
        };
        store.insert(tetrahedron(id, 1.0, &[]), origin)
    };
    let first = create("a", request_key(1, 1)).unwrap();
    let again = create("a", request_key(1, 1)).unwrap();
    assert!(same_object(&first, &again) && first.record == again.record);
    for (id, content) in [("a", 2), ("b", 2)] {
        assert!(matches!(
            create(id, request_key(1, content)),
            Err(ServiceError::RequestIdReused { .. })
        ));
    }
    assert!(matches!(
        create("a", request_key(2, 1)),
        Err(ServiceError::ObjectExists { .. })
    ));
    // Forgotten with the object, whether that is deleted or evicted.
    store.remove("a", None).unwrap();
    create("a", request_key(1, 3)).unwrap();
    for id in ["b", "c"] {
        insert(&store, id).unwrap();
    }
    create("d", request_key(1, 4)).unwrap();
    assert_eq!(store.created().requests.len(), 1);
}

#[test]
fn labels_change_without_the_object() {
    let store = store(2, 2);
    insert(&store, "a").unwrap();
    let base = store.changeable("a", None).unwrap();
    let after = store.replace(&base, labels(7), None).unwrap();
    assert!(same_object(&base, &after));
    assert_ne!(base.record.etag, after.record.etag);
    assert_eq!(base.record.created, after.record.created);
    assert!(after.record.updated >= base.record.updated);
    // The former state is gone.
    assert!(matches!(
        store.replace(&base, labels(8), None),
        Err(ServiceError::ObjectChanged { .. })
    ));
    let stale = Some(base.record.etag.as_str());
    assert!(matches!(
        store.changeable("a", stale),
        Err(ServiceError::ObjectChanged { .. })
    ));
    assert!(matches!(
        store.remove("a", stale),
        Err(ServiceError::ObjectChanged { .. })
    ));
    store.remove("a", Some(&after.record.etag)).unwrap();
    assert!(matches!(
        store.replace(&after, labels(8), None),
        Err(ServiceError::ObjectNotFound { evicted: false, .. })
    ));
    assert_eq!(store.created().bytes, 0);
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
    store.replace(&base, labels(1), Some(larger)).unwrap();
    assert!(store.contains("a") && !store.contains("b"));
    let sum: usize = store
        .created()
        .objects
        .values()
        .map(|entry| entry.state.bytes())
        .sum();
    assert_eq!(store.created().bytes, sum);
}

#[test]
fn objects_of_the_server_are_read_only() {
    let store = ObjectStore::new(
        StoreLimits {
            objects: 1,
            bytes: 1 << 20,
        },
        vec![stay()],
        None,
    );
    for id in ["remote", "stay"] {
        assert!(matches!(
            store.changeable(id, None),
            Err(ServiceError::ObjectReadOnly { .. })
        ));
        assert!(matches!(
            store.remove(id, None),
            Err(ServiceError::ObjectReadOnly { .. })
        ));
    }
}
