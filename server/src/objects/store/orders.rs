//! The store in many orders: calls create, change, delete and use objects at the same time, with room for few of them.

use std::{num::NonZeroUsize, sync::LazyLock};

use glam::Vec3;
use grasp_assets::hands::{Hand, hand};
use grasp_synthesis::{
    base::stop::Stop,
    known::{
        growth::{Grown, Growth},
        primitives::Primitive,
    },
    model::{hand::Handedness, object::GraspObject},
    physical::grip::Gripper,
    propose::prepared::PreparedObject,
};
use shuttle::thread;
use uuid::Uuid;

use super::{
    cache::{Item, Product, SIZES_PER_OBJECT},
    *,
};
use crate::{
    access::Caller,
    atlas_slots::Slot,
    objects::{
        Derived, Revision,
        derived::ObjectSize,
        tests::{LIMITS, with_mesh_file},
    },
    saved::SavedFiles,
    sync::orders::in_many_orders,
    validate::{ObjectFilter, RequestedSize, WatchQuery},
};

/// Objects in memory at most.
const MAX_OBJECTS: usize = 2;

/// The mass that an object is created with, in kilograms, and the one that it is given.
const MASS: f32 = 0.25;
const CHANGED_MASS: f32 = 0.5;

const EDGE: u8 = 5;

/// Some grips that hold an object of the tests.
static GROWN: LazyLock<Arc<Grown>> = LazyLock::new(|| {
    let half_extents = Vec3::new(0.02, 0.015, 0.05);
    let object = Primitive { half_extents }.object();
    let prepared = PreparedObject::new_until(Arc::new(object), Stop::NEVER).expect("nothing stops it");
    let mut growth = Growth::new(&prepared, &adult().rig);
    let mut gripper = Gripper::default();
    while growth.is_empty() {
        growth.round(&mut gripper);
    }
    Arc::new(growth.kept())
});

/// What is derived from an object of the tests, which takes longer than all else.
static DERIVED: LazyLock<Derived> = LazyLock::new(|| {
    let (object, _) = with_mesh_file("any", EDGE, MASS);
    let object = GraspObject::of_until(object.object, Stop::NEVER).expect("nothing stops it");
    let derived = Derived::of(Arc::new(object), Stop::NEVER).expect("nothing stops it");
    Derived::clone(&derived)
});

fn adult() -> &'static Arc<Hand> {
    hand("adult", Handedness::Right).expect("it is built in")
}

/// The labels of an object of this mass: one that does not match shows half a change.
fn labels(mass: f32) -> Labels {
    [("mass".to_owned(), mass.to_string())].into()
}

/// Calls about the objects of a store, and what it acknowledged.
struct Calls {
    store: Arc<ObjectStore>,
    /// The etags of all states of each object that were acknowledged; none once it is deleted.
    acknowledged: Mutex<BTreeMap<&'static str, Vec<String>>>,
}

impl Calls {
    fn new(saved: Option<SavedObjects>) -> Self {
        let (object, _) = with_mesh_file("any", EDGE, MASS);
        let limits = StoreLimits {
            objects: MAX_OBJECTS,
            // For one object at its own and at another size, with little besides.
            bytes: 3 * object.bytes() + 2 * DERIVED.bytes() + GROWN.bytes(),
        };
        let store = ObjectStore {
            pinned: BTreeMap::new(),
            mesh_uses: Mutex::default(),
            created: Mutex::new(Created::new(SystemTime::now())),
            limits,
            saved,
        };
        Self {
            store: Arc::new(store),
            acknowledged: Mutex::default(),
        }
    }

    /// The outcome of a call; only these errors are right.
    fn outcome<T>(&self, outcome: Result<T, ServiceError>) -> Option<T> {
        let created = self.store.created();
        let limits = self.store.limits;
        assert!(created.taken() <= limits.bytes, "{} bytes", created.taken());
        assert!(created.loaded <= limits.objects, "{} objects", created.loaded);
        match outcome {
            Ok(value) => Some(value),
            Err(
                ServiceError::Overloaded { .. }
                | ServiceError::ObjectNotFound { .. }
                | ServiceError::ObjectChanged { .. },
            ) => None,
            Err(error) => panic!("{error}"),
        }
    }

    fn acknowledge(&self, id: &'static str, state: Option<&Listed>) {
        let mut acknowledged = locked(&self.acknowledged);
        match state {
            Some(state) => acknowledged
                .entry(id)
                .or_default()
                .push(state.record.etag.clone()),
            None => drop(acknowledged.remove(id)),
        }
    }

