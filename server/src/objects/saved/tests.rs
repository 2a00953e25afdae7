//! Saved objects in a folder, whole and damaged, and the objects in memory against a plain map across restarts.

mod damage;

use std::{
    collections::BTreeMap,
    fs,
    path::PathBuf,
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    },
    time::Duration,
};

use futures_util::FutureExt as _;
use grasp_import::MeshLimits;
use grasp_proto::v1;
use grasp_synthesis::base::stop::Stop;
use proptest::prelude::*;
use tokio::runtime::Runtime;

use super::*;
use crate::saved::{StorePlace, wait_for};
use crate::{
    limits::StoreLimits,
    objects::{
        Listed, StoredObject,
        build::{build_object, changed},
        store::{ObjectStore as Objects, Origin},
    },
    validate::{Labels, ObjectChange, Violations, object_fields, page_query},
};

const LIMITS: MeshLimits = MeshLimits {
    bytes: 10_000,
    vertices: 100,
    triangles: 100,
};

/// A folder of its own, removed at the end.
struct Folder(PathBuf);

impl Folder {
    fn new() -> Self {
        static MADE: AtomicUsize = AtomicUsize::new(0);
        let number = MADE.fetch_add(1, Ordering::Relaxed);
        let name = format!("grasp-saved-{}-{number}", std::process::id());
        Self(std::env::temp_dir().join(name))
    }

    fn open(&self, maximum: usize) -> SavedObjects {
        let place = StorePlace::Folder(self.0.clone());
        let files = SavedFiles::open(&place).unwrap().unwrap();
        SavedObjects::new(Arc::new(files), maximum.try_into().unwrap(), LIMITS, 2)
    }

    /// The objects of a server that starts now, with room for so many in memory.
    fn objects(&self, in_memory: usize, maximum: usize) -> Arc<Objects> {
        let limits = StoreLimits {
            objects: in_memory,
            bytes: 1 << 30,
        };
        let objects = Arc::new(Objects::new(limits, Vec::new(), Some(self.open(maximum))));
        wait_for(objects.read_saved()).unwrap();
        objects
    }

