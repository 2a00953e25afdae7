//! Complete atlases: those of this crate's folder `complete`, and others, grown on first use and kept in a folder.

use std::{
    collections::HashMap,
    env,
    ffi::OsString,
    fs, io,
    path::{Path, PathBuf},
    sync::{
        Arc, LazyLock, Mutex, PoisonError,
        atomic::{AtomicU64, Ordering},
    },
    time::{Duration, Instant},
};

use grasp_synthesis::{
    known::{
        atlas::Atlas,
        codec::{decode, encode, file_name},
        growth::{Grown, Growth},
    },
    model::{hand::rig::Rig, object::GraspObject},
    physical::grip::Gripper,
    propose::prepared::{PreparedObject, PreparedRig},
};

use crate::objects::object;

/// How often a growing atlas is saved. Longer loses more when the process is killed; saving takes some 30 ms.
const SAVE_INTERVAL: Duration = Duration::from_secs(10);

/// The complete atlas of a built-in object. One that this crate's folder `complete` lacks is grown on first use and kept in
/// `target/atlases`. Each is read once per process. A fresh clone grows none of those that its tests need.
///
/// # Panics
/// The object is not built in, or `target/atlases` cannot be read or written.
pub fn complete_atlas(object_name: &str, rig: &PreparedRig) -> Arc<Atlas> {
    /// Atlases by file; a slot stays locked while its atlas grows, so that parallel tests do not all grow it.
    type Slots = HashMap<PathBuf, Arc<Mutex<Option<Arc<Atlas>>>>>;
    static READ: LazyLock<Mutex<Slots>> = LazyLock::new(Mutex::default);

    let object = &object(object_name).expect("the object is built in").prepared;
    let folder = AtlasFolder::in_target();
    let mut slots = READ.lock().unwrap_or_else(PoisonError::into_inner);
    let slot = Arc::clone(slots.entry(folder.file(object, rig)).or_default());
    drop(slots);
    let mut atlas = slot.lock().unwrap_or_else(PoisonError::into_inner);
    let atlas = atlas.get_or_insert_with(|| {
        let kept = AtlasFolder::new(Path::new(env!("CARGO_MANIFEST_DIR")).join("complete"));
        match read(&kept.file(object, rig), object, rig) {
            Ok(Some(kept)) => return kept.atlas,
            Ok(None) => folder.complete(object, rig),
            Err(error) => Err(error),
        }
        .unwrap_or_else(|error| panic!("no atlas of {object_name}: {error:?}"))
    });
    Arc::clone(atlas)
}

/// A folder of atlases, each named by the key of what it was grown from. A server accepts it as `atlas_directory`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AtlasFolder(PathBuf);

/// The folder cannot be read or written.
#[derive(Debug, thiserror::Error)]
#[error("cannot {action} {}", path.display())]
pub struct AtlasFolderError {
    /// "read", "create" or "write".
    action: &'static str,
    path: PathBuf,
    source: io::Error,
}

impl AtlasFolder {
    /// A folder, which is created when an atlas is first saved.
    pub fn new(path: impl Into<PathBuf>) -> Self {
        Self(path.into())
    }

    /// `atlases` in Cargo's target folder, which all tests and benches of a checkout share.
    pub fn in_target() -> Self {
        let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let target = env::var_os("CARGO_TARGET_DIR").unwrap_or_else(|| OsString::from("target"));
        Self(workspace.join(target).join("atlases"))
    }

    /// Where the folder is.
    pub fn path(&self) -> &Path {
        &self.0
    }

    /// The file of an object's and a hand's atlas.
    pub fn file(&self, object: &GraspObject, rig: &Rig) -> PathBuf {
        self.0.join(file_name(object, rig))
    }

    /// The complete atlas of an object and a hand. If the folder has none, it is grown first, which takes some twenty seconds.
    ///
    /// # Errors
    /// The folder cannot be read or written.
    pub fn complete(
        &self,
        object: &PreparedObject,
        rig: &PreparedRig,
    ) -> Result<Arc<Atlas>, AtlasFolderError> {
        let path = self.file(object, rig);
        let mut growth = match read(&path, object, rig)? {
            Some(known) if known.atlas.is_complete() => return Ok(known.atlas),
            Some(known) => Growth::resume(object, rig, &known),
            None => Growth::new(object, rig),
        };
        let mut gripper = Gripper::default();
        let mut saved = Instant::now();
        while !growth.is_complete() {
            growth.round(&mut gripper);
            if saved.elapsed() >= SAVE_INTERVAL {
                write(&path, object, rig, &growth.grown())?;
                saved = Instant::now();
            }
        }
        let grown = growth.grown();
        write(&path, object, rig, &grown)?;
        Ok(grown.atlas)
    }
}

/// What a file holds; `None` if there is no file, or one of another version, which is then replaced.
fn read(path: &Path, object: &GraspObject, rig: &Rig) -> Result<Option<Grown>, AtlasFolderError> {
    match fs::read(path) {
        Ok(bytes) => Ok(decode(&bytes, object, rig).ok()),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(failed_to("read", path)(error)),
    }
}

/// Writes an atlas to a temporary file and renames it, so that no reader sees half of one. A server that is given the folder
/// removes such files if a crash leaves them, so they are named as it names its own.
fn write(path: &Path, object: &GraspObject, rig: &Rig, grown: &Grown) -> Result<(), AtlasFolderError> {
    /// Number of the next file, unique in this process.
    static NEXT: AtomicU64 = AtomicU64::new(0);
    let parent = path.parent().unwrap_or(Path::new(""));
    fs::create_dir_all(parent).map_err(failed_to("create", parent))?;
    let number = NEXT.fetch_add(1, Ordering::Relaxed);
    let unfinished = path.with_extension(format!("{}-{number}.part", std::process::id()));
    fs::write(&unfinished, encode(grown, object, rig))
        .and_then(|()| fs::rename(&unfinished, path))
        .map_err(failed_to("write", path))
}

fn failed_to(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> AtlasFolderError {
    let path = path.to_owned();
    move |source| AtlasFolderError { action, path, source }
}
