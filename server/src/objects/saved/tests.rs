//! Saved objects in a folder, whole and damaged, and the objects in memory against a plain map across restarts.

mod damage;

use std::{
    collections::BTreeMap,
    fs,
    path::PathBuf,
    sync::{
        Arc, LazyLock,
        atomic::{AtomicUsize, Ordering},
    },
    time::Duration,
};

use futures_util::{FutureExt as _, future::join_all};
use grasp_proto::v1;
use proptest::prelude::*;
use tokio::runtime::{EnterGuard, Runtime};

use super::*;
use crate::{
    access::Caller,
    limits::StoreLimits,
    objects::{
        Listed,
        build::changed,
        store::{ObjectStore as Objects, Origin},
        tests::{LIMITS, tetrahedron, with_mesh_file},
    },
    saved::StorePlace,
    sync::wait_for,
    validate::{Labels, ObjectChange, page_query},
};

/// Where the objects of all tests are saved and loaded.
static RUNTIME: LazyLock<Runtime> = LazyLock::new(|| Runtime::new().unwrap());

/// A folder of its own, removed at the end, in the context of the runtime.
struct Folder {
    path: PathBuf,
    _context: EnterGuard<'static>,
}

impl Folder {
    fn new() -> Self {
        static MADE: AtomicUsize = AtomicUsize::new(0);
        let number = MADE.fetch_add(1, Ordering::Relaxed);
        let name = format!("grasp-saved-{}-{number}", std::process::id());
        Self {
            path: std::env::temp_dir().join(name),
            _context: RUNTIME.enter(),
        }
    }

    fn open(&self, maximum: usize) -> Result<SavedObjects, StoreError> {
        let files = SavedFiles::open(&StorePlace::Folder(self.path.clone()))?.unwrap();
        let maximum = maximum.try_into().unwrap();
        Ok(SavedObjects::new(Arc::new(files), maximum, LIMITS, 2))
    }

    /// The objects of a server that starts now, with room for so many in memory.
    fn objects_of(&self, in_memory: usize, maximum: usize) -> Arc<Objects> {
        let limits = StoreLimits {
            objects: in_memory,
            bytes: 1 << 30,
        };
        let saved = self.open(maximum).unwrap();
        let objects = Arc::new(Objects::new(limits, Vec::new(), Some(saved)));
        wait_for(objects.read_saved()).unwrap();
        objects
    }

    fn objects(&self) -> Arc<Objects> {
        self.objects_of(10, 10)
    }

    /// The files in a folder, but for the mark.
    fn names(&self, folder: &str) -> Vec<String> {
        let files = fs::read_dir(self.path.join(folder)).unwrap();
        let names = files.map(|file| file.unwrap().file_name().into_string().unwrap());
        names.filter(|name| !name.starts_with('.')).collect()
    }

    /// Number of records, and of meshes.
    fn counts(&self) -> [usize; 2] {
        [OBJECTS, MESHES].map(|folder| self.names(folder).len())
    }

    fn record(&self, id: &str) -> PathBuf {
        self.path.join(OBJECTS).join(id)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.path);
    }
}

fn labels(value: u8) -> Labels {
    [("value".to_owned(), value.to_string())].into()
}

/// A tetrahedron of so many centimetres, as a client creates it.
fn create(objects: &Objects, id: &str, edge: u8) -> Result<Listed, ServiceError> {
    let (object, mesh) = with_mesh_file(id, edge, 0.1);
    let origin = Origin {
        labels: labels(edge),
        request: None,
        mesh,
        caller: Caller::default(),
    };
    objects.insert(object, origin)
}

#[test]
fn a_mesh_is_kept_as_long_as_an_object_has_it() {
    let folder = Folder::new();
    let objects = folder.objects();
    for (id, edge) in [("a", 1), ("b", 1), ("c", 2)] {
        create(&objects, id, edge).unwrap();
    }
    assert_eq!(folder.counts(), [3, 2]);
    objects.remove("a", None, &Caller::default()).unwrap();
    objects.remove("c", None, &Caller::default()).unwrap();
    drop(objects);
    let objects = folder.objects();
    assert_eq!(folder.counts(), [1, 1]);
    wait_for(objects.loaded("b")).unwrap();
    objects.remove("b", None, &Caller::default()).unwrap();
    assert_eq!(folder.counts(), [0, 0]);
}

#[test]
fn remains_of_interrupted_writes_are_removed_at_the_start() {
    let folder = Folder::new();
    create(&folder.objects(), "a", 1).unwrap();
    // A mesh whose record was not written yet, and files that were not moved to their places yet.
    let meshes = folder.path.join(MESHES);
    for path in [
        meshes.join("0".repeat(64)),
        meshes.join("1#1"),
        folder.record("b#1"),
    ] {
        fs::write(path, "v").unwrap();
    }
    drop(folder.objects());
    assert_eq!(folder.counts(), [1, 1]);
}

