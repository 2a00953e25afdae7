//! Atlases without a server: who gives way to whom, and what the end of an object ends.

use std::{fs, path::PathBuf, time::Instant};

use glam::Vec3;
use grasp_synthesis::{
    known::{entry::Entry, growth::Growth, primitives::Primitive},
    physical::grip::Gripper,
};

use super::{shelf::Standing, *};
use crate::StoreLimits;

/// Longest that anything is waited for: never reached unless something hangs.
const HANGS_AFTER: Duration = Duration::from_mins(1);

/// A closed box of these half edges in metres.
fn cuboid(id: &str, half_extents: Vec3) -> StoredObject {
    let object = Primitive { half_extents }.object();
    StoredObject::new(id.to_owned(), false, Arc::new(object), Vec::new())
}

/// A box that a hand gets round.
fn small(id: &str) -> StoredObject {
    cuboid(id, Vec3::new(0.02, 0.015, 0.05))
}

fn adult() -> &'static Hand {
    hand("adult", Handedness::Right).unwrap()
}

fn grown(object: &StoredObject) -> Arc<Grown> {
    let mut growth = Growth::new(&object.object, &adult().rig);
    let mut gripper = Gripper::default();
    while growth.len() < 10 {
        growth.round(&mut gripper);
    }
    Arc::new(growth.grown())
}

/// The same grip with its hand so many millimetres further along x: the same hand is kept once, this is another.
fn moved(grip: &Entry, by: usize) -> Entry {
    let mut moved = grip.clone();
    moved.grip.pose.frame_from_wrist.position.x += by as f32 * 1e-3;
    moved
}

/// A store with room for so many objects and bytes.
fn store(objects: usize, bytes: usize) -> Arc<ObjectStore> {
    Arc::new(ObjectStore::new(StoreLimits { objects, bytes }, Vec::new()))
}

fn start(threads: usize, store: &Arc<ObjectStore>) -> Atlases {
    let executor = SearchExecutor::new(1, 1).unwrap();
    Atlases::start(threads, Arc::clone(store), executor, None, "adult".to_owned()).unwrap()
}

fn until(what: &str, condition: impl Fn() -> bool) {
    let start = Instant::now();
    while !condition() {
        assert!(start.elapsed() < HANGS_AFTER, "{what} did not happen");
        std::thread::sleep(Duration::from_millis(1));
    }
}

#[test]
fn what_was_not_used_for_longest_gives_way() {
    let [a, b, c] = ["a", "b", "c"].map(|id| Arc::new(small(id)));
    let grown = grown(&a);
    // Without threads, nothing but this test publishes.
    let atlases = start(0, &store(10, 2 * grown.bytes() + 10));
    let publish = |object: &Arc<StoredObject>| {
        atlases
            .workshop
            .publish(object, adult(), Arc::clone(&grown), Duration::ZERO)
    };
    let is_there = |object: &Arc<StoredObject>| object.shelf.slot(adult()).unwrap().grown.is_some();
    for object in [&a, &b, &c] {
        atlases.workshop.ask(object, Some(adult()));
    }
    atlases.workshop.ask(&a, Some(adult()));
    // From the least to the most lately used: b, c, a.
    assert!(publish(&b) && publish(&a));
    assert!(publish(&c), "b gives way");
    assert_eq!([&a, &b, &c].map(is_there), [true, false, true]);
    assert!(!publish(&b), "b would have to displace what was used after it");
    assert_eq!([&a, &b, &c].map(is_there), [true, false, true]);
    // To publish again takes no more room than once.
    assert!(publish(&a) && publish(&c));
    atlases.workshop.fit(grown.bytes());
    assert_eq!([&a, &b, &c].map(is_there), [true, false, false]);
    // What is gone takes no room.
    drop(a);
    assert!(publish(&b));
    atlases.workshop.fit(grown.bytes());
    assert_eq!([&b, &c].map(is_there), [true, false]);
}