    fn names(&self, folder: &str) -> Vec<String> {
        let files = fs::read_dir(self.0.join(folder)).unwrap();
        let names = files.map(|file| file.unwrap().file_name().into_string().unwrap());
        // But for the mark.
        let mut names: Vec<String> = names.filter(|name| !name.starts_with('.')).collect();
        names.sort();
        names
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

fn runtime() -> Runtime {
    tokio::runtime::Builder::new_multi_thread()
        .worker_threads(1)
        .enable_all()
        .build()
        .unwrap()
}

fn mesh(edge: u8) -> Vec<u8> {
    format!("v 0 0 0\nv {edge} 0 0\nv 0 {edge} 0\nv 0 0 {edge}\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n")
        .into_bytes()
}

fn labels(value: u8) -> Labels {
    [("value".to_owned(), value.to_string())].into()
}

/// A tetrahedron of so many centimetres, as a client creates it.
fn create(objects: &Objects, id: &str, edge: u8) -> Result<Listed, ServiceError> {
    let mut with_mesh = v1::CreateObjectRequest::new(id, mesh(edge), 0.1);
    with_mesh.object_mut().meters_per_unit = Some(0.01);
    let violations = Violations::default();
    let fields = object_fields(with_mesh, LIMITS.bytes, &violations);
    let object = build_object(&fields, LIMITS, violations, Stop::NEVER).unwrap();
    let origin = Origin {
        labels: labels(edge),
        request: None,
        mesh: fields.mesh.into(),
    };
    objects.insert(object, origin)
}

#[test]
fn a_mesh_is_kept_as_long_as_an_object_has_it() {
    let runtime = runtime();
    let _context = runtime.enter();
    let folder = Folder::new();
    let objects = folder.objects(10, 10);
    for (id, edge) in [("a", 1), ("b", 1), ("c", 2)] {
        create(&objects, id, edge).unwrap();
    }
    assert_eq!(folder.names(MESHES).len(), 2);
    objects.remove("a", None).unwrap();
    objects.remove("c", None).unwrap();
    drop(objects);
    let objects = folder.objects(10, 10);
    assert_eq!((folder.names(OBJECTS).len(), folder.names(MESHES).len()), (1, 1));
    wait_for(objects.loaded("b")).unwrap();
    objects.remove("b", None).unwrap();
    assert_eq!(folder.names(MESHES), [""; 0]);
}

#[test]
fn remains_of_interrupted_writes_are_removed_at_the_start() {
    let runtime = runtime();
    let _context = runtime.enter();
    let folder = Folder::new();
    create(&folder.objects(10, 10), "a", 1).unwrap();
    // A mesh whose record was not written yet, and files that were not moved to their places yet.
    fs::write(folder.0.join(MESHES).join("0".repeat(64)), "v").unwrap();
    fs::write(folder.0.join(MESHES).join("1#1"), "v").unwrap();
    fs::write(folder.0.join(OBJECTS).join("b#1"), "r").unwrap();
    drop(folder.objects(10, 10));
    assert_eq!((folder.names(OBJECTS).len(), folder.names(MESHES).len()), (1, 1));
}

#[test]
fn more_than_the_maximum_is_refused() {
    let runtime = runtime();
    let _context = runtime.enter();
    let folder = Folder::new();
    let objects = folder.objects(1, 2);
    for id in ["a", "b"] {
        create(&objects, id, 1).unwrap();
    }
    let full = create(&objects, "c", 1).map(|_| ());
    assert_eq!(full, Err(ServiceError::ObjectsFull { maximum: 2 }));
    objects.remove("a", None).unwrap();
    create(&objects, "c", 1).unwrap();
}

#[test]
fn a_failed_write_leaves_nothing() {
    let runtime = runtime();
    let _context = runtime.enter();
    let folder = Folder::new();
    let objects = folder.objects(10, 10);
    create(&objects, "a", 1).unwrap();
    // A folder in place of the record cannot be replaced by a file.
    fs::create_dir_all(folder.0.join(OBJECTS).join("b").join("c")).unwrap();
    let failed = create(&objects, "b", 2).map(|_| ());
    assert_eq!(failed, Err(ServiceError::StoreFailed));
    assert!(!objects.contains("b"));
    fs::remove_dir_all(folder.0.join(OBJECTS).join("b")).unwrap();
    create(&objects, "b", 2).unwrap();
    drop(objects);
    assert_eq!(folder.objects(10, 10).get("b").unwrap().id(), "b");
}

#[test]
fn calls_that_wait_for_an_object_share_its_loading() {
    let runtime = runtime();
    let folder = Folder::new();
    let objects = {
        let _context = runtime.enter();
        create(&folder.objects(10, 10), "a", 1).unwrap();
        folder.objects(10, 10)
    };
    runtime.block_on(async {
        let calls = (0..20).map(|_| objects.loaded("a"));
        let loaded = futures_util::future::join_all(calls).await;
        let first = loaded[0].as_ref().unwrap();
        for revision in &loaded {
            assert!(Arc::ptr_eq(&first.object, &revision.as_ref().unwrap().object));
        }
    });
}

#[test]
fn an_object_that_no_call_waits_for_any_more_stays_at_rest() {
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .max_blocking_threads(1)
        .enable_all()
        .build()
        .unwrap();
    let folder = Folder::new();
    let objects = {
        let _context = runtime.enter();
        create(&folder.objects(10, 10), "a", 1).unwrap();
        folder.objects(10, 10)
    };
    runtime.block_on(async {
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
fn a_failed_change_leaves_the_object_as_it_was() {
    let runtime = runtime();
    let _context = runtime.enter();
    let folder = Folder::new();
    let objects = folder.objects(10, 10);
    let base = create(&objects, "a", 1).unwrap();
    let path = folder.0.join(OBJECTS).join("a");
    let bytes = fs::read(&path).unwrap();
    fs::write(&path, "not a record").unwrap();
    let failed = objects.replace(&base, labels(9), None);
    assert!(matches!(failed, Err(ServiceError::ObjectDamaged { .. })));
    assert_eq!(objects.get("a").unwrap().record, base.record);
    fs::write(&path, bytes).unwrap();
    objects.replace(&base, labels(9), None).unwrap();
}

/// A record of an object with everything that a client may give one.
fn saved() -> SavedObject {
    let mut request = v1::CreateObjectRequest::new("mug", mesh(1), 0.3);
    let grip = v1::HandPose::new("", v1::Handedness::Left).with_object_from_wrist(v1::Pose::default());
    *request.object_mut() = v1::GraspObject {
        center_of_mass: Some(v1::Vector3::default()),
        friction: Some(0.5),
        regions: vec![v1::Region {
            triangles: vec![3],
            ..v1::Region::new("base", v1::Preference::Forbidden)
        }],
        known_grips: vec![v1::KnownGrip::new("not", v1::Preference::Forbidden, grip)],
        meters_per_unit: Some(0.01),
        z_up: true,
        ..request.object_mut().clone()
    };
    let violations = Violations::default();
    let fields = object_fields(request, LIMITS.bytes, &violations);
    let object = build_object(&fields, LIMITS, violations, Stop::NEVER).unwrap();
    let record = Record {
        labels: labels(7),
        etag: "1-2".to_owned(),
        created: SystemTime::UNIX_EPOCH + Duration::from_nanos(1_234_567_891),
        updated: SystemTime::UNIX_EPOCH + Duration::from_secs(7),
    };
    let key = RequestKey {
        id: Uuid::from_u128(7),
        content: [3; 32],
    };
    SavedObject::new(&object, &record, Some(key), [9; 32], 77)
}

#[test]
fn a_record_is_read_as_it_was_written() {
    let before = saved();
    let after = SavedObject::from_message("mug", &before.encode_to_vec()).unwrap();
    assert_eq!(before, after);
    let record = after.record().unwrap();
    assert_eq!(
        record.created,
        SystemTime::UNIX_EPOCH + Duration::from_nanos(1_234_567_891)
    );
    assert_eq!(record.labels, labels(7));
    assert_eq!(after.request_key().unwrap().id, Uuid::from_u128(7));
    assert_eq!((after.mesh_hash(), after.mesh_bytes), ([9; 32], 77));
    let given = after.clone().given();
    assert_eq!(given.center_of_mass, Some(v1::Vector3::default()));
    assert_eq!((given.friction, given.meters_per_unit), (Some(0.5), Some(0.01)));
    assert_eq!((given.regions.len(), given.known_grips.len()), (1, 1));
    let description = after.description();
    assert_eq!(
        (description.triangle_count, description.forbidden_triangle_count),
        (4, 1)
    );
    assert!(description.labels.is_empty() && description.regions.is_empty());
}

#[test]
fn a_record_of_another_object_or_version_is_found() {
    let read = |id: &str, saved: &SavedObject| SavedObject::from_message(id, &saved.encode_to_vec());
    assert_eq!(read("cup", &saved()), Err(Unreadable::Name));
    let mut no_etag = saved();
    no_etag.object.etag = String::new();
    let short_hash = SavedObject {
        mesh_sha256: vec![9; 31],
        ..saved()
    };
    let short_content = SavedObject {
        request_content: vec![3; 31],
        ..saved()
    };
    for incomplete in [no_etag, short_hash, short_content] {
        assert_eq!(read("mug", &incomplete), Err(Unreadable::Message));
    }
}

/// An operation on one of a few objects.
#[derive(Clone, Debug)]
enum Step {
    Create(u8, u8),
    Label(u8, u8, bool),
    Change(u8, u8),
    Delete(u8, bool),
    Load(u8),
    List(i32, bool),
    Restart,
}

fn steps() -> impl Strategy<Value = Vec<Step>> {
    let id = 0_u8..4;
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

/// What the map knows of an object: its description, and the etag.
type Model = BTreeMap<String, v1::GraspObject>;

fn check(objects: &Objects, model: &Model) -> Result<(), TestCaseError> {
    prop_assert!(objects.counts_rightly());
    for id in 0..4 {
        let id = format!("o{id}");
        let found = objects.get(&id).ok().map(|state| state.to_wire());
        prop_assert_eq!(found.as_ref(), model.get(&id));
    }
    Ok(())
}

/// The ids of all objects, page by page.
fn listed(objects: &Objects, page_size: i32, order_by: &str) -> Vec<String> {
    let mut query = page_query(&v1::ListObjectsRequest {
        page_size,
        order_by: order_by.to_owned(),
        ..Default::default()
    });
    let query = query.as_mut().unwrap();
    let mut seen = Vec::new();
    loop {
        let (page, more) = objects.page(query);
        query.after = page.last().map(Listed::place);
        seen.extend(page.into_iter().map(|state| state.id().to_owned()));
        if !more {
            return seen;
        }
    }
}

/// A change of the mass, of an object that has to be loaded for it.
fn change(objects: &Arc<Objects>, id: &str, mass: u8) -> Result<Listed, ServiceError> {
    let base = objects.changeable(id, None)?;
    let object: Arc<StoredObject> = wait_for(objects.loaded(id))?.object;
    let change = ObjectChange {
        mass: Some(f32::from(mass) / 16.0),
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
        let runtime = runtime();
        let _context = runtime.enter();
        let folder = Folder::new();
        // Two in memory at most: the others rest.
        let mut objects = folder.objects(2, 100);
        let mut model = Model::new();
        let mut etags = std::collections::HashSet::new();
        for step in steps {
            match step {
                Step::Create(id, edge) => {
                    let id = format!("o{id}");
                    let created = create(&objects, &id, edge);
                    prop_assert_eq!(created.is_ok(), !model.contains_key(&id));
                    if let Ok(created) = created {
                        prop_assert!(etags.insert(created.record.etag.clone()));
                        model.insert(id, created.to_wire());
                    }
                }
                Step::Label(id, value, stale) => {
                    let id = format!("o{id}");
                    let base = objects.changeable(&id, stale.then_some("stale"));
                    prop_assert_eq!(base.is_ok(), model.contains_key(&id) && !stale);
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
                    let id = format!("o{id}");
                    let changed = change(&objects, &id, mass);
                    prop_assert_eq!(changed.is_ok(), model.contains_key(&id));
                    if let Ok(state) = changed {
                        let after = state.to_wire();
                        prop_assert_eq!(after.mass_kg, f32::from(mass) / 16.0);
                        model.insert(id, after);
                    }
                }
                Step::Delete(id, stale) => {
                    let id = format!("o{id}");
                    let deleted = objects.remove(&id, stale.then_some("stale")).is_ok();
                    prop_assert_eq!(deleted, model.contains_key(&id) && !stale);
                    if deleted {
                        model.remove(&id);
                    }
                }
                Step::List(size, descending) => {
                    let built_in = objects.pinned().map(|object| object.id.clone());
                    let mut expected: Vec<String> = built_in.chain(model.keys().cloned()).collect();
                    expected.sort();
                    if descending {
                        expected.reverse();
                    }
                    let order_by = if descending { "name desc" } else { "" };
                    prop_assert_eq!(listed(&objects, size, order_by), expected);
                }
                Step::Load(id) => {
                    let id = format!("o{id}");
                    let loaded = wait_for(objects.loaded(&id)).ok();
                    let loaded = loaded.map(|revision| Listed::from(revision).to_wire());
                    prop_assert_eq!(loaded.as_ref(), model.get(&id));
                }
                Step::Restart => {
                    drop(objects);
                    objects = folder.objects(2, 100);
                }
            }
            check(&objects, &model)?;
        }
        drop(objects);
        check(&folder.objects(2, 100), &model)?;
        prop_assert_eq!(folder.names(OBJECTS).len(), model.len());
    }
}