#[test]
fn more_than_the_maximum_is_refused() {
    let folder = Folder::new();
    let objects = folder.objects_of(1, 2);
    for id in ["a", "b"] {
        create(&objects, id, 1).unwrap();
    }
    let full = create(&objects, "c", 1).map(|_| ());
    assert_eq!(full, Err(ServiceError::ObjectsFull { maximum: 2 }));
    objects.remove("a", None, &Caller::default()).unwrap();
    create(&objects, "c", 1).unwrap();
}

#[test]
fn a_failed_write_leaves_nothing() {
    let folder = Folder::new();
    let objects = folder.objects();
    create(&objects, "a", 1).unwrap();
    // A folder in place of the record cannot be replaced by a file.
    fs::create_dir_all(folder.record("b").join("c")).unwrap();
    let failed = create(&objects, "b", 2).map(|_| ());
    assert_eq!(failed, Err(ServiceError::StoreFailed));
    assert!(!objects.contains("b"));
    fs::remove_dir_all(folder.record("b")).unwrap();
    create(&objects, "b", 2).unwrap();
    drop(objects);
    assert_eq!(folder.objects().get("b").unwrap().id(), "b");
}

#[test]
fn a_failed_change_leaves_the_object_as_it_was() {
    let folder = Folder::new();
    let objects = folder.objects();
    let base = create(&objects, "a", 1).unwrap();
    let bytes = fs::read(folder.record("a")).unwrap();
    fs::write(folder.record("a"), "not a record").unwrap();
    let failed = objects.replace(&base, labels(9), None);
    assert!(matches!(failed, Err(ServiceError::ObjectDamaged { .. })));
    assert_eq!(objects.get("a").unwrap().record, base.record);
    fs::write(folder.record("a"), bytes).unwrap();
    objects.replace(&base, labels(9), None).unwrap();
}

#[test]
fn calls_that_wait_for_an_object_share_its_loading() {
    let folder = Folder::new();
    create(&folder.objects(), "a", 1).unwrap();
    let objects = folder.objects();
    let loaded = wait_for(join_all((0..20).map(|_| objects.loaded("a"))));
    let first = &loaded[0].as_ref().unwrap().object;
    let is_first = |object| Arc::ptr_eq(first, object);
    assert!(
        loaded
            .iter()
            .all(|revision| is_first(&revision.as_ref().unwrap().object))
    );
}

#[test]
fn an_object_that_no_call_waits_for_any_more_stays_at_rest() {
    let folder = Folder::new();
    create(&folder.objects(), "a", 1).unwrap();
    let objects = folder.objects();
    let one_thread = tokio::runtime::Builder::new_multi_thread()
        .max_blocking_threads(1)
        .enable_all()
        .build()
        .unwrap();
    one_thread.block_on(async {
        // The first poll does not finish: it waits for the only thread that may block.
        let (release, released) = std::sync::mpsc::channel::<()>();
        let occupied = tokio::task::spawn_blocking(move || released.recv());
        assert!(objects.loaded("a").now_or_never().is_none());
        release.send(()).unwrap();
        occupied.await.unwrap().unwrap();
        tokio::time::sleep(Duration::from_millis(50)).await;
        assert!(objects.get("a").unwrap().object().is_none());
        objects.loaded("a").await.unwrap();
        assert!(objects.get("a").unwrap().object().is_some());
    });
}

#[test]
fn a_record_of_another_object_or_version_is_found() {
    let record = Record {
        labels: labels(7),
        owner: Owner::named("studio"),
        etag: "1-2".to_owned(),
        created: SystemTime::UNIX_EPOCH,
        updated: SystemTime::UNIX_EPOCH,
    };
    let key = RequestKey {
        id: Uuid::from_u128(7),
        content: [3; 32],
    };
    let saved = SavedObject::new(&tetrahedron("mug", 0.1, &[]), &record, Some(key), [9; 32], 77);
    let read = |id: &str, saved: &SavedObject| SavedObject::from_message(id, &saved.encode_to_vec());
    assert_eq!(read("mug", &saved), Ok(saved.clone()));
    assert_eq!(read("cup", &saved), Err(Unreadable::Name));
    let changes: [fn(&mut SavedObject); 3] = [
        |saved| saved.object.etag.clear(),
        |saved| saved.mesh_sha256.truncate(31),
        |saved| saved.request_content.truncate(31),
    ];
    for change in changes {
        let mut incomplete = saved.clone();
        change(&mut incomplete);
        assert_eq!(read("mug", &incomplete), Err(Unreadable::Message));
    }
}

const IDS: [&str; 4] = ["o0", "o1", "o2", "o3"];

