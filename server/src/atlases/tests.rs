//! Atlases without a server: eviction, remembered grips, shipped grips, and the end of builders.

use std::time::{Duration, Instant};

use glam::Vec3;
use grasp_assets::hands::hand;
use grasp_synthesis::{
    known::{
        codec::{decode, encode},
        growth::{Grown, Growth, MAX_PROPOSALS, ROUND},
        primitives::Primitive,
    },
    physical::grip::Gripper,
};
use sha2::{Digest as _, Sha256};

use super::{build_queue::BuildJob, builders::Turn, files::tests::Folder, *};
use crate::{atlas_slots::Update, limits::StoreLimits, objects::store::Origin};

/// Longest wait for any event; reached only if something hangs.
const HANGS_AFTER: Duration = Duration::from_mins(1);

/// A closed box; half extents in metres.
pub(super) fn cuboid(id: &str, half_extents: Vec3) -> StoredObject {
    StoredObject::plain(id, Primitive { half_extents }.object())
}

/// A box that fits in a hand.
pub(super) fn small(id: &str) -> StoredObject {
    cuboid(id, Vec3::new(0.02, 0.015, 0.05))
}

pub(super) fn adult() -> &'static Arc<Hand> {
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
    Arc::new(ObjectStore::new(StoreLimits { objects, bytes }, Vec::new(), None))
}

fn start(threads: usize, store: &Arc<ObjectStore>) -> Atlases {
    let executor = SearchExecutor::new(1, 1).unwrap();
    Atlases::start(threads, store, executor, None, "adult".to_owned()).unwrap()
}

/// The known grips of one hand.
fn known(atlases: &Atlases, object: &Arc<StoredObject>, hand: &Arc<Hand>) -> KnownGrips {
    let [known, _] = atlases.get(object, [Some(hand), None]);
    known
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
        let update = Update::of(Arc::clone(&grown));
        atlases.0.loaded.publish(object, adult(), update, Duration::ZERO)
    };
    let is_there = |object: &Arc<StoredObject>| object.atlas_slots.get(adult()).unwrap().grown.is_some();
    for object in [&a, &b, &c] {
        atlases.0.request(object, [Some(adult()), None]);
    }
    atlases.0.request(&a, [Some(adult()), None]);
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
    let kept = |object: &Arc<StoredObject>| known(&atlases, object, adult()).recent.entries().len();
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
    assert!(known(&atlases, last, left).recent.is_empty());
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
    let kept = |object: &Arc<StoredObject>| known(&atlases, object, adult()).recent.entries().len();
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
    assert!(known(&atlases, &object, adult()).atlas.is_none());
    let is_there = || known(&atlases, &object, adult()).atlas.is_some();
    until("the first atlas", is_there);
    object.atlas_slots.finish(adult());
    atlases.0.loaded.shrink_to(0);
    let slot = object.atlas_slots.get(adult()).unwrap();
    assert_eq!((slot.state, slot.bytes), (BuildState::Absent, 0));
    until("the second atlas", is_there);
}

/// An atlas whose next round is its last: the number of proposals in its encoding is set to one round below the bound.
fn nearly_complete(object: &StoredObject) -> Grown {
    const PROPOSED: std::ops::Range<usize> = 47..55;
    const CHECKSUM_BYTES: usize = 32;
    let mut bytes = encode(&grown(object), &object.object, &adult().rig);
    bytes[PROPOSED].copy_from_slice(&(MAX_PROPOSALS - ROUND).to_be_bytes());
    let content = bytes.len() - CHECKSUM_BYTES;
    let checksum = Sha256::digest(&bytes[..content]);
    bytes[content..].copy_from_slice(&checksum);
    decode(&bytes, &object.object, &adult().rig).expect("the checksum is right")
}

#[test]
fn complete_atlas_replaces_shipped_grips() {
    let remote = Arc::clone(&grasp_assets::objects::object("remote").unwrap().object);
    let object = Arc::new(StoredObject::built_in("remote".to_owned(), remote));
    let atlases = start(0, &store(10, 1 << 30));
    let job = BuildJob {
        object: Arc::downgrade(&object),
        hand: Arc::clone(adult()),
        worked: Duration::ZERO,
    };
    let turn = || builders::turn(&atlases.0, &object, &job);
    let slot = || object.atlas_slots.get(adult()).unwrap();
    object.atlas_slots.request(adult(), 1);
    // A builder drops the job if it holds the last reference.
    let _second_reference = Arc::clone(&object);

    assert!(matches!(turn(), Turn::Read));
    let shipped = slot().grown.expect("grips ship with the server");
    assert!(!shipped.atlas.is_complete() && shipped.atlas.entries().len() >= 50);
    assert!(slot().growing.is_none());

    // The growing atlas is kept, but requests still get the shipped grips.
    assert!(matches!(turn(), Turn::More(_)));
    let growing = slot().growing.expect("it grows");
    assert!(growing.proposed() > 0 && !growing.atlas.entries().is_empty());
    assert!(Arc::ptr_eq(&slot().grown.unwrap(), &shipped));
    assert_eq!(slot().bytes, shipped.bytes() + growing.bytes());
    assert!(matches!(turn(), Turn::More(_)));
    assert!(slot().growing.unwrap().proposed() > growing.proposed());

    let update = Update {
        grown: shipped,
        growing: Some(Arc::new(nearly_complete(&object))),
    };
    object.atlas_slots.publish(adult(), update, Duration::ZERO);
    assert!(matches!(turn(), Turn::Finished));
    let complete = slot().grown.expect("it is complete");
    assert!(complete.atlas.is_complete());
    assert!(Arc::ptr_eq(&complete, &slot().growing.unwrap()));
    assert_eq!(slot().bytes, complete.bytes());
}

