//! Reads an atlas that is on disk or ships with the server.

use std::sync::Arc;

use grasp_assets::{atlases::shipped_atlas, hands::Hand};
use grasp_synthesis::known::{
    codec::decode,
    growth::{CHOSEN, Grown, Growth},
};

use super::{Builders, Stage, Turn, USEFUL, hand_label, plan::Plan, thread_time};
use crate::{atlas_slots::BuildState, objects::StoredObject};

/// Publishes the atlas on disk or the shipped grips, if there are any.
pub(super) fn read_turn(builders: &Builders, object: &Arc<StoredObject>, hand: &Arc<Hand>) -> Turn {
    let start = thread_time();
    let on_disk = || read_file(builders, object, hand);
    let Some(read) = shipped_grips(builders, object, hand)
        .or_else(on_disk)
        .map(Arc::new)
    else {
        return Turn::Next(Stage::Starting);
    };
    let entries = read.atlas.entries().len();
    let complete = read.atlas.is_complete();
    if !builders.publish(object, hand, read, thread_time().saturating_sub(start)) {
        return Turn::Ended(BuildState::NoRoom);
    }
    tracing::info!(object = object.name(), hand = %hand_label(hand), entries, complete, "read an atlas");
    if complete {
        Turn::Ended(BuildState::Finished)
    } else if entries >= USEFUL {
        Turn::Next(Stage::Completing)
    } else {
        Turn::Next(Stage::Starting)
    }
}

/// The atlas on disk. If another server has grown more than is kept, the file is replaced by an excerpt.
fn read_file(builders: &Builders, object: &Arc<StoredObject>, hand: &Arc<Hand>) -> Option<Grown> {
    let files = builders.files.as_ref()?;
    if !files.may_have(object, hand) {
        return None;
    }
    let prepared = builders.prepared(object)?;
    let plan = Plan::of(&prepared, hand);
    let read = files.read(object, &prepared, &plan.grows)?;
    if !read.atlas.is_complete() || read.atlas.entries().len() <= CHOSEN {
        return Some(plan.placed(read, &prepared, hand));
    }
    let kept = Growth::resume(&prepared, &plan.grows.rig, &read).kept();
    files.write(object, &prepared, &plan.grows, &kept);
    Some(plan.placed(kept, &prepared, hand))
}

/// The grips that ship with the server for an object and a hand: chosen from more than a server grows, hence complete.
fn shipped_grips(builders: &Builders, object: &Arc<StoredObject>, hand: &Arc<Hand>) -> Option<Grown> {
    if !object.built_in {
        return None;
    }
    let prepared = builders.prepared(object)?;
    let bytes = shipped_atlas(&object.id, &hand.rig)?;
    match decode(bytes, &prepared, &hand.rig) {
        Ok(grown) => Some(grown.completed()),
        Err(error) => {
            tracing::warn!(
                object = object.name(),
                hand = %hand_label(hand),
                %error,
                "cannot read the shipped grips"
            );
            None
        }
    }
}
