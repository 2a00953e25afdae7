//! Atlases without a server: eviction, remembered grips, and the end of builders.

use std::time::{Duration, Instant};

use glam::Vec3;
use grasp_assets::hands::hand;
use grasp_synthesis::{
    known::{
        growth::{Grown, Growth},
        primitives::Primitive,
    },
    physical::grip::Gripper,
};

use super::*;
use crate::limits::StoreLimits;

/// Longest wait for any event; reached only if something hangs.
const HANGS_AFTER: Duration = Duration::from_mins(1);

/// A closed box; half extents in metres.
pub(super) fn cuboid(id: &str, half_extents: Vec3) -> StoredObject {
    let object = Primitive { half_extents }.object();
    StoredObject::new(id.to_owned(), false, Arc::new(object), Vec::new())
}

/// A box that fits in a hand.
pub(super) fn small(id: &str) -> StoredObject {
    cuboid(id, Vec3::new(0.02, 0.015, 0.05))
}

pub(super) fn adult() -> &'static Hand {
    hand("adult", Handedness::Right).unwrap()
}

/// The first grips of an object.
pub(super) fn grown(object: &StoredObject) -> Arc<Grown> {
    let mut growth = Growth::new(&object.object, &adult().rig);
    let mut gripper = Gripper::default();
    while growth.len() < 10 {
        growth.round(&mut gripper);
    }
    Arc::new(growth.grown())
}

/// The grip with its hand moved `by` millimetres along x, so that it counts as another grip.
fn moved(grip: &Entry, by: usize) -> Entry {
    let mut moved = grip.clone();
    moved.grip.pose.frame_from_wrist.position.x += by as f32 * 1e-3;
    moved
}

fn store(objects: usize, bytes: usize) -> Arc<ObjectStore> {
    Arc::new(ObjectStore::new(StoreLimits { objects, bytes }, Vec::new()))
}

fn start(threads: usize, store: &Arc<ObjectStore>) -> Atlases {
    let executor = SearchExecutor::new(1, 1).unwrap();
    Atlases::start(threads, store, executor, None, "adult".to_owned()).unwrap()
}

fn until(what: &str, condition: impl Fn() -> bool) {
    let start = Instant::now();
    while !condition() {
        assert!(start.elapsed() < HANGS_AFTER, "{what} did not happen");
        std::thread::sleep(Duration::from_millis(1));
    }
}

#[test]
fn evicts_least_recently_used() {
    let [a, b, c] = ["a", "b", "c"].map(|id| Arc::new(small(id)));
    let grown = grown(&a);
    // Without threads, only this test publishes.
    let atlases = start(0, &store(10, 2 * grown.bytes() + 10));
    let publish = |object: &Arc<StoredObject>| {
        let builders = &atlases.0;
        builders
            .loaded
            .publish(object, adult(), Arc::clone(&grown), Duration::ZERO)
    };
    let is_there = |object: &Arc<StoredObject>| object.atlas_slots.get(adult()).unwrap().grown.is_some();
    for object in [&a, &b, &c] {
        atlases.0.request(object, Some(adult()));
    }
    atlases.0.request(&a, Some(adult()));
    // From the least to the most recently used: b, c, a.
    assert!(publish(&b) && publish(&a));
    assert!(publish(&c), "b is evicted");
    assert_eq!([&a, &b, &c].map(is_there), [true, false, true]);
    assert!(!publish(&b), "b would have to evict atlases used after it");
    assert_eq!([&a, &b, &c].map(is_there), [true, false, true]);
    // Publishing again takes no more room than publishing once.
    assert!(publish(&a) && publish(&c));
    atlases.0.loaded.shrink_to(grown.bytes());
    assert_eq!([&a, &b, &c].map(is_there), [true, false, false]);
    // Atlases of dropped objects take no room.
    drop(a);
    assert!(publish(&b));
    atlases.0.loaded.shrink_to(grown.bytes());
    assert_eq!([&b, &c].map(is_there), [true, false]);
}

