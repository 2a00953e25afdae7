//! Atlases without a server: eviction, learned grips, shipped grips, files, states, and the end of builders.

use std::{
    fs,
    path::PathBuf,
    time::{Duration, Instant},
};

use glam::Vec3;
use grasp_assets::hands::hand;
use grasp_synthesis::{
    base::stop::unstopped,
    known::{
        entry::Entry,
        growth::{CHOSEN, Grown, Growth},
        primitives::Primitive,
    },
    physical::grip::Gripper,
    propose::prepared::PreparedObject,
};

use super::*;
use crate::{limits::StoreLimits, objects::store::Origin, validate::Labels};

/// Longest wait for any event; reached only if something hangs.
const HANGS_AFTER: Duration = Duration::from_mins(5);

/// A closed box; half extents in metres.
pub(super) fn cuboid(id: &str, half_extents: Vec3) -> StoredObject {
    StoredObject::plain(id, Primitive { half_extents }.object().plain().clone())
}

/// A box that fits in a hand.
pub(super) fn small(id: &str) -> StoredObject {
    cuboid(id, Vec3::new(0.02, 0.015, 0.05))
}

pub(super) fn adult() -> &'static Arc<Hand> {
    hand("adult", Handedness::Right).unwrap()
}

/// An object in the form that searches use.
pub(super) fn prepared(object: &StoredObject) -> Arc<PreparedObject> {
    let derived = unstopped(|stop| object.derived_until(stop));
    Arc::clone(&derived.object)
}

fn slot_of(object: &StoredObject, hand: &Arc<Hand>) -> Slot {
    object.atlas_slots.get(hand).unwrap()
}

fn left() -> &'static Arc<Hand> {
    hand("adult", Handedness::Left).unwrap()
}

/// The first grips of an object.
pub(super) fn grown(object: &StoredObject) -> Arc<Grown> {
    let prepared = prepared(object);
    let mut growth = Growth::new(&prepared, &adult().rig);
    let mut gripper = Gripper::default();
    while growth.len() < 10 {
        growth.round(&mut gripper);
    }
    Arc::new(growth.kept())
}

/// A test's own folder, removed at its end.
pub(super) struct Folder(pub PathBuf);