#[test]
fn of_what_was_found_the_latest_thousand_are_kept() {
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
    let forgotten = OBJECTS * EACH - recents::MOST;
    for (place, object) in objects.iter().enumerate() {
        let left = EACH - forgotten.saturating_sub(place * EACH).min(EACH);
        assert_eq!(kept(object), left, "{place}");
    }
    // They stay where an atlas gives way, and end with their object.
    let last = objects.last().expect("there are some");
    last.shelf.drop_grown(adult());
    assert_eq!(kept(last), EACH);
    let left = hand("adult", Handedness::Left).unwrap();
    assert!(atlases.get(last, left).recent.is_empty());
    drop(objects);
    let another = Arc::new(small("another"));
    atlases.remember(&another, adult(), grip);
    assert_eq!(kept(&another), 1);
}

#[test]
fn what_is_found_again_and_again_takes_the_place_of_one() {
    let [a, b] = ["a", "b"].map(|id| Arc::new(small(id)));
    let grip = grown(&a).atlas.entries()[0].clone();
    let atlases = start(1, &store(10, 0));
    let kept = |object: &Arc<StoredObject>| atlases.get(object, adult()).recent.entries().len();
    atlases.remember(&b, adult(), grip.clone());
    for _ in 0..2 * recents::MOST {
        atlases.remember(&a, adult(), grip.clone());
    }
    assert_eq!([kept(&a), kept(&b)], [1, 1]);
    // Nor do those take any that went for others of their hand.
    let most_of_one = {
        for k in 0..2 * recents::MOST {
            atlases.remember(&a, adult(), moved(&grip, k));
        }
        kept(&a)
    };
    assert!(most_of_one < recents::MOST, "{most_of_one}");
    assert_eq!(kept(&b), 1);
}

#[test]
fn without_builders_nothing_is_kept() {
    let object = Arc::new(small("a"));
    let grip = grown(&object).atlas.entries()[0].clone();
    let atlases = start(0, &store(10, 1 << 30));
    atlases.remember(&object, adult(), grip);
    assert!(object.shelf.slot(adult()).is_none());
}

#[test]
fn what_gave_way_is_built_again_when_it_is_asked_for() {
    let object = Arc::new(small("a"));
    let store = store(10, 1 << 30);
    let atlases = start(1, &store);
    assert!(atlases.get(&object, adult()).atlas.is_none());
    let is_there = || atlases.get(&object, adult()).atlas.is_some();
    until("the first atlas", is_there);
    object.shelf.finish(adult());
    atlases.workshop.fit(0);
    let slot = object.shelf.slot(adult()).unwrap();
    assert_eq!((slot.standing, slot.bytes), (Standing::Absent, 0));
    until("the second atlas", is_there);
}

#[test]
fn what_is_new_comes_before_what_has_grown() {
    let atlases = start(0, &store(10, 1 << 30));
    let objects = ["a", "b", "c", "d"].map(|id| Arc::new(small(id)));
    let milliseconds = [300, 0, 20, 0];
    for (object, worked) in objects.iter().zip(milliseconds) {
        atlases.workshop.enqueue(Job {
            object: Arc::downgrade(object),
            hand: adult(),
            worked: Duration::from_millis(worked),
        });
    }
    let next = || {
        let is_new = atlases.workshop.has_new_job();
        let object = atlases.workshop.next_job().unwrap().object.upgrade().unwrap();
        (object.id.clone(), is_new)
    };
    let order = [next(), next(), next(), next()];
    let expected = [("b", true), ("d", true), ("c", false), ("a", false)];
    assert_eq!(order, expected.map(|(id, is_new)| (id.to_owned(), is_new)));
}

