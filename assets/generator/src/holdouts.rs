//! The 15 holdouts: six Holds posed as their author describes them, nine `GenHolds` found by the synthesis.
//!
//! A normal run poses the Holds and replays the recorded attempts of the `GenHolds`; `--search` looks for better attempts
//! and records them; `--report` measures the holdouts.

mod attempt_search;
mod giver_orientation;
mod grasp_template;
mod halton;
mod hand_capsules;
mod hold_figures;
mod least_squares;
mod pictures;
mod posing;
mod report;
mod specs;

use std::{io, path::Path};

use glam::{Mat3, Quat, Vec3};
use grasp_assets::{
    hands::{Hand, hand},
    holdouts::{BuiltInHoldout, Origin},
    objects::{BuiltInObject, object},
};
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::{HandPose, Handedness},
};

use crate::AssetFile;
use specs::{HoldSpec, Selected, Target, hold_specs, selection, targets, write_selection};

/// The rig of every giver: in the thesis, givers and receivers have the same hand.
const GIVER_RIG: &str = "thesis";

/// Every giver uses the right hand.
const GIVER_HANDEDNESS: Handedness = Handedness::Right;

/// The holdouts' files.
pub(crate) fn generate() -> Vec<AssetFile> {
    make("")
        .iter()
        .map(|holdout| {
            let mut text = serde_json::to_string_pretty(holdout).expect("holdouts can be written");
            text.push('\n');
            (format!("holdouts/{}.json", holdout.name), text.into_bytes())
        })
        .collect()
}

/// The holdouts whose names contain `only`, sorted by name.
fn make(only: &str) -> Vec<BuiltInHoldout> {
    let giver = giver();
    let specs = hold_specs().into_iter().filter(|spec| spec.name.contains(only));
    let mut holdouts: Vec<BuiltInHoldout> = specs.map(|spec| posed(giver, &spec)).collect();
    let targets = targets();
    let selected = selection()
        .into_iter()
        .filter(|selected| selected.name.contains(only));
    holdouts.extend(selected.map(|selected| replayed(giver, &targets, &selected)));
    holdouts.sort_by(|a, b| a.name.cmp(&b.name));
    holdouts
}

/// Searches for the `GenHolds` whose names contain `only` with `seeds` seeds, and records the best attempts.
///
/// # Errors
/// The record cannot be written.
pub(crate) fn search(seeds: u64, only: &str) -> io::Result<()> {
    let mut selection = selection();
    for found in attempt_search::search(giver(), &targets(), seeds, only) {
        selection.retain(|old| old.name != found.name);
        selection.push(found);
    }
    selection.sort_by(|a, b| a.name.cmp(&b.name));
    write_selection(selection)
}

/// Prints a table of the holdouts whose names contain `only`, as they would be made.
pub(crate) fn report(only: &str) {
    report::report(&make(only));
}

/// Draws the holdouts whose names contain `only`, as they would be made.
///
/// # Errors
/// A picture cannot be written.
pub(crate) fn pictures(folder: &Path, only: &str) -> io::Result<()> {
    pictures::pictures(&make(only), folder)
}

fn giver() -> &'static Hand {
    hand(GIVER_RIG, GIVER_HANDEDNESS).expect("the giver's rig is built in")
}

fn built_in(name: &str) -> &'static BuiltInObject {
    object(name).expect("the objects of the holdouts are built in")
}

/// A Hold.
fn posed(giver: &Hand, spec: &HoldSpec) -> BuiltInHoldout {
    let surface = &built_in(&spec.object).object.surface;
    let (pose, _) = posing::pose_hand(giver, surface, &spec.intent);
    let z = Vec3::from(spec.receiver).normalize_or(Vec3::Z);
    let y = Vec3::from(spec.up);
    let y = (y - z * y.dot(z)).normalize_or(Vec3::Y);
    let object_from_world = Quat::from_mat3(&Mat3::from_cols(y.cross(z), y, z)).normalize();
    in_world(
        &spec.name,
        &spec.object,
        &spec.grasp_type,
        Origin::Manual,
        object_from_world.conjugate(),
        &pose,
    )
}

/// A synthesized holdout.
fn replayed(giver: &Hand, targets: &[Target], selected: &Selected) -> BuiltInHoldout {
    let target = targets
        .iter()
        .find(|target| target.name == selected.name)
        .expect("every selected holdout is a target");
    let up = selected.world_from_object.conjugate() * Vec3::Y;
    let grasp = attempt_search::replay(
        &attempt_search::single_thread(),
        &built_in(&target.object).prepared,
        &giver.rig,
        up,
        selected.seed,
        selected.attempt,
    )
    .unwrap_or_else(|| {
        panic!(
            "{}: attempt {} of seed {} is no longer valid; run `holdouts --search`",
            selected.name, selected.attempt, selected.seed
        )
    });
    let origin = Origin::Synthesized {
        seed: selected.seed,
        attempt: selected.attempt,
        strategy: attempt_search::STRATEGY,
        bend_ratios: attempt_search::BEND_RATIOS,
        friction: attempt_search::FRICTION,
        up,
    };
    in_world(
        &target.name,
        &target.object,
        &target.grasp_type,
        origin,
        selected.world_from_object,
        &grasp.pose,
    )
}

/// A holdout of a hand in the object's frame; the object's box is centred in the world.
fn in_world(
    name: &str,
    object: &str,
    grasp_type: &str,
    origin: Origin,
    world_from_object: Quat,
    pose: &HandPose,
) -> BuiltInHoldout {
    let centre = built_in(object).object.bounding_box.object_from_box.position;
    let world_from_object = Pose::new(-(world_from_object * centre), world_from_object);
    BuiltInHoldout {
        name: name.to_owned(),
        object: object.to_owned(),
        grasp_type: grasp_type.to_owned(),
        origin,
        world_from_object,
        giver_rig: GIVER_RIG.to_owned(),
        giver_handedness: GIVER_HANDEDNESS,
        world_from_giver_wrist: world_from_object * pose.frame_from_wrist,
        giver_digits: pose.digits,
    }
}
