//! `grasp rigs`

mod create;

use std::fmt::Write as _;

use clap::{Args, Subcommand};
use grasp_client::{Handedness, v1};
use serde_json::json;

use crate::{
    Failure, Output, ServerOptions,
    format::yes_or_no,
    output::{pairs, table},
    values::full_name,
};

/// List, show, create and delete rigs of hands.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// List all rigs of the server.
    ///
    /// With --json: {"rigs": […]}, each like the output of `grasp rigs get --json`.
    List(ServerOptions),
    /// Show everything about a rig except its model.
    ///
    /// With --json: the API's `HandRig` in protobuf's JSON.
    Get(Named),
    Create(create::Arguments),
    /// Delete a created rig.
    ///
    /// With --json: {"deleted": "rigs/…"}.
    Delete(Named),
}

#[derive(Args, Debug)]
pub(crate) struct Named {
    /// The rig's name: "my-hand" or "rigs/my-hand".
    name: String,
    #[command(flatten)]
    server: ServerOptions,
}

pub(crate) async fn run(command: Command, output: Output) -> Result<(), Failure> {
    match command {
        Command::List(server) => {
            let rigs = server.connect().await?.list_rigs().await?;
            let page = v1::ListRigsResponse {
                rigs,
                ..v1::ListRigsResponse::default()
            };
            output.write_message(&page, |page| listed(&page.rigs))
        }
        Command::Get(Named { name, server }) => {
            let client = server.connect().await?;
            let rig = client.get_rig(full_name("rigs", &name)).await?;
            output.write_message(&rig, describe)
        }
        Command::Create(arguments) => create::run(arguments, output).await,
        Command::Delete(Named { name, server }) => {
            let name = full_name("rigs", &name);
            server.connect().await?.delete_rig(&name).await?;
            output.write(&json!({ "deleted": name }), |_| format!("deleted {name}"))
        }
    }
}

fn listed(rigs: &[v1::HandRig]) -> String {
    let mut table = table("rig | >left | >right | >digits | built in | model | warnings");
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
            yes_or_no(rig.built_in),
            yes_or_no(rig.hands.iter().any(|hand| !hand.nodes.is_empty())),
            rig.warnings.len().to_string(),
        ]);
    }
    table.to_string()
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
    let mut lines = vec![("name", rig.name.clone()), ("built in", yes_or_no(rig.built_in))];
    for hand in &rig.hands {
        let mut text = length(hand);
        if hand.limits.len() < 5 {
            let _ = write!(text, ", {} digits", hand.limits.len());
        }
        if hand.mirrored {
            text.push_str(", the other hand mirrored");
        }
        if let Some((root, below)) = hand.nodes.split_first() {
            let _ = write!(text, ", {} nodes below {:?}", below.len(), root.node);
        }
        let side = match hand.handedness() {
            Handedness::Left => "left hand",
            Handedness::Right | Handedness::Unspecified => "right hand",
        };
        lines.push((side, text));
    }
    lines.extend(rig.warnings.iter().map(|warning| ("warning", warning.clone())));
    pairs(&lines)
}