#[test]
fn remembers_the_latest_grips_up_to_the_capacity() {
    const OBJECTS: usize = 40;
    const EACH: usize = 30;
    let objects: Vec<_> = (0..OBJECTS).map(|id| Arc::new(small(&id.to_string()))).collect();
    let grip = grown(&objects[0]).atlas.entries()[0].clone();
    let atlases = start(1, &store(10, 0));
    for object in &objects {
        for k in 0..EACH {
            atlases.remember(object, adult(), moved(&grip, k));
        }
    }
    let kept = |object: &Arc<StoredObject>| atlases.get(object, adult()).recent.entries().len();
    let forgotten = OBJECTS * EACH - remembered::CAPACITY;
    for (place, object) in objects.iter().enumerate() {
        let left = EACH - forgotten.saturating_sub(place * EACH).min(EACH);
        assert_eq!(kept(object), left, "{place}");
    }
    // They survive the eviction of the atlas and end with their object.
    let last = objects.last().expect("there are some");
    last.atlas_slots.evict(adult());
    assert_eq!(kept(last), EACH);
    let left = hand("adult", Handedness::Left).unwrap();
    assert!(atlases.get(last, left).recent.is_empty());
    drop(objects);
    let another = Arc::new(small("another"));
    atlases.remember(&another, adult(), grip);
    assert_eq!(kept(&another), 1);
}

#[test]
fn a_grip_found_again_is_remembered_once() {
    let [a, b] = ["a", "b"].map(|id| Arc::new(small(id)));
    let grip = grown(&a).atlas.entries()[0].clone();
    let atlases = start(1, &store(10, 0));
    let kept = |object: &Arc<StoredObject>| atlases.get(object, adult()).recent.entries().len();
    atlases.remember(&b, adult(), grip.clone());
    for _ in 0..2 * remembered::CAPACITY {
        atlases.remember(&a, adult(), grip.clone());
    }
    assert_eq!([kept(&a), kept(&b)], [1, 1]);
    // Nor do grips that replaced others of the same hand count.
    let most_of_one = {
        for k in 0..2 * remembered::CAPACITY {
            atlases.remember(&a, adult(), moved(&grip, k));
        }
        kept(&a)
    };
    assert!(most_of_one < remembered::CAPACITY, "{most_of_one}");
    assert_eq!(kept(&b), 1);
}

#[test]
fn remembers_nothing_without_builders() {
    let object = Arc::new(small("a"));
    let grip = grown(&object).atlas.entries()[0].clone();
    let atlases = start(0, &store(10, 1 << 30));
    atlases.remember(&object, adult(), grip);
    assert!(object.atlas_slots.get(adult()).is_none());
}

#[test]
fn rebuilds_an_evicted_atlas_on_request() {
    let object = Arc::new(small("a"));
    let store = store(10, 1 << 30);
    let atlases = start(1, &store);
    assert!(atlases.get(&object, adult()).atlas.is_none());
    let is_there = || atlases.get(&object, adult()).atlas.is_some();
    until("the first atlas", is_there);
    object.atlas_slots.finish(adult());
    atlases.0.loaded.shrink_to(0);
    let slot = object.atlas_slots.get(adult()).unwrap();
    assert_eq!((slot.state, slot.bytes), (BuildState::Absent, 0));
    until("the second atlas", is_there);
}

#[test]
fn stops_building_for_an_evicted_object() {
    // Too large for a hand: its atlas would grow for minutes.
    let store = store(1, 1 << 30);
    let atlases = start(1, &store);
    let first = {
        let first = store.insert(cuboid("first", Vec3::splat(0.2))).unwrap();
        atlases.register(&first);
        Arc::downgrade(&first)
    };
    until("the first turn", || {
        first.upgrade().is_some_and(|first| {
            let slot = first.atlas_slots.get(adult());
            slot.is_some_and(|slot| slot.build_time > Duration::ZERO)
        })
    });
    let second = store.insert(small("second")).unwrap();
    atlases.register(&second);
    until("the end of the first", || first.strong_count() == 0);
}

#[test]
fn builders_end_when_stopped_or_dropped() {
    let store = store(10, 1 << 30);
    let object = store.insert(cuboid("large", Vec3::splat(0.2))).unwrap();
    for stop in [|atlases: &Atlases| drop(atlases.stopper()), |_: &Atlases| {}] {
        let atlases = start(2, &store);
        atlases.register(&object);
        assert_eq!(atlases.builders(), 2);
        stop(&atlases);
        let builders = Arc::clone(&atlases.0);
        drop(atlases);
        until("the end of the builders", || builders.running() == 0);
    }
}
