//! `grasp rigs create`

use std::path::PathBuf;

use clap::Args;
use grasp_client::{Handedness, v1};

use crate::{
    Failure, Output, ServerOptions,
    input::read_file,
    objects::id_from_file,
    values::{HANDS, one_of},
};

/// Create a rig from a GLB, glTF or VRM file with a skinned hand or a whole character.
///
/// Shows the new rig, like `grasp rigs get`.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
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
    /// What measured widths are multiplied by: 0.5 to 2.
    #[arg(long, value_name = "FACTOR")]
    width_scale: Option<f32>,
    /// A joint's distance from the skin in metres, such as index-finger-tip=0.008, instead of the measured one; may be repeated.
    #[arg(long, value_name = "JOINT=METRES", value_parser = parse_radius)]
    radius: Vec<(String, f32)>,
    /// A node and the joint that it is, such as Bone.012=index-finger-phalanx-proximal, for names that are not known; may be
    /// repeated. Joints have the names of the web's hand input module.
    #[arg(long, value_name = "NODE=JOINT", value_parser = parse_joint)]
    joint: Vec<(String, String)>,
    #[command(flatten)]
    server: ServerOptions,
}

pub(super) async fn run(arguments: Arguments, output: Output) -> Result<(), Failure> {
    let files = std::iter::once(&arguments.model).chain(&arguments.other_model);
    let joints = arguments.joint.into_iter();
    let request = v1::CreateRigRequest {
        models: files.map(|file| read_file(file)).collect::<Result<_, _>>()?,
        joint_map: joints
            .map(|(node, joint)| v1::RigNode {
                node,
                joint,
                ..v1::RigNode::default()
            })
            .collect(),
        handedness: arguments.hand.unwrap_or_default().into(),
        width_scale: arguments.width_scale,
        radii: arguments.radius.into_iter().collect(),
        rig_id: arguments.id.unwrap_or_else(|| id_from_file(&arguments.model)),
        ..v1::CreateRigRequest::default()
    };
    let rig = arguments.server.connect().await?.create_rig(&request).await?;
    output.write_message(&rig, super::describe)
}

/// The node and the joint of NODE=JOINT; names of nodes may contain the sign.
fn parse_joint(text: &str) -> Result<(String, String), String> {
    text.rsplit_once('=')
        .filter(|(node, joint)| !node.is_empty() && !joint.is_empty())
        .map(|(node, joint)| (node.to_owned(), joint.to_owned()))
        .ok_or_else(|| "must be NODE=JOINT".to_owned())
}

/// The joint and the metres of JOINT=METRES.
fn parse_radius(text: &str) -> Result<(String, f32), String> {
    let pair = text.rsplit_once('=').filter(|(joint, _)| !joint.is_empty());
    pair.and_then(|(joint, metres)| Some((joint.to_owned(), metres.parse().ok()?)))
        .ok_or_else(|| "must be JOINT=METRES".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_joint_follows_the_last_sign() {
        let pair = |node: &str, joint: &str| Ok((node.to_owned(), joint.to_owned()));
        assert_eq!(parse_joint("Bone.1=wrist"), pair("Bone.1", "wrist"));
        assert_eq!(parse_joint("a=b=wrist"), pair("a=b", "wrist"));
        assert!(parse_joint("wrist").is_err() && parse_joint("=wrist").is_err());
        assert_eq!(parse_radius("palm=0.01"), Ok(("palm".to_owned(), 0.01)));
        assert!(parse_radius("palm=thick").is_err() && parse_radius("0.01").is_err());
    }
}