#[test]
fn nothing_is_built_for_an_object_that_was_evicted() {
    // No hand gets round it: its atlas would grow for minutes.
    let store = store(1, 1 << 30);
    let atlases = start(1, &store);
    let first = {
        let first = store.insert(cuboid("first", Vec3::splat(0.2))).unwrap();
        atlases.registered(&first);
        Arc::downgrade(&first)
    };
    until("the turn of the first", || {
        first.upgrade().is_some_and(|first| {
            let slot = first.shelf.slot(adult());
            slot.is_some_and(|slot| slot.build_time > Duration::ZERO)
        })
    });
    let second = store.insert(small("second")).unwrap();
    atlases.registered(&second);
    until("the end of the first", || first.strong_count() == 0);
}

#[test]
fn builders_end_when_they_are_told_to() {
    let store = store(10, 1 << 30);
    let object = store.insert(cuboid("large", Vec3::splat(0.2))).unwrap();
    for stop in [|atlases: &Atlases| drop(atlases.stopper()), |_: &Atlases| {}] {
        let atlases = start(2, &store);
        atlases.registered(&object);
        assert_eq!(atlases.builders(), 2);
        stop(&atlases);
        let workshop = Arc::clone(&atlases.workshop);
        drop(atlases);
        until("the end of the builders", || {
            workshop.builders.load(Ordering::Relaxed) == 0
        });
    }
}

/// A folder of its own for a test, removed at its end.
struct Folder(PathBuf);

impl Folder {
    fn new(test: &str) -> Self {
        Self(std::env::temp_dir().join(format!("grasp-atlases-{test}-{}", std::process::id())))
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // A folder that stays in the temporary directory harms nobody.
        let _ = fs::remove_dir_all(&self.0);
    }
}

#[test]
fn files_give_back_what_was_written_and_nothing_that_is_broken() {
    let folder = Folder::new("files");
    let files = AtlasFiles::open(folder.0.clone()).unwrap();
    let (object, other) = (small("a"), cuboid("b", Vec3::new(0.03, 0.015, 0.05)));
    let grown = grown(&object);
    assert!(files.read(&object, adult()).is_none());
    files.write(&object, adult(), &grown);
    files.write(&object, adult(), &grown);
    assert_eq!(files.read(&object, adult()).as_ref(), Some(&*grown));
    assert!(files.read(&other, adult()).is_none());
    // Nothing is left of the writing.
    let mut paths = fs::read_dir(&folder.0).unwrap().map(|file| file.unwrap().path());
    let path = paths.next().unwrap();
    assert_eq!(
        (paths.next(), path.extension().unwrap()),
        (None, "atlas".as_ref())
    );
    let whole = fs::read(&path).unwrap();
    for broken in [&whole[..whole.len() / 2], b"", &[&whole[..], b"more"].concat()] {
        fs::write(&path, broken).unwrap();
        assert!(files.read(&object, adult()).is_none());
    }
    files.write(&object, adult(), &grown);
    assert_eq!(files.read(&object, adult()).as_ref(), Some(&*grown));
}

#[test]
fn files_that_were_not_used_for_longest_make_room() {
    let folder = Folder::new("room");
    let objects = [0.02, 0.021, 0.022].map(|x| cuboid("any", Vec3::new(x, 0.015, 0.05)));
    let grown = objects.each_ref().map(grown);
    let files = AtlasFiles::open(folder.0.clone()).unwrap();
    files.write(&objects[0], adult(), &grown[0]);
    let bytes = fs::read_dir(&folder.0)
        .unwrap()
        .map(|file| file.unwrap().metadata().unwrap().len())
        .sum::<u64>();
    let files = files.bounded(5 * bytes / 2);
    // Far enough apart for any clock of a file system.
    let pause = || std::thread::sleep(Duration::from_millis(20));
    pause();
    files.write(&objects[1], adult(), &grown[1]);
    pause();
    let is_there = |place: usize| files.read(&objects[place], adult()).is_some();
    assert!(is_there(0));
    pause();
    files.write(&objects[2], adult(), &grown[2]);
    assert_eq!([0, 1, 2].map(is_there), [true, false, true]);
}