    fn create(&self, id: &'static str) -> Option<Listed> {
        let (object, mesh) = with_mesh_file(id, EDGE, MASS);
        let origin = Origin {
            labels: labels(MASS),
            request: Some(RequestKey {
                id: Uuid::from_u128(u128::from(id.as_bytes()[0])),
                content: [1; 32],
            }),
            mesh,
            caller: Caller::default(),
        };
        let state = self.outcome(self.store.insert(object, origin))?;
        self.acknowledge(id, Some(&state));
        Some(state)
    }

    fn change(&self, id: &'static str, mass: f32) {
        let change = || {
            let base = self.store.changeable(id, None)?;
            let (object, _) = with_mesh_file(id, EDGE, mass);
            self.store.replace(&base, labels(mass), Some(object))
        };
        if let Some(state) = self.outcome(change()) {
            self.acknowledge(id, Some(&state));
        }
    }

    fn delete(&self, id: &'static str) {
        if self
            .outcome(self.store.remove(id, None, &Caller::default()))
            .is_some()
        {
            self.acknowledge(id, None);
            assert!(!self.store.contains(id));
        }
    }

    fn load(&self, id: &str) -> Option<Revision> {
        let loaded = self.outcome(wait_for(self.store.loaded(id)))?;
        assert_eq!(
            loaded.record.labels,
            labels(loaded.object.object.mass),
            "{id} is half changed"
        );
        Some(loaded)
    }

    /// Searches with an object, also at another size, and learns of it.
    fn search(&self, id: &str) {
        let Some(Revision { object, .. }) = self.load(id) else {
            return;
        };
        let _held = object.hold();
        let derived = self.derive(&object, Need::Call);
        if derived.is_some() {
            self.store.check_counted(&object);
        }
        let kept = self.store.kept(&object, Need::Call);
        if kept.is_some() {
            self.store.check_counted(&object);
        }
        let requested = RequestedSize {
            hundredths: 50,
            mass: None,
        };
        let size = ObjectSize::of(requested, &object).expect("it is another size");
        // Without derived data, the estimate for both sizes together exceeds the cache.
        let sized = self.store.resized(&object, size).ok();
        self.grow(&object);
        drop((derived, kept, sized));
    }

    /// Derives the data of an object before calls need it, and grows an atlas from it.
    fn prepare(&self, id: &str) {
        if let Some(Revision { object, .. }) = self.load(id) {
            drop(self.derive(&object, Need::Ahead));
            self.grow(&object);
        }
    }

    fn derive(&self, object: &Arc<StoredObject>, need: Need) -> Option<Arc<Derived>> {
        // Built here, so that the store seldom has to.
        let built = object.derived.get_or_build(|| Ok(Arc::new(DERIVED.clone())));
        drop(built);
        self.outcome(self.store.derived(object, need, Stop::NEVER))
    }

    fn grow(&self, object: &Arc<StoredObject>) {
        object.atlas_slots.request(adult(), Duration::ZERO);
        let publish = |slot: &mut Slot| slot.grown = Some(Arc::clone(&GROWN));
        self.outcome(Ok(self.store.change_atlas(object, adult(), publish)));
    }

    /// Checks what is left when all calls have ended.
    fn check_end(&self) {
        assert!(self.store.counts_rightly());
        self.store.check_products();
        for (id, etags) in &*locked(&self.acknowledged) {
            match self.store.get(id) {
                Ok(state) => assert!(etags.contains(&state.record.etag), "{id}"),
                Err(error) => {
                    let evicted = self.store.saved.is_none();
                    let name = name_of(id);
                    assert_eq!(error, ServiceError::ObjectNotFound { name, evicted });
                }
            }
        }
        self.check_saved();
        let created = self.store.created();
        assert!(
            created
                .requests
                .values()
                .all(|id| created.objects.contains_key(id))
        );
        assert_eq!(created.requests.len(), created.objects.len());
    }

    /// Checks that what is saved agrees with what is in memory, and can be loaded.
    fn check_saved(&self) {
        let Some(saved) = &self.store.saved else { return };
        for id in self.store.ids() {
            let record = wait_for(saved.record(&id)).expect("it is in memory");
            let record = record.expect("it is whole").record();
            assert_eq!(
                record,
                self.store.get(&id).ok().map(|state| (*state.record).clone())
            );
            assert!(self.load(&id).is_some(), "nothing is in use");
        }
        assert_eq!(
            self.store.changing().values().sum::<usize>(),
            self.store.ids().len()
        );
        let mut etags = locked(&self.acknowledged).remove("a").unwrap_or_default();
        etags.dedup();
        assert!(etags.len() <= 1, "a request created several objects");
    }
}

