//! The files behind the holdouts: `holds.toml`, `genholds.toml`, and the record of the last search.

use std::{fs, io, path::PathBuf};

use glam::Quat;
use serde::{Deserialize, Serialize, de::DeserializeOwned};

use super::{grasp_template::GraspTemplate, posing::Intent};

/// The folder of the files.
const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/holdouts");

/// A Hold: what it is, how it is turned, and the hand.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct HoldSpec {
    /// The holdout's name.
    pub(crate) name: String,
    /// The object's name.
    pub(crate) object: String,
    /// The grasp type, as in the thesis' caption.
    pub(crate) grasp_type: String,
    /// The object's direction that points to the receiver.
    pub(crate) receiver: [f32; 3],
    /// The object's direction that points up, as far as `receiver` allows.
    pub(crate) up: [f32; 3],
    /// The hand.
    #[serde(flatten)]
    pub(crate) intent: Intent,
}

/// A synthesized holdout that the search looks for.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct Target {
    /// The holdout's name.
    pub(crate) name: String,
    /// The object's name.
    pub(crate) object: String,
    /// The grasp type, as in the thesis' caption.
    pub(crate) grasp_type: String,
    /// The object's direction that should point to the receiver; by default, toward the part that the hand leaves free.
    pub(crate) offered: Option<[f32; 3]>,
    /// How it looks.
    #[serde(flatten)]
    pub(crate) template: GraspTemplate,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Holds {
    hold: Vec<HoldSpec>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct GenHolds {
    genhold: Vec<Target>,
}

/// A grasp of the synthesis that was chosen as a holdout.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Selected {
    /// The holdout's name.
    pub(crate) name: String,
    /// The seed of the search.
    pub(crate) seed: u64,
    /// The index of the attempt.
    pub(crate) attempt: u64,
    /// The object's orientation in the world, from which gravity follows.
    pub(crate) world_from_object: Quat,
}

/// The record of a search.
#[derive(Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct Selection {
    selected: Vec<Selected>,
}

/// The six Holds.
pub(crate) fn hold_specs() -> Vec<HoldSpec> {
    read::<Holds>("holds.toml").hold
}

/// The nine synthesized holdouts.
pub(crate) fn targets() -> Vec<Target> {
    read::<GenHolds>("genholds.toml").genhold
}

/// The attempts that the last search chose.
pub(crate) fn selection() -> Vec<Selected> {
    read::<Selection>("selection.toml").selected
}

/// Records the choices of a search.
///
/// # Errors
/// The file cannot be written.
pub(crate) fn write_selection(selected: Vec<Selected>) -> io::Result<()> {
    let text = toml::to_string(&Selection { selected }).expect("a selection can be written");
    let head = "# Written by `grasp-assets-generator holdouts --search`: which attempts became holdouts.\n\n";
    fs::write(path("selection.toml"), format!("{head}{text}"))
}

fn path(file: &str) -> PathBuf {
    PathBuf::from(FOLDER).join(file)
}

/// The files are part of the generator, so an error in them is a bug.
fn read<T: DeserializeOwned>(file: &str) -> T {
    let path = path(file);
    let text = fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    toml::from_str(&text).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}