/// An operation on one of a few objects.
#[derive(Clone, Debug)]
enum Step {
    Create(&'static str, u8),
    Label(&'static str, u8, bool),
    Change(&'static str, u8),
    Delete(&'static str, bool),
    Load(&'static str),
    List(i32, bool),
    Restart,
}

fn steps() -> impl Strategy<Value = Vec<Step>> {
    let id = prop::sample::select(&IDS[..]);
    let step = prop_oneof![
        4 => (id.clone(), 1_u8..4).prop_map(|(id, edge)| Step::Create(id, edge)),
        2 => (id.clone(), 0_u8..3, any::<bool>()).prop_map(|(id, value, stale)| Step::Label(id, value, stale)),
        2 => (id.clone(), 1_u8..9).prop_map(|(id, mass)| Step::Change(id, mass)),
        1 => (id.clone(), any::<bool>()).prop_map(|(id, stale)| Step::Delete(id, stale)),
        1 => (1_i32..5, any::<bool>()).prop_map(|(size, descending)| Step::List(size, descending)),
        2 => id.prop_map(Step::Load),
        1 => Just(Step::Restart),
    ];
    prop::collection::vec(step, 1..25)
}

/// The map's value for an object: its description.
type Model = BTreeMap<&'static str, v1::GraspObject>;

fn check(objects: &Objects, model: &Model) -> Result<(), TestCaseError> {
    prop_assert!(objects.counts_rightly());
    for id in IDS {
        let found = objects.get(id).ok().map(|state| state.to_wire());
        prop_assert_eq!(found.as_ref(), model.get(id));
    }
    Ok(())
}

/// The ids of all objects, page by page.
fn listed(objects: &Objects, page_size: i32, order_by: &str) -> Vec<String> {
    let request = v1::ListObjectsRequest {
        page_size,
        order_by: order_by.to_owned(),
        ..Default::default()
    };
    let mut query = page_query(&request).unwrap();
    let mut seen = Vec::new();
    loop {
        let (page, more) = objects.page(&query);
        query.after = page.last().map(Listed::place);
        seen.extend(page.into_iter().map(|state| state.id().to_owned()));
        if !more {
            return seen;
        }
    }
}

/// A change of the mass, of an object that has to be loaded for it.
fn change(objects: &Arc<Objects>, id: &str, mass: f32) -> Result<Listed, ServiceError> {
    let base = objects.changeable(id, None)?;
    let object = wait_for(objects.loaded(id))?.object;
    let change = ObjectChange {
        mass: Some(mass),
        ..ObjectChange::default()
    };
    match changed(&object, &change)? {
        Some(object) => objects.replace(&base, base.record.labels.clone(), Some(object)),
        None => Ok(base),
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// However operations, restarts and rests follow one another, the objects agree with a map of their descriptions.
    #[test]
    fn agrees_with_a_plain_map(steps in steps()) {
        let folder = Folder::new();
        // Two in memory at most: the others rest.
        let mut objects = folder.objects_of(2, 100);
        let mut model = Model::new();
        let mut etags = std::collections::HashSet::new();
        for step in steps {
            match step {
                Step::Create(id, edge) => {
                    let created = create(&objects, id, edge);
                    prop_assert_eq!(created.is_ok(), !model.contains_key(id));
                    if let Ok(created) = created {
                        prop_assert!(etags.insert(created.record.etag.clone()));
                        model.insert(id, created.to_wire());
                    }
                }
                Step::Label(id, value, stale) => {
                    let base = objects.changeable(id, stale.then_some("stale"));
                    prop_assert_eq!(base.is_ok(), model.contains_key(id) && !stale);
                    if let Ok(base) = base {
                        let state = objects.replace(&base, labels(value), None).unwrap();
                        prop_assert_eq!(&state.record.labels, &labels(value));
                        prop_assert!(objects.replace(&base, labels(value), None).is_err());
                        prop_assert!(etags.insert(state.record.etag.clone()));
                        let before = model.insert(id, state.to_wire()).unwrap();
                        prop_assert_eq!(before.content_hash, state.to_wire().content_hash);
                    }
                }
                Step::Change(id, mass) => {
                    let mass = f32::from(mass) / 16.0;
                    let changed = change(&objects, id, mass);
                    prop_assert_eq!(changed.is_ok(), model.contains_key(id));
                    if let Ok(state) = changed {
                        prop_assert_eq!(state.to_wire().mass_kg, mass);
                        model.insert(id, state.to_wire());
                    }
                }
                Step::Delete(id, stale) => {
                    let deleted = objects.remove(id, stale.then_some("stale"), &Caller::default()).is_ok();
                    prop_assert_eq!(deleted, model.contains_key(id) && !stale);
                    if deleted {
                        model.remove(id);
                    }
                }
                Step::List(size, descending) => {
                    let built_in = objects.pinned().map(|object| &*object.id);
                    let mut expected: Vec<&str> = built_in.chain(model.keys().copied()).collect();
                    expected.sort_unstable();
                    if descending {
                        expected.reverse();
                    }
                    let order_by = if descending { "name desc" } else { "" };
                    prop_assert_eq!(listed(&objects, size, order_by), expected);
                }
                Step::Load(id) => {
                    let loaded = wait_for(objects.loaded(id)).is_ok();
                    prop_assert_eq!(loaded, model.contains_key(id));
                    prop_assert!(!loaded || objects.get(id).unwrap().object().is_some());
                }
                Step::Restart => {
                    drop(objects);
                    objects = folder.objects_of(2, 100);
                }
            }
            check(&objects, &model)?;
        }
        drop(objects);
        check(&folder.objects_of(2, 100), &model)?;
        prop_assert_eq!(folder.names(OBJECTS).len(), model.len());
    }
}
