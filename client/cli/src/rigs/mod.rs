//! `grasp rigs`

mod create;

use std::fmt::Write as _;

use clap::{Args, Subcommand};
use grasp_client::{Handedness, v1};
use serde::Serialize;

use crate::{
    Ending,
    failure::Failure,
    output::{Output, pairs, table},
    server_options::ServerOptions,
};

const ABOUT: &str = r"Show everything about a rig except its model.

With --json: the API's HandRig in protobuf's JSON.";

/// List, show, create and delete rigs of hands.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    List(List),
    Get(Named),
    Create(create::Arguments),
    Delete(Delete),
}

/// List all rigs of the server.
///
/// With --json: {"rigs": […]}, each like the output of `grasp rigs get --json`.
#[derive(Args, Debug)]
pub(crate) struct List {
    #[command(flatten)]
    server: ServerOptions,
}

/// Show everything about a rig except its model.
#[derive(Args, Debug)]
#[command(long_about = ABOUT)]
pub(crate) struct Named {
    /// The rig's name: "my-hand" or "rigs/my-hand".
    name: String,
    #[command(flatten)]
    server: ServerOptions,
}

/// Delete a created rig.
///
/// With --json: {"deleted": "rigs/…"}.
#[derive(Args, Debug)]
pub(crate) struct Delete {
    #[command(flatten)]
    rig: Named,
}

#[derive(Serialize)]
struct Deleted {
    deleted: String,
}

pub(crate) async fn run(command: Command, output: Output) -> Result<Ending, Failure> {
    match command {
        Command::List(arguments) => {
            let rigs = arguments.server.connect().await?.list_rigs().await?;
            let page = v1::ListRigsResponse {
                rigs,
                ..v1::ListRigsResponse::default()
            };
            output.write_message(&page, |page| listed(&page.rigs))?;
        }
        Command::Get(arguments) => {
            let client = arguments.server.connect().await?;
            let rig = client.get_rig(full_name(&arguments.name)).await?;
            output.write_message(&rig, describe)?;
        }
        Command::Create(arguments) => create::run(arguments, output).await?,
        Command::Delete(Delete { rig }) => {
            let deleted = full_name(&rig.name);
            rig.server.connect().await?.delete_rig(&deleted).await?;
            output.write(&Deleted { deleted }, |answer| {
                format!("deleted {}", answer.deleted)
            })?;
        }
    }
    Ok(Ending::Done)
}

/// The full name of a rig; "my-hand" is short for "rigs/my-hand".
pub(crate) fn full_name(name: &str) -> String {
    if name.starts_with("rigs/") {
        name.to_owned()
    } else {
        format!("rigs/{name}")
    }
}

fn listed(rigs: &[v1::HandRig]) -> String {
    let mut table = table(&[
        "rig", ">left", ">right", ">digits", "built in", "model", "warnings",
    ]);
    for rig in rigs {
        let length_of = |side| {
            let hand = rig.hands.iter().find(|hand| hand.handedness() == side);
            hand.map(length).unwrap_or_default()
        };
        table.add_row([
            rig.name.clone(),
            length_of(Handedness::Left),
            length_of(Handedness::Right),
            digits(&rig.hands),
            yes(rig.built_in).to_owned(),
            yes(rig.hands.iter().any(|hand| !hand.nodes.is_empty())).to_owned(),
            rig.warnings.len().to_string(),
        ]);
    }
    table.to_string()
}

fn yes(is_so: bool) -> &'static str {
    if is_so { "yes" } else { "no" }
}

/// How many digits the hands have: one number if it is the same.
fn digits(hands: &[v1::RigHand]) -> String {
    let mut counts: Vec<String> = hands.iter().map(|hand| hand.limits.len().to_string()).collect();
    counts.dedup();
    counts.join(" and ")
}

/// From the wrist to the tip of the longest finger, stretched, in millimetres.
fn length(hand: &v1::RigHand) -> String {
    const TIPS: [usize; 4] = [10, 15, 20, 25];
    // Joints are in the wrist's frame; those of missing fingers are empty.
    let at = |joint: usize| hand.stretched_joints.get(joint).map(v1::JointPose::position);
    let lengths = TIPS.map(|tip| at(tip).unwrap_or_default().length());
    format!("{:.0} mm", 1000.0 * lengths.into_iter().fold(0.0, f32::max))
}

/// Everything about a rig, for people.
fn describe(rig: &v1::HandRig) -> String {
    let mut lines = vec![
        ("name", rig.name.clone()),
        ("built in", yes(rig.built_in).to_owned()),
    ];
    for hand in &rig.hands {
        let mut text = length(hand);
        if hand.limits.len() < 5 {
            // Writing to a string cannot fail.
            let _ = write!(text, ", {} digits", hand.limits.len());
        }
        if hand.mirrored {
            text.push_str(", the other hand mirrored");
        }
        if let Some((root, below)) = hand.nodes.split_first() {
            // Writing to a string cannot fail.
            let _ = write!(text, ", {} nodes below {:?}", below.len(), root.node);
        }
        lines.push((
            match hand.handedness() {
                Handedness::Left => "left hand",
                Handedness::Right | Handedness::Unspecified => "right hand",
            },
            text,
        ));
    }
    lines.extend(rig.warnings.iter().map(|warning| ("warning", warning.clone())));
    pairs(&lines)
}
