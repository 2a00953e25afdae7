//! `grasp rigs`

use std::{fmt::Write as _, path::PathBuf};

use clap::{Args, Subcommand};
use grasp_client::{Handedness, v1};
use serde_json::json;

use crate::{
    Failure, Output, ServerOptions,
    input::{HANDS, full_name, id_from_file, one_of, read_file},
    output::{pairs, table, warnings, yes_or_no},
};

/// List, show, create and delete rigs of hands.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    server: ServerOptions,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// List all rigs of the server.
    ///
    /// With --json: {"rigs": […]}, each like the output of `grasp rigs get --json`.
    List,
    /// Show everything about a rig except its model.
    ///
    /// With --json: the API's `HandRig` in protobuf's JSON.
    Get {
        /// The rig's name: "my-hand" or "rigs/my-hand".
        name: String,
    },
    Create(CreateArguments),
    /// Delete a created rig.
    ///
    /// With --json: {"deleted": "rigs/…"}.
    Delete {
        /// The rig's name: "my-hand" or "rigs/my-hand".
        name: String,
    },
}

/// Create a rig from a GLB, glTF or VRM file with a skinned hand or a whole character.
///
/// Shows the new rig, like `grasp rigs get`.
#[derive(Args, Debug)]
struct CreateArguments {
    /// Last part of the rig's name. Default: the file's name in lower case, with hyphens.
    id: Option<String>,
    /// The model.
    #[arg(long, value_name = "FILE")]
    model: PathBuf,
    /// The hand that the model shows, if the names of its nodes do not say.
    #[arg(long, value_name = "HAND", value_parser = one_of(HANDS))]
    hand: Option<Handedness>,
    /// The model of the other hand, if each hand has a file.
    #[arg(long, value_name = "FILE")]
    other_model: Option<PathBuf>,
    /// Factor on measured widths: 0.5 to 2.
    #[arg(long, value_name = "FACTOR")]
    width_scale: Option<f32>,
    /// A joint's distance from the skin in metres, such as index-finger-tip=0.008, instead of the measured one; may be repeated.
    #[arg(long, value_name = "JOINT=METRES", value_parser = parse_radius)]
    radius: Vec<(String, f32)>,
    /// A node with an unrecognised name and its joint, such as Bone.012=index-finger-phalanx-proximal; may be repeated. Joints
    /// have the names of the web's hand input module.
    #[arg(long, value_name = "NODE=JOINT", value_parser = parse_joint)]
    joint: Vec<(String, String)>,
}

pub(crate) async fn run(Arguments { command, server }: Arguments, output: Output) -> Result<(), Failure> {
    match command {
        Command::List => {
            let page = v1::ListRigsResponse {
                rigs: server.connect().await?.list_rigs().await?,
                ..v1::ListRigsResponse::default()
            };
            output.write_message(&page, |page| listed(&page.rigs))
        }
        Command::Get { name } => {
            let rig = server.connect().await?.get_rig(full_name("rigs", &name)).await?;
            output.write_message(&rig, describe)
        }
        Command::Create(arguments) => create(arguments, &server, output).await,
        Command::Delete { name } => {
            let name = full_name("rigs", &name);
            server.connect().await?.delete_rig(&name).await?;
            output.write(&json!({ "deleted": name }), |_| format!("deleted {name}"))
        }
    }
}

async fn create(arguments: CreateArguments, server: &ServerOptions, output: Output) -> Result<(), Failure> {
    let files = std::iter::once(&arguments.model).chain(&arguments.other_model);
    let joints = arguments.joint.into_iter().map(|(node, joint)| v1::RigNode {
        node,
        joint,
        ..v1::RigNode::default()
    });
    let request = v1::CreateRigRequest {
        models: files.map(|file| read_file(file)).collect::<Result<_, _>>()?,
        joint_map: joints.collect(),
        handedness: arguments.hand.unwrap_or_default().into(),
        width_scale: arguments.width_scale,
        radii: arguments.radius.into_iter().collect(),
        rig_id: arguments.id.unwrap_or_else(|| id_from_file(&arguments.model)),
        ..v1::CreateRigRequest::default()
    };
    let rig = server.connect().await?.create_rig(&request).await?;
    output.write_message(&rig, describe)
}

/// The node and the joint of NODE=JOINT; a node's name may contain "=".
fn parse_joint(text: &str) -> Result<(String, String), String> {
    let parts = text.rsplit_once('=');
    let parts = parts.filter(|(node, joint)| !node.is_empty() && !joint.is_empty());
    let parts = parts.map(|(node, joint)| (node.to_owned(), joint.to_owned()));
    parts.ok_or_else(|| "must be NODE=JOINT".to_owned())
}

/// The joint and the metres of JOINT=METRES.
fn parse_radius(text: &str) -> Result<(String, f32), String> {
    let wrong = || "must be JOINT=METRES".to_owned();
    let (joint, metres) = parse_joint(text).map_err(|_| wrong())?;
    Ok((joint, metres.parse().map_err(|_| wrong())?))
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

/// Number of digits of each hand; a single number if all are equal.
fn digits(hands: &[v1::RigHand]) -> String {
    let mut counts: Vec<String> = hands.iter().map(|hand| hand.limits.len().to_string()).collect();
    counts.dedup();
    counts.join(" and ")
}

/// Length from the wrist to the tip of the longest stretched finger, in millimetres.
fn length(hand: &v1::RigHand) -> String {
    const TIPS: [usize; 4] = [10, 15, 20, 25];
    // Joints are in the wrist's frame; those of missing fingers are empty.
    let at = |joint: usize| hand.stretched_joints.get(joint).map(v1::JointPose::position);
    let lengths = TIPS.map(|tip| at(tip).unwrap_or_default().length());
    format!("{:.0} mm", 1000.0 * lengths.into_iter().fold(0.0, f32::max))
}

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
    lines.extend(warnings(&rig.warnings));
    pairs(&lines)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_joint_follows_the_last_equals_sign() {
        let pair = |node: &str, joint: &str| Ok((node.to_owned(), joint.to_owned()));
        assert_eq!(parse_joint("Bone.1=wrist"), pair("Bone.1", "wrist"));
        assert_eq!(parse_joint("a=b=wrist"), pair("a=b", "wrist"));
        assert!(parse_joint("wrist").is_err() && parse_joint("=wrist").is_err());
        assert_eq!(parse_radius("palm=0.01"), Ok(("palm".to_owned(), 0.01)));
        assert!(parse_radius("palm=thick").is_err() && parse_radius("0.01").is_err());
    }
}