#[test]
fn complete_file_is_used_instead_of_shipped_grips() {
    let folder = Folder::new("complete");
    let store = store(10, 1 << 30);
    let remote = store.pinned().find(|object| object.id == "remote");
    let object = Arc::clone(remote.expect("it is built in"));
    let files = folder.open();
    let mut growth = Growth::resume(&object.object, &adult().rig, &nearly_complete(&object));
    growth.round(&mut Gripper::default());
    let complete = growth.grown();
    assert!(complete.atlas.is_complete());
    files.write(&object, adult(), &complete);
    let executor = SearchExecutor::new(1, 1).unwrap();
    let _atlases = Atlases::start(1, &store, executor, Some(files), "adult".to_owned()).unwrap();
    until("reading the file", || {
        let slot = object.atlas_slots.get(adult());
        slot.is_some_and(|slot| slot.state == BuildState::Finished)
    });
    assert_eq!(*object.atlas_slots.get(adult()).unwrap().grown.unwrap(), complete);
}

fn insert(store: &ObjectStore, object: StoredObject) -> Arc<StoredObject> {
    let state = store.insert(object, Origin::default()).unwrap();
    Arc::clone(state.object().unwrap())
}

#[test]
fn stops_building_for_an_evicted_object() {
    // Too large for a hand: its atlas would grow for minutes.
    let store = store(1, 1 << 30);
    let atlases = start(1, &store);
    let first = {
        let first = insert(&store, cuboid("first", Vec3::splat(0.2)));
        atlases.register(&first);
        Arc::downgrade(&first)
    };
    until("the first turn", || {
        first.upgrade().is_some_and(|first| {
            let slot = first.atlas_slots.get(adult());
            slot.is_some_and(|slot| slot.build_time > Duration::ZERO)
        })
    });
    let second = insert(&store, small("second"));
    atlases.register(&second);
    until("the end of the first", || first.strong_count() == 0);
}

/// Number of grips of each hand that requests of an object can use, right before left.
fn entries(object: &StoredObject) -> [usize; 2] {
    [Handedness::Right, Handedness::Left].map(|side| {
        let hand = hand("adult", side).unwrap();
        let grown = object.atlas_slots.get(hand).and_then(|slot| slot.grown);
        grown.map_or(0, |grown| grown.atlas.entries().len())
    })
}

#[test]
fn both_hands_of_every_new_object_become_useful_before_any_grows_on() {
    const USEFUL: usize = 100;
    let store = store(10, 1 << 30);
    let objects = ["a", "b"].map(|id| insert(&store, small(id)));
    let atlases = start(1, &store);
    for object in &objects {
        atlases.register(object);
    }
    let all = || objects.each_ref().map(|object| entries(object));
    until("useful atlases", || {
        all().as_flattened().iter().all(|&count| count >= USEFUL)
    });
    // By then an atlas had a turn or two more, each of a quarter of its grips.
    let most = all().into_iter().flatten().max().unwrap();
    assert!(most < 4 * USEFUL, "{:?}", all());
}

#[test]
fn hands_requested_together_do_not_evict_each_other() {
    let object = Arc::new(small("a"));
    let grown = grown(&object);
    let atlases = start(0, &store(10, grown.bytes() + 10));
    let left = hand("adult", Handedness::Left).unwrap();
    atlases.0.request(&object, [Some(adult()), Some(left)]);
    let publish = |hand| {
        let update = Update::of(Arc::clone(&grown));
        atlases.0.loaded.publish(&object, hand, update, Duration::ZERO)
    };
    assert!(publish(adult()));
    assert!(!publish(left), "there is room for one of them");
    assert!(object.atlas_slots.get(adult()).unwrap().grown.is_some());
}

#[test]
fn builders_end_when_stopped_or_dropped() {
    let store = store(10, 1 << 30);
    let object = insert(&store, cuboid("large", Vec3::splat(0.2)));
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