impl ObjectStore {
    /// Checks that derived data in use counts, unless its object was replaced or is gone.
    fn check_counted(&self, object: &Arc<StoredObject>) {
        let created = self.created();
        if created.is_current(object) {
            let is_it = |item: &&Item| item.is_of(object) && matches!(item.product, Product::Derived);
            assert_eq!(created.cache.items.iter().filter(is_it).count(), 1);
        }
    }

    /// Checks that everything made from objects counts once, and that nothing else does.
    fn check_products(&self) {
        let mut created = self.created();
        created.cache.retain(Item::is_there);
        let states = created.objects.values().map(|entry| &entry.state);
        for object in states.filter_map(Listed::object) {
            let items: Vec<_> = created
                .cache
                .items
                .iter()
                .filter(|item| item.is_of(object))
                .collect();
            let sum = |is: fn(&Product) -> bool| -> usize {
                let bytes = items
                    .iter()
                    .filter(|item| is(&item.product))
                    .map(|item| item.bytes);
                bytes.sum()
            };
            let derived = object.derived.get().map_or(0, |derived| derived.bytes());
            assert_eq!(sum(|product| matches!(product, Product::Derived)), derived);
            let atlases = object.atlas_slots.all();
            let atlases: usize = atlases.iter().map(|(_, slot)| slot.bytes()).sum();
            assert_eq!(sum(|product| matches!(product, Product::Atlas(_))), atlases);
            let sizes = items
                .iter()
                .filter(|item| matches!(item.product, Product::Size(..)));
            assert!(sizes.count() <= SIZES_PER_OBJECT);
        }
        let is_current = |item: &&Item| {
            let mut objects = created.objects.values().filter_map(|entry| entry.state.object());
            objects.any(|object| item.is_of(object))
        };
        assert_eq!(
            created.cache.items.iter().filter(is_current).count(),
            created.cache.items.len()
        );
    }
}

/// Calls about three objects, with room in memory for two.
fn calls_at_the_same_time(saved: Option<SavedObjects>) {
    let calls = Arc::new(Calls::new(saved));
    let watcher = calls.store.watch(WatchQuery {
        filter: ObjectFilter::default(),
        wants_present: false,
    });
    let scripts: [fn(&Calls); 6] = [
        |calls| {
            let first = calls.create("a");
            calls.search("a");
            drop(first);
        },
        |calls| {
            // The same request as the first.
            calls.create("a");
            calls.prepare("a");
        },
        |calls| {
            calls.create("b");
            calls.change("b", CHANGED_MASS);
        },
        |calls| {
            calls.search("b");
            calls.change("b", MASS);
        },
        |calls| {
            calls.create("c");
            calls.prepare("c");
            calls.delete("c");
        },
        |calls| {
            calls.search("a");
            calls.search("b");
        },
    ];
    let threads = scripts.map(|script| {
        let calls = Arc::clone(&calls);
        thread::spawn(move || script(&calls))
    });
    for thread in threads {
        thread.join().expect("it does not panic");
    }
    calls.check_end();
    let mut reported = BTreeMap::new();
    while let Some(report) = calls.store.next_report(&watcher).expect("it keeps up") {
        if let Report::Object { id, state, .. } = report {
            reported.insert(id, state.map(|state| state.record.etag.clone()));
        }
    }
    let created = calls.store.created();
    let ids = created.objects.iter();
    let etags = ids.map(|(id, entry)| (id.clone(), Some(entry.state.record.etag.clone())));
    reported.retain(|_, etag| etag.is_some());
    assert!(etags.eq(reported));
}

fn saved() -> SavedObjects {
    let files = Arc::new(SavedFiles::in_memory());
    SavedObjects::new(files, NonZeroUsize::new(10).expect("it is not 0"), LIMITS, 2)
}

#[test]
fn objects_in_memory_are_counted_and_not_lost_in_every_order() {
    LazyLock::force(&GROWN);
    LazyLock::force(&DERIVED);
    in_many_orders(|| calls_at_the_same_time(None));
}

#[test]
fn saved_objects_are_counted_and_not_lost_in_every_order() {
    LazyLock::force(&GROWN);
    LazyLock::force(&DERIVED);
    in_many_orders(|| calls_at_the_same_time(Some(saved())));
}