impl Folder {
    pub(super) fn new(test: &str) -> Self {
        let path = std::env::temp_dir().join(format!("grasp-atlases-{test}-{}", std::process::id()));
        fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    pub(super) fn open(&self) -> AtlasFiles {
        AtlasFiles::open(self.0.clone()).unwrap()
    }

    pub(super) fn names(&self) -> Vec<String> {
        let files = fs::read_dir(&self.0).unwrap();
        let mut names: Vec<String> = files
            .map(|file| file.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    pub(super) fn bytes(&self) -> u64 {
        let files = fs::read_dir(&self.0).unwrap();
        files.map(|file| file.unwrap().metadata().unwrap().len()).sum()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // A folder left in the temporary directory does no harm.
        let _ = fs::remove_dir_all(&self.0);
    }
}

fn store(objects: usize, bytes: usize) -> Arc<ObjectStore> {
    Arc::new(ObjectStore::new(StoreLimits { objects, bytes }, Vec::new(), None))
}

fn start(threads: usize, store: &Arc<ObjectStore>) -> Atlases {
    let executor = SearchExecutor::new(1, 1).unwrap();
    Atlases::start(threads, store, executor, None, "adult".to_owned()).unwrap()
}

fn known(atlases: &Atlases, object: &Arc<StoredObject>, hand: &Arc<Hand>) -> Option<Arc<Atlas>> {
    let [known, _] = atlases.get(object, [Some(hand), None]);
    known.atlas
}

fn until(what: &str, condition: impl Fn() -> bool) {
    let start = Instant::now();
    while !condition() {
        assert!(start.elapsed() < HANGS_AFTER, "{what} did not happen");
        std::thread::sleep(Duration::from_millis(1));
    }
}

#[test]
fn evicts_the_atlas_in_least_demand() {
    let [a, b, c] = ["a", "b", "c"].map(|id| Arc::new(small(id)));
    let grown = grown(&a);
    // Without threads, only this test publishes.
    let atlases = start(0, &store(10, 2 * grown.bytes() + 10));
    let publish = |object: &Arc<StoredObject>| {
        let builders = &atlases.0;
        builders.publish(object, adult(), Arc::clone(&grown), Duration::ZERO)
    };
    let is_there = |object: &Arc<StoredObject>| slot_of(object, adult()).grown.is_some();
    for object in [&a, &b, &c] {
        atlases.0.request(object, [Some(adult()), None]);
    }
    atlases.0.request(&a, [Some(adult()), None]);
    // From the one in least demand: b, c, which was requested later, and a.
    assert!(publish(&b) && publish(&a));
    assert!(publish(&c), "b is evicted");
    assert_eq!([&a, &b, &c].map(is_there), [true, false, true]);
    assert!(!publish(&b), "b would have to evict atlases in more demand");
    assert_eq!([&a, &b, &c].map(is_there), [true, false, true]);
    // Publishing again takes no more room than publishing once.
    assert!(publish(&a) && publish(&c));
    atlases.0.objects.shrink_to(grown.bytes());
    assert_eq!([&a, &b, &c].map(is_there), [true, false, false]);
    // Atlases of dropped objects take no room.
    drop(a);
    assert!(publish(&b));
    atlases.0.objects.shrink_to(grown.bytes());
    assert_eq!([&b, &c].map(is_there), [true, false]);
}

/// The grip with its hand moved `by` millimetres along x, so that it counts as another grip.
fn moved(grip: &Entry, by: usize) -> Entry {
    let mut moved = grip.clone();
    moved.grip.pose.frame_from_wrist.position.x += by as f32 * 1e-3;
    moved
}

#[test]
fn learns_up_to_the_limit_and_counts_it_toward_the_memory() {
    const MOST: usize = 5;
    let object = Arc::new(small("a"));
    let known_of = grown(&object);
    let grip = known_of.atlas.entries()[0].clone();
    let store = store(10, 1 << 30);
    let atlases = start(1, &store);
    let learned = |hand| {
        let [known, _] = atlases.get(&object, [Some(hand), None]);
        known.learned
    };
    assert!(learned(adult()).is_empty());
    for k in 0..9 {
        atlases.learn(&object, adult(), moved(&grip, k), MOST);
    }
    assert_eq!(learned(adult()).entries().len(), MOST);
    assert_eq!(learned(adult()).entries().last(), Some(&moved(&grip, 8)));
    let state = atlases.state("block", Some(&object), Handedness::Right);
    assert_eq!(state.learned_count, MOST as u32);
    // Publishing the atlas keeps them, and evicting it drops both.
    let builders = &atlases.0;
    assert!(builders.publish(&object, adult(), Arc::clone(&known_of), Duration::ZERO));
    let slot = slot_of(&object, adult());
    assert_eq!(slot.bytes(), known_of.bytes() + slot.learned.bytes());
    assert_eq!(slot.learned.entries().len(), MOST);
    builders.objects.shrink_to(slot.bytes() - 1);
    assert!(slot_of(&object, adult()).learned.is_empty());
    // Another hand, and an object without a slot, are not concerned.
    assert!(learned(left()).is_empty());
}

#[test]
fn learns_only_grips_that_fit_and_only_of_requested_hands() {
    let object = Arc::new(small("a"));
    let grip = grown(&object).atlas.entries()[0].clone();
    let no_room = start(1, &store(10, 0));
    no_room.0.request(&object, [Some(adult()), None]);
    no_room.learn(&object, adult(), grip.clone(), 5);
    assert!(slot_of(&object, adult()).learned.is_empty());
    let atlases = start(1, &store(10, 1 << 30));
    atlases.learn(&object, left(), grip.clone(), 5);
    assert!(object.atlas_slots.get(left()).is_none());
    for (threads, most) in [(0, 5), (1, 0)] {
        let atlases = start(threads, &store(10, 1 << 30));
        atlases.0.request(&object, [Some(left()), None]);
        atlases.learn(&object, left(), grip.clone(), most);
        assert!(slot_of(&object, left()).learned.is_empty());
    }
}

#[test]
fn rebuilds_an_evicted_atlas_on_request() {
    let object = Arc::new(small("a"));
    let store = store(10, 1 << 30);
    let atlases = start(1, &store);
    assert!(known(&atlases, &object, adult()).is_none());
    let is_there = || known(&atlases, &object, adult()).is_some();
    until("the first atlas", is_there);
    object.atlas_slots.end(adult(), BuildState::Finished);
    atlases.0.objects.shrink_to(0);
    let slot = slot_of(&object, adult());
    assert_eq!((slot.state, slot.bytes()), (BuildState::Absent, 0));
    until("the second atlas", is_there);
}

#[test]
fn an_object_keeps_its_atlases_through_changes_that_leave_its_grips_valid() {
    let objects = store(10, 1 << 30);
    let atlases = start(1, &objects);
    let builders = &atlases.0;
    let before = insert(&objects, small("a"));
    let known_of = grown(&before);
    for hand in [adult(), left()] {
        before.atlas_slots.request(hand, Duration::ZERO);
        assert!(builders.publish(&before, hand, Arc::clone(&known_of), Duration::ZERO));
    }
    before.atlas_slots.end(adult(), BuildState::Finished);
    atlases.learn(&before, adult(), known_of.atlas.entries()[0].clone(), 5);
    let change = |changed| {
        let base = objects.changeable("a", None).unwrap();
        let state = objects.replace(&base, Labels::new(), Some(changed)).unwrap();
        let object = Arc::clone(state.object().unwrap());
        atlases.register(&object);
        object
    };
    let same = change(small("a"));
    let complete = slot_of(&same, adult());
    assert_eq!(complete.state, BuildState::Finished);
    assert!(Arc::ptr_eq(&complete.grown.unwrap(), &known_of));
    assert_eq!(complete.learned, slot_of(&before, adult()).learned);
    assert_eq!(complete.learned.entries().len(), 1);
    // The left hand's atlas goes on from where it was.
    assert_eq!(slot_of(&same, left()).state, BuildState::Growing);
    let has_grown = || {
        slot_of(&same, left())
            .grown
            .is_some_and(|of| of.atlas.entries().len() > 10)
    };
    until("the growth of what was not complete", has_grown);
    // A heavier object's atlases start from nothing.
    let heavier = same.object.with_properties(9.0, Vec3::ZERO, None, &[]);
    let heavier = change(StoredObject::plain("a", heavier.unwrap()));
    assert!(slot_of(&heavier, adult()).learned.is_empty());
    assert_eq!(slot_of(&heavier, adult()).state, BuildState::Growing);
}

#[test]
fn atlases_that_an_object_took_over_count_and_can_be_dropped() {
    let objects = store(10, 1 << 30);
    let before = insert(&objects, small("a"));
    let known_of = grown(&before);
    before.atlas_slots.request(adult(), Duration::ZERO);
    assert!(objects.change_atlas(&before, adult(), |slot| slot.grown = Some(known_of)));
    let base = objects.changeable("a", None).unwrap();
    let state = objects.replace(&base, Labels::new(), Some(small("a"))).unwrap();
    let same = state.object().unwrap();
    assert!(slot_of(same, adult()).grown.is_some());
    objects.shrink_to(0);
    assert!(slot_of(same, adult()).grown.is_none());
}

/// The atlas that a server reads from a file, and how many grips the file has afterwards.
fn read_back(test: &str, written: &Grown) -> (Arc<Grown>, usize) {
    let folder = Folder::new(test);
    let files = folder.open();
    let object = Arc::new(small("a"));
    files.write(&object, &prepared(&object), adult(), written);
    let executor = SearchExecutor::new(1, 1).unwrap();
    let store = store(10, 1 << 30);
    let atlases = Atlases::start(1, &store, executor, Some(files), "adult".to_owned()).unwrap();
    atlases.0.request(&object, [Some(adult()), None]);
    until("reading the file", || {
        let slot = object.atlas_slots.get(adult());
        slot.is_some_and(|slot| slot.state == BuildState::Finished)
    });
    let slot = slot_of(&object, adult());
    let read = folder
        .open()
        .read(&object, &prepared(&object), adult())
        .expect("the file is there");
    (slot.grown.expect("it was read"), read.atlas.entries().len())
}

#[test]
fn a_complete_file_is_read_as_it_is_and_a_longer_one_is_cut() {
    let object = small("a");
    let prepared = prepared(&object);
    let mut growth = Growth::new(&prepared, &adult().rig);
    let mut gripper = Gripper::default();
    while !growth.is_enough() {
        growth.round(&mut gripper);
    }
    let longer = growth.grown().completed();
    assert_eq!(growth.kept().atlas.entries().len(), CHOSEN);
    let (read, in_file) = read_back("longer", &longer);
    assert!(read.atlas.is_complete());
    assert_eq!((read.atlas.entries().len(), in_file), (CHOSEN, CHOSEN));
    let kept = longer.atlas.entries();
    assert!(read.atlas.entries().iter().all(|entry| kept.contains(entry)));
    let (again, _) = read_back("complete", &read);
    assert_eq!(again, read);
}

#[test]
fn tells_why_an_atlas_has_no_grips() {
    let object = Arc::new(cuboid("large", Vec3::splat(0.2)));
    let state = |atlases: &Atlases| atlases.state("large", Some(&object), Handedness::Right);
    let full = start(1, &store(10, 0));
    full.register(&object);
    until("the end of the memory", || {
        state(&full).growth() == v1::AtlasGrowth::NoMemory
    });
    drop(full);
    // Too large for a hand. The next call tries again.
    let atlases = start(1, &store(10, 1 << 30));
    atlases.register(&object);
    assert_eq!(state(&atlases).growth(), v1::AtlasGrowth::Waiting);
    until("the end of the search for grips", || {
        state(&atlases).growth() == v1::AtlasGrowth::NothingFound
    });
    assert_eq!(state(&atlases).entry_count, 0);
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
    // A left hand's atlas lacks the mirror images that do not hold.
    const USEFUL: usize = 224 * 7 / 8;
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
    let is_complete = |object: &StoredObject| slot_of(object, adult()).state == BuildState::Finished;
    assert!(!objects.iter().any(|object| is_complete(object)), "{:?}", all());
}

#[test]
fn hands_requested_together_do_not_evict_each_other() {
    let object = Arc::new(small("a"));
    let grown = grown(&object);
    let atlases = start(0, &store(10, grown.bytes() + 10));
    atlases.0.request(&object, [Some(adult()), Some(left())]);
    let publish = |hand| {
        let builders = &atlases.0;
        builders.publish(&object, hand, Arc::clone(&grown), Duration::ZERO)
    };
    assert!(publish(adult()));
    assert!(!publish(left()), "there is room for one of them");
    assert!(slot_of(&object, adult()).grown.is_some());
}

#[test]
fn builders_end_when_stopped_or_dropped() {
    let store = store(10, 1 << 30);
    let object = insert(&store, cuboid("large", Vec3::splat(0.2)));
    for stop in [|atlases: &Atlases| drop(atlases.stopper()), |_: &Atlases| {}] {
        let atlases = start(2, &store);
        atlases.register(&object);
        stop(&atlases);
        let builders = Arc::clone(&atlases.0);
        drop(atlases);
        until("the end of the builders", || Arc::strong_count(&builders) == 1);
    }
}
